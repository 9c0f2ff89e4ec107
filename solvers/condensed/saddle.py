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

from solvers.basics.types import BoolVector, IntVector, Matrix, Vector
from solvers.condensed.complementarity import SLOTS, Complementarity
from solvers.inequality.rows import Rows, dense, scaled

_SIDES = np.array(SLOTS)
_SAME_SIDE = np.outer(_SIDES, _SIDES)
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
    bounds: IntVector  # (stiff, 4) those of stiff tractions by slot, −1 without one
    ratio: Matrix  # (stiff, 4) λ/s of them, 0 without one
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
        D: Vector = np.asarray(np.bincount(problem.traction, ratio), dtype=np.float64)
        T, W = problem.traction_rows, problem.weights[: len(D)]
        size = problem.traction_sizes
        stiff = size * D > 1.0
        bounds = problem.bounds[stiff]
        by_slot = _gathered(ratio, bounds)
        matrix = np.zeros((k + len(bounds),) * 2)
        matrix[:k, :k] = problem.S
        problem.add_stiffness(matrix[:k, :k], np.where(stiff[problem.traction], 0.0, ratio), rows)
        matrix[:k, k:] = (W[stiff, None] * T[stiff]).T
        matrix[k:, :k] = _summed(by_slot * _SIDES / D[stiff, None], rows, bounds)
        diagonal = np.arange(k, len(matrix))
        matrix[diagonal, diagonal] = -1.0 / D[stiff]
        left = 1.0 / np.abs(matrix).max(axis=1, initial=np.finfo(float).tiny)
        right = 1.0 / np.abs(left[:, None] * matrix).max(axis=0, initial=np.finfo(float).tiny)
        regular = np.multiply(left[:, None] * matrix, right, order="F")
        regular[diagonal, diagonal] = -np.maximum(1.0 / D, size / _STIFFEST)[stiff] * left[k:] * right[k:]
        factor, pivots, info = dgetrf(regular, overwrite_a=1)
        if info > 0 or not np.isfinite(factor).all():
            raise LinAlgError("it is singular")
        return cls(problem, s, lam, rows, stiff, bounds, by_slot, D[stiff], matrix, left, right, factor, pivots)

    def solve(self, force: Vector, slack: Vector, comp: Vector) -> tuple[Vector, Vector, Vector]:
        """(dy, ds, dλ) for residuals of y and of the slacks, and the wanted change of s λ."""
        problem, k = self.problem, len(force)
        moved = (comp + self.lam * slack) / self.s
        top = -force - problem.force(np.where(self.stiff[problem.traction], 0.0, moved))
        right = np.concatenate([top, -(_gathered(moved, self.bounds) @ _SIDES) / self.total])
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
        net = forces - _gathered(comp / self.s, self.bounds) @ _SIDES
        self._by_forces(s, friction - slack, net)
        coulomb = problem.coulomb
        pressure = (s + slack)[problem.pressed[coulomb]]
        friction[coulomb] = problem.friction[coulomb] * pressure
        self._by_forces(s, friction - slack, net)
        return s

    def _by_forces(self, s: Vector, free: Vector, net: Vector) -> None:
        """Put ds_j of the module's docstring in place of that of stiff tractions; `free` are g (q,), net f − Σ ±a."""
        g = _gathered(free, self.bounds)
        pairs = g[:, :, None] - _SAME_SIDE * g[:, None, :]  # exactly zero for a bound with itself
        changes = ((pairs * self.ratio[:, None, :]).sum(axis=2) - net[:, None] * _SIDES) / self.total[:, None]
        there = self.bounds >= 0
        s[self.bounds[there]] = changes[there]


def _gathered(values: Vector, bounds: IntVector) -> Matrix:
    """Values (q,) of bounds by traction and slot, 0 where there is no bound."""
    return np.where(bounds >= 0, values[bounds], 0.0)


def _summed(factors: Matrix, rows: Rows, bounds: IntVector) -> Matrix:
    """Sums (t, k) of the rows of the bounds of each traction, times factors (t, 4)."""
    total = np.zeros((len(bounds), rows.shape[1]))
    for slot in np.flatnonzero((bounds >= 0).any(axis=0)):
        total += dense(scaled(factors[:, slot], rows[bounds[:, slot]]))
    return total
