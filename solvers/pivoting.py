"""The whole inequality as one linear complementarity problem on the contact, solved by pivoting.

With the compliance C of the contact (`Compliance`) and multipliers m = F x, x ≥ 0, tractions are σ = σ_bonded − C m,
and every bound is a row of w = limit − H σ ≥ 0 with xᵀw = 0:

    normal      w = −σ_N                                           x = m_N               unilateral points
    friction    w = cohesion ± sign(σ_N) mu σ_N ∓ σ_T, two rows     x = m_T⁺, m_T⁻        points that may slip
    cap         w = cap ∓ σ_T, two rows                            x, more of m_T        where the cap is finite

so that w = q + M x with q = limit − H σ_bonded, M = H C F: no outer iteration, since |σ_N| = −σ_N is linear. At
bilateral points with friction the sign of σ_N is guessed, and guessed again from the solution until it stays.

A vertex is exact where an interior point method has no interior to go through: where contact touches without load,
where equilibrium alone says that a contact carries nothing, where only one traction is admissible. It takes about as
many pivots of a dense table as there are points that slip or open. So it is the first thing that is tried on small
contacts (`LARGEST`), from the state that is given if there is one. With much friction the path may end in a ray though
there is a solution; after the condensed method other directions d are tried, on larger contacts too (`LARGEST_LATE`):
thin wedges that are all slip cost an interior point method its last digits.

| stops when                                          | status before the certificate |
|-----------------------------------------------------|-------------------------------|
| the certificate passes                              | solved                        |
| all directions end in rays, or in what it refuses   | stalled                       |
| `max_iterations` vertices are found along one       | max_iterations                |
| the time is over                                    | time_limit                    |
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import lstsq
from scipy.linalg.blas import dger

from solvers.basics.progress import Progress, deadline, report
from solvers.basics.status import Status
from solvers.basics.types import BoolVector, IntVector, Matrix, Vector
from solvers.inequality.problem import Compliance, FrictionQVI
from solvers.settings import PivotingOptions
from solvers.solution import Iteration, Outcome, Start

LARGEST: Final = 200
"""Contact points up to which it comes first: a table of 600 rows."""

LARGEST_LATE: Final = 800
"""Up to which it is tried where the condensed method has not found the answer, which takes some seconds."""

DIRECTIONS: Final = 4
"""How many paths there are to try."""

_SIGNS = 6  # guesses of the signs of bilateral points
_POLISHING = 4  # corrections of a vertex
_EXACT = 1e-5  # of the tolerance: error of bounds, over the largest bonded traction, that is not worth a correction
_BOTH_ZERO = 1e-9  # of the units of tractions and displacements
_SOUND = 1e-8  # the same, above which the path from a state is not taken
_RANK = 1e-11  # singular values of active rows below this share of the largest are none


class ContactBounds:
    """The linear complementarity problem of a QVI for signs (m,) of σ_N, in units of the bonded tractions.

    Attributes
    ----------
    M, q : (r, r), (r,) of w = q + M x
    stress : the largest bonded traction, with w = (limit − H σ) / stress

    """

    def __init__(self, qvi: FrictionQVI, compliance: Compliance, signs: Vector) -> None:
        m, law, every = qvi.m, qvi.law, np.arange(qvi.m)
        normal, capped = (~qvi.bilateral).nonzero()[0], np.isfinite(law.cap).nonzero()[0]
        unpressed, none = np.zeros(len(normal)), np.zeros(len(capped))
        rubbed, mu = -law.mu * signs, law.mu
        # a row of H has `side` at the traction `place`, and `by_normal` at σ_N of its point
        point = np.concatenate([normal, every, capped, every, capped])
        sides = np.ones(len(normal)), np.ones(m + len(capped)), -np.ones(m + len(capped))
        self._side, self._by_normal = np.concatenate(sides), np.concatenate([unpressed, rubbed, none, rubbed, none])
        self._point, self._place = point, np.concatenate([normal, m + point[len(normal) :]])
        self._size = 1.0 / (1.0 + np.concatenate([unpressed, mu, none, mu, none]))
        limit = np.concatenate([unpressed, law.cohesion, law.cap[capped], law.cohesion, law.cap[capped]])
        self._limit = self._size * limit
        self.stress = float(np.maximum.reduce(np.abs(compliance.bonded), initial=0.0)) or 1.0
        unit = self.stress / (qvi.contact_stiffness or 1.0)
        self._relief, self._rows = unit * self._side * qvi.W[point], 2 * m  # F has one entry in a column
        relieved = compliance.dense[:, self._place] * self._relief
        self.M = self._bounded(relieved.T).T / self.stress
        self.q = self.slack(compliance.bonded)

    def _bounded(self, tractions: Matrix) -> Matrix:
        """H σ (r,) of tractions (2m,), or of many, one a row."""
        places = self._side * tractions[..., self._place] + self._by_normal * tractions[..., self._point]
        return np.asarray(self._size * places)

    def slack(self, tractions: Vector) -> Vector:
        """The slack w (r,) at tractions (2m,)."""
        return np.asarray((self._limit - self._bounded(tractions)) / self.stress)

    def multipliers(self, x: Vector) -> Vector:
        """Row multipliers m = F x (2m,)."""
        return np.bincount(self._place, self._relief * x, self._rows).astype(np.float64, copy=False)

    def active(self, tractions: Vector, m: Vector) -> BoolVector:
        """Rows (r,) whose multiplier is larger than their slack at a state; not those where both are rounding.

        Of the two that share a multiplier, friction and cap, that with the smaller slack.
        """
        slack, least = self.slack(tractions), np.full(2 * self._rows, np.inf)
        shared = np.where(self._side > 0.0, self._place, self._place + self._rows)
        np.minimum.at(least, shared, slack)
        return np.asarray((m[self._place] / self._relief > slack + _BOTH_ZERO) & (slack <= least[shared]))

    def corrected(
        self, compliance: Compliance, vertex: Vertex, tolerance: float
    ) -> tuple[tuple[Vector, Vector, Vector, Vector], float]:
        """(z, m_N, m_T, ν) of a vertex, corrected by what active bounds miss as accurate stresses say; what they miss.

        What they miss is over the largest bonded traction.
        """
        x, active = vertex.x, vertex.basic
        found = state = compliance.state(self.multipliers(x))
        least = np.inf
        for left in reversed(range(_POLISHING + 1)):
            missed = self.slack(compliance.qvi.tractions(state[0]))
            error = max(float(np.abs(missed[active]).max(initial=0.0)), -float(missed.min(initial=0.0)))
            before = least
            if error < least:
                found, least = state, error
            if not left or not _EXACT * tolerance < error < 0.5 * before:
                break
            x = x.copy()
            own = self.M[np.ix_(active, active)]
            x[active] -= lstsq(own, missed[active], cond=_RANK, lapack_driver="gelsy")[0]
            x = np.maximum(x, 0.0)
            state = compliance.state(self.multipliers(x))
        return found, least


def affordable(qvi: FrictionQVI, most: int = LARGEST) -> bool:
    """Whether the contact is small enough."""
    return 0 < qvi.m <= most and qvi.n > 0


def solve_pivoting(
    qvi: FrictionQVI, tolerance: float, options: PivotingOptions, direction: int = 0, start: Start | None = None
) -> Outcome:
    """The vertex at the end of one path, from a state that fits or from no multipliers at all.

    Entries of the direction d are all alike first, then without any pattern. Where the path from a state ends in a ray
    the other one is taken. An iteration is a vertex for guessed signs of bilateral points, its inner ones are pivots.
    """
    began = time.perf_counter()
    compliance = Compliance(qvi)
    best = Outcome.nothing(qvi, Status.STALLED, _ENDS[Status.STALLED])
    best.near, best.form, best.setup = (None if start is None else False), "condensed", time.perf_counter() - began
    guessed = qvi.bilateral & (qvi.mu > 0.0)
    normal = compliance.bonded[: qvi.m] if start is None else qvi.normal(start.z)
    for _ in range(_SIGNS):
        signs = np.where(guessed & (normal > 0.0), 1.0, -1.0)
        bounds = ContactBounds(qvi, compliance, signs)
        n = len(bounds.q)
        d = 0.2 + np.random.default_rng(direction).random(n) if direction else np.ones(n)
        starts = [] if start is None else [bounds.active(qvi.tractions(start.z), start.multipliers)]
        for active in (*starts, None):
            vertex = solve_lcp(bounds.M, bounds.q, d, active)
            state, missed = bounds.corrected(compliance, vertex, tolerance) if vertex.solved else (None, np.inf)
            if missed <= _SOUND:
                best.near = None if start is None else active is not None
                break
        best.reason, best.message = vertex.reason, _ENDS.get(vertex.reason, "")
        if state is None:
            break
        best.z, best.m_N, best.m_T, best.nu = state
        best.iterations += 1
        entry = Iteration(
            best.iterations, missed, qvi.energy(best.z), qvi.resultant(best.z), None, vertex.pivots,
            time.perf_counter() - began,
        )  # fmt: skip
        best.history.append(entry)
        report(Progress("pivoting", entry))
        normal = qvi.normal(best.z)
        if best.iterations >= options.max_iterations:
            best.reason = Status.MAX_ITERATIONS
            break
        if (signs[guessed] == np.where(normal[guessed] > 0.0, 1.0, -1.0)).all():
            break
    return best


_ENDS = {
    Status.STALLED: "the path of pivots ends in a ray",
    Status.TIME_LIMIT: "the time limit was reached on the path of pivots",
}


# Linear complementarity by pivoting: x ≥ 0, w = q + M x ≥ 0, xᵀw = 0.
#
# Lemke's method (C. E. Lemke, Management Science 11, 1965; R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear
# Complementarity Problem, section 4.4) follows the solutions of w = q + d θ + M x, d > 0, from θ so large that x = 0
# down to θ = 0. Each pivot goes along one edge of that path. It ends at a solution, or in a ray on which x grows
# without end.


_PIVOT = 1e-9  # share of its column's largest entry below which an entry is rounding
_TIE = 1e-10  # relative difference of steps that count as equal
_ROUNDED = 1e-13  # share of the largest q, or of 1, below which one that is missed is none
_GONE = 1e-10  # the same of θ, whose end is corrected
_PIVOTS = 20  # pivots at most, times the number of unknowns


@dataclass(frozen=True, eq=False)
class Vertex:
    """Where the path has ended."""

    x: Vector  # (n,) ≥ 0; of no use unless it is solved
    basic: BoolVector  # (n,) bool, where x may be positive, w zero
    pivots: int  # how many it took
    reason: Status = Status.SOLVED  # or stalled in a ray, or what was over

    @property
    def solved(self) -> bool:
        """Whether it is a solution."""
        return self.reason is Status.SOLVED


def solve_lcp(M: Matrix, q: Vector, d: Vector, active: BoolVector | None = None) -> Vertex:
    """A solution of the problem of this module, (n, n), (n,) and (n,) > 0, if the path has one.

    With `active` (n,) bool the path begins where w = 0 there and x = 0 elsewhere: it is that of the problem with x and
    w exchanged there (section 2.3 there).
    """
    n = len(q)
    if active is not None and active.any():
        return _from_active(M, q, d, active)
    x, basic = np.zeros(n), np.zeros(n, dtype=bool)
    largest = max(1.0, float(np.maximum.reduce(np.abs(q), initial=0.0)))
    if q.min(initial=0.0) >= -_ROUNDED * largest:
        return Vertex(x, basic, 0)
    # basic + table @ non-basic = values; w are the variables 0 to n − 1, x those up to 2n − 1, θ is 2n
    table: Matrix = np.empty((n, n + 2), order="F")
    np.negative(M, out=table[:, :n])
    table[:, n], table[:, -1] = -d, q
    basis, column = np.arange(n), np.arange(-n, n + 1)  # of rows; where a variable that is not basic stands
    row, entering = int(np.argmin(q / d)), 2 * n
    for pivots in range(1, _PIVOTS * n):
        if deadline.over:
            return Vertex(x, basic, pivots, Status.TIME_LIMIT)
        # The row is solved for the entering variable, which is eliminated from all others.
        place = column[entering]
        factors, pivot = table[:, place].copy(), table[row, place]
        table[:, place] = 0.0
        solved = table[row] / pivot
        solved[place] = 1.0 / pivot
        factors[row] = 0.0
        table = dger(-1.0, factors, solved, a=table, overwrite_a=1)
        table[row] = solved
        leaving, basis[row] = int(basis[row]), entering
        column[leaving] = place
        found = None
        if leaving < 2 * n:
            entering = leaving + n if leaving < n else leaving - n
            found = _leaving_row(table[:, column[entering]], table[:, -1], basis)
        if found is None:  # θ is zero, or a ray begins; one where θ is rounding does so at a solution
            rows = (basis >= n).nonzero()[0]
            reached = leaving == 2 * n or table[basis == 2 * n, -1].max() <= _GONE * largest
            rows = rows[basis[rows] < 2 * n]
            x[basis[rows] - n] = np.maximum(table[rows, -1], 0.0)
            basic[basis[rows] - n] = True
            return Vertex(x, basic, pivots, Status.SOLVED if reached else Status.STALLED)
        row = found
    return Vertex(x, basic, pivots, Status.STALLED)


def _from_active(M: Matrix, q: Vector, d: Vector, active: BoolVector) -> Vertex:
    """The path of the problem with x and w exchanged where `active`."""
    order = np.concatenate([np.flatnonzero(active), np.flatnonzero(~active)])
    exchanged, values = M[order][:, order], q[order]
    own, rest = slice(np.count_nonzero(active)), slice(np.count_nonzero(active), None)
    try:
        inverse = np.linalg.inv(exchanged[own, own])
    except np.linalg.LinAlgError:
        return Vertex(np.zeros(len(q)), active, 0, Status.STALLED)
    values[own] = -inverse @ values[own]
    values[rest] += exchanged[rest, own] @ values[own]
    across = -inverse @ exchanged[own, rest]
    exchanged[rest, rest] += exchanged[rest, own] @ across
    exchanged[rest, own] = exchanged[rest, own] @ inverse
    exchanged[own, own], exchanged[own, rest] = inverse, across
    found = solve_lcp(exchanged, values, d)
    x, basic = np.empty(len(q)), np.empty(len(q), dtype=bool)
    x[order[own]] = np.maximum(values[own] + exchanged[own] @ found.x, 0.0)
    x[order[rest]] = found.x[rest]
    basic[order] = found.basic
    return Vertex(x, basic ^ active, found.pivots, found.reason)


def _leaving_row(column: Vector, values: Vector, basis: IntVector) -> int | None:
    """The basic variable that reaches zero first, θ before others and large pivots before small; none: a ray."""
    falls = column > _PIVOT * max(1.0, float(np.maximum.reduce(np.abs(column))))
    steps = np.full(len(column), np.inf)
    np.divide(np.maximum(values, 0.0), column, out=steps, where=falls)
    least = float(np.minimum.reduce(steps))
    if least == np.inf:
        return None
    tied = (steps <= least + _TIE * max(least, 1e-4)).nonzero()[0]
    if len(tied) == 1:
        return int(tied[0])
    last = tied[basis[tied] == 2 * len(basis)]
    return int(last[0]) if len(last) else int(tied[np.argmax(column[tied])])
