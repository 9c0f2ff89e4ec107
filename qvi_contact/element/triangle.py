"""Triangles as images of one, polynomials there by Bernstein coefficients, quadrature, and points that divide them.

    p(λ) = Σ c_α B_α(λ),   B_α = d!/(α₀! α₁! α₂!) λ₀^α₀ λ₁^α₁ λ₂^α₂,   α₀ + α₁ + α₂ = d

with barycentric coordinates λ. Derivatives are linear maps from coefficients of degree d to those of degree d − 1,
∂B_α/∂λ_a = d B_(α − e_a), so they are exact to the last digits at any degree.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from math import factorial
from typing import Final

import numpy as np
from numpy.polynomial.legendre import leggauss

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray

CORNERS: Final[FloatArray] = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
"""Corners of the reference triangle: equilateral, so that no corner and no direction is preferred."""
CORNERS.flags.writeable = False
_TO_UNIT: Final[FloatArray] = np.linalg.inv(CORNERS[1:] - CORNERS[0])  # from its edges to (1, 0) and (0, 1)
_SIGNS: Final[FloatArray] = np.array([[1.0], [1.0], [-1.0]])  # of stresses in second derivatives

EDGES: Final = ((1, 2), (0, 2), (0, 1))
"""Corners of the three edges, edge s opposite to corner s, the lower corner first."""


@cache
def exponents(degree: int) -> IntArray:
    """The α of all Bernstein polynomials of one degree, shape (count, 3); B of vertex 0 first, that of 2 last."""
    found = np.array([(i, j, degree - i - j) for i in range(degree, -1, -1) for j in range(degree - i, -1, -1)])
    found.flags.writeable = False
    return found


def bernstein(degree: int, barycentric: FloatArray) -> FloatArray:
    """Values B_α at points λ (..., 3), shape (..., count)."""
    powers = np.asarray(barycentric, dtype=float)[..., None, :] ** exponents(degree)
    factorials = np.array([float(factorial(k)) for k in range(degree + 1)])
    return np.asarray(factorials[-1] / factorials[exponents(degree)].prod(axis=1) * powers.prod(axis=-1))


@cache
def _lowered(degree: int) -> FloatArray:
    """From coefficients to those of ∂/∂λ_a, λ taken as three independent variables; (3, count of degree − 1, count)."""
    fine, coarse = exponents(degree), exponents(degree - 1)
    matrices = np.zeros((3, len(coarse), len(fine)))
    for axis, unit in enumerate(np.eye(3, dtype=np.int64)):
        row, column = np.nonzero((coarse[:, None] + unit == fine).all(axis=-1))
        matrices[axis, row, column] = degree
    return matrices


def gradient(degree: int, slopes: FloatArray) -> FloatArray:
    """From coefficients to those of (∂/∂x, ∂/∂y), shape (2, count of degree − 1, count), by ∇λ (3, 2)."""
    return np.asarray(np.einsum("ax,acf->xcf", slopes, _lowered(degree)))


@cache
def quadrature(degree: int) -> tuple[FloatArray, FloatArray]:
    """Points λ (n, 3) and weights (n,) of sum 1, exact up to the degree: Gauss-Jacobi (Golub and Welsch, 1969)."""
    count = degree // 2 + 1
    along, weights_along = leggauss(count)
    k = np.arange(1.0, count + 1.0)
    off, centre = np.sqrt(k * (k + 1.0)) / (2.0 * k + 1.0), -1.0 / (4.0 * k**2 - 1.0)  # of the polynomials' recurrence
    towards, vectors = np.linalg.eigh(np.diag(centre) + np.diag(off[:-1], -1))
    u, v = np.meshgrid((towards + 1.0) / 2.0, (along + 1.0) / 2.0, indexing="ij")
    points = np.column_stack([((1.0 - u) * (1.0 - v)).ravel(), ((1.0 - u) * v).ravel(), u.ravel()])
    weights = np.outer(np.square(vectors[0]), weights_along / 2.0).ravel()
    points.flags.writeable = weights.flags.writeable = False
    return points, weights


def triangle_lattice(divisions: int) -> tuple[FloatArray, IntArray]:
    """Barycentric points (k, 3) that divide a triangle into equal parts, and the corners (c, 3) of these."""
    n = divisions
    j, i = np.indices((n + 1, n + 1))
    inside = i + j <= n
    number = (np.cumsum(inside) - 1).reshape(inside.shape)  # of the points inside, row by row
    i, j = i[inside], j[inside]
    upright, turned = i + j < n, i + j < n - 1

    def parts(chosen: BoolArray, corners: list[tuple[int, int]]) -> IntArray:
        return np.column_stack([number[j[chosen] + up, i[chosen] + across] for across, up in corners])

    found = [parts(upright, [(0, 0), (1, 0), (0, 1)]), parts(turned, [(1, 0), (1, 1), (0, 1)])]
    return np.column_stack([n - i - j, i, j]) / n, np.concatenate(found)


@dataclass(frozen=True, eq=False)
class AffineTriangles:
    """Triangles as images x = X₀ + J (ξ − Ξ₀) of the reference triangle with corners Ξ."""

    corners: FloatArray  # (n, 3, 2): corners X of the triangles, in any sense of rotation

    def __len__(self) -> int:
        return len(self.corners)

    def take(self, chosen: BoolArray | slice) -> AffineTriangles:
        """Some of them; with all of them, what is known of these."""
        corners = self.corners[chosen]
        return self if len(corners) == len(self) else AffineTriangles(corners)

    @cached_property
    def jacobians(self) -> FloatArray:
        """J = ∂x/∂ξ, shape (n, 2, 2)."""
        return np.asarray((_TO_UNIT @ (self.corners[:, 1:] - self.corners[:, :1])).swapaxes(1, 2))

    @cached_property
    def scales(self) -> FloatArray:
        """|det J|: area over that of the reference triangle, shape (n,)."""
        J = self.jacobians
        return np.abs(J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] * J[:, 1, 0])

    @property
    def areas(self) -> FloatArray:
        """Areas, shape (n,)."""
        return np.asarray(self.scales * np.sqrt(0.75) / 2.0)

    @cached_property
    def elongations(self) -> FloatArray:
        """Longest side over the height on it, shape (n,)."""
        sides = self.corners - self.corners.take([2, 0, 1], axis=1)
        return np.asarray(np.square(sides).sum(axis=2).max(axis=1) / (self.scales * np.sqrt(0.75)))

    @cached_property
    def hessian_maps(self) -> FloatArray:
        """From (Φ_ξξ, Φ_ηη, Φ_ξη) to (Φ_xx, Φ_yy, Φ_xy), shape (n, 3, 3)."""
        J = self.jacobians
        det = J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] * J[:, 1, 0]
        a, b, c, d = J[:, 1, 1] / det, -J[:, 0, 1] / det, -J[:, 1, 0] / det, J[:, 0, 0] / det  # ∂ξ/∂x, by rows
        found = np.array([[a * a, c * c, 2.0 * a * c], [b * b, d * d, 2.0 * b * d], [a * b, c * d, a * d + b * c]])
        return np.ascontiguousarray(found.transpose(2, 0, 1))

    @cached_property
    def stress_maps(self) -> FloatArray:
        """From (Φ_ξξ, Φ_ηη, Φ_ξη) to (σ_xx, σ_yy, σ_xy) = (Φ_yy, Φ_xx, −Φ_xy), shape (n, 3, 3)."""
        return np.asarray(self.hessian_maps.take([1, 0, 2], axis=1) * _SIGNS)
