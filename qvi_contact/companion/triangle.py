"""The reference triangle of displacements: polynomials of degree p by Bernstein coefficients.

A function on a triangle is Σ c_α B_α(λ), λ = (1 − t₁ − t₂, t₁, t₂), with B_α ≥ 0 of sum 1. Its trace on a side is the
polynomial whose coefficients are those of the side, so that contact conditions and prescribed data are conditions on
single coefficients. Derivatives along the two reference axes act on differences of neighbouring coefficients,

    ∂u/∂t_a = Σ_k (D_a c)_k B_k,

so that a rigid motion, however large, leaves no rounding behind. Reference points are (t₁, t₂) with corner 0 in the
origin.
"""

from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import ClassVar, Final

import numpy as np
from skfem import MeshTri  # type: ignore[import-untyped]
from skfem.assembly import Dofs  # type: ignore[import-untyped]
from skfem.element import Element  # type: ignore[import-untyped]
from skfem.refdom import RefTri  # type: ignore[import-untyped]

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.element.triangle import bernstein, exponents, gradient, quadrature, triangle_lattice
from qvi_contact.errors import InputError

_SIDES: Final = ((0, 1), (1, 2), (0, 2))  # in scikit-fem's order, from the lower number of a corner to the higher one
_SLOPES: Final = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])  # of λ

DEGREES: Final = (1, 2, 3, 4, 5)
"""Degrees of displacements that are offered."""

DEFAULT_DEGREE: Final = 3
"""The one taken where none is given."""


def degree_beside(airy: int) -> int:
    """The degree that goes with Airy functions of a degree, for bounds of the energy: the same.

    Displacements of one degree less are of the same order, but hold half of the gap.
    """
    return min(airy, DEGREES[-1])


def triangle(degree: int | None = None) -> "Triangle":
    """The triangle with displacements of a degree, the same again for the same degree; see `DEGREES`.

    Raises
    ------
    InputError
        If that degree is not offered.

    """
    chosen = DEFAULT_DEGREE if degree is None else degree
    if isinstance(chosen, bool) or not isinstance(chosen, int | np.integer) or chosen not in DEGREES:
        raise InputError("degree", degree, f"give one of {', '.join(map(str, DEGREES))}")
    return _triangle(int(chosen))


@cache
def _triangle(degree: int) -> "Triangle":
    return Triangle(degree)


@dataclass(frozen=True)
class Triangle:
    """P_p with n coefficients, which come in the order of `element.triangle.exponents`.

    Corners have ascending numbers, so that neighbours agree on the direction of a side.
    """

    degree: int

    area: ClassVar[float] = 0.5

    @cached_property
    def places(self) -> FloatArray:
        """The points α/p (n, 2) of the coefficients: those of a linear function are its values there."""
        return np.asarray(exponents(self.degree)[:, 1:] / self.degree)

    @cached_property
    def corners(self) -> IntArray:
        """The coefficients of α = p e_k, in the order of the mesh's cells, shape (3,)."""
        return np.asarray(np.argmax(exponents(self.degree), axis=0))

    @cached_property
    def sides(self) -> IntArray:
        """The coefficients (3, 3, p + 1) from one corner to another along a side; −1 from a corner to itself."""
        alpha, found = exponents(self.degree), np.full((3, 3, self.degree + 1), -1)
        for first, last in _SIDES:
            on_side = np.flatnonzero(alpha[:, first] + alpha[:, last] == self.degree)
            side = on_side[np.argsort(alpha[on_side, last])]
            found[first, last], found[last, first] = side, side[::-1]
        return found

    @cached_property
    def differences(self) -> tuple[FloatArray, FloatArray]:
        """D₁ and D₂ (m, n): p (c_{α+e₁} − c_{α+e₀}) and p (c_{α+e₂} − c_{α+e₀})."""
        along_x, along_y = gradient(self.degree, _SLOPES)
        return along_x, along_y

    def values(self, t: FloatArray) -> FloatArray:
        """B_α(λ) at points t (..., 2), shape (..., n)."""
        return bernstein(self.degree, barycentric(t))

    def derivative_values(self, t: FloatArray) -> FloatArray:
        """B_k of the derivatives, those of degree p − 1, at points t (..., 2), shape (..., m)."""
        return bernstein(self.degree - 1, barycentric(t))

    def quadrature(self, count: int) -> tuple[FloatArray, FloatArray]:
        """Gauss points (q, 2), `count` in each direction of the collapsed square, and weights (q,) of sum `area`."""
        points, weights = quadrature(2 * count - 1)
        return points[:, 1:], weights / 2.0

    def lattice(self, divisions: int) -> tuple[FloatArray, IntArray]:
        """Points (k, 2) that divide the triangle, so many parts along each side, and the parts' corners (c, 3)."""
        points, parts = triangle_lattice(divisions)
        return points[:, 1:], parts

    def table(self, vertices: IntArray) -> IntArray:
        """Numbers of the coefficients of cells whose corners are the vertices (cells, 3), shape (cells, n).

        By scikit-fem: vertices, sides, inside; neighbours share those of vertices and sides.
        """
        p, points = self.degree, np.zeros((2, int(vertices.max()) + 1))
        topology = MeshTri(points, np.ascontiguousarray(vertices.T))
        numbers = Dofs(topology, _Counts(RefTri, p - 1, (p - 1) * (p - 2) // 2)).element_dofs.T
        return np.asarray(numbers, dtype=np.int64)[:, self._local]

    @property
    def _local(self) -> IntArray:
        """Place of each coefficient among vertices, sides and the inside."""
        on_sides = [self.sides[first, last][1:-1] for first, last in _SIDES]
        inside = np.flatnonzero((exponents(self.degree) > 0).all(axis=1))
        return np.argsort(np.concatenate([self.corners, *on_sides, inside]))


def barycentric(t: FloatArray) -> FloatArray:
    """Barycentric coordinates (…, 3) of reference points (…, 2)."""
    t = np.asarray(t, dtype=float)
    return np.concatenate([1.0 - t.sum(axis=-1, keepdims=True), t], axis=-1)


@lru_cache(maxsize=16)
def reference_matrices(cell: Triangle) -> FloatArray:
    """∫ ∂_a B_i ∂_b B_j over the reference cell, shape (2, 2, n, n) as [a, b, i, j]."""
    t, weights = cell.quadrature(cell.degree + 1)
    values = cell.derivative_values(t)
    slopes = [values @ cell.differences[axis] for axis in (0, 1)]
    found = np.array([[first.T @ (weights[:, None] * second) for second in slopes] for first in slopes])
    found.setflags(write=False)
    return found


class _Counts(Element):  # type: ignore[misc]  # scikit-fem has no types
    """How many coefficients vertices, sides and the inside of a cell have."""

    nodal_dofs = 1

    def __init__(self, domain: object, side: int, inside: int) -> None:
        self.refdom, self.facet_dofs, self.interior_dofs = domain, side, inside
