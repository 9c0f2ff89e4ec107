"""What the displacement model asks of a cell: polynomials on a reference cell by Bernstein coefficients.

A function on a cell is Σ c_i B_i with B_i ≥ 0 of sum 1. Its trace on a side is the polynomial whose coefficients are
those of the side, so that contact conditions and prescribed data are conditions on single coefficients. Derivatives
along the two reference axes act on differences of neighbouring coefficients,

    ∂u/∂t_a = Σ_k (D_a c)_k B_k^a,

so that a rigid motion, however large, leaves no rounding behind. Reference points are (t₁, t₂) with corner 0 in the
origin.
"""

from functools import lru_cache
from typing import ClassVar, Protocol

import numpy as np
from skfem import Mesh as Topology  # type: ignore[import-untyped]
from skfem.assembly import Dofs  # type: ignore[import-untyped]
from skfem.element import Element  # type: ignore[import-untyped]

from qvi_contact.basics.checks import FloatArray, IntArray


class Cell(Protocol):
    """A reference cell with c corners and n coefficients of degree p.

    Attributes
    ----------
    degree : int
        p.
    degrees, default : tuple of int, int
        The degrees that are offered, and the one taken where none is given.
    axes : (int, int)
        The corners at (1, 0) and (0, 1).
    area : float
        Of the reference cell.
    places : (n, 2) array
        Points of the coefficients: those of a linear function are its values there.
    corners : (c,) int array
        The coefficients in the corners, in the order of the mesh's cells.
    sides : (c, c, p + 1) int array
        The coefficients from one corner to another along a side; −1 where there is no side between them.
    differences : pair of (m, n) arrays
        D₁ and D₂.

    """

    degrees: ClassVar[tuple[int, ...]]
    default: ClassVar[int]
    axes: ClassVar[tuple[int, int]]
    area: ClassVar[float]

    @classmethod
    def beside(cls, airy: int) -> int:
        """The degree that goes with Airy functions of a degree, for bounds of the energy."""
        ...

    @property
    def degree(self) -> int: ...  # noqa: D102  # described above
    @property
    def places(self) -> FloatArray: ...  # noqa: D102
    @property
    def corners(self) -> IntArray: ...  # noqa: D102
    @property
    def sides(self) -> IntArray: ...  # noqa: D102
    @property
    def differences(self) -> tuple[FloatArray, FloatArray]: ...  # noqa: D102

    def __hash__(self) -> int: ...  # for caches

    def values(self, t: FloatArray) -> FloatArray:
        """B_i at points t (..., 2), shape (..., n)."""
        ...

    def derivative_values(self, axis: int, t: FloatArray) -> FloatArray:
        """B_k^a of the derivative along reference axis 0 or 1 at points t (..., 2), shape (..., m)."""
        ...

    def quadrature(self, count: int) -> tuple[FloatArray, FloatArray]:
        """Points (q, 2) and weights (q,) of sum `area`, exact up to degree 2 count − 1."""
        ...

    def lattice(self, divisions: int) -> tuple[FloatArray, IntArray]:
        """Points (k, 2) that divide the cell, so many parts along each side, and the parts' corners (c, s)."""
        ...

    def table(self, vertices: IntArray) -> IntArray:
        """Numbers of the coefficients of cells whose corners are the vertices (cells, c), shape (cells, n)."""
        ...


@lru_cache(maxsize=16)
def reference_matrices(cell: Cell) -> FloatArray:
    """∫ ∂_a B_i ∂_b B_j over the reference cell, shape (2, 2, n, n) as [a, b, i, j]."""
    t, weights = cell.quadrature(cell.degree + 1)
    slopes = [cell.derivative_values(axis, t) @ cell.differences[axis] for axis in (0, 1)]
    found = np.array([[first.T @ (weights[:, None] * second) for second in slopes] for first in slopes])
    found.setflags(write=False)
    return found


class _Counts(Element):  # type: ignore[misc]  # scikit-fem has no types
    """How many coefficients vertices, sides and the inside of a cell have."""

    nodal_dofs = 1

    def __init__(self, domain: object, side: int, inside: int) -> None:
        self.refdom, self.facet_dofs, self.interior_dofs = domain, side, inside


def numbered(topology: Topology, domain: object, side: int, inside: int) -> IntArray:
    """Numbers of coefficients by cell: vertices, sides, inside; neighbours share those of vertices and sides."""
    return np.asarray(Dofs(topology, _Counts(domain, side, inside)).element_dofs.T, dtype=np.int64)
