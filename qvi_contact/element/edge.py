"""The edge, 0 ≤ t ≤ 1: polynomials by coefficients of Legendre or of Bernstein, Gauss points, quadrature of functions.

    p(t) = Σ c_k P_k(2t − 1),     p(t) = Σ c_i B_i(t),   B_i(t) = C(p, i) tⁱ (1 − t)^(p − i),   i = 0 … p

A polynomial lies between the smallest and the largest of its Bernstein coefficients, and |Σ c_i B_i| ≤ Σ |c_i| B_i.
Those of a linear function are its values at i/p.

Functions may jump, bend or grow inside an edge. A function is taken as the polynomial through its values at Gauss
points of each edge. Where `SAMPLES` show that it is another one, the edge is halved, and so are its parts, until the
polynomial on a part is what the function is at the Gauss points of its halves, just inside its ends, and at all
samples. A jump is so enclosed down to rounding. Far from the origin rounding of the coordinates moves the points, by
more than a function is asked to be followed: what that explains is no reason to halve a part.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from math import comb
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial import Legendre, Polynomial
from numpy.polynomial.legendre import leggauss, legvander

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from solvers.basics.types import read_only

Function: TypeAlias = Callable[[IntArray, FloatArray], FloatArray]
"""Values (k, q) at reference points t (k, q) of edges by number (k,)."""

_END = 1e-6  # so far inside the ends a step on a grid line is not seen, a peak there is

SAMPLES: FloatArray = np.concatenate([[_END], (np.arange(97.0) + 0.5) / 97.0, [1.0 - _END]])
"""Points (99,) of every edge at which data are compared with the polynomial taken for them: 97 midpoints and a point
just inside each end. A difference on less than 1/97 of an edge may lie between them."""
SAMPLES.flags.writeable = False

_LEADING = 1e-13  # of a polynomial's largest coefficient: below, its degree is lower

_POLYNOMIAL: Final = 1e-11  # difference at samples, relative to the largest value, that counts as rounding
_NOTHING: Final = 1e-14  # integral of a difference on one part, relative to the largest value
_DEEPEST: Final = 48  # halvings of an edge: then a part is as small as rounding of t
_MOST: Final = 512  # parts of one edge, in the mean, that may wait
_UNSEEN: Final = 1e-3  # of an edge: what the parts that do not count where values are compared may be together
_MOVED: Final = 32.0  # differences that points moved by rounding explain, by the mean slope of a part
_ENDS: Final = SAMPLES[[0, -1]]  # of a part: a jump may lie between its Gauss points and its ends


def legendre_basis(degree: int, t: FloatArray) -> FloatArray:
    """Values P_k(2t − 1), shape (..., degree + 1)."""
    return np.asarray(legvander(2.0 * np.asarray(t, dtype=float) - 1.0, degree))


@lru_cache(maxsize=64)
def legendre_basis_at(degree: int, t: tuple[float, ...]) -> FloatArray:
    """The same at few points that are asked for again and again, kept and read only, shape (q, degree + 1)."""
    values = legendre_basis(degree, np.array(t))
    values.flags.writeable = False
    return values


@cache
def gauss_legendre(count: int) -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre points and weights on [0, 1], exact for polynomials of degree 2·count − 1."""
    points, weights = leggauss(count)
    points, weights = (points + 1.0) / 2.0, weights / 2.0
    points.flags.writeable = weights.flags.writeable = False
    return points, weights


@cache
def legendre_from_values(degree: int, count: int) -> FloatArray:
    """From values at `count` Gauss points to the coefficients (2k + 1) ∫ p P_k dt, shape (degree + 1, count).

    They are those of the projection on polynomials of the degree in the mean square. Mean and first moment of the data
    are kept from degree 1 on.
    """
    t, w = gauss_legendre(count)
    matrix = (2.0 * np.arange(degree + 1)[:, None] + 1.0) * (legendre_basis(degree, t) * w[:, None]).T
    matrix.flags.writeable = False
    return np.asarray(matrix)


def bernstein_basis(degree: int, t: FloatArray) -> FloatArray:
    """Values B_i(t_j), shape (j, degree + 1)."""
    i = np.arange(degree + 1)
    binomial = np.array([comb(degree, int(k)) for k in i], dtype=float)
    t = np.asarray(t, dtype=float)[:, None]
    return np.asarray(binomial * t**i * (1.0 - t) ** (degree - i))


def largest_quadratic(b: FloatArray) -> FloatArray:
    """Maximum on [0, 1] of each quadratic b (e, 3): at an end, or inside where it is concave."""
    curvature = 2.0 * b[:, 1] - b[:, 0] - b[:, 2]  # > 0: concave
    inside = (b[:, 1] > b[:, 0]) & (b[:, 1] > b[:, 2])
    t = np.divide(b[:, 1] - b[:, 0], curvature, out=np.zeros(len(b)), where=inside)
    return np.asarray(np.maximum(b[:, [0, 2]].max(axis=1), (bernstein_basis(2, t) * b).sum(axis=1)))


@cache
def lobatto_points(degree: int) -> FloatArray:
    """Gauss-Lobatto points (degree + 1,), the ends included: where data are interpolated.

    What polynomials through them miss on arcs, of directions that turn, is at right angles to polynomials of degree
    p − 2: smooth tractions do next to no work along it.
    """
    inside = np.asarray(Legendre.basis(degree).deriv().roots().real)  # complex from NumPy 2.5 on
    found = np.concatenate([[0.0], 0.5 + 0.25 * (inside - inside[::-1]), [1.0]])
    found.flags.writeable = False
    return found


@cache
def bernstein_from_values(degree: int) -> FloatArray:
    """Matrix (degree + 1, degree + 1) from values at `lobatto_points` to coefficients."""
    matrix = np.asarray(np.linalg.inv(bernstein_basis(degree, lobatto_points(degree))))
    matrix.flags.writeable = False
    return matrix


@cache
def product_integrals(first: int, second: int) -> FloatArray:
    """∫₀¹ B_i B_j dt of the degrees `first` and `second`, shape (first + 1, second + 1)."""
    t, w = gauss_legendre((first + second) // 2 + 1)
    found = bernstein_basis(first, t).T @ (w[:, None] * bernstein_basis(second, t))
    found.flags.writeable = False
    return found


def absolute_integrals(weight: FloatArray, coefficients: FloatArray) -> FloatArray:
    """∫₀¹ s |v| dt for s (e, q + 1) ≥ 0 and v (e, p + 1), by coefficients: exact, split where v changes sign."""
    q, p = weight.shape[1] - 1, coefficients.shape[1] - 1
    signed = np.einsum("eq,qp,ep->e", weight, product_integrals(q, p), coefficients)
    total = np.abs(signed)
    mixed = (coefficients.max(axis=1, initial=0.0) > 0.0) & (coefficients.min(axis=1, initial=0.0) < 0.0)
    t, w = gauss_legendre((q + p) // 2 + 1)
    for edge in np.flatnonzero(mixed):  # signs change at roots of Σ c_i C(p, i) rⁱ with r = t/(1 − t)
        powers = coefficients[edge] * np.array([comb(p, i) for i in range(p + 1)])
        roots = Polynomial(powers).trim(_LEADING * np.abs(powers).max()).roots()
        real = np.sort(roots.real[(np.abs(roots.imag) <= 1e-9 * (1.0 + np.abs(roots.real))) & (roots.real > 0.0)])
        breaks = np.concatenate([[0.0], real / (1.0 + real), [1.0]])
        points = breaks[:-1, None] + np.diff(breaks)[:, None] * t
        values = (
            bernstein_basis(p, points.ravel())
            @ coefficients[edge]
            * (bernstein_basis(q, points.ravel()) @ weight[edge])
        )
        total[edge] = float(np.abs(values.reshape(points.shape) @ w) @ np.diff(breaks))
    return np.asarray(total)


@dataclass(frozen=True, eq=False)
class EdgeQuadrature:
    """A function at Gauss points of k parts of edges."""

    count: int  # number of edges n
    edge: IntArray  # (k,): the edge that each part belongs to; every edge has one part or more
    # (k, q): points and weights on the reference edges; the weights of every edge have the sum 1
    t: FloatArray
    weights: FloatArray
    values: FloatArray  # (k, q): the function
    error: float  # integral of what parts that were not divided further leave of it

    @classmethod
    def joined(cls, given: "Sequence[EdgeQuadrature]") -> "EdgeQuadrature":
        """Functions on several sets of edges as one on all of them, set after set."""
        starts = np.cumsum([0, *(part.count for part in given)]).tolist()
        edge = np.concatenate([start + part.edge for start, part in zip(starts, given, strict=False)])
        at_points = zip(*((part.t, part.weights, part.values) for part in given), strict=True)
        t, weights, values = map(np.concatenate, at_points)
        return cls(starts[-1], edge, t, weights, values, sum(part.error for part in given))

    def coefficients(self, degree: int) -> FloatArray:
        """Coefficients of Legendre on every edge (n, degree + 1) of the projection in the mean square."""
        return self.integrals(legendre_basis(degree, self.t)) * (2.0 * np.arange(degree + 1) + 1.0)

    def moments(self, degree: int) -> FloatArray:
        """∫₀¹ f B_i dt on every edge (n, degree + 1)."""
        return self.integrals(bernstein_basis(degree, self.t.ravel()).reshape(*self.t.shape, -1))

    def misfit(self, coefficients: FloatArray) -> float:
        """Largest difference at points from polynomials (n, k), but for smallest parts of edges, as beside jumps."""
        share = self.weights.sum(axis=1)
        order = np.lexsort([share, self.edge])
        covered = np.cumsum(share[order])
        before = np.searchsorted(self.edge[order], self.edge[order])  # parts of earlier edges
        seen = order[covered - np.concatenate([[0.0], covered])[before] > _UNSEEN]
        shapes = legendre_basis(coefficients.shape[1] - 1, self.t[seen])
        values = (shapes @ coefficients[self.edge[seen], :, None])[..., 0]
        return float(np.abs(values - self.values[seen]).max(initial=0.0))

    def integrals(self, shapes: FloatArray) -> FloatArray:
        """∫₀¹ f s_j dt on every edge (n, j) of shape functions s_j at the points, (k, q, j)."""
        parts = np.einsum("kq,kqj->kj", self.values * self.weights, shapes)
        found = np.zeros((self.count, shapes.shape[-1]))
        np.add.at(found, self.edge, parts)
        return found


class _Parts(NamedTuple):
    """Parts of edges, from `start` (k,) on and so `long` (k,), and the function at their Gauss points (k, q)."""

    edge: IntArray
    start: FloatArray
    long: FloatArray
    values: FloatArray

    def places(self, t: FloatArray) -> FloatArray:
        """Points t (q,) of the parts as places on their edges, (k, q)."""
        return np.asarray(self.start[:, None] + self.long[:, None] * t)

    def take(self, chosen: BoolArray) -> "_Parts":
        return _Parts(self.edge[chosen], self.start[chosen], self.long[chosen], self.values[chosen])

    def allowed(self, size: float, rounding: FloatArray) -> FloatArray:
        """Differences (k,) that count as rounding, of values of this size at points moved by `rounding` (edges,)."""
        slopes = np.ptp(self.values, axis=1) / self.long
        return np.asarray(_POLYNOMIAL * size + _MOVED * rounding[self.edge] * slopes)

    def halves(self, function: Function, t: FloatArray) -> "_Parts":
        edge, long = np.repeat(self.edge, 2), np.repeat(self.long / 2.0, 2)
        start = np.stack([self.start, self.start + self.long / 2.0], axis=1).ravel()
        return _Parts(edge, start, long, function(edge, start[:, None] + long[:, None] * t))

    def missed(self, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Sum and maximum of |p − f| (k,) over the samples f (edges, 99) that lie on each part, p its polynomial."""
        first, last = (np.searchsorted(SAMPLES, ends) for ends in (self.start, self.start + self.long))
        part = np.repeat(np.arange(len(self.edge)), last - first)
        at = np.arange(len(part)) - np.repeat(np.cumsum(last - first) - last, last - first)
        points = self.values.shape[1]
        t = (SAMPLES[at] - self.start[part]) / self.long[part]
        coefficients = self.values @ legendre_from_values(points - 1, points).T
        found = (coefficients[part] * legendre_basis(points - 1, t)).sum(axis=1)
        differences, largest = np.abs(found - samples[self.edge[part], at]), np.zeros(len(self.edge))
        np.maximum.at(largest, part, differences)
        return np.asarray(np.bincount(part, differences, len(self.edge)), dtype=float), largest


def constant(value: float, count: int, points: int = 8) -> EdgeQuadrature:
    """What `adapted` finds a number on `count` edges to be, with so many Gauss points on each."""
    (t, w), each = gauss_legendre(points), np.ones((count, 1))
    return EdgeQuadrature(count, np.arange(count), each * t, each * w, np.full((count, points), float(value)), 0.0)


@cache
def _interpolations(points: int) -> tuple[FloatArray, ...]:
    """From so many points of a part to those of its halves, just inside its ends, and to the samples of an edge."""
    t, project = gauss_legendre(points)[0], legendre_from_values(points - 1, points)
    halfway = np.concatenate([t / 2.0, (1.0 + t) / 2.0])
    found = tuple((legendre_basis(points - 1, at) @ project).T for at in (halfway, _ENDS, SAMPLES))
    read_only(*found)
    return found


def adapted(function: Function, count: int, points: int = 8, rounding: FloatArray | None = None) -> EdgeQuadrature:
    """Quadrature of a function on so many edges, with so many Gauss points on each part.

    Polynomials of a degree below that have one part an edge. Rounding of coordinates may move a point of each edge by
    `rounding` (n,) along the reference edge, by default not at all.
    """
    if not count:
        return constant(0.0, 0, points)
    every, (t, w) = np.arange(count), gauss_legendre(points)
    rounding = np.zeros(count) if rounding is None else rounding
    whole = _Parts(every, np.zeros(count), np.ones(count), function(every, np.tile(t, (count, 1))))
    samples = function(every, np.tile(SAMPLES, (count, 1)))
    size = max(float(np.abs(values).max()) for values in (samples, whole.values))
    to_halves, to_ends, to_samples = _interpolations(points)
    even = np.abs(samples - whole.values @ to_samples).max(axis=1) <= whole.allowed(size, rounding)
    found, waiting, left = [whole.take(even)], whole.take(~even), np.zeros(0)
    edges = len(waiting.edge)
    for _ in range(_DEEPEST):
        if not 0 < len(waiting.edge) <= _MOST * edges:
            break
        halves = waiting.halves(function, t)
        inside = np.abs(halves.values.reshape(-1, 2 * points) - waiting.values @ to_halves)
        at_ends = np.abs(function(waiting.edge, waiting.places(_ENDS)) - waiting.values @ to_ends)
        missed, most = waiting.missed(samples)
        between = inside @ np.tile(w / 2.0, 2) + t[0] / 2.0 * at_ends.sum(axis=1)
        left = waiting.long * between + missed / len(SAMPLES)
        apart = np.maximum(most, np.concatenate([inside, at_ends], axis=1).max(axis=1))
        close = (left <= _NOTHING * size) | (apart <= waiting.allowed(size, rounding))
        found.append(waiting.take(close))
        waiting, left = halves.take(np.repeat(~close, 2)), left[~close]
    parts = _Parts(*map(np.concatenate, zip(*found, waiting, strict=True)))
    return EdgeQuadrature(count, parts.edge, parts.places(t), parts.long[:, None] * w, parts.values, float(left.sum()))
