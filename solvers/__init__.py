"""The frictional contact problem as algebra: quasi-variational inequality, methods, back ends, certificate.

    from solvers import FrictionQVI, solve_qvi
    solution = solve_qvi(FrictionQVI.from_arrays(K=K, f=f, N=N, n0=n0, T=T, t0=t0, mu=mu, W=W))
    print(solution.message)

Knows nothing of meshes or mechanics. Names, and the back ends behind them, are imported on first use.
"""

from typing import TYPE_CHECKING

from solvers.basics.front import front

if TYPE_CHECKING:
    from solvers.basics.status import Status
    from solvers.certificate.certificate import Certificate, certify
    from solvers.certificate.feasibility import Feasibility, check_feasibility
    from solvers.errors import InputError, QVIError, SolveError, SolverUnavailableError, UnknownNameError
    from solvers.inequality.body import EnergyRoot, Loads, Stiffness
    from solvers.inequality.contact import ContactMatrices
    from solvers.inequality.problem import FrictionQVI, Law
    from solvers.inequality.traces import TractionFactor
    from solvers.inner.registry import available
    from solvers.solution import Iteration, QVISolution
    from solvers.solve import solve_qvi

__all__ = [
    "Certificate", "ContactMatrices", "EnergyRoot", "Feasibility", "FrictionQVI", "InputError", "Iteration", "Law",
    "Loads", "QVIError", "QVISolution", "SolveError", "SolverUnavailableError", "Status", "Stiffness",
    "TractionFactor", "UnknownNameError", "available", "certify", "check_feasibility", "solve_qvi",
]  # fmt: skip

__getattr__ = front(
    __name__,
    {
        "basics.status": ("Status",),
        "certificate.certificate": ("Certificate", "certify"),
        "certificate.feasibility": ("Feasibility", "check_feasibility"),
        "errors": ("InputError", "QVIError", "SolveError", "SolverUnavailableError", "UnknownNameError"),
        "inequality.contact": ("ContactMatrices",),
        "inequality.problem": ("FrictionQVI", "Law"),
        "inequality.body": ("EnergyRoot", "Loads", "Stiffness"),
        "inequality.traces": ("TractionFactor",),
        "inner.registry": ("available",),
        "solution": ("Iteration", "QVISolution"),
        "solve": ("solve_qvi",),
    },
)


def __dir__() -> list[str]:
    return sorted(__all__)
