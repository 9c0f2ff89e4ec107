"""Tractions on edges of the grid as linear functions of the degrees of freedom.

On one edge the normal stress is linear and the shear stress quadratic; both depend on the two nodes of the edge only,
so the tractions of neighbouring cells agree.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.element.bogner_fox_schmit import GAUSS_COUNT, Grid
from qvi_contact.element.hermite import gauss_legendre, nodal_quadratics
from qvi_contact.mesh.edges import Edges


@dataclass(frozen=True, eq=False)
class GridTraces:
    """Edges as cells of the grid see them, at the points t (q,) along each.

    Attributes
    ----------
    grid : Grid
        Dimensionless grid.
    edges : Edges
        The n edges.
    column, row : (n,) int arrays
        Their first cells.
    t : (q,) array
        Reference coordinates along the edges.

    """

    grid: Grid
    edges: Edges
    column: IntArray
    row: IntArray
    t: FloatArray

    @cached_property
    def horizontal(self) -> BoolArray:
        """Which edges run along x, shape (n,)."""
        return horizontal(self.edges)

    @cached_property
    def sign(self) -> FloatArray:
        """Sign of the outward normal, along +x or +y, shape (n,)."""
        return np.asarray(self.edges.normal.sum(axis=1))

    @cached_property
    def _places(self) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
        """Columns and rows of cells (n, 1), and reference points there (n, q)."""
        along = np.broadcast_to(self.t, (len(self.edges), len(self.t)))
        far = np.broadcast_to(((self.sign + 1.0) / 2.0)[:, None], along.shape)
        tx = np.where(self.horizontal[:, None], along, far)
        ty = np.where(self.horizontal[:, None], far, along)
        return self.column[:, None], self.row[:, None], tx, ty

    @cached_property
    def stress_rows(self) -> FloatArray:
        """Coefficients of (σ_xx, σ_yy, σ_xy) without φ, shape (n, q, 3, 16)."""
        return self.grid.stress_rows(*self._places)

    def normal(self) -> sparse.csr_array:
        """Rows of σ_N: σ_yy on horizontal, σ_xx on vertical edges; shape (n q, N)."""
        xx, yy = (self.grid.component_rows(*self._places, component) for component in (0, 1))
        return self._matrix(np.where(self.horizontal[:, None, None], yy, xx))

    def shear(self) -> sparse.csr_array:
        """Rows of σ_T: ±σ_xy by the sign of n; shape (n q, N)."""
        return self._matrix(self.grid.component_rows(*self._places, 2) * self.sign[:, None, None])

    def tractions(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """σ_N and σ_T of u (N,), shape (n q,) each."""
        values = u[self.grid.cell_dofs(self.column, self.row)]
        xx, yy, xy = np.moveaxis(np.einsum("nqkd,nd->nqk", self.stress_rows, values), 2, 0)
        return np.where(self.horizontal[:, None], yy, xx).ravel(), (xy * self.sign[:, None]).ravel()

    def load(self, normal: FloatArray, shear: FloatArray) -> FloatArray:
        """Σ normal σ_N + shear σ_T of weights (n q,), shape (N,)."""
        w_N, w_T = (weights.reshape(len(self.edges), -1) for weights in (normal, shear))
        flat = self.horizontal[:, None]
        weights = np.stack([np.where(flat, 0.0, w_N), np.where(flat, w_N, 0.0), self.sign[:, None] * w_T], axis=2)
        sums = np.einsum("nqk,nqkd->nd", weights, self.stress_rows)
        dofs = self.grid.cell_dofs(self.column, self.row)
        return np.asarray(np.bincount(dofs.ravel(), sums.ravel(), self.grid.size), dtype=np.float64)

    def _matrix(self, rows: FloatArray) -> sparse.csr_array:
        # Coefficients of the far side's nodes are exact zeros (or round-off of none): drop them.
        flat = rows.reshape(-1, 16)
        columns = np.repeat(self.grid.cell_dofs(self.column, self.row), len(self.t), axis=0)
        points = np.repeat(np.arange(len(flat)), 16).reshape(-1, 16)
        kept = flat != 0.0
        return sparse.csr_array((flat[kept], (points[kept], columns[kept])), shape=(len(flat), self.grid.size))


def horizontal(edges: Edges) -> BoolArray:
    """Which edges of a grid run along x, shape (n,)."""
    return np.asarray(edges.tangent[:, 0] > 0.5)


def trace_parameters(
    edges: Sequence[Edges], normal: sparse.csr_array, midpoint_shear: sparse.csr_array, grid: Grid
) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Tractions at the Gauss points of edges from the parameters of their traces: (Y, E) with [N; T] = E Y.

    Parameters are σ_N at the outer two Gauss points of each edge, since it is linear there, and σ_xy at nodes and σ_T
    at midpoints, since σ_T is quadratic on an edge and continuous; Y (r, all degrees of freedom), E (2m, r).

    Parameters
    ----------
    edges : sequence of Edges
        Those of each contact.
    normal : (m, N) sparse array
        Rows of σ_N at all Gauss points.
    midpoint_shear : (edges, N) sparse array
        Rows of σ_T at the midpoints.
    grid : Grid
        The dimensionless grid.

    """
    t = gauss_legendre(GAUSS_COUNT)[0]
    first, last = t[0], t[-1]
    linear = np.column_stack([last - t, t - first]) / (last - first)
    quadratic = nodal_quadratics(t)
    count = int(sum(len(part) for part in edges))
    ends = np.concatenate([np.column_stack([part.first, part.second]) for part in edges])
    signs = np.concatenate([part.normal.sum(axis=1) for part in edges])
    nodes, local = np.unique(ends, return_inverse=True)
    local = local.reshape(ends.shape)
    twist = -1.0 / grid.dof_scales.reshape(-1, 4)[nodes, 3]
    at_nodes = sparse.csr_array((twist, (np.arange(len(nodes)), 4 * nodes + 3)), shape=(len(nodes), grid.size))
    outer = np.add.outer(GAUSS_COUNT * np.arange(count), [0, GAUSS_COUNT - 1]).ravel()
    Y = sparse.csr_array(sparse.vstack([normal[outer], at_nodes, midpoint_shear]))

    number = np.arange(count)
    first_T = 2 * count + len(nodes)
    columns_T = np.column_stack([2 * count + local, first_T + number])
    shapes_T = quadratic[None] * np.column_stack([signs, signs, np.ones(count)])[:, None, :]
    shape = (count * GAUSS_COUNT, Y.shape[0])
    columns_N = np.column_stack([2 * number, 2 * number + 1])
    E_N = _interpolation(columns_N, np.broadcast_to(linear, (count, *linear.shape)), shape)
    return Y, sparse.csr_array(sparse.vstack([E_N, _interpolation(columns_T, shapes_T, shape)]))


def _interpolation(columns: IntArray, shapes: FloatArray, shape: tuple[int, int]) -> sparse.csr_array:
    """Rows edge by edge: shapes (edges, points, j) at columns (edges, j)."""
    points = shapes.shape[1]
    rows = np.repeat(np.arange(len(columns) * points), columns.shape[1])
    return sparse.csr_array((shapes.ravel(), (rows, np.repeat(columns, points, axis=0).ravel())), shape=shape)
