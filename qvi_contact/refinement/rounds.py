"""What is asked for in each round of a refinement, and what a round leaves behind."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol, TypeVar

from qvi_contact.basics.certainty import Certainty
from qvi_contact.basics.checks import FloatArray
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement.outcome import RefinementRound, RefinementStatus
from qvi_contact.solution.result import ContactResult
from solvers import Status

ROUNDS: Final = 60
"""Largest number of rounds, unless another is asked for."""

THINNEST: Final = 1e-9
"""Smallest edge over the body's length, unless another is asked for."""

_STOPS: Final = {
    Status.ILL_CONDITIONED: RefinementStatus.THIN_CELLS,
    Status.TIME_LIMIT: RefinementStatus.TIME_LIMIT,
}  # what a status on the way means for the refinement


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


A = TypeVar("A")
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
