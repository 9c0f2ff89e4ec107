"""Is there a solution at all? All states of a small contact gone through by a mixed-integer program.

Each point is open, sticks, or slips one way or the other. Which it is are binary unknowns; everything else is linear,

    σ = σ_bonded − C m,   σ_N ≤ 0 ≤ m_N,   |σ_T| ≤ cohesion + mu |σ_N|,   one of each pair zero,

and HiGHS finds a state within bounds, or proves within them, and within its tolerances, that there is none. The bounds
are `_BIG` times the bonded tractions and what they would move: no proof for the problem itself, but a reason. Contacts
with caps or bilateral points with friction, and large ones, are left out.
"""

from typing import Final

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp

from qvi_contact.basics.checks import FloatArray
from solvers import FrictionQVI
from solvers.inequality.problem import Compliance

EXISTS, NONE, UNDECIDED = "a solution exists", "no solution", "undecided"
_BIG: Final = 1e3
_POINTS: Final = 40
_FOUND, _EMPTY = 0, 2  # status numbers of scipy.optimize.milp


def enumerated(qvi: FrictionQVI, seconds: float) -> str:
    """One of the three words of this module."""
    suits = not (qvi.bilateral & (qvi.mu > 0.0)).any() and not np.isfinite(qvi.cap).any()
    if not suits or not 0 < qvi.m <= _POINTS:
        return UNDECIDED
    m, compliance = qvi.m, Compliance(qvi)
    stress = float(np.abs(compliance.bonded).max()) or 1.0
    weights = np.concatenate([qvi.W, qvi.W]) / (qvi.contact_stiffness or 1.0)
    C, bonded = compliance.dense * weights, compliance.bonded / stress
    move = np.hstack([C[:, :m], C[:, m:], -C[:, m:]])  # by gaps, forward and backward slips
    normal, shear = (bonded[:m], -move[:m]), (bonded[m:], -move[m:])
    bound = (qvi.cohesion / stress - qvi.mu * normal[0], -qvi.mu[:, None] * normal[1])
    answer = milp(
        np.zeros(6 * m),
        integrality=np.repeat([0, 1], 3 * m),
        bounds=Bounds(0.0, np.repeat([_BIG, 1.0], 3 * m)),
        constraints=_constraints(m, normal, shear, bound, _BIG * (1.0 + float(qvi.mu.max()))),
        options={"time_limit": seconds},
    )
    return {_FOUND: EXISTS, _EMPTY: NONE}.get(answer.status, UNDECIDED)


_Affine = tuple[FloatArray, FloatArray]


def _constraints(m: int, normal: _Affine, shear: _Affine, bound: _Affine, far: float) -> LinearConstraint:
    """In the unknowns gap, forward slip, backward slip, and the binary closed, forward, backward; (m,) each."""
    one, no = np.eye(m), np.zeros((m, m))
    none = np.zeros((m, 3 * m))
    up = (bound[0] - shear[0], bound[1] - shear[1])
    down = (bound[0] + shear[0], bound[1] + shear[1])
    rows: list[tuple[FloatArray, FloatArray, FloatArray]] = [  # a y + b binaries ≤ upper
        (normal[1], none, -normal[0]),
        (-normal[1], -_BIG * np.hstack([one, no, no]), normal[0]),
        (-up[1], none, up[0]),
        (-down[1], none, down[0]),
        (up[1], far * np.hstack([no, one, no]), far - up[0]),
        (down[1], far * np.hstack([no, no, one]), far - down[0]),
        (np.hstack([one, no, no]), _BIG * np.hstack([one, no, no]), np.full(m, _BIG)),
        (np.hstack([no, one, no]), -_BIG * np.hstack([no, one, no]), np.zeros(m)),
        (np.hstack([no, no, one]), -_BIG * np.hstack([no, no, one]), np.zeros(m)),
        (none, np.hstack([no, one, one]), np.ones(m)),
    ]
    left, binary, upper = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    return LinearConstraint(np.hstack([left, binary]), -np.inf, upper)
