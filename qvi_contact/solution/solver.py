"""Solve a contact problem: discretise, solve the algebraic inequality, wrap the answer."""

from typing import Any

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.discretization.discretization import Discretization, discretize
from qvi_contact.discretization.loads import shear_beside_contacts
from qvi_contact.errors import InputError, SolveError
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from solvers import Status, solve_qvi
from solvers.factorisation import FactorisationError

_CONDENSED_ONLY = ("gap",)  # options
_CANNOT_CARRY = (Status.INFEASIBLE, Status.INNER_INFEASIBLE, Status.BACKEND_FAILED)


def solve(
    problem: ContactProblem | Discretization,
    method: str | None = None,
    inner: str | None = None,
    tolerance: float = 1e-8,
    **options: Any,  # checked by the method that takes them
) -> ContactResult:
    """Solve a contact problem and certify the answer.

    Parameters
    ----------
    problem : ContactProblem or Discretization
        The problem; a discretisation is used as it is, so that several methods can share one.
    method : str, optional
        "condensed" (the inequality solved directly on what the contact feels, by an interior point method),
        "fixed-point" (outer iteration on the friction bound, convex inner problems) or "uzawa" (the paper's iteration
        (4.1)-(4.4)). By default "condensed", and "fixed-point" where that fails and the contact is not large; another
        one if an inner solver or options are given that only that one takes.
    inner : str, optional
        How the fixed point solves its inner problems: "qp:<qpsolvers name>", "direct:clarabel", "direct:osqp",
        "strict:<cvxpy name>" or "strict-direct:clarabel" (the contact law on whole edges, by cones), or
        "socp:<cvxpy name>"; `solvers.available()` lists what is installed. By default "qp:clarabel".
    tolerance : float
        Accuracy that the certificate must confirm, dimensionless.
    **options
        ``factorisation`` and ``threads``, and options of the method, see `solvers.solve_qvi`. ``initial``, the
        pressure the fixed point starts from, is an earlier `ContactResult` on the same contact points, such as that of
        a smaller load, or an array over all contact points [stress]; negative values count as zero.

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
    if discretization is not problem:
        name, threads = options.get("factorisation", "auto"), options.get("threads")
        with discretization.qvi.operator.using(name, threads):
            discretization = _fitted(discretization)
    throw = bool(options.pop("throw", False))
    if options.get("initial") is not None:
        options["initial"] = _initial_pressure(options["initial"], discretization)
    settings = {"method": method, "inner": inner, "tolerance": tolerance, **options}
    result = ContactResult(discretization, solve_qvi(discretization.qvi, **settings))
    if result.status is not Status.SOLVED:
        result = _with_free_corners(result, settings) or result
    if throw and result.status is not Status.SOLVED:
        raise SolveError(result.message)
    return result


def _fitted(discretization: Discretization) -> Discretization:
    """In fitting units; where K cannot be factorised the solve will say so."""
    try:
        return discretization.fitted()
    except FactorisationError:
        return discretization


def _with_free_corners(failed: ContactResult, settings: dict[str, Any]) -> ContactResult | None:
    """Solve again where a shear prescribed beside a contact with friction may be more than that carries in the corner.

    Corner and contact share one Φ_xy. It is freed, as between two prescribed shears that disagree, and the resultants
    of the edges are kept. From the pressure found so the original problem gets another try, unless it is proved to have
    no solution; else as few corners as possible are given up, and only where the original cannot be solved.
    """
    known = failed.discretization
    corners = np.array([node for node, _ in shear_beside_contacts(failed.problem)], dtype=np.int64)
    freed = np.setdiff1d(corners, np.concatenate([known.elimination.conflicts, known.freed]))
    if not len(freed):
        return None
    discretization = known.freeing(np.union1d(known.freed, freed))
    result = ContactResult(discretization, solve_qvi(discretization.qvi, **settings))
    if result.status is not Status.SOLVED:
        corners_only = failed.status is Status.INFEASIBLE and result.status is not Status.INFEASIBLE
        return result if corners_only else None
    again = settings
    if settings["method"] in (None, "fixed-point"):
        pressure = result.solution.problem.pressure(result.solution.z)
        options = {name: value for name, value in settings.items() if name not in _CONDENSED_ONLY}
        again = {**options, "method": "fixed-point", "initial": pressure}
        exact = _solved(known, again) if failed.status is not Status.INFEASIBLE else None
        if exact is not None:
            return exact
    for node in freed if len(freed) > 1 else ():
        fewer = result.discretization.freed[result.discretization.freed != node]
        result = _solved(known.freeing(fewer), again) or result
    return result if failed.status in _CANNOT_CARRY else None


def _solved(discretization: Discretization, settings: dict[str, Any]) -> ContactResult | None:
    """The result if it is solved."""
    result = ContactResult(discretization, solve_qvi(discretization.qvi, **settings))
    return result if result.status is Status.SOLVED else None


def _initial_pressure(initial: object, discretization: Discretization) -> FloatArray:
    """Dimensionless pressure at all contact points from an earlier result or physical values."""
    if isinstance(initial, ContactResult):
        _ = initial.nodal  # says what is wrong if there is no state
        solution, unit = initial.solution, initial.discretization.scales.stress
        initial = unit * solution.problem.pressure(solution.z)
    try:
        pressure = np.array(initial, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError("initial", initial, "give a ContactResult or an array of pressures") from error
    return np.asarray(np.maximum(pressure, 0.0) / discretization.scales.stress)
