"""Stress components on cell edges as linear functions of the degrees of freedom.

On one edge the normal stress is linear and the shear stress quadratic; both depend on the two nodes of the edge only,
so the tractions of neighbouring cells agree.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray
from qvi_contact.element.bogner_fox_schmit import Grid
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.mesh.rectilinear import HORIZONTAL, VERTICAL, GridEdges


@dataclass(frozen=True)
class EdgePoints:
    """Gauss points on boundary edges, and the stress there.

    Attributes
    ----------
    grid : Grid
        Dimensionless grid.
    edges : GridEdges
        The n edges.
    count : int
        Gauss points an edge, q. Arrays over points have shape (n q,), edge by edge.

    """

    grid: Grid
    edges: GridEdges
    count: int

    @cached_property
    def _reference(self) -> tuple[FloatArray, FloatArray]:
        return gauss_legendre(self.count)

    @cached_property
    def lengths(self) -> FloatArray:
        """Edge lengths, shape (n,)."""
        along = np.where(self.edges.axis == HORIZONTAL, self.edges.column, self.edges.row)
        in_x = self.grid.x.sizes[np.minimum(along, len(self.grid.x.sizes) - 1)]
        in_y = self.grid.y.sizes[np.minimum(along, len(self.grid.y.sizes) - 1)]
        return np.where(self.edges.axis == HORIZONTAL, in_x, in_y)

    @cached_property
    def weights(self) -> FloatArray:
        """Quadrature weights, the edge's length included, shape (n q,)."""
        return np.outer(self.lengths, self._reference[1]).ravel()

    @cached_property
    def cell_coordinates(self) -> tuple[FloatArray, FloatArray]:
        """Reference coordinates (tx, ty) in the cell of each edge, each of shape (n, q)."""
        t = np.broadcast_to(self._reference[0], (len(self.edges), self.count))
        far = np.broadcast_to(((self.edges.sign + 1.0) / 2.0)[:, None], t.shape)
        horizontal = (self.edges.axis == HORIZONTAL)[:, None]
        return np.where(horizontal, t, far), np.where(horizontal, far, t)

    @cached_property
    def coordinates(self) -> FloatArray:
        """Dimensionless coordinates, shape (n q, 2)."""
        tx, ty = self.cell_coordinates
        x = self.grid.x.lines[self.edges.column][:, None] + tx * self.grid.x.sizes[self.edges.column][:, None]
        y = self.grid.y.lines[self.edges.row][:, None] + ty * self.grid.y.sizes[self.edges.row][:, None]
        return np.column_stack([x.ravel(), y.ravel()])

    @cached_property
    def stress_rows(self) -> FloatArray:
        """Coefficients of (σ_xx, σ_yy, σ_xy) without φ, shape (n q, 3, 16)."""
        tx, ty = self.cell_coordinates
        return self.grid.stress_rows(self.edges.column[:, None], self.edges.row[:, None], tx, ty).reshape(-1, 3, 16)

    def stress(self, nodal: FloatArray) -> FloatArray:
        """(σ_xx, σ_yy, σ_xy) without φ, dimensionless, of nodal values of Φ; shape (n q, 3)."""
        values = nodal.ravel()[self.grid.cell_dofs(self.edges.column, self.edges.row)]
        rows = self.stress_rows.reshape(len(self.edges), self.count, 3, 16)
        return np.asarray(np.einsum("nqkd,nd->nqk", rows, values)).reshape(-1, 3)

    @property
    def point_axis(self) -> FloatArray:
        """Axis of the edge at each point, shape (n q,)."""
        return np.repeat(self.edges.axis, self.count)

    @property
    def point_sign(self) -> FloatArray:
        """Sign of the outward normal at each point, shape (n q,)."""
        return np.repeat(self.edges.sign, self.count)

    def normal(self) -> sparse.csr_array:
        """Rows of σ_N = n·σn without φ: σ_yy on horizontal, σ_xx on vertical edges; shape (n q, all)."""
        rows = np.where((self.point_axis == HORIZONTAL)[:, None], self.stress_rows[:, 1], self.stress_rows[:, 0])
        return self._matrix(rows)

    def shear(self) -> sparse.csr_array:
        """Rows of σ_T, the traction's component along +x or +y: ±σ_xy by the sign of n; shape (n q, all)."""
        return self._matrix(self.stress_rows[:, 2] * self.point_sign[:, None])

    def traction(self, component: int) -> sparse.csr_array:
        """Rows of the traction component (σn)_x (0) or (σn)_y (1) without φ, shape (n q, all)."""
        normal_axis = VERTICAL if component == 0 else HORIZONTAL
        normal = self.stress_rows[:, component]
        rows = np.where((self.point_axis == normal_axis)[:, None], normal, self.stress_rows[:, 2])
        return self._matrix(rows * self.point_sign[:, None])

    def _matrix(self, rows: FloatArray) -> sparse.csr_array:
        # Coefficients of the far side's nodes are exact zeros (or round-off of none): drop them.
        columns = np.repeat(self.grid.cell_dofs(self.edges.column, self.edges.row), self.count, axis=0)
        points = np.repeat(np.arange(len(rows)), 16).reshape(-1, 16)
        total = 4 * len(self.grid.x.lines) * len(self.grid.y.lines)
        kept = rows != 0.0
        return sparse.csr_array((rows[kept], (points[kept], columns[kept])), shape=(len(rows), total))
