"""Polynomials on [0, 1] by Bernstein coefficients: values, data as coefficients, and integrals.

    p(t) = Σ c_i B_i(t),   B_i(t) = C(p, i) tⁱ (1 − t)^(p − i),   i = 0 … p

A polynomial lies between the smallest and the largest of its coefficients, and |Σ c_i B_i| ≤ Σ |c_i| B_i. Coefficients
of a linear function are its values at i/p.
"""

from functools import cache
from math import comb

import numpy as np
from numpy.polynomial import Legendre, Polynomial

from qvi_contact.basics.checks import FloatArray
from qvi_contact.element.legendre import gauss_legendre

_END = 1e-6  # so far inside the ends a step on a grid line is not seen, a peak there is

SAMPLES: FloatArray = np.concatenate([[_END], (np.arange(97.0) + 0.5) / 97.0, [1.0 - _END]])
"""Points (99,) of every edge at which data are compared with the polynomial taken for them: 97 midpoints and a point
just inside each end. A difference on less than 1/97 of an edge may lie between them."""
SAMPLES.flags.writeable = False

_LEADING = 1e-13  # of a polynomial's largest coefficient: below, its degree is lower


def basis(degree: int, t: FloatArray) -> FloatArray:
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
    return np.asarray(np.maximum(b[:, [0, 2]].max(axis=1), (basis(2, t) * b).sum(axis=1)))


@cache
def nodes(degree: int) -> FloatArray:
    """Gauss-Lobatto points (degree + 1,), the ends included: where data are interpolated.

    What polynomials through them miss on arcs, of directions that turn, is at right angles to polynomials of degree
    p − 2: smooth tractions do next to no work along it.
    """
    inside = np.asarray(Legendre.basis(degree).deriv().roots().real)  # complex from NumPy 2.5 on
    found = np.concatenate([[0.0], 0.5 + 0.25 * (inside - inside[::-1]), [1.0]])
    found.flags.writeable = False
    return found


@cache
def from_values(degree: int) -> FloatArray:
    """Matrix (degree + 1, degree + 1) from values at `nodes` to coefficients."""
    matrix = np.asarray(np.linalg.inv(basis(degree, nodes(degree))))
    matrix.flags.writeable = False
    return matrix


@cache
def product_integrals(first: int, second: int) -> FloatArray:
    """∫₀¹ B_i B_j dt of the degrees `first` and `second`, shape (first + 1, second + 1)."""
    t, w = gauss_legendre((first + second) // 2 + 1)
    found = basis(first, t).T @ (w[:, None] * basis(second, t))
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
        values = basis(p, points.ravel()) @ coefficients[edge] * (basis(q, points.ravel()) @ weight[edge])
        total[edge] = float(np.abs(values.reshape(points.shape) @ w) @ np.diff(breaks))
    return np.asarray(total)
