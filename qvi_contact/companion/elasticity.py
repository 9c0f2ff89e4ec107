"""Strains and stresses of a displacement, the stiffness matrix, and forces without the rounding inside it.

Strains are (ε_xx, ε_yy, 2ε_xy). Derivatives act on differences of neighbouring Bernstein coefficients,

    ∂u/∂x = p/h Σ (c_{i+1,j} − c_ij) B_i^{p−1} B_j^p,

so that a rigid motion, however large, leaves no rounding behind.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.companion.element import lattice, reference_matrices
from qvi_contact.companion.space import Space
from qvi_contact.element import bernstein
from qvi_contact.element.hermite import gauss_legendre


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
        space = self.space
        p = space.degree
        order = np.argsort(lattice(p).ravel())  # scikit-fem's numbers to [along y, along x]
        local = reference_matrices(p)
        h = space.sizes
        factors = np.empty((2, 2, len(h)))
        factors[0, 0], factors[1, 1] = h[:, 1] / h[:, 0], h[:, 0] / h[:, 1]
        factors[0, 1] = factors[1, 0] = 1.0
        # Entry of (ε_xx, ε_yy, 2ε_xy) that ∂_a of component c goes to.
        entry = ((0, 2), (2, 1))
        n = local.shape[-1]
        blocks = np.zeros((len(h), n, 2, n, 2))
        for c in (0, 1):
            for d in (0, 1):
                for a in (0, 1):
                    for b in (0, 1):
                        weight = self.moduli[:, entry[a][c], entry[b][d]] * factors[a, b]
                        blocks[:, :, c, :, d] += weight[:, None, None] * local[a, b]
        dofs = (2 * space.table.reshape(len(h), -1)[:, order, None] + np.arange(2)).reshape(len(h), 2 * n)
        rows, columns = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
        data = blocks.reshape(len(h), 2 * n, 2 * n)
        K = sparse.coo_array((data.ravel(), (rows.ravel(), columns.ravel())), shape=(space.size, space.size)).tocsr()
        return sparse.csr_array((K + K.T) / 2.0)

    def strain(self, v: FloatArray, cells: IntArray | slice, tx: FloatArray, ty: FloatArray) -> FloatArray:
        """Strains of v (size,) at reference points, (n, k, 3): tx, ty are (k,) for all cells, or (n, k)."""
        gradients = self._gradients(v.reshape(-1, 2)[self.space.table[cells]], self.space.sizes[cells], tx, ty)
        (xx, xy), (yx, yy) = gradients
        return np.stack([xx, yy, xy + yx], axis=-1)

    def _gradients(
        self, local: FloatArray, sizes: FloatArray, tx: FloatArray, ty: FloatArray
    ) -> list[list[FloatArray]]:
        """∂_b u_a as [a][b], (n, k) each, of coefficients (n, p + 1, p + 1, 2)."""
        p = self.space.degree
        along_x = p * (local[:, :, 1:] - local[:, :, :-1]) / sizes[:, 0, None, None, None]
        along_y = p * (local[:, 1:] - local[:, :-1]) / sizes[:, 1, None, None, None]
        return [
            [tensor_values(along_x[..., a], p, p - 1, tx, ty), tensor_values(along_y[..., a], p - 1, p, tx, ty)]
            for a in (0, 1)
        ]

    def points(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Reference coordinates tx, ty (q,) and weights (cells, q) that integrate ε:C:ε exactly."""
        count = self.space.degree + 1
        t, w = gauss_legendre(count)
        area = self.space.sizes.prod(axis=1)
        return np.tile(t, count), np.repeat(t, count), area[:, None] * np.outer(w, w).ravel()

    def energy(self, v: FloatArray) -> float:
        """½ ∫ ε:C:ε."""
        tx, ty, weights = self.points()
        strain = self.strain(v, slice(None), tx, ty)
        return 0.5 * float(np.einsum("cq,cqk,ckl,cql->", weights, strain, self.moduli, strain, optimize=True))

    def force(self, v: FloatArray) -> FloatArray:
        """K v (size,), through stresses."""
        tx, ty, weights = self.points()
        stress = np.einsum("ckl,cql->cqk", self.moduli, self.strain(v, slice(None), tx, ty)) * weights[..., None]
        return self.virtual_work(stress, tx, ty)

    def virtual_work(self, stress: FloatArray, tx: FloatArray, ty: FloatArray) -> FloatArray:
        """Σ_q stress_q : ε_q(v) as a vector (size,), for weighted stresses (cells, q, 3) at points (q,)."""
        space, p = self.space, self.space.degree
        xx, yy, xy = np.moveaxis(stress, -1, 0)
        local = np.zeros((len(xx), p + 1, p + 1, 2))
        for a, (by_x, by_y) in enumerate(((xx, xy), (xy, yy))):
            x_part = np.einsum("cq,qj,qi->cji", by_x, bernstein.basis(p, ty), bernstein.basis(p - 1, tx), optimize=True)
            y_part = np.einsum("cq,qj,qi->cji", by_y, bernstein.basis(p - 1, ty), bernstein.basis(p, tx), optimize=True)
            x_part *= p / space.sizes[:, 0, None, None]
            y_part *= p / space.sizes[:, 1, None, None]
            local[:, :, 1:, a] += x_part
            local[:, :, :-1, a] -= x_part
            local[:, 1:, :, a] += y_part
            local[:, :-1, :, a] -= y_part
        dofs = 2 * space.table[..., None] + np.arange(2)
        return np.asarray(np.bincount(dofs.ravel(), local.ravel(), minlength=space.size), dtype=np.float64)


def tensor_values(coefficients: FloatArray, degree_y: int, degree_x: int, tx: FloatArray, ty: FloatArray) -> FloatArray:
    """Values (n, k) of Σ c_ji B_j(ty) B_i(tx), c (n, degree_y + 1, degree_x + 1), at points (k,) or (n, k)."""
    if tx.ndim == 1:
        in_x, in_y = bernstein.basis(degree_x, tx), bernstein.basis(degree_y, ty)
        return np.asarray(np.einsum("cji,ki,kj->ck", coefficients, in_x, in_y, optimize=True))
    in_x = bernstein.basis(degree_x, tx.ravel()).reshape(*tx.shape, degree_x + 1)
    in_y = bernstein.basis(degree_y, ty.ravel()).reshape(*ty.shape, degree_y + 1)
    return np.asarray(np.einsum("cji,cki,ckj->ck", coefficients, in_x, in_y))
