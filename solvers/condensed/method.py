"""The condensed method: (D2) solved directly, by an interior point method on the unknowns of the contact.

    1  eliminate the interior once, with the Schur complement S on the unknowns of the contact  (`systems`);
       if the contact is a large share of the body, keep all unknowns and sparse matrices
    2  solve the mixed complementarity problem by an interior point method                    (`interior_point`);
       if it stalls, follow the central path around its turns                                 (`CentralPath`)
    3  move z to the solution, compute the gradient without the rounding inside K, and repeat step 2 about this z: a
       defect correction, until the linear residual has reached its round-off floor

| stops when                                                             | status before the certificate |
|------------------------------------------------------------------------|-------------------------------|
| gap ≤ `gap`, the next correction is predicted to be below 1e-12        | solved                        |
| gap ≤ `gap`, corrections below 1e-6 no longer shrink                   | solved                        |
| no progress, and bounds or equations are violated                      | inner_infeasible              |
| no progress: too many turns, path given up, or a singular matrix       | stalled                       |
| corrections above 1e-6 do not shrink                                   | ill_conditioned               |
| the gap overflows                                                      | diverged                      |
| `max_iterations` done                                                  | max_iterations                |
| the time is over, see `deadline`                                       | time_limit                    |

`solvers.solve` decides which other start follows one that ends without a certificate.

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
from solvers.solution import Attempt, Iteration, Outcome

_FIRST_GAP = 1e-5  # gap before the first defect correction; at larger gaps the iteration's error exceeds that of S
_SLACK, _FORCE = 1e-11, 1e-11  # largest residuals of a solution, see `Measures`
_FORCE_FLOOR = 1e-8  # largest residual `force` of a solution if it no longer shrinks
_COARSEST_GAP = 1e-11  # largest gap of a solution if the iteration has stalled
_LATE = 1e-4  # gap below which a kink that lags behind is sharpened, and the error of the stress is computed
_UNBALANCED = 1e-10  # largest error of the stress by residual forces, in the energy norm, relative
_PROGRESS = 0.7  # factor by which the distance has to fall within `patience` iterations
_LEAST_GAP = 2e-17  # least gap of sparse systems, twice the least of the interior point method
_UNREACHABLE_GAP = 1e-19  # least gap of dense systems, so that iterations go on until they gain nothing
_WARM_FACTOR = 0.1  # factor of the option `gap` if the start was near a given state
_TAU_FACTOR = 0.3  # gap, over the final one, at which τ is no longer reduced in sparse systems
EXACT: Final = 1e-12  # relative size of a defect correction that is not worth computing
_LARGEST_ROUNDING = 1e-6  # relative size of a correction above which it cannot be rounding
_HALVED = 0.5
_CONTRADICTION = 1e-6  # shear at points without friction, relative, above which the equations contradict each other
_DIVERGING = 0.3  # size of a defect correction, over the step before it, above which they do not converge
_LEAST_WARM_STEPS = (0.5, 0.4)  # first steps from a given state; with shorter ones the start gains nothing
_LONG_STEP = 0.5  # length above which a step counts as long
_MOST_TURNS = 12
_MOST_ITERATIONS = 300  # iterations of one start
LAST: Final = (Status.ILL_CONDITIONED, Status.MAX_ITERATIONS, Status.TIME_LIMIT)
"""Reasons for the end of a run after which no other start is tried."""

_SHARPENING = 0.1  # factor of the weights ω of tension · pressure if the kink lags behind the gap
_SETTLED = 1e-7  # residual of slacks at which the late weights are taken, see `InteriorPoint.settle`
_ON_PATH = 1e-4  # residual of slacks below which a stalled iteration means a turn of the path


class CondensedRun:
    """A run of the method from one start: base z = 0, first point the bonded solution; and its state.

    `history` has the iterations of earlier runs, to which this run adds its own; `turned_before`: whether the path of
    an earlier run, with other weights, had a turn; `near`: whether the state `initial` was near, None without one.
    """

    def __init__(
        self, qvi: FrictionQVI, space: Coordinates, options: CondensedOptions, weights: PathWeights, *, setup: float,
        near: bool | None = None, history: list[Iteration] | None = None, turned_before: bool = False,
    ) -> None:  # fmt: skip
        self.qvi, self.space, self.options, self.setup = qvi, space, options, setup
        self.near, self.turned_before = near, turned_before
        self.history = [] if history is None else history
        self.before = len(self.history)  # number of iterations of earlier runs
        self.progress = (np.inf, self.before)  # least distance, see `_distance`, and number of iterations until then
        self.end: Status | None = None  # why the run ended, None before its end
        self.message = ""
        self.is_warm = False  # whether the run began near the state `initial`
        self.turns, self.scale = 0, 0.0  # number of turns of the path; energy norm of the first step
        self.steps: list[float] = []  # relative lengths of the steps between corrections
        self.sizes: list[float] = []  # relative sizes of the corrections
        self.base = space.base(np.zeros(qvi.n))
        bonded = space.bonded(self.base)
        stress = max(1e-300, largest(self.base.tractions + space.E @ bonded))
        self.problem = Complementarity(qvi, space, self.base, stress, weights)
        stiffness = qvi.contact_stiffness
        self.interior = InteriorPoint(self.problem, stress / stiffness if stiffness > 0.0 else 1.0)
        self.interior.start_at(self.problem.restricted(bonded))
        if not self.problem.system.last_digits:
            self.interior.finest = max(self.interior.finest, _TAU_FACTOR * self.final_gap)
        self._reset()
        self.began = time.perf_counter()

    def _reset(self) -> None:
        """Prepare for the next gap; only the current iterate is kept."""
        self.last_gap = self.force = np.inf  # gap and `force` of the iteration before
        self.last_residual = np.inf  # residual of y, in the energy norm, at the last iterate that met all other tests
        self.path: CentralPath | None = None
        self.long_step_point: Point | None = None  # the last point from which a step was long
        self.best_point = (np.inf, self.interior.point)  # the best point and its error, see `_worst`

    @classmethod
    def of(cls, qvi: FrictionQVI, options: CondensedOptions) -> "CondensedRun":
        """The usual start, in the coordinates of the option `system`, by default those with fewer operations."""
        began = time.perf_counter()
        system = options.system
        if system == "auto":
            system = "dense" if qvi.stiffness.condensing_pays(qvi.contact) else "sparse"
        space = SparseCoordinates(qvi) if system == "sparse" else DenseCoordinates(qvi)
        return cls(qvi, space, options, space.paths[0], setup=time.perf_counter() - began)

    def again(self, weights: PathWeights) -> "CondensedRun":
        """Another run, with these path weights, from the usual start."""
        turned_before = self.turned_before or (self.turns > 0 and not self.is_warm)
        return CondensedRun(
            self.qvi, self.space, self.options, weights, setup=self.setup, near=self.near, history=self.history,
            turned_before=turned_before,
        )  # fmt: skip

    @property
    def reason(self) -> Status:
        """Why the run ended."""
        return self.end or Status.STALLED

    def attempt(self, name: str, why: str) -> Attempt:
        """The record of this run."""
        return Attempt(name, why, self.reason, len(self.history) - self.before)

    @cached_property
    def final_gap(self) -> float:
        """The gap at which the interior point method stops.

        At a distance r from the end of a slip zone s λ is about r², in the unit of the gap, with r = 1 the length of
        the contact (of one bed of a wall). Points of an edge of length r neither stick nor slip clearly before the gap
        is well below r²; tractions, which are λ / r, need an even smaller gap. From a near state the last step does not
        end as far below the gap that is asked for, so that gap is reduced.
        """
        system, gap = self.problem.system, self.options.gap * (_WARM_FACTOR if self.is_warm else 1.0)
        least = _UNREACHABLE_GAP if system.last_digits else _LEAST_GAP
        return min(gap, max(gap * (self.problem.least_share / system.small) ** 2, least))

    def relative(self, length: float) -> float:
        """An energy norm over that of the first step, which the first call sets."""
        self.scale = self.scale or length
        return length / self.scale if self.scale > 0.0 else 0.0

    def begin_near(self) -> None:
        """Two iterations from the state `initial`, if it is given; back to the usual start if their steps are short."""
        start = self.options.initial
        if start is None or not self.problem.weights.size:
            return  # without bounds all starts are alike
        interior, usual_y = self.interior, self.interior.point.y
        start_near(interior, self.problem.restricted(self.space.coordinates(start.z)), start)
        self.near = self.is_warm = all(self._warm_step() >= least for least in _LEAST_WARM_STEPS)
        if not self.is_warm:
            interior.start_at(usual_y)

    def _warm_step(self) -> float:
        """The length of the step of one iteration, recorded; 0 if it fails."""
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
        """Interior point method and defect corrections in turn, until the next correction would be rounding."""
        final = self.final_gap
        gap = max(final, _FIRST_GAP)
        while True:
            self._reach(gap)
            if self.end is not None:
                return
            # The size of the next correction is predicted from that of the last one and the step since then.
            contraction = self.sizes[-1] / self.steps[-1] if self.sizes and self.steps[-1] > 0.0 else 1.0
            step = self.relative(self.space.length(self.problem.full(self.interior.point.y)))
            if gap == final and self.sizes and contraction * step <= EXACT:
                is_consistent = self.problem.contradiction() <= _CONTRADICTION
                self.end = Status.SOLVED if is_consistent else Status.INNER_INFEASIBLE
                return
            self._correct(step)
            gap = final
            if self.sizes[-1] > _DIVERGING * max(step, _HALVED * self.sizes[-2] if len(self.sizes) > 1 else 0.0):
                at_floor = self.sizes[-1] <= _LARGEST_ROUNDING
                self.end = Status.SOLVED if at_floor else Status.ILL_CONDITIONED
                self.message = f"defect corrections end at {self.sizes[-1]:.0e} of the first step"
                return

    def _correct(self, step: float) -> None:
        """Move the base to the current point, and record the size of this defect correction."""
        y = self.problem.full(self.interior.point.y)
        after = self.space.moved(self.base, y)
        self.steps.append(step)
        self.sizes.append(self.relative(self.space.defect(self.base, y, after)))
        self.base = after
        self.problem.rebase(after)
        point = self.interior.point
        self.interior.point = Point(np.zeros_like(point.y), point.values, len(point.s))
        self.progress = (np.inf, len(self.history))

    def _reach(self, gap: float) -> None:
        """Iterate until the gap is reached, around turns of the central path; ends at the best point."""
        self._reset()
        while True:
            residuals = self.interior.residuals()
            measures = self.interior.measures(residuals)
            worst = self._worst(measures, residuals)
            if worst < self.best_point[0]:
                self.best_point = (worst, self.interior.point)
            stalled = self.path is None and self._is_stalled(measures)
            if self._is_reached(measures, residuals, gap, stalled) and (stalled or self._is_settled(residuals)):
                break
            self._prepare(measures)
            if stalled:
                self._turn(measures)
            self.end = self._limit(measures) or self.end
            if self.end is None:
                self._advance(residuals)
            if self.end is not None:
                break
            self._record(measures)
        self.interior.point = self.best_point[1]

    def _limit(self, measures: Measures) -> Status | None:
        """The reason to end the run at once: divergence, or a limit of iterations or time."""
        if not np.isfinite(measures.gap):
            return Status.DIVERGED
        count = len(self.history)
        if count >= self.options.max_iterations:
            return Status.MAX_ITERATIONS
        if deadline.over:
            return Status.TIME_LIMIT
        return Status.STALLED if count - self.before >= _MOST_ITERATIONS else None

    def _prepare(self, measures: Measures) -> None:
        """Settings of the next step: late weights once slacks fit, and a sharper kink if it lags behind."""
        self.force, self.last_gap = measures.force, measures.gap
        problem, interior = self.problem, self.interior
        if self.path is None and measures.slack <= _SETTLED:
            interior.settle()
        if measures.gap < _LATE and measures.kink > max(measures.gap, _SLACK):
            interior.omega[problem.weights.size :] *= _SHARPENING  # where σ_N = 0 both factors fall like √τ only

    def _is_reached(self, measures: Measures, residuals: Residuals, gap: float, stalled: bool) -> bool:
        """Whether the gap is reached, and all residuals are rounding."""
        is_balanced = measures.force <= _FORCE
        if not is_balanced and measures.force > _HALVED * self.force:  # it no longer shrinks
            is_balanced = measures.force <= _FORCE_FLOOR or self._unbalanced(residuals) <= _UNBALANCED
        if self.last_gap < 10.0 * gap and measures.gap > _HALVED * self.last_gap:
            gap = 10.0 * gap  # the gap no longer shrinks
        if stalled and measures.force <= _FORCE_FLOOR:  # points that touch without pressure limit the gap
            gap = max(gap, _COARSEST_GAP)
        return measures.gap <= gap and max(measures.slack, measures.kink) <= _SLACK and (is_balanced or stalled)

    def _is_settled(self, residuals: Residuals) -> bool:
        """Whether the residual of y is small in the energy norm, or no longer shrinks."""
        if self.scale == 0.0:  # before the first defect correction no more digits are needed
            return True
        before, self.last_residual = self.last_residual, self.residual(residuals)
        return self.last_residual <= EXACT or self.last_residual > _HALVED * before

    def residual(self, residuals: Residuals | None = None) -> float:
        """The residual of y in the energy norm, over the first step."""
        force = (residuals or self.interior.residuals()).force
        return self.problem.system.norm(force) / self.scale if self.scale > 0.0 else 0.0

    def _worst(self, measures: Measures, residuals: Residuals) -> float:
        """The error by which the best point is chosen; in sparse systems it includes that of the stress.

        Where the body is soft, as at open joints, a small residual force causes a large error of the stress.
        """
        if self.problem.system.last_digits:
            return measures.worst
        worst = max(self._distance(measures), measures.force / _FORCE_FLOOR)
        if measures.gap > _LATE or worst >= self.best_point[0] or not self.base.strain_energy > 0.0:
            return worst
        return max(worst, self._unbalanced(residuals) / _UNBALANCED)

    def _unbalanced(self, residuals: Residuals) -> float:
        """Relative error of the stress by residual forces, in the energy norm; infinite in dense systems."""
        if self.problem.system.last_digits or not self.base.strain_energy > 0.0:
            return np.inf
        return self.problem.system.norm(residuals.force) / float(np.sqrt(2.0 * self.base.strain_energy))

    def _distance(self, measures: Measures) -> float:
        """The largest quotient of gap, slack and kink and their limits."""
        return max(measures.gap / self.final_gap, measures.slack / _SLACK, measures.kink / _SLACK)

    def _is_stalled(self, measures: Measures) -> bool:
        """Whether there was no progress for `patience` iterations."""
        worst, count = self._distance(measures), len(self.history)
        if worst < _PROGRESS * self.progress[0]:
            self.progress = (worst, count)
        return count - self.progress[1] >= self.problem.system.patience

    def _turn(self, measures: Measures) -> None:
        """Follow the central path from the last point from which a step was long; end the run if there is no path.

        After short steps the iterate is far off the path, and Newton's matrix nearly singular.
        """
        if measures.slack > _ON_PATH:
            self.end, self.message = Status.INNER_INFEASIBLE, f"bounds are violated by {measures.slack:.1e}"
        elif self.turns >= _MOST_TURNS or not self.interior.parameter() > 0.0:
            self.end = Status.STALLED
        else:
            self.interior.point = self.long_step_point or self.interior.point
            self.path, self.turns = CentralPath(self.interior), self.turns + 1

    def _advance(self, residuals: Residuals) -> None:
        """One iteration of the interior point method, or one step along the central path."""
        try:
            if self.path is None:
                before = self.interior.point
                if self.interior.iterate(residuals) >= _LONG_STEP:
                    self.long_step_point = before
                return
            self.path.advance()
        except LinAlgError as error:
            self.end, self.message = Status.STALLED, f"Newton's matrix: {error}"
            return
        if self.path.lost:
            self.end, self.message = Status.STALLED, "the interior point method stalled"
        elif self.path.passed:
            self.path, self.long_step_point, self.progress = None, None, (np.inf, len(self.history))

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
        """The outcome of the run, its point in the unknowns of (D2)."""
        point, y = self.interior.point, self.problem.full(self.interior.point.y)
        m_N, m_T, nu = self.problem.multipliers(point.y, point.lam)
        turned = "The central path has a turning point before this solution" if self.turns or self.turned_before else ""
        return Outcome(
            self.reason, self.space.move(self.base, y), m_N, m_T, nu, self.history, len(self.history), self.message,
            setup=self.setup, form=self.space.name, corrections=tuple(self.sizes), turned=turned,
            near=self.near,
        )  # fmt: skip
