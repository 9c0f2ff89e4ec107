"""The frictional contact problem as algebra: quasi-variational inequality, methods, back ends, certificate.

    from solvers import FrictionQVI, solve_qvi
    solution = solve_qvi(FrictionQVI(K=K, f=f, N=N, n0=n0, T=T, t0=t0, mu=mu, W=W))
    print(solution.message)

Knows nothing of meshes or mechanics. Back ends are imported when they are used.
"""

from solvers.certificate import Certificate, certify
from solvers.errors import InputError, QVIError, SolveError, SolverUnavailableError
from solvers.feasibility import Feasibility, check_feasibility
from solvers.inner.registry import available
from solvers.problem import FrictionQVI
from solvers.solution import Iteration, QVISolution
from solvers.solve import solve_qvi
from solvers.status import Status

__all__ = [
    "Certificate",
    "Feasibility",
    "FrictionQVI",
    "InputError",
    "Iteration",
    "QVIError",
    "QVISolution",
    "SolveError",
    "SolverUnavailableError",
    "Status",
    "available",
    "certify",
    "check_feasibility",
    "solve_qvi",
]
