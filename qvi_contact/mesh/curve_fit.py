"""The bends of edges whose vertices lie on a curve that is given as a function.

Vertices are looked for along the curve by halving. Between two of them the curve is taken at points of Gauss of its
parameter; derivatives are those of the polynomial through these points, and its angle is known along its length then.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np
from numpy.polynomial.legendre import legder, legint
from scipy.spatial import cKDTree

from qvi_contact.basics.checks import FloatArray, IntArray, finite_number, positive_number, real_array
from qvi_contact.errors import InputError
from qvi_contact.mesh.arcs import arc_offsets, coefficients, cross, gauss, levelled, polynomials, turned
from qvi_contact.mesh.circles import ROUNDING
from qvi_contact.mesh.curves import Curve

CurveFunction: TypeAlias = Callable[[FloatArray], object]
"""Points (n, 2) of a curve at parameters (n,)."""

_SAMPLES: Final = 512  # of the curve at least, and so many for each edge:
_FOR_EACH: Final = 16
_HALVINGS: Final = 60
_POINTS: Final = 32  # of an edge, and coefficients of its bend before the smallest are left out
_CHECKED: Final[FloatArray] = np.linspace(0.03, 0.97, 21)  # shares of an edge where its bend is compared with the curve
_STEPS: Final = 8  # of Newton's method for the parameter from the length
_CLOSED: Final = 1e-9  # distance of both ends over the curve's size where it is closed
_EXACT: Final = 1e-12  # distance of an edge from its curve over the chord that is rounding
_RESOLVED: Final = 1e-2  # share of that below which coefficients of a curve are rounding, which slopes would enlarge
_KEPT: Final = 0.2  # share of that below which the highest coefficients are none
_LOST: Final = 64.0 * np.finfo(float).eps  # of coordinates by the differences that angles are made of


@dataclass(frozen=True, eq=False)
class _Given:
    """A curve as a function, asked for points between its ends; a closed one goes round and round."""

    name: str
    function: CurveFunction
    start: float
    stop: float
    closed: bool = False

    def points(self, t: FloatArray) -> FloatArray:
        """Points (..., 2) at parameters (...)."""
        if self.closed:
            inside = self.start + np.mod(t.ravel() - self.start, self.stop - self.start)
        else:
            inside = np.clip(t.ravel(), min(self.start, self.stop), max(self.start, self.stop))
        try:
            found = self.function(inside)
        except Exception as error:
            remedy = f"the function must take an array (n,) of parameters and return points (n, 2) ({error})"
            raise InputError(self.name, self.function, remedy) from error
        found = real_array(self.name, found, "the function must return real numbers")
        if found.shape != (inside.size, 2):
            remedy = f"the function must return points ({inside.size}, 2) for so many parameters"
            raise InputError(self.name, f"shape {found.shape}", remedy)
        if not np.isfinite(found).all():
            where = float(inside[np.argmin(np.isfinite(found).all(axis=1))])
            raise InputError(self.name, f"parameter {where:.6g}", "the function returns NaN or infinity here")
        return found.reshape(*t.shape, 2)


def ellipse(centre: tuple[float, float], axes: tuple[float, float], angle: float = 0.0) -> CurveFunction:
    """An ellipse by its half axes [length] and the angle [rad] of the first, for parameters from 0 to 2π."""
    a, b = (positive_number("axes", axis) for axis in axes)
    middle, first = np.array(centre), finite_number("angle", angle)

    def points(t: FloatArray) -> FloatArray:
        return middle + turned(np.column_stack([a * np.cos(t), b * np.sin(t)]), np.full(len(t), first))

    return points


def fitted(
    name: str, function: CurveFunction, start: float, stop: float, edges: IntArray, vertices: FloatArray
) -> Curve:
    """The bends of edges (k, 2) whose vertices are on a curve.

    Parameters
    ----------
    name : str
        What messages call the curve.
    function : callable
        Points (n, 2) [length] at parameters (n,).
    start, stop : float
        First and last parameter. If both points are the same, the curve is closed.
    edges : (k, 2) int array
        The edges; each follows the shorter way between its vertices where the curve is closed.
    vertices : (v, 2) array
        Coordinates [length].

    Raises
    ------
    InputError
        If the function is none, or fails, a vertex is off the curve, or the curve is not smooth along an edge.

    """
    if not callable(function):
        raise InputError(name, function, "give a function of an array (n,) that returns points (n, 2)")
    given = _Given(name, function, finite_number("start", start), finite_number("stop", stop))
    if given.start == given.stop:
        raise InputError("stop", stop, "give another parameter than the one that the curve starts at")
    t = np.linspace(given.start, given.stop, max(_SAMPLES, _FOR_EACH * len(edges)) + 1)
    samples = given.points(t)
    size = float(np.ptp(samples, axis=0).max())
    if not size > 0.0:
        raise InputError(name, tuple(samples[0].tolist()), "all points of the curve are this one")
    given = replace(given, closed=bool(np.hypot(*(samples[-1] - samples[0])) <= _CLOSED * size))
    numbers, places = np.unique(edges, return_inverse=True)
    found = _nearest(given, vertices[numbers], t, samples)
    _refuse_off(given, vertices[numbers], given.points(found), size)
    first, second = found[places.reshape(edges.shape)].T
    if given.closed:
        second = second - (stop - start) * np.rint((second - first) / (stop - start))
    return Curve(edges, _bends(given, first, second, vertices[edges]))


def _nearest(given: _Given, places: FloatArray, t: FloatArray, samples: FloatArray) -> FloatArray:
    """Parameters (n,) where (γ − x)·d vanishes for places x (n, 2), d from the sample before the nearest to that after.

    By halving, which needs no derivative, and no smoothness but between vertices.
    """
    nearest = np.asarray(cKDTree(samples).query(places)[1])
    before, after = np.maximum(nearest - 1, 0), np.minimum(nearest + 1, len(t) - 1)
    low, high, along = t[before], t[after], samples[after] - samples[before]
    for _ in range(_HALVINGS):
        middle = (low + high) / 2.0
        ahead = ((given.points(middle) - places) * along).sum(axis=1) > 0.0
        low, high = np.where(ahead, low, middle), np.where(ahead, middle, high)
    return np.asarray((low + high) / 2.0)


def _refuse_off(given: _Given, places: FloatArray, points: FloatArray, size: float) -> None:
    """`InputError` where a vertex is further from its point of the curve than rounding of data."""
    off = np.hypot(*(points - places).T)
    worst = int(np.argmax(off))
    if off[worst] > ROUNDING * size:
        x, y = places[worst]
        remedy = f"the vertex ({x:.6g}, {y:.6g}) is {off[worst]:.3g} off this curve: correct the curve, or its ends"
        raise InputError(given.name, given.function, remedy)


def _bends(given: _Given, first: FloatArray, second: FloatArray, ends: FloatArray) -> FloatArray:
    """Bends (k, n) of the edges between parameters (k,) of the curve; their own ends (k, 2, 2) say how they round."""
    step = (second - first)[:, None]
    corners = given.points(first[:, None] + step * np.array([0.0, 1.0]))
    chords = corners[:, 1] - corners[:, 0]
    lengths = np.hypot(*chords.T)
    exact = np.maximum(_EXACT, _LOST * np.abs(ends).max(axis=(1, 2)) / np.where(lengths > 0.0, lengths, 1.0))
    t, _ = gauss(_POINTS)
    points = coefficients((given.points(first[:, None] + step * t) - corners[:, :1]).swapaxes(1, 2))
    points = _without_rounding(points, (_RESOLVED * exact * lengths)[:, None])
    slopes = np.asarray(legder(points, axis=2), dtype=np.float64)
    tangents = _at(slopes, _by_length(slopes, t))
    turn = np.arctan2(cross(chords[:, None], tangents), (chords[:, None] * tangents).sum(axis=2))
    bends = levelled(_without_rounding(coefficients(turn), _KEPT * exact))
    there = given.points(first[:, None] + step * (1.0 + _by_length(slopes, _CHECKED)) / 2.0)
    off = np.hypot(*np.moveaxis(corners[:, :1] + arc_offsets(chords, bends, _CHECKED) - there, -1, 0)).max(axis=1)
    rough = np.flatnonzero(off > exact * lengths)
    if len(rough):
        x, y = ends[rough[0]].mean(axis=0)
        remedy = "is not smooth there, turns back, or turns too far along one edge: divide the triangles there"
        raise InputError(given.name, f"({x:.6g}, {y:.6g})", f"the curve {remedy}")
    return bends[:, : 1 + int(np.flatnonzero(bends.any(axis=0)).max(initial=0))]


def _by_length(slopes: FloatArray, t: FloatArray) -> FloatArray:
    """Parameters −1 to 1 (k, q) at shares t (q,) of the lengths of curves, from their derivatives (k, 2, n)."""
    nodes = np.tile(2.0 * gauss(_POINTS)[0] - 1.0, (len(slopes), 1))
    speed = coefficients(np.hypot(*np.moveaxis(_at(slopes, nodes), -1, 0)))
    lengths = np.asarray(legint(speed, axis=1, lbnd=-1), dtype=np.float64)
    wanted = t * polynomials(lengths, np.ones((len(slopes), 1)))
    found = np.tile(2.0 * t - 1.0, (len(slopes), 1))
    for _ in range(_STEPS):
        rate = polynomials(speed, found)
        step = (polynomials(lengths, found) - wanted) / np.where(rate != 0.0, rate, 1.0)
        found = np.clip(found - step, -1.0, 1.0)
    return found


def _at(curves: FloatArray, x: FloatArray) -> FloatArray:
    """Curves by coefficients of Legendre (k, 2, n) at x (k, q), −1 to 1; shape (k, q, 2)."""
    return np.stack([polynomials(curves[:, axis], x) for axis in (0, 1)], axis=-1)


def _without_rounding(terms: FloatArray, rounding: FloatArray) -> FloatArray:
    """Coefficients (..., n) up to the last one that is larger than rounding (...), 0 behind it."""
    large = np.abs(terms) > rounding[..., None]
    kept = np.cumsum(large[..., ::-1], axis=-1)[..., ::-1] > 0
    return np.where(kept, terms, 0.0)
