"""Contact and friction as one mixed complementarity problem (D5) in trace coordinates y.

The slacks s are in this order: s = −σ_N of the normal bounds, then upper friction bounds and caps of σ_T, then lower
ones. The code writes c for γ_y. At bilateral points with friction p = |σ_N| has a kink. It is split there,

    σ_N = tension − pressure,    p = tension + pressure,    tension ≥ 0,  pressure ≥ 0,  tension · pressure = 0,

which is one more complementarity: slacks stay linear in all unknowns. With tension · pressure = δ²/4, p is
√(σ_N² + δ²). Points whose friction bound is always zero give equations σ_T = 0. All equations are solved for some of
the coordinates (`Equations`).

In `docs/theory.md`: (D5), (D6).
"""

from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from solvers.basics.types import IntVector, Matrix, SparseRows, Vector
from solvers.certificate.certificate import body_scales
from solvers.condensed.systems import SLOTS, USUAL_PATHS, Coordinates, Expansion, NewtonSystem, PathWeights
from solvers.inequality.problem import FrictionQVI
from solvers.inequality.rows import LEAST_PIVOT, Rows, basis, dense, largest, scaled, stored

_EPSILON = float(np.finfo(np.float64).eps)
_ROUNDINGS = 16.0  # a residual up to this many ε times the terms of its sum is rounding
_START_STRESS = 1e-3  # least scale of stress before the first correction, over `stress`


class Complementarity:
    """The problem about a base, which `rebase` replaces, in the free coordinates u, see `Equations`.

    In the shapes are q bounds, t bounded tractions (normal ones first), b bilateral points with friction, and k free
    coordinates.

    Attributes
    ----------
    S, c : (k, k) stiffness, and (k,) gradient at the base
    T : (t, k) rows of the bounded tractions
    forces : (k, t) map from forces on the bounded tractions to forces on the coordinates, Tᵀ
    N : (t, k) rows of σ_N at the points of bounded shears σ_T; zero for bounded normal tractions
    weights, W : (q,) W of each bound, and (t,) of each bounded traction
    early_omega, omega : (q,) ω of the central path, until the slacks fit their tractions and after
    start : least multiplier at the start, over the scale of displacement
    friction : (q,) mu of bounds that depend on the pressure, else 0
    pressed : (q,) the normal bound whose slack is the pressure in a friction bound, −1 if there is none
    coulomb : the bounds whose `pressed` is not −1
    traction, signs : (q,) the traction that each bound limits, and the sign of the multiplier's force on it
    signed : (t, q) matrix that sums values of the bounds of each traction, times `signs`
    bounds : (t, 4) the bounds of each traction in the order of `SLOTS`, −1 for a missing bound
    count : number of normal bounds, which is that of bounded normal tractions
    split, split_rows : (b,) bilateral points whose friction bound depends on |σ_N|, and (b, k) their rows of σ_N
    stress, sizes : scale of the tractions, and (q,) that of the slacks over it: 1 + mu for friction, else 1

    """

    def __init__(
        self,
        qvi: FrictionQVI,
        space: Coordinates,
        base: Expansion,
        stress: float,
        path: PathWeights = USUAL_PATHS[0],
    ) -> None:
        self._path, self.start = path, path.start
        self._qvi, self._space, self.stress = qvi, space, stress
        self._equations = Equations(space, qvi.W)
        self._lay_out()
        self._lay_out_rows()
        self.S: Matrix | SparseRows = self._equations.quadratic(space.stiffness)
        self.system: NewtonSystem = space.system(self.S)
        self.rebase(base)

    def _lay_out(self) -> None:
        """Points, tractions and data of the bounds."""
        qvi = self._qvi
        # The points of all bounds: normal, then friction and cap above, then friction and cap below.
        normal, friction = np.flatnonzero(~qvi.bilateral), np.flatnonzero(~qvi.frictionless)
        capped = friction[np.isfinite(qvi.cap[friction]) & (qvi.mu[friction] > 0.0)]
        parts = (normal, friction, capped, friction, capped)
        kind = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
        self._points: IntVector = np.concatenate(parts)
        self._sign: Vector = np.array([0.0, 1.0, 1.0, -1.0, -1.0])[kind]
        is_cap = np.array([False, False, True, False, True])[kind]
        # The bounded traction of each bound, and the bounds of each traction.
        places = np.full((2, qvi.m), -1)
        places[0, normal], places[1, friction] = np.split(np.arange(len(normal) + len(friction)), [len(normal)])
        self.traction: IntVector = places[np.where(self._sign == 0.0, 0, 1), self._points]
        self.bounds: IntVector = np.full((len(normal) + len(friction), len(SLOTS)), -1)
        self.bounds[self.traction, np.array([0, 0, 2, 1, 3])[kind]] = np.arange(len(self._points))
        # Friction bounds that depend on a pressure, and the normal bound of that pressure.
        mu, cohesion, limit = qvi.mu[self._points], qvi.cohesion[self._points], qvi.cap[self._points]
        is_coulomb = (self._sign != 0.0) & ~is_cap & (mu > 0.0)
        self.pressed: IntVector = np.where(is_coulomb, places[0, self._points], -1)
        self.coulomb: IntVector = np.flatnonzero(self.pressed >= 0)
        self.friction: Vector = np.where(is_coulomb, mu, 0.0)
        self.signs: Vector = np.where(self._sign == 0.0, 1.0, self._sign)
        # Matrices (t, q) that sum values of the bounds of each traction: with signs, without signs, and times ± mu.
        entries = (self.signs, np.ones(len(kind)), self.signs * self.friction)
        entry_places = self.traction, np.arange(len(kind))
        self.signed, self._summed, self._friction_signed = (
            stored(csr_array((each, entry_places), (len(self.bounds), len(kind)))) for each in entries
        )
        fixed = np.where(is_cap, limit, np.where(mu > 0.0, cohesion, np.minimum(cohesion, limit)))
        self._constant_bound: Vector = np.where(self._sign == 0.0, 0.0, fixed)
        self.count = count = len(normal)
        # Upper bounds of σ_T, which lower ones follow; their mu if a normal bound has the pressure; and the rows of
        # (σ_N, σ_T) (2m,) that normal and upper bounds limit.
        self._upper = slice(count, (count + len(kind)) // 2)
        self._bound_friction: Vector = np.where(self.pressed >= 0, self.friction, 0.0)[self._upper]
        self._bounded_tractions: IntVector = self._points[: self._upper.stop] + qvi.m * (kind > 0)[: self._upper.stop]
        self.weights: Vector = qvi.W[self._points]
        self.W: Vector = self.weights[: len(self.bounds)]
        self.total_weight = float(self.weights.sum())
        self.sizes: Vector = np.where(is_cap | (self._sign == 0.0), 1.0, 1.0 + mu)
        early, late = self._path.early, self._path.late
        self.early_omega, self.omega = (np.where(self._sign == 0.0, 1.0, weight) for weight in (early, late))
        # Bilateral points with friction: their friction bounds, the point of each of these bounds, and their shears.
        self.split: IntVector = np.flatnonzero(qvi.bilateral & (qvi.mu > 0.0) & ~qvi.frictionless)
        self.split_weights: Vector = qvi.W[self.split]
        self._split_bounds: IntVector = np.flatnonzero(is_coulomb & qvi.bilateral[self._points])
        self._split_points: IntVector = np.searchsorted(self.split, self._points[self._split_bounds])
        self._split_shears: IntVector = places[1, self.split]

    def _lay_out_rows(self) -> None:
        """Rows of tractions and bounds in the free coordinates."""
        E, m, count = self._space.E, self._qvi.m, self.count
        are_all_free = len(self._equations.free) == self._space.size
        self._rows: Rows = E if are_all_free else E @ self._equations.map
        self._row_sizes: Any = abs(self._rows)
        normal, shears = self._points[:count], self._points[count : len(self.bounds)]
        self.T: Rows = self._rows[np.concatenate([normal, m + shears])]
        self.N: Rows = scaled(np.repeat([0.0, 1.0], [count, len(shears)]), self._rows[np.concatenate([normal, shears])])
        self.forces: Rows = self._space.forces(self.T)
        self.split_rows: Rows = self._rows[self.split]

    def rebase(self, base: Expansion) -> None:
        """Take another base; u = 0 is the base, corrected to meet the equations."""
        space = self._space
        self._has_moved = bool(base.z.any())
        _, self._body_stress, self._unloaded = (
            body_scales(self._qvi, base.strain_energy) if self._has_moved else (0.0, 0.0, 0.0)
        )
        self._base = base
        self._offset: Vector = self._equations.offset(base.equality[: len(space.A)], base.tractions[self._qvi.m :])
        half = base.c + 0.5 * (space.stiffness @ self._offset)
        self._energy = base.energy + float(half @ self._offset)
        self.c: Vector = self._equations.map.T @ (base.c + space.stiffness @ self._offset)
        self._base_tractions = base.tractions + space.E @ self._offset
        self._base_sizes = np.abs(self._base_tractions)
        self._last: tuple[Vector | None, Vector] = (None, self._base_tractions)

    def full(self, u: Vector) -> Vector:
        """All coordinates y of free coordinates u."""
        return np.asarray(self._offset + self._equations.map @ u)

    def restricted(self, y: Vector) -> Vector:
        """The free coordinates u of all coordinates y."""
        return y[self._equations.free]

    def tractions(self, y: Vector) -> Vector:
        """(σ_N, σ_T) (2m,), kept for the last y, as an iteration needs them several times."""
        if self._last[0] is not y:
            self._last = (y, self._base_tractions + self._rows @ y)
        return self._last[1]

    def contradiction(self) -> float:
        """Largest shear at points without friction, over the scale of stress; above 0 if equations contradict."""
        return float(np.abs(self._base_tractions[self._qvi.m :][self._qvi.frictionless]).max(initial=0.0)) / self.stress

    def stress_at(self, y: Vector) -> float:
        """Scale of stress at y, as in `certificate`: max |σ_N|, |σ_T|, or the stress of the body."""
        stress = largest(self.tractions(y))
        if not self._has_moved:  # the stress of the body is not known yet
            return max(stress, _START_STRESS * self.stress)
        return stress if stress > self._unloaded else self._body_stress

    def slack(self, y: Vector, size: Vector) -> Vector:
        """Slacks (q,) for coordinates y and |σ_N| (b,), `size`, at the points `split`."""
        points, count = self._points, self.count
        normal, tangential = np.split(self.tractions(y), 2)
        pressure = -normal
        pressure[self.split] = size
        slack = self._constant_bound + self.friction * pressure[points]
        slack[:count] -= normal[points[:count]]
        slack[count:] -= self._sign[count:] * tangential[points[count:]]
        return slack

    def slack_residual(self, y: Vector, s: Vector, size: Vector) -> Vector:
        """Residual (q,) of s less the slacks at y; 0 where it is rounding, which λ/s would amplify.

        In the sum of an upper and a lower bound the traction cancels: s₊ + s₋ = 2 bound. The residual of that sum is
        computed from s alone, so that it keeps its digits where a point opens and all its slacks are tiny.
        """
        count, pressed = self.count, self.pressed[self._upper]
        upper, lower = s[self._upper], s[self._upper.stop :]
        bound = self._constant_bound[self._upper] + self._bound_friction * s[pressed]
        if self.split.size:
            bound += self.friction_of(size)[self._upper]
        pair = upper + lower
        pair_rounding = 4.0 * _EPSILON * (pair + 2.0 * bound)
        # s_N + σ_N of normal bounds, (s₊ − s₋)/2 + σ_T of pairs.
        limit = self._rounding(y)[self._bounded_tractions]
        limit[count:] += pair_rounding
        from_s = np.concatenate([s[:count], 0.5 * (upper - lower)])
        difference = _above_rounding(from_s + self.tractions(y)[self._bounded_tractions], limit)
        mean = 0.5 * _above_rounding(pair - 2.0 * bound, pair_rounding) + self._bound_friction * difference[pressed]
        return np.concatenate([difference[:count], mean + difference[count:], mean - difference[count:]])

    def split_residual(self, y: Vector, difference: Vector) -> Vector:
        """σ_N (b,) at the points `split` less tension − pressure, `difference`; 0 where that is rounding."""
        if not self.split.size:
            return self._base_tractions[:0]
        return _above_rounding(self.split_normal(y) - difference, self._rounding(y)[self.split])

    def _rounding(self, y: Vector) -> Vector:
        """Error of (σ_N, σ_T) (2m,) that the rounding of y and of sums may cause."""
        rounding: Vector = _ROUNDINGS * _EPSILON * (self._base_sizes + self._row_sizes @ np.abs(y))
        return rounding

    def split_normal(self, y: Vector) -> Vector:
        """σ_N (b,) at the points `split`."""
        return np.asarray(self._base_tractions[self.split] + self.split_rows @ y)

    def friction_of(self, size: Vector) -> Vector:
        """The terms mu |σ_N| (q,) of the friction bounds of the points `split`, for |σ_N| (b,)."""
        values = np.zeros(len(self._points))
        values[self._split_bounds] = self.friction[self._split_bounds] * size[self._split_points]
        return values

    def change(self, y: Vector, slope: Vector) -> Vector:
        """C y = −ds (q,) for a change y of the coordinates, with the slope d|σ_N|/dσ_N (b,) at the points `split`."""
        tractions = self.T @ y
        change = self.signs * tractions[self.traction]
        change[self.coulomb] += self.friction[self.coulomb] * tractions[self.pressed[self.coulomb]]
        return change - self.friction_of(slope * (self.split_rows @ y)) if self.split.size else change

    def energy(self, y: Vector) -> float:
        """Energy of (D2) at y."""
        return self._energy + float(0.5 * y @ (self.S @ y) + self.c @ y)

    @cached_property
    def least_share(self) -> float:
        """The least weight of a bound over the sum of all in its contact, see `ContactMatrices`; 1 without bounds."""
        contact = self._qvi.contact.contacts[self._points]
        return float((self.weights / np.bincount(contact, self.weights)[contact]).min(initial=1.0))

    @cached_property
    def row_sizes(self) -> Vector:
        """W |T|² (t,)."""
        return np.asarray(self.W * (self.forces * self.forces).sum(axis=0))

    def force(self, multipliers: Vector) -> Vector:
        """BᵀWλ (k,), the forces of the multipliers λ (q,)."""
        force: Vector = self.forces @ (self.W * (self.signed @ multipliers))
        return force

    def blocks(self, ratio: Vector, slope: Vector) -> tuple[Vector, Vector]:
        """(D, e) (t,) with BᵀW diag(ratio) C = Tᵀ W (D T + e N), for the slope d|σ_N|/dσ_N (b,) at `split`."""
        D, e = self._summed @ ratio, self._friction_signed @ ratio
        if slope.size:
            e[self._split_shears] *= -slope
        return D, e

    def stiffness(self, D: Vector, e: Vector) -> Matrix:
        """Tᵀ W (D T + e N) (k, k), see `blocks`."""
        return dense(self.forces @ (scaled(self.W * D, self.T) + scaled(self.W * e, self.N)))

    def spread(self, D: Vector, e: Vector) -> Vector:
        """The blocks M_NN, M_TN, M_TT (3m,) of all contact points, [N; T]ᵀM[N; T] = BᵀW diag(ratio) C, from (D, e)."""
        parts, count = np.zeros((3, self._qvi.m)), self.count
        shears = self._points[count : len(D)]
        parts[0, self._points[:count]] = (self.W * D)[:count]
        parts[1, shears], parts[2, shears] = (self.W * e)[count:], (self.W * D)[count:]
        return parts.ravel()

    def bound_multipliers(self, m: Vector, slack: Vector) -> Vector:
        """λ (q,) of row multipliers (2m,); a friction bound and its cap share one, which goes to the smaller slack."""
        rows = self.signs * m[self._points + self._qvi.m * (self._sign != 0.0)]
        lam: Vector = np.maximum(rows, 0.0) / self.weights
        for side in (0, 1):
            bound, cap = self.bounds[(self.bounds[:, side + 2] >= 0)][:, [side, side + 2]].T
            farther = np.where(slack[bound] > slack[cap], bound, cap)
            lam[farther] = 0.0
        return lam

    def multipliers(self, u: Vector, lam: Vector) -> tuple[Vector, Vector, Vector]:
        """Row multipliers (m_N, m_T, ν) of (D2), from λ (q,) of the bounds and the equilibrium at u."""
        qvi, space = self._qvi, self._space
        m, y = self.weights * lam, self.full(u)
        is_normal = self._sign == 0.0
        m_N: Vector = np.zeros(qvi.m) + np.bincount(self._points[is_normal], m[is_normal], qvi.m)
        m_T: Vector = np.zeros(qvi.m) + np.bincount(self._points[~is_normal], (self._sign * m)[~is_normal], qvi.m)
        of_equations = space.multipliers(self._base, y)
        if of_equations is None:
            residual = self._base.c + space.stiffness @ y + space.E.T @ np.concatenate([m_N, m_T])
            of_equations = self._equations.multipliers(residual, qvi.m, qvi.p)
        return m_N, m_T + of_equations[1], of_equations[0]


def _above_rounding(values: Vector, rounding: Vector) -> Vector:
    """The values, with 0 in place of those within their rounding."""
    return np.where(np.abs(values) > rounding, values, 0.0)


class Equations:
    """Equations between trace coordinates, solved for some of them: y = y₀ + M u.

    The equations are A y = b, and σ_T = 0 at contact points whose friction bound is zero whatever the pressure: as
    bounds |σ_T| ≤ 0 they would have no interior. If the equations σ_T = 0 determine every coordinate in them, as on a
    contact without friction, these coordinates are known. Else linearly independent ones of their rows are added to A.
    A QR factorisation of A with pivoting then gives one coordinate for each row, its pivot, by the free coordinates u.

    Attributes
    ----------
    free : indices of the coordinates u
    map : M (k, u): unit rows for free coordinates, dense rows for pivots, zero rows for known coordinates

    """

    def __init__(self, space: Coordinates, weights: Vector) -> None:
        size, self._A, self._points = space.size, space.A, space.frictionless
        self._known: IntVector = np.zeros(0, dtype=np.int64)  # coordinates that σ_T = 0 determines
        self._equation_points = self._known  # points without friction whose rows are added to A
        if len(self._points):
            rows = csr_array(space.E[len(weights) + self._points])
            rows.data[np.abs(rows.data) < 1e-14 * np.abs(rows.data).max(initial=0.0)] = 0.0
            rows.eliminate_zeros()
            touched = np.unique(rows.indices).astype(np.int64)
            independent = basis(rows[:, touched]).rows
            if len(independent) < len(touched):
                self._equation_points = self._points[independent]
                self._A = np.vstack([self._A, rows[independent].toarray()])
            elif len(touched):
                self._known, self._weights, self._G = touched, weights[self._points], csc_array(rows[:, touched])
                self._normal = splu(csc_array(self._G.T @ diags_array(self._weights) @ self._G))
        is_unknown = np.ones(size, dtype=np.bool_)
        is_unknown[self._known] = False
        unknown = is_unknown.nonzero()[0]
        # Q R of the equations in the unknown coordinates; the first columns are pivots.
        rank, order, Q, R = 0, np.arange(len(unknown)), np.zeros((0, 0)), np.zeros((0, 0))
        if len(self._A):
            lengths = np.linalg.norm(self._A, axis=1)
            self._scale: Vector = 1.0 / np.where(lengths > 0.0, lengths, 1.0)
            factors: Any = qr(self._scale[:, None] * self._A[:, unknown], mode="economic", pivoting=True)
            Q, R, order = factors
            rank = int((np.abs(R.diagonal()) > LEAST_PIVOT).sum())
        self._Q, self._R = Q[:, :rank], R[:rank, :rank]
        self._pivots, free = unknown[order[:rank]], unknown[order[rank:]]
        self.free: IntVector = np.sort(free)
        # M: the identity for free coordinates, −R⁻¹R₂ for pivots.
        n_free, columns = len(free), np.arange(len(free))
        pivot_rows = np.zeros((rank, n_free))
        if rank:
            pivot_rows[:, np.searchsorted(self.free, free)] = -solve_triangular(self._R, R[:rank, rank:])
        shape, places = (size, n_free), (np.repeat(self._pivots, n_free), np.tile(columns, rank))
        identity = csr_array((np.ones(n_free), (self.free, columns)), shape)
        self.map: Rows = stored(identity + csr_array((pivot_rows.ravel(), places), shape))

    def offset(self, b: Vector, tangential: Vector) -> Vector:
        """y₀ (k,): the solution of A y = b and σ_T = 0 with u = 0, for the shear `tangential` (m,) at y = 0."""
        y = np.zeros(self.map.shape[0])
        if len(self._known):
            y[self._known] = self._normal.solve(-(self._G.T @ (self._weights * tangential[self._points])))
        if len(self._pivots):
            right = np.concatenate([b, -tangential[self._equation_points]]) - self._A @ y
            y[self._pivots] = solve_triangular(self._R, self._Q.T @ (self._scale * right))
        return y

    def quadratic(self, S: Matrix | SparseRows) -> Matrix | SparseRows:
        """MᵀSM (u, u); S may be sparse only if there are no equations."""
        free, pivots = self.free, self._pivots
        if len(free) == S.shape[0]:
            return S
        S = np.asarray(S)
        S_free = S[np.ix_(free, free)]
        if not len(pivots):
            return S_free
        pivot_rows = dense(self.map[pivots])
        mixed = S[np.ix_(free, pivots)] @ pivot_rows
        return np.asarray(S_free + mixed + mixed.T + pivot_rows.T @ (S[np.ix_(pivots, pivots)] @ pivot_rows))

    def multipliers(self, residual: Vector, count: int, p: int) -> tuple[Vector, Vector]:
        """ν (p,) and m_T (count,) of the points without friction, which balance the residual S y + c + Eᵀm (k,)."""
        nu, m_T = np.zeros(len(self._A)), np.zeros(count)
        if len(self._pivots):
            nu = self._scale * (self._Q @ solve_triangular(self._R, -residual[self._pivots], trans="T"))
        m_T[self._equation_points] = nu[p:]
        if len(self._known):
            forces = (residual + self._A.T @ nu)[self._known]
            m_T[self._points] = -self._weights * (self._G @ self._normal.solve(forces))
        return nu[:p], m_T
