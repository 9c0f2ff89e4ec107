"""The Bogner-Fox-Schmit element: bicubic Airy stress function, C1 across cells.

Nodal degrees of freedom are, in this order and with local mesh sizes s_x, s_y at the node,

    Φ,   s_x Φ_x,   s_y Φ_y,   s_x s_y Φ_xy

and stresses are (3.1)

    σ_xx = Φ_yy + φ,   σ_yy = Φ_xx + φ,   σ_xy = −Φ_xy.

Cell nodes are ordered (x₀, y₀), (x₁, y₀), (x₀, y₁), (x₁, y₁). A degree of freedom is the product of one Hermite
function of x (end a, kind p) and one of y (end b, kind r): node a + 2b, entry p + 2r.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.element.hermite import gauss_legendre, scaled_hermite
from qvi_contact.mesh.rectilinear import RectilinearMesh

GAUSS_COUNT = 4
"""Gauss points per direction: exact for the energy of bicubic functions, and the points the paper checks."""

#: Orders of derivative (in x, in y) and factor that turn Φ into σ_xx, σ_yy, σ_xy.
STRESS_DERIVATIVES = ((0, 2, 1.0), (2, 0, 1.0), (1, 1, -1.0))


@dataclass(frozen=True)
class Line:
    """Grid lines in one direction with the scales of their slope degrees of freedom.

    Attributes
    ----------
    lines : (n + 1,) array
        Coordinates.

    """

    lines: FloatArray

    @cached_property
    def sizes(self) -> FloatArray:
        """Interval lengths h, shape (n,)."""
        return np.diff(self.lines)

    @cached_property
    def scales(self) -> FloatArray:
        """Slope scale s at every line: the geometric mean of the adjacent lengths, shape (n + 1,)."""
        padded = np.concatenate([self.sizes[:1], self.sizes, self.sizes[-1:]])
        return np.asarray(np.sqrt(padded[:-1] * padded[1:]))

    @cached_property
    def end_scales(self) -> FloatArray:
        """Slope scales at the two ends of each interval, shape (n, 2)."""
        return np.column_stack([self.scales[:-1], self.scales[1:]])

    def basis(self, interval: IntArray, t: FloatArray, derivative: int) -> FloatArray:
        """Hermite functions of the given intervals at reference points t, shape (..., 2, 2); see `scaled_hermite`."""
        return scaled_hermite(t, self.sizes[interval], self.end_scales[interval], derivative)

    def integrals(self, first: int, second: int) -> FloatArray:
        """∫ H^(first) H^(second) over each interval, shape (n, 2, 2, 2, 2), indices (a, p, c, q)."""
        points, weights = gauss_legendre(GAUSS_COUNT)
        interval = np.arange(len(self.sizes))[:, None]
        left = self.basis(interval, points, first)
        right = left if second == first else self.basis(interval, points, second)
        result: FloatArray = np.einsum("g,i,igap,igcq->iapcq", weights, self.sizes, left, right)
        return result


@dataclass(frozen=True)
class Grid:
    """The two directions of a rectilinear mesh in dimensionless coordinates (origin at the corner, length 1)."""

    x: Line
    y: Line

    @classmethod
    def of(cls, mesh: RectilinearMesh) -> "Grid":
        """The mesh's grid, shifted to the origin and divided by its characteristic length."""
        return cls(Line((mesh.x - mesh.x[0]) / mesh.length), Line((mesh.y - mesh.y[0]) / mesh.length))

    @property
    def size(self) -> int:
        """Number of degrees of freedom, those of nodes outside the body included."""
        return 4 * len(self.x.lines) * len(self.y.lines)

    @property
    def dof_scales(self) -> FloatArray:
        """Scale of each degree of freedom: stored value = scale × derivative; shape (ny + 1, nx + 1, 4)."""
        one_x, one_y = np.ones_like(self.x.scales), np.ones_like(self.y.scales)
        scale_x = np.stack([one_x, self.x.scales], axis=-1)
        scale_y = np.stack([one_y, self.y.scales], axis=-1)
        return np.asarray(np.einsum("jr,ip->jirp", scale_y, scale_x)).reshape(len(one_y), len(one_x), 4)

    def cell_dofs(self, column: IntArray, row: IntArray) -> IntArray:
        """Global numbers of the 16 degrees of freedom of the given cells, shape (..., 16)."""
        stride = len(self.x.lines)
        base = np.asarray(column + row * stride)
        nodes = base[..., None] + np.array([0, 1, stride, stride + 1])
        return np.asarray(4 * nodes[..., None] + np.arange(4)).reshape(*base.shape, 16)

    def derivative_rows(
        self, column: IntArray, row: IntArray, tx: FloatArray, ty: FloatArray, order: tuple[int, int]
    ) -> FloatArray:
        """Coefficients of ∂^order Φ at reference points (tx, ty) of the given cells, shape (..., 16)."""
        in_x = self.x.basis(column, tx, order[0])
        in_y = self.y.basis(row, ty, order[1])
        product = np.einsum("...ap,...br->...barp", in_x, in_y)
        return np.asarray(product).reshape(*product.shape[:-4], 16)

    def component_rows(
        self, column: IntArray, row: IntArray, tx: FloatArray, ty: FloatArray, component: int
    ) -> FloatArray:
        """Coefficients of σ_xx (0), σ_yy (1) or σ_xy (2) without φ at reference points of cells, shape (..., 16)."""
        in_x, in_y, factor = STRESS_DERIVATIVES[component]
        return factor * self.derivative_rows(column, row, tx, ty, (in_x, in_y))

    def stress_rows(self, column: IntArray, row: IntArray, tx: FloatArray, ty: FloatArray) -> FloatArray:
        """The same of all three, shape (..., 3, 16)."""
        return np.stack([self.component_rows(column, row, tx, ty, component) for component in range(3)], axis=-2)
