"""Equations between trace coordinates, solved for some of them: y = y₀ + M u.

Of all k coordinates some are known from points without friction (`Frictionless`), p more are given by the others
through A y = b, pivots of a QR factorisation of A, and u are the rest. M is sparse but for p rows.

In `docs/theory.md`: (D6).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import SuperLU, splu

from solvers.basics.types import IntVector, Matrix, Sparse, SparseRows, Vector
from solvers.inequality.rows import Rows, are_few, dense, echelon

# Contact points whose friction bound is zero whatever the pressure: equations σ_T = 0 instead of bounds.
#
# As bounds |σ_T| ≤ 0 they would have no interior. Where they fix every trace coordinate they touch, as on a contact
# without friction, those coordinates are known; otherwise independent ones of the rows become equations.


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


_DEPENDENT = 1e-10  # rows of A, scaled to length one, that are shorter than this beside the others repeat them


@dataclass(frozen=True, eq=False)
class Equations:
    """The substitution that a set of equations gives.

    Attributes
    ----------
    free : coordinates u
    map : M (k, u)
    A : (p', k), all equations
    frictionless : the coordinates and equations that points without friction bring

    """

    free: IntVector
    map: Rows
    A: Matrix
    frictionless: Frictionless
    _pivots: IntVector
    _scale: Vector  # of the rows
    _Q: Matrix
    _R: Matrix

    @classmethod
    def of(cls, A: Matrix, frictionless: Frictionless, size: int) -> "Equations":
        """Choose pivots for A (p, k) and the equations of points without friction."""
        A = np.vstack([A, frictionless.equations])
        unknown = np.setdiff1d(np.arange(size), frictionless.fixed)
        lengths = np.linalg.norm(A, axis=1)
        scale = 1.0 / np.where(lengths > 0.0, lengths, 1.0)
        Q, R, order = _pivoted(scale[:, None] * A[:, unknown])
        rank = int((np.abs(R.diagonal()) > _DEPENDENT).sum())
        pivots, free = unknown[order[:rank]], np.sort(unknown[order[rank:]])
        number = np.searchsorted(free, unknown[order[rank:]])
        tail = np.zeros((rank, len(free)))
        tail[:, number] = -solve_triangular(R[:rank, :rank], R[:rank, rank:]) if rank else 0.0
        return cls(free, _map(size, free, pivots, tail), A, frictionless, pivots, scale, Q[:, :rank], R[:rank, :rank])

    def offset(self, b: Vector, tangential: Vector) -> Vector:
        """y₀ (k,): the solution of A y = b and σ_T = 0 with u = 0; b without, tangential (m,) the shear at y = 0."""
        y = np.zeros(self.map.shape[0])
        y[self.frictionless.fixed] = self.frictionless.values(tangential)
        right = np.concatenate([b, -tangential[self.frictionless.kept]]) - self.A @ y
        if len(self._pivots):
            y[self._pivots] = solve_triangular(self._R, self._Q.T @ (self._scale * right))
        return y

    def quadratic(self, S: Matrix | SparseRows) -> Matrix | SparseRows:
        """MᵀSM (u, u); sparse only where there are no equations."""
        free, pivots = self.free, self._pivots
        if len(free) == S.shape[0]:
            return S
        S = np.asarray(S)
        inner = S[np.ix_(free, free)]
        if not len(pivots):
            return inner
        tail = dense(self.map[pivots])
        mixed = S[np.ix_(free, pivots)] @ tail
        return np.asarray(inner + mixed + mixed.T + tail.T @ (S[np.ix_(pivots, pivots)] @ tail))

    def multipliers(self, residual: Vector, count: int, p: int) -> tuple[Vector, Vector]:
        """(ν (p,), m_T (count,) of points without friction) that balance the residual (k,) of S y + c + Eᵀm."""
        nu = np.zeros(len(self.A))
        if len(self._pivots):
            nu = self._scale * (self._Q @ solve_triangular(self._R, -residual[self._pivots], trans="T"))
        residual = residual + self.A.T @ nu
        return nu[:p], self.frictionless.multipliers(residual, nu[p:], count)


def _pivoted(A: Matrix) -> tuple[Matrix, Matrix, IntVector]:
    """Q, R and the order of columns of a QR factorisation with pivoting; without rows all columns as they are."""
    if not len(A):
        return np.zeros((0, 0)), np.zeros((0, 0)), np.arange(A.shape[1])
    Q, R, order = qr(A, mode="economic", pivoting=True)
    return np.asarray(Q, dtype=np.float64), np.asarray(R, dtype=np.float64), np.asarray(order, dtype=np.int64)


def _map(size: int, free: IntVector, pivots: IntVector, tail: Matrix) -> Rows:
    """M (size, u): unit rows for the free coordinates, the tail's for the pivots, none for those that are known."""
    if are_few(size, len(free)):
        M = np.zeros((size, len(free)))
        M[free, np.arange(len(free))] = 1.0
        M[pivots] = tail
        return M
    identity = csr_array((np.ones(len(free)), (free, np.arange(len(free)))), (size, len(free)))
    spread = csr_array((np.ones(len(pivots)), (pivots, np.arange(len(pivots)))), (size, len(pivots)))
    return csr_array(identity + spread @ csr_array(tail))
