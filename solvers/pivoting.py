"""The whole inequality as one linear complementarity problem on the contact, solved by pivoting.

With the compliance C of the contact (`Compliance`) and multipliers m = F x, x ≥ 0, tractions are σ = σ_bonded − C m,
and every bound is a row of the slacks w = limit − H σ ≥ 0, with xᵀw = 0:

    normal      w = −σ_N                                           x = m_N               unilateral points
    friction    w = cohesion ± sign(σ_N) mu σ_N ∓ σ_T, two rows     x = m_T⁺, m_T⁻        points that may slip
    cap         w = cap ∓ σ_T, two rows                            x, added to m_T±      where the cap is finite

so that w = q + M x with q = limit − H σ_bonded, M = H C F. There is no outer iteration, since |σ_N| = −σ_N is linear.
At bilateral points with friction the sign of σ_N is guessed, and guessed again from the solution until it stays.

A vertex is exact even if the admissible set has no interior, which an interior point method needs: a contact touches
without pressure, equilibrium alone excludes any pressure, or only one traction is admissible. The number of pivots of a
dense table is about that of the points that slip or open. So pivoting comes first on small contacts (`LARGEST`), and
starts from the state `initial` if it is given. With large friction the path may end in a ray although there is a
solution. On larger contacts, up to `LARGEST_LATE`, it follows a condensed method that failed: for thin wedges that slip
all over an interior point method loses its last digits.

| stops when                                            | status before the certificate |
|-------------------------------------------------------|-------------------------------|
| the certificate passes                                | solved                        |
| the path ends in a ray, or the certificate fails      | stalled                       |
| `max_iterations` vertices are found                   | max_iterations                |
| the time is over                                      | time_limit                    |
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np
from scipy.linalg import lstsq
from scipy.linalg.blas import dger
from scipy.linalg.lapack import dgetrf, dgetri, dgetrs

from solvers.basics.progress import Progress, deadline, report
from solvers.basics.status import Status
from solvers.basics.types import BoolVector, IntVector, Matrix, Vector
from solvers.inequality.problem import Compliance, FrictionQVI
from solvers.inequality.rows import largest, most
from solvers.settings import PivotingOptions
from solvers.solution import Iteration, Outcome, Start

LARGEST: Final = 200
"""Contact points up to which pivoting is the first method: a table of 600 rows."""

LARGEST_LATE: Final = 800
"""Contact points up to which pivoting follows a condensed method that failed; it then takes some seconds."""

_MOST_GUESSES = 6  # guesses of the signs of σ_N at bilateral points
_MOST_CORRECTIONS = 4  # corrections of a vertex
_LEAST_ERROR = 1e-5  # error of a vertex, over the tolerance, that is not worth correcting
_LEAST_ACTIVE = 1e-9  # difference of x and w, in units of displacement and traction, above which a row is active
_LARGEST_ERROR = 1e-8  # error of a vertex, over the bonded traction, above which the path from a state is not taken
_RANK = 1e-11  # singular values of active rows below this share of the largest are zero


State: TypeAlias = tuple[Vector, Vector, Vector, Vector]
"""(z, m_N, m_T, ν)"""


class ContactBounds:
    """The linear complementarity problem w = q + M x, M (r, r), q (r,), of a QVI for signs (m,) of σ_N.

    It is dimensionless: w = (limit − H σ) / stress, with the largest bonded traction as `stress`.
    """

    def __init__(self, qvi: FrictionQVI, compliance: Compliance, signs: Vector) -> None:
        m, law = qvi.m, qvi.law
        normal, capped = (~law.bilateral).nonzero()[0], np.isfinite(law.cap).nonzero()[0]
        # Rows of normal bounds, then of friction and caps above, then of friction and caps below. A row of H has the
        # entry `side` at its `traction`, and −mu sign(σ_N) at σ_N of its `point`; rows are divided by 1 + mu.
        shear, above = np.concatenate([np.arange(m), capped]), len(normal)
        self._point = point = np.concatenate([normal, shear, shear])
        self._traction = traction = point.copy()
        traction[above:] += m
        below = above + len(shear)
        side, mu, limit = np.ones(len(point)), np.zeros(len(point)), np.zeros(len(point))
        side[below:] = -1.0
        for first in (above, below):
            mu[first : first + m], limit[first : first + m] = law.mu, law.cohesion
            limit[first + m : first + len(shear)] = law.cap[capped]
        size = 1.0 / (1.0 + mu)
        self._side, self._by_side, self._by_normal = side, size * side, -size * mu * signs[point]
        self._limit = size * limit
        self.stress = largest(compliance.bonded) or 1.0
        unit = self.stress / (qvi.contact_stiffness or 1.0)
        self._relief_entries, self._n_tractions = unit * side * qvi.W[point], 2 * m  # F has one entry per column
        C = compliance.dense
        bounded = self._by_side[:, None] * C[traction] + self._by_normal[:, None] * C[point]  # H C
        self.M = bounded.take(traction, axis=1) * (self._relief_entries / self.stress)
        self.q = self.slack(compliance.bonded)

    def slack(self, tractions: Vector) -> Vector:
        """The slack w (r,) at tractions (2m,)."""
        bounded = self._by_side * tractions[self._traction] + self._by_normal * tractions[self._point]
        return np.asarray((self._limit - bounded) / self.stress)

    def multipliers(self, x: Vector) -> Vector:
        """Row multipliers m = F x (2m,)."""
        return np.bincount(self._traction, self._relief_entries * x, self._n_tractions).astype(np.float64, copy=False)

    def active(self, tractions: Vector, m: Vector) -> BoolVector:
        """Rows (r,) bool whose multiplier exceeds their slack at a state, by more than rounding.

        A friction row and its cap share a multiplier; the one with the smaller slack is active.
        """
        slack, least = self.slack(tractions), np.full(2 * self._n_tractions, np.inf)
        shared = np.where(self._side > 0.0, self._traction, self._traction + self._n_tractions)
        np.minimum.at(least, shared, slack)
        return np.asarray((m[self._traction] / self._relief_entries > slack + _LEAST_ACTIVE) & (slack <= least[shared]))

    def corrected(self, compliance: Compliance, vertex: Vertex, tolerance: float) -> tuple[State, Vector, float]:
        """The state of a vertex, its tractions (2m,), and its error: the violation of bounds, over the bonded traction.

        Corrections of x remove the slacks of active bounds, computed from the accurate stresses of the state.
        """
        x, active, least = vertex.x, vertex.basic, np.inf
        best: Any = ()
        for n_left in reversed(range(_MOST_CORRECTIONS + 1)):
            state = compliance.state(self.multipliers(x))
            tractions = compliance.qvi.tractions(state[0])
            slack = self.slack(tractions)
            error, before = max(largest(slack[active]), most(-slack)), least
            if not best or error < least:
                best, least = (state, tractions, error), error
            if not n_left or not _LEAST_ERROR * tolerance < error < 0.5 * before:
                break
            block = self.M[active][:, active]
            x = x.copy()
            x[active] -= lstsq(block, slack[active], cond=_RANK, lapack_driver="gelsy")[0]
            x = np.maximum(x, 0.0)
        return best  # type: ignore[no-any-return]  # never empty


def solve_pivoting(qvi: FrictionQVI, tolerance: float, options: PivotingOptions, start: Start | None = None) -> Outcome:
    """The vertex at the end of the path from the state `start`, or from x = 0.

    If the path from the state ends in a ray, or its vertex is inaccurate, the path from x = 0 follows. An iteration is
    a vertex for guessed signs; inner iterations are pivots.
    """
    began = time.perf_counter()
    compliance, law, history, found = Compliance(qvi), qvi.law, list[Iteration](), None
    setup, near = time.perf_counter() - began, None if start is None else False
    started = compliance.bonded if start is None else qvi.tractions(start.z)
    is_guessed = law.bilateral & (law.mu > 0.0)
    signs = np.where(is_guessed & (started[: qvi.m] > 0.0), 1.0, -1.0)
    for _ in range(_MOST_GUESSES):
        bounds = ContactBounds(qvi, compliance, signs)
        d = np.ones(len(bounds.q))
        for active in (None,) if start is None else (bounds.active(started, start.multipliers), None):
            vertex = solve_lcp(bounds.M, bounds.q, d, active)
            end = bounds.corrected(compliance, vertex, tolerance) if vertex.reason is Status.SOLVED else None
            if end is not None and end[2] <= _LARGEST_ERROR:
                near = None if start is None else active is not None
                break
        reason = vertex.reason
        message = "the path of pivots ends in a ray" if reason is Status.STALLED else ""
        if end is None:
            break
        found, tractions, error = end
        normal, before = tractions[: qvi.m], signs
        numbers = error, qvi.energy(found[0]), float(qvi.W @ normal), None, vertex.pivots
        history.append(Iteration(len(history) + 1, *numbers, time.perf_counter() - began))
        report(Progress("pivoting", history[-1]))
        signs = np.where(is_guessed & (normal > 0.0), 1.0, -1.0)
        if len(history) >= options.max_iterations:
            reason = Status.MAX_ITERATIONS
            break
        if (signs == before).all():
            break
    more: dict[str, Any] = {"message": message, "setup": setup, "form": "condensed", "near": near}
    if found is None:
        return Outcome.nothing(qvi, reason, **more)
    return Outcome(reason, *found, history, len(history), **more)


# Linear complementarity by pivoting: x ≥ 0, w = q + M x ≥ 0, xᵀw = 0.
#
# Lemke's method (C. E. Lemke, Management Science 11, 1965; R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear
# Complementarity Problem, section 4.4) follows the solutions of w = q + d θ + M x, d > 0, from a θ so large that x = 0
# is one, down to θ = 0. Each pivot is an edge of that path. The path ends at a solution, or in a ray on which x grows
# without bound.

_PIVOT = 1e-9  # entries of a column below this share of its largest one are rounding
_TIE = 1e-10  # relative difference of steps that count as equal
_ROUNDING = 1e-13  # negative q above this share of the largest q, or of 1, are rounding
_LEAST_THETA = 1e-10  # θ, over the largest q or 1, that counts as 0: the vertex is corrected later
_MOST_PIVOTS = 20  # largest number of pivots, over the number of unknowns


@dataclass(frozen=True, eq=False)
class Vertex:
    """The end of a path."""

    x: Vector  # (n,) ≥ 0; meaningless unless solved
    basic: BoolVector  # (n,) bool, True: w = 0 and x may be positive
    pivots: int  # number of pivots
    reason: Status = Status.SOLVED  # or "stalled", in a ray, or "time_limit"


def solve_lcp(M: Matrix, q: Vector, d: Vector, active: BoolVector | None = None, *, away: bool = False) -> Vertex:
    """The end of the path for M (n, n), q (n,) and the direction d (n,) > 0.

    With `active` (n,) bool the path begins at w = 0 in the active rows and x = 0 in the others: it is the path of the
    problem in which x and w are exchanged in the active rows (section 2.3 of the book). If that is a solution, the path
    ends there, or with `away` leaves it: d has any signs, θ grows from 0, and is 0 again at another solution.
    """
    n = len(q)
    if active is not None and active.any():
        return _from_active(M, q, d, active, away)
    x, basic = np.zeros(n), np.zeros(n, dtype=bool)
    size = max(1.0, largest(q))
    if q.min(initial=0.0) >= -_ROUNDING * size and not away:
        return Vertex(x, basic, 0)
    # basic + table @ non-basic = values, the last column. Variables: w 0 to n − 1, x n to 2n − 1, θ 2n.
    table: Matrix = np.empty((n, n + 2), order="F")
    np.negative(M, out=table[:, :n])
    table[:, n], table[:, -1] = -d, q
    basis, column = np.arange(n), np.arange(-n, n + 1)  # basic variable of each row; column of each non-basic one
    first = np.divide(np.maximum(q, 0.0), -d, out=np.full(n, np.inf), where=d < -_PIVOT * largest(d)) if away else q / d
    row, entering = int(np.argmin(first)), 2 * n
    if first[row] == np.inf:
        return Vertex(x, basic, 0, Status.STALLED)
    for pivots in range(1, _MOST_PIVOTS * n):
        if deadline.over:
            return Vertex(x, basic, pivots, Status.TIME_LIMIT)
        # The row is solved for the entering variable, which is eliminated from all other rows.
        pivot_column = column[entering]
        factors, pivot = table[:, pivot_column].copy(), table[row, pivot_column]
        table[:, pivot_column] = 0.0
        pivot_row = table[row] / pivot
        pivot_row[pivot_column] = 1.0 / pivot
        factors[row] = 0.0
        table = dger(-1.0, factors, pivot_row, a=table, overwrite_a=1)
        table[row] = pivot_row
        leaving, basis[row] = int(basis[row]), entering
        column[leaving] = pivot_column
        # The complement of the variable that left enters next.
        next_row = None
        if leaving < 2 * n:
            entering = leaving + n if leaving < n else leaving - n
            next_row = _leaving_row(table[:, column[entering]], table[:, -1], basis)
        if next_row is None:  # θ has left the basis, or a ray begins, which is a solution if θ is rounding
            rows = (basis >= n).nonzero()[0]
            is_solution = leaving == 2 * n or table[basis == 2 * n, -1].max() <= _LEAST_THETA * size
            rows = rows[basis[rows] < 2 * n]
            x[basis[rows] - n] = np.maximum(table[rows, -1], 0.0)
            basic[basis[rows] - n] = True
            return Vertex(x, basic, pivots, Status.SOLVED if is_solution else Status.STALLED)
        row = next_row
    return Vertex(x, basic, pivots, Status.STALLED)


def _from_active(M: Matrix, q: Vector, d: Vector, active: BoolVector, away: bool) -> Vertex:
    """The path of the problem in which x and w are exchanged in the active rows, by a block pivot."""
    inside, outside = active.nonzero()[0], (~active).nonzero()[0]
    columns = M[:, inside]
    lower_upper, pivots, singular = dgetrf(columns[inside])
    if singular:
        return Vertex(np.zeros(len(q)), active, 0, Status.STALLED)
    values, change = np.stack([q, d])
    for vector in (values, change) if away else (values,):
        vector[inside] = -dgetrs(lower_upper, pivots, vector[inside])[0]
        vector[outside] += columns[outside] @ vector[inside]
    if values.min() >= -_ROUNDING * max(1.0, largest(values)) and not away:  # it ends where it begins, see `solve_lcp`
        return Vertex(np.where(active, np.maximum(values, 0.0), 0.0), active, 0)
    inverse = dgetri(lower_upper, pivots)[0]
    rows = inverse @ M[inside]
    exchanged = M - columns @ rows
    exchanged[inside], exchanged[:, inside] = -rows, columns @ inverse
    exchanged[inside[:, None], inside] = inverse
    vertex = solve_lcp(exchanged, values, change, away=away)
    x = np.where(active, np.maximum(values + exchanged @ vertex.x, 0.0), vertex.x)
    return Vertex(x, vertex.basic ^ active, vertex.pivots, vertex.reason)


def _leaving_row(column: Vector, values: Vector, basis: IntVector) -> int | None:
    """The row whose basic variable reaches zero first, None in a ray; of ties θ, else the largest pivot."""
    decreases = column > _PIVOT * max(1.0, largest(column))
    steps = np.full(len(column), np.inf)
    np.divide(np.maximum(values, 0.0), column, out=steps, where=decreases)
    least = float(np.minimum.reduce(steps))
    if least == np.inf:
        return None
    tied = (steps <= least + _TIE * max(least, 1e-4)).nonzero()[0]
    if len(tied) == 1:
        return int(tied[0])
    theta_row = tied[basis[tied] == 2 * len(basis)]
    return int(theta_row[0]) if len(theta_row) else int(tied[np.argmax(column[tied])])
