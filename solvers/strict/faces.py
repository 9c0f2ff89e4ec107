"""Edges whose bound is zero at an end: there the law is linear.

Of a quadratic that is zero at one end, c₀ = 0 or c₂ = 0, (D16) leaves c_j ≥ 0, so that |σ_T| ≤ θ on such an edge is

    |τ_j| ≤ θ_j,  j = 0, 1, 2,     with τ_j = 0 where θ_j = 0.

As a second-order cone this has no interior, and as neighbouring edges share σ_T at nodes, τ_j = 0 is said twice there:
multipliers of the two may grow without bound if only their sum is right. Interior point methods then follow them until
nothing but rounding is left. So coefficients that are held at zero are equations, each that follows from others left
out, and the other coefficients of such an edge have bounds of their own.

In `docs/theory.md`: (D16).
"""

from functools import cached_property

import numpy as np
from scipy.sparse import csc_array

from solvers.basics.types import BoolVector, IntVector, Matrix, Sparse, Vector
from solvers.inequality.rows import spanning_rows
from solvers.strict.cones import ConeProblem

_CLOSED = 1e-10  # of the largest bound: a coefficient that is none, as in `certificate.strict`
_CONTRADICTION = 1e-9  # of the largest shear or bound
_NOTHING = 1e-10  # of the longest row of T: a row that is rounding


def closed_coefficients(theta: Matrix, size: float) -> BoolVector:
    """Which Bernstein coefficients (e, 3) of the bound hold those of σ_T at zero; `size` is that of tractions."""
    none = _CLOSED * min(size, float(np.abs(theta).max(initial=0.0)))
    small = np.abs(theta) <= none
    ends = small[:, [0, 2]].any(axis=1) & (theta[:, 1] >= -none)
    return np.asarray(small & ends[:, None])


class Faces:
    """Equations and linear bounds on the edges of which some coefficients are held.

    Attributes
    ----------
    closed : (e, 3)
        What is held, `closed_coefficients`.
    curved : (c,)
        Numbers of the edges whose bound is positive at both ends: they keep their cones.

    """

    def __init__(self, cones: ConeProblem, closed: BoolVector) -> None:
        self._rows = cones.bernstein_rows.tocsr()
        self.closed = closed
        self._linear = np.asarray(closed.any(axis=1))
        self.curved: IntVector = np.flatnonzero(~self._linear)

    @property
    def _free(self) -> BoolVector:
        """Coefficients with bounds of their own (e, 3)."""
        return np.asarray(self._linear[:, None] & ~self.closed)

    @cached_property
    def _equations(self) -> tuple[Matrix, IntVector]:
        """E and the numbers of r closed rows that are independent: T_closed = E T_chosen.

        Rows that are zero but for rounding count as zero.
        """
        rows = csc_array(self._rows[self.closed.ravel()])
        lengths = np.sqrt(np.asarray(rows.multiply(rows).sum(axis=1)).ravel())
        felt = np.flatnonzero(
            lengths > _NOTHING * np.sqrt(self._rows.multiply(self._rows).sum(axis=1).max(initial=0.0))
        )
        E = np.zeros((len(lengths), 0))
        if not len(felt):
            return E, felt
        found, chosen = spanning_rows(csc_array(rows.tocsr()[felt]))
        E = np.zeros((len(lengths), len(chosen)))
        E[felt] = found
        return E, felt[chosen]

    @property
    def equations(self) -> Sparse:
        """Rows (r, n) whose σ_T is zero."""
        return csc_array(self._rows[np.flatnonzero(self.closed)[self._equations[1]]])

    @property
    def bounded(self) -> Sparse:
        """Rows (f, n) of the coefficients with bounds of their own."""
        return csc_array(self._rows[self._free.ravel()])

    def contradicted(self, theta: Matrix, shear: Matrix) -> bool:
        """Whether the equations contradict one another, or a σ_T that no unknown changes."""
        scale = max(np.abs(theta).max(initial=0.0), np.abs(shear).max(initial=0.0))
        left = self._equations[0] @ self.values(shear) + shear[self.closed]
        return bool(np.abs(left).max(initial=0.0) > _CONTRADICTION * scale)

    def values(self, shear: Matrix) -> Vector:
        """What the equations ask for (r,), σ_T being (e, 3) at the centre."""
        return np.asarray(-shear[self.closed][self._equations[1]])

    def limits(self, theta: Matrix, shear: Matrix) -> Vector:
        """Upper bounds (2f,) of the bounded rows and of their negatives."""
        return np.concatenate([(theta - shear)[self._free], (theta + shear)[self._free]])

    def functionals(self, equations: Vector, limits: Vector, cones: Matrix) -> Matrix:
        """ℓ (e, 3) from multipliers of equations (r,) and limits (2f,), and ℓ (c, 3) on curved edges."""
        found = np.zeros(self.closed.shape)
        found[self.curved] = cones
        found[self._free] = np.subtract(*np.split(limits, 2))
        held = np.zeros(int(self.closed.sum()))
        held[self._equations[1]] = equations
        found[self.closed] = held
        return found
