"""What an error costs each code: its quickest model and its smallest one, and how they compare."""

from collections.abc import Callable, Iterable, Sequence
from typing import Final, NamedTuple

from comparisons.benchmark.ratios import ratio
from comparisons.peers.models import CODES, TRIANGLES
from comparisons.peers.points import Point, Reference

TARGETS: Final = (1e-4, 2e-5, 3e-6, 1e-6, 1e-7, 1e-8)
"""Relative errors of P/2 that codes are asked for."""

OTHERS: Final = ("ngsolve", "getfem")
"""Keys of the codes that are not this package's."""

Errors = Sequence[tuple[Point, float]]
"""Points at one μ that have an error, and the error."""


class Reach(NamedTuple):
    """What one code needs for an error: the quickest of its points, and that with the fewest unknowns."""

    code: str
    target: float
    quickest: Point
    smallest: Point


class Comparison(NamedTuple):
    """Triangles beside the best of the other codes, for one error; the rivals may be two codes."""

    own: Reach
    quickest: Point
    smallest: Point

    @property
    def time(self) -> float | None:
        """Time of the quickest other code over that of the triangles."""
        return ratio(self.quickest.seconds, self.own.quickest.seconds)

    @property
    def unknowns(self) -> float | None:
        """Unknowns of the other code that needs the fewest over those of the triangles."""
        return ratio(self.smallest.unknowns, self.own.smallest.unknowns)


def errors_at(found: Iterable[Point], known: Reference) -> list[tuple[Point, float]]:
    """The points at the μ of a reference that have an error."""
    pairs = [(point, known.error(point)) for point in found if point.friction == known.friction]
    return [(point, error) for point, error in pairs if error is not None]


def lasting_error(rows: Errors, point: Point) -> float:
    """The largest error of a point's model on its mesh and on all finer ones that are solved.

    Forces of contact with friction may cross the right value: an error that a finer mesh contradicts is small by
    chance, and is not what the model is worth. Where no finer mesh is solved nothing is known of that, see `confirmed`.
    """
    return max(error for other, error in rows if other.model == point.model and other.number >= point.number)


def confirmed(rows: Errors, point: Point) -> bool:
    """Whether a finer mesh of the same model is solved, so that `lasting_error` could show chance."""
    return any(other.model == point.model and other.number > point.number for other, _ in rows)


def reached(rows: Errors, known: Reference, code: str, target: float) -> Reach | None:
    """The best points of a code whose error is lastingly within the target; None if there are none.

    The uncertainty of the reference counts against them, or the error would not be known to be reached.
    """
    there = [
        point for point, _ in rows if point.model.code == code and lasting_error(rows, point) + known.floor <= target
    ]
    return Reach(code, target, _best(rows, there, _time), _best(rows, there, _unknowns)) if there else None


def all_reached(rows: Errors, known: Reference) -> list[Reach]:
    """By target, then by code; no target is asked for that the reference does not resolve."""
    targets = (target for target in TARGETS if target > known.floor)
    found = (reached(rows, known, code, target) for target in targets for code in CODES)
    return [each for each in found if each is not None]


def comparison(reaches: Iterable[Reach], target: float) -> Comparison | None:
    """Triangles and the best of the other codes for one error; None if one of them does not reach it."""
    here = {each.code: each for each in reaches if each.target == target}
    others = [here[code] for code in OTHERS if code in here]
    if TRIANGLES not in here or not others:
        return None
    quickest = min((each.quickest for each in others), key=_time)
    return Comparison(here[TRIANGLES], quickest, min((each.smallest for each in others), key=_unknowns))


def _best(rows: Errors, candidates: Sequence[Point], cost: Callable[[Point], float]) -> Point:
    """The best of them, those that a finer mesh confirms before all others."""
    return min(candidates, key=lambda point: (not confirmed(rows, point), cost(point), _time(point)))


def _time(point: Point) -> float:
    return point.seconds or 0.0


def _unknowns(point: Point) -> float:
    return float(point.unknowns or 0)
