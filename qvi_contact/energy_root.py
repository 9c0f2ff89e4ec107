"""The energy as a square of stresses: K = RᵀR without cancellation.

An assembled K is wrong by its own rounding: entries of size h⁻² (in scaled degrees of freedom) cancel to stresses of
size one, which costs a direct solve four digits at every tenfold refinement. Stresses computed from differences of
nodal values lose nothing, so a residual computed through them tells how good a solution really is, and one or two
steps of defect correction repair it.

Along one direction a cubic with end values v₀, v₁ and end slopes g₀, g₁ (times the length) is written with the
differences d = v₁ − v₀, δ₀ = g₀ − d, δ₁ = g₁ − d as

    v₀ + d t + δ₀ (t − 2t² + t³) + δ₁ (t³ − t²)

whose second derivative contains the δ alone.
"""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from scipy import sparse

from qvi_contact.checks import BoolArray, FloatArray, IntArray
from qvi_contact.element import GAUSS_COUNT, STRESS_DERIVATIVES, Grid
from qvi_contact.hermite import gauss_legendre, hermite

#: (v₀, g₀, v₁, g₁) to (v₀, d, δ₀, δ₁)
_DIFFERENCES = np.array([[1.0, 0, 0, 0], [-1, 0, 1, 0], [1, 1, -1, 0], [1, 0, -1, 1]])


@cache
def _difference_basis(derivative: int) -> FloatArray:
    """Functions 1, t, t − 2t² + t³, t³ − t², or their derivatives, at the Gauss points; shape (points, 4)."""
    t, _ = gauss_legendre(GAUSS_COUNT)
    polynomials = {0: (np.ones_like(t), t), 1: (np.zeros_like(t), np.ones_like(t)), 2: (0 * t, 0 * t)}[derivative]
    slopes = hermite(t, derivative)[..., 1]
    return np.column_stack([*polynomials, slopes[..., 0], slopes[..., 1]])


@dataclass(frozen=True, eq=False)
class StressRoot:
    """z ↦ r(z) = R z + r₀, the stresses at the Gauss points weighted so that ½|r|² is the strain energy.

    With U the upper Cholesky factor of the compliance, c = UᵀU, and w the quadrature weights, r stacks √w U σ over
    the 4×4 Gauss points of all cells; the rule is exact for bicubic Φ.

    Attributes
    ----------
    grid : Grid
        Dimensionless grid.
    active : (ny, nx) bool array
        Cells of the body.
    compliances : (cells, 3, 3) array
        Dimensionless compliance of the active cells.
    basis, particular
        u = basis z + particular, see `Elimination`.
    potential : (cells, points) array
        Dimensionless body-force potential φ at the Gauss points of the active cells.

    """

    grid: Grid
    active: BoolArray
    compliances: FloatArray
    basis: sparse.csr_array
    particular: FloatArray
    potential: FloatArray

    def apply(self, z: FloatArray) -> FloatArray:
        """r(z), shape (cells · points · 3,)."""
        stress = self._stress(self.basis @ z + self.particular)
        stress[..., 0] += self.potential
        stress[..., 1] += self.potential
        return np.asarray(self._root_weights * (stress @ self._upper.swapaxes(1, 2))).ravel()

    def adjoint(self, r: FloatArray) -> FloatArray:
        """Rᵀ r, shape (n,)."""
        weighted = (self._root_weights * r.reshape(*self._root_weights.shape[:2], 3)) @ self._upper
        return np.asarray(self.basis.T @ self._stress_adjoint(weighted))

    @cached_property
    def _upper(self) -> FloatArray:
        """U of each cell, shape (cells, 3, 3)."""
        return np.asarray(np.linalg.cholesky(self.compliances).swapaxes(1, 2))

    @cached_property
    def _root_weights(self) -> FloatArray:
        row, column = np.nonzero(self.active)
        _, w = gauss_legendre(GAUSS_COUNT)
        size = self.grid.x.sizes[column] * self.grid.y.sizes[row]
        return np.sqrt(np.outer(size, np.outer(w, w).ravel()))[..., None]

    @cached_property
    def _dofs(self) -> IntArray:
        row, column = np.nonzero(self.active)
        return self.grid.cell_dofs(column, row)

    @cached_property
    def _slope_factors(self) -> FloatArray:
        """Factors that turn stored values into (Φ, h_x Φ_x, h_y Φ_y, h_x h_y Φ_xy), shape (cells, 16)."""
        row, column = np.nonzero(self.active)
        one = np.ones_like(self.grid.x.end_scales)
        in_x = np.stack([one, self.grid.x.sizes[:, None] / self.grid.x.end_scales], axis=-1)[column]
        one = np.ones_like(self.grid.y.end_scales)
        in_y = np.stack([one, self.grid.y.sizes[:, None] / self.grid.y.end_scales], axis=-1)[row]
        return np.asarray(np.einsum("cap,cbr->cbarp", in_x, in_y)).reshape(-1, 16)

    @cached_property
    def _derivative_factors(self) -> FloatArray:
        """Factor of each stress component: ±1/(h_x^i h_y^j), shape (cells, 3)."""
        row, column = np.nonzero(self.active)
        h_x, h_y = self.grid.x.sizes[column], self.grid.y.sizes[row]
        return np.column_stack([sign / (h_x**i * h_y**j) for i, j, sign in STRESS_DERIVATIVES])

    def _stress(self, u: FloatArray) -> FloatArray:
        """Stress without φ at the Gauss points, shape (cells, points, 3)."""
        values = (u[self._dofs] * self._slope_factors).reshape(-1, 2, 2, 2, 2)  # (cell, b, a, r, p)
        values = values.transpose(0, 1, 3, 2, 4).reshape(-1, 4, 4)  # rows along y, columns along x
        values = _DIFFERENCES @ values @ _DIFFERENCES.T
        stress = [
            _difference_basis(j) @ values @ _difference_basis(i).T * self._derivative_factors[:, k, None, None]
            for k, (i, j, _) in enumerate(STRESS_DERIVATIVES)
        ]
        return np.stack([part.reshape(len(values), -1) for part in stress], axis=-1)

    def _stress_adjoint(self, stress: FloatArray) -> FloatArray:
        """Transpose of `_stress`, shape (all degrees of freedom,)."""
        values = np.zeros((len(stress), 4, 4))
        for k, (i, j, _) in enumerate(STRESS_DERIVATIVES):
            part = stress[..., k].reshape(-1, GAUSS_COUNT, GAUSS_COUNT) * self._derivative_factors[:, k, None, None]
            values += _difference_basis(j).T @ part @ _difference_basis(i)
        values = _DIFFERENCES.T @ values @ _DIFFERENCES
        values = values.reshape(-1, 2, 2, 2, 2).transpose(0, 1, 3, 2, 4).reshape(-1, 16) * self._slope_factors
        total = np.zeros(len(self.particular))
        total += np.bincount(self._dofs.ravel(), weights=values.ravel(), minlength=len(total))
        return total
