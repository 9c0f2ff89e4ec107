"""Solve a contact problem: discretise, solve the algebraic inequality, wrap the answer, judge what is impossible.

Obstacles out of reach: a problem is solved as if they stood nearer (`Scales.reach`), and again where they are if the
body gets there. An obstacle that was moved closer has been reached where a pressure on it is more than the certificate
would take for none. Multipliers tell less: where rows depend on each other single ones may be zero.

Loads that cannot be carried: the algebraic problem of a mesh may be infeasible although the body carries the load, as
its stresses cannot follow the tractions, which crowd in corners shortly before a body slides or tips. So the status is
decided anew, by a mechanism that proves it for the body, see `mechanism`. The other way round an answer of a mesh may
keep a contact law at its points, or by its coefficients, and exceed it between them. Where μ and c are constant and
there is no cap, the rows of an edge integrate the work of the contact against rigid motions, which stays what the law
allows. Else a load beyond the limit of the body may look carried.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, real_array
from qvi_contact.basics.retired import RETIRED, refuse_arguments
from qvi_contact.discretization.discretization import Discretization, discretize
from qvi_contact.discretization.loads import joined, laws_vary
from qvi_contact.discretization.space import FAMILY, LawOn
from qvi_contact.errors import InputError, SolveError
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from qvi_contact.version import __version__
from solvers import QVISolution, Status
from solvers.basics.checks import true_or_false
from solvers.basics.progress import Log, Progress, deadline, report
from solvers.factorisation import FactorisationError
from solvers.solution import Attempt, Start
from solvers.solve import Settings, facts_of, solved

if TYPE_CHECKING:
    from qvi_contact.mechanism import Mechanism

_MANY_CELLS = 20_000  # whose discretisation takes seconds
_LINEAR = 2  # coefficients of a linear function
UNITS: Final = Attempt("units", "stresses are far below the unit that the loads suggest", Status.STALLED, 0)
FAR_OBSTACLES: Final = Attempt("far obstacles", "the body presses on one that was taken to be nearer", Status.SOLVED, 0)
"""Changes of the problem, tried in this order; why the first solve, or the one before, is not taken."""

_ANSWERED: Final = (Status.SOLVED, Status.INACCURATE)
_EXCEEDED: Final = 1e-7  # of the unit of stress: excess between the points that is more than the tolerance of solves


def solve(
    problem: ContactProblem | Discretization,
    method: str | None = None,
    inner: str | None = None,
    tolerance: float = 1e-8,
    time_limit: float | None = None,
    *,
    degree: int | None = None,
    law_on: LawOn | None = None,
    verbose: bool = False,
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
        (4.1)-(4.4)), or "pivoting" (from vertex to vertex, for small contacts). By default "condensed"; where that
        fails "pivoting" and "fixed-point", as far as the contact is small enough for them, for as long again as the
        first took at most, or 15 seconds if that is more; another method if an inner solver or options are given that
        only that one takes.
    inner : str, optional
        How the fixed point solves its inner problems: "qp:<qpsolvers name>", "direct:clarabel" or
        "socp:<cvxpy name>"; `solvers.available()` lists what is installed. By default "qp:clarabel".
    tolerance : float
        Accuracy that the certificate must confirm, dimensionless.
    time_limit : float, optional
        Seconds for everything together: all methods, retries and inner problems. When they are over the best state so
        far is returned, with the status "time_limit" unless its certificate passes. A factorisation under way, and an
        inner solver that takes no limit, are not interrupted. A factorisation that is estimated to take more than twice
        the time left, or twice the memory of the machine, is not begun; the message has the estimate.
    degree, law_on
        Degree of the element, and what bounds tractions, see `discretize`.
    verbose : bool
        Print a header, a line an iteration (dimensionless, see `solvers.Iteration`), a footer with status and times.
    **options
        ``factorisation`` and ``threads``, and options of the method, see `solvers.solve_qvi`; ``callback`` is called
        with every `solvers.Iteration` of any method. ``initial`` is an earlier `ContactResult`, such as that of a
        smaller load: on the same mesh and element the condensed method starts from it if two iterations find it near,
        and on the same contact points the fixed point starts from its pressure. An array of pressures over all contact
        points [stress], effective where a fluid presses, is for the fixed point only; negative values count as zero.
        ``initial`` chooses no method.

    Returns
    -------
    ContactResult
        With a status; a failure to solve does not raise unless ``throw=True`` is among the options. It is "infeasible"
        only if a mechanism proves that no stress of the body carries the load (`ContactResult.mechanism`), and
        "infeasible_on_mesh" if those of the mesh cannot, but others might.

    Raises
    ------
    InputError
        If the problem or an option is wrong.
    SolverUnavailableError
        If method or inner solver is unknown or not installed.

    """
    if not isinstance(problem, (ContactProblem, Discretization)):
        raise InputError("problem", problem, "give a ContactProblem or a Discretization")
    if isinstance(problem, Discretization):
        for option, value in (("degree", degree), ("law_on", law_on)):
            if value is not None:
                raise InputError(option, value, "belongs to discretize: this problem is discretised already")
    throw = true_or_false("throw", options.pop("throw", False))
    settings = check_options({"method": method, "inner": inner, "tolerance": tolerance, **options})
    with deadline(time_limit), Log(f"qvi_contact {__version__}: solve", verbose) as log:
        chosen, units = problem, tuple[Attempt, ...]()
        if isinstance(chosen, ContactProblem):
            if chosen.mesh.cell_count >= _MANY_CELLS:
                report(Progress("mesh", stage=f"discretising {chosen.mesh.cell_count} cells"))
            given = discretize(chosen, degree=degree, law_on=rows_for(method, law_on))
            chosen = _fitted(given, settings.factorisation, settings.threads)
            units = () if chosen is given else (UNITS,)
        log.begin(_facts(chosen, settings))
        result = _judged(_solve(chosen, settings, units))
        log.end(str(result.status), result.message, result.solution.timings, result.status is Status.SOLVED)
    if throw and result.status is not Status.SOLVED:
        raise SolveError(result.message)
    return result


def check_options(options: Mapping[str, Any]) -> Settings:
    """The settings of these options of `solve`; raises what that raises for any problem, before anything is done."""
    refuse_arguments({name: value for name, value in options.items() if name in RETIRED})
    settings = Settings.of(**options)
    initial = options.get("initial")
    if initial is not None and not isinstance(initial, ContactResult):
        _ = _pressures(initial)
    return settings


def discretized(
    problem: ContactProblem,
    *,
    degree: int | None = None,
    law_on: LawOn | None = None,
    method: str | None = None,
    before: Discretization | None = None,
    **options: Any,
) -> Discretization:
    """The problem discretised in fitting units, as `solve` does it first with these options.

    `solve` takes it in place of the problem, with all options but ``degree`` and ``law_on``. What it has in common with
    a problem `before`, discretized with the same options on the same mesh, is shared; degree and rows may be left out
    then, and are those of `before`.

    Raises
    ------
    InputError
        If the problem or an option is wrong, or `before` is on another mesh, or of another degree or rows.

    """
    rows = rows_for(method, law_on)
    if before is None:
        return _fitted(discretize(problem, degree=degree, law_on=rows), **_linear(options))
    rows = "points" if rows is None and laws_vary(problem) else rows
    space = before.space
    for field, asked, found in (("degree", degree, space.degree), ("law_on", rows, before.rule.law_on)):
        if asked is not None and asked != found:
            remedy = f"the problem discretised before has {found!r}: give both the same, or leave before out"
            raise InputError(field, asked, remedy)
    return _fitted(before.with_data(problem), **_linear(options))


def _linear(options: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of `_fitted` among options of `solve`."""
    return {"factorisation": options.get("factorisation", "auto"), "threads": options.get("threads")}


def _facts(known: Discretization, settings: Settings) -> dict[str, object]:
    """What the header of a narration says."""
    space, mesh = known.space, known.problem.mesh
    element = f"{FAMILY} of degree {space.degree}, contact law on {known.rule.law_on}"
    return {"cells": mesh.cell_count, "element": element, **facts_of(known.qvi, settings)}


def rows_for(method: str | None, law_on: LawOn | None) -> LawOn | None:
    """The rows asked for, or those that the method wants; None if it takes any."""
    if law_on is None and method == "uzawa":
        return "points"  # its steps, divided by |σ_T|, are those of tractions: coefficients may vanish
    return law_on


def _solve(discretization: Discretization, settings: Settings, attempts: tuple[Attempt, ...]) -> ContactResult:
    """Solve, after these changes of the problem; again with obstacles where they stand if one moved closer is reached.

    Attempts of the result are in their order: changes of the problem, and the ways of `solvers` after each.
    """
    _check_uzawa(discretization, settings.method)
    if settings.options.get("initial") is not None:
        settings = settings.starting(_initial(settings.options["initial"], discretization))
    solution = solved(discretization.qvi, settings)
    attempts += solution.attempts
    if _reached(discretization, solution):
        discretization = discretization.with_far_obstacles()
        solution = solved(discretization.qvi, settings)
        attempts += (FAR_OBSTACLES, *solution.attempts)
    return ContactResult(discretization, replace(solution, attempts=attempts))


def _reached(discretization: Discretization, solution: QVISolution) -> bool:
    """Whether the body presses on an obstacle that stands farther away than it was taken to be."""
    moved = joined([rows.beyond for rows in discretization.contacts if rows.law != "tied"]) > 0.0
    certificate = solution.certificate
    if not moved.any() or not certificate.scales:  # nothing was measured, as there is no state
        return False
    pressure = -solution.problem.normal(solution.z)[moved]
    return bool(pressure.max() > certificate.tolerance * certificate.scales["stress"])


def _check_uzawa(discretization: Discretization, method: str | None) -> None:
    """Uzawa runs on coefficients of linear tractions, of higher degree it only runs on."""
    rule = discretization.rule
    if method == "uzawa" and rule.law_on == "edges" and rule.count > _LINEAR:
        remedy = (
            "Uzawa's steps do not settle on Bernstein coefficients of degree 2 and more, which may vanish where the "
            "shear does not: leave law_on out, or give 'points'"
        )
        raise InputError("law_on", rule.law_on, remedy)


def _fitted(discretization: Discretization, factorisation: str, threads: int | None) -> Discretization:
    """In fitting units; where K cannot be factorised the solve will say so."""
    with discretization.qvi.stiffness.using(factorisation, threads):
        try:
            return discretization.rescaled()
        except FactorisationError:
            return discretization


def _initial(initial: object, discretization: Discretization) -> Start | FloatArray:
    """Dimensionless state of an earlier result, or where its unknowns are others the pressure in all contact rows."""
    if isinstance(initial, ContactResult):
        _ = initial.dofs  # says what is wrong if there is no state
        before, scales = initial.discretization.scales, discretization.scales
        start = Start.of(initial.solution, before.stress / scales.stress, before.displacement / scales.displacement)
        return start if _same_unknowns(initial.discretization, discretization) else start.pressure
    pressure, count = _pressures(initial), discretization.qvi.m
    if pressure.shape != (count,):
        remedy = f"give a ContactResult, or pressures at all {count} contact points as an array of shape ({count},)"
        raise InputError("initial", initial, remedy)
    pressure = discretization.rule.at_rows(pressure)
    return np.asarray(np.maximum(pressure, 0.0) / discretization.scales.stress)


def _pressures(initial: object) -> FloatArray:
    """Pressures over all contact points as they are given."""
    pressure = real_array("initial", initial, "give a ContactResult or an array of pressures")
    if not np.isfinite(pressure).all():
        raise InputError("initial", initial, "give finite pressures, or a ContactResult")
    return pressure


def _same_unknowns(one: Discretization, other: Discretization) -> bool:
    """Whether z means the same in both, and so do the rows of contacts."""
    return (
        one.space.degree == other.space.degree
        and one.qvi.m == other.qvi.m
        and np.array_equal(one.supports.basis.kept, other.supports.basis.kept)
        and one.problem.mesh.same_as(other.problem.mesh)
    )


def _judged(result: ContactResult) -> ContactResult:
    """The result with the status "infeasible" if a mechanism proves it, "infeasible_on_mesh" if only the mesh does."""
    if result.status in _ANSWERED and not _exceeds(result):
        return result
    mechanism = _mechanism(result)
    if mechanism is not None:
        drive = "the driving loads do work, and nothing resists"
        if mechanism.overload < float("inf"):
            drive = f"the driving loads do {mechanism.overload:.6g} times the work that everything else can take up"
        return _with_status(result, Status.INFEASIBLE, f"proved by a mechanism of rigid blocks, on which {drive}")
    if result.status is not Status.INFEASIBLE:
        return result
    return _with_status(
        result,
        Status.INFEASIBLE_ON_MESH,
        "no traction of this mesh carries the load, proved by multipliers (Farkas) checked on the data; there is no "
        "such proof for the body",
    )


def _exceeds(result: ContactResult) -> bool:
    """Whether an answer exceeds, between the points, a contact law whose rows do not bound its work."""
    largest = _EXCEEDED * result.discretization.scales.stress
    uneven = [
        contact.name
        for contact in result.problem.contacts
        if contact.law != "tied"
        and (callable(contact.friction) or callable(contact.cohesion) or contact.shear_limit is not None)
    ]
    return any(result.contacts[name].excess_between_points > largest for name in uneven)


def _mechanism(result: ContactResult) -> Mechanism | None:
    """The mechanism that proves it; none where its linear program fails, or functions have no values at its places."""
    from qvi_contact.mechanism import find_mechanism  # loaded where a load cannot be carried only

    with suppress(SolveError, InputError):
        return find_mechanism(result.problem)
    return None


def _with_status(result: ContactResult, status: Status, proof: str) -> ContactResult:
    count = result.iterations
    message = f"{status.words} after {count} iteration{'s' if count != 1 else ''}; {proof}. {status.advice}"
    return ContactResult(result.discretization, replace(result.solution, status=status, message=message))
