"""Can the load be carried at all? Emptiness of the admissible set, with a proof.

Every solution of (D2) has σ_N ≤ 0 at unilateral points, hence mu |σ_N| = −mu σ_N there, and lies in the convex set

    C = { z : A z = b,  N z + n0 ≤ 0,  |T z + t0| ≤ cohesion − mu (N z + n0),  |T z + t0| ≤ cap }
      = { z : A z = b,  G z ≤ h }.

At bilateral points the first row is missing, and where mu > 0 the second, not convex there. If C is empty the QVI
has no solution, proved by multipliers (Farkas) y ≥ 0, ν with Gᵀy + Aᵀν = 0 and hᵀy + bᵀν < 0, which are checked here on
the data. If it is not, its point of least energy is a start: its pressure s makes the inner problem feasible. It is
a start only, never the answer: minimising over C is associated friction, which dilates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csc_array, triu, vstack

from solvers.basics.types import BoolVector, IntVector, Sparse, Vector, load
from solvers.basics.watch import left
from solvers.inequality.blocks import by_columns
from solvers.inequality.problem import FrictionQVI
from solvers.inner.guard import BackendFailure, attempt

_REACH = 1e4
"""The proof must exclude every z up to this many times the size of the bonded solution (and of 1)."""

_DETERMINATE = 1e-9
"""Violation, relative to the largest traction, that counts as one where nothing is unknown."""


@dataclass(frozen=True, eq=False)
class Feasibility:
    """Result of `check_feasibility`.

    Attributes
    ----------
    feasible : True, False (proved), or None if undecided
    z : (n,) point of least energy in C if feasible
    farkas : (y (rows of G,), ν (p,)) if infeasible
    message : one sentence

    """

    feasible: bool | None
    z: Vector | None
    farkas: tuple[Vector, Vector] | None
    message: str


@dataclass(frozen=True, eq=False)
class AdmissibleRows:
    """G z ≤ h of the set C: rows of N, of ±T + mu N, and of ±T below the cap.

    Attributes
    ----------
    H : (rows, 2m) sparse, G = H [N; T]: what the rows say of the tractions
    limit : (rows,), h = limit − H [n0; t0]
    G, h : (rows, n) and (rows,)
    point : (rows,) int, the contact point of each row
    tangential : (rows,) bool, whether the row limits |σ_T| rather than σ_N

    """

    H: Sparse
    limit: Vector
    G: Sparse
    h: Vector
    point: IntVector
    tangential: BoolVector

    @classmethod
    def of(cls, qvi: FrictionQVI) -> AdmissibleRows:
        """Rows of a QVI."""
        normal = np.flatnonzero(~qvi.bilateral)
        law = np.flatnonzero(~qvi.bilateral | (qvi.mu == 0.0))
        capped = np.flatnonzero(np.isfinite(qvi.cap))
        point = np.concatenate([normal, law, capped, law, capped])
        ones, none, count = np.ones(len(law) + len(capped)), np.zeros(len(capped)), len(normal)
        of_normal = np.concatenate([np.ones(count), qvi.mu[law], none, qvi.mu[law], none])
        of_shear = np.concatenate([np.zeros(count), ones, -ones])
        limit = np.concatenate([np.zeros(count), *2 * (qvi.cohesion[law], qvi.cap[capped])])
        places = (np.tile(np.arange(len(point)), 2), np.concatenate([point, qvi.m + point]))
        H = by_columns(coo_array((np.concatenate([of_normal, of_shear]), places), shape=(len(point), 2 * qvi.m)))
        H.eliminate_zeros()
        G = csc_array(H @ qvi.contact_rows)
        h = limit - H @ np.concatenate([qvi.n0, qvi.t0])
        return cls(H, limit, G, h, point, np.arange(len(point)) >= count)

    def shares(self, y: Vector, points: int) -> tuple[Vector, Vector]:
        """Multipliers y (rows,) summed at each of the contact points: (normal, tangential), (points,) each."""
        normal, tangential = (
            np.bincount(self.point[kind], weights=y[kind], minlength=points)
            for kind in (~self.tangential, self.tangential)
        )
        return np.asarray(normal, dtype=float), np.asarray(tangential, dtype=float)


def is_farkas(qvi: FrictionQVI, y: Vector, nu: Vector) -> bool:
    """Whether (y, ν) proves that C is empty, rounding included.

    For z in C: 0 ≤ yᵀ(h − G z) + νᵀ(b − A z) = (hᵀy + bᵀν) − (Gᵀy + Aᵀν)ᵀz, so with hᵀy + bᵀν = −d < 0 every
    point of C has max |z| ≥ d / Σ |Gᵀy + Aᵀν|. The proof counts if that is `_REACH` times the data's size.
    """
    if not (np.isfinite(y).all() and np.isfinite(nu).all()) or y.min(initial=0.0) < 0:
        return False
    rows = AdmissibleRows.of(qvi)
    G, h = rows.G, rows.h
    deficit = -float(h @ y + qvi.b @ nu)
    size = float(np.abs(qvi.bonded).max(initial=0.0)) or 1.0
    return deficit > 0 and deficit >= _REACH * size * float(np.abs(G.T @ y + qvi.A.T @ nu).sum())


def check_feasibility(qvi: FrictionQVI) -> Feasibility:
    """Minimise the energy over C with Clarabel; a claim of emptiness counts only if `is_farkas` agrees.

    Where σ_N ≤ 0 alone cannot be met the proof has no multipliers on friction: then it is not friction that fails.
    """
    rows = AdmissibleRows.of(qvi)
    found = _minimise(qvi, rows) if qvi.n else _determinate(rows.h)
    if found.feasible is False and qvi.n and rows.tangential.any():
        pulled = _minimise(qvi, rows, ~rows.tangential)
        found = pulled if pulled.feasible is False else found
    return found


def _minimise(qvi: FrictionQVI, rows: AdmissibleRows, chosen: BoolVector | slice = slice(None)) -> Feasibility:
    """Least energy over A z = b and the chosen rows."""
    clarabel = load("clarabel")
    G, h = csc_array(rows.G[chosen]), rows.h[chosen]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.presolve_enable = False
    settings.tol_infeas_abs = settings.tol_infeas_rel = 1e-11
    settings.time_limit = left()
    cones = ([clarabel.ZeroConeT(qvi.p)] if qvi.p else []) + [clarabel.NonnegativeConeT(h.size)]
    stacked = csc_array(vstack([qvi.A, G])) if qvi.p else G
    program = (csc_array(triu(qvi.K)), -qvi.f, stacked, np.concatenate([qvi.b, h]), cones, settings)
    answer = attempt("feasibility check failed", lambda: clarabel.DefaultSolver(*program).solve())
    if isinstance(answer, BackendFailure):
        return Feasibility(None, None, None, str(answer))
    word = str(answer.status)
    multipliers = np.array(answer.z)
    y, nu = np.zeros(rows.h.size), multipliers[: qvi.p]
    y[chosen] = np.maximum(multipliers[qvi.p :], 0.0)
    if "PrimalInfeasible" in word and is_farkas(qvi, y, nu):
        text = "no admissible traction carries the load, proved by multipliers (Farkas) checked on the data"
        return Feasibility(False, None, (y, nu), text)
    if word in ("Solved", "AlmostSolved"):
        return Feasibility(True, np.array(answer.x), None, "the load can be carried by some admissible traction")
    return Feasibility(None, None, None, f"whether the load can be carried was not decided ({word})")


def _determinate(h: Vector) -> Feasibility:
    """Nothing is unknown: C is empty if a row 0 ≤ h fails, and the multiplier 1 of that row proves it."""
    if h.min(initial=0.0) < -_DETERMINATE * float(np.abs(h).max(initial=0.0)):
        y = np.zeros(h.size)
        y[np.argmin(h)] = 1.0
        text = "the stress is statically determinate and violates the contact law"
        return Feasibility(False, None, (y, np.zeros(0)), text)
    return Feasibility(True, np.zeros(0), None, "the load can be carried by the one admissible traction")
