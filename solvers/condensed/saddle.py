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

from solvers.basics.types import IntVector, Matrix, Vector
from solvers.condensed.complementarity import SLOTS, Complementarity

_SIDES = np.array(SLOTS)
_SAME_SIDE = np.outer(_SIDES, _SIDES)
_REFINEMENTS = 2
_STIFFEST = 1e15  # W D |T|² as it is factorised: of dependent rows no pivot vanishes; refinement knows the true one


@dataclass(frozen=True, eq=False)
class Saddle:
    """The factorised matrix for slacks s, multipliers λ and the slope of |σ_N| at bilateral points; stiff tractions."""

    problem: Complementarity
    s: Vector
    lam: Vector
    slope: Vector
    stiff: IntVector
    D: Vector  # of all tractions
    soft: Vector  # W of the tractions that are not stiff, 0 of the others
    matrix: Matrix
    left: Vector  # scale of equations
    right: Vector  # scale of unknowns
    factor: Matrix
    pivots: IntVector

    @classmethod
    def at(cls, problem: Complementarity, s: Vector, lam: Vector, slope: Vector) -> "Saddle":
        """Assemble and factorise."""
        k, W, (T, N, sizes) = problem.S.shape[0], problem.W, problem.dense_rows
        D, e = problem.blocks(lam / s, slope)
        sizes = sizes * D  # W D |T|²
        stiff = (sizes > 1.0).nonzero()[0]
        soft = np.where(sizes > 1.0, 0.0, W)
        rows = T + (e / D)[:, None] * N  # Σ ± λ/s C / D
        matrix = np.zeros((k + stiff.size,) * 2)
        matrix[:k, :k] = problem.S + (T.T * (soft * D)) @ rows
        matrix[:k, k:] = T[stiff].T * W[stiff]
        matrix[k:, :k] = rows[stiff]
        diagonal = np.arange(k, k + stiff.size)
        matrix[diagonal, diagonal] = -1.0 / D[stiff]
        tiny = np.finfo(np.float64).tiny
        size = np.abs(matrix)
        left = 1.0 / np.maximum.reduce(size, axis=1, initial=tiny)
        size *= left[:, None]
        right = 1.0 / np.maximum.reduce(size, axis=0, initial=tiny)
        regular = np.multiply(left[:, None] * matrix, right, order="F")
        regular[diagonal, diagonal] *= np.maximum(1.0, sizes[stiff] / _STIFFEST)
        factor, pivots, info = dgetrf(regular, overwrite_a=1)
        if info > 0 or not np.isfinite(factor).all():
            raise LinAlgError("it is singular")
        return cls(problem, s, lam, slope, stiff, D, soft, matrix, left, right, factor, pivots)

    def solve(self, force: Vector, slack: Vector, comp: Vector) -> tuple[Vector, Vector, Vector]:
        """(dy, ds, dλ) for residuals of y and of the slacks, and the wanted change of s λ."""
        problem, k = self.problem, force.size
        moved = problem.summed((comp + self.lam * slack) / self.s)
        right = np.concatenate([-force - problem.forces @ (self.soft * moved), -(moved / self.D)[self.stiff]])
        x = self.right * dgetrs(self.factor, self.pivots, self.left * right)[0]
        for _ in range(_REFINEMENTS):
            x += self.right * dgetrs(self.factor, self.pivots, self.left * (right - self.matrix @ x))[0]
        s = self._slacks(x[:k], x[k:], slack, comp)
        return x[:k], s, (comp - self.lam * s) / self.s

    def _slacks(self, y: Vector, forces: Vector, slack: Vector, comp: Vector) -> Vector:
        """The changes of s (q,), those of stiff tractions by their forces."""
        problem, stiff, D = self.problem, self.stiff, self.D[self.stiff]
        s = -slack - problem.change(y, self.slope)
        net = forces - problem.summed(comp / self.s)[stiff]
        count = int(stiff.searchsorted(problem.count))
        s[stiff[:count]] = -net[:count] / D[:count]  # of the one bound of a normal traction
        if count == stiff.size:
            return s
        free, coulomb = -slack, problem.coulomb  # g
        pressed = problem.pressed[coulomb]
        free[coulomb] += problem.friction[coulomb] * (s + slack)[pressed]
        if problem.split.size:
            free += problem.friction_of(self.slope * problem.split_change(y))
        bounds, n = problem.slots[stiff[count:]], problem.slots.shape[1]
        there = bounds >= 0
        g, ratio = free[bounds], np.where(there, (self.lam / self.s)[bounds], 0.0)
        pairs = g[:, :, None] - _SAME_SIDE[:n, :n] * g[:, None, :]  # exactly zero for a bound with itself
        resisted = np.add.reduce(pairs * ratio[:, None, :], axis=2) - net[count:, None] * _SIDES[:n]
        s[bounds[there]] = (resisted / D[count:, None])[there]
        return s
