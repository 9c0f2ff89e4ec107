"""Strains and stresses of a displacement, the stiffness matrix, and forces without the rounding inside it.

Strains are (ε_xx, ε_yy, 2ε_xy). Derivatives act on differences of neighbouring coefficients, see `Triangle`.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.companion.space import Space
from qvi_contact.companion.triangle import reference_matrices

_ON_ARCS = 6  # Gauss points more where cells have arcs
_ENTRIES = ([0, 2], [2, 1])  # of (ε_xx, ε_yy, 2ε_xy): where ∂_x and ∂_y of each component go to


@dataclass(frozen=True, eq=False)
class Elasticity:
    """The elastic body, dimensionless.

    Attributes
    ----------
    space : Space
        Displacements.
    moduli : (cells, 3, 3) array
        Stiffness C with σ = C ε, times the unit of compliance.

    """

    space: Space
    moduli: FloatArray

    def stiffness(self) -> sparse.csr_array:
        """K with vᵀKv = ∫ ε:C:ε, shape (size, size)."""
        space, count = self.space, len(self.space.table)
        local, slopes = reference_matrices(space.cell), space.slopes
        n = local.shape[-1]
        blocks = np.empty((count, n, 2, n, 2))
        for c in (0, 1):
            for d in (0, 1):
                moduli = self.moduli[:, _ENTRIES[c]][:, :, _ENTRIES[d]]
                weights = space.areas[:, None, None] * (slopes @ moduli @ slopes.swapaxes(1, 2))
                blocks[:, :, c, :, d] = (weights.reshape(count, 4) @ local.reshape(4, n * n)).reshape(count, n, n)
        if len(space.curved):
            blocks[space.curved.numbers] = self._curved_stiffness()
        K = space.assembled(blocks.reshape(count, 2 * n, 2 * n))
        return sparse.csr_array((K + K.T) / 2.0)

    def _curved_stiffness(self) -> FloatArray:
        """The blocks (c, n, 2, n, 2) of cells with arcs, by quadrature."""
        space, curved = self.space, self.space.curved
        t, w = space.cell.quadrature(self._count)
        tables = [space.cell.derivative_values(t) @ space.cell.differences[axis] for axis in (0, 1)]
        found = np.empty((len(curved), tables[0].shape[1], 2, tables[0].shape[1], 2))
        for k in range(len(curved)):
            jacobians = curved.jacobians(np.array([k]), t)[0]
            slopes = np.einsum("qab,aqn->qbn", np.linalg.inv(jacobians), np.stack(tables))
            weights, moduli = np.abs(np.linalg.det(jacobians)) * w, self.moduli[curved.numbers[k]]
            for c in (0, 1):
                for d in (0, 1):
                    inner = moduli[_ENTRIES[c]][:, _ENTRIES[d]]
                    found[k, :, c, :, d] = np.einsum("q,qan,ab,qbm->nm", weights, slopes, inner, slopes, optimize=True)
        return found

    @property
    def _count(self) -> int:
        """Gauss points a direction: exact for ε:C:ε of polynomials; arcs, which are none, take more."""
        return self.space.degree + 1 + (_ON_ARCS if len(self.space.curved) else 0)

    def strain(self, v: FloatArray, cells: IntArray | slice, t: FloatArray) -> FloatArray:
        """Strains of v (size,) at reference points t, (k, 2) for all cells or (cells, k, 2); (cells, k, 3)."""
        (xx, xy), (yx, yy) = np.moveaxis(self._gradients(v, cells, t), (3, 1), (0, 1))
        return np.stack([xx, yy, xy + yx], axis=-1)

    def _gradients(self, v: FloatArray, cells: IntArray | slice, t: FloatArray) -> FloatArray:
        """∂_b u_c as [cell, b, point, c]."""
        cell, local = self.space.cell, v.reshape(-1, 2)[self.space.table[cells]]
        values = cell.derivative_values(t)
        along = np.stack([values @ (cell.differences[axis] @ local) for axis in (0, 1)], axis=1)
        found = _combined(self.space.slopes[cells].swapaxes(1, 2), along)
        at, which = self.space.curved.among(cells, len(self.space.table))
        if len(at):
            slopes = np.linalg.inv(self.space.curved.jacobians(which, t if np.ndim(t) == 2 else t[at]))
            found[at] = np.einsum("kqab,kaqc->kbqc", slopes, along[at])
        return found

    def points(self) -> tuple[FloatArray, FloatArray]:
        """Reference points t (q, 2) and weights (cells, q) that integrate ε:C:ε exactly."""
        t, weights = self.space.cell.quadrature(self._count)
        return t, self.space.measures(t, weights)

    def energy(self, v: FloatArray) -> float:
        """½ ∫ ε:C:ε."""
        t, weights = self.points()
        strain = self.strain(v, slice(None), t)
        return 0.5 * float(np.einsum("cq,cqk,cqk->", weights, strain, strain @ self.moduli.swapaxes(1, 2)))

    def force(self, v: FloatArray) -> FloatArray:
        """K v (size,), through stresses."""
        t, weights = self.points()
        stress = self.strain(v, slice(None), t) @ self.moduli.swapaxes(1, 2)
        return self.virtual_work(stress * weights[..., None], t)

    def virtual_work(self, stress: FloatArray, t: FloatArray) -> FloatArray:
        """Σ_q stress_q : ε_q(v) as a vector (size,), for weighted stresses (cells, q, 3) at points t (q, 2)."""
        space, cell = self.space, self.space.cell
        xx, yy, xy = np.moveaxis(stress, -1, 0)
        tensor = np.stack([np.stack([xx, xy], axis=-1), np.stack([xy, yy], axis=-1)], axis=1)
        along = _combined(space.slopes, tensor)
        if len(space.curved):
            every = np.arange(len(space.curved))
            slopes = np.linalg.inv(space.curved.jacobians(every, t))
            along[space.curved.numbers] = np.einsum("kqab,kbqc->kaqc", slopes, tensor[space.curved.numbers])
        values = cell.derivative_values(t).T
        local = sum(cell.differences[axis].T @ (values @ along[:, axis]) for axis in (0, 1))
        found = np.bincount(space.dofs.ravel(), np.ravel(local), minlength=space.size)
        return np.asarray(found, dtype=np.float64)


def _combined(matrices: FloatArray, fields: FloatArray) -> FloatArray:
    """Σ_b M_ab f_b of each cell for matrices (cells, 2, 2) and fields (cells, 2, q, c)."""
    n, _, q, c = fields.shape
    return np.asarray((matrices @ fields.reshape(n, 2, q * c)).reshape(n, 2, q, c))
