"""What the contact points feel of the body: σ = σ_bonded − C m with C = B K⁻¹ Bᵀ, B = [N; T].

As B touches only the interface Γ of `EqualitySystem`, C = B_Γ S⁻¹ B_Γᵀ with the Schur complement S.
"""

import numpy as np

from solvers.basics.types import Matrix, Vector
from solvers.inequality.problem import FrictionQVI

_DENSE_LIMIT = 20_000_000  # entries of C up to which it is computed
_CORRECTIONS = 4


class Compliance:
    """The affine map from row multipliers m = (m_N, m_T) to tractions σ = (σ_N, σ_T), K factored once.

    With equality rows K⁻¹ is that of the constrained system. C (2m, 2m) is kept dense where it is small.
    """

    def __init__(self, qvi: FrictionQVI) -> None:
        self._qvi = qvi
        self._rows = qvi.contact_rows
        self._condensed = qvi.condensed_contact
        self.bonded = self.tractions(qvi.bonded)

    @property
    def is_dense(self) -> bool:
        """Whether C is computed rather than applied."""
        return (2 * self._qvi.m) ** 2 <= _DENSE_LIMIT

    @property
    def dense(self) -> Matrix:
        """C (2m, 2m)."""
        return self._condensed.compliance

    def tractions(self, z: Vector) -> Vector:
        """(σ_N, σ_T) at z (2m,)."""
        return np.concatenate([self._qvi.normal(z), self._qvi.tangential(z)])

    def relief(self, m: Vector) -> Vector:
        """C m (2m,)."""
        if self.is_dense:
            return np.asarray(self.dense @ m)
        rows = self._condensed.contact_rows_near
        return np.asarray(rows @ self._condensed.system.solve_interface(rows.T @ m)[0])

    def unknowns(self, m: Vector) -> tuple[Vector, Vector]:
        """The z (n,) and ν (p,) that minimise the energy under the multipliers m (2m,).

        Defect corrections with `FrictionQVI.gradient` go on as long as they shrink.
        """
        qvi, system = self._qvi, self._condensed.system
        forces = self._rows.T @ m
        z = qvi.bonded - system.solve(forces)[0]
        correction, nu = system.solve(-qvi.gradient(z) - forces, qvi.b - qvi.arrays.A @ z)
        size = np.inf
        for _ in range(_CORRECTIONS):
            new = float(np.abs(self._rows @ correction).max(initial=0.0))
            if not new < 0.5 * size:
                break
            z, size = z + correction, new
            correction, nu = system.solve(-qvi.gradient(z) - forces, qvi.b - qvi.arrays.A @ z)
        return z, nu
