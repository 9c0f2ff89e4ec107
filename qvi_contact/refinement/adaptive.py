"""Refine a mesh until a quantity is as accurate as asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from itertools import count
from typing import TYPE_CHECKING, Any, Final, overload

import numpy as np

from qvi_contact import __version__
from qvi_contact.basics.checks import FloatArray, instance_of, positive_number, whole_number
from qvi_contact.basics.schema import WithFields
from qvi_contact.errors import InputError, QVIError, SolveError
from qvi_contact.limit.load_factor import LimitLoad, checked_loads
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement.bisection import (
    LimitStrategy,
    RefinementRound,
    RefinementStatus,
    Round,
    Settings,
    StopError,
    TriangleRefinement,
    steps_of,
)
from qvi_contact.refinement.measure import LimitFactor, Measure, Quantity
from qvi_contact.solution.history import History
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.settings import Settings as SolveSettings
from qvi_contact.units import Certainty
from solvers.basics.checks import function_or_none, true_or_false
from solvers.basics.progress import Log, deadline
from solvers.basics.types import columns_of, frame
from solvers.errors import counted

if TYPE_CHECKING:
    from pandas import DataFrame

_COLUMNS = {
    "round": ">5", "cells": ">8", "unknowns": ">9", "value": ">16.9g", "estimate": ">9.1e", "guaranteed": ">10",
    "seconds": ">9.2f",
}  # fmt: skip

_ROUNDS: Final = 60  # default of `max_rounds`
_GROWING: Final = 4  # rounds in succession that show whether a quantity grows while its error stays,
_STAYED: Final = 0.8  # that is, falls to no less than this share; smooth quantities lose far more in three rounds


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Outcome(WithFields):
    """The quantity of a refinement, its error, and the way to it."""

    status: RefinementStatus
    """Only `RefinementStatus.REACHED` means: the estimate is within the target, and guaranteed if asked for."""
    quantity: str
    """Name of the quantity."""
    target: float
    """Relative error asked for."""
    unit: float
    """Reference of relative errors, see `refine`; NaN if no mesh was solved."""
    indicator: FloatArray
    """Contribution of each cell of the last mesh, (cells,); they are ≥ 0 and add up to the estimate."""
    rounds: tuple[RefinementRound, ...]
    """One for each mesh solved."""
    reason: str = ""
    """Why the refinement stopped before the target, if a solve or a mesh failed."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.message}>"

    def to_frame(self) -> DataFrame:
        """One row per round: "round" from 1, fields of `RefinementRound`; `InputError` without pandas (``frame``)."""
        rows = [{"round": number, **asdict(record)} for number, record in enumerate(self.rounds, 1)]
        return frame(columns_of(rows))

    @property
    def value(self) -> float:
        """The quantity on the last mesh; NaN if that failed, or if the quantity tends to no limit."""
        return self.rounds[-1].value if self.rounds else float("nan")

    @property
    def estimate(self) -> float:
        """Estimated relative error of the value, or its bound if `guaranteed`; infinity if unknown."""
        return self.rounds[-1].estimate if self.rounds else float("inf")

    @property
    def error(self) -> float:
        """Estimated error of the value, in its own unit."""
        return self.estimate * self.unit

    @property
    def certainty(self) -> Certainty:
        """Whether `estimate` is a bound of the error, up to rounding."""
        return self.rounds[-1].certainty if self.rounds else Certainty.ESTIMATE

    @property
    def guaranteed(self) -> bool:
        """Whether `estimate` is a bound of the error without a condition, up to rounding; see `Bracket.certainty`."""
        return self.certainty is Certainty.GUARANTEED

    @property
    def message(self) -> str:
        """One sentence about the outcome."""
        if not self.rounds:
            return f"{self.status.value}: {self.quantity} has no value; {self.reason}"
        last = self.rounds[-1]
        is_bound = self.certainty is not Certainty.ESTIMATE
        error = f"relative error ({self.certainty})" if is_bound else "estimated relative error"
        sense = "within" if self.status in {RefinementStatus.REACHED, RefinementStatus.NO_GUARANTEE} else "above"
        text = (
            f"{self.status.value}: {self.quantity} = {self.value:.9g}, {error} {self.estimate:.1e}, "
            f"{sense} the target {self.target:.1e}, with {last.unknowns} unknowns on {last.cells} triangles after "
            f"{counted(len(self.rounds), 'round')}"
        )
        return f"{text}; {self.reason}" if self.reason else text


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Refinement(Outcome):
    """A problem solved on a mesh refined for one quantity, with an estimate of the quantity's error."""

    result: ContactResult
    """The result on the last mesh that was solved, or the failed one on the first mesh; of load steps the last."""
    history: History | None = None
    """All load steps on that mesh, if these were refined."""

    @property
    def problem(self) -> ContactProblem:
        """The problem on the last mesh."""
        return self.result.problem

    @property
    def message(self) -> str:
        """One sentence about the outcome; a second clause says if the value may be infinite."""
        last = self.rounds[-_GROWING:]
        is_growing = len(last) == _GROWING and (np.diff(np.abs([each.value for each in last])) > 0.0).all()
        if not is_growing or not last[-1].estimate > _STAYED * last[0].estimate:
            return super().message
        return (
            f"{super().message}; the value grew in each of the last {_GROWING - 1} rounds while the error stayed: "
            "it may be infinite, as stresses are at sharp corners"
        )


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class LimitRefinement(Outcome):
    """A limit load on a mesh refined until both of its sides are as near as asked for.

    It is not guaranteed where tractions, or data along contacts that add to them, are no polynomials that the mesh can
    follow. Loads are then met in their resultants on every edge.
    """

    limit: LimitLoad
    """Both sides on the last mesh. `Outcome.value` is the lower one, `Outcome.estimate` is (upper − lower)/upper."""
    problem: ContactProblem
    """The problem on the last mesh."""


@overload
def refine(
    problem: ContactProblem | Sequence[ContactProblem], result: ContactResult | None = None, target: float = 1e-3,
    quantity: Quantity = "energy", **options: Any,
) -> Refinement: ...  # fmt: skip


@overload
def refine(
    problem: ContactProblem, result: Any = None, target: float = 1e-3, *, quantity: LimitFactor, **options: Any
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
    callback: Callable[[RefinementRound], object] | None = None,
    verbose: bool = False,
    **options: Any,  # checked by solve
) -> Refinement | LimitRefinement:
    """Solve a problem on meshes refined where it pays until the error of a quantity is within a target.

    Each round solves the problem on a mesh, which gives the answer. Where the contact laws allow it (no friction,
    Tresca's, or tied contacts) a displacement companion bounds the energy, and the force at a single prescribed
    displacement: the error is guaranteed, see `Bracket.certainty`. Otherwise the answer is compared with a reference
    solution, of one degree more and on a mesh bisected where contact states change and at corners where stresses may
    be singular (see `refinement.bisection`). Triangles that hold most of the difference are bisected.

    With a `LimitFactor` the limit load of `limit_load_factor` is refined instead, until upper − lower is within the
    target of upper. That is a guaranteed error of either side wherever the mesh can follow the tractions. Contact edges
    are bisected where the collapse of the mesh differs from the body's: where a block turns on an edge, or slip ends.

    Parameters
    ----------
    problem : ContactProblem, or a list of them
        The problem. Its mesh is the coarsest one, and its vertices are kept: let it be coarse, but fine enough to
        show the loads. A list holds the load steps of a history, see `solve_history`: each round solves all of them on
        one mesh, which is refined by the sum of their differences. "dissipation" is then the friction work of all
        steps, any other quantity belongs to the last step, and errors are estimates.
    result : ContactResult, optional
        An earlier result of the problem, on its mesh or another: the refinement starts from that mesh.
    target : float
        Relative error asked for.
    quantity : str, function of a ContactResult, or LimitFactor
        "energy": the complementary energy, its error relative to the strain energy (½∫cσ:σ; this is the squared
        relative error of the stresses in the energy norm, if there is no friction). "dissipation": the work lost in
        friction, see `Energies`. Errors of all others are relative to their value:

        * "NAME.normal_force" or "NAME.tangential_force", the resultant of the contact called NAME; of a rigid plate or
          pin also "NAME.force_x", "NAME.force_y", "NAME.moment", its action on the body, and "NAME.x", "NAME.y",
          "NAME.rotation", its motion.
        * "NAME.largest_pressure" of a contact, "NAME.slip(x, y)" at a point of it.
        * "von_mises(x, y)", a stress at a point: "xx", "yy", "xy", "von_mises", and "first", "second" for the principal
          stresses σ₁ ≥ σ₂ in the plane. Where triangles meet it is taken of their mean stress.
        * "EDGES.largest_von_mises" or "EDGES.smallest_second" and the like: the extreme of such a stress along a named
          edge set, joint or contact, on both sides of it. Where stresses are singular there is no extreme: the
          value grows from round to round, and its estimate does not fall.
        * any function of a ContactResult that gives one number.
    max_unknowns : int
        Largest number of unknowns of an answer. The reference solution has up to about three times as many.
    max_rounds : int, optional
        Largest number of rounds; 60 by default.
    time_limit : float, optional
        Seconds for all rounds together; the answer is that of the last round done in time.
    guaranteed : bool
        Refine the force of a contact until its bounds are within the target, see `Bracket.forces`. This takes more
        unknowns than the estimate, which is used by default. If the bounds are estimates, or missing, the refinement
        ends with `RefinementStatus.NO_GUARANTEE` once the bounds, or the estimate, are within the target. Bounds that
        no mesh would guarantee, nor make narrow, count as missing.
    callback : callable, optional
        Called with the record of each round.
    verbose : bool
        Print a header, a line per round, and a footer with status and time.
    **options
        Fields of `Settings` and options of the method; ``degree`` is 5 by default, at most 11. For a limit load only
        ``degree``, 4 by default.

    Returns
    -------
    Refinement or LimitRefinement
        The last answer, the estimate with its status, and the error indicator of every cell; `Refinement.certainty`
        says whether the estimate is a bound. For a `LimitFactor` the answer is a limit load, `LimitRefinement.limit`.
        Only failures on the first mesh raise: `InputError` if an argument or the problem is wrong, `SolveError` if a
        program of a limit load is not solved.

    Notes
    -----
    Where `Refinement.certainty` is "estimate", the error is 1.5 |q − q(reference solution)|, at least 1.5 times the
    change of the reference since the round before, and at least the accuracy of the solves. Agreement by chance does
    not count, see (D22) in `docs/theory.md`. It is no bound. Rounds do not start from the answer before.

    """
    steps = tuple(problem) if isinstance(problem, Sequence) else (problem,)
    if not steps or not all(isinstance(step, ContactProblem) for step in steps):
        raise InputError("problem", problem, "give a ContactProblem, or a list of load steps")
    problem = steps[0]
    if len(steps) > 1 and (guaranteed or isinstance(quantity, LimitFactor)):
        raise InputError("problem", f"{len(steps)} load steps", "have no guaranteed errors and no limit load: give one")
    mesh = _start(problem.mesh, result)
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

        def report(record: RefinementRound) -> None:
            is_guaranteed = "yes" if record.guaranteed else "no"
            columns = (record.cells, record.unknowns, record.value, record.estimate, is_guaranteed)
            log.line(next(numbers), *columns, log.seconds)
            if callback is not None:
                callback(record)

        strategy: LimitStrategy | TriangleRefinement
        if isinstance(quantity, LimitFactor):
            strategy = LimitStrategy(problem, settings, checked_loads(problem, quantity.loads))
        else:
            solves = SolveSettings.of(None, options)
            strategy = TriangleRefinement(settings, Measure.of(problem, quantity), steps, solves)
        outcome = _refined(strategy, mesh, report)
        log.end(outcome.status.value, outcome.message, {}, outcome.status is RefinementStatus.REACHED)
        return outcome


def _start(own: TriangleMesh, result: ContactResult | None) -> TriangleMesh:
    """The mesh of an earlier result, or the problem's own; `InputError` if the result is none, or of another body."""
    if result is None:
        return own
    instance_of(ContactResult, "result", result, "give an earlier ContactResult of the problem, or None")
    mesh = result.problem.mesh
    if any((first.locate(second.vertices) < 0).any() for first, second in ((mesh, own), (own, mesh))):
        raise InputError("result", result, "is that of another body: give an earlier one of this problem")
    return mesh


def _refined(
    strategy: LimitStrategy | TriangleRefinement, mesh: TriangleMesh, callback: Callable[[RefinementRound], object]
) -> Refinement | LimitRefinement:
    """The last answer that was assessed, or the first answer."""
    rounds = list[Round]()
    answer: Any = None
    failed: RefinementStatus | None
    try:
        while True:
            failed = RefinementStatus.THIN_CELLS  # the data are right, as the mesh before took them
            mesh = rounds[-1].finer() if rounds else mesh
            answer = strategy.answer(mesh)
            failed = RefinementStatus.UNSOLVED
            assessed = strategy.assessed(mesh, answer, rounds)
            before = rounds[-1].record if rounds else assessed.record
            is_bound = before.certainty is not Certainty.ESTIMATE
            if deadline.over and is_bound and assessed.record.estimate > before.estimate:
                raise StopError(RefinementStatus.TIME_LIMIT)  # time ran out before the bounds were computed
            rounds.append(assessed)
            failed = None  # errors of the callback are the caller's
            callback(assessed.record)
            _stop_at_end(strategy.settings, rounds)
    except StopError as stop:
        if answer is None:
            remedy = f"{stop.reason}: allow more, or start coarser"
            raise InputError("max_unknowns", strategy.settings.max_unknowns, remedy) from stop
        status, reason = stop.status, stop.reason
    except QVIError as error:
        if not rounds or failed is None:
            raise
        status, reason = RefinementStatus.TIME_LIMIT if deadline.over else failed, str(error)
    fields: dict[str, Any] = {"status": status, "reason": reason, "target": strategy.settings.target}
    fields |= {"rounds": tuple(each.record for each in rounds), "unit": np.nan, "indicator": np.zeros(mesh.cell_count)}
    if rounds:
        last = rounds[-1]
        answer, fields["unit"], fields["indicator"] = last.answer, last.unit, last.indicator
    if isinstance(strategy, TriangleRefinement):
        history = answer if isinstance(answer, History) else None
        return Refinement(quantity=strategy.measure.name, result=steps_of(answer)[-1], history=history, **fields)
    if not rounds:
        raise SolveError(f"limit load: {fields['reason']}: use a coarser or less graded mesh")
    name = f"limit load factor of {', '.join(strategy.names)}"
    return LimitRefinement(quantity=name, limit=answer.limit, problem=answer.problem, **fields)


def _stop_at_end(settings: Settings, rounds: Sequence[Round]) -> None:
    """`StopError` if the target is met, or time or rounds are used up."""
    record = rounds[-1].record
    if record.estimate <= settings.target:
        is_enough = record.guaranteed or not settings.guaranteed
        raise StopError(RefinementStatus.REACHED if is_enough else RefinementStatus.NO_GUARANTEE)
    if deadline.over:
        raise StopError(RefinementStatus.TIME_LIMIT)
    if len(rounds) >= settings.max_rounds:
        raise StopError(RefinementStatus.ROUNDS)
