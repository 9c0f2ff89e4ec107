"""What a refinement is asked for, what each of its rounds finds, and what it ends with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.basics.units import Certainty
from qvi_contact.limit.load_factor import LimitLoad
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.history import History
from qvi_contact.solution.result import ContactResult
from solvers.basics.types import columns_of, frame

if TYPE_CHECKING:
    from pandas import DataFrame


class RefinementStatus(StrEnum):
    """How a refinement ended. The value is a word for files and tables, `advice` a sentence for the user."""

    REACHED = "reached"
    NO_GUARANTEE = "no_guarantee"
    UNKNOWNS = "unknowns"
    ROUNDS = "rounds"
    THIN_CELLS = "thin_cells"
    UNSOLVED = "unsolved"
    TIME_LIMIT = "time_limit"

    @property
    def advice(self) -> str:
        """What to do about it, in one sentence."""
        return _ADVICE[self]


_ADVICE = {
    RefinementStatus.REACHED: "Nothing to do: the error, estimated or bounded, is within the target.",
    RefinementStatus.NO_GUARANTEE: "The error is within the target, but no guaranteed bound, as was asked for: "
    "accept it as it is, or read why in result.bracket (reasons, coulomb, coulomb_reason).",
    RefinementStatus.UNKNOWNS: "The next mesh would have more unknowns than allowed: raise max_unknowns, or accept the "
    "estimate.",
    RefinementStatus.ROUNDS: "The rounds are used up: raise max_rounds, or accept the estimate.",
    RefinementStatus.THIN_CELLS: "The cells with the largest error are as thin as double precision allows: accept the "
    "estimate.",
    RefinementStatus.UNSOLVED: "A problem of the refinement was not solved. Its message says what to do.",
    RefinementStatus.TIME_LIMIT: "The time limit was reached: allow more time (time_limit), or accept the estimate "
    "of the last round.",
}


@dataclass(frozen=True)
class RefinementRound:
    """One round of a refinement."""

    cells: int
    """Number of triangles."""
    unknowns: int
    """Unknowns of the problem on them."""
    value: float
    """The quantity."""
    estimate: float
    """Its estimated relative error; infinity if there is none."""
    certainty: Certainty = Certainty.ESTIMATE
    """Whether the estimate is a bound of the error."""

    @property
    def guaranteed(self) -> bool:
        """Whether the estimate is a bound of the error without a condition."""
        return self.certainty is Certainty.GUARANTEED


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Outcome:
    """What a refinement says of its quantity, whatever that is."""

    status: RefinementStatus
    """Only `RefinementStatus.REACHED` means that the estimate is within the target, and guaranteed if that was asked
    for."""
    quantity: str
    """Name of the quantity."""
    target: float
    """Relative error asked for."""
    unit: float
    """What errors are relative to, see `refine`; NaN if no mesh was solved."""
    indicator: FloatArray
    """Contribution of each cell of the last mesh, (cells,); they are ≥ 0 and add up to the estimate."""
    rounds: tuple[RefinementRound, ...]
    """One for each mesh solved."""
    reason: str = ""
    """Why the refinement stopped before the target, if a solve or a mesh failed."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.message}>"

    def to_frame(self) -> DataFrame:
        """One row a round as a pandas table: "round" (from 1), and the fields of `RefinementRound`.

        `InputError` without pandas (extra ``frame``).
        """
        rows = [{"round": number, **asdict(record)} for number, record in enumerate(self.rounds, 1)]
        return frame(columns_of(rows))

    @property
    def value(self) -> float:
        """The quantity on the last mesh; NaN if that failed."""
        return self.rounds[-1].value if self.rounds else float("nan")

    @property
    def estimate(self) -> float:
        """Estimated relative error of the value, or its bound if `guaranteed`; infinity if there is none."""
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
            return f"{self.status.value}: no mesh was solved; {self.reason}"
        last = self.rounds[-1]
        sure = self.certainty is not Certainty.ESTIMATE
        error = f"relative error ({self.certainty})" if sure else "estimated relative error"
        sense = "within" if self.status in {RefinementStatus.REACHED, RefinementStatus.NO_GUARANTEE} else "above"
        text = (
            f"{self.status.value}: {self.quantity} = {self.value:.9g}, {error} {self.estimate:.1e}, "
            f"{sense} the target {self.target:.1e}, with {last.unknowns} unknowns on {last.cells} triangles after "
            f"{len(self.rounds)} {'round' if len(self.rounds) == 1 else 'rounds'}"
        )
        return f"{text}; {self.reason}" if self.reason else text


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Refinement(Outcome):
    """A problem solved on a mesh refined for one quantity, with an estimate of the quantity's error."""

    result: ContactResult
    """On the last mesh that was solved; if there is none, the failed one on the first. Of load steps the last one."""
    history: History | None = None
    """All load steps on that mesh, if these were refined."""

    @property
    def problem(self) -> ContactProblem:
        """The problem on the last mesh."""
        return self.result.problem


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class LimitRefinement(Outcome):
    """A limit load on a mesh refined until both of its sides are as near as asked for.

    It is not guaranteed where tractions, or what enters them along contacts, are no polynomials that the mesh can
    follow: loads are then met in their resultants on every edge.
    """

    limit: LimitLoad
    """Both sides on the last mesh. `Outcome.value` is the lower one, `Outcome.estimate` is (upper − lower)/upper."""
    problem: ContactProblem
    """The problem on the last mesh."""


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
    """What is asked for: the target, what must not be exceeded, options of all solves; see `refine`."""

    target: float
    max_unknowns: int
    max_rounds: int
    options: Mapping[str, Any]
    guaranteed: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Round:
    """An answer and how far it is off."""

    answer: Any  # a ContactResult, History or LimitProblem
    record: RefinementRound  # what is kept of the round
    unit: float  # what the error of the quantity is relative to
    parts: FloatArray  # (cells,): in which proportion cells have a share in it
    finer: Callable[[], TriangleMesh]  # makes the mesh of the next round, or stops
    reference: float = np.nan  # the quantity of the reference solution; NaN where there was none
    hopeless: bool = False  # whether bounds need not be tried again

    @property
    def indicator(self) -> FloatArray:
        """Contribution (cells,) of each cell to the estimate; zero where there is none."""
        total, estimate = float(self.parts.sum()), self.record.estimate
        known = total > 0.0 and np.isfinite(estimate)
        return self.parts * (estimate / total) if known else np.zeros_like(self.parts)


class StopError(Exception):
    """The end of the rounds: how, and why if something failed."""

    def __init__(self, status: RefinementStatus, reason: str = "") -> None:
        super().__init__(reason)
        self.status, self.reason = status, reason
