"""The frictional contact problem as algebra: quasi-variational inequality, methods, back ends, certificate.

    from solvers import FrictionQVI, solve_qvi
    solution = solve_qvi(FrictionQVI.from_arrays(K=K, f=f, N=N, n0=n0, T=T, t0=t0, mu=mu, W=W))
    print(solution.message)

Knows nothing of meshes or mechanics. Names, and the back ends behind them, are imported on first use.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from solvers.basics.status import Status
    from solvers.certificate.certificate import Certificate, certify
    from solvers.certificate.feasibility import Feasibility, check_feasibility
    from solvers.errors import InputError, QVIError, SolveError, SolverUnavailableError, UnknownNameError
    from solvers.inequality.contact import ContactMatrices
    from solvers.inequality.loads import Loads
    from solvers.inequality.problem import FrictionQVI, Law
    from solvers.inequality.stiffness import EnergyRoot, Stiffness
    from solvers.inequality.traces import TractionFactor
    from solvers.inner.registry import available
    from solvers.solution import Iteration, QVISolution
    from solvers.solve import solve_qvi

_HOME = {
    "Certificate": "certificate.certificate",
    "ContactMatrices": "inequality.contact",
    "EnergyRoot": "inequality.stiffness",
    "Feasibility": "certificate.feasibility",
    "FrictionQVI": "inequality.problem",
    "InputError": "errors",
    "Iteration": "solution",
    "Law": "inequality.problem",
    "Loads": "inequality.loads",
    "QVIError": "errors",
    "QVISolution": "solution",
    "SolveError": "errors",
    "SolverUnavailableError": "errors",
    "Status": "basics.status",
    "Stiffness": "inequality.stiffness",
    "TractionFactor": "inequality.traces",
    "UnknownNameError": "errors",
    "available": "inner.registry",
    "certify": "certificate.certificate",
    "check_feasibility": "certificate.feasibility",
    "solve_qvi": "solve",
}

__all__ = [
    "Certificate",
    "ContactMatrices",
    "EnergyRoot",
    "Feasibility",
    "FrictionQVI",
    "InputError",
    "Iteration",
    "Law",
    "Loads",
    "QVIError",
    "QVISolution",
    "SolveError",
    "SolverUnavailableError",
    "Status",
    "Stiffness",
    "TractionFactor",
    "UnknownNameError",
    "available",
    "certify",
    "check_feasibility",
    "solve_qvi",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
