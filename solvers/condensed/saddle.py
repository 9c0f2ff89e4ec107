"""Newton steps of `interior_point` without the elimination of stiff bounds, for the last digits.

Eliminating λ adds W λ/s times the square of a row to S. Once s is tiny that swamps S in all directions in which several
rows act together, and the multipliers lose what the gap gains. Here tractions t = T y with W D |T|² > 1 keep the force
f = Σ ± dλ of their bounds as an unknown, D = Σ λ/s over the bounds of the traction, ± their side:

    [S + BᵀW diag(λ/s) C over the others   TᵀW  ] (dy)   (−force − BᵀW (target + λ r)/s over the others)
    [Σ ± λ/s C / D                         −1/D ] (f )  = (−Σ ± (target + λ r)/s / D                   )

with r the residual of the slacks. One row a traction, not one a bound: an open point has three bounds on two tractions.
The matrix is larger, so this is for when the smaller one has done what it can.

Slacks that are tiny change by what forces say, not by differences of the much larger tractions. With a = target/s and
g = −r + the change of the friction bound, ds_j = g_j − ±_j dt and f = Σ ±_i (a_i − λ_i/s_i ds_i) give

    ds_j = (Σ_i λ_i/s_i (g_j − ±_i ±_j g_i) − ±_j (f − Σ ±_i a_i)) / D,

in which the two bounds on either side of a point that opens, s₊ + s₋ = 2 mu p, keep their sum.
"""

from dataclasses import dataclass

import numpy as np
from numpy.linalg import LinAlgError
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse import csr_matrix

from solvers.basics.types import BoolVector, IntVector, Matrix, Vector
from solvers.condensed.complementarity import SLOTS, Complementarity
from solvers.inequality.blocks import Rows, dense

_REFINEMENTS = 2
_STIFFEST = 1e15  # W D |T|² as it is factorised: of dependent rows no pivot vanishes; refinement knows the true one


@dataclass(frozen=True, eq=False)
class Saddle:
    """The factorised matrix for slacks s, multipliers λ and rows C; stiff tractions."""

    problem: Complementarity
    s: Vector
    lam: Vector
    rows: Rows
    stiff: BoolVector
    total: Vector  # D of the stiff tractions
    matrix: Matrix
    left: Vector  # scale of equations
    right: Vector  # scale of unknowns
    factor: Matrix
    pivots: IntVector

    @classmethod
    def at(cls, problem: Complementarity, s: Vector, lam: Vector, rows: Rows) -> "Saddle":
        """Assemble and factorise."""
        k, ratio = problem.S.shape[0], lam / s
        D = np.bincount(problem.traction, ratio)
        T, W = dense(problem.B)[: len(D)], problem.weights[: len(D)]
        size = W * np.einsum("ij,ij->i", T, T)
        stiff = size * D > 1.0
        H = np.array(problem.S)
        problem.add_stiffness(H, np.where(stiff[problem.traction], 0.0, ratio), rows)
        matrix = np.zeros((k + int(stiff.sum()),) * 2)
        matrix[:k, :k] = H
        matrix[:k, k:] = (W[stiff, None] * T[stiff]).T
        matrix[k:, :k] = dense(_sums(problem, ratio / D[problem.traction])[stiff] @ rows)
        matrix[k:, k:] = -np.diag(1.0 / D[stiff])
        left = 1.0 / np.abs(matrix).max(axis=1, initial=np.finfo(float).tiny)
        right = 1.0 / np.abs(left[:, None] * matrix).max(axis=0, initial=np.finfo(float).tiny)
        regular = matrix.copy()
        regular[k:, k:] = -np.diag(np.maximum(1.0 / D, size / _STIFFEST)[stiff])
        factor, pivots, info = dgetrf(left[:, None] * regular * right)
        if info > 0 or not np.isfinite(factor).all():
            raise LinAlgError("it is singular")
        return cls(problem, s, lam, rows, stiff, D[stiff], matrix, left, right, factor, pivots)

    def solve(self, force: Vector, slack: Vector, comp: Vector) -> tuple[Vector, Vector, Vector]:
        """(dy, ds, dλ) for residuals of y and of the slacks, and the wanted change of s λ."""
        problem, k = self.problem, len(force)
        moved = (comp + self.lam * slack) / self.s
        top = -force - problem.force(np.where(self.stiff[problem.traction], 0.0, moved))
        sums = (np.bincount(problem.traction, np.take(SLOTS, problem.slot) * moved))[self.stiff]
        right = np.concatenate([top, -sums / self.total])
        x = np.zeros_like(right)
        for _ in range(1 + _REFINEMENTS):
            x = x + self.right * dgetrs(self.factor, self.pivots, self.left * (right - self.matrix @ x))[0]
        y = x[:k]
        s = self._slacks(y, x[k:], slack, comp)
        return y, s, (comp - self.lam * s) / self.s

    def _slacks(self, y: Vector, forces: Vector, slack: Vector, comp: Vector) -> Vector:
        """The changes of s (q,), those of stiff tractions by their forces."""
        problem = self.problem
        change = self.rows @ y
        s = -slack - change
        friction = problem.B @ y - change  # of the friction bounds, with the pressure
        s = self._by_forces(s, friction - slack, forces, comp)
        coulomb = np.flatnonzero(problem.pressed >= 0)
        pressure = (s + slack)[problem.pressed[coulomb]]
        friction[coulomb] = problem.friction[coulomb] * pressure
        return self._by_forces(s, friction - slack, forces, comp)

    def _by_forces(self, s: Vector, free: Vector, forces: Vector, comp: Vector) -> Vector:
        """Changes s with ds_j of the module's docstring in place of that of stiff tractions; `free` are g (q,)."""
        ratio, wanted, g = (self._gathered(values) for values in (self.lam / self.s, comp / self.s, free))
        sides = np.array(SLOTS)
        net = forces - wanted @ sides
        pairs = g[:, :, None] - np.outer(sides, sides) * g[:, None, :]  # exactly zero for a bound with itself
        changes = np.einsum("tji,ti->tj", pairs, ratio) - np.outer(net, sides)
        every = np.zeros((len(self.stiff), len(SLOTS)))
        every[self.stiff] = changes / self.total[:, None]
        traction, slot = self.problem.traction, self.problem.slot
        return np.where(self.stiff[traction], every[traction, slot], s)

    def _gathered(self, values: Vector) -> Matrix:
        """Values (q,) of bounds by stiff traction and slot, 0 where there is no bound."""
        gathered = np.zeros((len(self.stiff), len(SLOTS)))
        gathered[self.problem.traction, self.problem.slot] = values
        return gathered[self.stiff]


def _sums(problem: Complementarity, values: Vector) -> csr_matrix:
    """Sums over the bounds of each traction, with their side: (tractions, q)."""
    sides = np.take(SLOTS, problem.slot) * values
    shape = (int(problem.traction.max(initial=-1)) + 1, len(sides))  # no bound, no traction: all may be equations
    return csr_matrix((sides, (problem.traction, np.arange(len(sides)))), shape)
