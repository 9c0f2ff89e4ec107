"""Polynomials on [0, 1] by coefficients of Legendre, p(t) = Σ c_k P_k(2t − 1), and Gauss points."""

from functools import cache, lru_cache
from math import comb

import numpy as np

from qvi_contact.basics.checks import FloatArray


def basis(degree: int, t: FloatArray) -> FloatArray:
    """Values P_k(2t − 1), shape (..., degree + 1)."""
    x = 2.0 * np.asarray(t, dtype=float) - 1.0
    values = np.ones((*x.shape, degree + 1))
    if degree:
        values[..., 1] = x
    for k in range(2, degree + 1):  # k P_k = (2k − 1) x P_(k−1) − (k − 1) P_(k−2)
        values[..., k] = (values[..., k - 1] * x * (2 * k - 1) - values[..., k - 2] * (k - 1)) / k
    return values


@lru_cache(maxsize=64)
def basis_at(degree: int, t: tuple[float, ...]) -> FloatArray:
    """The same at few points that are asked for again and again, kept and read only, shape (q, degree + 1)."""
    values = basis(degree, np.array(t))
    values.flags.writeable = False
    return values


@cache
def gauss_legendre(count: int) -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre points and weights on [0, 1], exact for polynomials of degree 2·count − 1."""
    points, weights = np.polynomial.legendre.leggauss(count)
    points, weights = (points + 1.0) / 2.0, weights / 2.0
    points.flags.writeable = weights.flags.writeable = False
    return points, weights


@cache
def from_values(degree: int, count: int) -> FloatArray:
    """From values at `count` Gauss points to the coefficients (2k + 1) ∫ p P_k dt, shape (degree + 1, count).

    They are those of the projection on polynomials of the degree in the mean square. Mean and first moment of the data
    are kept from degree 1 on.
    """
    t, w = gauss_legendre(count)
    matrix = (2.0 * np.arange(degree + 1)[:, None] + 1.0) * (basis(degree, t) * w[:, None]).T
    matrix.flags.writeable = False
    return np.asarray(matrix)


@cache
def to_bernstein(degree: int) -> FloatArray:
    """From coefficients of Legendre to those of Bernstein polynomials of the degree, both degree + 1.

    P_k(2t − 1) = Σ_i (−1)^(k − i) C(k, i)² tⁱ (1 − t)^(k − i), its degree raised.
    """
    matrix = np.zeros((degree + 1, degree + 1))
    for k in range(degree + 1):
        for i in range(k + 1):
            for j in range(i, degree - k + i + 1):
                matrix[j, k] += (-1) ** (k - i) * comb(k, i) ** 2 * comb(degree - k, j - i) / comb(degree, j)
    matrix.flags.writeable = False
    return matrix
