"""Contact and friction as one mixed complementarity problem in trace coordinates y.

With the pressure p = −σ_N (|σ_N| at bilateral points, smoothed as √(σ_N² + δ²)) every condition is a slack

    normal      s = −σ_N                            at unilateral points
    friction    s = cohesion + mu p − σ_T,          multiplier λ₊
                s = cohesion + mu p + σ_T,          multiplier λ₋       at points with friction
    cap         s = cap − σ_T and cap + σ_T         where mu > 0 and the cap is finite

with s ≥ 0, λ ≥ 0, s λ = 0, m_N = W λ_N and m_T = W Σ (λ₊ − λ₋). As |σ_N| = −σ_N the threshold is linear in y and needs
no outer iteration; the problem is not symmetric, since the pressure in the threshold has no multiplier of its own:

    S y + c + Bᵀ W λ + Aᵀ ν = 0,    s = slack(y),    A y = b,

rows of B the tractions on which λ works, C(y) = −∂slack/∂y. Points whose bound is always zero give equations σ_T = 0.
"""

from typing import TypeAlias

import numpy as np
from scipy.sparse import csr_matrix, diags, vstack

from solvers.condensed.frictionless import Frictionless
from solvers.condensed.reduction import Base, Reduction
from solvers.problem import FrictionQVI
from solvers.types import IntVector, Matrix, Sparse, Vector

Rows: TypeAlias = Sparse | Matrix
"""Rows by trace coordinates: sparse where there are many, dense where there are few."""

FRICTION_SHARE = 1000.0
"""s λ of friction bounds over s λ of normal bounds on the central path: with 1 the path often turns back where contact
opens and friction is large."""

_DENSE = 2e6  # multiplications of a weighted product of rows up to which they are kept dense
_SMOOTHING = 1e-14  # δ over the scale of stress


class Complementarity:
    """The problem about a base point, which `rebase` exchanges.

    Attributes
    ----------
    S : (k, k); c : (k,); A, b : (p, k) and (p,), equations of points without friction included
    B : (q, k) rows
    weights : (q,) W of each bound
    shares : (q,) what s λ is on the central path, relative
    stress : scale of the tractions

    """

    def __init__(self, qvi: FrictionQVI, reduction: Reduction, base: Base, stress: float) -> None:
        self._qvi, self._reduction, self.stress = qvi, reduction, stress
        self._frictionless = Frictionless.of(np.flatnonzero(qvi.frictionless), reduction.E_T, qvi.W)
        fixed = self._frictionless.fixed
        self._free: IntVector = np.setdiff1d(np.arange(reduction.size), fixed)
        self._lay_out()
        free = self._free
        self.S: Matrix = reduction.stiffness[np.ix_(free, free)] if len(fixed) else reduction.stiffness
        self._coupling: Matrix = reduction.stiffness[np.ix_(free, fixed)]
        self.A: Matrix = np.vstack([reduction.A, self._frictionless.equations])[:, free]
        self.rebase(base)

    def _lay_out(self) -> None:
        """Which bound belongs to which point, and its rows."""
        qvi, E_N, E_T = self._qvi, self._reduction.E_N, self._reduction.E_T
        normal, friction = np.flatnonzero(~qvi.bilateral), np.flatnonzero(~qvi.frictionless)
        capped = friction[np.isfinite(qvi.cap[friction]) & (qvi.mu[friction] > 0.0)]
        parts = (normal, friction, friction, capped, capped)
        lengths = [len(part) for part in parts]
        self._points: IntVector = np.concatenate(parts)
        self._sign: Vector = np.repeat([0.0, 1.0, -1.0, 1.0, -1.0], lengths)
        self._is_cap = np.repeat([False, False, False, True, True], lengths)
        self._bounded: IntVector = friction
        self.weights: Vector = qvi.W[self._points]
        self.shares: Vector = np.where(self._sign == 0.0, 1.0, FRICTION_SHARE)
        self._all_N = csr_matrix(E_N[:, self._free])
        self._all_T = csr_matrix(E_T[:, self._free])
        rows = csr_matrix(
            vstack([self._all_N[normal], diags(self._sign[len(normal) :]) @ self._all_T[self._points[len(normal) :]]])
        )
        self._is_dense = len(self._points) * len(self._free) ** 2 <= _DENSE
        self.B: Rows = self._stored(rows)
        self._B_transposed: Rows = self.B.T if self._is_dense else csr_matrix(rows.T)
        self._constant: Rows | None = None
        if not (qvi.bilateral & (qvi.mu > 0.0)).any():
            self._constant = self._slack_rows(np.zeros(qvi.m))

    def _stored(self, rows: Sparse) -> Rows:
        return rows.toarray() if self._is_dense else csr_matrix(rows)

    def rebase(self, base: Base) -> None:
        """Pose the problem about another point; y = 0 there, up to coordinates that are known."""
        self._base = base
        self._fixed_values: Vector = self._frictionless.values(base.tangential)
        fixed = self._frictionless.fixed
        self.c: Vector = base.c[self._free] + self._coupling @ self._fixed_values
        kept = -(base.tangential[self._frictionless.kept])
        known = self._reduction.A[:, fixed] @ self._fixed_values
        self.b: Vector = np.concatenate([base.equality - known, kept])
        self._normal = base.normal + self._reduction.E_N[:, fixed] @ self._fixed_values
        self._tangential = base.tangential + self._reduction.E_T[:, fixed] @ self._fixed_values

    def restricted(self, y: Vector) -> Vector:
        """Those of all trace coordinates that are unknown."""
        return y[self._free]

    def full(self, y: Vector) -> Vector:
        """All trace coordinates, those known included."""
        values = np.zeros(self._reduction.size)
        values[self._free] = y
        values[self._frictionless.fixed] = self._fixed_values
        return values

    def tractions(self, y: Vector) -> tuple[Vector, Vector]:
        """(σ_N, σ_T) (m,) each."""
        return self._normal + self._all_N @ y, self._tangential + self._all_T @ y

    def slack(self, y: Vector) -> Vector:
        """s(y) (q,)."""
        qvi, points = self._qvi, self._points
        normal, tangential = self.tractions(y)
        pressure = np.where(qvi.bilateral, np.hypot(normal, _SMOOTHING * self.stress), -normal)
        cap = np.where(qvi.mu > 0.0, np.inf, qvi.cap)
        bound = np.minimum(qvi.cohesion + qvi.mu * pressure, cap)[points]
        bound = np.where(self._is_cap, qvi.cap[points], bound)
        return np.where(self._sign == 0.0, -normal[points], bound - self._sign * tangential[points])

    def slack_rows(self, y: Vector) -> Rows:
        """C(y) = −∂slack/∂y (q, k)."""
        return self._constant if self._constant is not None else self._slack_rows(self.tractions(y)[0])

    def _slack_rows(self, normal: Vector) -> Rows:
        qvi, points = self._qvi, self._points
        smooth = np.hypot(normal, _SMOOTHING * self.stress)
        change = np.where(qvi.bilateral, normal / np.where(smooth > 0.0, smooth, 1.0), -1.0)  # of the pressure
        factor = np.where(self._is_cap | (self._sign == 0.0), 0.0, (qvi.mu * change)[points])
        rows = diags(-factor) @ self._all_N[points] + csr_matrix(vstack([self.B]) if not self._is_dense else self.B)
        return self._stored(csr_matrix(rows))

    def energy(self, y: Vector) -> float:
        """½ yᵀSy + cᵀy, the energy but for a constant."""
        return float(0.5 * y @ (self.S @ y) + self.c @ y)

    def force(self, multipliers: Vector) -> Vector:
        """BᵀWλ (k,)."""
        return np.asarray(self._B_transposed @ (self.weights * multipliers))

    def add_stiffness(self, target: Matrix, factors: Vector, slack_rows: Rows) -> None:
        """Add BᵀW diag(factors) C to target (k, k)."""
        scaled = self.weights * factors
        if self._is_dense:
            target += self._B_transposed @ (scaled[:, None] * slack_rows)
            return
        product = (self._B_transposed @ (diags(scaled) @ slack_rows)).tocoo()
        target[product.row, product.col] += product.data

    def multipliers(self, y: Vector, lam: Vector, nu: Vector) -> tuple[Vector, Vector, Vector]:
        """Row multipliers (m_N, m_T, ν) of (D2)."""
        qvi, p = self._qvi, len(self._reduction.A)
        scaled = self.weights * lam
        normal = self._sign == 0.0
        m_N = np.bincount(self._points[normal], scaled[normal], qvi.m)
        m_T = np.bincount(self._points[~normal], (self._sign * scaled)[~normal], qvi.m)
        reduction = self._reduction
        residual = (
            reduction.stiffness @ self.full(y) + self._base.c + reduction.E_N.T @ m_N + reduction.E_T.T @ m_T
            + reduction.A.T @ nu[:p]
        )  # fmt: skip
        return m_N, m_T + self._frictionless.multipliers(residual, nu[p:], qvi.m), nu[:p]
