"""Tractions on a straight contact as piecewise polynomials, and how far two of them are apart."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.element.hermite import gauss_legendre, nodal_quadratics

Field: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""σ_N and σ_T [stress] at coordinates s along a contact, arrays of one shape."""

_GAUSS: Final = gauss_legendre(4)[0]
_POINTS, _WEIGHTS = gauss_legendre(6)
_END_VALUES: Final = np.linalg.pinv(np.column_stack([1.0 - _GAUSS, _GAUSS]))
_NODE_VALUES: Final = np.linalg.pinv(nodal_quadratics(_GAUSS)[:, [0, 2, 1]])  # start, middle, end


@dataclass(frozen=True, eq=False)
class Tractions:
    """Tractions of equilibrium elements on the e edges of a contact, in the order of s.

    Attributes
    ----------
    lines : (e + 1,) ends of the edges along the contact [length]
    normal : (e, 2) σ_N at both ends of each edge, linear between them [stress]
    tangential : (e, 3) σ_T at both ends and the middle (start, middle, end), quadratic on the edge [stress]

    """

    lines: FloatArray
    normal: FloatArray
    tangential: FloatArray

    @classmethod
    def at_gauss_points(cls, s: FloatArray, normal: FloatArray, tangential: FloatArray) -> "Tractions":
        """From values at the four Gauss points of each edge, arrays (4 e,), edges in any order."""
        points, order = ordered(s)
        n, t = (values.reshape(-1, 4)[order] for values in (normal, tangential))
        return cls(edge_lines(points), n @ _END_VALUES.T, t @ _NODE_VALUES.T)

    @classmethod
    def of_record(cls, record: Mapping[str, Any]) -> "Tractions":
        """From `as_record`."""
        return cls(*(np.array(record[name]) for name in ("lines", "normal", "tangential")))

    def as_record(self) -> dict[str, Any]:
        """Lists of numbers."""
        return {name: getattr(self, name).tolist() for name in ("lines", "normal", "tangential")}

    def __call__(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """σ_N and σ_T at s; on a line between two edges those of the right one."""
        edge = np.clip(np.searchsorted(self.lines, s, side="right") - 1, 0, len(self.normal) - 1)
        t = (s - self.lines[edge]) / np.diff(self.lines)[edge]
        n, shear = self.normal[edge], self.tangential[edge]
        quadratic = (1 - t) * (1 - 2 * t) * shear[..., 0] + 4 * t * (1 - t) * shear[..., 1]
        return (1 - t) * n[..., 0] + t * n[..., 1], quadratic + t * (2 * t - 1) * shear[..., 2]


def ordered(s: FloatArray) -> tuple[FloatArray, IntArray]:
    """Gauss points (4 e,) as (e, 4) with the edges in the order of s, and that order (e,)."""
    points = s.reshape(-1, 4)
    order = np.argsort(points[:, 0])
    return points[order], order


def edge_lines(points: FloatArray) -> FloatArray:
    """Ends (e + 1,) of neighbouring edges with these Gauss points (e, 4)."""
    length = (points[:, 3] - points[:, 0]) / (_GAUSS[3] - _GAUSS[0])
    start = points[:, 0] - _GAUSS[0] * length
    return np.append(start, start[-1] + length[-1])


def difference(first: Tractions, second: Field, lines: FloatArray | None = None) -> float:
    """√∫ (σ_N − σ_N′)² + (σ_T − σ_T′)² ds of two fields [stress × √length].

    `lines` are the places where the second is not smooth, by default its own if it has any. Between the places of both
    six Gauss points are exact for polynomials up to degree 5.
    """
    own = lines if lines is not None else getattr(second, "lines", first.lines)
    points, weights = quadrature(np.union1d(first.lines, np.clip(own, first.lines[0], first.lines[-1])))
    squares = sum((one - other) ** 2 for one, other in zip(first(points), second(points), strict=True))
    return float(np.sqrt((weights * squares).sum()))


def size(field: Field, lines: FloatArray) -> float:
    """√∫ σ_N² + σ_T² ds between the first and the last line [stress × √length]."""
    points, weights = quadrature(lines)
    return float(np.sqrt((weights * sum(values**2 for values in field(points))).sum()))


def quadrature(lines: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gauss points and weights on the intervals between lines, both (intervals, 6); empty intervals have none."""
    steps = np.diff(lines)
    kept = steps > 1e-13 * (lines[-1] - lines[0])
    start, steps = lines[:-1][kept], steps[kept]
    return start[:, None] + steps[:, None] * _POINTS, steps[:, None] * _WEIGHTS
