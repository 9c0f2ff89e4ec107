"""The whole inequality as one linear complementarity problem on the contact, solved by pivoting.

With the compliance C of the contact (`Compliance`) and multipliers m = F x, x ≥ 0, tractions are σ = σ_bonded − C m,
and every bound is a row of w = limit − H σ ≥ 0 with xᵀw = 0:

    normal      w = −σ_N                                           x = m_N               unilateral points
    friction    w = cohesion ± sign(σ_N) mu σ_N ∓ σ_T, two rows     x = m_T⁺, m_T⁻        points that may slip
    cap         w = cap ∓ σ_T, two rows                            x, more of m_T        where the cap is finite

so that w = q + M x with q = limit − H σ_bonded, M = H C F: no outer iteration, since |σ_N| = −σ_N is linear. At
bilateral points with friction the sign of σ_N is guessed, and guessed again from the solution until it stays.

A vertex is exact where an interior point method has no interior to go through: where contact touches without load,
where equilibrium alone says that a contact carries nothing, where only one traction is admissible. It takes pivots of
dense tables, some for every point, and is meant for small contacts (`LARGEST`). With much friction the path may end in
a ray though there is a solution; then other directions d are tried.

| stops when                                          | status before the certificate |
|-----------------------------------------------------|-------------------------------|
| the certificate passes                              | solved                        |
| all directions end in rays, or in what it refuses   | stalled                       |
| the time is over                                    | time_limit                    |
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lstsq

from solvers.basics.progress import Progress, deadline, report
from solvers.basics.status import Status
from solvers.basics.types import BoolVector, IntVector, Matrix, Vector
from solvers.certificate.certificate import certify
from solvers.inequality.problem import Compliance, FrictionQVI, Law
from solvers.settings import PivotingOptions
from solvers.solution import WHAT_TO_DO, Iteration, Outcome, QVISolution

LARGEST = 200
"""Contact points up to which it is worth trying: a table of 600 rows."""

_DIRECTIONS = 4
_SIGNS = 6  # guesses of the signs of bilateral points
_POLISHING = 4  # corrections of a vertex
_STEPS = 3  # of the bound, from no friction on
_SETTLED = 1e-11  # change of the bound, over the bonded tractions, that is none
_RANK = 1e-11  # singular values of active rows below this share of the largest are none


@dataclass(frozen=True, eq=False)
class _Rows:
    """Bounds of one problem for given signs of σ_N, in units of the tractions and of the multipliers they relieve."""

    H: Matrix  # (r, 2m); limit : (r,)
    limit: Vector
    F: Matrix  # (2m, r), m of unit x

    @classmethod
    def of(cls, qvi: FrictionQVI, law: Law, signs: Vector, unit: float) -> _Rows:
        """The rows; `unit`: multiplier over weight of x = 1."""
        m, normal, capped = qvi.m, np.flatnonzero(~qvi.bilateral), np.flatnonzero(np.isfinite(law.cap))
        pull = np.eye(m, 2 * m)
        rubbed = (law.mu * signs)[:, None] * pull
        blocks, limits, forces = [pull[normal]], [np.zeros(len(normal))], [pull[normal]]
        for side in (1.0, -1.0):
            shear = side * np.eye(m, 2 * m, m)
            blocks += [shear - rubbed, shear[capped]]
            limits += [law.cohesion, law.cap[capped]]
            forces += [shear, shear[capped]]
        weights = np.concatenate([qvi.W, qvi.W])
        sizes = 1.0 / np.concatenate([np.ones(len(normal)), *(2 * [1.0 + law.mu, np.ones(len(capped))])])
        F = unit * weights[:, None] * np.concatenate(forces).T
        return cls(sizes[:, None] * np.concatenate(blocks), sizes * np.concatenate(limits), F.reshape(2 * m, -1))


def affordable(qvi: FrictionQVI) -> bool:
    """Whether the contact is small enough, and the law one of points."""
    return 0 < qvi.m <= LARGEST and qvi.n > 0


def solve_pivoting(qvi: FrictionQVI, tolerance: float, options: PivotingOptions) -> Outcome:
    """Solve the QVI by the method of this module."""
    began, compliance, accuracy = time.perf_counter(), Compliance(qvi), np.inf
    best = Outcome.nothing(qvi, Status.STALLED, "the path of pivots ends in a ray")
    for m, pivots in _vertices(qvi, compliance, best):
        state = compliance.state(m)
        z, certificate = state[0], certify(qvi, *state, tolerance)
        entry = Iteration(
            len(best.history) + 1, certificate.accuracy, qvi.energy(z), qvi.resultant(z), None, pivots,
            time.perf_counter() - began,
        )  # fmt: skip
        best.history.append(entry)
        report(Progress("pivoting", entry))
        if certificate.accuracy < accuracy:
            accuracy = certificate.accuracy
            best.z, best.m_N, best.m_T, best.nu = state
        if certificate.passed:
            best.reason = Status.SOLVED
            break
        if len(best.history) >= options.max_iterations:
            best.reason, best.message = Status.MAX_ITERATIONS, ""
            break
    if best.reason is not Status.SOLVED and deadline.over:
        best.reason, best.message = Status.TIME_LIMIT, "the time limit was reached on the path of pivots"
    best.iterations = len(best.history)
    return best


def _vertices(qvi: FrictionQVI, compliance: Compliance, best: Outcome) -> Iterator[tuple[Vector, int]]:
    """Multipliers (2m,) of vertices and corrections of them, with the pivots to each, until the time is over.

    Along each direction d, with guessed signs of bilateral points, guessed again from the best state. A vertex is
    corrected by what its active bounds miss, as accurate stresses say.
    """
    stress, unit = _scales(qvi, compliance)
    guessed = qvi.bilateral & (qvi.mu > 0.0)
    for number in range(_DIRECTIONS):
        signs = np.where(guessed & (compliance.bonded[: qvi.m] > 0.0), 1.0, -1.0)
        for _ in range(_SIGNS):
            rows, M, q = _posed(qvi, compliance, qvi.law, signs, stress, unit)
            vertex = solve_lcp(M, q, _direction(len(q), number))
            if vertex is None:
                break
            x, active = vertex.x, vertex.basic
            for left in reversed(range(_POLISHING + 1)):
                yield rows.F @ x, vertex.pivots
                if not left or not active.any():
                    break
                z, _ = compliance.unknowns(rows.F @ x)
                missed = (rows.limit - rows.H @ compliance.tractions(z)) / stress
                if not np.isfinite(missed).all():
                    break
                x = x.copy()
                x[active] -= lstsq(M[np.ix_(active, active)], missed[active], cond=_RANK)[0]
                x = np.maximum(x, 0.0)
            before = signs
            signs = np.where(guessed & (qvi.normal(best.z) > 0.0), 1.0, -1.0)
            if (signs == before).all():
                break


def other_ends(qvi: FrictionQVI, compliance: Compliance, *, both: bool) -> Iterator[Vector]:
    """Multipliers m (2m,) at the ends of ways of another kind than a path through the interior.

    The first is that of this module, along the first direction. The second, for `both`, starts without friction and
    takes the bound from the pressure found, as the fixed point does, a few times. Ways that end in a ray, or have signs
    to guess, are left out; nothing is certified.
    """
    if (qvi.bilateral & (qvi.mu > 0.0)).any():
        return
    stress, unit = _scales(qvi, compliance)
    rows, M, q = _posed(qvi, compliance, qvi.law, -np.ones(qvi.m), stress, unit)
    vertex = solve_lcp(M, q, _direction(len(q), 0))
    if vertex is not None:
        yield rows.F @ vertex.x
    bound = np.zeros(qvi.m)
    for _ in range(_STEPS if both else 0):
        rows, M, q = _posed(qvi, compliance, Law(np.zeros(qvi.m), bound), -np.ones(qvi.m), stress, unit)
        vertex = solve_lcp(M, q, _direction(len(q), 0))
        if vertex is None:
            return
        m = rows.F @ vertex.x
        last, bound = bound, qvi.threshold(qvi.law.pressed((compliance.bonded - compliance.relief(m))[: qvi.m]))
        if np.abs(bound - last).max() <= _SETTLED * stress:
            yield m
            return


def _scales(qvi: FrictionQVI, compliance: Compliance) -> tuple[float, float]:
    """The largest bonded traction, and the displacement it stands for."""
    stress = float(np.abs(compliance.bonded).max(initial=0.0)) or 1.0
    return stress, stress / (qvi.contact_stiffness or 1.0)


def _posed(
    qvi: FrictionQVI, compliance: Compliance, law: Law, signs: Vector, stress: float, unit: float
) -> tuple[_Rows, Matrix, Vector]:
    """Rows, M and q of the linear complementarity problem of a law for given signs of σ_N."""
    rows = _Rows.of(qvi, law, signs, unit)
    M = rows.H @ (compliance.dense @ rows.F) / stress
    return rows, M, (rows.limit - rows.H @ compliance.bonded) / stress


def _direction(size: int, number: int) -> Vector:
    """All alike first, then others without any pattern that rows could share."""
    return np.ones(size) if number == 0 else 0.2 + np.random.default_rng(number).random(size)


# Linear complementarity by pivoting: x ≥ 0, w = q + M x ≥ 0, xᵀw = 0.
#
# Lemke's method (C. E. Lemke, Management Science 11, 1965; R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear
# Complementarity Problem, section 4.4) follows the solutions of w = q + d θ + M x, d > 0, from θ so large that x = 0
# down to θ = 0. Each pivot goes along one edge of that path. It ends at a solution, or in a ray on which x grows
# without end.


_PIVOT = 1e-9  # share of its column's largest entry below which an entry is rounding
_TIE = 1e-10  # relative difference of steps that count as equal
_PIVOTS = 20  # pivots at most, times the number of unknowns


@dataclass(frozen=True, eq=False)
class Vertex:
    """Where the path has ended."""

    x: Vector  # (n,) ≥ 0
    basic: BoolVector  # (n,) bool, where x may be positive, w zero
    pivots: int  # how many it took


def solve_lcp(M: Matrix, q: Vector, d: Vector) -> Vertex | None:
    """A solution of the problem of this module, (n, n), (n,) and (n,) > 0; nothing if the path ends in a ray.

    Nor is there one if the time is over before the path ends, see `deadline`.
    """
    n = len(q)
    x, basic = np.zeros(n), np.zeros(n, dtype=bool)
    if q.min(initial=0.0) >= 0.0:
        return Vertex(x, basic, 0)
    table = np.concatenate([np.eye(n), -M, -d[:, None], q[:, None]], axis=1)  # w − M x − d θ = q
    basis = np.arange(n)
    row, entering = int(np.argmin(q / d)), 2 * n
    for pivots in range(1, _PIVOTS * n):
        # The row is solved for the entering variable, which is eliminated from all others.
        table[row] /= table[row, entering]
        factors = table[:, entering].copy()
        factors[row] = 0.0
        table -= factors[:, None] * table[row]
        table[:, entering] = 0.0
        table[row, entering] = 1.0
        leaving, basis[row] = int(basis[row]), entering
        if leaving == 2 * n:
            rows = np.flatnonzero(basis >= n)
            x[basis[rows] - n] = np.maximum(table[rows, -1], 0.0)
            basic[basis[rows] - n] = True
            return Vertex(x, basic, pivots)
        entering = leaving + n if leaving < n else leaving - n
        found = _leaving_row(table, basis, entering)
        if found is None or deadline.over:
            return None
        row = found
    return None


def _leaving_row(table: Matrix, basis: IntVector, entering: int) -> int | None:
    """The basic variable that reaches zero first, θ before others and large pivots before small; none: a ray."""
    column = table[:, entering]
    falls = column > _PIVOT * max(1.0, float(np.maximum.reduce(np.abs(column))))
    steps = np.full(len(column), np.inf)
    np.divide(np.maximum(table[:, -1], 0.0), column, out=steps, where=falls)
    least = float(np.minimum.reduce(steps))
    if least == np.inf:
        return None
    tied = (steps <= least + _TIE * max(least, 1e-4)).nonzero()[0]
    if len(tied) == 1:
        return int(tied[0])
    last = tied[basis[tied] == 2 * len(basis)]
    return int(last[0]) if len(last) else int(tied[np.argmax(column[tied])])


# A second opinion on a solution: whether there is another one.
#
# With friction the solution of (D2) need not be unique, and each method ends at the one its own way leads to. Pivoting
# comes from elsewhere than an interior point method. Where it ends at other tractions, and the certificate passes there
# too, there are at least two solutions: a fact. Where it ends at the same ones nothing follows.


LARGEST_DOUBTED, LARGEST_PLAIN = 48, 16
"""Contact points up to which a second opinion is asked for, where the way to a solution had to turn or the first method
failed, and two ways are gone, and where nothing was the matter, and one way is: a few per cent of the solve."""

OTHER = 1e-4
"""Difference of tractions, over the largest one, that is not the certificates' error."""


def another_solution(qvi: FrictionQVI, solution: QVISolution, tolerance: float, *, doubted: bool = True) -> str:
    """A sentence if there is a certified solution with other tractions at the end of another way, else nothing."""
    largest = LARGEST_DOUBTED if doubted else LARGEST_PLAIN
    if not (qvi.law.moving.any() and qvi.m <= largest and affordable(qvi)):
        return ""
    size = solution.certificate.scales["stress"]
    compliance = Compliance(qvi)
    own = compliance.tractions(solution.z)
    for m in other_ends(qvi, compliance, both=doubted):
        difference = float(np.abs(compliance.bonded - compliance.relief(m) - own).max()) / size
        if difference > OTHER and certify(qvi, *compliance.state(m), tolerance).passed:
            return (
                "The discrete problem has several solutions: there is another one, certified as well, whose contact "
                f"tractions differ by up to {100.0 * difference:.2g} % of the largest. {WHAT_TO_DO}"
            )
    return ""
