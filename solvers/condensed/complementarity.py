"""Contact and friction as one mixed complementarity problem in trace coordinates y.

With the pressure p = −σ_N (|σ_N| at bilateral points, smoothed as √(σ_N² + δ²) with δ → 0) every condition is a slack

    normal      s = −σ_N                            at unilateral points
    friction    s = cohesion + mu p − σ_T,          multiplier λ₊
                s = cohesion + mu p + σ_T,          multiplier λ₋       at points with friction
    cap         s = cap − σ_T and cap + σ_T         where mu > 0 and the cap is finite

with s ≥ 0, λ ≥ 0, s λ = 0, m_N = W λ_N and m_T = W Σ (λ₊ − λ₋). As |σ_N| = −σ_N the threshold is linear in y and needs
no outer iteration; the problem is not symmetric, since the pressure in the threshold has no multiplier of its own:

    S y + c + Bᵀ W λ + Aᵀ ν = 0,    s = slack(y),    A y = b,

rows of B the tractions on which λ works, C(y) = −∂slack/∂y. Points whose bound is always zero give equations σ_T = 0.
Equations are solved for some of the coordinates (`equations`).
"""

import numpy as np

from solvers.basics.types import IntVector, Matrix, Vector
from solvers.condensed.equations import Equations
from solvers.condensed.frictionless import Frictionless
from solvers.condensed.reduction import Base, Reduction
from solvers.inequality.blocks import Rows, add_product, mapped, scaled, stacked, transposed
from solvers.inequality.problem import FrictionQVI

FRICTION_SHARES = (1000.0, 100.0, 1e4, 10.0)
"""s λ of friction bounds and caps over s λ of normal bounds on the central path, one after the other if need be: with 1
the path often turns back where contact opens and friction is large."""

_UNLOADED = 1e-7  # tractions smaller than this share of the stress in the body are none
_FIRST = 1e-3  # the same of the stress at the start, before the first correction
_SMOOTHEST, _SHARPEST, _SHARPER = 1.0, 1e-14, 0.1  # δ over the scale of stress, and its reduction


class Complementarity:
    """The problem about a base point, which `rebase` exchanges, in the coordinates u that equations leave free.

    Attributes
    ----------
    S : (k, k); c : (k,)
    B : (q, k) rows
    weights : (q,) W of each bound
    shares : (q,) what s λ is on the central path, relative
    sizes : (q,) what s may be relative to the tractions: 1 + mu for friction, else 1
    stress : scale of the tractions

    """

    def __init__(
        self, qvi: FrictionQVI, reduction: Reduction, base: Base, stress: float, share: float = FRICTION_SHARES[0]
    ) -> None:
        self._share = share
        self._qvi, self._reduction, self.stress = qvi, reduction, stress
        self._smoothing = _SMOOTHEST * stress
        frictionless = Frictionless.of(np.flatnonzero(qvi.frictionless), reduction.E_T, qvi.W)
        self._equations = Equations.of(reduction.A, frictionless, reduction.size)
        self._lay_out()
        self.S: Matrix = self._equations.quadratic(reduction.stiffness)
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
        self.weights: Vector = qvi.W[self._points]
        self.sizes: Vector = np.where(self._is_cap | (self._sign == 0.0), 1.0, 1.0 + qvi.mu[self._points])
        self.shares: Vector = np.where(self._sign == 0.0, 1.0, self._share)
        whole = len(self._equations.free) == self._reduction.size
        self._all_N: Rows = E_N if whole else mapped(E_N, self._equations.map)
        self._all_T: Rows = E_T if whole else mapped(E_T, self._equations.map)
        tangential = scaled(self._sign[len(normal) :], self._all_T[self._points[len(normal) :]])
        self.B: Rows = stacked([self._all_N[normal], tangential])
        self._B_transposed: Rows = transposed(self.B)
        self._constant: Rows | None = None
        if not (qvi.bilateral & (qvi.mu > 0.0)).any():
            self._constant = self._slack_rows(np.zeros(qvi.m))

    def rebase(self, base: Base) -> None:
        """Pose the problem about another point; u = 0 there, up to what equations had missed."""
        reduction = self._reduction
        self._in_body = float(np.sqrt(2.0 * base.strain_energy * reduction.contact_stiffness / self._qvi.W.sum()))
        self._base = base
        self._offset: Vector = self._equations.offset(base.equality, base.tangential)
        half = base.c + 0.5 * (reduction.stiffness @ self._offset)
        z = base.z if base.z.any() else reduction.move(base, np.zeros(reduction.size))  # interior in equilibrium
        self._energy = self._qvi.energy(z) + float(half @ self._offset)
        self.c: Vector = self._equations.map.T @ (base.c + reduction.stiffness @ self._offset)
        self._normal, self._tangential = reduction.tractions(base, self._offset)

    @property
    def is_sharp(self) -> bool:
        """Whether |σ_N| is no longer smoothed, or need not be."""
        return self._constant is not None or self._smoothing <= _SHARPEST * self.stress

    def sharpen(self) -> None:
        """Smooth |σ_N| less."""
        self._smoothing = max(_SHARPER * self._smoothing, _SHARPEST * self.stress)

    def full(self, u: Vector) -> Vector:
        """All trace coordinates y."""
        return np.asarray(self._offset + self._equations.map @ u)

    def restricted(self, y: Vector) -> Vector:
        """The free ones of all trace coordinates."""
        return y[self._equations.free]

    def tractions(self, y: Vector) -> tuple[Vector, Vector]:
        """(σ_N, σ_T) (m,) each."""
        return self._normal + self._all_N @ y, self._tangential + self._all_T @ y

    def contradiction(self) -> float:
        """Largest shear at points without friction, over the scale of stress: what equations cannot make zero."""
        return float(np.abs(self._tangential[self._qvi.frictionless]).max(initial=0.0)) / self.stress

    def stress_at(self, y: Vector) -> float:
        """Max |σ_N|, |σ_T|; where the contact carries nothing that of the body, much as `certificate` does."""
        largest = max(float(np.abs(part).max(initial=0.0)) for part in self.tractions(y))
        if self._in_body == 0.0:  # nothing is known of the body yet
            return max(largest, _FIRST * self.stress)
        return largest if largest > _UNLOADED * self._in_body else self._in_body

    def slack(self, y: Vector) -> Vector:
        """s(y) (q,)."""
        qvi, points = self._qvi, self._points
        normal, tangential = self.tractions(y)
        pressure = np.where(qvi.bilateral, np.hypot(normal, self._smoothing), -normal)
        cap = np.where(qvi.mu > 0.0, np.inf, qvi.cap)
        bound = np.minimum(qvi.cohesion + qvi.mu * pressure, cap)[points]
        bound = np.where(self._is_cap, qvi.cap[points], bound)
        return np.where(self._sign == 0.0, -normal[points], bound - self._sign * tangential[points])

    def slack_rows(self, y: Vector) -> Rows:
        """C(y) = −∂slack/∂y (q, k)."""
        return self._constant if self._constant is not None else self._slack_rows(self.tractions(y)[0])

    def _slack_rows(self, normal: Vector) -> Rows:
        qvi, points = self._qvi, self._points
        smooth = np.hypot(normal, self._smoothing)
        change = np.where(qvi.bilateral, normal / np.where(smooth > 0.0, smooth, 1.0), -1.0)  # of the pressure
        factor = np.where(self._is_cap | (self._sign == 0.0), 0.0, (qvi.mu * change)[points])
        return scaled(-factor, self._all_N[points]) + self.B

    def energy(self, y: Vector) -> float:
        """Of (D2), with what the base lacks in accuracy."""
        return self._energy + float(0.5 * y @ (self.S @ y) + self.c @ y)

    def force(self, multipliers: Vector) -> Vector:
        """BᵀWλ (k,)."""
        return np.asarray(self._B_transposed @ (self.weights * multipliers))

    def add_stiffness(self, target: Matrix, factors: Vector, slack_rows: Rows) -> None:
        """Add BᵀW diag(factors) C to target (k, k)."""
        add_product(target, self._B_transposed, scaled(self.weights * factors, slack_rows))

    def multipliers(self, u: Vector, lam: Vector) -> tuple[Vector, Vector, Vector]:
        """Row multipliers (m_N, m_T, ν) of (D2)."""
        qvi, reduction = self._qvi, self._reduction
        rows = self.weights * lam
        normal = self._sign == 0.0
        m_N: Vector = np.zeros(qvi.m) + np.bincount(self._points[normal], rows[normal], qvi.m)
        m_T: Vector = np.zeros(qvi.m) + np.bincount(self._points[~normal], (self._sign * rows)[~normal], qvi.m)
        residual = (
            self._base.c + reduction.stiffness @ self.full(u) + reduction.E_N.T @ m_N + reduction.E_T.T @ m_T
        )  # fmt: skip
        nu, frictionless = self._equations.multipliers(residual, qvi.m, qvi.p)
        return m_N, m_T + frictionless, nu
