"""Rows that are samples of polynomials along each contact edge: σ_N and σ_T of given degrees."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array

from solvers.basics.checks import real_array
from solvers.basics.types import Matrix, Sparse, Vector
from solvers.errors import InputError


@dataclass(frozen=True, eq=False)
class EdgeRows:
    """Contact rows in groups of q consecutive points, one group an edge, abscissae t in [0, 1] along it.

    Where it is affine, a traction or field is given by its end values, where it is quadratic by Bernstein coefficients:

        p(t) = v₀ (1 − t) + v₁ t,        p(t) = b₀ (1 − t)² + 2 b₁ t (1 − t) + b₂ t²

    Row multipliers m act on tractions by Σ m_i p(t_i) = π·v = ℓ·b with the functionals π (2,) and ℓ (3,) of an edge.

    Attributes
    ----------
    points : (q,) distinct, more than the degrees
    normal_degree, shear_degree : degrees of σ_N and σ_T along an edge. Strict admissibility (`FrictionQVI.strict`) is
        for σ_N affine and σ_T quadratic

    """

    points: Vector
    normal_degree: int = 1
    shear_degree: int = 2

    def __post_init__(self) -> None:
        points = real_array("edges.points", self.points, "give a vector of real numbers")
        least = max(self.normal_degree, self.shear_degree) + 1
        if points.ndim != 1 or len(np.unique(points)) < max(least, points.size):
            raise InputError("edges.points", self.points, f"give {least} or more different points")
        if not (np.isfinite(points).all() and points.min() >= 0.0 and points.max() <= 1.0):
            raise InputError("edges.points", self.points, "give points in [0, 1]")
        points.setflags(write=False)
        object.__setattr__(self, "points", points)

    @property
    def affine_and_quadratic(self) -> bool:
        """Whether σ_N is affine and σ_T quadratic, at enough points to tell."""
        return self.normal_degree <= 1 and self.shear_degree <= 2 and self.count >= 3

    @property
    def count(self) -> int:
        """Points an edge, q."""
        return len(self.points)

    @cached_property
    def affine(self) -> Matrix:
        """Values at the points (q, 2) of 1 − t and t."""
        return affine_basis(self.points)

    @cached_property
    def quadratic(self) -> Matrix:
        """Values at the points (q, 3) of (1 − t)², 2t(1 − t) and t²."""
        return quadratic_basis(self.points)

    @cached_property
    def to_ends(self) -> Matrix:
        """(2, q), end values of the affine function nearest to values at the points, in least squares."""
        return np.asarray(np.linalg.pinv(self.affine))

    @cached_property
    def to_bernstein(self) -> Matrix:
        """(3, q), Bernstein coefficients of the quadratic nearest to values at the points, in least squares."""
        return np.asarray(np.linalg.pinv(self.quadratic))

    def grouped(self, values: object) -> Matrix:
        """Values at the points (m,) edge by edge (e, q); `InputError` if they are no whole number of edges."""
        array = real_array("values", values)
        if array.ndim != 1 or array.size % self.count:
            raise InputError("values", f"shape {array.shape}", f"give a vector of {self.count} values an edge")
        return array.reshape(-1, self.count)

    def ends(self, values: Vector) -> Matrix:
        """End values (e, 2) from values at the points (m,); exact where they are affine."""
        return self.grouped(values) @ self.to_ends.T

    def bernstein(self, values: Vector) -> Matrix:
        """Bernstein coefficients (e, 3) from values at the points (m,); exact where they are quadratic."""
        return self.grouped(values) @ self.to_bernstein.T

    def at_points(self, coefficients: Matrix) -> Vector:
        """Values at the points (m,) from end values (e, 2) or Bernstein coefficients (e, 3)."""
        array = real_array("coefficients", coefficients)
        if array.ndim != 2 or array.shape[1] not in (2, 3):
            raise InputError("coefficients", f"shape {array.shape}", "give 2 end values or 3 coefficients an edge")
        basis = self.affine if array.shape[1] == 2 else self.quadratic
        return np.asarray((array @ basis.T).ravel())

    def on_ends(self, multipliers: Vector) -> Matrix:
        """The functionals π (e, 2) that row multipliers (m,) are on affine functions."""
        return self.grouped(multipliers) @ self.affine

    def on_bernstein(self, multipliers: Vector) -> Matrix:
        """The functionals ℓ (e, 3) that row multipliers (m,) are on quadratic functions."""
        return self.grouped(multipliers) @ self.quadratic

    def rows(self, functionals: Matrix) -> Vector:
        """Row multipliers (m,) that are the functionals π (e, 2) or ℓ (e, 3): the transposed `ends` or `bernstein`."""
        maps = self.to_ends if functionals.shape[1] == 2 else self.to_bernstein
        return np.asarray((functionals @ maps).ravel())

    def matrix(self, map_: Matrix, edges: int) -> Sparse:
        """A map of one edge (k, q) applied to each: block diagonal (k e, q e)."""
        k, q = map_.shape
        rows = k * np.repeat(np.arange(edges), q)[:, None] + np.arange(k)
        starts = k * np.arange(edges * q + 1)
        return csc_array((np.tile(map_.T.ravel(), edges), rows.ravel(), starts), (edges * k, edges * q))


def affine_basis(t: Vector) -> Matrix:
    """1 − t and t, shape (..., 2)."""
    t = np.asarray(t, dtype=np.float64)
    return np.stack([1.0 - t, t], axis=-1)


def quadratic_basis(t: Vector) -> Matrix:
    """(1 − t)², 2t(1 − t) and t², shape (..., 3)."""
    t = np.asarray(t, dtype=np.float64)
    return np.stack([(1.0 - t) ** 2, 2.0 * t * (1.0 - t), t**2], axis=-1)
