"""Solve a contact problem: discretise, solve the algebraic inequality, wrap the answer."""

from typing import Any

from qvi_contact.discretization import Discretization, discretize
from qvi_contact.problem import ContactProblem
from qvi_contact.result import ContactResult
from solvers import solve_qvi


def solve(
    problem: ContactProblem | Discretization,
    method: str = "fixed-point",
    inner: str = "qp:clarabel",
    tolerance: float = 1e-8,
    **options: Any,  # checked by the method that takes them
) -> ContactResult:
    """Solve a contact problem and certify the answer.

    Parameters
    ----------
    problem : ContactProblem or Discretization
        The problem; a discretisation is used as it is, so that several methods can share one.
    method : str
        "fixed-point" (outer iteration on the friction bound, convex inner problems) or "uzawa" (the paper's
        iteration (4.1)-(4.4)).
    inner : str
        How the fixed point solves its inner problems: "qp:<qpsolvers name>", "direct:clarabel", "direct:osqp" or
        "socp:<cvxpy name>"; `solvers.available()` lists what is installed.
    tolerance : float
        Accuracy that the certificate must confirm, dimensionless.
    **options
        Options of the method, see `solvers.solve_qvi`.

    Returns
    -------
    ContactResult
        With a status; a failure to solve does not raise unless ``throw=True`` is among the options.

    Raises
    ------
    InputError
        If the problem or an option is wrong.
    SolverUnavailableError
        If method or inner solver is unknown or not installed.

    """
    discretization = problem if isinstance(problem, Discretization) else discretize(problem)
    solution = solve_qvi(discretization.qvi, method=method, inner=inner, tolerance=tolerance, **options)
    return ContactResult(discretization, solution)
