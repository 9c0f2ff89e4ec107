"""Polynomials on [0, 1] by coefficients of Legendre, p(t) = Σ c_k P_k(2t − 1), and Gauss points."""

from functools import cache, lru_cache

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander

from qvi_contact.basics.checks import FloatArray


def basis(degree: int, t: FloatArray) -> FloatArray:
    """Values P_k(2t − 1), shape (..., degree + 1)."""
    return np.asarray(legvander(2.0 * np.asarray(t, dtype=float) - 1.0, degree))


@lru_cache(maxsize=64)
def basis_at(degree: int, t: tuple[float, ...]) -> FloatArray:
    """The same at few points that are asked for again and again, kept and read only, shape (q, degree + 1)."""
    values = basis(degree, np.array(t))
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
def from_values(degree: int, count: int) -> FloatArray:
    """From values at `count` Gauss points to the coefficients (2k + 1) ∫ p P_k dt, shape (degree + 1, count).

    They are those of the projection on polynomials of the degree in the mean square. Mean and first moment of the data
    are kept from degree 1 on.
    """
    t, w = gauss_legendre(count)
    matrix = (2.0 * np.arange(degree + 1)[:, None] + 1.0) * (basis(degree, t) * w[:, None]).T
    matrix.flags.writeable = False
    return np.asarray(matrix)
