"""Refine a mesh until a quantity is as accurate as asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import count
from typing import Any, Final, TypeAlias, overload

import numpy as np

from qvi_contact.basics.checks import positive_number, whole_number
from qvi_contact.errors import InputError, QVIError, SolveError
from qvi_contact.limit.load_factor import checked_loads
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement.bisection import LimitStrategy, TriangleRefinement, steps_of
from qvi_contact.refinement.measure import LimitFactor, Measure, Quantity
from qvi_contact.refinement.outcome import (
    LimitRefinement,
    Refinement,
    RefinementRound,
    RefinementStatus,
    Round,
    Settings,
    StopError,
)
from qvi_contact.solution.history import History
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.settings import Settings as SolveSettings
from qvi_contact.version import __version__
from solvers.basics.checks import function_or_none, true_or_false
from solvers.basics.progress import Log, deadline

_COLUMNS = {
    "round": ">5", "cells": ">8", "unknowns": ">9", "value": ">16.9g", "estimate": ">9.1e", "guaranteed": ">10",
    "seconds": ">9.2f",
}  # fmt: skip

_ROUNDS: Final = 60

RoundCallback: TypeAlias = Callable[[RefinementRound], object]
"""Called with the record of a round."""


@overload
def refine(
    problem: ContactProblem | Sequence[ContactProblem],
    result: ContactResult | None = None,
    target: float = 1e-3,
    quantity: Quantity = "energy",
    *,
    max_unknowns: int = 20_000,
    max_rounds: int | None = None,
    time_limit: float | None = None,
    guaranteed: bool = False,
    callback: RoundCallback | None = None,
    verbose: bool = False,
    **options: Any,
) -> Refinement: ...


@overload
def refine(
    problem: ContactProblem,
    result: ContactResult | None = None,
    target: float = 1e-3,
    *,
    quantity: LimitFactor,
    max_unknowns: int = 20_000,
    max_rounds: int | None = None,
    time_limit: float | None = None,
    guaranteed: bool = False,
    callback: RoundCallback | None = None,
    verbose: bool = False,
    **options: Any,
) -> LimitRefinement: ...


def refine(
    problem: ContactProblem | Sequence[ContactProblem],
    result: ContactResult | None = None,
    target: float = 1e-3,
    quantity: Quantity | LimitFactor = "energy",
    *,
    max_unknowns: int = 20_000,
    max_rounds: int | None = None,
    time_limit: float | None = None,
    guaranteed: bool = False,
    callback: RoundCallback | None = None,
    verbose: bool = False,
    **options: Any,  # checked by solve
) -> Refinement | LimitRefinement:
    """Solve a problem on meshes refined where it pays until the error of a quantity is within a target.

    Each round solves the problem on a mesh, which gives the answer. Where the contact laws allow it (no friction,
    Tresca's, or tied contacts) a displacement companion bounds the energy, and the force of one prescribed
    displacement: the error is guaranteed, see `Bracket.certainty`. Else the answer is compared with a reference
    solution: one degree more, on a mesh bisected where contact states change and at corners where stresses may be
    singular (see `refinement.bisection`). Triangles that hold most of the difference are bisected.

    With a `LimitFactor` the limit load of `limit_load_factor` is refined instead, until upper − lower is within the
    target of upper. That is a guaranteed error of either side wherever the mesh can follow the tractions. Contact edges
    are bisected on which the mesh gives way in another manner than the body would: where a block turns about an edge,
    or slip ends.

    Parameters
    ----------
    problem : ContactProblem, or a list of them
        The problem. Its mesh is where the refinement starts: vertices it has are kept, so let it be coarse, but fine
        enough to show the loads. A list are the load steps of a history, see `solve_history`: each round solves all of
        them on one mesh, which is refined by the sum of their differences. "dissipation" is then what friction loses in
        all of them, any other quantity that of the last step, and errors are estimates.
    result : ContactResult, optional
        An earlier result of the problem, on its mesh or another: the refinement starts from that mesh.
    target : float
        Relative error asked for.
    quantity : str, function of a ContactResult, or LimitFactor
        "energy": the complementary energy, its error relative to the strain energy (½∫cσ:σ; this is the squared
        relative error of the stresses in the energy norm, if there is no friction). "dissipation": the work lost in
        friction, see `Energies`. All others are relative to themselves:

        * "NAME.normal_force" or "NAME.tangential_force", the resultant of the contact called NAME; of a rigid plate or
          pin also "NAME.force_x", "NAME.force_y", "NAME.moment", what it does to the body, and "NAME.x", "NAME.y",
          "NAME.rotation", how far it moves.
        * "NAME.largest_pressure" of a contact, "NAME.slip(x, y)" at a point of it.
        * "von_mises(x, y)", a stress at a point: "xx", "yy", "xy", "von_mises", and "first", "second" for the principal
          stresses σ₁ ≥ σ₂ in the plane. Where triangles meet it is that of the mean stress.
        * "EDGES.largest_von_mises" or "EDGES.smallest_second" and the like: the extreme of such a stress along a named
          edge set, joint or contact, on both sides of it. Where stresses are singular there is none: the value grows
          from round to round, and its estimate does not fall.
        * any function of a ContactResult that gives one number.
    max_unknowns : int
        Largest number of unknowns of an answer. The reference solution has up to about three times as many.
    max_rounds : int, optional
        Largest number of rounds; 60 by default.
    time_limit : float, optional
        Seconds for all rounds together; the answer is that of the last round done in time.
    guaranteed : bool
        Whether the force of a contact with Coulomb friction is refined until its bounds are within the target, see
        `Bracket.coulomb`. That takes more unknowns than the estimate, which is used by default. Where these bounds are
        estimated ones, or there are none, it ends with `RefinementStatus.NO_GUARANTEE` once they, or the estimate, are
        within the target.
    callback : callable, optional
        Called with the record of each round.
    verbose : bool
        Print a header, a line a round, and a footer with status and time.
    **options
        Fields of `Settings` and options of the method; ``degree`` is 5 by default, at most 11. For a limit load only
        ``degree``, 4 by default.

    Returns
    -------
    Refinement or LimitRefinement
        The last answer, the estimate with its status, and the error indicator of every cell; `Refinement.certainty`
        says whether the estimate is a bound. For a `LimitFactor` the answer is a limit load, `LimitRefinement.limit`.
        A failure does not raise, but on the first mesh: `InputError` if an argument or the problem is wrong,
        `SolveError` if a linear program of a limit load is not solved.

    Notes
    -----
    The error told is 1.5 |q − q(reference solution)| where `Refinement.certainty` is "estimate", and no less than 1.5
    times the step from the reference of the round before, nor than solves are accurate: it is no bound. It held in
    97 % of 200 generated problems; (D22) in `docs/theory.md` says why 1.5, and how far it is from true errors of
    stresses at points. Rounds do not start from the answer before.

    """
    steps = tuple(problem) if isinstance(problem, Sequence) else (problem,)
    if not steps or not all(isinstance(step, ContactProblem) for step in steps):
        raise InputError("problem", problem, "give a ContactProblem, or a list of load steps")
    problem = steps[0]
    if len(steps) > 1 and (guaranteed or isinstance(quantity, LimitFactor)):
        raise InputError("problem", f"{len(steps)} load steps", "have no guaranteed errors and no limit load: give one")
    if result is not None and not isinstance(result, ContactResult):
        raise InputError("result", result, "give an earlier ContactResult of the problem, or None")
    for name in ("initial", "throw"):
        if name in options:
            raise InputError(name, options[name], "is not for refine: meshes change, and failures are in the status")
    if positive_number("target", target) > 1.0:
        raise InputError("target", target, "give a relative error up to 1, such as 1e-3")
    settings = Settings(
        float(target),
        whole_number("max_unknowns", max_unknowns),
        _ROUNDS if max_rounds is None else whole_number("max_rounds", max_rounds),
        options,
        true_or_false("guaranteed", guaranteed),
    )
    function_or_none("callback", callback)
    title = f"qvi_contact {__version__}: refine"
    with deadline(time_limit), Log(title, verbose, _COLUMNS, iterations=False) as log:
        log.begin({"target": f"{settings.target:g}", "cells at first": problem.mesh.cell_count})
        numbers = count(1)

        def told(record: RefinementRound) -> None:
            sure = "yes" if record.guaranteed else "no"
            known = (record.cells, record.unknowns, record.value, record.estimate, sure)
            log.line(next(numbers), *known, log.seconds)
            if callback is not None:
                callback(record)

        strategy: LimitStrategy | TriangleRefinement
        if isinstance(quantity, LimitFactor):
            strategy = LimitStrategy(problem, settings, checked_loads(problem, quantity.loads))
        else:
            _ = SolveSettings.of(None, options)
            strategy = TriangleRefinement(settings, Measure.of(problem, quantity), steps)
        found = _refined(strategy, problem.mesh if result is None else result.problem.mesh, told)
        log.end(found.status.value, found.message, {}, found.status is RefinementStatus.REACHED)
        return found


def _refined(
    strategy: LimitStrategy | TriangleRefinement, mesh: TriangleMesh, callback: RoundCallback
) -> Refinement | LimitRefinement:
    first, rounds, stop = _in_rounds(strategy, mesh, callback)
    answer, last = (rounds[-1].answer, rounds[-1]) if rounds else (first, None)
    said: dict[str, Any] = {
        "status": stop.status, "target": strategy.settings.target, "reason": stop.reason,
        "rounds": tuple(each.record for each in rounds), "unit": np.nan if last is None else last.unit,
        "indicator": np.zeros(mesh.cell_count) if last is None else last.indicator,
    }  # fmt: skip
    if isinstance(strategy, TriangleRefinement):
        history = answer if isinstance(answer, History) else None
        return Refinement(quantity=strategy.measure.name, result=steps_of(answer)[-1], history=history, **said)
    if last is None:
        raise SolveError(f"limit load: {stop.reason}: use a coarser or less graded mesh")
    name = f"limit load factor of {', '.join(strategy.names)}"
    return LimitRefinement(quantity=name, limit=answer.limit, problem=answer.problem, **said)


def _in_rounds(
    strategy: LimitStrategy | TriangleRefinement, mesh: TriangleMesh, callback: RoundCallback
) -> tuple[Any, list[Round], StopError]:
    """The first answer, all rounds that were assessed, and why they ended; what the first mesh raises is raised."""
    settings, rounds = strategy.settings, list[Round]()
    answer: Any
    try:
        first = answer = strategy.answer(mesh)
    except StopError as stop:
        remedy = f"{stop.reason}: allow more, or start coarser"
        raise InputError("max_unknowns", settings.max_unknowns, remedy) from stop
    try:
        while True:
            last = strategy.assessed(mesh, answer, rounds)
            rounds.append(last)
            callback(last.record)
            if last.record.estimate <= settings.target:
                enough = last.record.guaranteed or not settings.guaranteed
                raise StopError(RefinementStatus.REACHED if enough else RefinementStatus.NO_GUARANTEE)
            if deadline.over:
                raise StopError(RefinementStatus.TIME_LIMIT)
            if len(rounds) >= settings.max_rounds:
                raise StopError(RefinementStatus.ROUNDS)
            mesh = last.finer()
            try:
                answer = strategy.answer(mesh)
            except QVIError as error:  # the same data were taken on the mesh before
                late = RefinementStatus.TIME_LIMIT if deadline.over else RefinementStatus.THIN_CELLS
                raise StopError(late, str(error)) from error
    except StopError as stop:
        return first, rounds, stop
