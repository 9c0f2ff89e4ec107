"""Products of Bernstein polynomials on the unit square, u = Σ c_ij B_i(t₁) B_j(t₂), i, j = 0 … p."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Final

import numpy as np
from skfem import MeshQuad  # type: ignore[import-untyped]
from skfem.refdom import RefQuad  # type: ignore[import-untyped]

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.companion.cell import numbered
from qvi_contact.element import bernstein
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.element.lattices import square_lattice

_SIDES: Final = ((0, 1), (1, 2), (3, 2), (0, 3))  # from corner to corner along +x or +y


@dataclass(frozen=True)
class Rectangle:
    """Q_p; coefficient j (p + 1) + i belongs to B_i(t₁) B_j(t₂). See `Cell`.

    Corners come counterclockwise from the lower left one. Coefficients on a side are counted along +x or +y; neighbours
    agree on that where all cells have the same order of corners, as those of a grid do.
    """

    degree: int

    degrees: ClassVar[tuple[int, ...]] = (2, 3, 4)
    default: ClassVar[int] = 2
    axes: ClassVar[tuple[int, int]] = (1, 3)
    area: ClassVar[float] = 1.0

    @classmethod
    def beside(cls, airy: int) -> int:
        """One less than Φ has, which is of the same order."""
        return min(airy - 1, cls.degrees[-1])

    @property
    def _grid(self) -> IntArray:
        """Numbers of the coefficients as [along y, along x]."""
        return np.arange((self.degree + 1) ** 2).reshape(self.degree + 1, self.degree + 1)

    @cached_property
    def places(self) -> FloatArray:
        """The points (i, j)/p."""
        step = np.arange(self.degree + 1) / self.degree
        return np.column_stack([np.tile(step, len(step)), np.repeat(step, len(step))])

    @property
    def corners(self) -> IntArray:
        """The coefficients in the corners."""
        grid = self._grid
        return np.array([grid[0, 0], grid[0, -1], grid[-1, -1], grid[-1, 0]])

    @cached_property
    def sides(self) -> IntArray:
        """The coefficients from corner to corner."""
        grid, found = self._grid, np.full((4, 4, self.degree + 1), -1)
        for (first, last), side in zip(_SIDES, (grid[0], grid[:, -1], grid[-1], grid[:, 0]), strict=True):
            found[first, last], found[last, first] = side, side[::-1]
        return found

    @cached_property
    def differences(self) -> tuple[FloatArray, FloatArray]:
        """P (c_{i+1,j} − c_ij) and p (c_{i,j+1} − c_ij)."""
        p, one = self.degree, np.eye(self.degree + 1)
        step = p * np.diff(one, axis=0)
        return np.asarray(np.kron(one, step)), np.asarray(np.kron(step, one))

    def values(self, t: FloatArray) -> FloatArray:
        """B_i(t₁) B_j(t₂)."""
        return _products(self.degree, self.degree, t)

    def derivative_values(self, axis: int, t: FloatArray) -> FloatArray:
        """The same, of degree p − 1 along one axis."""
        p = self.degree
        return _products(p - 1, p, t) if axis == 0 else _products(p, p - 1, t)

    def quadrature(self, count: int) -> tuple[FloatArray, FloatArray]:
        """`count` Gauss points in each direction, along x first."""
        t, w = gauss_legendre(count)
        return np.column_stack([np.tile(t, count), np.repeat(t, count)]), np.outer(w, w).ravel()

    def lattice(self, divisions: int) -> tuple[FloatArray, IntArray]:
        """Points and parts, see `Cell`."""
        return square_lattice(divisions)

    def table(self, vertices: IntArray) -> IntArray:
        """Numbers of the coefficients, by scikit-fem."""
        p = self.degree
        points = np.zeros((2, int(vertices.max()) + 1))
        topology = MeshQuad(points, np.ascontiguousarray(vertices.T))
        return numbered(topology, RefQuad, p - 1, (p - 1) ** 2)[:, self._local]

    @property
    def _local(self) -> IntArray:
        """Place of each coefficient among vertices, the sides bottom, right, top, left, and the inside."""
        p, grid = self.degree, self._grid
        order = np.concatenate(
            [self.corners, grid[0, 1:p], grid[1:p, p], grid[p, 1:p], grid[1:p, 0], grid[1:p, 1:p].ravel()]
        )
        return np.argsort(order)


def _products(in_x: int, in_y: int, t: FloatArray) -> FloatArray:
    """B_i(t₁) B_j(t₂) of two degrees at points (..., 2), i fastest."""
    flat = np.asarray(t, dtype=float).reshape(-1, 2)
    along_x, along_y = bernstein.basis(in_x, flat[:, 0]), bernstein.basis(in_y, flat[:, 1])
    return np.asarray((along_y[:, :, None] * along_x[:, None, :]).reshape(*np.shape(t)[:-1], -1))
