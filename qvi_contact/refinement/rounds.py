"""The rounds of one refinement, whatever is refined: answer, assess, refine, until the target or a limit is reached."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.basics.units import Certainty
from qvi_contact.errors import InputError, QVIError
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.refinement.outcome import RefinementRound, RefinementStatus
from solvers.basics.progress import deadline

_BULK: Final = 0.6  # Dörfler's share of the difference that is marked


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
class Round:
    """An answer and how far it is off.

    Attributes
    ----------
    answer : ContactResult, History or LimitAnalysis
        The answer.
    unknowns : int
        Its unknowns.
    value, unit : float
        The quantity, and what its error is relative to.
    estimate : float
        Relative error; infinity if there is none.
    certainty : Certainty
        Whether the estimate is a bound.
    parts : (cells,) array
        In which proportion cells have a share in it.
    finer : function
        Makes the mesh of the next round; None if there is none.
    reference : float
        The quantity of the reference solution; NaN where there was none.
    hopeless : bool
        Whether bounds need not be tried again.

    """

    answer: Any
    unknowns: int
    value: float
    unit: float
    estimate: float
    certainty: Certainty
    parts: FloatArray
    finer: Callable[[], TriangleMesh | None]
    reference: float = np.nan
    hopeless: bool = False

    @property
    def indicator(self) -> FloatArray:
        """Contribution (cells,) of each cell to the estimate; zero where there is none."""
        total = float(self.parts.sum())
        known = total > 0.0 and np.isfinite(self.estimate)
        return self.parts * (self.estimate / total) if known else np.zeros_like(self.parts)

    @property
    def record(self) -> RefinementRound:
        """What is kept of the round."""
        return RefinementRound(len(self.parts), self.unknowns, self.value, self.estimate, self.certainty)


class Strategy(Protocol):
    """How meshes are refined for one kind of answer."""

    def answer(self, mesh: TriangleMesh) -> Any:
        """The answer on a mesh; `TooLargeError` if it would have more unknowns than allowed, else as `solve`."""

    def assessed(self, mesh: TriangleMesh, answer: Any, earlier: Sequence[Round], /) -> Round:
        """How far off an answer is; `StopError` if it was not solved, or the time is over before that is known."""


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
    strategy: Strategy, settings: Settings, mesh: TriangleMesh, callback: Callable[[RefinementRound], object]
) -> tuple[Any, list[Round], StopError]:
    """The first answer, all rounds that were assessed, and why they ended; what the first mesh raises is raised."""
    rounds = list[Round]()
    try:
        first = answer = strategy.answer(mesh)
    except TooLargeError as error:
        remedy = f"the first mesh has {error.unknowns} unknowns: allow more, or start coarser"
        raise InputError("max_unknowns", settings.max_unknowns, remedy) from error
    try:
        while True:
            last = strategy.assessed(mesh, answer, rounds)
            rounds.append(last)
            callback(last.record)
            if last.estimate <= settings.target:
                enough = last.certainty is Certainty.GUARANTEED or not settings.guaranteed
                raise StopError(RefinementStatus.REACHED if enough else RefinementStatus.NO_GUARANTEE)
            if deadline.over:
                raise StopError(RefinementStatus.TIME_LIMIT)
            if len(rounds) >= settings.max_rounds:
                raise StopError(RefinementStatus.ROUNDS)
            finer = last.finer()
            if finer is None:
                raise StopError(RefinementStatus.THIN_CELLS)
            mesh = finer
            try:
                answer = strategy.answer(mesh)
            except TooLargeError as error:
                raise StopError(RefinementStatus.UNKNOWNS) from error
            except QVIError as error:  # the same data were taken on the mesh before
                late = RefinementStatus.TIME_LIMIT if deadline.over else RefinementStatus.THIN_CELLS
                raise StopError(late, str(error)) from error
    except StopError as stop:
        return first, rounds, stop
