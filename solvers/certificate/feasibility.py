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
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csc_array, diags_array, eye_array, hstack

from solvers.basics.progress import deadline
from solvers.basics.types import BoolVector, IntVector, Sparse, Vector
from solvers.inequality.problem import FrictionQVI
from solvers.inequality.rows import by_columns, largest
from solvers.inner.linear_program import BackendFailure, attempt, real_vector, solved
from solvers.inner.qp import clarabel_solver

_EXCLUDED_SIZE = 1e4
"""A proof must exclude every z up to this multiple of the sizes that `is_farkas` names."""

_LEAST_VIOLATION = 1e-9
"""Violation of dependent equations, or of rows of G at n = 0, over the largest right-hand side, that is no rounding."""

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
    has max |z_i| D_i ≥ d / Σ |Gᵀy + Aᵀν|_i / D_i, D² the diagonal of K. The proof counts if that exceeds
    `_EXCLUDED_SIZE` times the same size of the bonded solution, and times the size at which single terms of the sum
    reach those of d.
    """
    if not (np.isfinite(y).all() and np.isfinite(nu).all()) or y.min(initial=0.0) < 0:
        return False
    rows, D, sizes = AdmissibleRows.of(qvi), np.sqrt(qvi.stiffness.positive_diagonal), np.abs(nu)
    deficit = -float(rows.h @ y + qvi.b @ nu)
    rest = float((np.abs(rows.G.T @ y + qvi.A.T @ nu) / D).sum())
    terms = float(((abs(rows.G).T @ y + abs(qvi.A).T @ sizes) / D).sum())
    bonded, right = largest(D * qvi.bonded), float(np.abs(rows.h) @ y + np.abs(qvi.b) @ sizes)
    is_clear = deficit * terms >= _EXCLUDED_SIZE * right * rest
    return deficit > 0 and deficit >= _EXCLUDED_SIZE * bonded * rest and is_clear


def check_feasibility(qvi: FrictionQVI) -> Feasibility:
    """Whether the load can be carried: by `refuted`, else by Clarabel, whose claims `is_farkas` checks.

    If the rows σ_N ≤ 0 alone cannot be met, the proof has no multipliers on friction, which is then not the reason.
    """
    rows = AdmissibleRows.of(qvi)
    if not qvi.n:  # C is empty if a row 0 ≤ h or 0 = b fails, and the multiplier ±1 of that row proves it
        right = np.concatenate([rows.h, qvi.b])
        violation = np.concatenate([-rows.h / (largest(rows.h) or 1.0), (qvi.b != 0.0).astype(float)])
        if violation.max(initial=0.0) > _LEAST_VIOLATION:
            worst = int(np.argmax(violation))
            multipliers = -np.sign(right[worst]) * np.eye(1, right.size, worst)[0]
            text = "the stress is statically determinate and violates the equations or the contact law"
            return Feasibility(False, None, (multipliers[: rows.h.size], multipliers[rows.h.size :]), text)
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


class _Scaled(NamedTuple):
    """G x ≤ h, A x = b of chosen rows, in units in which entries of [G; A] and h are at most 1, as back ends expect."""

    G: Sparse
    h: Vector
    A: Sparse
    b: Vector
    unit: Vector  # (n,), z = unit · x
    equations: Vector  # (p,), ν for multipliers y of G z ≤ h is `equations` times that of A x = b

    @classmethod
    def of(cls, qvi: FrictionQVI, G: Sparse, h: Vector) -> _Scaled:
        """The chosen rows G z ≤ h and the equations of a problem."""
        D, stress = 1.0 / np.sqrt(qvi.stiffness.positive_diagonal), largest(h) or 1.0
        G, A = csc_array(G @ diags_array(D)), csc_array(qvi.A @ diags_array(D))
        size = largest(G.data) or 1.0
        sizes = np.asarray(abs(A).max(axis=1).toarray()).ravel() if A.nnz else np.ones(qvi.p)
        sizes[sizes == 0.0] = 1.0
        unit = stress / size * D
        A = csc_array(diags_array(1.0 / sizes) @ A)
        return cls(csc_array(G / size), h / stress, A, qvi.b * size / (stress * sizes), unit, size / sizes)


def _farkas(qvi: FrictionQVI, rows: AdmissibleRows, chosen: BoolVector) -> tuple[Vector, Vector] | None:
    """Multipliers (y, ν) of the least violation t, if they prove that no z with A z = b meets the chosen rows."""
    G, h, A, b, _, of_equations = _Scaled.of(qvi, rows.G[chosen], rows.h[chosen])
    if qvi.p:  # equations that contradict each other: the residual of least squares has no component in A
        gram = (A @ A.T).toarray()
        residual = gram @ np.linalg.lstsq(gram, b, rcond=None)[0] - b
        refutes = (gram.diagonal() == 0.0) & (b != 0.0)  # 0 = b_i, whatever its size
        residual[~(refutes if refutes.any() else np.abs(residual) > _LEAST_VIOLATION * largest(b))] = 0.0
        proof = np.zeros(rows.h.size), of_equations * residual
        if is_farkas(qvi, *proof):
            return proof
    if not h.size:
        return None
    equations = {"A_eq": csc_array(hstack([A, csc_array((qvi.p, 1))])), "b_eq": b} if qvi.p else {}
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
    nu = -answer.equations * of_equations if qvi.p else np.zeros(0)
    return (y, nu) if is_farkas(qvi, y, nu) else None


def _nearest(qvi: FrictionQVI, rows: AdmissibleRows, chosen: BoolVector | slice = slice(None)) -> Feasibility:
    """The point of A z = b and the chosen rows that is nearest to the bonded state, by Clarabel."""
    program = _Scaled.of(qvi, rows.G[chosen], rows.h[chosen])
    options = {"tol_infeas_abs": 1e-11, "tol_infeas_rel": 1e-11, "time_limit": deadline.left}

    def solve() -> tuple[str, Vector, Vector]:
        P, q = csc_array(eye_array(qvi.n)), -qvi.bonded / program.unit
        answer = clarabel_solver(P, q, program.A, program.b, program.G, program.h, options).solve()
        return str(answer.status), real_vector("x", answer.x, qvi.n), real_vector("z", answer.z, qvi.p + program.h.size)

    outcome = attempt("feasibility check failed", solve)
    if isinstance(outcome, BackendFailure):
        return Feasibility(None, None, None, str(outcome))
    word, x, multipliers = outcome
    y, nu = np.zeros(rows.h.size), multipliers[: qvi.p] * program.equations
    y[chosen] = np.maximum(multipliers[qvi.p :], 0.0)
    if "PrimalInfeasible" in word and is_farkas(qvi, y, nu):
        return Feasibility(False, None, (y, nu), _PROVED)
    if word in ("Solved", "AlmostSolved") and np.isfinite(x).all():
        return Feasibility(True, program.unit * x, None, "the load can be carried by some admissible traction")
    return Feasibility(None, None, None, f"whether the load can be carried was not decided ({word})")
