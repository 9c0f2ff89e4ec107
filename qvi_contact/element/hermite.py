"""Cubic Hermite functions, nodal quadratics and Gauss points on the reference interval [0, 1].

Everything the Bogner-Fox-Schmit element needs is a tensor product of these, so no matrix is ever inverted and
nothing depends on where the element lies in the plane.
"""

from functools import cache

import numpy as np
from numpy.polynomial import polynomial

from qvi_contact.basics.checks import FloatArray

# Coefficients in ascending powers of t of the functions with unit value at 0, unit slope at 0, value at 1, slope at 1.
_COEFFICIENTS = np.array(
    [
        [1.0, 0.0, -3.0, 2.0],
        [0.0, 1.0, -2.0, 1.0],
        [0.0, 0.0, 3.0, -2.0],
        [0.0, 0.0, -1.0, 1.0],
    ]
)
_DERIVATIVES = [polynomial.polyder(_COEFFICIENTS, order, axis=1) for order in range(4)]


def hermite(t: FloatArray, derivative: int = 0) -> FloatArray:
    """Cubic Hermite functions, or their derivatives with respect to t, at the points t.

    Parameters
    ----------
    t : (...) array
        Reference coordinates, 0 to 1.
    derivative : int
        Order of the derivative, 0 to 3.

    Returns
    -------
    (..., 2, 2) array
        Entry ``[..., a, p]`` belongs to end a (0: t = 0, 1: t = 1) and kind p (0: value, 1: slope d/dt).

    """
    t = np.asarray(t, dtype=float)
    *lower, values = _DERIVATIVES[derivative].T
    for coefficients in reversed(lower):  # Horner's rule
        values = values * t[..., None] + coefficients
    return np.broadcast_to(values, (*t.shape, 4)).reshape(*t.shape, 2, 2)


def scaled_hermite(t: FloatArray, length: FloatArray, scale: FloatArray, derivative: int = 0) -> FloatArray:
    """Hermite functions of the physical coordinate x = x₀ + h t, for degrees of freedom (Φ, s Φ').

    The slope at end a is stored as s_a Φ'(x_a), with s_a a local mesh size, so that all degrees of freedom have one
    unit. The function of that degree of freedom is h/s_a times the reference one, and every derivative costs 1/h.

    Parameters
    ----------
    t : (...) array
        Reference coordinates.
    length : (...) array
        Interval length h [length], broadcast against t.
    scale : (..., 2) array
        Slope scales s_a at the two ends [length].
    derivative : int
        Order of the derivative with respect to x.

    Returns
    -------
    (..., 2, 2) array
        As `hermite`, entries in 1/length^derivative.

    """
    length = np.asarray(length, dtype=float)
    values: FloatArray = hermite(t, derivative) / length[..., None, None] ** derivative
    values[..., 1] *= length[..., None] / scale
    return values


def nodal_quadratics(t: FloatArray) -> FloatArray:
    """Quadratics with the value one at 0, at 1 and at 1/2, and zero at the other two, shape (..., 3)."""
    t = np.asarray(t, dtype=float)
    return np.stack([(1 - t) * (1 - 2 * t), t * (2 * t - 1), 4 * t * (1 - t)], axis=-1)


@cache
def gauss_legendre(count: int) -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre points and weights on [0, 1], exact for polynomials of degree 2·count − 1."""
    points, weights = np.polynomial.legendre.leggauss(count)
    points, weights = (points + 1.0) / 2.0, weights / 2.0
    points.flags.writeable = weights.flags.writeable = False
    return points, weights
