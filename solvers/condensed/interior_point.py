"""Primal-dual interior point method for `Complementarity`, with Mehrotra's predictor and Gondzio's correctors.

The conditions are s λ = τ ω and tension · pressure = τ ω with weights ω (`omega`). Each iteration factorises their
Newton matrix once. With a = tension, b = pressure and the residual r = σ_N − (a − b):

    (S + BᵀW diag(λ/s) C) dy = …,    ds = slack − s − C dy,    dλ = (target − s λ − λ ds) / s,
    d(a + b) = (2 (target − a b) + (a − b) (dσ_N + r)) / (a + b).

Only the products are nonlinear, so a step of length t leaves 1 − t of every other residual. The kink of |σ_N| is
smoothed in proportion to the gap. One step length is taken for all unknowns, since the friction bound couples slacks
and multipliers. Among thousands of contact points those at the ends of joints open or slip one after the other, each at
a turn of the central path. For them ω of friction is small at first (`settle`), and a step may pass the few bounds that
would stop it (`past_few`). Sources, for convex problems: S. Mehrotra, SIAM J. Optim. 2 (1992); J. Gondzio, Comput.
Optim. Appl. 6 (1996). For this problem, which is not monotone, nothing is proved: hence `CentralPath` and certificate.

In `docs/theory.md`: (D6), (D7).
"""

from typing import NamedTuple

import numpy as np
from numpy.linalg import LinAlgError

from solvers.basics.types import Vector
from solvers.condensed.complementarity import Complementarity
from solvers.condensed.systems import SLOTS
from solvers.inequality.rows import largest
from solvers.solution import Start

_STEP_SHARE = 0.99  # least step, over the distance to the nearest bound
_NEIGHBOURHOOD = 1e-3  # least s λ / (τ ω) after a step
_SHORT_PREDICTOR = 0.1  # predictor steps shorter than this enter with the square of their length only
_CORRECTORS = 2
_REFINED = (0.0, 1e-8, 1e-14)  # residual of a step's equations, over their largest term, before a solve that is needed
_CORRECTOR_GAIN = 0.02  # least gain of the step length by a corrector
# Steps shorter than `_SHORT_STEP` pass the few bounds that stop them, if that lengthens them by this factor.
_SHORT_STEP, _LEAST_GAIN = 0.7, 1.3
_LARGEST_RISE = 2.0  # largest factor by which τ may rise in such a step
_KEPT_SHARE = 0.3  # share that slacks and multipliers keep when their bounds are passed
_MOST_CENTRING = 0.3  # largest centring if bounds may be passed: τ would else not fall at turns of a few bounds
_LAST_PASSING = 10.0  # τ, over the least τ, below which no bounds are passed
_PASSED_RESIDUAL = 1e-9  # slack residual above which τ stays at `_WAITING` times the least τ, where passing is allowed
_WAITING = 30.0
_START_SLACK = 0.1  # least slack at the start, over the scale of stress
_START_KINK = 1.0  # √(4 tension · pressure) at the start, over the scale of stress
_FINEST = 1e-17  # gap below which slacks and multipliers lose their digits
_TINY = 1e-300


class Point:
    """An iterate, or a step: y (k,), slacks s and multipliers λ (q,), tension and pressure (b,) at the points `split`.

    Attributes
    ----------
    values : (2q + 2b,) s, tension, λ, pressure; all > 0 in an iterate. The halves have the factors of the products
    s, lam, tension, pressure : views of its parts
    count : q

    """

    __slots__ = ("count", "half", "lam", "pressure", "s", "tension", "values", "y")

    def __init__(self, y: Vector, values: Vector, count: int) -> None:
        half = self.half = values.size // 2
        self.y, self.values, self.count = y, values, count
        self.s, self.tension = values[:count], values[count:half]
        self.lam, self.pressure = values[half : half + count], values[half + count :]

    @classmethod
    def of(cls, y: Vector, s: Vector, lam: Vector, tension: Vector, pressure: Vector) -> "Point":
        """A point from its parts."""
        return cls(y, np.concatenate([s, tension, lam, pressure]), s.size)

    @property
    def products(self) -> Vector:
        """All products s λ and tension · pressure (q + b,); for a step the terms of second order."""
        return self.values[: self.half] * self.values[self.half :]

    def moved(self, step: "Point", length: float) -> "Point":
        """The point after a step of this length."""
        return Point(self.y + length * step.y, self.values + length * step.values, self.count)


class Residuals(NamedTuple):
    """Residuals of an iterate."""

    force: Vector  # (k,) S y + c + BᵀWλ
    slack: Vector  # (q,) s less the slacks at y
    split: Vector  # (b,) σ_N − (tension − pressure)
    largest: float  # the largest entry of the terms of `force`


class Measures(NamedTuple):
    """Relative errors of an iterate; the scale of stress is that at the iterate."""

    gap: float  # Σ W s λ over stress × displacement × Σ W
    slack: float  # largest residual of slacks over their `sizes`, and of the points `split`, over the stress
    kink: float  # largest tension + pressure − |σ_N| over the stress
    force: float  # largest residual of forces, over their largest term or that of multipliers λ = displacement
    worst: float  # the largest of the four


class InteriorPoint:
    """The state of the method for one problem; `displacement` is the scale of λ.

    Attributes
    ----------
    point : the iterate
    omega : (q + b,) weights ω of the products on the central path, the early ones before `settle`
    settled : whether the late weights are taken, and bounds may be passed
    finest : the gap at which τ is not reduced any more
    least : the τ of that gap
    longest : largest step, over the distance to the nearest bound

    """

    def __init__(self, problem: Complementarity, displacement: float) -> None:
        self.problem, self.displacement = problem, displacement
        self.finest, self.least = _FINEST, 0.0
        self.start_at(np.zeros(problem.S.shape[0]))
        self._force_scale = displacement * float(np.abs(problem.force(np.ones(len(problem.weights)))).max(initial=0.0))

    def start_at(self, y: Vector) -> None:
        """Start from coordinates y (k,), with slacks kept away from zero."""
        problem = self.problem
        self.longest = problem.system.longest
        normal = problem.split_normal(y)
        smooth = np.hypot(normal, _START_KINK * problem.stress)
        s = np.maximum(problem.slack(y, smooth), _START_SLACK * problem.stress * problem.sizes)
        early = problem.early_omega
        lam = problem.start * self.displacement * early / np.maximum(problem.sizes, s / problem.stress)
        self.point = Point.of(y, s, lam, 0.5 * (smooth + normal), 0.5 * (smooth - normal))
        self._set_omega(np.concatenate([early, np.zeros(len(normal))]))
        self.settled, self._n_stragglers = False, 0
        kink = self.point.tension * self.point.pressure / max(self.parameter(), _TINY)  # equal at all points
        self.omega[len(early) :] = kink

    def residuals(self) -> Residuals:
        """Residuals of the current point."""
        problem, point = self.problem, self.point
        terms = (problem.S @ point.y, problem.c, problem.force(point.lam))
        slack = problem.slack_residual(point.y, point.s, point.tension + point.pressure)
        split = problem.split_residual(point.y, point.tension - point.pressure)
        return Residuals(terms[0] + terms[1] + terms[2], slack, split, largest(np.concatenate(terms)))

    def settle(self) -> None:
        """Take the late weights, and allow steps to pass bounds. Targets of tension · pressure do not change."""
        if self.settled:
            return
        tau, count = self.parameter(), len(self.point.s)
        self.omega[:count], self.settled = self.problem.omega, True
        self._n_stragglers = int(self.problem.system.stragglers * len(self.omega))
        self._set_omega(self.omega)
        self.omega[count:] *= tau / max(self.parameter(), _TINY)

    def measures(self, residuals: Residuals) -> Measures:
        """Relative errors of the current point."""
        problem = self.problem
        stress = problem.stress_at(self.point.y)
        unit = stress * (stress / problem.stress * self.displacement) * problem.total_weight
        gap = self._work(self.point) / max(unit, _TINY)
        slack, kink = largest(residuals.slack / problem.sizes) / stress, 0.0
        if residuals.split.size:
            slack = max(slack, largest(residuals.split) / stress)
            kink = 2.0 * largest(np.minimum(self.point.tension, self.point.pressure)) / stress
        size = max(self._force_scale, residuals.largest, _TINY)
        self.least = self.finest * unit / max(self._total_omega, _TINY)
        force = largest(residuals.force) / size
        return Measures(gap, slack, kink, force, max(gap, slack, kink, force))

    def iterate(self, residuals: Residuals) -> float:
        """One iteration; returns the length of its step."""
        point = self.point
        newton = Newton(self.problem, point, residuals)
        products, work = point.products, self._work(point)
        tau = self.parameter()
        # Mehrotra's predictor, the step to τ = 0. The work after it gives the centring, the factor of τ.
        affine = newton.step(-products)
        reach = min(1.0, _longest(point, affine))
        affine_work = max(self._work(point.moved(affine, reach)), 0.0)
        most = _MOST_CENTRING if self._n_stragglers else 1.0
        centring = min(most, max(min(1.0, affine_work / max(work, _TINY)) ** 3, 1e-6, (1.0 - reach) ** 3))
        damping = 1.0 if reach >= _SHORT_PREDICTOR else reach**2
        # The corrected step to the target, without the second order of the predictor.
        target = max(centring * tau, self.lowest(residuals, tau)) * self.omega
        comp = target - products - damping * affine.products
        may_pass = self._n_stragglers > 0 and tau > _LAST_PASSING * self.least
        step, length = _corrected(newton, point, comp, target, _SHORT_STEP if may_pass else 0.0)
        # Its length: short of the nearest bound, and until no product is far below the others.
        share = min(max(_STEP_SHARE, reach), self.longest)
        length, least = min(1.0, share * length), min(_NEIGHBOURHOOD, self._centrality(point))
        for _ in range(20):
            if self._centrality(point.moved(step, length)) >= 0.9 * least:
                break
            length *= 0.8
        if may_pass and length < _SHORT_STEP:
            return self.past_few(step, length)
        self.point = point.moved(step, length)
        return length

    def past_few(self, step: Point, length: float) -> float:
        """Take a longer step if only few bounds stop it: their slacks and multipliers keep a share of their values.

        The residuals of these bounds are reduced by the next steps. Returns the length of the step.
        """
        point, n_stragglers = self.point, self._n_stragglers
        falls = -step.values / point.values
        longer = min(1.0, _STEP_SHARE / max(float(np.partition(falls, -1 - n_stragglers)[-1 - n_stragglers]), _TINY))
        while longer > _LEAST_GAIN * length:
            moved = point.moved(step, longer)
            passed = Point(moved.y, np.maximum(moved.values, _KEPT_SHARE * point.values), moved.count)
            if self.parameter(passed) <= _LARGEST_RISE * self.parameter():
                self.point = passed
                return longer
            longer *= 0.5
        self.point = point.moved(step, length)
        return length

    def lowest(self, residuals: Residuals, tau: float) -> float:
        """The least τ of the next target: `least`, or more while passed bounds have large slack residuals."""
        waits = self._n_stragglers > 0 and self.measures(residuals).slack > _PASSED_RESIDUAL
        return min(tau, _WAITING * self.least) if waits else self.least

    def parameter(self, point: Point | None = None) -> float:
        """τ = Σ W s λ / Σ W ω of a point, the current one by default; 0 without bounds."""
        return self._work(point or self.point) / self._total_omega if self._total_omega > 0.0 else 0.0

    def _work(self, point: Point) -> float:
        """Σ W s λ."""
        return float(self.problem.weights @ (point.s * point.lam))

    def _set_omega(self, omega: Vector) -> None:
        """Take these weights ω (q + b,); `_total_omega` is Σ W ω over the bounds."""
        self.omega = omega
        self._total_omega = float(self.problem.weights @ omega[: len(self.problem.weights)])

    def _centrality(self, point: Point) -> float:
        """The smallest product over its value τω on the central path."""
        products, weights = point.products, self.problem.weights
        tau = float(weights @ products[: weights.size]) / (self._total_omega or np.inf)
        return float(np.minimum.reduce(products / (max(tau, _TINY) * self.omega), initial=np.inf))


# Newton steps: the elimination of λ adds W λ/s times the square of a row to S. When s is tiny, these terms swamp S in
# all directions in which several rows act together, and the multipliers lose as many digits as the gap gains. So the
# force f = Σ ± dλ of the bounds of each traction t = T y is an unknown beside y. With D = Σ λ/s and e = Σ ± mu λ/s over
# the bounds of the traction (`Complementarity.blocks`), ± the sign of a bound, and r the residual of the slacks,
#
#     S dy + TᵀW f = −force,    f/D − (T + e/D N) dy = Σ ± (comp + λ r)/s / D.
#
# Only the matrix that is factorised has min(D, D_max) in place of D, and e in proportion, with W D_max |T|² = 1e10. It
# keeps six digits of S, and each refinement of (dy, f) gains as many. Forces without resultant, TᵀW f = 0, which exist
# where rows depend on each other, do not converge for D ≫ D_max: residuals of slacks of about s then remain.
#
# The changes of tiny slacks are computed from forces, not from differences of the much larger tractions. With
# a = comp/s, g = −r + the change of the friction bound, ds_j = g_j − ±_j dt and f = Σ ±_i (a_i − λ_i/s_i ds_i) it is
#
#     ds_j = (Σ_i λ_i/s_i (g_j − ±_i ±_j g_i) − ±_j (f − Σ ±_i a_i)) / D,
#
# so that s₊ + s₋ = 2 mu p of the two friction bounds holds at a point that opens.

_SIDES = np.array(SLOTS)
_SAME_SIDE = np.outer(_SIDES, _SIDES)
_STIFF = 1.0  # W D |T|² above which a traction is stiff: the changes of its slacks are computed from its force
_STIFFEST = 1e10  # W D_max |T|²


class Newton:
    """The factorised Newton matrix at a point."""

    def __init__(self, problem: Complementarity, point: Point, residuals: Residuals) -> None:
        self.point, self.problem, self.residuals = point, problem, residuals
        self.slope = (point.tension - point.pressure) / (point.tension + point.pressure)
        self.D, e = problem.blocks(point.lam / point.s, self.slope)
        stiffness = problem.row_sizes * self.D  # W D |T|²
        self.stiff = (stiffness > _STIFF).nonzero()[0]
        self.N_share = e / self.D
        self.least_D = self.D / np.maximum(1.0, stiffness / _STIFFEST)  # min(D, D_max)
        self.solve = problem.system.factorised(problem, self.least_D, self.N_share * self.least_D)

    def step(self, comp: Vector, *, only: bool = False) -> Point:
        """The step that changes the products by comp (q + b,); unless `only`, it removes the residuals too."""
        (force, slack, split, _), point, problem = self.residuals, self.point, self.problem
        if only:
            force, slack, split = 0.0 * force, 0.0 * slack, 0.0 * split
        if not split.size:
            dy, ds, dlam = self._bounds(force, slack, comp)
            return Point(dy, np.concatenate([ds, dlam]), point.count)
        # d|σ_N| = size + slope dσ_N: the first term goes to the friction bounds, the slope is in the matrix.
        work, kink, total = comp[: point.count], comp[point.count :], point.tension + point.pressure
        size = (2.0 * kink + (point.tension - point.pressure) * split) / total
        slack = slack - problem.friction_of(size)
        dy, ds, dlam = self._bounds(force, slack, work)
        normal = (problem.split_rows @ dy) + split
        tension, pressure = kink + point.tension * normal, kink - point.pressure * normal
        return Point.of(dy, ds, dlam, tension / total, pressure / total)

    def _bounds(self, force: Vector, slack: Vector, comp: Vector) -> tuple[Vector, Vector, Vector]:
        """(dy, ds, dλ) for the residuals `force` and `slack`, and the required change `comp` of s λ."""
        problem, s, lam = self.problem, self.point.s, self.point.lam
        forces, W = problem.forces, problem.W
        sums = problem.signed @ ((comp + lam * slack) / s)
        dy, f = np.zeros_like(force), np.zeros_like(W)
        for tolerance in _REFINED:
            terms = (problem.S @ dy, forces @ (W * f))
            df = self.least_D * ((sums - f) / self.D + self._strain(dy))  # for dy as it is
            right = -force - terms[0] - terms[1] - forces @ (W * df)
            if largest(right) <= tolerance * largest(np.concatenate(terms)):
                break
            correction = self.solve(right)
            dy, f = dy + correction, f + df + self.least_D * self._strain(correction)
        ds = self._slacks(dy, f[self.stiff], slack, comp)
        dlam = (comp - lam * ds) / s
        lost = (f - problem.signed @ dlam) / self.D  # digits of f, where the net force of large opposite λ is small
        return dy, ds, dlam + problem.signs * (lam / s) * lost[problem.traction]

    def _strain(self, y: Vector) -> Vector:
        """(T + e/D N) y (t,)."""
        return np.asarray(self.problem.T @ y + self.N_share * (self.problem.N @ y))

    def _slacks(self, y: Vector, forces: Vector, slack: Vector, comp: Vector) -> Vector:
        """The changes ds (q,): of stiff tractions from their forces f, of the others by C dy."""
        problem, stiff, D = self.problem, self.stiff, self.D[self.stiff]
        ds = -slack - problem.change(y, self.slope)
        net = forces - (problem.signed @ (comp / self.point.s))[stiff]  # f − Σ ± a
        # Stiff normal tractions, which have one bound each.
        count = int(stiff.searchsorted(problem.count))
        ds[stiff[:count]] = -net[:count] / D[:count]
        if count == stiff.size:
            return ds
        # Stiff shears: g of all bounds, then the sum over the bounds of each shear, in the order of `SLOTS`.
        g_all, coulomb = -slack, problem.coulomb
        pressed = problem.pressed[coulomb]
        g_all[coulomb] += problem.friction[coulomb] * (ds + slack)[pressed]
        if problem.split.size:
            g_all += problem.friction_of(self.slope * (problem.split_rows @ y))
        bounds = problem.bounds[stiff[count:]]
        exists = bounds >= 0
        g, ratio = g_all[bounds], np.where(exists, (self.point.lam / self.point.s)[bounds], 0.0)
        pairs = g[:, :, None] - _SAME_SIDE * g[:, None, :]  # exactly zero for a bound with itself
        numerator = np.add.reduce(pairs * ratio[:, None, :], axis=2) - net[count:, None] * _SIDES
        ds[bounds[exists]] = (numerator / D[count:, None])[exists]
        return ds


def _corrected(newton: Newton, point: Point, comp: Vector, target: Vector, least: float) -> tuple[Point, float]:
    """Gondzio's correctors: bring outlying products nearer to the target as long as that lengthens the step.

    Steps shorter than `least` are not corrected, as they will pass the few bounds that stop them.
    """
    step = newton.step(comp)
    length = _longest(point, step)
    for _ in range(_CORRECTORS):
        if length > 0.95 or length < least:
            break
        trial = point.moved(step, min(1.0, 1.1 * length + 0.1))
        products = trial.products
        corrected_comp = comp + np.maximum(np.clip(products, 0.1 * target, 10.0 * target) - products, -10.0 * target)
        corrected_step = newton.step(corrected_comp)
        corrected_length = _longest(point, corrected_step)
        if corrected_length < length + _CORRECTOR_GAIN:
            break
        step, length, comp = corrected_step, corrected_length, corrected_comp
    return step, length


def _longest(point: Point, step: Point) -> float:
    """The length of a step at which the first of `Point.values` becomes zero; infinite if none decreases."""
    least = float(np.minimum.reduce(step.values / point.values, initial=0.0))
    return -1.0 / least if least < 0.0 else np.inf


# An interior point near the solution of an earlier problem.
#
# For each bound the earlier solution has a slack s₀ in the present problem, which is negative if the bound has moved
# past it, and a multiplier λ₀. The starting values s, λ > 0 have the product of the central path and this difference:
#
#     s − κ λ = s₀ − κ λ₀,    s λ = τ ω,    κ = stress / displacement × size²,
#
# which is a quadratic equation. They differ from s₀ and λ₀ by √τ where a point is about to open or to slip, by τ
# elsewhere, and by the motion of the bound. If the contact opens or closes beyond that, the first step is short.

GAP = 1e-6
"""Relative gap of the starting point: with 1e-4 the start gains less, with 1e-8 it is too close to the bounds."""

_LONGEST_NEAR = 0.999  # largest step from such a start, over the distance to the nearest bound


def start_near(interior: InteriorPoint, y: Vector, start: Start) -> None:
    """Replace the iterate of a started method by one near the state `start` with free coordinates y (k,)."""
    problem, n_split = interior.problem, len(interior.point.tension)
    interior.settle()
    interior.longest = max(interior.longest, _LONGEST_NEAR)
    unit = problem.stress * interior.displacement * problem.total_weight
    products = GAP * unit / float(problem.weights @ problem.omega) * interior.omega
    kink = products[len(products) - n_split :]
    normal = problem.split_normal(y)
    size = np.sqrt(normal**2 + 4.0 * kink)
    tension, pressure = _pair(normal, kink)
    slack = problem.slack(y, size)
    kappa = problem.stress / interior.displacement * problem.sizes**2
    lam = problem.bound_multipliers(start.multipliers, slack)
    s, lam = _pair(slack - kappa * lam, kappa * products[: len(products) - n_split])
    interior.point = Point.of(y, s, lam / kappa, tension, pressure)


def _pair(difference: Vector, product: Vector) -> tuple[Vector, Vector]:
    """The two positive numbers with this difference and this product."""
    larger = 0.5 * (np.abs(difference) + np.sqrt(difference**2 + 4.0 * product))
    smaller = product / larger
    return np.where(difference > 0.0, larger, smaller), np.where(difference > 0.0, smaller, larger)


# Arc length continuation of the central path around its turns: (D7), with tension and pressure as further s and λ. The
# tangent has two directions: where det of Newton's matrix is positive, τ has to fall, where it is negative, to rise. At
# a turn the slope of τ and det both change their signs, so the curve from τ = ∞ is followed to its end, and a step over
# a sharp turn cannot reverse the direction. If the sign of det is not known, the last direction is kept.

_FIRST_STEP, _LAST_STEP, _LEAST_STEP = 0.3, 3.0, 0.01  # arc lengths: the first, the largest, the least
_GROWTH = 1.5
_LARGEST_CORRECTION = 0.5  # largest Newton correction of s or λ, relative, of a point that counts as on the curve
_LARGEST_CHANGE = 0.8  # largest relative change of any s or λ in a step
_HIGHEST = 7.0  # rise of log τ above its start at which the curve is given up
_LONGEST = 250  # steps along one curve; a contact that opens edge by edge takes several for each edge
_LONGEST_APPROACH = 40  # steps from the start until the curve is reached
_FALL = 3.0  # fall of log τ below its start at which the turn is passed


class CentralPath:
    """The central path from the current point of an interior point method; each `advance` is one factorisation."""

    def __init__(self, method: InteriorPoint) -> None:
        self._method = method
        problem = method.problem
        half, split = problem.weights / problem.total_weight, problem.split_weights / problem.total_weight
        self._metric: Vector = np.concatenate([[1.0], half, split, half, split])
        self._log: float = float(np.log(method.parameter()))
        self._start = self._log
        self._tangent: Vector | None = None
        self._length = _FIRST_STEP
        self._steps = 0

    @property
    def passed(self) -> bool:
        """Whether the turn is passed: τ is well below its value at the start, and falls."""
        return self._tangent is not None and self._tangent[0] < 0.0 and self._log < self._start - _FALL

    @property
    def lost(self) -> bool:
        """Whether the curve is given up: τ has risen too far, or there were too many steps."""
        longest = _LONGEST if self._tangent is not None else _LONGEST_APPROACH
        return self._log > self._start + _HIGHEST or self._steps > longest

    def advance(self) -> float:
        """Correct the point, and step along the curve if it is near; returns the change of log τ."""
        method = self._method
        self._steps += 1
        point, residuals = method.point, method.residuals()
        target = np.exp(self._log) * method.omega
        newton = Newton(method.problem, point, residuals)
        # The tangent, a change of log τ by 1, and the Newton step to the curve at this τ.
        along = newton.step(target, only=True)
        to_curve = newton.step(target - point.products)
        tangent, change = self._relative(1.0, along), self._relative(0.0, to_curve)
        tangent_unit = tangent / np.sqrt(self._metric @ tangent**2)
        reversal = tangent_unit[0] if self._tangent is None else -self._metric @ (self._tangent * tangent_unit)
        if (method.problem.system.orientation * tangent_unit[0] or reversal) > 0.0:
            tangent_unit = -tangent_unit
        # The Newton step with log τ free, normal to the tangent.
        slope = float(self._metric @ (tangent_unit * tangent))
        if not np.isfinite(slope) or slope == 0.0:
            raise LinAlgError("the central path has no tangent")
        shift = -float(self._metric @ (tangent_unit * change)) / slope
        correction = change + shift * tangent
        size = float(np.abs(correction[1:]).max(initial=0.0))
        fraction = 1.0
        # Far from the curve a part of the correction, near it the correction and an arc length along the tangent.
        if size > _LARGEST_CORRECTION:
            fraction = min(1.0, _LARGEST_CHANGE / size)
            self._length = max(0.5 * self._length, _LEAST_STEP)
        else:
            self._tangent = tangent_unit
            length = self._length
            while np.abs(correction[1:] + length * tangent_unit[1:]).max(initial=0.0) > _LARGEST_CHANGE:
                length *= 0.7
            shift += length * tangent_unit[0] / tangent[0]
            self._length = min(_GROWTH * length, _LAST_STEP)
        step = Point(to_curve.y + shift * along.y, to_curve.values + shift * along.values, to_curve.count)
        method.point = point.moved(step, fraction)
        self._log += fraction * shift
        return fraction * shift

    def _relative(self, log: float, step: Point) -> Vector:
        """(dlog τ, ds/s, dλ/λ) of a step."""
        return np.concatenate([[log], step.values / self._method.point.values])
