"""One-sided derivatives of a solution by its data, without another solve of the inequality.

Along a straight line from the data to other data, z and the multipliers are differentiable if every bound is either
inactive, w > 0, or has a multiplier x > 0. With w = limit − H σ ≥ 0, x ≥ 0 and F of `solvers.pivoting`, the compliance
C, and dσ_f the change of the tractions at fixed multipliers,

    dσ = dσ_f − C F dx,      w > 0: dx = 0,      x > 0: dw = 0,      else: dw ≥ 0, dx ≥ 0, dw dx = 0

The last case are points that change their state. There the derivatives from the two sides differ, and each is the
solution of a small linear complementarity problem.

In `docs/theory.md`: (D34).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import lstsq

from solvers.basics.status import Status
from solvers.basics.types import BoolVector, Matrix, Vector
from solvers.errors import InputError
from solvers.inequality.problem import FrictionQVI
from solvers.inequality.rows import largest
from solvers.pivoting import solve_lcp
from solvers.solution import QVISolution

LARGEST: Final = 2000
"""Contact points up to which derivatives are computed: their matrices are dense."""

# w over the largest traction, and x over the largest displacement, that count as 0; of x also the traction that it
# relieves at its own point, as displacements of points with very different weights are not comparable
_ZERO: Final = 1e-6
_UNLOADED: Final = 1e-3  # least scale of stress, in its unit, for contacts without load
_RANK: Final = 1e-12  # singular values of rows below this share of the largest are zero
_SINGULAR: Final = 1e-9  # residual of the dense system, over its right-hand side, above which it is singular
_UNSOLVABLE: Final = 1e-6  # residual, over the change by the data, above which a singular system has no solution


@dataclass(frozen=True, eq=False)
class Change:
    """Derivatives of a solution, for a unit step from the data to other data."""

    z: Vector  # (n,)
    normal: Vector  # (m,), of the row multipliers m_N
    tangential: Vector  # (m,), of m_T
    equality: Vector  # (p,), of ν
    changes_state: bool  # whether a point changes its state here, so that the derivative from the other side differs


def change(solution: QVISolution, base: FrictionQVI, moved: FrictionQVI, sign: float = 1.0) -> Change:
    """The one-sided derivative of a solution along the data from `base` towards `moved`, for sign −1 away from it.

    The problem of the solution has the matrices of `base`, and `moved` has the same N, T, W and A. `InputError` if
    there are more than `LARGEST` contact points, or no derivative exists.
    """
    qvi, z, m = solution.problem, solution.z, solution.problem.m
    if m > LARGEST:
        raise InputError("contact points", m, f"derivatives take at most {LARGEST}: take a coarser mesh")
    condensed, law = qvi.condensed_contact, qvi.law
    system, B = condensed.system, qvi.contact.rows
    force, b = -sign * (moved.gradient(z) - base.gradient(z)), sign * (moved.b - base.b)
    fixed_change = sign * (moved.tractions(z) - base.tractions(z)) + B @ system.solve(force, b)[0]  # dσ_f
    # Friction bound at the computed pressure, its slope by σ_N, and `limit`, its change by the data at fixed σ_N.
    normal, shear = np.split(qvi.tractions(z), 2)
    pressure, stress = law.pressed(normal), max(_UNLOADED, largest(qvi.tractions(z)))
    with np.errstate(invalid="ignore"):  # infinite caps: inf − inf
        mu, cohesion, cap = (sign * (getattr(moved, name) - getattr(base, name)) for name in ("mu", "cohesion", "cap"))
    is_capped = law.cap <= law.cohesion + law.mu * pressure
    bound = law.threshold(pressure)
    slope = np.where(is_capped, 0.0, law.mu * np.where(law.bilateral & (normal > 0.0), -1.0, 1.0))
    limit = np.where(is_capped, cap, cohesion + mu * pressure)
    # Bounds with w = 0, and those with x > 0: of σ_N, then of σ_T on both sides.
    multipliers = np.stack([solution.normal_multiplier, solution.tangential_multiplier])
    relief, own_traction = multipliers / qvi.W, multipliers * condensed.compliance.diagonal().reshape(2, m)
    least, size = stress / (qvi.contact_stiffness or 1.0), float(np.abs(relief).max(initial=0.0))
    size = size if size > _ZERO * least else least
    has_relief = (np.abs(relief) > _ZERO * size) | (np.abs(own_traction) > _ZERO * stress)
    is_unpressed = ~law.bilateral & (-normal <= _ZERO * stress)
    is_open = is_unpressed & has_relief[0] & (relief[0] > 0.0)
    is_slipping = has_relief[1]
    # A bound that is zero and stays zero is one equation, σ_T = 0.
    is_zero_bound = (bound <= _ZERO * stress) & (limit == 0.0) & ((slope == 0.0) | is_open)
    sides = np.array([[1.0], [-1.0]])
    is_equation, is_slip_side = is_zero_bound & (sides > 0.0), is_slipping & (sides * relief[1] > 0.0)
    is_at_bound = (bound - sides * shear <= _ZERO * stress) & (is_slip_side | ~is_slipping)
    kind, point = np.vstack([is_unpressed, np.where(is_zero_bound, is_equation, is_at_bound)]).nonzero()
    # Rows (r,): w = limit − (by_normal σ_N + side σ_T), x = multiplier_sign times the multiplier; is_active: x > 0.
    is_shear, side = kind > 0, np.array([0.0, 1.0, -1.0])[kind]
    by_normal, limit = np.where(is_shear, slope[point], 1.0), np.where(is_shear, limit[point], 0.0)
    multiplier_sign, is_active = (
        np.where(is_shear, side, 1.0), np.vstack([is_open, is_slip_side | is_equation])[kind, point],
    )  # fmt: skip
    H_C = by_normal[:, None] * condensed.compliance[point] + side[:, None] * condensed.compliance[m + point]
    columns = np.where(is_shear, m + point, point)
    M = H_C[:, columns] * multiplier_sign
    q = limit - by_normal * fixed_change[point] - side * fixed_change[m + point]
    x = _relieved(M, q, is_active)
    changed = max(_UNLOADED * stress, largest(limit), largest(fixed_change))  # a change this much smaller is rounding
    if largest((q + M @ x)[is_active]) > _UNSOLVABLE * changed:  # e.g. the friction of a body that slides freely
        remedy = "the parameter drives a motion that nothing determines: add a support, or give it another value"
        raise InputError("derivative", "none found", remedy)
    dm = np.zeros(2 * m)
    np.add.at(dm, columns, multiplier_sign * x)
    dz, nu = system.solve(force - B.T @ dm, b)
    return Change(dz, dm[:m], dm[m:], nu, not is_active.all())


def _relieved(M: Matrix, q: Vector, is_active: BoolVector) -> Vector:
    """The dx (r,) of the complementarity conditions above, with dw = q + M dx; in active rows dw = 0."""
    x, is_free = np.zeros(len(q)), ~is_active
    if not len(q):
        return x
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(M)), 1e-300 + 1e-12 * np.abs(np.diag(M)).max()))
    M, q = scale[:, None] * M * scale, scale * q
    right = np.column_stack([q[is_active], M[np.ix_(is_active, is_free)]])
    eliminated = _solved(M[np.ix_(is_active, is_active)], right)
    if is_free.any():
        # The active rows are eliminated from the others.
        coupling = M[np.ix_(is_free, is_active)]
        reduced_M = M[np.ix_(is_free, is_free)] - coupling @ eliminated[:, 1:]
        reduced_q = q[is_free] - coupling @ eliminated[:, 0]
        size = largest(reduced_q) or 1.0
        vertex = solve_lcp(reduced_M, reduced_q / size, np.ones(len(reduced_q)))
        if vertex.reason is not Status.SOLVED:
            why = "a point changes its state, or nothing determines where a body is"
            raise InputError("derivative", "none found", f"{why}: change the parameter slightly, or add a support")
        x[is_free] = vertex.x * size
    x[is_active] = -eliminated[:, 0] - eliminated[:, 1:] @ x[is_free]
    return np.asarray(scale * x)


def _solved(A: Matrix, right: Matrix) -> Matrix:
    """The solution of a linear system, the one of least size if it is singular."""
    try:
        x = np.linalg.solve(A, right)
        if np.abs(A @ x - right).max(initial=0.0) <= _SINGULAR * np.abs(right).max(initial=0.0):
            return np.asarray(x)
    except np.linalg.LinAlgError:
        pass
    return np.asarray(lstsq(A, right, cond=_RANK)[0])
