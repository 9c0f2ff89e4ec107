"""Affine triangles: their maps from the reference triangle, Bernstein polynomials, quadrature and lattices of points.

    p(λ) = Σ c_α B_α(λ),   B_α = d!/(α₀! α₁! α₂!) λ₀^α₀ λ₁^α₁ λ₂^α₂,   α₀ + α₁ + α₂ = d

with barycentric coordinates λ. Derivatives are linear maps from coefficients of degree d to coefficients of degree
d − 1, ∂B_α/∂λ_a = d B_(α − e_a), and so exact to rounding at any degree.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from math import factorial
from typing import Final

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.special import roots_jacobi

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray

CORNERS: Final[FloatArray] = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
"""Corners of the reference triangle; it is equilateral, so that no corner is preferred."""
CORNERS.flags.writeable = False
_TO_UNIT: Final[FloatArray] = np.linalg.inv(CORNERS[1:] - CORNERS[0])  # edges from corner 0 to (1, 0) and (0, 1)
_SIGNS: Final[FloatArray] = np.array([[1.0], [1.0], [-1.0]])  # of σ in terms of second derivatives of Φ

EDGES: Final = ((1, 2), (0, 2), (0, 1))
"""Corners of the three edges, edge s opposite to corner s, the lower corner first."""


@cache
def exponents(degree: int) -> IntArray:
    """Exponents α of all Bernstein polynomials of a degree, shape (count, 3), from (degree, 0, 0) to (0, 0, degree)."""
    alpha = np.array([(i, j, degree - i - j) for i in range(degree, -1, -1) for j in range(degree - i, -1, -1)])
    alpha.flags.writeable = False
    return alpha


def bernstein(degree: int, barycentric: FloatArray) -> FloatArray:
    """Values B_α at points λ (..., 3), shape (..., count)."""
    powers = np.asarray(barycentric, dtype=float)[..., None, :] ** exponents(degree)
    factorials = np.array([float(factorial(k)) for k in range(degree + 1)])
    return np.asarray(factorials[-1] / factorials[exponents(degree)].prod(axis=1) * powers.prod(axis=-1))


def gradient(degree: int, slopes: FloatArray) -> FloatArray:
    """Matrices from coefficients to those of d derivatives, (d, count of degree − 1, count), of slopes ∇λ (3, d)."""
    fine, coarse = exponents(degree), exponents(degree - 1)
    matrices = np.zeros((slopes.shape[1], len(coarse), len(fine)))
    for slope, unit in zip(slopes, np.eye(3, dtype=np.int64), strict=True):
        row, column = np.nonzero((coarse[:, None] + unit == fine).all(axis=-1))
        matrices[:, row, column] = degree * slope[:, None]
    return matrices


@cache
def quadrature(degree: int) -> tuple[FloatArray, FloatArray]:
    """Points λ (n, 3), weights (n,) of sum 1, exact to the degree: Gauss-Legendre × Gauss-Jacobi."""
    count = degree // 2 + 1
    along, weights_along = leggauss(count)
    nodes, weights_across = roots_jacobi(count, 1.0, 0.0)
    u, v = np.meshgrid((nodes + 1.0) / 2.0, (along + 1.0) / 2.0, indexing="ij")
    points = np.column_stack([((1.0 - u) * (1.0 - v)).ravel(), ((1.0 - u) * v).ravel(), u.ravel()])
    weights = np.outer(weights_across, weights_along).ravel() / 4.0
    points.flags.writeable = weights.flags.writeable = False
    return points, weights


def triangle_lattice(divisions: int) -> tuple[FloatArray, IntArray]:
    """Barycentric points (k, 3) that divide each side into `divisions` parts, and the triangles (c, 3) between them."""
    n = divisions
    j, i = np.indices((n + 1, n + 1))
    inside = i + j <= n
    number = (np.cumsum(inside) - 1).reshape(inside.shape)  # of the points in the triangle, row by row
    i, j = i[inside], j[inside]
    upright, inverted = i + j < n, i + j < n - 1

    def triangles(chosen: BoolArray, corners: list[tuple[int, int]]) -> IntArray:
        return np.column_stack([number[j[chosen] + dj, i[chosen] + di] for di, dj in corners])

    found = [triangles(upright, [(0, 0), (1, 0), (0, 1)]), triangles(inverted, [(1, 0), (1, 1), (0, 1)])]
    return np.column_stack([n - i - j, i, j]) / n, np.concatenate(found)


@dataclass(frozen=True, eq=False)
class AffineTriangles:
    """n triangles as images x = X₀ + J (ξ − Ξ₀) of the reference triangle with corners Ξ."""

    corners: FloatArray  # (n, 3, 2): corners X, in either sense of rotation

    def __len__(self) -> int:
        return len(self.corners)

    def take(self, chosen: BoolArray | slice) -> AffineTriangles:
        """The chosen triangles; the same object, with its cached values, if all are chosen."""
        corners = self.corners[chosen]
        return self if len(corners) == len(self) else AffineTriangles(corners)

    @cached_property
    def jacobians(self) -> FloatArray:
        """J = ∂x/∂ξ, shape (n, 2, 2)."""
        return np.asarray((_TO_UNIT @ (self.corners[:, 1:] - self.corners[:, :1])).swapaxes(1, 2))

    @cached_property
    def scales(self) -> FloatArray:
        """|det J|: ratio of area to that of the reference triangle, shape (n,)."""
        J = self.jacobians
        return np.abs(J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] * J[:, 1, 0])

    @property
    def areas(self) -> FloatArray:
        """Areas, shape (n,)."""
        return np.asarray(self.scales * np.sqrt(0.75) / 2.0)

    @cached_property
    def elongations(self) -> FloatArray:
        """Ratio of the longest side to the height on it, shape (n,)."""
        sides = self.corners - self.corners.take([2, 0, 1], axis=1)
        return np.asarray(np.square(sides).sum(axis=2).max(axis=1) / (self.scales * np.sqrt(0.75)))

    @cached_property
    def hessian_maps(self) -> FloatArray:
        """Matrices from (Φ_ξξ, Φ_ηη, Φ_ξη) to (Φ_xx, Φ_yy, Φ_xy), shape (n, 3, 3)."""
        J = self.jacobians
        det = J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] * J[:, 1, 0]
        a, b, c, d = J[:, 1, 1] / det, -J[:, 0, 1] / det, -J[:, 1, 0] / det, J[:, 0, 0] / det  # ∂ξ/∂x, by rows
        maps = np.array([[a * a, c * c, 2.0 * a * c], [b * b, d * d, 2.0 * b * d], [a * b, c * d, a * d + b * c]])
        return np.ascontiguousarray(maps.transpose(2, 0, 1))

    @cached_property
    def stress_maps(self) -> FloatArray:
        """Matrices from (Φ_ξξ, Φ_ηη, Φ_ξη) to (σ_xx, σ_yy, σ_xy) = (Φ_yy, Φ_xx, −Φ_xy), shape (n, 3, 3)."""
        return np.asarray(self.hessian_maps.take([1, 0, 2], axis=1) * _SIGNS)
