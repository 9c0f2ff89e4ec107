"""The last digits: Newton's method on the whole strict problem, bound and tractions at once.

Inner solvers leave half the digits where a cone is touched along a line, and the outer iteration takes as many steps as
it gains digits. From a state that is close, these equations for the functionals π of unilateral ends and q₊, q₋ ∈ D
of the two bounds of each edge are solved instead, n(m), τ(m) being the tractions that the multipliers leave:

    n − min(n + k π/w, 0) = 0
    y(b) − P_C(y(b) − κ ŷ(q)) = 0,    b = θ(n) − τ with q₊,   b = θ(n) + τ with q₋

in the cone coordinates y, ŷ of `natural`, which also says why that is complementarity. P_C is piecewise smooth: Newton
steps with its derivatives converge quadratically unless a touching point presses or slips with no force at all.
Equations that say no more than π = 0 or q = 0 are solved so; what is left is solved in least squares, as neighbouring
edges share σ_T at nodes.

Where a bound that is zero at one end of an edge (contact about to open, no cohesion) holds σ_T = 0 there, multipliers
in D need not exist, only limits of such. On that face of C, c = 0 at the end, the law is |τ_j| ≤ θ_j for the other two
coefficients, whose multipliers are numbers ≥ 0, and these equations are taken there. An edge closed at both ends has
τ = 0, and any ℓ. Nothing is believed: the result counts if the certificate passes.

Source: L. Qi, J. Sun, A nonsmooth version of Newton's method, Math. Programming 58 (1993).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lstsq

from solvers.basics.types import BoolVector, Matrix, Vector
from solvers.basics.watch import expired
from solvers.inequality.compliance import Compliance
from solvers.inequality.problem import FrictionQVI
from solvers.strict.natural import project
from solvers.strict.quadratics import in_dual
from solvers.strict.support import least_part
from solvers.strict.threshold import (
    bilateral_edges,
    edge_rows,
    end_pressure,
    frictionless_edges,
    strict_bound,
    threshold_of_ends,
)

_LARGEST = 256  # edges
_STEPS = 15
_ENOUGH = 1e-13  # residual over the largest traction
_LOST = 1e3  # growth of the residual that ends it
_OPEN = -1  # no coefficient is held at zero
_CLOSED = 1e-6  # share of the largest traction below which a bound at an end is none
_LITTLE = 1e-6  # share of the largest functional or bound that is none
_RANK = 1e-12  # singular values that are rounding
_DIFFERENCE = 1e-6  # of the largest traction: step of the difference quotients of θ
_TO_CONE = np.array([[1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [0.0, 2.0, 0.0]])
_DUAL_TO_CONE = 0.5 * np.array([[1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class Refined:
    """Multipliers (m,) after the last step, how many steps, and the residual over the largest traction."""

    m_N: Vector  # noqa: N815  # letters of (D2)
    m_T: Vector  # noqa: N815
    steps: int
    residual: float


class Newton:
    """The equations of one strict problem; `refine` starts from any state that is close."""

    def __init__(self, qvi: FrictionQVI) -> None:
        self._qvi, self._edges = qvi, edge_rows(qvi)
        self._e = qvi.m // self._edges.count
        self._unilateral = np.repeat(~bilateral_edges(qvi), 2)
        self._frictionless = self._held = frictionless_edges(qvi)
        self._closed = np.full(self._e, _OPEN)  # coefficient of σ_T that is zero as the bound is
        self._weights = self._edges.on_ends(qvi.W)
        self.compliance = Compliance(qvi)
        self._matrix: Matrix | None = None

    @property
    def affordable(self) -> bool:
        """Whether the dense matrices are small enough."""
        return self._e <= _LARGEST and self.compliance.is_dense

    @property
    def _flexibility(self) -> Matrix:
        """Tractions (n, τ) (5e,) that unit functionals (π, ℓ) relieve."""
        if self._matrix is None:
            ends = self._edges.matrix(self._edges.to_ends, self._e)
            bernstein = self._edges.matrix(self._edges.to_bernstein, self._e)
            C, m = self.compliance.dense, self._qvi.m
            left = np.vstack([ends @ C[:m], bernstein @ C[m:]])
            self._matrix = np.hstack([(ends @ left[:, :m].T).T, (bernstein @ left[:, m:].T).T])
        return self._matrix

    def refine(self, z: Vector, m_N: Vector, m_T: Vector, k: float) -> Refined | None:
        """Newton steps from (z, m_N, m_T); `k` is stress over displacement, see `certificate`. None if they lead away.

        Parameters
        ----------
        z : (n,)
            Unknowns that belong to the multipliers.
        m_N, m_T : (m,)
            Row multipliers.
        k : float
            Stress a unit of displacement.

        """
        edges, e = self._edges, self._e
        normal, tangential = self._qvi.normal(z), self._qvi.tangential(z)
        n, tau = edges.ends(normal), edges.bernstein(tangential)
        theta = strict_bound(self._qvi, normal).coefficients
        size = float(max(np.abs(n).max(initial=0.0), np.abs(tau).max(initial=0.0))) or 1.0
        self._close(theta, size)
        start = np.concatenate([edges.on_ends(m_N).ravel(), *self._split(edges.on_bernstein(m_T), tau, theta)])
        u, first = start.copy(), np.inf
        for step in range(_STEPS):
            moved = self._flexibility @ self._functionals(u - start)
            system = self._equations(u, n - moved[: 2 * e].reshape(e, 2), tau - moved[2 * e :].reshape(e, 3), k, size)
            residual = float(np.abs(system.values).max(initial=0.0)) / size
            if residual <= _ENOUGH or step == _STEPS - 1 or not residual < _LOST * first or expired():
                break
            first = min(first, residual)
            u = u + system.step(u)
            if not np.isfinite(u).all():
                return None
        functionals = self._functionals(u)
        m_N = edges.rows(functionals[: 2 * e].reshape(e, 2))
        return Refined(m_N, edges.rows(functionals[2 * e :].reshape(e, 3)), step, residual)

    def _functionals(self, u: Vector) -> Vector:
        """(π, ℓ) (5e,) of u = (π, q₊, q₋) (8e,)."""
        pushes, upper, lower = np.split(u, [2 * self._e, 5 * self._e])
        return np.concatenate([pushes, upper - lower])

    def _close(self, theta: Matrix, size: float) -> None:
        """Where the bound is zero at one end, and where at both."""
        closed = theta[:, [0, 2]] <= _CLOSED * size
        self._held = self._frictionless | closed.all(axis=1)
        self._closed = np.where(closed[:, 0], 0, np.where(closed[:, 1], 2, _OPEN))
        self._closed[self._held] = _OPEN

    def _split(self, ell: Matrix, tau: Matrix, theta: Matrix) -> tuple[Vector, Vector]:
        """Parts q₊ and q₋ (3e,) of functionals ℓ: all of it on the side where it works, if it is about in ±D there."""
        up = (ell * tau).sum(axis=1) >= 0.0
        plus = np.where((up | self._held)[:, None], ell, 0.0)
        slack = _LITTLE * float(np.abs(ell).max(initial=0.0))
        faces = np.flatnonzero(self._closed != _OPEN)
        plus[faces] = np.maximum(ell[faces], 0.0)
        plus[faces, self._closed[faces]] = ell[faces, self._closed[faces]]
        one_sided = np.where(up, in_dual(ell, slack), in_dual(-ell, slack))
        both = np.flatnonzero(~one_sided & ~self._held & (self._closed == _OPEN))
        if len(both):
            bound = theta[both] + _LITTLE * float(theta.max(initial=0.0)) + np.finfo(float).tiny
            plus[both] = ell[both] + least_part(ell[both], bound, 1.0 / _LITTLE)
        return plus.ravel(), (plus - ell).ravel()

    def _equations(self, u: Vector, n: Matrix, tau: Matrix, k: float, size: float) -> "_System":
        """Values and derivatives of the equations at u, where the tractions are n and τ."""
        e = self._e
        theta, slope = self._bound(n, size)
        pushes, upper, lower = np.split(u, [2 * e, 5 * e])
        pressed = self._unilateral & (n.ravel() + k * pushes / self._weights.ravel() >= 0.0)
        rate = np.where(self._unilateral, k / self._weights.ravel(), 1.0)
        first = np.where(pressed, n.ravel(), -rate * pushes)
        kappa = (k / self._weights.sum(axis=1))[:, None, None]
        values, traction, own, trivial = [first], [], [], [~pressed]
        for sign, q in ((-1.0, upper.reshape(e, 3)), (1.0, lower.reshape(e, 3))):
            part = _cone_equations(sign, q, theta, tau, slope, kappa)
            self._on_faces(part, sign, q, theta + sign * tau, slope, kappa)
            self._hold(part, sign, q, tau)
            values.append(part.values.ravel())
            traction.append((part.by_pressure, part.by_shear))
            own.append(part.own)
            trivial.append(part.trivial.ravel())
        return _System(self._flexibility, np.concatenate(values), traction, own, np.concatenate(trivial), e)

    def _hold(self, part: "_Equations", sign: float, q: Matrix, tau: Matrix) -> None:
        """τ = 0 with q₊ free, and q₋ = 0, on edges without any bound."""
        held = self._held
        part.by_pressure[held] = 0.0
        part.by_shear[held] = np.eye(3) if sign < 0 else 0.0
        part.own[held] = 0.0 if sign < 0 else np.eye(3)
        part.values[held] = tau[held] if sign < 0 else q[held]
        part.trivial[held] = sign > 0

    def _on_faces(self, part: "_Equations", sign: float, q: Matrix, b: Matrix, slope: Matrix, kappa: Matrix) -> None:
        """τ = 0 at the closed end with q₊ free there and q₋ = 0; b_j = max(b_j − κq_j, 0) of the other coefficients."""
        edges = np.flatnonzero(self._closed != _OPEN)
        scaled = kappa[edges, :, 0] * q[edges]
        end = self._closed[edges]
        kept = b[edges] - scaled <= 0.0
        kept[np.arange(len(edges)), end] = sign < 0
        rows = kept[:, :, None] * np.eye(3)
        part.values[edges] = np.where(kept, b[edges], scaled)
        part.by_shear[edges] = sign * rows
        by_pressure = rows @ slope[edges]
        by_pressure[np.arange(len(edges)), end] = 0.0
        part.by_pressure[edges] = by_pressure
        part.own[edges] = kappa[edges] * (np.eye(3) - rows)
        part.trivial[edges] = ~kept

    def _bound(self, n: Matrix, size: float) -> tuple[Matrix, Matrix]:
        """θ (e, 3) at the end values n (e, 2) and its derivatives (e, 3, 2), by difference quotients."""

        def at(ends: Matrix) -> Matrix:
            return threshold_of_ends(self._qvi, end_pressure(self._qvi, self._edges.at_points(ends))).coefficients

        theta, step = at(n), _DIFFERENCE * size
        moved = [at(n - step * np.eye(2)[i]) for i in range(2)]
        return theta, np.stack([(theta - other) / step for other in moved], axis=2)


@dataclass(frozen=True, eq=False)
class _Equations:
    """Of one bound on all edges: values (e, 3), derivatives by n (e, 3, 2), τ and q (e, 3, 3), and which say q = 0."""

    values: Matrix
    by_pressure: Matrix
    by_shear: Matrix
    own: Matrix
    trivial: BoolVector


def _cone_equations(sign: float, q: Matrix, theta: Matrix, tau: Matrix, slope: Matrix, kappa: Matrix) -> _Equations:
    """The equations of the bound θ + sign τ in the cone."""
    y = (theta + sign * tau) @ _TO_CONE.T
    v = y - kappa[:, :, 0] * (q @ _DUAL_TO_CONE.T)
    derivative = _derivative(v)
    keep = np.eye(3) - derivative
    free = np.abs(keep).max(axis=(1, 2), initial=0.0) == 0.0
    return _Equations(
        y - project(v),
        keep @ _TO_CONE @ slope,
        sign * keep @ _TO_CONE,
        kappa * derivative @ _DUAL_TO_CONE,
        np.repeat(free[:, None], 3, axis=1),
    )


@dataclass(frozen=True, eq=False)
class _System:
    """F(u) and its derivative: `traction` by (n, τ) on each edge, `own` by q; trivial rows only say u = 0."""

    flexibility: Matrix
    values: Vector
    traction: list[tuple[Matrix, Matrix]]
    own: list[Matrix]
    trivial: BoolVector
    e: int

    def step(self, u: Vector) -> Vector:
        """Newton's step (8e,)."""
        e, trivial = self.e, self.trivial
        step = np.where(trivial, -u, 0.0)
        kept = np.flatnonzero(~trivial)
        if not len(kept):
            return step
        by_traction, by_own = self._derivative(kept)
        functional = np.concatenate([step[: 2 * e], step[2 * e : 5 * e] - step[5 * e :]])
        right = -self.values[kept] + by_traction @ (self.flexibility @ functional) - by_own @ step
        columns = np.where(kept < 5 * e, kept, kept - 3 * e)
        signs = np.where(kept < 5 * e, 1.0, -1.0)
        matrix = by_own[:, kept] - (by_traction @ self.flexibility[:, columns]) * signs
        scale = np.abs(matrix).max(axis=0)
        scale = np.maximum(scale, _RANK * scale.max())
        step[kept] = lstsq(matrix / scale, right, cond=_RANK, lapack_driver="gelsy")[0] / scale
        return step

    def _derivative(self, kept: np.ndarray) -> tuple[Matrix, Matrix]:
        """Derivatives of the kept rows by (n, τ) (5e,) and by u itself (8e,)."""
        e = self.e
        by_traction, by_own = np.zeros((8 * e, 5 * e)), np.zeros((8 * e, 8 * e))
        ends = np.arange(2 * e)
        by_traction[ends, ends] = 1.0
        edge = np.arange(e)[:, None, None]
        row, column = np.arange(3)[None, :, None], np.arange(3)[None, None, :]
        for number, ((by_n, by_tau), own) in enumerate(zip(self.traction, self.own, strict=True)):
            place = 2 * e + 3 * e * number + 3 * edge + row
            by_traction[place, 2 * edge + column[:, :, :2]] = by_n
            by_traction[place, 2 * e + 3 * edge + column] = by_tau
            by_own[place, 2 * e + 3 * e * number + 3 * edge + column] = own
        return by_traction[kept], by_own[kept]


def _derivative(v: Matrix) -> Matrix:
    """Derivatives (e, 3, 3) of the projection on C, see `natural.project`."""
    above = v[:, 2] >= 0.0
    plane = np.zeros((len(v), 3, 3))
    plane[:, :2, :2] = _second_order(v[:, :2])
    plane[:, 2, 2] = 1.0
    return np.where(above[:, None, None], plane, _second_order(v))


def _second_order(v: Matrix) -> Matrix:
    """Derivatives (e, d, d) of the projection on y₀ ≥ |(y₁, …)|."""
    d = v.shape[1]
    size = np.linalg.norm(v[:, 1:], axis=1)
    safe = np.where(size > 0.0, size, 1.0)
    direction, ratio = v[:, 1:] / safe[:, None], (v[:, 0] / safe)[:, None, None]
    surface = np.zeros((len(v), d, d))
    surface[:, 0, 0] = 0.5
    surface[:, 0, 1:] = surface[:, 1:, 0] = 0.5 * direction
    outer = direction[:, :, None] * direction[:, None, :]
    surface[:, 1:, 1:] = 0.5 * ((1.0 + ratio) * np.eye(d - 1) - ratio * outer)
    inside, polar = v[:, 0] >= size, v[:, 0] <= -size
    return np.where(inside[:, None, None], np.eye(d), np.where(polar[:, None, None], 0.0, surface))
