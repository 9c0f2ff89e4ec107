"""The edge, 0 ≤ t ≤ 1: polynomials by Legendre or Bernstein coefficients, Gauss points, quadrature of functions.

    p(t) = Σ c_k P_k(2t − 1),     p(t) = Σ c_i B_i(t),   B_i(t) = C(p, i) tⁱ (1 − t)^(p − i),   i = 0 … p

A polynomial lies between the smallest and the largest of its Bernstein coefficients, and |Σ c_i B_i| ≤ Σ |c_i| B_i.
The Bernstein coefficients of a linear function are its values at i/p.

Quadrature of functions that may jump, bend or grow inside an edge: a function is replaced by the polynomial through its
values at the Gauss points of the edge. If the two differ at one of the `SAMPLES`, the edge is halved, and so are its
parts, until they agree at the samples of each, which include those of the whole. So a jump is enclosed down to
rounding. Far from the origin the rounding of coordinates moves the points; differences that this explains do not count.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from math import comb
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.polynomial import Legendre, Polynomial
from numpy.polynomial.legendre import leggauss, legvander

from qvi_contact.basics.checks import FloatArray, IntArray

Function: TypeAlias = Callable[[IntArray, FloatArray], FloatArray]
"""Values (k, q) from numbers (k,) of edges and reference points t (k, q) on them."""

_END_DISTANCE = 1e-6  # from an end: a jump at the vertex, moved by rounding, is excluded, a peak at the end is sampled

SAMPLES: FloatArray = np.concatenate([[_END_DISTANCE], np.arange(1.0, 96.0) / 96.0, [1.0 - _END_DISTANCE]])
"""Points (97,) of every edge at which a function is compared with its polynomial: one just inside each end, and those
between 96 equal parts. A peak narrower than 1/96 of the edge may lie between two of them."""
SAMPLES.flags.writeable = False

_LEADING_TOLERANCE = 1e-13  # leading coefficient, relative to the largest, that counts as zero

_SAMPLE_TOLERANCE: Final = 1e-11  # difference at samples, relative to the largest value, that counts as rounding
_INTEGRAL_TOLERANCE: Final = 1e-14  # integral of the difference on one part, relative to the largest value
_MAX_HALVINGS: Final = 48  # a part is as small then as the rounding of t
_MAX_PARTS: Final = 512  # parts that are not accepted yet, per divided edge
_IGNORED: Final = 1e-3  # fraction of each edge: the smallest parts, which `misfit` leaves out, have no more together
_SLOPE_FACTOR: Final = 32.0  # a point moved by rounding changes a value by up to this × (rounding × mean slope + noise)


def legendre_basis(degree: int, t: FloatArray) -> FloatArray:
    """Values P_k(2t − 1), shape (..., degree + 1)."""
    return np.asarray(legvander(2.0 * np.asarray(t, dtype=float) - 1.0, degree))


@lru_cache(maxsize=64)
def legendre_basis_at(degree: int, t: tuple[float, ...]) -> FloatArray:
    """`legendre_basis`, cached for points used often; read only, shape (q, degree + 1)."""
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
    """Matrix (degree + 1, count) from values at `count` Gauss points to the coefficients (2k + 1) ∫ p P_k dt.

    It is the L2 projection on polynomials of this degree, which from degree 1 on keeps mean and first moment.
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
    """Gauss-Lobatto points (degree + 1,), ends included, at which data are interpolated.

    On arcs, where directions turn, the interpolation error is nearly orthogonal to polynomials of degree p − 2, so
    smooth tractions do almost no work on it.
    """
    interior = np.asarray(Legendre.basis(degree).deriv().roots().real)  # complex from NumPy 2.5 on
    points = np.concatenate([[0.0], 0.5 + 0.25 * (interior - interior[::-1]), [1.0]])
    points.flags.writeable = False
    return points


@cache
def bernstein_from_values(degree: int) -> FloatArray:
    """Matrix (degree + 1, degree + 1) from values at `lobatto_points` to Bernstein coefficients."""
    matrix = np.asarray(np.linalg.inv(bernstein_basis(degree, lobatto_points(degree))))
    matrix.flags.writeable = False
    return matrix


@cache
def product_integrals(first: int, second: int) -> FloatArray:
    """∫₀¹ B_i B_j dt of the degrees `first` and `second`, shape (first + 1, second + 1)."""
    t, w = gauss_legendre((first + second) // 2 + 1)
    integrals = bernstein_basis(first, t).T @ (w[:, None] * bernstein_basis(second, t))
    integrals.flags.writeable = False
    return integrals


def absolute_integrals(weight: FloatArray, coefficients: FloatArray) -> FloatArray:
    """∫₀¹ s |v| dt (e,), exact, from Bernstein coefficients of s ≥ 0 (e, q + 1) and v (e, p + 1)."""
    q, p = weight.shape[1] - 1, coefficients.shape[1] - 1
    signed = np.einsum("eq,qp,ep->e", weight, product_integrals(q, p), coefficients)
    total = np.abs(signed)
    changes_sign = (coefficients.max(axis=1, initial=0.0) > 0.0) & (coefficients.min(axis=1, initial=0.0) < 0.0)
    t, w = gauss_legendre((q + p) // 2 + 1)
    for edge in np.flatnonzero(changes_sign):  # zeros of v are roots of Σ c_i C(p, i) rⁱ, r = t/(1 − t)
        powers = coefficients[edge] * np.array([comb(p, i) for i in range(p + 1)])
        roots = Polynomial(powers).trim(_LEADING_TOLERANCE * np.abs(powers).max()).roots()
        real_roots = np.sort(roots.real[(np.abs(roots.imag) <= 1e-9 * (1.0 + np.abs(roots.real))) & (roots.real > 0.0)])
        breaks = np.concatenate([[0.0], real_roots / (1.0 + real_roots), [1.0]])
        points = breaks[:-1, None] + np.diff(breaks)[:, None] * t
        v, s = (bernstein_basis(len(c) - 1, points.ravel()) @ c for c in (coefficients[edge], weight[edge]))
        total[edge] = float(np.abs((v * s).reshape(points.shape) @ w) @ np.diff(breaks))
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
    error: float  # estimated integral of the error on parts that were left unresolved

    @classmethod
    def joined(cls, functions: "Sequence[EdgeQuadrature]") -> "EdgeQuadrature":
        """Functions on several sets of edges as one function on all edges, in the order of the sets."""
        starts = np.cumsum([0, *(part.count for part in functions)]).tolist()
        edge = np.concatenate([start + part.edge for start, part in zip(starts, functions, strict=False)])
        arrays = zip(*((part.t, part.weights, part.values) for part in functions), strict=True)
        t, weights, values = map(np.concatenate, arrays)
        return cls(starts[-1], edge, t, weights, values, sum(part.error for part in functions))

    def coefficients(self, degree: int) -> FloatArray:
        """Legendre coefficients (n, degree + 1) of the L2 projection on every edge."""
        return self.integrals(legendre_basis(degree, self.t)) * (2.0 * np.arange(degree + 1) + 1.0)

    def moments(self, degree: int) -> FloatArray:
        """Moments ∫₀¹ f B_i dt on every edge, shape (n, degree + 1)."""
        return self.integrals(bernstein_basis(degree, self.t.ravel()).reshape(*self.t.shape, -1))

    def misfit(self, coefficients: FloatArray) -> float:
        """Largest difference from polynomials with Legendre coefficients (n, k), without the parts around jumps."""
        length = self.weights.sum(axis=1)
        order = np.lexsort([length, self.edge])
        covered = np.cumsum(length[order])
        first_of_edge = np.searchsorted(self.edge[order], self.edge[order])  # number of parts of earlier edges
        compared = order[covered - np.concatenate([[0.0], covered])[first_of_edge] > _IGNORED]
        shapes = legendre_basis(coefficients.shape[1] - 1, self.t[compared])
        values = (shapes @ coefficients[self.edge[compared], :, None])[..., 0]
        return float(np.abs(values - self.values[compared]).max(initial=0.0))

    def integrals(self, shapes: FloatArray) -> FloatArray:
        """∫₀¹ f s_j dt on every edge, shape (n, j), for shape functions s_j with values (k, q, j) at the points."""
        part_integrals = np.einsum("kq,kqj->kj", self.values * self.weights, shapes)
        integrals = np.zeros((self.count, shapes.shape[-1]))
        np.add.at(integrals, self.edge, part_integrals)
        return integrals


def constant(value: float, count: int, points: int = 8) -> EdgeQuadrature:
    """The quadrature of a constant on `count` edges with `points` Gauss points on each."""
    (t, w), ones = gauss_legendre(points), np.ones((count, 1))
    return EdgeQuadrature(count, np.arange(count), ones * t, ones * w, np.full((count, points), float(value)), 0.0)


def adapted(
    function: Function, count: int, points: int = 8, rounding: FloatArray | None = None,
    noise: Callable[[], FloatArray] | None = None,
) -> EdgeQuadrature:  # fmt: skip
    """Quadrature of a function on `count` edges with `points` Gauss points on each part.

    A polynomial of degree below `points` needs one part per edge. By edge (n,), 0 by default: `rounding` is the error
    of t, `noise` gives the change of values where rounding moves points to the side of their edge, if it is needed.
    """
    if not count:
        return constant(0.0, 0, points)
    t, w = gauss_legendre(points)
    to_samples = legendre_basis(points - 1, SAMPLES) @ legendre_from_values(points - 1, points)
    rounding, across = np.zeros(count) if rounding is None else rounding, np.zeros(count)
    edge, start, length = np.arange(count), np.zeros(count), np.ones(count)
    accepted, size, n_divided, error = list[tuple[Any, ...]](), 0.0, count, 0.0
    for halvings in range(_MAX_HALVINGS + 1):
        step = 8 if halvings >= 3 else 1  # eighths of an edge, and smaller parts, need fewer samples
        places = start[:, None] + length[:, None] * np.concatenate([t, SAMPLES[::step]])
        found = function(edge, places)
        values, size = found[:, :points], size or float(np.abs(found).max())
        differences = np.abs(values @ to_samples[::step].T - found[:, points:])
        slopes = np.ptp(values, axis=1) / length  # a point moved by rounding changes a value in proportion to these
        tolerances = _SAMPLE_TOLERANCE * size + _SLOPE_FACTOR * (rounding[edge] * slopes + across[edge])
        errors = length * differences.mean(axis=1)
        is_open = (errors > _INTEGRAL_TOLERANCE * size) & (differences.max(axis=1) > tolerances)
        if halvings == 0:
            if noise is not None and is_open.any():
                across = noise()
                is_open &= differences.max(axis=1) > tolerances + _SLOPE_FACTOR * across
            n_divided = int(is_open.sum())
        if halvings == _MAX_HALVINGS or is_open.sum() > _MAX_PARTS * n_divided:  # left unresolved
            is_open, error = np.zeros_like(is_open), float(errors[is_open].sum())
        accepted.append(tuple(part[~is_open] for part in (edge, places[:, :points], np.outer(length, w), values)))
        if not is_open.any():
            break
        edge, length = np.repeat(edge[is_open], 2), np.repeat(length[is_open] / 2.0, 2)
        start = np.repeat(start[is_open], 2)
        start[1::2] += length[1::2]
    edges, places, weights, values = map(np.concatenate, zip(*accepted, strict=True))
    return EdgeQuadrature(count, edges, places, weights, values, error)
