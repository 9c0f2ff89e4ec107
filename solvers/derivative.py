"""How a solution changes with its data, without another solve of the inequality.

Along straight lines from the data to others, z and the multipliers are differentiable where every bound is either
inactive or relieves something. With the rows w = limit − H σ ≥ 0 and x ≥ 0 of `solvers.pivoting`, and the compliance C,

    dσ = dσ_f − C F dx,      w > 0: dx = 0,      x > 0: dw = 0,      else: dw ≥ 0, dx ≥ 0, dw dx = 0

where dσ_f is what tractions do with multipliers held. The last rows are points where the state changes: there the
derivatives from both sides differ, each of them a small linear complementarity problem.

In `docs/theory.md`: (D34).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import lstsq

from solvers.basics.types import BoolVector, Matrix, Vector
from solvers.errors import InputError
from solvers.inequality.problem import FrictionQVI
from solvers.inequality.rows import largest
from solvers.pivoting import solve_lcp
from solvers.solution import QVISolution

LARGEST: Final = 2000
"""Contact points up to which derivatives are computed: their matrices are dense."""

_ZERO: Final = 1e-6  # share of the largest traction, or displacement, below which a bound is met, or relieves nothing
_LEAST: Final = 1e-3  # of the unit of stress: the size of tractions of contacts without load
_RANK: Final = 1e-12  # singular values of rows below this share of the largest are none
_MET: Final = 1e-9  # of the right-hand side: residual of the dense system beyond which it is singular
_LEFT: Final = 1e-6  # of what the data change: residual beyond which a singular system has no solution


@dataclass(frozen=True, eq=False)
class Change:
    """What a unit step towards other data changes at first."""

    z: Vector  # (n,)
    normal: Vector  # (m,), row multipliers
    tangential: Vector
    equality: Vector  # (p,)
    changes_state: bool  # whether a point changes its state here, so that the other side has another derivative


def change(solution: QVISolution, base: FrictionQVI, moved: FrictionQVI, sign: float = 1.0) -> Change:
    """The one-sided derivative of a solution along data from `base` to `moved`, or from there back for sign −1.

    The solution's problem has the matrices of `base`; N, T, W and A of both are the same. `InputError` if there are
    more than `LARGEST` contact points, or no derivative was found.
    """
    qvi, z, m = solution.problem, solution.z, solution.problem.m
    if m > LARGEST:
        raise InputError("contact points", m, f"derivatives take at most {LARGEST}: take a coarser mesh")
    condensed, law = qvi.condensed_contact, qvi.law
    system, B = condensed.system, qvi.contact.rows
    force, b = -sign * (moved.gradient(z) - base.gradient(z)), sign * (moved.b - base.b)
    free = sign * (moved.tractions(z) - base.tractions(z)) + B @ system.solve(force, b)[0]  # dσ_f
    # Friction as it is for the pressure at hand: by_normal (m,) of its rows, and what its bound changes by itself.
    normal, shear = np.split(qvi.tractions(z), 2)
    pressure, stress = law.pressed(normal), max(_LEAST, largest(qvi.tractions(z)))
    with np.errstate(invalid="ignore"):  # of caps that are infinite
        mu, cohesion, cap = (sign * (getattr(moved, name) - getattr(base, name)) for name in ("mu", "cohesion", "cap"))
    capped = law.cap < law.cohesion + law.mu * pressure
    bound = law.threshold(pressure)
    slope = np.where(capped, 0.0, law.mu * np.where(law.bilateral & (normal > 0.0), -1.0, 1.0))
    limit = np.where(capped, cap, cohesion + mu * pressure)
    # Bounds that are met, and those of them that relieve something: σ_N ≤ 0, then σ_T on both sides.
    relief = np.stack([solution.normal_multiplier, solution.tangential_multiplier]) / qvi.W
    least, size = stress / (qvi.contact_stiffness or 1.0), float(np.abs(relief).max(initial=0.0))
    size = size if size > _ZERO * least else least
    opens = ~law.bilateral & (-normal <= _ZERO * stress)
    released = opens & (relief[0] > _ZERO * size)
    slips = np.abs(relief[1]) > _ZERO * size
    # where the bound is zero and stays so there is one equation, σ_T = 0
    held_at_zero = (bound <= _ZERO * stress) & (limit == 0.0) & ((slope == 0.0) | released)
    sides = np.array([[1.0], [-1.0]])
    single, own = held_at_zero & (sides > 0.0), slips & (sides * relief[1] > 0.0)
    met = (bound - sides * shear <= _ZERO * stress) & (own | ~slips)
    kind, point = np.vstack([opens, np.where(held_at_zero, single, met)]).nonzero()
    # Rows (r,): w = limit − (by_normal σ_N + side σ_T), relieved by x with a multiplier of this sign; strong: x > 0.
    along, side = kind > 0, np.array([0.0, 1.0, -1.0])[kind]
    by_normal, limit = np.where(along, slope[point], 1.0), np.where(along, limit[point], 0.0)
    relieving, strong = np.where(along, side, 1.0), np.vstack([released, own | single])[kind, point]
    H_C = by_normal[:, None] * condensed.compliance[point] + side[:, None] * condensed.compliance[m + point]
    columns = np.where(along, m + point, point)
    M = H_C[:, columns] * relieving
    q = limit - by_normal * free[point] - side * free[m + point]
    x = _relieved(M, q, strong)
    changed = max(_LEAST * stress, largest(limit), largest(free))  # a change this much smaller is rounding
    if largest((q + M @ x)[strong]) > _LEFT * changed:  # such as friction in free sliding
        remedy = "the parameter drives a motion that nothing determines: add a support, or give it another value"
        raise InputError("derivative", "none found", remedy)
    multipliers = np.zeros(2 * m)
    np.add.at(multipliers, columns, relieving * x)
    dz, nu = system.solve(force - B.T @ multipliers, b)
    return Change(dz, multipliers[:m], multipliers[m:], nu, not strong.all())


def _relieved(M: Matrix, q: Vector, strong: BoolVector) -> Vector:
    """What x (r,) changes by, of dw = q + M dx; see the module."""
    x, weak = np.zeros(len(q)), ~strong
    if not len(q):
        return x
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(M)), 1e-300 + 1e-12 * np.abs(np.diag(M)).max()))
    M, q = scale[:, None] * M * scale, scale * q
    right = np.column_stack([q[strong], M[np.ix_(strong, weak)]])
    solved = _solved(M[np.ix_(strong, strong)], right)
    if weak.any():
        across = M[np.ix_(weak, strong)]
        reduced, rest = M[np.ix_(weak, weak)] - across @ solved[:, 1:], q[weak] - across @ solved[:, 0]
        size = largest(rest) or 1.0
        vertex = solve_lcp(reduced, rest / size, np.ones(len(rest)))
        if not vertex.solved:
            why = "a point changes its state, or nothing determines where a body is"
            raise InputError("derivative", "none found", f"{why}: change the parameter slightly, or add a support")
        x[weak] = vertex.x * size
    x[strong] = -solved[:, 0] - solved[:, 1:] @ x[weak]
    return np.asarray(scale * x)


def _solved(A: Matrix, right: Matrix) -> Matrix:
    """The solution of a linear system, of least size where it is singular."""
    try:
        found = np.linalg.solve(A, right)
        if np.abs(A @ found - right).max(initial=0.0) <= _MET * np.abs(right).max(initial=0.0):
            return np.asarray(found)
    except np.linalg.LinAlgError:
        pass
    return np.asarray(lstsq(A, right, cond=_RANK)[0])
