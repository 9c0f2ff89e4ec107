"""Equations between trace coordinates, solved for some of them: y = y₀ + M u.

Of all k coordinates some are known from points without friction (`Frictionless`), p more are given by the others
through A y = b, pivots of a QR factorisation of A, and u are the rest. M is sparse but for p rows.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.sparse import csr_matrix

from solvers.basics.types import IntVector, Matrix, Sparse, Vector
from solvers.condensed.frictionless import Frictionless

_DEPENDENT = 1e-10  # rows of A, scaled to length one, that are shorter than this beside the others repeat them


@dataclass(frozen=True, eq=False)
class Equations:
    """The substitution that a set of equations gives.

    Attributes
    ----------
    free : coordinates u
    map : M (k, u) csr
    A : (p', k), all equations
    frictionless : the coordinates and equations that points without friction bring

    """

    free: IntVector
    map: Sparse
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
        Q, R, order = qr(scale[:, None] * A[:, unknown], mode="economic", pivoting=True)
        rank = int((np.abs(R.diagonal()) > _DEPENDENT).sum()) if len(A) else 0
        pivots, free = unknown[order[:rank]], np.sort(unknown[order[rank:]])
        number = np.searchsorted(free, unknown[order[rank:]])
        tail = np.zeros((rank, len(free)))
        tail[:, number] = -solve_triangular(R[:rank, :rank], R[:rank, rank:]) if rank else 0.0
        identity = csr_matrix((np.ones(len(free)), (free, np.arange(len(free)))), (size, len(free)))
        spread = csr_matrix((np.ones(rank), (pivots, np.arange(rank))), (size, rank))
        return cls(
            free, csr_matrix(identity + spread @ csr_matrix(tail)), A, frictionless, pivots, scale,
            np.asarray(Q[:, :rank], dtype=np.float64), np.asarray(R[:rank, :rank], dtype=np.float64),
        )  # fmt: skip

    def offset(self, b: Vector, tangential: Vector) -> Vector:
        """y₀ (k,): the solution of A y = b and σ_T = 0 with u = 0; b without, tangential (m,) the shear at y = 0."""
        y = np.zeros(self.map.shape[0])
        y[self.frictionless.fixed] = self.frictionless.values(tangential)
        right = np.concatenate([b, -tangential[self.frictionless.kept]]) - self.A @ y
        if len(self._pivots):
            y[self._pivots] = solve_triangular(self._R, self._Q.T @ (self._scale * right))
        return y

    def quadratic(self, S: Matrix) -> Matrix:
        """MᵀSM (u, u)."""
        free, pivots = self.free, self._pivots
        if len(free) == len(S):
            return S
        inner = S[np.ix_(free, free)]
        if not len(pivots):
            return inner
        tail = self.map[pivots].toarray()
        mixed = S[np.ix_(free, pivots)] @ tail
        return np.asarray(inner + mixed + mixed.T + tail.T @ (S[np.ix_(pivots, pivots)] @ tail))

    def multipliers(self, residual: Vector, count: int, p: int) -> tuple[Vector, Vector]:
        """(ν (p,), m_T (count,) of points without friction) that balance the residual (k,) of S y + c + Eᵀm."""
        nu = np.zeros(len(self.A))
        if len(self._pivots):
            nu = self._scale * (self._Q @ solve_triangular(self._R, -residual[self._pivots], trans="T"))
        residual = residual + self.A.T @ nu
        return nu[:p], self.frictionless.multipliers(residual, nu[p:], count)
