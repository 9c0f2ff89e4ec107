"""Bernstein polynomials of total degree p on a triangle, u = Σ c_α B_α(λ), λ = (1 − t₁ − t₂, t₁, t₂)."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Final

import numpy as np
from skfem import MeshTri  # type: ignore[import-untyped]
from skfem.refdom import RefTri  # type: ignore[import-untyped]

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.companion.cell import numbered
from qvi_contact.element.lattices import triangle_lattice
from qvi_contact.element.triangle import bernstein, exponents, gradient, quadrature

_SIDES: Final = ((0, 1), (1, 2), (0, 2))  # in scikit-fem's order, from the lower number of a corner to the higher one
_SLOPES: Final = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])  # of λ


@dataclass(frozen=True)
class Triangle:
    """P_p; coefficients come in the order of `element.triangle.exponents`. See `Cell`.

    Corners have ascending numbers, so that neighbours agree on the direction of a side.
    """

    degree: int

    degrees: ClassVar[tuple[int, ...]] = (1, 2, 3, 4, 5)
    default: ClassVar[int] = 3
    axes: ClassVar[tuple[int, int]] = (1, 2)
    area: ClassVar[float] = 0.5

    @classmethod
    def beside(cls, airy: int) -> int:
        """As much as Φ has: displacements of one degree less are of the same order, but hold half of the gap."""
        return min(airy, cls.degrees[-1])

    @cached_property
    def places(self) -> FloatArray:
        """The points α/p."""
        return np.asarray(exponents(self.degree)[:, 1:] / self.degree)

    @cached_property
    def corners(self) -> IntArray:
        """The coefficients of α = p e_k."""
        return np.asarray(np.argmax(exponents(self.degree), axis=0))

    @cached_property
    def sides(self) -> IntArray:
        """The coefficients from corner to corner."""
        alpha, found = exponents(self.degree), np.full((3, 3, self.degree + 1), -1)
        for first, last in _SIDES:
            on_side = np.flatnonzero(alpha[:, first] + alpha[:, last] == self.degree)
            side = on_side[np.argsort(alpha[on_side, last])]
            found[first, last], found[last, first] = side, side[::-1]
        return found

    @cached_property
    def differences(self) -> tuple[FloatArray, FloatArray]:
        """P (c_{α+e₁} − c_{α+e₀}) and p (c_{α+e₂} − c_{α+e₀})."""
        along_x, along_y = gradient(self.degree, _SLOPES)
        return along_x, along_y

    def values(self, t: FloatArray) -> FloatArray:
        """B_α(λ)."""
        return bernstein(self.degree, barycentric(t))

    def derivative_values(self, axis: int, t: FloatArray) -> FloatArray:  # noqa: ARG002  # the same for both
        """B_α of degree p − 1."""
        return bernstein(self.degree - 1, barycentric(t))

    def quadrature(self, count: int) -> tuple[FloatArray, FloatArray]:
        """Gauss points, `count` in each direction of the collapsed square."""
        points, weights = quadrature(2 * count - 1)
        return points[:, 1:], weights / 2.0

    def lattice(self, divisions: int) -> tuple[FloatArray, IntArray]:
        """Points and parts, see `Cell`."""
        points, parts = triangle_lattice(divisions)
        return points[:, 1:], parts

    def table(self, vertices: IntArray) -> IntArray:
        """Numbers of the coefficients, by scikit-fem."""
        p = self.degree
        points = np.zeros((2, int(vertices.max()) + 1))
        topology = MeshTri(points, np.ascontiguousarray(vertices.T))
        return numbered(topology, RefTri, p - 1, (p - 1) * (p - 2) // 2)[:, self._local]

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
