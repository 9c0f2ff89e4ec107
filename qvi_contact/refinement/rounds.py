"""The rounds of one refinement, whatever is refined: answer, assess, refine, until the target or a limit is reached."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Generic, Protocol, TypeVar

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.basics.units import Certainty
from qvi_contact.errors import InputError, QVIError
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement.outcome import RefinementRound, RefinementStatus
from qvi_contact.solution.result import ContactResult
from solvers.basics.progress import deadline

_BULK: Final = 0.6  # Dörfler's share of the difference that is marked

A = TypeVar("A")


def bulk(parts: FloatArray, share: float = _BULK) -> BoolArray:
    """The fewest entries that hold a share of the sum, Dörfler's by default."""
    order: IntArray = np.argsort(-parts, kind="stable")
    enough = int(np.searchsorted(np.cumsum(parts[order]), share * parts.sum() * (1.0 - 1e-12))) + 1
    found = np.zeros(len(parts), dtype=bool)
    found[order[:enough]] = True
    return found


@dataclass(frozen=True)
class Settings:
    """What is asked for: the target, what must not be exceeded, options of all solves; see `refine`.

    Attributes
    ----------
    thinnest : float
        Smallest edge that is made [length].

    """

    target: float
    max_unknowns: int
    max_rounds: int
    thinnest: float
    options: Mapping[str, Any]
    guaranteed: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Round(Generic[A]):
    """An answer and how far it is off.

    Attributes
    ----------
    problem : ContactProblem
        What the next round's mesh is made from.
    answer : A
        The answer.
    unknowns : int
        Its unknowns.
    value, unit : float
        The quantity, and what its error is relative to.
    estimate : float
        Relative error; infinity if there is none.
    certainty : Certainty
        Whether the estimate is a bound.
    indicator : (cells,) array
        Contribution of each cell to the estimate.

    """

    problem: ContactProblem
    answer: A
    unknowns: int
    value: float
    unit: float
    estimate: float
    certainty: Certainty
    indicator: FloatArray

    @property
    def record(self) -> RefinementRound:
        """What is kept of the round."""
        cells = self.problem.mesh.cell_count
        return RefinementRound(cells, self.unknowns, self.value, self.estimate, self.certainty)


R = TypeVar("R", bound=Round[Any])


class Strategy(Protocol[A, R]):
    """How meshes are refined for one kind of answer."""

    @property
    def settings(self) -> Settings:
        """What is asked for."""
        ...

    def answer(self, problem: ContactProblem) -> A:
        """The answer of a round; `TooLargeError` if it would have more unknowns than allowed, else as `solve`."""
        ...

    def assessed(self, problem: ContactProblem, answer: A, earlier: Sequence[R], /) -> R:
        """How far off an answer is; `StopError` if it was not solved, or the time is over before that is known."""
        ...

    def next(self, rounds: Sequence[R]) -> ContactProblem:
        """The problem on the mesh of the next round; `StopError` if there is none."""
        ...


class StopError(Exception):
    """The end of the rounds: how, and why if something failed."""

    def __init__(self, status: RefinementStatus, reason: str = "") -> None:
        super().__init__(reason)
        self.status, self.reason = status, reason


class TooLargeError(Exception):
    """An answer would have more unknowns than allowed."""

    def __init__(self, unknowns: int) -> None:
        super().__init__(unknowns)
        self.unknowns = unknowns


def in_rounds(
    strategy: Strategy[A, R],
    problem: ContactProblem,
    earlier: ContactResult | None,
    callback: Callable[[RefinementRound], object],
) -> tuple[A, list[R], StopError]:
    """The first answer, all rounds that were assessed, and why they ended; what the first mesh raises is raised."""
    settings, rounds = strategy.settings, list[R]()
    if earlier is not None:
        problem = replace(problem, mesh=earlier.problem.mesh)
    try:
        first = answer = strategy.answer(problem)
    except TooLargeError as error:
        remedy = f"the first mesh has {error.unknowns} unknowns: allow more, or start coarser"
        raise InputError("max_unknowns", settings.max_unknowns, remedy) from error
    try:
        while True:
            last = strategy.assessed(problem, answer, rounds)
            rounds.append(last)
            callback(last.record)
            if last.estimate <= settings.target:
                enough = last.certainty is Certainty.GUARANTEED or not settings.guaranteed
                raise StopError(RefinementStatus.REACHED if enough else RefinementStatus.NO_GUARANTEE)
            if deadline.over:
                raise StopError(RefinementStatus.TIME_LIMIT)
            if len(rounds) >= settings.max_rounds:
                raise StopError(RefinementStatus.ROUNDS)
            problem = strategy.next(rounds)
            try:
                answer = strategy.answer(problem)
            except TooLargeError as error:
                raise StopError(RefinementStatus.UNKNOWNS) from error
            except QVIError as error:  # the same data were taken on the mesh before
                late = RefinementStatus.TIME_LIMIT if deadline.over else RefinementStatus.THIN_CELLS
                raise StopError(late, str(error)) from error
    except StopError as stop:
        return first, rounds, stop
