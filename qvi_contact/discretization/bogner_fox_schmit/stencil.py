"""The complementary energy ∫ cσ:τ of Bogner-Fox-Schmit cells, summed without a loop over cells."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.element.bogner_fox_schmit import STRESS_DERIVATIVES, Grid


@dataclass(frozen=True)
class StencilMatrix:
    """Energy matrix K of a grid by nodes and their neighbours.

    Attributes
    ----------
    blocks : (ny + 1, nx + 1, 4, 3, 3, 4) array
        ``blocks[j, i, d, 1 + v, 1 + u, e]`` couples degree of freedom d of node (i, j) with e of node (i + u, j + v).
        It is zero where that neighbour does not exist.

    """

    blocks: FloatArray

    def rows(self, chosen: IntArray) -> sparse.csr_array:
        """The rows of K with the given global numbers, all columns kept."""
        ny, nx = self.blocks.shape[:2]
        node, dof = np.divmod(chosen, 4)
        row, column = np.divmod(node, nx)
        data = self.blocks[row, column, dof].reshape(len(chosen), 36)
        columns = self._columns(node).reshape(len(chosen), 36)
        inside = self._inside(row, column).reshape(len(chosen), 36)
        lines = np.repeat(np.arange(len(chosen)), 36).reshape(-1, 36)
        shape = (len(chosen), 4 * nx * ny)
        return sparse.csr_array((data[inside], (lines[inside], columns[inside])), shape=shape)

    def submatrix(self, kept: BoolArray) -> sparse.csr_array:
        """K restricted to the kept degrees of freedom, renumbered; `kept` has shape (ny + 1, nx + 1, 4)."""
        ny, nx = self.blocks.shape[:2]
        count = int(kept.sum())
        number = np.full(kept.shape, -1, dtype=np.int32)
        number[kept] = np.arange(count, dtype=np.int32)
        padded = np.pad(number, ((1, 1), (1, 1), (0, 0)), constant_values=-1)
        neighbours = np.lib.stride_tricks.sliding_window_view(padded, (3, 3), axis=(0, 1))
        columns = np.ascontiguousarray(np.moveaxis(neighbours, 2, 4)).reshape(ny * nx, 36)
        exists = columns >= 0
        owner = np.nonzero(kept.reshape(-1, 4).any(axis=1))[0]
        lengths = np.repeat(exists.sum(axis=1), 4)[kept.ravel()]
        indptr = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
        mask = exists[owner][:, None, :] & kept.reshape(-1, 4)[owner][:, :, None]
        data = self.blocks.reshape(ny * nx, 4, 36)
        data = data if len(owner) == ny * nx else data[owner]
        indices = np.broadcast_to(columns[owner][:, None, :], mask.shape)
        return sparse.csr_array((data[mask], indices[mask], indptr), shape=(count, count))

    def _columns(self, node: IntArray) -> IntArray:
        """Global numbers of the degrees of freedom around the nodes, shape (n, 3, 3, 4)."""
        nx = self.blocks.shape[1]
        shift = np.array([-1, 0, 1])
        neighbour = node[:, None, None] + nx * shift[:, None] + shift
        return np.asarray(4 * neighbour[..., None] + np.arange(4))

    def _inside(self, row: IntArray, column: IntArray) -> BoolArray:
        """Whether those degrees of freedom exist, shape (n, 3, 3, 4)."""
        ny, nx = self.blocks.shape[:2]
        shift = np.array([-1, 0, 1])
        in_y = (row[:, None] + shift >= 0) & (row[:, None] + shift < ny)
        in_x = (column[:, None] + shift >= 0) & (column[:, None] + shift < nx)
        inside = in_y[:, :, None, None] & in_x[:, None, :, None]
        return np.broadcast_to(inside, (*inside.shape[:3], 4))


def energy_matrix(grid: Grid, parts: Sequence[tuple[BoolArray, FloatArray]]) -> StencilMatrix:
    """Matrix of the bilinear form ∫ c σ(Φ) : σ(Ψ) dx over the cells of one or several materials.

    With D₁ = ∂_yy, D₂ = ∂_xx, D₃ = −∂_xy the form is Σ_kl c_kl ∫ D_k Φ D_l Ψ. On a block of cells that is the product
    of an x-range and a y-range every term is a Kronecker product of two one-dimensional matrices, so the work is done
    once for each run of grid rows that have the same active cells.

    Parameters
    ----------
    grid : Grid
        Grid lines, dimensionless.
    parts : sequence of ((ny, nx) bool array, (3, 3) array)
        Cells, and their dimensionless compliance c.

    """
    ny, nx = len(grid.y.sizes), len(grid.x.sizes)
    blocks = np.zeros((ny + 1, nx + 1, 2, 2, 3, 3, 2, 2))
    for cells, compliance in parts:
        _add_energy(blocks, grid, cells, compliance)
    return StencilMatrix(blocks.reshape(ny + 1, nx + 1, 4, 3, 3, 4))


def _add_energy(blocks: FloatArray, grid: Grid, active: BoolArray, compliance: FloatArray) -> None:
    """Add the energy of the active cells of one material to blocks (j, i, r, p, v, u, s, q)."""
    terms = [
        (compliance[k, m] * first[2] * second[2], (first[0], second[0]), (first[1], second[1]))
        for (k, first), (m, second) in product(enumerate(STRESS_DERIVATIVES), repeat=2)
        if compliance[k, m] != 0.0
    ]
    in_x = np.stack([factor * grid.x.integrals(*orders) for factor, orders, _ in terms])
    in_y = np.stack([grid.y.integrals(*orders) for _, _, orders in terms])
    changes = np.flatnonzero((active[1:] != active[:-1]).any(axis=1)) + 1
    for start, stop in pairwise([0, *changes.tolist(), len(active)]):
        along_x = _node_stencil(in_x * active[start][:, None, None, None, None])
        along_y = _node_stencil(in_y[:, start:stop])
        if active[start].any():
            _add_products(blocks[start : stop + 1], along_x, along_y)


def _node_stencil(integrals: FloatArray) -> FloatArray:
    """Interval integrals (t, n, a, p, c, q) summed to node stencils (t, n + 1, p, 1 + c − a, q)."""
    terms, count = integrals.shape[:2]
    stencil = np.zeros((terms, count + 1, 2, 3, 2))
    for a, c in product((0, 1), repeat=2):
        stencil[:, a : a + count, :, 1 + c - a] += integrals[:, :, a, :, c]
    return stencil


def _add_products(blocks: FloatArray, along_x: FloatArray, along_y: FloatArray) -> None:
    """Add Σ_t along_y[t] ⊗ along_x[t] to blocks (j, i, r, p, v, u, s, q), row by row of nodes to stay in cache."""
    terms, nodes = along_x.shape[:2]
    right = along_x.reshape(terms, -1)
    for target, left in zip(blocks, np.moveaxis(along_y, 1, 0), strict=True):
        values = (left.reshape(terms, -1).T @ right).reshape(2, 3, 2, nodes, 2, 3, 2)
        target += values.transpose(3, 0, 4, 1, 5, 2, 6)
