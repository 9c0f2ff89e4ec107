"""The energy of Bogner-Fox-Schmit cells: assembled by stencils, reduced to the unknowns, a square of stresses."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.bogner_fox_schmit.energy_root import StressRoot
from qvi_contact.discretization.bogner_fox_schmit.stencil import StencilMatrix, energy_matrix
from qvi_contact.discretization.elimination import Elimination
from qvi_contact.element.bogner_fox_schmit import GAUSS_COUNT, Grid
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.mesh.rectilinear import RectilinearMesh


@dataclass(frozen=True, eq=False)
class GridEnergy:
    """½ ∫ cσ:σ over the active cells of a grid; an `Energy`.

    Attributes
    ----------
    mesh : RectilinearMesh
        The mesh.
    grid : Grid
        Its dimensionless lines.
    materials : (cells,) int array
        Which of the compliances each active cell has.
    compliances : (k, 3, 3) array
        Dimensionless compliances.
    potential : (cells, 16) array or None
        Body-force potential φ at 4×4 Gauss points, dimensionless; None without body force.

    """

    mesh: RectilinearMesh
    grid: Grid
    materials: IntArray
    compliances: FloatArray
    potential: FloatArray | None

    def _stencil(self) -> StencilMatrix:
        """Not kept: it takes several times the memory of K."""
        parts = []
        for number, compliance in enumerate(self.compliances):
            cells = np.zeros(self.mesh.shape, dtype=bool)
            cells[self.mesh.active] = self.materials == number
            parts.append((cells, compliance))
        return energy_matrix(self.grid, parts)

    @cached_property
    def load(self) -> FloatArray:
        """−∫ c φI : τ dx, what the particular stress φI of the body force contributes to the load vector (N,)."""
        load = np.zeros(self.grid.size)
        if self.potential is None:
            return load
        column, row = self.mesh.cell_places
        t, w = gauss_legendre(GAUSS_COUNT)
        tx, ty = (
            np.broadcast_to(part, (len(row), GAUSS_COUNT**2)) for part in (np.tile(t, len(t)), np.repeat(t, len(t)))
        )
        size_x, size_y = self.grid.x.sizes[column][:, None], self.grid.y.sizes[row][:, None]
        weights = size_x * size_y * (np.tile(w, len(w)) * np.repeat(w, len(w)))
        strain = self.compliances[self.materials][:, :, :2].sum(axis=2)
        rows = self.grid.stress_rows(column[:, None], row[:, None], tx, ty)
        work = np.einsum("cg,ck,cgkd->cd", -weights * self.potential, strain, rows)
        np.add.at(load, self.grid.cell_dofs(column, row), work)
        return load

    def reduced(self, elimination: Elimination) -> tuple[sparse.csr_array, FloatArray]:
        """K = Bᵀ 𝒦 B with B the identity on kept degrees of freedom, and 𝒦 u₀."""
        kept, stencil = elimination.kept, self._stencil()
        K = stencil.submatrix(kept.reshape(*self.mesh.active_nodes.shape, 4))
        slave_rows = stencil.rows(elimination.slaves)
        Q = elimination.slave_basis
        coupling = slave_rows[:, kept]
        inner = slave_rows[:, elimination.slaves]
        mixed = Q.T @ coupling
        K = _narrow(K + (mixed + mixed.T + Q.T @ (inner @ Q)))
        return K, slave_rows.T @ elimination.particular[elimination.slaves]

    def root(self, elimination: Elimination) -> StressRoot:
        """The stresses of all cells from differences of nodal values."""
        compliances = self.compliances[self.materials]
        potential = np.zeros((len(self.materials), GAUSS_COUNT**2)) if self.potential is None else self.potential
        basis, particular = elimination.basis, elimination.particular
        return StressRoot(self.grid, self.mesh.active, compliances, basis, particular, potential)

    def places(self, elimination: Elimination) -> FloatArray:
        """Columns and rows of the unknowns' nodes."""
        rows, columns = np.indices(self.mesh.active_nodes.shape)
        nodes = np.column_stack([columns.ravel(), rows.ravel()]).astype(np.float64)
        return np.repeat(nodes, 4, axis=0)[elimination.kept]

    def coefficients(self, u: FloatArray) -> FloatArray:
        """The degrees of freedom themselves."""
        return u


def _narrow(K: sparse.csr_array) -> sparse.csr_array:
    """K with 32-bit indices, where they suffice: a third less memory."""
    if K.nnz > np.iinfo(np.int32).max:
        return K
    return sparse.csr_array((K.data, K.indices.astype(np.int32), K.indptr.astype(np.int32)), shape=K.shape)
