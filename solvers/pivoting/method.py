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

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import lstsq

from solvers.basics.checks import whole_number
from solvers.basics.status import Status
from solvers.basics.types import Matrix, Vector
from solvers.basics.watch import Progress, expired, tell
from solvers.certificate.certificate import certify
from solvers.inequality.compliance import Compliance
from solvers.inequality.problem import FrictionQVI
from solvers.pivoting.lemke import Vertex, solve_lcp
from solvers.solution.finish import Outcome, finish, no_outcome
from solvers.solution.solution import Iteration, QVISolution

LARGEST = 200
"""Contact points up to which it is worth trying: a table of 600 rows."""

_DIRECTIONS = 4
_SIGNS = 6  # guesses of the signs of bilateral points
_POLISHING = 4  # corrections of a vertex
_STEPS = 3  # of the bound, from no friction on
_SETTLED = 1e-11  # change of the bound, over the bonded tractions, that is none
_RANK = 1e-11  # singular values of active rows below this share of the largest are none


@dataclass(frozen=True)
class PivotingOptions:
    """Options of pivoting.

    Attributes
    ----------
    max_iterations : vertices, and corrections of one, at most
    callback : called with an `Iteration` for every vertex, and every correction of one

    """

    max_iterations: int = 1000  # more than there are: a few directions, guesses of signs, and corrections
    callback: Callable[[Iteration], object] | None = None

    def __post_init__(self) -> None:
        whole_number("max_iterations", self.max_iterations)


class _Law(NamedTuple):
    """mu, cohesion and cap of the contact points (m,) each."""

    mu: Vector
    cohesion: Vector
    cap: Vector

    @classmethod
    def of(cls, qvi: FrictionQVI) -> "_Law":
        """The problem's own."""
        return cls(qvi.mu, qvi.cohesion, qvi.cap)

    @classmethod
    def given(cls, bound: Vector) -> "_Law":
        """|σ_T| ≤ bound whatever the pressure."""
        return cls(np.zeros(len(bound)), bound, np.full(len(bound), np.inf))


@dataclass(frozen=True, eq=False)
class _Rows:
    """Bounds of one problem for given signs of σ_N, in units of the tractions and of the multipliers they relieve.

    Attributes
    ----------
    H : (r, 2m); limit : (r,)
    F : (2m, r), m of unit x

    """

    H: Matrix
    limit: Vector
    F: Matrix

    @classmethod
    def of(cls, qvi: FrictionQVI, law: _Law, signs: Vector, unit: float) -> "_Rows":
        """The rows; `unit`: multiplier over weight of x = 1."""
        m, one = qvi.m, np.eye(qvi.m)
        normal, capped = np.flatnonzero(~qvi.bilateral), np.flatnonzero(np.isfinite(law.cap))
        blocks, limits, forces = (
            [_side(one, 0.0 * one)[normal]],
            [np.zeros(len(normal))],
            [_side(one, 0.0 * one)[normal]],
        )
        for side in (1.0, -1.0):
            shear = _side(0.0 * one, side * one)
            blocks += [_side(np.diag(-law.mu * signs), side * one), shear[capped]]
            limits += [law.cohesion, law.cap[capped]]
            forces += [shear, shear[capped]]
        weights = np.concatenate([qvi.W, qvi.W])
        sizes = 1.0 / np.concatenate([np.ones(len(normal)), *(2 * [1.0 + law.mu, np.ones(len(capped))])])
        F = unit * weights[:, None] * np.concatenate(forces).T
        return cls(sizes[:, None] * np.concatenate(blocks), sizes * np.concatenate(limits), F.reshape(2 * m, -1))


def _side(left: Matrix, right: Matrix) -> Matrix:
    return np.concatenate([left, right], axis=1)


@dataclass(eq=False)
class _Run:
    """What stays the same, and the best state so far."""

    qvi: FrictionQVI
    compliance: Compliance
    tolerance: float
    stress: float
    unit: float
    best: Outcome
    options: PivotingOptions
    accuracy: float = np.inf
    pivots: int = 0
    began: float = 0.0

    @property
    def spent(self) -> bool:
        """Whether no iterations are left."""
        return len(self.best.history) >= self.options.max_iterations

    def keep(self, m: Vector) -> bool:
        """Judge multipliers (2m,); True if their certificate passes."""
        qvi = self.qvi
        z, nu = self.compliance.unknowns(m)
        certificate = certify(qvi, z, m[: qvi.m], m[qvi.m :], nu, self.tolerance)
        entry = Iteration(
            len(self.best.history) + 1, certificate.accuracy, qvi.energy(z), qvi.resultant(z), None, self.pivots,
            time.perf_counter() - self.began,
        )  # fmt: skip
        self.best.history.append(entry)
        tell(Progress("pivoting", entry))
        if self.options.callback is not None:
            self.options.callback(entry)
        if certificate.accuracy < self.accuracy:
            self.accuracy = certificate.accuracy
            best = self.best
            best.z, best.m_N, best.m_T, best.nu = z, m[: qvi.m], m[qvi.m :], nu
            best.threshold = qvi.threshold(qvi.pressure(z))
        return certificate.passed


def affordable(qvi: FrictionQVI) -> bool:
    """Whether the contact is small enough, and the law one of points."""
    return 0 < qvi.m <= LARGEST and qvi.n > 0


def solve_pivoting(qvi: FrictionQVI, tolerance: float, options: PivotingOptions | None = None) -> QVISolution:
    """Solve the QVI by the method of this module."""
    began = time.perf_counter()
    compliance = Compliance(qvi)
    nothing = no_outcome(qvi, Status.STALLED, "the path of pivots ends in a ray")
    run = _Run(
        qvi, compliance, tolerance, *_scales(qvi, compliance), nothing, options or PivotingOptions(), began=began
    )
    for number in range(_DIRECTIONS):
        if _try(run, number):
            run.best.reason = Status.SOLVED
            break
        if expired():
            run.best.reason, run.best.message = Status.TIME_LIMIT, "the time limit was reached on the path of pivots"
            break
        if run.spent:
            run.best.reason, run.best.message = Status.MAX_ITERATIONS, ""
            break
    run.best.iterations = len(run.best.history)
    run.best.timings = {"setup": 0.0, "solve": time.perf_counter() - began}
    return finish(qvi, run.best, "pivoting", "", tolerance)


def other_ends(qvi: FrictionQVI, compliance: Compliance, *, both: bool) -> Iterator[Vector]:
    """Multipliers m (2m,) at the ends of ways of another kind than a path through the interior.

    The first is that of this module, along the first direction. The second, for `both`, starts without friction and
    takes the bound from the pressure found, as the fixed point does, a few times. Ways that end in a ray, or have signs
    to guess, are left out; nothing is certified.
    """
    if (qvi.bilateral & (qvi.mu > 0.0)).any():
        return
    stress, unit = _scales(qvi, compliance)
    rows, M, q = _posed(qvi, compliance, _Law.of(qvi), -np.ones(qvi.m), stress, unit)
    vertex = solve_lcp(M, q, _direction(len(q), 0))
    if vertex is not None:
        yield rows.F @ vertex.x
    bound = np.zeros(qvi.m)
    for _ in range(_STEPS if both else 0):
        rows, M, q = _posed(qvi, compliance, _Law.given(bound), -np.ones(qvi.m), stress, unit)
        vertex = solve_lcp(M, q, _direction(len(q), 0))
        if vertex is None:
            return
        m = rows.F @ vertex.x
        last, bound = bound, qvi.threshold(qvi.pressed((compliance.bonded - compliance.relief(m))[: qvi.m]))
        if np.abs(bound - last).max() <= _SETTLED * stress:
            yield m
            return


def _scales(qvi: FrictionQVI, compliance: Compliance) -> tuple[float, float]:
    """The largest bonded traction, and the displacement it stands for."""
    stress = float(np.abs(compliance.bonded).max(initial=0.0)) or 1.0
    return stress, stress / (qvi.contact_stiffness or 1.0)


def _posed(
    qvi: FrictionQVI, compliance: Compliance, law: _Law, signs: Vector, stress: float, unit: float
) -> tuple[_Rows, Matrix, Vector]:
    """Rows, M and q of the linear complementarity problem of a law for given signs of σ_N."""
    rows = _Rows.of(qvi, law, signs, unit)
    M = rows.H @ (compliance.dense @ rows.F) / stress
    return rows, M, (rows.limit - rows.H @ compliance.bonded) / stress


def _try(run: _Run, number: int) -> bool:
    """Along one direction d, with guessed signs of bilateral points; whether that ends in a solution."""
    qvi = run.qvi
    guessed = qvi.bilateral & (qvi.mu > 0.0)
    normal = run.compliance.bonded[: qvi.m]
    for _ in range(_SIGNS):
        if run.spent:
            return False
        signs = np.where(guessed & (normal > 0.0), 1.0, -1.0)
        rows, M, q = _posed(qvi, run.compliance, _Law.of(qvi), signs, run.stress, run.unit)
        vertex = solve_lcp(M, q, _direction(len(q), number))
        if vertex is None:
            return False
        run.pivots = vertex.pivots
        if _polished(run, rows, M, vertex):
            return True
        normal = qvi.normal(run.best.z) if np.isfinite(run.accuracy) else normal
        if not guessed.any() or (np.where(guessed & (normal > 0.0), 1.0, -1.0) == signs).all():
            return False
    return False


def _direction(size: int, number: int) -> Vector:
    """All alike first, then others without any pattern that rows could share."""
    return np.ones(size) if number == 0 else 0.2 + np.random.default_rng(number).random(size)


def _polished(run: _Run, rows: _Rows, M: Matrix, vertex: Vertex) -> bool:
    """Correct the vertex by what its active bounds miss, as accurate stresses say; whether the certificate passes."""
    x, active = vertex.x, vertex.basic
    for _ in range(_POLISHING):
        if run.keep(rows.F @ x):
            return True
        if run.spent:
            return False
        z, _ = run.compliance.unknowns(rows.F @ x)
        missed = (rows.limit - rows.H @ run.compliance.tractions(z)) / run.stress
        if not active.any() or not np.isfinite(missed).all():
            return False
        x = x.copy()
        x[active] -= lstsq(M[np.ix_(active, active)], missed[active], cond=_RANK)[0]
        x = np.maximum(x, 0.0)
    return run.keep(rows.F @ x)
