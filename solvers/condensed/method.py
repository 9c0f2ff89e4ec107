"""The condensed method: (D2) solved directly on what the contact feels, to the last digits.

    1  eliminate the interior once, with the Schur complement S on the contact's unknowns     (`reduction`)
       or, where the contact is a large share of the body, nothing: all matrices are sparse   (`whole`)
    2  solve the mixed complementarity problem there by an interior point method              (`interior_point`)
       where it stalls, follow the central path around its turns                              (`CentralPath`)
    3  move z, compute the gradient without the rounding inside K, and go on from there: a defect correction, repeated
       until the linear residual has reached its round-off floor

| stops when                                                             | status before the certificate |
|------------------------------------------------------------------------|-------------------------------|
| gap ≤ `gap`, the next correction is foreseen below 1e-12               | solved                        |
| gap ≤ `gap`, corrections below 1e-6 that no longer shrink              | solved                        |
| no progress, and bounds or equations that are not met                  | inner_infeasible              |
| no progress, too many turns or no end of the path, a singular matrix   | stalled                       |
| the first correction is above 1e-3, even with R factorised, or larger  | ill_conditioned               |
| ones do not shrink                                                     |                               |
| the gap overflows                                                      | diverged                      |
| `max_iterations` done                                                  | max_iterations                |
| the time is over, see `watch`                                          | time_limit                    |

After the third, fourth and sixth other shares of friction in s λ are tried (`FRICTION_SHARES`), each on its own path,
after the third first those with which slacks fit most easily (`FITTING_SHARES`), unless the certificate passes already;
of all starts the best point by its certificate is the result. Sparse systems have a start near the bonded solution too
(`NEAR_BONDED_SHARES`): it is the first of large ones, and the last of others. Smaller shares are tried after the first
two statuses if the residual of y is above 1e-12 in the energy norm: the two multipliers of shear at an open point are
proportional to that share, and lose as many digits in their difference. Before all these a linear program is asked, for
a fifth of the time of the first start or half a second, whether the load can be carried, see `certificate.feasibility`.

In `docs/theory.md`: (D8).
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final, Literal

import numpy as np
from numpy.linalg import LinAlgError

from solvers.basics.checks import one_of, whole_number
from solvers.basics.progress import Progress, deadline, report
from solvers.basics.status import Status
from solvers.certificate import certify
from solvers.certificate.feasibility import Feasibility, refuted
from solvers.condensed.complementarity import Complementarity
from solvers.condensed.coordinates import DenseCoordinates, SparseCoordinates, obstacle
from solvers.condensed.interior_point import CentralPath, InteriorPoint, Measures, Point, Residuals, start_near
from solvers.condensed.systems import FITTING_SHARES, Coordinates, Expansion, PathWeights, SystemName
from solvers.errors import InputError
from solvers.inequality.loads import SLOW_CONTRACTION
from solvers.inequality.problem import FrictionQVI
from solvers.solution import Attempt, Iteration, Outcome, QVISolution, Start, finish

_FIRST_GAP = 1e-5  # of the first defect correction: earlier its error is larger than that of the linear algebra
_SLACK, _FORCE = 1e-11, 1e-11  # residuals that a solution may have, see `Measures`
_COARSEST_GAP = 1e-11  # that will do if it does not shrink any more
_SPOILT, _LATE = 1e-11, 1e-4  # force residual, below this gap, from which on Newton steps are those of `saddle`
_LARGEST_SADDLE = 2500  # unknowns of them
_FORCE_FLOOR = 1e-8  # the same if it does not shrink any more
_UNBALANCED = 1e-10  # error of the stress, in the energy norm and relative, that forces out of balance may make
_PROGRESS = 0.7
_LEAST_GAP = 2e-17  # that is asked for: the interior point method goes no further than half of it
_NO_GAP = 1e-19  # out of reach, so that iterations go on as long as they gain
_FINER = 0.3  # of the gap that is asked for, at which iterations go on with the residuals alone
_ENOUGH = 1e-12  # relative defect correction that is not worth another one
_FLOOR = 1e-6  # above, a correction that no longer shrinks is no rounding
_HALVED = 0.5
_ASKED, _AT_LEAST = 0.2, 0.5  # of the first start's time, and seconds, for a proof that the load cannot be carried
_CONTRADICTION = 1e-6  # shear at points without friction, relative, above which the equations contradict each other
_HOPELESS = 0.3  # of the defect corrections' contraction
_FAR_ENOUGH = (0.5, 0.4)  # of the first steps from an earlier answer: shorter ones cost more than they gain
_LONG = 0.5  # of the way that Newton's method asks for
_TURNS = 12
_ONE_START = 300  # iterations of one start
_LAST = (Status.ILL_CONDITIONED, Status.MAX_ITERATIONS, Status.TIME_LIMIT)  # no other start follows
SYSTEMS: Final = ("auto", "dense", "sparse")
_FORMS: Final[dict[SystemName, str]] = {"dense": "condensed", "sparse": "full"}  # of the result
_FITTED = 1e-7  # slack residual from which on friction has its own share, see `InteriorPoint.settle`
_ON_PATH = 1e-4  # slack residual below which stalling means a turn of the path


@dataclass(frozen=True)
class CondensedOptions:
    """Options of the condensed method.

    Attributes
    ----------
    gap : complementarity at which the interior point method stops, relative to stress × displacement × length; less
        by the square of the least share that a point's bound has in its contact, where that is below 2e-3, or 5e-4 in
        sparse systems
    max_iterations : factorisations of the Newton matrix at most
    initial : the `Start` to begin near, optional; not used where it does not fit, or is not near
    system : linear systems of Newton's method: "dense" on what the contact feels, "sparse" in all unknowns, or "auto",
        what takes less time by the count of operations. With equations or points without friction they are dense
    callback : called with every `Iteration`

    """

    gap: float = 1e-14
    max_iterations: int = 600
    initial: object = None
    system: Literal["auto", "dense", "sparse"] = "auto"
    callback: Callable[[Iteration], object] | None = None

    def __post_init__(self) -> None:
        if not (isinstance(self.gap, int | float) and 0 < self.gap < 1):
            raise InputError("gap", self.gap, "give a number between 0 and 1")
        whole_number("max_iterations", self.max_iterations)
        if not (self.initial is None or isinstance(self.initial, Start)):
            remedy = "give the result of an earlier problem: the condensed method cannot start from a pressure alone"
            raise InputError("initial", type(self.initial).__name__, remedy)
        one_of("system", self.system, SYSTEMS)


@dataclass(eq=False)
class _Run:
    """Everything that changes during a solve."""

    qvi: FrictionQVI
    space: Coordinates
    base: Expansion
    problem: Complementarity
    interior: InteriorPoint
    options: CondensedOptions
    history: list[Iteration] = field(default_factory=list)
    reason: Status | None = None
    message: str = ""
    best: tuple[float, int] = (np.inf, 0)
    path: CentralPath | None = None
    clear: Point | None = None  # the last point from which a step was long
    force: float = np.inf  # residual of the iteration before
    last_gap: float = np.inf  # gap of the iteration before
    kept: tuple[float, Point | None] = (np.inf, None)  # the best point, see `_worst`
    unsettled: float = np.inf  # energy norm of the residual of y when last all else was reached
    before: int = 0  # iterations of earlier starts
    elsewhere: bool = False  # whether the path of an earlier start, with other shares, had to turn
    warm: bool = False  # whether it started near the answer to a problem before
    turns: int = 0
    feasibility: Feasibility | None = None  # that the load cannot be carried, if it was proved
    began: float = 0.0
    attempts: tuple[Attempt, ...] = ()  # so far
    scale: float = 0.0  # energy norm of the first step
    steps: list[float] = field(default_factory=list)  # relative lengths of the steps between corrections
    sizes: list[float] = field(default_factory=list)  # relative sizes of the corrections

    @cached_property
    def final_gap(self) -> float:
        """The gap at which the interior point method stops.

        At a distance r from where slip ends s λ is about r², in the unit of the gap: points of an edge of that length
        have no sticking or slipping of their own before the gap is well below. The more so for tractions, which are
        λ over r. The length of r = 1 is that of the contact, each bed of a wall one of its own.
        """
        system = self.problem.system
        least = _NO_GAP if system.last_digits else _LEAST_GAP
        return min(self.options.gap, max(self.options.gap * (self.problem.least_share / system.small) ** 2, least))

    def relative(self, length: float) -> float:
        """An energy norm over that of the first step."""
        self.scale = self.scale or length
        return length / self.scale if self.scale > 0.0 else 0.0


def solve_condensed(qvi: FrictionQVI, tolerance: float, options: CondensedOptions) -> QVISolution:
    """Solve the QVI by the method of this module."""
    began = time.perf_counter()
    space, remark = _space(qvi, options)
    set_up = time.perf_counter()
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # a diverging iteration is judged by its gap
        run = _start(qvi, space, options)
        near = _begin_near(run)
        _iterate(run)
        run.attempts = (_attempted(run, "condensed", ""),)
        if run.sizes and run.sizes[0] > SLOW_CONTRACTION and qvi.stiffness.use_root():
            attempts, run = run.attempts, _start(qvi, DenseCoordinates(qvi), options)
            _iterate(run)
            run.attempts = (*attempts, _attempted(run, "condensed, R in place of K", "K has lost too much to rounding"))
        run = _restarted(run, tolerance, time.perf_counter() - set_up)
    outcome = _outcome(run)
    outcome.form = _FORMS[run.space.name]
    outcome.corrections = tuple(run.sizes)
    outcome.turned = "The central path has a turning point before this solution" if run.turns or run.elsewhere else ""
    outcome.near = near
    outcome.attempts = run.attempts
    outcome.timings = {"setup": set_up - began, "solve": time.perf_counter() - set_up}
    solution = finish(qvi, outcome, "condensed", "", tolerance)
    return replace(solution, message=f"{solution.message} {remark}") if remark else solution


def _space(qvi: FrictionQVI, options: CondensedOptions) -> tuple[Coordinates, str]:
    """The coordinates asked for, or those that cost less; and a sentence where they cannot be had."""
    wanted = options.system
    if wanted == "auto":
        wanted = "dense" if qvi.stiffness.condensing_pays(qvi.contact) else "sparse"
    reason = obstacle(qvi) if wanted == "sparse" else ""
    if wanted == "dense" or reason:
        return DenseCoordinates(qvi), f"Dense linear systems were taken: {reason}." if reason else ""
    return SparseCoordinates(qvi), ""


def _restarted(first: _Run, tolerance: float, seconds: float) -> _Run:
    """The usual start where an earlier answer led nowhere, then other central paths; the best by its certificate.

    None of them where it is soon proved that there is no solution; the first start took so many seconds.
    """
    inexact = first.reason is Status.SOLVED and _residual(first) > _ENOUGH
    last = _LAST if inexact else (Status.SOLVED, *_LAST)
    if first.reason in last:
        return first
    accuracy = _accuracy(first)
    if accuracy > tolerance:
        first.feasibility = refuted(first.qvi, max(_ASKED * seconds, _AT_LEAST))
        if first.feasibility is not None:
            return first
    best, run, attempts = first, first, first.attempts
    shares = first.space.shares
    others = [share for share in shares[1:] if share.late < shares[0].late or not inexact]
    if first.reason is Status.INNER_INFEASIBLE and FITTING_SHARES not in shares:
        others.insert(0, FITTING_SHARES)
    for share in [shares[0], *others] if first.warm else others:
        if accuracy <= tolerance:
            break
        turned, ended = run.elsewhere or run.turns > 0, str((run.reason or Status.STALLED).words)
        run = _start(first.qvi, first.space, first.options, share)
        run.history = first.history
        run.before = len(run.history)
        run.elsewhere = turned and share != shares[0] and not inexact
        run.best = (np.inf, run.before)
        _iterate(run)
        name = f"condensed, friction's share {share.early:g}, then {share.late:g}"
        attempts += (_attempted(run, name, f"the start before ended {ended}"),)
        found = _accuracy(run)
        if found < accuracy:
            best, accuracy = run, found
        if run.reason in last:
            break
    if run.reason is Status.TIME_LIMIT and not inexact:
        best.reason, best.message = run.reason, ""
    best.attempts = attempts
    return best


def _attempted(run: _Run, name: str, reason: str) -> Attempt:
    return Attempt(name, reason, run.reason or Status.STALLED, len(run.history) - run.before)


def _accuracy(run: _Run) -> float:
    """The tolerance at which the certificate of the run's best point passes."""
    outcome = _outcome(run)
    return certify(run.qvi, outcome.z, outcome.m_N, outcome.m_T, outcome.nu).accuracy


def _start(qvi: FrictionQVI, space: Coordinates, options: CondensedOptions, shares: PathWeights | None = None) -> _Run:
    """Reduce about z = 0, and begin where the contact would be bonded."""
    base = space.base(np.zeros(qvi.n))
    bonded = space.bonded(base)
    stress = max(1e-300, *(float(np.abs(part).max(initial=0.0)) for part in space.tractions(base, bonded)))
    problem = Complementarity(qvi, space, base, stress, shares or space.shares[0])
    stiffness = qvi.contact_stiffness
    interior = InteriorPoint(problem, stress / stiffness if stiffness > 0.0 else 1.0)
    interior.start_at(problem.restricted(bonded))
    run = _Run(qvi, space, base, problem, interior, options, began=time.perf_counter())
    if not problem.system.last_digits:
        interior.finest = max(interior.finest, _FINER * run.final_gap)
    return run


def _begin_near(run: _Run) -> bool | None:
    """Two iterations from the state to start from, if there is one; back to where it was if their steps are short.

    Returns whether they were long; None without a state.
    """
    start = run.options.initial
    if not (isinstance(start, Start) and start.fits(run.qvi)):
        return None
    interior, usual = run.interior, run.interior.point.y
    start_near(interior, run.problem.restricted(run.space.coordinates(start.z)), start)
    run.warm = all(_step_of(run) >= enough for enough in _FAR_ENOUGH)
    if not run.warm:
        interior.start_at(usual)
    return run.warm


def _step_of(run: _Run) -> float:
    """The length of the step of one iteration, recorded; 0 where there is none."""
    residuals = run.interior.residuals()
    measures = run.interior.measures(residuals)
    if not np.isfinite(measures.worst) or _limit(run, measures) is not None:
        return 0.0
    try:
        length = run.interior.iterate(residuals)
    except LinAlgError:
        length = 0.0
    _record(run, measures)
    return length


def _iterate(run: _Run) -> None:
    """Interior point method and defect corrections in turn, until the next correction would be lost in rounding."""
    final = run.final_gap
    gap = max(final, _FIRST_GAP)
    while True:
        _reach(run, gap)
        if run.reason is not None:
            return
        contraction = run.sizes[-1] / run.steps[-1] if run.sizes and run.steps[-1] > 0.0 else 1.0
        step = run.relative(run.space.length(run.problem.full(run.interior.point.y)))
        if gap == final and run.sizes and contraction * step <= _ENOUGH:
            run.reason = Status.SOLVED if run.problem.contradiction() <= _CONTRADICTION else Status.INNER_INFEASIBLE
            return
        _correct(run, step)
        gap = final
        if len(run.sizes) == 1 and run.sizes[0] > SLOW_CONTRACTION:
            run.reason, run.message = Status.ILL_CONDITIONED, f"defect corrections shrink by {run.sizes[0]:.0e} only"
            return
        if run.sizes[-1] > _HOPELESS * max(step, _HALVED * run.sizes[-2] if len(run.sizes) > 1 else 0.0):
            at_floor = run.sizes[-1] <= _FLOOR
            run.reason = Status.SOLVED if at_floor else Status.ILL_CONDITIONED
            return


def _correct(run: _Run, step: float) -> None:
    """Move the base to the current point; records what the reduced problem had missed."""
    y = run.problem.full(run.interior.point.y)
    after = run.space.base(run.space.move(run.base, y))
    run.steps.append(step)
    run.sizes.append(run.relative(run.space.defect(run.base, y, after)))
    run.base = after
    run.problem.rebase(after)
    point = run.interior.point
    run.interior.point = Point(np.zeros_like(point.y), point.values, len(point.s))
    run.best = (np.inf, len(run.history))


def _reach(run: _Run, gap: float) -> None:
    """Iterate to a gap, around turns of the central path; ends at the best point on the way."""
    run.last_gap = np.inf
    run.path, run.clear, run.force, run.unsettled = None, None, np.inf, np.inf
    run.kept = (np.inf, run.interior.point)
    _iterate_to(run, gap)
    run.interior.point = run.kept[1] or run.interior.point


def _iterate_to(run: _Run, gap: float) -> None:
    while True:
        residuals = run.interior.residuals()
        measures = run.interior.measures(residuals)
        worst = _worst(run, measures, residuals)
        if worst < run.kept[0]:
            run.kept = (worst, run.interior.point)
        stalled = run.path is None and _stalled(run, measures)
        if _reached(run, measures, gap, stalled) and (stalled or _settled(run, residuals)):
            return
        _prepare(run, measures)
        if stalled:
            _turn(run, measures)
        run.reason = _limit(run, measures) or run.reason
        if run.reason is None:
            _advance(run, residuals)
        if run.reason is not None:
            return
        _record(run, measures)


def _limit(run: _Run, measures: Measures) -> Status | None:
    """What ends the iteration whatever its progress."""
    if not np.isfinite(measures.gap):
        return Status.DIVERGED
    if len(run.history) >= run.options.max_iterations:
        return Status.MAX_ITERATIONS
    if deadline.over:
        return Status.TIME_LIMIT
    return Status.STALLED if len(run.history) - run.before >= _ONE_START else None


def _prepare(run: _Run, measures: Measures) -> None:
    """Friction's own share once slacks fit; a sharper kink where it lags behind; the larger matrix where it is needed.

    The larger Newton matrix is taken once the smaller one spoils multipliers.
    """
    run.force, run.last_gap = measures.force, measures.gap
    problem, interior = run.problem, run.interior
    if run.path is None and measures.slack <= _FITTED:
        interior.settle()
    if measures.gap < _LATE and measures.kink > max(measures.gap, _SLACK):
        interior.sharpen()
    affordable = problem.system.last_digits and problem.S.shape[0] + len(problem.weights) <= _LARGEST_SADDLE
    interior.accurate = affordable and (interior.accurate or (measures.force > _SPOILT and measures.gap < _LATE))


def _reached(run: _Run, measures: Measures, gap: float, stalled: bool) -> bool:
    """Whether the gap is reached and no residual is left but what rounding makes."""
    balanced = measures.force <= _FORCE or (measures.force <= _FORCE_FLOOR and measures.force > _HALVED * run.force)
    if run.last_gap < 10.0 * gap and measures.gap > _HALVED * run.last_gap:
        gap = 10.0 * gap  # at its floor
    if stalled and measures.force <= _FORCE_FLOOR:  # where points touch without load the last digits do not come
        gap = max(gap, _COARSEST_GAP)
    return measures.gap <= gap and max(measures.slack, measures.kink) <= _SLACK and (balanced or stalled)


def _settled(run: _Run, residuals: Residuals) -> bool:
    """Whether the residual of y moves nothing any more, in the energy norm, or does not shrink any more.

    What is little beside the largest force may be much in a direction in which the body is soft.
    """
    if run.scale == 0.0:  # before the first defect correction digits do not count
        return True
    before, run.unsettled = run.unsettled, _residual(run, residuals)
    return run.unsettled <= _ENOUGH or run.unsettled > _HALVED * before


def _residual(run: _Run, residuals: Residuals | None = None) -> float:
    """The residual of y in the energy norm, relative."""
    force = (residuals or run.interior.residuals()).force
    return run.problem.system.norm(force) / run.scale if run.scale > 0.0 else 0.0


def _worst(run: _Run, measures: Measures, residuals: Residuals) -> float:
    """What the best point is chosen by; forces count as much as the gap where their last digits are within reach.

    Else they count by the error of the stress that they make: the stiffer the bounds, the more digits they lose, and
    where the body is soft, as at joints that open, little force is much stress.
    """
    if run.problem.system.last_digits:
        return measures.worst
    worst = max(_distance(run, measures), measures.force / _FORCE_FLOOR)
    if measures.gap > _LATE or worst >= run.kept[0] or not run.base.strain_energy > 0.0:
        return worst
    error = run.problem.system.norm(residuals.force) / float(np.sqrt(2.0 * run.base.strain_energy))
    return max(worst, error / _UNBALANCED)


def _distance(run: _Run, measures: Measures) -> float:
    """How far gap, slacks and kinks are from what they may be, the largest quotient; forces follow from them."""
    return max(measures.gap / run.final_gap, measures.slack / _SLACK, measures.kink / _SLACK)


def _stalled(run: _Run, measures: Measures) -> bool:
    """Whether nothing was gained for `patience` iterations."""
    worst = _distance(run, measures)
    if worst < _PROGRESS * run.best[0]:
        run.best = (worst, len(run.history))
    return len(run.history) - run.best[1] >= run.problem.system.patience


def _turn(run: _Run, measures: Measures) -> None:
    """Follow the central path from here on, if there is one.

    It is looked for from the last point from which a step was long: where steps have become short, before the turn, the
    iterate is far off the path, and Newton's matrix nearly singular there.
    """
    if measures.slack > _ON_PATH:
        run.reason, run.message = Status.INNER_INFEASIBLE, f"bounds are violated by {measures.slack:.1e}"
    elif run.turns >= _TURNS or not run.interior.parameter() > 0.0:
        run.reason = Status.STALLED
    else:
        run.interior.point = run.clear or run.interior.point
        run.path, run.turns = CentralPath(run.interior), run.turns + 1


def _advance(run: _Run, residuals: Residuals) -> None:
    """One iteration of the interior point method, or one step along the central path."""
    try:
        if run.path is None:
            before = run.interior.point
            if run.interior.iterate(residuals) >= _LONG:
                run.clear = before
            return
        run.path.advance()
    except LinAlgError as error:
        run.reason, run.message = Status.STALLED, f"Newton's matrix: {error}"
        return
    if run.path.lost:
        run.reason, run.message = Status.STALLED, "the interior point method stalled"
    elif run.path.passed:
        run.path, run.clear, run.best = None, None, (np.inf, len(run.history))


def _record(run: _Run, measures: Measures) -> None:
    y = run.interior.point.y
    normal, _ = run.problem.tractions(y)
    now = time.perf_counter()
    entry = Iteration(
        len(run.history) + 1, measures.worst, run.problem.energy(y),
        float(run.qvi.W @ normal), None, 1, now - run.began,
    )  # fmt: skip
    run.began = now
    run.history.append(entry)
    report(Progress("condensed", entry))
    if run.options.callback is not None:
        run.options.callback(entry)


def _outcome(run: _Run) -> Outcome:
    """The last point in the unknowns of (D2)."""
    point = run.interior.point
    z = run.space.move(run.base, run.problem.full(point.y))
    m_N, m_T, nu = run.problem.multipliers(point.y, point.lam)
    threshold = run.qvi.threshold(run.qvi.pressure(z))
    count = len(run.history)
    reason = run.reason or Status.STALLED
    found = run.feasibility
    return Outcome(reason, z, m_N, m_T, nu, threshold, run.history, count, run.message, feasibility=found)
