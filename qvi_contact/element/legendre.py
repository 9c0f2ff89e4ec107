"""Polynomials on [0, 1] by coefficients of Legendre: p(t) = Σ c_k P_k(2t − 1)."""

from functools import cache

import numpy as np
from numpy.polynomial.legendre import legvander

from qvi_contact.basics.checks import FloatArray
from qvi_contact.element.hermite import gauss_legendre


def basis(degree: int, t: FloatArray) -> FloatArray:
    """Values P_k(2t − 1), shape (..., degree + 1)."""
    return np.asarray(legvander(2.0 * np.asarray(t, dtype=float) - 1.0, degree))


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
