"""The condensed method: (D2) solved directly on what the contact feels, to the last digits.

    1  eliminate the interior once, with the Schur complement S on the contact's unknowns     (`systems`)
       or, where the contact is a large share of the body, nothing: all matrices are sparse
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
| corrections above 1e-6 that do not shrink                              | ill_conditioned               |
| the gap overflows                                                      | diverged                      |
| `max_iterations` done                                                  | max_iterations                |
| the time is over, see `deadline`                                        | time_limit                    |

What follows a start that ends without a certificate is said in `solvers.solve`.

In `docs/theory.md`: (D8).
"""

import time
from functools import cached_property
from typing import Final

import numpy as np
from numpy.linalg import LinAlgError

from solvers.basics.progress import Progress, deadline, report
from solvers.basics.status import Status
from solvers.condensed.complementarity import Complementarity
from solvers.condensed.interior_point import CentralPath, InteriorPoint, Measures, Point, Residuals, start_near
from solvers.condensed.systems import Coordinates, DenseCoordinates, PathWeights, SparseCoordinates
from solvers.inequality.problem import FrictionQVI
from solvers.inequality.rows import largest
from solvers.settings import CondensedOptions
from solvers.solution import Attempt, Iteration, Outcome, Start

_FIRST_GAP = 1e-5  # of the first defect correction: earlier its error is larger than that of the linear algebra
_SLACK, _FORCE = 1e-11, 1e-11  # residuals that a solution may have, see `Measures`
_COARSEST_GAP = 1e-11  # that will do if it does not shrink any more
_SPOILT, _LATE = 1e-11, 1e-4  # force residual, below this gap, from which on Newton steps are those of `Saddle`
_LARGEST_SADDLE = 2500  # unknowns of them
_FORCE_FLOOR = 1e-8  # the same if it does not shrink any more
_UNBALANCED = 1e-10  # error of the stress, in the energy norm and relative, that forces out of balance may make
_PROGRESS = 0.7
_LEAST_GAP = 2e-17  # that is asked for: the interior point method goes no further than half of it
_NO_GAP = 1e-19  # out of reach, so that iterations go on as long as they gain
_FINER_NEAR = 0.1  # of the gap that is asked for, from a state that is near
_FINER = 0.3  # of the gap that is asked for, at which iterations go on with the residuals alone
EXACT: Final = 1e-12  # relative defect correction that is not worth another one
_FLOOR = 1e-6  # above, a correction that no longer shrinks is no rounding
_HALVED = 0.5
_CONTRADICTION = 1e-6  # shear at points without friction, relative, above which the equations contradict each other
_HOPELESS = 0.3  # of the defect corrections' contraction
_FAR_ENOUGH = (0.5, 0.4)  # of the first steps from an earlier answer: shorter ones cost more than they gain
_LONG = 0.5  # of the way that Newton's method asks for
_TURNS = 12
_ONE_START = 300  # iterations of one start
LAST: Final = (Status.ILL_CONDITIONED, Status.MAX_ITERATIONS, Status.TIME_LIMIT)
"""How a start ends that no other follows."""

_FITTED = 1e-7  # slack residual from which on friction has its own share, see `InteriorPoint.settle`
_ON_PATH = 1e-4  # slack residual below which stalling means a turn of the path


class CondensedRun:
    """One start of the method, about z = 0 and from where the contact would be bonded; what an iteration changes.

    `history` is that of earlier starts, to which iterations are added; `elsewhere`: the path of one of them, with other
    shares of friction, had to turn; `near`: whether the state given was near, None without one.
    """

    def __init__(
        self, qvi: FrictionQVI, space: Coordinates, options: CondensedOptions, shares: PathWeights, *, setup: float,
        near: bool | None = None, history: list[Iteration] | None = None, elsewhere: bool = False,
    ) -> None:  # fmt: skip
        self.qvi, self.space, self.options, self.setup = qvi, space, options, setup
        self.near, self.elsewhere = near, elsewhere
        self.history = [] if history is None else history
        self.before = len(self.history)  # iterations of earlier starts
        self.best = (np.inf, self.before)  # the least distance, and after how many iterations
        self.ended: Status | None = None
        self.message = ""
        self.warm = False  # whether it began near the answer to a problem before
        self.turns, self.scale = 0, 0.0  # of the path; energy norm of the first step
        self.steps: list[float] = []  # relative lengths of the steps between corrections
        self.sizes: list[float] = []  # relative sizes of the corrections
        self.base = space.base(np.zeros(qvi.n))
        bonded = space.bonded(self.base)
        stress = max(1e-300, largest(self.base.tractions + space.E @ bonded))
        self.problem = Complementarity(qvi, space, self.base, stress, shares)
        stiffness = qvi.contact_stiffness
        self.interior = InteriorPoint(self.problem, stress / stiffness if stiffness > 0.0 else 1.0)
        self.interior.start_at(self.problem.restricted(bonded))
        if not self.problem.system.last_digits:
            self.interior.finest = max(self.interior.finest, _FINER * self.final_gap)
        self._renew()
        self.began = time.perf_counter()

    def _renew(self) -> None:
        """Forget all iterates but the last."""
        self.last_gap = self.force = np.inf  # gap, and residual of the iteration before
        self.unsettled = np.inf  # energy norm of the residual of y when last all else was reached
        self.path: CentralPath | None = None
        self.clear: Point | None = None  # the last point from which a step was long
        self.kept = (np.inf, self.interior.point)  # the best point, see `_worst`

    @classmethod
    def of(cls, qvi: FrictionQVI, options: CondensedOptions) -> "CondensedRun":
        """The usual start, in the coordinates asked for, or those that cost less."""
        began = time.perf_counter()
        wanted = options.system
        if wanted == "auto":
            wanted = "dense" if qvi.stiffness.condensing_pays(qvi.contact) else "sparse"
        space = SparseCoordinates(qvi) if wanted == "sparse" else DenseCoordinates(qvi)
        return cls(qvi, space, options, space.shares[0], setup=time.perf_counter() - began)

    def again(self, shares: PathWeights, *, turned: bool) -> "CondensedRun":
        """Another start with these shares of friction; `turned`: a turn of the path so far is of interest."""
        elsewhere = turned and (self.elsewhere or self.turns > 0)
        return CondensedRun(
            self.qvi, self.space, self.options, shares, setup=self.setup, near=self.near, history=self.history,
            elsewhere=elsewhere,
        )  # fmt: skip

    @property
    def reason(self) -> Status:
        """How it ended."""
        return self.ended or Status.STALLED

    def attempt(self, name: str, why: str) -> Attempt:
        """The record of this start."""
        return Attempt(name, why, self.reason, len(self.history) - self.before)

    @cached_property
    def final_gap(self) -> float:
        """The gap at which the interior point method stops.

        At a distance r from where slip ends s λ is about r², in the unit of the gap: points of an edge of that length
        have no sticking or slipping of their own before the gap is well below. The more so for tractions, which are
        λ over r. The length of r = 1 is that of the contact, each bed of a wall one of its own. From a state that is
        near the last step is longer and goes less beyond what is asked for.
        """
        system, gap = self.problem.system, self.options.gap * (_FINER_NEAR if self.warm else 1.0)
        least = _NO_GAP if system.last_digits else _LEAST_GAP
        return min(gap, max(gap * (self.problem.least_share / system.small) ** 2, least))

    def relative(self, length: float) -> float:
        """An energy norm over that of the first step."""
        self.scale = self.scale or length
        return length / self.scale if self.scale > 0.0 else 0.0

    def begin_near(self) -> None:
        """Two iterations from the state that is given, if any; back to where it was if their steps are short."""
        start = self.options.initial
        if not (isinstance(start, Start) and start.fits(self.qvi) and self.problem.weights.size):
            return  # where nothing is bounded all states are alike
        interior, usual = self.interior, self.interior.point.y
        start_near(interior, self.problem.restricted(self.space.coordinates(start.z)), start)
        self.near = self.warm = all(self._step_of() >= enough for enough in _FAR_ENOUGH)
        if not self.warm:
            interior.start_at(usual)

    def _step_of(self) -> float:
        """The length of the step of one iteration, recorded; 0 where there is none."""
        residuals = self.interior.residuals()
        measures = self.interior.measures(residuals)
        if not np.isfinite(measures.worst) or self._limit(measures) is not None:
            return 0.0
        try:
            length = self.interior.iterate(residuals)
        except LinAlgError:
            length = 0.0
        self._record(measures)
        return length

    def iterate(self) -> None:
        """Interior point method and defect corrections in turn, until the next correction would be lost in rounding."""
        final = self.final_gap
        gap = max(final, _FIRST_GAP)
        while True:
            self._reach(gap)
            if self.ended is not None:
                return
            contraction = self.sizes[-1] / self.steps[-1] if self.sizes and self.steps[-1] > 0.0 else 1.0
            step = self.relative(self.space.length(self.problem.full(self.interior.point.y)))
            if gap == final and self.sizes and contraction * step <= EXACT:
                met = self.problem.contradiction() <= _CONTRADICTION
                self.ended = Status.SOLVED if met else Status.INNER_INFEASIBLE
                return
            self._correct(step)
            gap = final
            if self.sizes[-1] > _HOPELESS * max(step, _HALVED * self.sizes[-2] if len(self.sizes) > 1 else 0.0):
                at_floor = self.sizes[-1] <= _FLOOR
                self.ended = Status.SOLVED if at_floor else Status.ILL_CONDITIONED
                self.message = f"defect corrections end at {self.sizes[-1]:.0e} of the first step"
                return

    def _correct(self, step: float) -> None:
        """Move the base to the current point; records what the reduced problem had missed."""
        y = self.problem.full(self.interior.point.y)
        after = self.space.moved(self.base, y)
        self.steps.append(step)
        self.sizes.append(self.relative(self.space.defect(self.base, y, after)))
        self.base = after
        self.problem.rebase(after)
        point = self.interior.point
        self.interior.point = Point(np.zeros_like(point.y), point.values, len(point.s))
        self.best = (np.inf, len(self.history))

    def _reach(self, gap: float) -> None:
        """Iterate to a gap, around turns of the central path; ends at the best point on the way."""
        self._renew()
        while True:
            residuals = self.interior.residuals()
            measures = self.interior.measures(residuals)
            worst = self._worst(measures, residuals)
            if worst < self.kept[0]:
                self.kept = (worst, self.interior.point)
            stalled = self.path is None and self._stalled(measures)
            if self._reached(measures, residuals, gap, stalled) and (stalled or self._settled(residuals)):
                break
            self._prepare(measures)
            if stalled:
                self._turn(measures)
            self.ended = self._limit(measures) or self.ended
            if self.ended is None:
                self._advance(residuals)
            if self.ended is not None:
                break
            self._record(measures)
        self.interior.point = self.kept[1]

    def _limit(self, measures: Measures) -> Status | None:
        """What ends the iteration whatever its progress."""
        if not np.isfinite(measures.gap):
            return Status.DIVERGED
        count = len(self.history)
        if count >= self.options.max_iterations:
            return Status.MAX_ITERATIONS
        if deadline.over:
            return Status.TIME_LIMIT
        return Status.STALLED if count - self.before >= _ONE_START else None

    def _prepare(self, measures: Measures) -> None:
        """Friction's own share once slacks fit, a sharper kink where it lags, and `Saddle` once multipliers spoil."""
        self.force, self.last_gap = measures.force, measures.gap
        problem, interior = self.problem, self.interior
        if self.path is None and measures.slack <= _FITTED:
            interior.settle()
        if measures.gap < _LATE and measures.kink > max(measures.gap, _SLACK):
            interior.sharpen()
        affordable = problem.system.last_digits and problem.S.shape[0] + len(problem.weights) <= _LARGEST_SADDLE
        interior.accurate = affordable and (interior.accurate or (measures.force > _SPOILT and measures.gap < _LATE))

    def _reached(self, measures: Measures, residuals: Residuals, gap: float, stalled: bool) -> bool:
        """Whether the gap is reached and no residual is left but what rounding makes."""
        balanced = measures.force <= _FORCE
        if not balanced and measures.force > _HALVED * self.force:  # it no longer shrinks
            balanced = measures.force <= _FORCE_FLOOR or self._unbalanced(residuals) <= _UNBALANCED
        if self.last_gap < 10.0 * gap and measures.gap > _HALVED * self.last_gap:
            gap = 10.0 * gap  # at its floor
        if stalled and measures.force <= _FORCE_FLOOR:  # where points touch without load the last digits do not come
            gap = max(gap, _COARSEST_GAP)
        return measures.gap <= gap and max(measures.slack, measures.kink) <= _SLACK and (balanced or stalled)

    def _settled(self, residuals: Residuals) -> bool:
        """Whether the residual of y moves nothing, however soft the body is there, or does not shrink any more."""
        if self.scale == 0.0:  # before the first defect correction digits do not count
            return True
        before, self.unsettled = self.unsettled, self.residual(residuals)
        return self.unsettled <= EXACT or self.unsettled > _HALVED * before

    def residual(self, residuals: Residuals | None = None) -> float:
        """The residual of y in the energy norm, relative."""
        force = (residuals or self.interior.residuals()).force
        return self.problem.system.norm(force) / self.scale if self.scale > 0.0 else 0.0

    def _worst(self, measures: Measures, residuals: Residuals) -> float:
        """What the best point is chosen by; forces count like the gap where their last digits are within reach.

        Else they count by the error of the stress: where the body is soft, as at open joints, a little force is much.
        """
        if self.problem.system.last_digits:
            return measures.worst
        worst = max(self._distance(measures), measures.force / _FORCE_FLOOR)
        if measures.gap > _LATE or worst >= self.kept[0] or not self.base.strain_energy > 0.0:
            return worst
        return max(worst, self._unbalanced(residuals) / _UNBALANCED)

    def _unbalanced(self, residuals: Residuals) -> float:
        """The error of the stress, in the energy norm, relative, that forces out of balance make in sparse systems."""
        if self.problem.system.last_digits or not self.base.strain_energy > 0.0:
            return np.inf
        return self.problem.system.norm(residuals.force) / float(np.sqrt(2.0 * self.base.strain_energy))

    def _distance(self, measures: Measures) -> float:
        """How far gap, slacks and kinks are from what they may be, the largest quotient; forces follow from them."""
        return max(measures.gap / self.final_gap, measures.slack / _SLACK, measures.kink / _SLACK)

    def _stalled(self, measures: Measures) -> bool:
        """Whether nothing was gained for `patience` iterations."""
        worst, count = self._distance(measures), len(self.history)
        if worst < _PROGRESS * self.best[0]:
            self.best = (worst, count)
        return count - self.best[1] >= self.problem.system.patience

    def _turn(self, measures: Measures) -> None:
        """Follow the central path, if there is one, from the last point from which a step was long.

        Where steps have become short the iterate is far off the path, and Newton's matrix nearly singular.
        """
        if measures.slack > _ON_PATH:
            self.ended, self.message = Status.INNER_INFEASIBLE, f"bounds are violated by {measures.slack:.1e}"
        elif self.turns >= _TURNS or not self.interior.parameter() > 0.0:
            self.ended = Status.STALLED
        else:
            self.interior.point = self.clear or self.interior.point
            self.path, self.turns = CentralPath(self.interior), self.turns + 1

    def _advance(self, residuals: Residuals) -> None:
        """One iteration of the interior point method, or one step along the central path."""
        try:
            if self.path is None:
                before = self.interior.point
                if self.interior.iterate(residuals) >= _LONG:
                    self.clear = before
                return
            self.path.advance()
        except LinAlgError as error:
            self.ended, self.message = Status.STALLED, f"Newton's matrix: {error}"
            return
        if self.path.lost:
            self.ended, self.message = Status.STALLED, "the interior point method stalled"
        elif self.path.passed:
            self.path, self.clear, self.best = None, None, (np.inf, len(self.history))

    def _record(self, measures: Measures) -> None:
        y = self.interior.point.y
        normal = self.problem.tractions(y)[: self.qvi.m]
        now = time.perf_counter()
        entry = Iteration(
            len(self.history) + 1, measures.worst, self.problem.energy(y),
            float(self.qvi.W @ normal), None, 1, now - self.began,
        )  # fmt: skip
        self.began = now
        self.history.append(entry)
        report(Progress("condensed", entry))

    def outcome(self) -> Outcome:
        """The last point in the unknowns of (D2)."""
        point, y = self.interior.point, self.problem.full(self.interior.point.y)
        m_N, m_T, nu = self.problem.multipliers(point.y, point.lam)
        turned = "The central path has a turning point before this solution" if self.turns or self.elsewhere else ""
        return Outcome(
            self.reason, self.space.move(self.base, y), m_N, m_T, nu, self.history, len(self.history), self.message,
            setup=self.setup, form=self.space.name, corrections=tuple(self.sizes), turned=turned,
            near=self.near,
        )  # fmt: skip
