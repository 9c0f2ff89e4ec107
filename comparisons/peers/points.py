"""Rows of the study as points of curves, and the value of P/2 that their errors are relative to."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from comparisons.benchmark.ratios import spread
from comparisons.lab.report.numbers import scientific
from comparisons.lab.study import DONE, Row
from comparisons.peers.models import BRACKET, CODES, NAMED, Model
from comparisons.settled import LIMITS, LIMITS_SOURCE, SETTLED, SOURCE, UNCERTAINTY

SOLVED: Final = "solved"

INVERTED: Final = "inverted"
"""Status of a bracket whose lower end is above its upper one, see `Bounds.inverted`: it proves nothing."""

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
        lower, upper = _finite(self.lower), _finite(self.upper)
        return None if lower is None or upper is None or not self.guaranteed else (lower, upper)

    @property
    def widened(self) -> tuple[float, float] | None:
        """`force`, wider on either side by `RESOLUTION`, up to which the solves hold."""
        if self.force is None:
            return None
        lower, upper = self.force
        return lower - RESOLUTION * abs(lower), upper + RESOLUTION * abs(upper)

    @property
    def inverted(self) -> bool:
        """Whether the lower end, of the energy or of P, is above the upper one by more than twice `RESOLUTION`."""
        if self.width < -RESOLUTION:
            return True
        return self.widened is not None and self.widened[0] > self.widened[1]


@dataclass(frozen=True)
class Point:
    """One model on one mesh, whatever came of it.

    Attributes
    ----------
    model : Model
    friction : float
        μ.
    number : int
        Of the mesh in the model's family: cells a side, or a level.
    status, message : str
        "solved", or what became of it and why.
    half_force : float, optional
        P/2 [MPa × length].
    unknowns, iterations : int, optional
    residual : float, optional
        Of the code's own check.
    setup, solve : tuple of float
        Processor times of the repetitions [s].
    before, peak : int, optional
        Largest resident memory of the process [bytes] before the case and after its first solve.
    version : str, optional
        What the code says of itself.
    bounds : Bounds, optional
        Of a bracket.

    """

    model: Model
    friction: float
    number: int
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
        """Whether the code says so, and no bounds are inverted."""
        return self.status == SOLVED

    @property
    def seconds(self) -> float | None:
        """Smallest of set-up and solve together [s]: what else the machine does can only add to it."""
        return min(self._whole, default=None)

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
    status, message = result["status"], result["message"]
    bounded = model.code == BRACKET and status == SOLVED
    bounds = Bounds(*(result[name] for name in Bounds._fields)) if bounded else None
    if bounds is not None and bounds.inverted:
        status, message = INVERTED, _inversion(bounds)
    return Point(
        model, row.case["friction"], row.case["number"], status, message,
        _finite(result.get("half_force")), result.get("unknowns"), result.get("iterations"),
        _finite(result.get("residual")), tuple(result.get("setup", ())), tuple(result.get("solve", ())),
        result.get("before"), result.get("peak"), result.get("version"),
        bounds,
    )  # fmt: skip


def _inversion(bounds: Bounds) -> str:
    ends = "" if bounds.force is None else f", P/2 from {bounds.force[0]:.7f} to {bounds.force[1]:.7f} MPa × length"
    return f"the lower end is above the upper one: half width {scientific(bounds.width)}{ends}"


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
        """The same uncertainty, relative: errors below it are not resolved."""
        return self.uncertainty / abs(self.value)

    def error(self, point: Point) -> float | None:
        """|P/2 - value| of a solution, relative, so that it is known up to `floor`; None where there is none."""
        if point.half_force is None or not point.solved:
            return None
        return abs(point.half_force / self.value - 1.0)


def reference(found: Sequence[Point], friction: float) -> Reference | None:
    """The limit or value that is known from elsewhere, or the narrowest guaranteed bounds of this run if narrower.

    Bounds are taken as `Bounds.widened` has them; those that contradict each other (`contradictory`) are not taken.
    """
    known, at = [], 1.0 if friction >= STICKING else friction
    if at in LIMITS:
        known.append(Reference(friction, *LIMITS[at], LIMITS_SOURCE))
    elif at in SETTLED:
        known.append(Reference(friction, SETTLED[at], UNCERTAINTY, SOURCE))
    for point, (lower, upper) in [] if contradictory(found, friction) else guaranteed(found, friction):
        source = f"the guaranteed bounds of {named(point)}"
        known.append(Reference(friction, (lower + upper) / 2.0, (upper - lower) / 2.0, source))
    return min(known, key=lambda each: each.uncertainty, default=None)


def guaranteed(found: Iterable[Point], friction: float) -> list[tuple[Point, tuple[float, float]]]:
    """The brackets at one μ that bound P/2, each with its bounds (`Bounds.widened`), the narrowest first."""
    here = [point for point in found if point.friction == friction and point.solved and point.bounds]
    sure = [(point, point.bounds.widened) for point in here if point.bounds]
    return sorted(((point, ends) for point, ends in sure if ends is not None), key=lambda pair: pair[1][1] - pair[1][0])


def contradictory(found: Iterable[Point], friction: float) -> bool:
    """Whether no value of P/2 is inside all guaranteed bounds at one μ, so that some of them are wrong."""
    ends = [each for _, each in guaranteed(found, friction)]
    return bool(ends) and max(lower for lower, _ in ends) > min(upper for _, upper in ends)


def named(point: Point) -> str:
    """Model and mesh."""
    return f"{point.model.name}, {point.model.family.label(point.number)}"


def missing(found: Iterable[Point]) -> list[str]:
    """Keys of the codes that are not in the run, since they were not installed."""
    present = {point.model.code for point in found}
    return [key for key in CODES if key not in present]
