"""What the interior point method needs of linear algebra, and the dense way: S on the free trace coordinates by LU.

The other way, sparse in all unknowns, is in `coordinates`. For the last digits there is `Saddle`.

In `docs/theory.md`: (D6).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.linalg import LinAlgError
from scipy.linalg.lapack import dgetrf, dgetrs, dpotrf, dpotrs

from solvers.basics.types import Matrix, Vector
from solvers.factorisation.base import State

if TYPE_CHECKING:
    from solvers.condensed.complementarity import Complementarity


class PathWeights(NamedTuple):
    """s λ of friction bounds and caps over s λ of normal bounds on a central path, and where it begins."""

    early: float  # until slacks fit their tractions
    late: float  # from there on
    start: float = 0.1  # the least multiplier at the start, of the scale of displacement


FRICTION_SHARES = (PathWeights(30.0, 1000.0), PathWeights(100.0, 100.0), PathWeights(1e4, 1e4), PathWeights(10.0, 10.0))
"""Tried one after the other if need be: with 1 to the end the path often turns back where contact opens and friction is
large, and with 1000 from the start where rows are dense."""

FITTING_SHARES = PathWeights(1.0, 30.0)
"""Tried next where slacks do not fit their tractions: close to a sliding limit those of walls fit with these alone."""

MANY_POINTS_SHARES = (FITTING_SHARES, PathWeights(30.0, 1000.0), PathWeights(1e4, 1e4), PathWeights(10.0, 10.0))
"""The same where points are thousands: pressures are rounded off as much as friction at first, and beds open and slip
without a step that is short."""

NEAR_BONDED_SHARES = FITTING_SHARES._replace(start=0.002)
"""A start nearer to the bonded solution. From larger multipliers the pressure of large walls gathers at first in the
last cells of the lowest bed, where steps become short; small problems take more iterations from here."""

MANY_POINTS_PATIENCE = 15  # close to the limit the gap hovers for a while and goes on
MANY_POINTS_STRAGGLERS = 0.02

Solve: TypeAlias = Callable[[Vector], Vector]
"""From a force (k,) to coordinates (k,)."""


@dataclass(eq=False)
class Expansion:
    """A point about which a problem is posed."""

    z: Vector  # (n,)
    c: Vector  # (k,) gradient in coordinates
    equality: Vector  # (p,) b − A z
    normal: Vector  # (m,) tractions at z
    tangential: Vector
    reduced: Vector  # the gradient by the unknowns that are kept, Γ or all
    strain_energy: float  # at z
    energy: float  # that of (D2) at y = 0, z with its interior in equilibrium
    state: State  # of the elimination, what `Factorisation.expand` takes
    held: Vector  # multipliers of equations that are coordinates


class DenseSystem:
    """The matrices of Newton's method for S (k, k) dense; `many`: whether contact points are many.

    Attributes
    ----------
    patience : iterations without progress after which the central path is followed
    stragglers : share of slacks and multipliers that may not hold up all the others
    longest : step that is taken at most, of the way to the nearest bound
    small : share of a contact that belongs to one bound, below which the gap has to be smaller
    last_digits : whether forces have digits left where the gap is at its floor: iterations go on for them, and `Saddle`
        can take its place
    orientation : sign of the determinant of the matrix factorised last; 0 where it is not known

    """

    longest = 0.99  # beyond, forces lose digits on graded meshes
    small = 2e-3
    last_digits = True

    def __init__(self, S: Matrix, *, many: bool = False) -> None:
        self._S = S
        self.patience, self.stragglers = (MANY_POINTS_PATIENCE, MANY_POINTS_STRAGGLERS) if many else (6, 0.0)
        self.orientation = 1

    def norm(self, force: Vector) -> float:
        """√(fᵀ S⁻¹ f) of a force (k,): how far it moves the body; 0 where S is no longer definite to rounding."""
        if self._cholesky is None or not len(force):
            return 0.0
        return float(np.sqrt(abs(force @ dpotrs(self._cholesky, force, lower=1)[0])))

    def factorised(self, problem: Complementarity, ratio: Vector, slope: Vector) -> Solve:
        """The inverse of S + BᵀW diag(ratio) C, see `Complementarity.blocks`; `LinAlgError` if it is singular.

        Scaled to a diagonal of 1.
        """
        if not len(self._S):
            return lambda force: force
        H = self._S + problem.stiffness(*problem.blocks(ratio, slope))
        scale = 1.0 / np.sqrt(np.maximum(H.diagonal(), 1.0))
        H *= scale
        factor, pivots, info = dgetrf(np.multiply(H, scale[:, None], order="F"), overwrite_a=1)
        if info > 0 or not np.isfinite(factor).all():
            raise LinAlgError("it is singular")
        swaps, negative = pivots != np.arange(len(pivots)), factor.diagonal() < 0.0
        self.orientation = -1 if (np.count_nonzero(swaps) + np.count_nonzero(negative)) % 2 else 1
        return lambda force: np.asarray(scale * dgetrs(factor, pivots, scale * force)[0])

    @cached_property
    def _cholesky(self) -> Matrix | None:
        factor, info = dpotrf(self._S, lower=1, clean=0) if len(self._S) else (None, 1)
        return None if info else factor


# Newton steps of `interior_point` without the elimination of stiff bounds, for the last digits.
#
# Eliminating λ adds W λ/s times the square of a row to S. Once s is tiny that swamps S in all directions in which
# several rows act together, and the multipliers lose what the gap gains. Here tractions t = T y with W D |T|² > 1 keep
# the force f = Σ ± dλ of their bounds as an unknown, D = Σ λ/s over the bounds of the traction, ± their side:
#
#     [S + BᵀW diag(λ/s) C over the others   TᵀW  ] (dy)   (−force − BᵀW (target + λ r)/s over the others)
#     [Σ ± λ/s C / D                         −1/D ] (f )  = (−Σ ± (target + λ r)/s / D                   )
#
# with r the residual of the slacks. One row a traction, not one a bound: an open point has three bounds on two
# tractions. The matrix is larger, so this is for when the smaller one has done what it can.
#
# Slacks that are tiny change by what forces say, not by differences of the much larger tractions. With a = target/s and
# g = −r + the change of the friction bound, ds_j = g_j − ±_j dt and f = Σ ±_i (a_i − λ_i/s_i ds_i) give
#
#     ds_j = (Σ_i λ_i/s_i (g_j − ±_i ±_j g_i) − ±_j (f − Σ ±_i a_i)) / D,
#
# in which the two bounds on either side of a point that opens, s₊ + s₋ = 2 mu p, keep their sum.


SLOTS: Final = (1.0, -1.0, 1.0, -1.0)
"""Sign of each bound of a traction: friction above and below, or pressure; cap above and below."""

_SIDES = np.array(SLOTS)
_SAME_SIDE = np.outer(_SIDES, _SIDES)
_REFINEMENTS = 2
_STIFFEST = 1e15  # W D |T|² as it is factorised: of dependent rows no pivot vanishes; refinement knows the true one


class Saddle:
    """The factorised matrix for slacks s, multipliers λ and the slope of |σ_N| at bilateral points; stiff tractions."""

    def __init__(self, problem: Complementarity, s: Vector, lam: Vector, slope: Vector) -> None:
        self.problem, self.s, self.lam, self.slope = problem, s, lam, slope
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
        self.stiff, self.D, self.soft = stiff, D, soft  # D of all tractions; soft: W, 0 of those that are stiff
        self.matrix, self.left, self.right = matrix, left, right  # with the scales of equations and of unknowns
        self.factor, self.pivots = factor, pivots

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
