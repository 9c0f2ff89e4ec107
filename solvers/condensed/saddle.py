"""Newton steps of `interior_point` without the elimination of stiff bounds, for the last digits.

Eliminating λ adds W λ/s times the square of a row to S. Once s is tiny that swamps S in all directions in which several
rows act together, and the multipliers lose what the gap gains. Here bounds with W λ/s |B|² > 1 keep their multiplier:

    [S + BᵀW diag(λ/s) C over the others   B_AᵀW_A   ] (dy  )   (−force − BᵀW (target + λ r)/s over the others)
    [C_A                                   −diag(s/λ)] (dλ_A) = (−target/λ − r                                )

with r the residual of the slacks. The matrix is larger, so this is for when the smaller one has done what it can.
"""

from dataclasses import dataclass

import numpy as np
from numpy.linalg import LinAlgError
from scipy.linalg.lapack import dgetrf, dgetrs

from solvers.basics.types import BoolVector, IntVector, Matrix, Vector
from solvers.condensed.complementarity import Complementarity
from solvers.inequality.blocks import Rows

_REFINEMENTS = 2


@dataclass(frozen=True, eq=False)
class Saddle:
    """The factorised matrix for slacks s, multipliers λ, rows C and stiff bounds A."""

    problem: Complementarity
    s: Vector
    lam: Vector
    rows: Rows
    stiff: BoolVector
    matrix: Matrix
    left: Vector  # scale of equations
    right: Vector  # scale of unknowns
    factor: Matrix
    pivots: IntVector

    @classmethod
    def at(cls, problem: Complementarity, s: Vector, lam: Vector, rows: Rows) -> "Saddle":
        """Assemble and factorise."""
        k = problem.S.shape[0]
        B, C = _dense(problem.B), _dense(rows)
        size = np.einsum("ij,ij->i", B, B)
        stiff = problem.weights * lam * size > s
        H = np.array(problem.S)
        problem.add_stiffness(H, np.where(stiff, 0.0, lam / s), rows)
        matrix = np.zeros((k + int(stiff.sum()),) * 2)
        matrix[:k, :k] = H
        matrix[:k, k:] = (problem.weights[stiff, None] * B[stiff]).T
        matrix[k:, :k] = C[stiff]
        matrix[k:, k:] = -np.diag(s[stiff] / lam[stiff])
        left = 1.0 / np.abs(matrix).max(axis=1, initial=np.finfo(float).tiny)
        right = 1.0 / np.abs(left[:, None] * matrix).max(axis=0, initial=np.finfo(float).tiny)
        factor, pivots, info = dgetrf(left[:, None] * matrix * right)
        if info > 0 or not np.isfinite(factor).all():
            raise LinAlgError("it is singular")
        return cls(problem, s, lam, rows, stiff, matrix, left, right, factor, pivots)

    def solve(self, force: Vector, slack: Vector, comp: Vector) -> tuple[Vector, Vector, Vector]:
        """(dy, ds, dλ) for residuals of y and of the slacks, and the wanted change of s λ."""
        k = len(force)
        others = np.where(self.stiff, 0.0, (comp + self.lam * slack) / self.s)
        top = -force - self.problem.force(others)
        right = np.concatenate([top, (-comp / self.lam - slack)[self.stiff]])
        x = np.zeros_like(right)
        for _ in range(1 + _REFINEMENTS):
            x = x + self.right * dgetrs(self.factor, self.pivots, self.left * (right - self.matrix @ x))[0]
        y = x[:k]
        s = -slack - self.rows @ y
        lam = (comp - self.lam * s) / self.s
        lam[self.stiff] = x[k:]
        return y, s, lam


def _dense(rows: Rows) -> Matrix:
    return rows if isinstance(rows, np.ndarray) else np.asarray(rows.toarray())
