"""Solve a contact problem: discretise, solve the algebraic inequality, wrap the answer."""

from typing import Any

import numpy as np

from qvi_contact.checks import FloatArray
from qvi_contact.discretization import Discretization, discretize
from qvi_contact.errors import InputError
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
        Options of the method, see `solvers.solve_qvi`. ``initial``, the pressure the fixed point starts from, is an
        earlier `ContactResult` on the same contact points, such as that of a smaller load, or an array over all
        contact points [stress]; negative values count as zero.

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
    if not isinstance(problem, (ContactProblem, Discretization)):
        raise InputError("problem", problem, "give a ContactProblem or a Discretization")
    discretization = problem if isinstance(problem, Discretization) else discretize(problem)
    if options.get("initial") is not None:
        options["initial"] = _initial_pressure(options["initial"], discretization)
    solution = solve_qvi(discretization.qvi, method=method, inner=inner, tolerance=tolerance, **options)
    return ContactResult(discretization, solution)


def _initial_pressure(initial: object, discretization: Discretization) -> FloatArray:
    """Dimensionless pressure at all contact points from an earlier result or physical values."""
    if isinstance(initial, ContactResult):
        lines = initial.contacts.values()
        initial = -np.concatenate([np.empty(0), *(line.normal_stress for line in lines)])
    try:
        pressure = np.array(initial, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError("initial", initial, "give a ContactResult or an array of pressures") from error
    return np.asarray(np.maximum(pressure, 0.0) / discretization.scales.stress)
