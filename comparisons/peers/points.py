"""Rows of the study as points of curves, and the value of P/2 that their errors are relative to."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from comparisons.benchmark.ratios import median, spread
from comparisons.peers.models import BRACKET, CODES, NAMED, Model
from comparisons.study import DONE, Row
from comparisons.verify.plate import SETTLED

SOLVED: Final = "solved"

UNCERTAINTY: Final = 3e-5
"""Of `comparisons.verify.plate.SETTLED` [MPa × length]."""

STICKING: Final = 0.25
"""From this μ on the whole contact sticks."""

RESOLUTION: Final = 1e-8
"""Relative: bounds hold up to the tolerance of the solves, so that nothing smaller is resolved by any of them."""


KINDS: Final = {
    "PROBLEM": "the problem itself",
    "STICKING": "the tied problem",
    "GIVEN_BOUND": "the problem with the friction bound of the computed state held fixed",
}
"""Name of a `BracketKind` → what is bracketed."""


class Bounds(NamedTuple):
    """What a bracket says, see `codes.equilibrium`."""

    lower: float | None
    upper: float | None
    width: float
    strain_error: float
    guaranteed: bool
    kind: str

    @property
    def force(self) -> tuple[float, float] | None:
        """Guaranteed bounds of P/2 [MPa × length], None if there are none."""
        return None if self.lower is None or self.upper is None or not self.guaranteed else (self.lower, self.upper)


@dataclass(frozen=True)
class Point:
    """One model on one mesh, whatever came of it.

    Attributes
    ----------
    model : Model
    friction : float
        μ.
    cells : int
        Cells a side.
    status, message : str
        "solved", or what became of it and why.
    half_force : float, optional
        P/2 [MPa × length].
    unknowns, iterations : int, optional
    residual : float, optional
        Of the code's own check.
    setup, solve : tuple of float
        Wall times of the repetitions [s].
    before, peak : int, optional
        Largest resident memory of the process [bytes] before the case and after its first solve.
    version : str, optional
        What the code says of itself.
    bounds : Bounds, optional
        Of a bracket.

    """

    model: Model
    friction: float
    cells: int
    status: str
    message: str
    half_force: float | None
    unknowns: int | None
    iterations: int | None
    residual: float | None
    setup: tuple[float, ...]
    solve: tuple[float, ...]
    before: int | None
    peak: int | None
    version: str | None
    bounds: Bounds | None

    @property
    def solved(self) -> bool:
        """Whether the code says so."""
        return self.status == SOLVED

    @property
    def seconds(self) -> float | None:
        """Median of set-up and solve together [s]."""
        return median(self._whole)

    @property
    def spread(self) -> float | None:
        """Largest less smallest of these sums over their median."""
        return spread(self._whole)

    @property
    def _whole(self) -> list[float]:
        return [sum(pair) for pair in zip(self.setup, self.solve, strict=True)]


def points(rows: Iterable[Row]) -> list[Point]:
    """A point for each row."""
    return [_point(row) for row in rows]


def _point(row: Row) -> Point:
    model = NAMED[row.case["model"]]
    done = row.status == DONE
    result: Mapping[str, Any] = row.result if done else {"status": row.status, "message": row.reason}
    bounded = model.code == BRACKET and "width" in result
    return Point(
        model, row.case["friction"], row.case["cells"], result["status"], result["message"],
        _finite(result.get("half_force")), result.get("unknowns"), result.get("iterations"),
        _finite(result.get("residual")), tuple(result.get("setup", ())), tuple(result.get("solve", ())),
        result.get("before"), result.get("peak"), result.get("version"),
        Bounds(*(result[name] for name in Bounds._fields)) if bounded else None,
    )  # fmt: skip


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


@dataclass(frozen=True)
class Reference:
    """The value of P/2 at one μ.

    Attributes
    ----------
    friction : float
        μ.
    value, uncertainty : float
        P/2 lies within value ± uncertainty [MPa × length].
    source : str
        Where it comes from.

    """

    friction: float
    value: float
    uncertainty: float
    source: str

    @property
    def floor(self) -> float:
        """Relative error below which nothing is resolved."""
        return max(self.uncertainty / self.value, RESOLUTION)

    def error(self, point: Point) -> float | None:
        """|P/2| error of a solution, relative; None where there is none."""
        return None if point.half_force is None or not point.solved else abs(point.half_force / self.value - 1.0)


def reference(found: Sequence[Point], friction: float) -> Reference | None:
    """The narrowest guaranteed bounds of this run, or what displacement codes settle on, whichever is narrower."""
    known = []
    settled = SETTLED[1.0] if friction >= STICKING else SETTLED.get(friction)
    if settled is not None:
        known.append(Reference(friction, settled, UNCERTAINTY, "what GetFEM and NGSolve settle on, agreeing"))
    for point in found:
        force = point.bounds.force if point.bounds and point.friction == friction and point.solved else None
        if force is not None:
            source = f"the guaranteed bounds of {named(point)}"
            known.append(Reference(friction, sum(force) / 2.0, abs(force[1] - force[0]) / 2.0, source))
    return min(known, key=lambda each: each.uncertainty, default=None)


def named(point: Point) -> str:
    """Model and mesh."""
    return f"{point.model.name}, {point.cells}² cells"


def missing(found: Iterable[Point]) -> list[str]:
    """Keys of the codes that are not in the run, since they were not installed."""
    present = {point.model.code for point in found}
    return [key for key in CODES if key not in present]
