"""Whether the load can be carried: a proof that the admissible set is empty, or a point of it.

Every solution of (D2) has σ_N ≤ 0 at unilateral points, hence mu |σ_N| = −mu σ_N there, and lies in the convex set

    C = { z : A z = b,  N z + n0 ≤ 0,  |T z + t0| ≤ cohesion − mu (N z + n0),  |T z + t0| ≤ cap }
      = { z : A z = b,  G z ≤ h }.

At bilateral points the first row is missing, and, if mu > 0, the second too, as it is not convex there. If C is empty,
the QVI has no solution. Its proof: multipliers (Farkas) y ≥ 0, ν with Gᵀy + Aᵀν = 0 and hᵀy + bᵀν < 0, which this
module checks on the data. They are the multipliers of a linear program, the least t ≥ 0 with A z = b and G z ≤ h + t,
if t > 0. Otherwise, or if the program is not solved, a quadratic program looks for the point of C with the least
Σ K_ii (z_i − (z_b)_i)², z_b the bonded state. On large meshes that takes a hundredth of the time of the point of least
energy. The fixed point can start from it: with its pressure s the inner problem is feasible.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csc_array, diags_array, hstack

from solvers.basics.progress import deadline
from solvers.basics.types import BoolVector, IntVector, Sparse, Vector
from solvers.inequality.problem import FrictionQVI
from solvers.inequality.rows import by_columns
from solvers.inner.linear_program import BackendFailure, attempt, real_vector, solved
from solvers.inner.qp import clarabel_solver

_EXCLUDED_SIZE = 1e4
"""A proof must exclude every z with max |z| up to this multiple of the bonded solution's max |z|."""

_LEAST_VIOLATION = 1e-9
"""Violation of a row, over the largest |h|, that makes a problem without unknowns infeasible."""

LARGEST = 4000
"""Rows of G up to which the linear program is solved; it takes 25 ms for 400 rows, and 2 s for this many."""

PROOF_SECONDS = 2.0
"""Time limit of a proof by which an iteration decides whether to go on; the largest programs need as long."""

_PROVED = "no admissible traction carries the load, proved by multipliers (Farkas) checked on the data"


@dataclass(frozen=True, eq=False)
class Feasibility:
    """Result of `check_feasibility`."""

    feasible: bool | None
    """True, False (proved), or None if undecided."""
    z: Vector | None
    """A point (n,) of C if feasible."""
    farkas: tuple[Vector, Vector] | None
    """The proof (y (rows of G,), ν (p,)) if infeasible."""
    message: str
    """One sentence."""


@dataclass(frozen=True, eq=False)
class AdmissibleRows:
    """G z ≤ h of the set C: rows of N, of ±T + mu N, and of ±T below the cap."""

    G: Sparse  # (rows, n)
    h: Vector
    point: IntVector  # (rows,) int, the contact point of each row
    tangential: BoolVector  # (rows,) bool, whether the row limits |σ_T| rather than σ_N

    @classmethod
    def of(cls, qvi: FrictionQVI) -> AdmissibleRows:
        """The rows of a QVI."""
        # Points of the rows: σ_N ≤ 0, then friction and cap above, then friction and cap below.
        normal = np.flatnonzero(~qvi.bilateral)
        convex = np.flatnonzero(~qvi.bilateral | (qvi.mu == 0.0))
        capped = np.flatnonzero(np.isfinite(qvi.cap))
        point = np.concatenate([normal, convex, capped, convex, capped])
        # H (rows, 2m): coefficients of σ_N and of σ_T at the point.
        ones, zeros, count = np.ones(len(convex) + len(capped)), np.zeros(len(capped)), len(normal)
        of_normal = np.concatenate([np.ones(count), qvi.mu[convex], zeros, qvi.mu[convex], zeros])
        of_shear = np.concatenate([np.zeros(count), ones, -ones])
        limit = np.concatenate([np.zeros(count), *2 * (qvi.cohesion[convex], qvi.cap[capped])])
        places = (np.tile(np.arange(len(point)), 2), np.concatenate([point, qvi.m + point]))
        H = by_columns(coo_array((np.concatenate([of_normal, of_shear]), places), shape=(len(point), 2 * qvi.m)))
        H.eliminate_zeros()
        G = csc_array(H @ qvi.contact_rows)
        h = limit - H @ np.concatenate([qvi.n0, qvi.t0])
        return cls(G, h, point, np.arange(len(point)) >= count)

    def shares(self, y: Vector, points: int) -> tuple[Vector, Vector]:
        """Multipliers y (rows,) summed at each of the contact points: (normal, tangential), (points,) each."""
        kinds = (~self.tangential, self.tangential)
        normal, tangential = (np.bincount(self.point[kind], y[kind], points).astype(np.float64) for kind in kinds)
        return normal, tangential


def is_farkas(qvi: FrictionQVI, y: Vector, nu: Vector) -> bool:
    """Whether (y, ν) proves that C is empty, despite rounding.

    For z in C: 0 ≤ yᵀ(h − G z) + νᵀ(b − A z) = (hᵀy + bᵀν) − (Gᵀy + Aᵀν)ᵀz, so with hᵀy + bᵀν = −d < 0 every point of C
    has max |z| ≥ d / Σ |Gᵀy + Aᵀν|. The proof counts if that exceeds `_EXCLUDED_SIZE` times the bonded solution.
    """
    if not (np.isfinite(y).all() and np.isfinite(nu).all()) or y.min(initial=0.0) < 0:
        return False
    rows = AdmissibleRows.of(qvi)
    deficit = -float(rows.h @ y + qvi.b @ nu)
    size = float(np.abs(qvi.bonded).max(initial=0.0)) or 1.0
    return deficit > 0 and deficit >= _EXCLUDED_SIZE * size * float(np.abs(rows.G.T @ y + qvi.A.T @ nu).sum())


def check_feasibility(qvi: FrictionQVI) -> Feasibility:
    """Whether the load can be carried: by `refuted`, else by Clarabel, whose claims `is_farkas` checks.

    If the rows σ_N ≤ 0 alone cannot be met, the proof has no multipliers on friction, which is then not the reason.
    """
    rows = AdmissibleRows.of(qvi)
    if not qvi.n:  # C is empty if a row 0 ≤ h fails, and the multiplier 1 of that row proves it
        failed = rows.h.min(initial=0.0) < -_LEAST_VIOLATION * float(np.abs(rows.h).max(initial=0.0))
        if failed:
            y = np.eye(1, rows.h.size, int(np.argmin(rows.h)))[0]
            text = "the stress is statically determinate and violates the contact law"
            return Feasibility(False, None, (y, np.zeros(0)), text)
        return Feasibility(True, np.zeros(0), None, "the load can be carried by the one admissible traction")
    proof = refuted(qvi)
    if proof is not None:
        return proof
    answer = _nearest(qvi, rows)
    if answer.feasible is False and rows.tangential.any():
        without_friction = _nearest(qvi, rows, ~rows.tangential)
        answer = without_friction if without_friction.feasible is False else answer
    return answer


def refuted(qvi: FrictionQVI, seconds: float | None = None) -> Feasibility | None:
    """A proof by a linear program that C is empty, by the rows σ_N ≤ 0 alone if they suffice.

    None if there is no proof within `seconds`, or for more than `LARGEST` rows, for which Clarabel is faster.
    """
    rows = AdmissibleRows.of(qvi)
    if rows.h.size > LARGEST:
        return None
    with deadline(seconds):
        proof = _farkas(qvi, rows, np.ones_like(rows.tangential))
    if proof is None:
        return None
    without_friction = _farkas(qvi, rows, ~rows.tangential) if rows.tangential.any() else None
    return Feasibility(False, None, without_friction or proof, _PROVED)


def _farkas(qvi: FrictionQVI, rows: AdmissibleRows, chosen: BoolVector) -> tuple[Vector, Vector] | None:
    """Multipliers (y, ν) of the least violation t, if they prove that no z with A z = b meets the chosen rows."""
    G, h = rows.G[chosen], rows.h[chosen]
    if not h.size:
        return None
    equations = {"A_eq": csc_array(hstack([qvi.A, csc_array((qvi.p, 1))])), "b_eq": qvi.b} if qvi.p else {}
    answer = solved(
        np.append(np.zeros(qvi.n), 1.0),
        A_ub=csc_array(hstack([G, csc_array(-np.ones((h.size, 1)))])),
        b_ub=h,
        bounds=[(None, None)] * qvi.n + [(0.0, None)],
        **equations,
    )
    if not answer.solved:
        return None
    y = np.zeros(rows.h.size)
    y[chosen] = np.maximum(-answer.inequalities, 0.0)
    nu = -answer.equations
    return (y, nu) if is_farkas(qvi, y, nu) else None


def _nearest(qvi: FrictionQVI, rows: AdmissibleRows, chosen: BoolVector | slice = slice(None)) -> Feasibility:
    """The point of A z = b and the chosen rows that is nearest to the bonded state, by Clarabel."""
    weights, G, h = qvi.stiffness.diagonal, csc_array(rows.G[chosen]), rows.h[chosen]
    options = {"tol_infeas_abs": 1e-11, "tol_infeas_rel": 1e-11, "time_limit": deadline.left}

    def solve() -> tuple[str, Vector, Vector]:
        answer = clarabel_solver(csc_array(diags_array(weights)), -weights * qvi.bonded, qvi, G, h, options).solve()
        return str(answer.status), real_vector("x", answer.x, qvi.n), real_vector("z", answer.z, qvi.p + h.size)

    outcome = attempt("feasibility check failed", solve)
    if isinstance(outcome, BackendFailure):
        return Feasibility(None, None, None, str(outcome))
    word, z, multipliers = outcome
    y, nu = np.zeros(rows.h.size), multipliers[: qvi.p]
    y[chosen] = np.maximum(multipliers[qvi.p :], 0.0)
    if "PrimalInfeasible" in word and is_farkas(qvi, y, nu):
        return Feasibility(False, None, (y, nu), _PROVED)
    if word in ("Solved", "AlmostSolved") and np.isfinite(z).all():
        return Feasibility(True, z, None, "the load can be carried by some admissible traction")
    return Feasibility(None, None, None, f"whether the load can be carried was not decided ({word})")
