"""Solve a contact problem: discretise, solve the algebraic inequality, wrap the answer, prove what is impossible.

Far obstacles: obstacles beyond `Scales.reach` are first moved to that distance. If the body presses on one of them, by
a pressure above the certificate's tolerance, the problem is solved again with all obstacles at their true distance.
Multipliers would be a weaker test of contact: where rows are dependent single multipliers may be zero.

Loads that cannot be carried: the problem of a mesh may be infeasible although the body carries the load. Shortly before
a body slides or tips, tractions concentrate in corners, where the stresses of a mesh cannot follow them. So a status
"infeasible" must be proved for the body, by a mechanism, see `mechanism`. Conversely the answer of a mesh obeys a
contact law at points, or in its coefficients, but may exceed it between points. If μ and c are constant and there is no
cap, the rows of an edge still integrate the contact's work on rigid motions exactly, so that it stays within the law.
Otherwise a load beyond the limit of the body may look carried.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

import numpy as np

from qvi_contact import __version__
from qvi_contact.basics.checks import FloatArray
from qvi_contact.discretization.discretization import Discretization, discretize
from qvi_contact.discretization.loads import joined
from qvi_contact.discretization.space import FAMILY
from qvi_contact.errors import InputError, SolveError
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.settings import Settings, pressures
from solvers import QVISolution, Status
from solvers.basics.progress import Log, Progress, deadline, report
from solvers.errors import counted
from solvers.solution import Attempt, Start
from solvers.solve import facts_of
from solvers.solve import solved as solve_checked

_MANY_CELLS = 20_000  # number of cells from which on discretising takes seconds and is reported
_LINEAR = 2  # number of coefficients of a linear function on an edge
FAR_OBSTACLES: Final = Attempt("far obstacles", "the body presses on an obstacle moved nearer", Status.SOLVED, 0)
"""A change of the problem, with the reason why the solve before is not taken."""

_EXCEEDED: Final = 1e-7  # excess of friction between points over the unit of stress, above the tolerance of solves


def solve(problem: ContactProblem | Discretization, settings: Settings | None = None, **changes: Any) -> ContactResult:
    """Solve a contact problem and certify the answer.

    Parameters
    ----------
    problem : ContactProblem or Discretization
        The problem; a discretisation is used as it is, so that several methods can share one.
    settings : Settings, optional
        How to discretise and solve it.
    **changes
        Fields of `Settings`, and options of the method.

    Returns
    -------
    ContactResult
        Its status says whether the problem was solved; a failure raises only with the setting ``throw=True``. The
        status is "infeasible" only if a mechanism proves that no stress of the body carries the load
        (`ContactResult.mechanism`), and "infeasible_on_mesh" if no stress of the mesh does, but others might.

    Raises
    ------
    InputError
        If the problem or a setting is wrong.
    SolverUnavailableError
        If method or inner solver is unknown or not installed.

    """
    if not isinstance(problem, (ContactProblem, Discretization)):
        raise InputError("problem", problem, "give a ContactProblem or a Discretization")
    settings = Settings.of(settings, changes)
    if isinstance(problem, Discretization):
        for option, value in (("degree", settings.degree), ("law_on", settings.law_on)):
            if value is not None:
                raise InputError(option, value, "belongs to discretize: this problem is discretised already")
    with deadline(settings.time_limit):
        return solved(problem, settings)


def solved(
    problem: ContactProblem | Discretization, settings: Settings, before: ContactResult | None = None
) -> ContactResult:
    """`solve` with checked settings and the deadline of the caller; `before` replaces `settings.initial`."""
    with Log(f"qvi_contact {__version__}: solve", settings.verbose) as log:
        if isinstance(problem, ContactProblem):
            if problem.mesh.cell_count >= _MANY_CELLS:
                report(Progress("mesh", stage=f"discretising {problem.mesh.cell_count} cells"))
            current = discretize(problem, degree=settings.degree, law_on=settings.law)
        else:
            current = problem
        rule = current.rule
        if settings.chosen == "uzawa" and rule.law_on == "edges" and rule.count > _LINEAR:
            remedy = (
                "Uzawa's steps do not settle on Bernstein coefficients of degree 2 and more, which may vanish "
                "where the shear does not: leave law_on out, or give 'points'"
            )
            raise InputError("law_on", rule.law_on, remedy)
        element = f"{FAMILY} of degree {current.space.degree}, contact law on {rule.law_on}"
        cells = current.problem.mesh.cell_count
        log.begin({"cells": cells, "element": element, **facts_of(current.qvi, settings)})
        initial = settings.initial if before is None else before
        start = None if initial is None else _initial(initial, current)
        solution = solve_checked(current.qvi, settings, start)
        if _reached(current, solution):
            attempts, current = (*solution.attempts, FAR_OBSTACLES), current.with_far_obstacles()
            solution = solve_checked(current.qvi, settings, start)
            solution = replace(solution, attempts=(*attempts, *solution.attempts))
        result = _with_proof(ContactResult(current, solution))
        log.end(str(result.status), result.message, result.solution.timings, result.status is Status.SOLVED)
    if settings.throw and result.status is not Status.SOLVED:
        raise SolveError(result.message)
    return result


def _reached(discretization: Discretization, solution: QVISolution) -> bool:
    """Whether the body presses on an obstacle that was moved nearer."""
    is_moved = joined([rows.beyond for rows in discretization.contacts if rows.law != "tied"]) > 0.0
    certificate = solution.certificate
    if not is_moved.any() or not certificate.scales:  # without a state the certificate has no scales
        return False
    pressure = -solution.problem.normal(solution.z)[is_moved]
    return bool(pressure.max() > certificate.tolerance * certificate.scales["stress"])


def _initial(initial: object, discretization: Discretization) -> Start | FloatArray:
    """The dimensionless state of an earlier result; only its pressure (m,) in the rows if its unknowns differ."""
    if isinstance(initial, ContactResult):
        if not initial.has_state:
            _ = initial.dofs  # raises InputError
        one, other, solution = initial.discretization, discretization, initial.solution
        stress = one.scales.stress / other.scales.stress
        same = one.qvi.contact is other.qvi.contact or (  # same unknowns z, same rows of contacts
            one.space.degree == other.space.degree
            and one.qvi.m == other.qvi.m
            and np.array_equal(one.supports.basis.kept, other.supports.basis.kept)
            and one.problem.mesh.same_as(other.problem.mesh)
        )
        if same:
            return Start.of(solution, stress, one.scales.displacement / other.scales.displacement)
        return stress * solution.problem.pressure(solution.z)
    pressure, count = pressures(initial), discretization.qvi.m
    if pressure.shape != (count,):
        remedy = f"give a ContactResult, or pressures at all {count} contact points as an array of shape ({count},)"
        raise InputError("initial", initial, remedy)
    pressure = discretization.rule.at_rows(pressure)
    return np.asarray(np.maximum(pressure, 0.0) / discretization.scales.stress)


def _with_proof(result: ContactResult) -> ContactResult:
    """The result, with status "infeasible" if a mechanism proves it, or "infeasible_on_mesh" without a mechanism.

    A solved result is checked too if it exceeds, between the points, a contact law whose rows do not bound its work.
    No mechanism is found where the linear program fails, or functions of the problem have no values at its points.
    """
    unbounded = [
        contact.name
        for contact in result.problem.contacts
        if contact.law != "tied"
        and (callable(contact.friction) or callable(contact.cohesion) or contact.shear_limit is not None)
    ]
    largest = _EXCEEDED * result.discretization.scales.stress
    answered = result.status in (Status.SOLVED, Status.INACCURATE)
    if answered and not any(result.contacts[name].excess_between_points > largest for name in unbounded):
        return result
    from qvi_contact.mechanism import find_mechanism  # loaded only where a load may be too large

    mechanism = None
    with suppress(SolveError, InputError):
        mechanism = find_mechanism(result.problem)
    if mechanism is not None:
        drive = "the driving loads do work that nothing else takes up, however small they are"
        if mechanism.overload < float("inf"):
            drive = f"the driving loads do {mechanism.overload:.6g} times the work that everything else can take up"
        status, proof = Status.INFEASIBLE, f"proved by a mechanism of rigid blocks, on which {drive}"
    elif result.status is Status.INFEASIBLE:
        status = Status.INFEASIBLE_ON_MESH
        proof = "no traction of this mesh carries the load, proved by multipliers (Farkas) checked on the data; "
        proof += "no such proof was found for the body"
    else:
        return result
    message = f"{status.words} after {counted(result.iterations, 'iteration')}; {proof}. {status.advice}"
    proved = ContactResult(result.discretization, replace(result.solution, status=status, message=message))
    vars(proved)["mechanism"] = mechanism  # computed anew, it could miss the deadline
    return proved
