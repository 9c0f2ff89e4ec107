"""Where zones of a contact end: the point of opening, and the point between stick and slip.

A zone is a run of edges on whose four Gauss points a function f is positive: the pressure −σ_N for a zone in contact,
and the friction not used up, μ|σ_N| − |σ_T|, for one that sticks. On the first edge beyond it f has a point where it is
zero, and as it is a polynomial there, the end of the zone is its first root between the zone and that point. If f falls
to zero by a jump between the two edges, the end is the grid line; if it touches zero at the Gauss point without a
change of sign, it is that point.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.polynomial import Polynomial

from comparisons.convergence.mesh.tractions import edge_lines, ordered
from qvi_contact.basics.checks import BoolArray, FloatArray

TOLERANCE: Final = 1e-6
"""Of the largest |σ_N|: smaller values of f are zero."""

ROOT, LINE, POINT = "root", "grid line", "Gauss point"
"""How the end of a zone was found."""


@dataclass(frozen=True)
class ZoneEnd:
    """An end of a zone.

    Attributes
    ----------
    kind : "contact begins", "contact ends", "stick begins" or "stick ends", in the direction of growing s
    position : where [length]
    how : `ROOT`, `LINE` or `POINT`
    low, high : Gauss points around it: the last where f is positive and the first where it is zero, or the reverse
    extrapolated : zero of the straight line through f² at the points of the last edge of the zone [length]: close to a
        better value where f falls like the square root of the distance, as the theory of contact has it for zones
        between smooth bodies; None where f² does not fall

    """

    kind: str
    position: float
    how: str
    low: float
    high: float
    extrapolated: float | None


def zone_ends(s: FloatArray, normal: FloatArray, tangential: FloatArray, bound: FloatArray) -> list[ZoneEnd]:
    """All ends of zones in contact, then of zones that stick, from values at the four Gauss points of each edge (4 e,).

    Contact that nothing presses has none.
    """
    points, order = ordered(s)
    unit = float(np.abs(normal).max(initial=0.0))
    if unit == 0.0:
        return []
    pressure, unused = -normal / unit, (bound - np.abs(tangential)) / unit
    names = {"contact": pressure.reshape(-1, 4)[order], "stick": unused.reshape(-1, 4)[order]}
    return [end for name, values in names.items() for end in _ends(name, points, values)]


def _ends(name: str, points: FloatArray, values: FloatArray) -> Iterator[ZoneEnd]:
    lines = edge_lines(points)
    inside: BoolArray = np.asarray((values > TOLERANCE).all(axis=1))
    for edge in np.flatnonzero(np.diff(inside.astype(int))).tolist():
        if inside[edge]:
            yield _end(f"{name} ends", lines, points, values, edge, edge + 1)
        else:  # looked at from the right, where the zone is
            mirrored = -lines[::-1], -points[::-1, ::-1], values[::-1, ::-1]
            last = len(values) - 1
            end = _end(f"{name} begins", *mirrored, last - edge - 1, last - edge)
            other = None if end.extrapolated is None else -end.extrapolated
            yield ZoneEnd(end.kind, -end.position, end.how, -end.high, -end.low, other)


def _end(kind: str, lines: FloatArray, points: FloatArray, values: FloatArray, last: int, beyond: int) -> ZoneEnd:
    """The right end of a zone whose last edge is `last`."""
    x, f = points[beyond], values[beyond]
    first = int(np.argmax(f <= TOLERANCE))
    low = float(x[first - 1] if first else points[last, 3])
    position, how = _first_zero(Polynomial.fit(x, f, 3), float(lines[beyond]), float(x[first]))
    return ZoneEnd(kind, position, how, min(low, position), float(x[first]), _extrapolated(points[last], values[last]))


def _first_zero(f: Polynomial, start: float, stop: float) -> tuple[float, str]:
    """Where f, which is zero or less at `stop`, is so for the first time after `start`."""
    if f(start) <= TOLERANCE:
        return start, LINE
    roots = f.roots()
    real = roots.real[(np.abs(roots.imag) <= 1e-9 * (stop - start)) & (roots.real > start) & (roots.real < stop)]
    return (float(real.min()), ROOT) if len(real) else (stop, POINT)


def _extrapolated(x: FloatArray, f: FloatArray) -> float | None:
    """Zero of the line through (x, f²) by least squares, if it falls."""
    middle, level = float(x.mean()), float((f**2).mean())
    slope = float((x - middle) @ (f**2 - level)) / float((x - middle) @ (x - middle))
    return middle - level / slope if slope < 0.0 else None
