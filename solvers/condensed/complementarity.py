"""Contact and friction as one mixed complementarity problem (D5) in trace coordinates y.

Slacks s are first the normal ones, s = −σ_N, then those of friction and of caps: upper bounds of σ_T, then lower ones.
The letter c stands for γ_y. At bilateral points with friction p = |σ_N| has a kink. There

    σ_N = pull − push,    p = pull + push,    pull ≥ 0,  push ≥ 0,  pull push = 0,

one more complementarity: slacks stay linear in all unknowns, and where pull push = δ²/4 is p = √(σ_N² + δ²). Points
whose bound is always zero give equations σ_T = 0. Equations are solved for some of the coordinates (`Equations`).

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
from solvers.condensed.systems import FRICTION_SHARES, SLOTS, Coordinates, Expansion, NewtonSystem, PathWeights
from solvers.inequality.problem import FrictionQVI
from solvers.inequality.rows import Rows, are_few, dense, echelon, largest, scaled

_EPSILON = float(np.finfo(np.float64).eps)
_TERMS = 16.0  # roundings of the size of a sum's terms that count as none
_FIRST = 1e-3  # the same of the stress at the start, before the first correction
_FILLED = 0.1  # share of rows without zeros from which sparse products take longer than dense ones


class Complementarity:
    """The problem about a base point, which `rebase` exchanges, in the coordinates u that equations leave free.

    Attributes
    ----------
    S : (k, k); c : (k,)
    T : (t, k) rows of the tractions that are bounded, σ_N first; forces : (k, t) Tᵀ, forces on them as such on y
    N : (t, k) rows of σ_N at the points of bounded σ_T, zero beside σ_N itself
    weights : (q,) W of each bound; W : (t,) of each traction
    early_shares, shares : (q,) what s λ is on the central path, relative, until slacks fit their tractions and after
    start : the least multiplier at the start, of the scale of displacement
    friction : (q,) mu where a bound depends on the pressure, else 0
    pressed : (q,) the normal bound of the pressure on which a bound depends, −1 without one
    coulomb : the bounds that depend on the pressure of a normal bound
    traction : (q,) the traction on which λ works; signs : (q,) the sign of its force
    signed : (t, q) sums values of the bounds of each traction with the signs of their forces
    bounds : (tractions, 4) the bounds of each traction by their place among `SLOTS`, −1 where it has no such bound
    count : number of normal bounds, and of normal tractions
    split : (b,) bilateral points whose bound depends on |σ_N|; split_rows : (b, k) rows of their σ_N
    sizes : (q,) what s may be relative to the tractions: 1 + mu for friction, else 1
    stress : scale of the tractions

    """

    def __init__(
        self,
        qvi: FrictionQVI,
        space: Coordinates,
        base: Expansion,
        stress: float,
        shares: PathWeights = FRICTION_SHARES[0],
    ) -> None:
        self._shares, self.start = shares, shares.start
        self._qvi, self._space, self.stress = qvi, space, stress
        self._equations = Equations(space, qvi.W)
        self._lay_out()
        self._lay_out_rows()
        self.S: Matrix | SparseRows = self._equations.quadratic(space.stiffness)
        self.system: NewtonSystem = space.system(self.S)
        self.rebase(base)

    def _lay_out(self) -> None:
        """Which bound belongs to which point and traction, and what is fixed of it."""
        qvi = self._qvi
        normal, friction = np.flatnonzero(~qvi.bilateral), np.flatnonzero(~qvi.frictionless)
        capped = friction[np.isfinite(qvi.cap[friction]) & (qvi.mu[friction] > 0.0)]
        parts = (normal, friction, capped, friction, capped)
        kind = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
        self._points: IntVector = np.concatenate(parts)
        self._sign: Vector = np.array([0.0, 1.0, 1.0, -1.0, -1.0])[kind]
        is_cap = np.array([False, False, True, False, True])[kind]
        places = np.full((2, qvi.m), -1)
        places[0, normal], places[1, friction] = np.split(np.arange(len(normal) + len(friction)), [len(normal)])
        self.traction: IntVector = places[np.where(self._sign == 0.0, 0, 1), self._points]
        self.bounds: IntVector = np.full((len(normal) + len(friction), len(SLOTS)), -1)
        self.bounds[self.traction, np.array([0, 0, 2, 1, 3])[kind]] = np.arange(len(self._points))
        mu, cohesion, limit = qvi.mu[self._points], qvi.cohesion[self._points], qvi.cap[self._points]
        rubs = (self._sign != 0.0) & ~is_cap & (mu > 0.0)
        self.pressed: IntVector = np.where(rubs, places[0, self._points], -1)
        self.coulomb: IntVector = np.flatnonzero(self.pressed >= 0)
        self.friction: Vector = np.where(rubs, mu, 0.0)
        self.signs: Vector = np.where(self._sign == 0.0, 1.0, self._sign)
        # Matrices (t, q) that sum values of the bounds of each traction: with signs, without, and times ± mu.
        entries = (self.signs, np.ones(len(self.signs)), self.signs * self.friction)
        self.signed, self._summed, self._rubbing = (self._summing(each) for each in entries)
        fixed = np.where(is_cap, limit, np.where(mu > 0.0, cohesion, np.minimum(cohesion, limit)))
        self._fixed: Vector = np.where(self._sign == 0.0, 0.0, fixed)
        self.count = count = len(normal)
        self._above = slice(count, (count + len(kind)) // 2)  # upper bounds; lower ones follow
        self._pressing: Vector = np.where(self.pressed >= 0, self.friction, 0.0)[self._above]  # μ of a normal bound
        self._limited: IntVector = self._points[: self._above.stop] + qvi.m * (kind > 0)[: self._above.stop]
        self.weights: Vector = qvi.W[self._points]
        self.W: Vector = self.weights[: len(self.bounds)]
        self.total_weight = float(self.weights.sum())
        self.sizes: Vector = np.where(is_cap | (self._sign == 0.0), 1.0, 1.0 + mu)
        early, late = self._shares.early, self._shares.late
        self.early_shares, self.shares = (np.where(self._sign == 0.0, 1.0, share) for share in (early, late))
        self.split: IntVector = np.flatnonzero(qvi.bilateral & (qvi.mu > 0.0) & ~qvi.frictionless)
        self.split_weights: Vector = qvi.W[self.split]
        self._rubs: IntVector = np.flatnonzero(rubs & qvi.bilateral[self._points])  # bounds of points in `split`
        self._splits: IntVector = np.searchsorted(self.split, self._points[self._rubs])  # which of them
        self._shears: IntVector = places[1, self.split]  # their tangential tractions

    def _summing(self, entries: Vector) -> Rows:
        """The matrix (t, q) with an entry for each bound in the row of its traction."""
        shape, columns = (len(self.bounds), len(entries)), np.arange(len(entries))
        if not are_few(*shape):
            return csr_array((entries, (self.traction, columns)), shape)
        matrix = np.zeros(shape)
        matrix[self.traction, columns] = entries
        return matrix

    def _lay_out_rows(self) -> None:
        """Rows of tractions and bounds in the coordinates that are free."""
        E, m, count = self._space.E, self._qvi.m, self.count
        whole = len(self._equations.free) == self._space.size
        self._all: Rows = E if whole else E @ self._equations.map
        self._all_sizes: Any = abs(self._all)
        normal, shears = self._points[:count], self._points[count : len(self.bounds)]
        self.T: Rows = self._all[np.concatenate([normal, m + shears])]
        self.N: Rows = scaled(np.repeat([0.0, 1.0], [count, len(shears)]), self._all[np.concatenate([normal, shears])])
        self.forces: Rows = self._space.forces(self.T)
        self.split_rows: Rows = self._all[self.split]

    def rebase(self, base: Expansion) -> None:
        """Pose the problem about another point; u = 0 there, up to what equations had missed."""
        space = self._space
        self._moved = bool(base.z.any())
        _, self._in_body, self._nothing = body_scales(self._qvi, base.strain_energy) if self._moved else (0.0, 0.0, 0.0)
        self._base = base
        self._offset: Vector = self._equations.offset(base.equality[: len(space.A)], base.tractions[self._qvi.m :])
        half = base.c + 0.5 * (space.stiffness @ self._offset)
        self._energy = base.energy + float(half @ self._offset)
        self.c: Vector = self._equations.map.T @ (base.c + space.stiffness @ self._offset)
        self._at_zero = base.tractions + space.E @ self._offset
        self._base_sizes = np.abs(self._at_zero)
        self._last: tuple[Vector | None, Vector] = (None, self._at_zero)

    def full(self, u: Vector) -> Vector:
        """All trace coordinates y."""
        return np.asarray(self._offset + self._equations.map @ u)

    def restricted(self, y: Vector) -> Vector:
        """The free ones of all trace coordinates."""
        return y[self._equations.free]

    def tractions(self, y: Vector) -> Vector:
        """(σ_N, σ_T) (2m,), kept for the last y: an iteration asks for them several times."""
        if self._last[0] is not y:
            self._last = (y, self._at_zero + self._all @ y)
        return self._last[1]

    def contradiction(self) -> float:
        """Largest shear at points without friction, over the scale of stress: what equations cannot make zero."""
        return float(np.abs(self._at_zero[self._qvi.m :][self._qvi.frictionless]).max(initial=0.0)) / self.stress

    def stress_at(self, y: Vector) -> float:
        """Max |σ_N|, |σ_T|; where the contact carries nothing that of the body, as `certificate` does."""
        found = largest(self.tractions(y))
        if not self._moved:  # nothing is known of the body yet
            return max(found, _FIRST * self.stress)
        return found if found > self._nothing else self._in_body

    def slack(self, y: Vector, size: Vector) -> Vector:
        """Slacks s (q,) for coordinates y and |σ_N| (b,) at the points `split`."""
        points, count = self._points, self.count
        normal, tangential = np.split(self.tractions(y), 2)
        pressure = -normal
        pressure[self.split] = size
        slack = self._fixed + self.friction * pressure[points]
        slack[:count] -= normal[points[:count]]
        slack[count:] -= self._sign[count:] * tangential[points[count:]]
        return slack

    def slack_residual(self, y: Vector, s: Vector, size: Vector) -> Vector:
        """What s (q,) differs from the slacks, with zeros where it is rounding: λ/s would make much of it.

        Two bounds on either side of a traction have a sum in which the tractions cancel. It is taken from the slacks
        themselves, so that it keeps its digits where a point opens and all its slacks are tiny.
        """
        count, pressed = self.count, self.pressed[self._above]
        above, below = s[self._above], s[self._above.stop :]
        bound = self._fixed[self._above] + self._pressing * s[pressed]
        if self.split.size:
            bound += self.friction_of(size)[self._above]
        sum_ = above + below
        both = 4.0 * _EPSILON * (sum_ + 2.0 * bound)
        limit = self._rounding(y)[self._limited]
        limit[count:] += both
        found = _beyond(np.concatenate([s[:count], 0.5 * (above - below)]) + self.tractions(y)[self._limited], limit)
        mean = 0.5 * _beyond(sum_ - 2.0 * bound, both) + self._pressing * found[pressed]
        return np.concatenate([found[:count], mean + found[count:], mean - found[count:]])

    def split_residual(self, y: Vector, difference: Vector) -> Vector:
        """σ_N (b,) at the points `split` less the difference of pull and push, with zeros where it is rounding."""
        if not self.split.size:
            return self._at_zero[:0]
        return _beyond(self.split_normal(y) - difference, self._rounding(y)[self.split])

    def _rounding(self, y: Vector) -> Vector:
        """What the rounding of y and of sums may change of (σ_N, σ_T) (2m,)."""
        rounding: Vector = _TERMS * _EPSILON * (self._base_sizes + self._all_sizes @ np.abs(y))
        return rounding

    def split_normal(self, y: Vector) -> Vector:
        """σ_N (b,) at the points `split`."""
        return np.asarray(self._at_zero[self.split] + self.split_rows @ y)

    def friction_of(self, size: Vector) -> Vector:
        """What |σ_N| (b,) of the points `split` adds to the bounds (q,) in which it appears."""
        values = np.zeros(len(self._points))
        values[self._rubs] = self.friction[self._rubs] * size[self._splits]
        return values

    def change(self, y: Vector, slope: Vector) -> Vector:
        """C y = −ds (q,) for a change of y, with the slope d|σ_N|/dσ_N (b,) at the points `split`."""
        tractions = self.T @ y
        change = self.signs * tractions[self.traction]
        change[self.coulomb] += self.friction[self.coulomb] * tractions[self.pressed[self.coulomb]]
        return change - self.friction_of(slope * (self.split_rows @ y)) if self.split.size else change

    def energy(self, y: Vector) -> float:
        """Of (D2), with what the base lacks in accuracy."""
        return self._energy + float(0.5 * y @ (self.S @ y) + self.c @ y)

    @cached_property
    def least_share(self) -> float:
        """The least weight of a bound over the sum of those in its contact, see `ContactMatrices`; 1 with none."""
        contact = self._qvi.contact.contacts[self._points]
        return float((self.weights / np.bincount(contact, self.weights)[contact]).min(initial=1.0))

    @cached_property
    def dense_rows(self) -> tuple[Matrix, Matrix, Vector]:
        """T and N as dense arrays, and W |T|² (t,)."""
        T = dense(self.T)
        return T, dense(self.N), np.asarray(self.W * (T * T).sum(axis=1))

    def force(self, multipliers: Vector) -> Vector:
        """BᵀWλ (k,)."""
        force: Vector = self.forces @ (self.W * (self.signed @ multipliers))
        return force

    def blocks(self, ratio: Vector, slope: Vector) -> tuple[Vector, Vector]:
        """(D, e) (t,) with BᵀW diag(ratio) C = Tᵀ W (D T + e N), with the slope d|σ_N|/dσ_N (b,) at `split`."""
        D, e = self._summed @ ratio, self._rubbing @ ratio
        if slope.size:
            e[self._shears] *= -slope
        return D, e

    def stiffness(self, D: Vector, e: Vector) -> Matrix:
        """Tᵀ W (D T + e N) (k, k), see `blocks`."""
        return dense(self.forces @ (scaled(self.W * D, self.T) + scaled(self.W * e, self.N)))

    def spread(self, D: Vector, e: Vector) -> Vector:
        """The blocks by contact point (3m,): M_NN, M_TN, M_TT of [N; T]ᵀM[N; T] = BᵀW diag(ratio) C."""
        parts, count = np.zeros((3, self._qvi.m)), self.count
        shears = self._points[count : len(D)]
        parts[0, self._points[:count]] = (self.W * D)[:count]
        parts[1, shears], parts[2, shears] = (self.W * e)[count:], (self.W * D)[count:]
        return parts.ravel()

    def bound_multipliers(self, m: Vector, slack: Vector) -> Vector:
        """λ (q,) of row multipliers (2m,); of friction bound and cap that with the smaller slack (q,) has it."""
        rows = self.signs * m[self._points + self._qvi.m * (self._sign != 0.0)]
        lam: Vector = np.maximum(rows, 0.0) / self.weights
        for side in (0, 1):
            bound, cap = self.bounds[(self.bounds[:, side + 2] >= 0)][:, [side, side + 2]].T
            farther = np.where(slack[bound] > slack[cap], bound, cap)
            lam[farther] = 0.0
        return lam

    def multipliers(self, u: Vector, lam: Vector) -> tuple[Vector, Vector, Vector]:
        """Row multipliers (m_N, m_T, ν) of (D2)."""
        qvi, space = self._qvi, self._space
        rows, y = self.weights * lam, self.full(u)
        normal = self._sign == 0.0
        m_N: Vector = np.zeros(qvi.m) + np.bincount(self._points[normal], rows[normal], qvi.m)
        m_T: Vector = np.zeros(qvi.m) + np.bincount(self._points[~normal], (self._sign * rows)[~normal], qvi.m)
        found = space.multipliers(self._base, y)
        if found is None:
            residual = self._base.c + space.stiffness @ y + space.E.T @ np.concatenate([m_N, m_T])
            found = self._equations.multipliers(residual, qvi.m, qvi.p)
        return m_N, m_T + found[1], found[0]


def _beyond(values: Vector, rounding: Vector) -> Vector:
    """The values, 0 where they are rounding."""
    return np.where(np.abs(values) > rounding, values, 0.0)


_DEPENDENT = 1e-10  # rows of A, scaled to length one, that are shorter than this beside the others repeat them


class Equations:
    """Equations between trace coordinates, solved for some of them: y = y₀ + M u.

    They are A y = b, and σ_T = 0 at contact points whose friction bound is zero whatever the pressure: as bounds
    |σ_T| ≤ 0 they would have no interior. Where the latter fix every coordinate that they touch, as on a contact
    without friction, those are known; else independent ones of the rows become equations beside A. Each of these gives
    one coordinate, a pivot of a QR factorisation, by those that are left, u.

    Attributes
    ----------
    free : the coordinates u
    map : M (k, u): unit rows for the free coordinates, dense ones for the pivots, none for those that are known

    """

    def __init__(self, space: Coordinates, weights: Vector) -> None:
        size, self._A, self._points = space.size, space.A, space.frictionless
        self._fixed: IntVector = np.zeros(0, dtype=np.int64)  # coordinates that points without friction determine
        self._kept = self._fixed  # those of the points whose rows become equations
        if len(self._points):
            rows = csr_array(space.E[len(weights) + self._points])
            rows.data[np.abs(rows.data) < 1e-14 * np.abs(rows.data).max(initial=0.0)] = 0.0
            rows.eliminate_zeros()
            touched = np.unique(rows.indices).astype(np.int64)
            chosen = echelon(rows[:, touched]).rows
            if len(chosen) < len(touched):
                self._kept, self._A = self._points[chosen], np.vstack([self._A, rows[chosen].toarray()])
            elif len(touched):
                self._fixed, self._weights, self._G = touched, weights[self._points], csc_array(rows[:, touched])
                self._normal = splu(csc_array(self._G.T @ diags_array(self._weights) @ self._G))
        left = np.ones(size, dtype=np.bool_)
        left[self._fixed] = False
        unknown = left.nonzero()[0]
        rank, order, Q, R = 0, np.arange(len(unknown)), np.zeros((0, 0)), np.zeros((0, 0))
        if len(self._A):
            lengths = np.linalg.norm(self._A, axis=1)
            self._scale: Vector = 1.0 / np.where(lengths > 0.0, lengths, 1.0)
            found: Any = qr(self._scale[:, None] * self._A[:, unknown], mode="economic", pivoting=True)
            Q, R, order = found
            rank = int((np.abs(R.diagonal()) > _DEPENDENT).sum())
        self._Q, self._R = Q[:, :rank], R[:rank, :rank]
        self._pivots, rest = unknown[order[:rank]], unknown[order[rank:]]
        self.free: IntVector = np.sort(rest)
        columns = np.arange(len(rest))
        tail = np.zeros((rank, len(rest)))
        if rank:
            tail[:, np.searchsorted(self.free, rest)] = -solve_triangular(self._R, R[:rank, rank:])
        if are_few(size, len(rest)) or rank > _FILLED * size:
            self.map: Rows = np.zeros((size, len(rest)))
            self.map[self.free, columns] = 1.0
            self.map[self._pivots] = tail
        else:
            shape, places = (size, len(rest)), (np.repeat(self._pivots, len(rest)), np.tile(columns, rank))
            identity = csr_array((np.ones(len(rest)), (self.free, columns)), shape)
            self.map = csr_array(identity + csr_array((tail.ravel(), places), shape))

    def offset(self, b: Vector, tangential: Vector) -> Vector:
        """y₀ (k,): the solution of A y = b and σ_T = 0 with u = 0; b without, tangential (m,) the shear at y = 0."""
        y = np.zeros(self.map.shape[0])
        if len(self._fixed):
            y[self._fixed] = self._normal.solve(-(self._G.T @ (self._weights * tangential[self._points])))
        if len(self._pivots):
            right = np.concatenate([b, -tangential[self._kept]]) - self._A @ y
            y[self._pivots] = solve_triangular(self._R, self._Q.T @ (self._scale * right))
        return y

    def quadratic(self, S: Matrix | SparseRows) -> Matrix | SparseRows:
        """MᵀSM (u, u); sparse only where there are no equations."""
        free, pivots = self.free, self._pivots
        if len(free) == S.shape[0]:
            return S
        S = np.asarray(S)
        inner = S[np.ix_(free, free)]
        if not len(pivots):
            return inner
        tail = dense(self.map[pivots])
        mixed = S[np.ix_(free, pivots)] @ tail
        return np.asarray(inner + mixed + mixed.T + tail.T @ (S[np.ix_(pivots, pivots)] @ tail))

    def multipliers(self, residual: Vector, count: int, p: int) -> tuple[Vector, Vector]:
        """(ν (p,), m_T (count,) of points without friction) that balance the residual (k,) of S y + c + Eᵀm."""
        nu, m_T = np.zeros(len(self._A)), np.zeros(count)
        if len(self._pivots):
            nu = self._scale * (self._Q @ solve_triangular(self._R, -residual[self._pivots], trans="T"))
        m_T[self._kept] = nu[p:]
        if len(self._fixed):
            forces = (residual + self._A.T @ nu)[self._fixed]
            m_T[self._points] = -self._weights * (self._G @ self._normal.solve(forces))
        return nu[:p], m_T
