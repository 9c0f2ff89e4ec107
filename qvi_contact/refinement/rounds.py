"""The rounds of one refinement, whatever is refined: answer, assess, refine, until the target or a limit is reached."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Generic, Protocol, TypeVar

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.basics.shown import Certainty
from qvi_contact.errors import InputError, QVIError
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement.outcome import RefinementRound, RefinementStatus
from qvi_contact.solution.result import ContactResult
from solvers import Status
from solvers.basics.progress import expired

_BULK: Final = 0.6  # Dörfler's share of the difference that is marked

ROUNDS: Final = 60
"""Largest number of rounds, unless another is asked for."""
THINNEST: Final = 1e-9
"""Smallest edge over the body's length, unless another is asked for."""
_STOPS: Final = {
    Status.ILL_CONDITIONED: RefinementStatus.THIN_CELLS,
    Status.TIME_LIMIT: RefinementStatus.TIME_LIMIT,
}  # what a status on the way means for the refinement
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
    """What is asked for: the target, what must not be exceeded, options of all solves.

    Attributes
    ----------
    target : float
        Relative error.
    max_unknowns : int
        Of an answer.
    max_rounds : int
        Rounds.
    thinnest : float
        Smallest edge that is made [length].
    options : mapping
        Of `solve`.
    guaranteed : bool
        Whether bounds under slip are wanted rather than estimates.

    """

    target: float
    max_unknowns: int
    max_rounds: int
    thinnest: float
    options: Mapping[str, Any]
    guaranteed: bool = False


@dataclass(frozen=True)
class Accuracy:
    """The quantity of a round, and how far off it is.

    Attributes
    ----------
    value, unit : float
        The quantity, and what its error is relative to.
    estimate : float
        Relative error; infinity if there is none.
    certainty : Certainty
        Whether the estimate is a bound.

    """

    value: float
    unit: float
    estimate: float
    certainty: Certainty = Certainty.ESTIMATE


@dataclass(frozen=True, eq=False, kw_only=True)
class Round:
    """An answer and how far it is off.

    Attributes
    ----------
    problem : ContactProblem
        What the next round's mesh is made from.
    unknowns : int
        Unknowns of the answer.
    accuracy : Accuracy
        The quantity of the answer, and how far off it is.
    cells : int
        Number of triangles.
    indicator : array
        Contribution of each cell to the estimate.

    """

    problem: ContactProblem
    unknowns: int
    accuracy: Accuracy
    cells: int
    indicator: FloatArray

    @property
    def estimate(self) -> float:
        """Relative error; infinity if there is none."""
        return self.accuracy.estimate

    @property
    def record(self) -> RefinementRound:
        """What is kept of the round."""
        known = self.accuracy
        return RefinementRound(self.cells, self.unknowns, known.value, known.estimate, known.certainty)


@dataclass(frozen=True, eq=False, kw_only=True)
class ResultRound(Round):
    """A round that solves the problem.

    Attributes
    ----------
    result : ContactResult
        The answer.

    """

    result: ContactResult


R = TypeVar("R", bound=Round)
K = TypeVar("K", bound=ResultRound)


class Strategy(Protocol[A, R]):
    """How meshes are refined for one kind of answer.

    Attributes
    ----------
    settings : Settings
        What is asked for.

    """

    @property
    def settings(self) -> Settings:
        """What is asked for."""
        ...

    def start(self, problem: ContactProblem, result: ContactResult) -> ContactProblem:
        """The problem on the mesh that goes on from an earlier result, if there is one."""
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


def check_solved(result: ContactResult) -> None:
    """`StopError` unless the result is solved."""
    if result.status is not Status.SOLVED:
        status = _STOPS.get(result.status, RefinementStatus.UNSOLVED)
        if result.status is Status.INACCURATE and _rounded(result):
            status = RefinementStatus.THIN_CELLS
        raise StopError(status, f"the mesh with {unknowns_of(result)} unknowns: {result.message}")


def _rounded(result: ContactResult) -> bool:
    """Whether rounding alone does more to stresses in the smallest cells than the certificate allows."""
    certificate = result.certificate
    unit = certificate.scales.get("stress", 1.0) * result.discretization.scales.stress
    return result.has_state and result.stress_rounding > certificate.tolerance * unit


def unknowns_of(result: ContactResult) -> int:
    """Unknowns of the algebraic problem."""
    return int(result.discretization.qvi.n)


@dataclass(frozen=True, eq=False)
class Ended(Generic[A, R]):
    """What a loop leaves.

    Attributes
    ----------
    first : A
        The first answer.
    rounds : list of R
        Those that were assessed.
    stop : StopError
        The end, and why.

    """

    first: A
    rounds: list[R]
    stop: StopError


@dataclass(frozen=True, eq=False)
class Loop(Generic[A, R]):
    """A strategy, and who is told of its rounds."""

    strategy: Strategy[A, R]
    callback: Callable[[RefinementRound], object] | None

    def run(self, problem: ContactProblem, earlier: ContactResult | None) -> Ended[A, R]:
        """Answer, assess, refine, until the target or a limit is reached."""
        rounds: list[R] = []
        if earlier is not None:
            problem = self.strategy.start(problem, earlier)
        first = answer = self._first(problem)
        try:
            while True:
                rounds.append(self.strategy.assessed(problem, answer, rounds))
                if self.callback is not None:
                    self.callback(rounds[-1].record)
                self._check_limits(rounds)
                problem = self.strategy.next(rounds)
                answer = self._answered(problem)
        except StopError as stop:
            return Ended(first, rounds, stop)

    def _first(self, problem: ContactProblem) -> A:
        """The answer on the first mesh, which may raise."""
        try:
            return self.strategy.answer(problem)
        except TooLargeError as error:
            remedy = f"the first mesh has {error.unknowns} unknowns: allow more, or start coarser"
            raise InputError("max_unknowns", self.strategy.settings.max_unknowns, remedy) from error

    def _answered(self, problem: ContactProblem) -> A:
        """The answer on a later mesh."""
        try:
            return self.strategy.answer(problem)
        except TooLargeError as error:
            raise StopError(RefinementStatus.UNKNOWNS) from error
        except QVIError as error:  # the same data were taken on the mesh before
            late = RefinementStatus.TIME_LIMIT if expired() else RefinementStatus.THIN_CELLS
            raise StopError(late, str(error)) from error

    def _check_limits(self, rounds: Sequence[R]) -> None:
        """`StopError` where the target or a limit is reached."""
        settings = self.strategy.settings
        if rounds[-1].estimate <= settings.target:
            sure = rounds[-1].accuracy.certainty is Certainty.GUARANTEED
            raise StopError(
                RefinementStatus.REACHED if sure or not settings.guaranteed else RefinementStatus.NO_GUARANTEE
            )
        if expired():
            raise StopError(RefinementStatus.TIME_LIMIT)
        if len(rounds) >= settings.max_rounds:
            raise StopError(RefinementStatus.ROUNDS)
