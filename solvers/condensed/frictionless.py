"""Contact points whose friction bound is zero whatever the pressure: equations σ_T = 0 instead of bounds.

As bounds |σ_T| ≤ 0 they would have no interior. Where they fix every trace coordinate they touch, as on a contact
without friction, those coordinates are known; otherwise independent ones of the rows become equations.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import SuperLU, splu

from solvers.basics.types import IntVector, Matrix, Sparse, Vector
from solvers.inequality.blocks import Rows
from solvers.inequality.rows import echelon


@dataclass(frozen=True, eq=False)
class Frictionless:
    """The equations of points without friction.

    Attributes
    ----------
    points : (f,) contact points without friction
    fixed : trace coordinates that they determine
    equations : (p', k) rows for those that are kept as equations, of the points `kept`
    kept : (p',) points

    """

    points: IntVector
    fixed: IntVector
    equations: Matrix
    kept: IntVector
    _rows: Rows  # E_T of the points, by all coordinates
    _weights: Vector

    @classmethod
    def of(cls, points: IntVector, E_T: Rows, weights: Vector) -> "Frictionless":
        """Sort the rows E_T (m, k) of the given points; weights W (m,)."""
        if not len(points):
            none = np.zeros(0, dtype=np.int64)
            return cls(points, none, np.zeros((0, E_T.shape[1])), none, E_T[points], weights[points])
        rows = csr_array(E_T[points])
        rows.data[np.abs(rows.data) < 1e-14 * np.abs(rows.data).max(initial=0.0)] = 0.0
        rows.eliminate_zeros()
        touched = np.unique(rows.indices).astype(np.int64)
        chosen = echelon(rows[:, touched]).rows
        none = np.zeros(0, dtype=np.int64)
        if len(chosen) == len(touched):
            return cls(points, touched, np.zeros((0, E_T.shape[1])), none, rows, weights[points])
        return cls(points, none, rows[chosen].toarray(), points[chosen], rows, weights[points])

    def values(self, tangential: Vector) -> Vector:
        """The fixed coordinates at which σ_T = tangential + E_T y vanishes at the points; tangential is (m,)."""
        if not len(self.fixed):
            return np.zeros(0)
        G, factor = self._normal_equations
        return np.asarray(factor.solve(-(G.T @ (self._weights * tangential[self.points]))))

    def multipliers(self, residual: Vector, nu: Vector, count: int) -> Vector:
        """m_T (count,) of the points: those that balance the residual (k,) of S y + c + …, or ν of the equations."""
        m_T = np.zeros(count)
        m_T[self.kept] = nu
        if len(self.fixed):
            G, factor = self._normal_equations
            m_T[self.points] = -self._weights * (G @ factor.solve(residual[self.fixed]))
        return m_T

    @cached_property
    def _normal_equations(self) -> tuple[Sparse, SuperLU]:
        """G, the rows by fixed coordinates, and the factor of GᵀWG."""
        G = csc_array(self._rows[:, self.fixed])
        return G, splu(csc_array(G.T @ diags_array(self._weights) @ G))
