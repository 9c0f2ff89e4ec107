"""Primal-dual interior point method for `Complementarity`, with Mehrotra's predictor and Gondzio's correctors.

Each iteration factorises, once, the Newton matrix of the conditions with s λ = τ ω and pull push = τ ω, ω the shares:

    (S + BᵀW diag(λ/s) C) dy = …,    ds = slack − s − C dy,    dλ = (target − s λ − λ ds) / s,
    d(pull + push) = (2 (target − pull push) + (pull − push) (dσ_N + what σ_N = pull − push lacks)) / (pull + push).

Only products are nonlinear: a step of length t leaves 1 − t of every residual, and the kink of |σ_N| is rounded off by
as much as the gap is open, no less. One step length is taken for everything, since the threshold couples slacks and
multipliers. Among thousands of contact points those at the ends of joints snap one after the other, each at a turn of
its own; there ω of friction is small at first (`settle`), and a step passes the few bounds that stop it (`past_few`).
Sources: S. Mehrotra, SIAM J. Optim. 2 (1992); J. Gondzio, Comput. Optim. Appl. 6 (1996), for convex problems; nothing
is proved for this one, which is not monotone, hence `CentralPath`, and the certificate.

In `docs/theory.md`: (D6), (D7).
"""

from typing import NamedTuple

import numpy as np
from numpy.linalg import LinAlgError
from scipy.linalg.lapack import dgetrf, dgetrs

from solvers.basics.types import Vector
from solvers.condensed.complementarity import Complementarity
from solvers.condensed.systems import SLOTS
from solvers.inequality.rows import largest
from solvers.solution import Start

_STEP = 0.99  # of the way to the nearest bound, at least
_NEIGHBOURHOOD = 1e-3  # s λ / (τ ω) may not fall below this
_SHORT = 0.1  # predictor steps shorter than this count little
_CORRECTORS = 2
_ENOUGH = (1e-8, 1e-14)  # residuals of a step's equations, of their largest term, up to which it is not refined again
_GAIN = 0.02  # by which a corrector has to lengthen the step
_HELD_UP = 0.7  # steps shorter than this go past the few bounds that stop them
_FARTHER = 1.3  # if that makes them so much longer
_RISE = 2.0  # of τ at most, in such a step
_KEPT = 0.3  # of slacks and multipliers that are passed
_MOST_CENTRING = 0.3  # of τ where steps may do so: at a turn for a few bounds τ would else stay where it is
_PASSED_FROM = 10.0  # times the least τ, below which nothing is passed any more
_UNFIT = 1e-9  # slack residual of bounds that were passed, above which τ waits
_WAITS = 30.0  # at so many times the least τ: once it is there bounds are passed no more
_START = 0.1  # least slack at the start, of the scale of stress
_SMOOTHEST = 1.0  # √(4 pull push) at the start, of the scale of stress
_SHARPER = 0.1  # of the shares of pull push, where it lags behind
_FINEST = 1e-17  # gap below which slacks and multipliers lose their digits
_LEAST = 1e-300


class Point:
    """An iterate: y (k,), slacks s > 0 and multipliers λ > 0 (q,), pull > 0 and push > 0 (b,); or a change of one.

    Attributes
    ----------
    values : (2q + 2b,) all that must stay positive: s and pull, then λ and push, so that products are those of halves
    s, lam, pull, push : parts of it

    """

    __slots__ = ("count", "half", "lam", "pull", "push", "s", "values", "y")

    def __init__(self, y: Vector, values: Vector, count: int) -> None:
        half = self.half = values.size // 2
        self.y, self.values, self.count = y, values, count
        self.s, self.pull = values[:count], values[count:half]
        self.lam, self.push = values[half : half + count], values[half + count :]

    @classmethod
    def of(cls, y: Vector, s: Vector, lam: Vector, pull: Vector, push: Vector) -> "Point":
        """From its parts."""
        return cls(y, np.concatenate([s, pull, lam, push]), s.size)

    @property
    def products(self) -> Vector:
        """All s λ and pull push (q + b,); of a change those of second order."""
        return self.values[: self.half] * self.values[self.half :]

    def moved(self, step: "Point", length: float) -> "Point":
        """The point a step further."""
        return Point(self.y + length * step.y, self.values + length * step.values, self.count)


class Residuals(NamedTuple):
    """What is left of S y + c + BᵀWλ = 0 (k,), s = slack (q,) and σ_N = pull − push (b,).

    `largest` is the largest of the terms that make up `force`.
    """

    force: Vector
    slack: Vector
    split: Vector
    largest: float


class Measures(NamedTuple):
    """How far an iterate is from a solution, relative."""

    gap: float  # Σ W s λ over stress × displacement × Σ W, both as large as they are at the iterate
    # largest |s − slack| over the stress, of friction bounds over 1 + mu times the stress; |σ_N − pull + push|
    slack: float
    kink: float  # largest pull + push − |σ_N| over the stress
    force: float  # largest residual of y, of its largest term or of what the scale of displacement would cause
    worst: float  # the largest of them


class InteriorPoint:
    """The method's state for one problem; `displacement` is the scale of λ.

    Attributes
    ----------
    point : the iterate
    shares : (q + b,) what the products are on the central path, over τ; other ones before `settle` than after
    settled : whether friction has its own share, and few bounds may be passed
    finest : gap below which τ is not made smaller
    least : that τ
    accurate : whether Newton steps are those of `Saddle`
    longest : step that is taken at most, of the way to the nearest bound

    """

    def __init__(self, problem: Complementarity, displacement: float) -> None:
        self.problem, self.displacement = problem, displacement
        self.finest, self.least = _FINEST, 0.0
        self.accurate = False
        self.start_at(np.zeros(problem.S.shape[0]))
        self._force_scale = displacement * float(np.abs(problem.force(np.ones(len(problem.weights)))).max(initial=0.0))

    def start_at(self, y: Vector) -> None:
        """Start from trace coordinates, with slacks away from zero."""
        problem = self.problem
        self.longest = problem.system.longest
        normal = problem.split_normal(y)
        smooth = np.hypot(normal, _SMOOTHEST * problem.stress)
        s = np.maximum(problem.slack(y, smooth), _START * problem.stress * problem.sizes)
        early = problem.early_shares
        lam = problem.start * self.displacement * early / np.maximum(problem.sizes, s / problem.stress)
        self.point = Point.of(y, s, lam, 0.5 * (smooth + normal), 0.5 * (smooth - normal))
        self._share(np.concatenate([early, np.zeros(len(normal))]))
        self.settled, self._few = False, 0
        kink = self.point.pull * self.point.push / max(self.parameter(), _LEAST)  # the same at all points
        self.shares[len(early) :] = kink

    def residuals(self) -> Residuals:
        """At the current point."""
        problem, point = self.problem, self.point
        terms = (problem.S @ point.y, problem.c, problem.force(point.lam))
        slack = problem.slack_residual(point.y, point.s, point.pull + point.push)
        split = problem.split_residual(point.y, point.pull - point.push)
        return Residuals(terms[0] + terms[1] + terms[2], slack, split, largest(np.concatenate(terms)))

    def settle(self) -> None:
        """From here on friction has its own share, and few bounds may be passed. Targets of pull push stay."""
        if self.settled:
            return
        before, count = self.parameter(), len(self.point.s)
        self.shares[:count], self.settled = self.problem.shares, True
        self._few = int(self.problem.system.stragglers * len(self.shares))  # that must not hold up all the others
        self._share(self.shares)
        self.shares[count:] *= before / max(self.parameter(), _LEAST)

    def sharpen(self) -> None:
        """Aim at smaller pull push: where both vanish they would else fall like √τ each."""
        self.shares[len(self.point.s) :] *= _SHARPER

    def measures(self, residuals: Residuals) -> Measures:
        """At the current point."""
        problem = self.problem
        stress = problem.stress_at(self.point.y)
        unit = stress * (stress / problem.stress * self.displacement) * problem.total_weight
        gap = self._work(self.point) / max(unit, _LEAST)
        slack, kink = largest(residuals.slack / problem.sizes) / stress, 0.0
        if residuals.split.size:
            slack = max(slack, largest(residuals.split) / stress)
            kink = 2.0 * largest(np.minimum(self.point.pull, self.point.push)) / stress
        size = max(self._force_scale, residuals.largest, _LEAST)
        self.least = self.finest * unit / max(self._total_share, _LEAST)
        force = largest(residuals.force) / size
        return Measures(gap, slack, kink, force, max(gap, slack, kink, force))

    def iterate(self, residuals: Residuals) -> float:
        """One iteration; returns the length of its step."""
        point = self.point
        newton = Newton(self.problem, point, residuals, accurate=self.accurate)
        products, work = point.products, self._work(point)
        tau = self.parameter()
        affine = newton.step(-products)
        reach = min(1.0, _longest(point, affine))
        ahead = max(self._work(point.moved(affine, reach)), 0.0)
        most = _MOST_CENTRING if self._few else 1.0
        centring = min(most, max((ahead / max(work, _LEAST)) ** 3, 1e-6, (1.0 - reach) ** 3))
        damping = 1.0 if reach >= _SHORT else reach**2
        target = max(centring * tau, self.lowest(residuals, tau)) * self.shares
        comp = target - products - damping * affine.products
        passes = self._few > 0 and tau > _PASSED_FROM * self.least
        step, length = _corrected(newton, point, comp, target, _HELD_UP if passes else 0.0)
        share = min(max(_STEP, reach), self.longest)  # products keep at least what the step leaves
        length, least = min(1.0, share * length), min(_NEIGHBOURHOOD, self._centrality(point))
        for _ in range(20):  # until no product is far below the others
            if self._centrality(point.moved(step, length)) >= 0.9 * least:
                break
            length *= 0.8
        if passes and length < _HELD_UP:
            return self.past_few(step, length)
        self.point = point.moved(step, length)
        return length

    def past_few(self, step: Point, length: float) -> float:
        """A step that is longer if it is stopped by few bounds, whose slacks and multipliers keep a share instead.

        That leaves residuals at these bounds alone, which the next steps reduce. Returns its length.
        """
        point = self.point
        falls = -step.values / point.values
        farther = min(1.0, _STEP / max(float(np.partition(falls, -1 - self._few)[-1 - self._few]), _LEAST))
        while farther > _FARTHER * length:
            moved = point.moved(step, farther)
            passed = Point(moved.y, np.maximum(moved.values, _KEPT * point.values), moved.count)
            if self.parameter(passed) <= _RISE * self.parameter():
                self.point = passed
                return farther
            farther *= 0.5
        self.point = point.moved(step, length)
        return length

    def lowest(self, residuals: Residuals, tau: float) -> float:
        """τ that may be aimed at; above the least one as long as bounds that were passed do not fit."""
        waits = self._few > 0 and self.measures(residuals).slack > _UNFIT
        return min(tau, _WAITS * self.least) if waits else self.least

    def parameter(self, point: Point | None = None) -> float:
        """τ of a point, the current one by default: Σ W s λ / Σ W ω; 0 without bounds."""
        return self._work(point or self.point) / self._total_share if self._total_share > 0.0 else 0.0

    def _work(self, point: Point) -> float:
        """Σ W s λ."""
        return float(self.problem.weights @ (point.s * point.lam))

    def _share(self, shares: Vector) -> None:
        """Take other shares; `_total_share` is Σ W ω of s λ."""
        self.shares = shares
        self._total_share = float(self.problem.weights @ shares[: len(self.problem.weights)])

    def _centrality(self, point: Point) -> float:
        """The smallest of the products, relative to those of the central path."""
        products, weights = point.products, self.problem.weights
        tau = float(weights @ products[: weights.size]) / (self._total_share or np.inf)
        return float(np.minimum.reduce(products / (max(tau, _LEAST) * self.shares), initial=np.inf))


# Newton steps without the elimination of stiff bounds, for the last digits.
#
# Eliminating λ adds W λ/s times the square of a row to S. Once s is tiny that swamps S in all directions in which
# several rows act together, and the multipliers lose what the gap gains. Here tractions t = T y with W D |T|² > 1 keep
# the force f = Σ ± dλ of their bounds as an unknown, D = Σ λ/s over the bounds of the traction, ± their side:
#
#     [S + BᵀW diag(λ/s) C over the others   TᵀW  ] (dy)   (−force − BᵀW (target + λ r)/s over the others)
#     [Σ ± λ/s C / D                         −1/D ] (f )  = (−Σ ± (target + λ r)/s / D                   )
#
# with r the residual of the slacks. One row a traction, not one a bound: an open point has three bounds on two
# tractions. The matrix is larger, so this is for when the smaller one has done what it can.
#
# Slacks that are tiny change by what forces say, not by differences of the much larger tractions. With a = target/s and
# g = −r + the change of the friction bound, ds_j = g_j − ±_j dt and f = Σ ±_i (a_i − λ_i/s_i ds_i) give
#
#     ds_j = (Σ_i λ_i/s_i (g_j − ±_i ±_j g_i) − ±_j (f − Σ ±_i a_i)) / D,
#
# in which the two bounds on either side of a point that opens, s₊ + s₋ = 2 mu p, keep their sum.


_SIDES = np.array(SLOTS)
_SAME_SIDE = np.outer(_SIDES, _SIDES)
_REFINEMENTS = 2
_STIFFEST = 1e15  # W D |T|² as it is factorised: of dependent rows no pivot vanishes; refinement knows the true one


class Saddle:
    """The factorised matrix for slacks s, multipliers λ and the slope of |σ_N| at bilateral points; stiff tractions."""

    def __init__(self, problem: Complementarity, s: Vector, lam: Vector, slope: Vector) -> None:
        self.problem, self.s, self.lam, self.slope = problem, s, lam, slope
        k, W, (T, N, sizes) = problem.S.shape[0], problem.W, problem.dense_rows
        D, e = problem.blocks(lam / s, slope)
        sizes = sizes * D  # W D |T|²
        stiff = (sizes > 1.0).nonzero()[0]
        soft = np.where(sizes > 1.0, 0.0, W)
        rows = T + (e / D)[:, None] * N  # Σ ± λ/s C / D
        matrix = np.zeros((k + stiff.size,) * 2)
        matrix[:k, :k] = problem.S + (T.T * (soft * D)) @ rows
        matrix[:k, k:] = T[stiff].T * W[stiff]
        matrix[k:, :k] = rows[stiff]
        diagonal = np.arange(k, k + stiff.size)
        matrix[diagonal, diagonal] = -1.0 / D[stiff]
        tiny = np.finfo(np.float64).tiny
        size = np.abs(matrix)
        left = 1.0 / np.maximum.reduce(size, axis=1, initial=tiny)
        size *= left[:, None]
        right = 1.0 / np.maximum.reduce(size, axis=0, initial=tiny)
        regular = np.multiply(left[:, None] * matrix, right, order="F")
        regular[diagonal, diagonal] *= np.maximum(1.0, sizes[stiff] / _STIFFEST)
        factor, pivots, info = dgetrf(regular, overwrite_a=1)
        if info > 0 or not np.isfinite(factor).all():
            raise LinAlgError("it is singular")
        self.stiff, self.D, self.soft = stiff, D, soft  # D of all tractions; soft: W, 0 of those that are stiff
        self.matrix, self.left, self.right = matrix, left, right  # with the scales of equations and of unknowns
        self.factor, self.pivots = factor, pivots

    def solve(self, force: Vector, slack: Vector, comp: Vector) -> tuple[Vector, Vector, Vector]:
        """(dy, ds, dλ) for residuals of y and of the slacks, and the wanted change of s λ."""
        problem, k = self.problem, force.size
        moved = problem.signed @ ((comp + self.lam * slack) / self.s)
        right = np.concatenate([-force - problem.forces @ (self.soft * moved), -(moved / self.D)[self.stiff]])
        x = self.right * dgetrs(self.factor, self.pivots, self.left * right)[0]
        for _ in range(_REFINEMENTS):
            x += self.right * dgetrs(self.factor, self.pivots, self.left * (right - self.matrix @ x))[0]
        s = self._slacks(x[:k], x[k:], slack, comp)
        return x[:k], s, (comp - self.lam * s) / self.s

    def _slacks(self, y: Vector, forces: Vector, slack: Vector, comp: Vector) -> Vector:
        """The changes of s (q,), those of stiff tractions by their forces."""
        problem, stiff, D = self.problem, self.stiff, self.D[self.stiff]
        s = -slack - problem.change(y, self.slope)
        net = forces - (problem.signed @ (comp / self.s))[stiff]
        count = int(stiff.searchsorted(problem.count))
        s[stiff[:count]] = -net[:count] / D[:count]  # of the one bound of a normal traction
        if count == stiff.size:
            return s
        free, coulomb = -slack, problem.coulomb  # g
        pressed = problem.pressed[coulomb]
        free[coulomb] += problem.friction[coulomb] * (s + slack)[pressed]
        if problem.split.size:
            free += problem.friction_of(self.slope * (problem.split_rows @ y))
        bounds = problem.bounds[stiff[count:]]
        there = bounds >= 0
        g, ratio = free[bounds], np.where(there, (self.lam / self.s)[bounds], 0.0)
        pairs = g[:, :, None] - _SAME_SIDE * g[:, None, :]  # exactly zero for a bound with itself
        resisted = np.add.reduce(pairs * ratio[:, None, :], axis=2) - net[count:, None] * _SIDES
        s[bounds[there]] = (resisted / D[count:, None])[there]
        return s


class Newton:
    """The factorised Newton matrix at a point; `accurate`: as in `Saddle`."""

    def __init__(self, problem: Complementarity, point: Point, residuals: Residuals, *, accurate: bool = False) -> None:
        self.point, self.problem, self.residuals = point, problem, residuals
        self.slope = slope = (point.pull - point.push) / (point.pull + point.push)
        self._saddle = Saddle(problem, point.s, point.lam, slope) if accurate else None
        self.solve = None if accurate else problem.system.factorised(problem, point.lam / point.s, slope)

    def step(self, comp: Vector, *, only: bool = False) -> Point:
        """The change that makes the products grow by comp (q + b,); `only`: without reducing the residuals."""
        (force, slack, split, _), point, problem = self.residuals, self.point, self.problem
        if only:
            force, slack, split = 0.0 * force, 0.0 * slack, 0.0 * split
        if not split.size:
            y, s, lam = self._bounds(force, slack, comp)
            return Point(y, np.concatenate([s, lam]), point.count)
        work, kink = comp[: point.count], comp[point.count :]
        # |σ_N| changes by this much, and by its slope times the change of σ_N.
        size = (2.0 * kink + (point.pull - point.push) * split) / (point.pull + point.push)
        slack = slack - problem.friction_of(size)
        y, s, lam = self._bounds(force, slack, work)
        normal = (problem.split_rows @ y) + split
        pull, push = kink + point.pull * normal, kink - point.push * normal
        return Point.of(y, s, lam, pull / (point.pull + point.push), push / (point.pull + point.push))

    def _bounds(self, force: Vector, slack: Vector, comp: Vector) -> tuple[Vector, Vector, Vector]:
        """Changes of y, s and λ for the residuals of y and of the slacks, and the wanted change of s λ."""
        if self._saddle is not None:
            return self._saddle.solve(force, slack, comp)
        assert self.solve is not None
        problem, solve = self.problem, self.solve
        lam = (comp + self.point.lam * slack) / self.point.s
        y = solve(-force - problem.force(lam))
        s = -slack - problem.change(y, self.slope)
        lam = (comp - self.point.lam * s) / self.point.s
        for enough in _ENOUGH:  # the elimination of s and λ loses digits where s is small
            terms = (problem.S @ y, problem.force(lam))
            left = -force - terms[0] - terms[1]
            if largest(left) <= enough * largest(np.concatenate(terms)):
                break
            more = solve(left)
            moved = problem.change(more, self.slope)
            # Added up, not computed from y: λ/s times the rounding of C y would put forces out of balance again.
            y, s, lam = y + more, s - moved, lam + self.point.lam / self.point.s * moved
        return y, s, lam


def _corrected(newton: Newton, point: Point, comp: Vector, target: Vector, least: float) -> tuple[Point, float]:
    """Gondzio's correctors: bring outlying products nearer to the target as long as that lengthens the step.

    Steps shorter than `least` are not corrected: they will go past the few bounds that stop them.
    """
    step = newton.step(comp)
    length = _longest(point, step)
    for _ in range(_CORRECTORS):
        if length > 0.95 or length < least:
            break
        trial = point.moved(step, min(1.0, 1.1 * length + 0.1))
        products = trial.products
        wanted = comp + np.maximum(np.clip(products, 0.1 * target, 10.0 * target) - products, -10.0 * target)
        new = newton.step(wanted)
        further = _longest(point, new)
        if further < length + _GAIN:
            break
        step, length, comp = new, further, wanted
    return step, length


def _longest(point: Point, step: Point) -> float:
    """The length at which a slack, a multiplier, a pull or a push reaches zero."""
    least = float(np.minimum.reduce(step.values / point.values, initial=0.0))
    return -1.0 / least if least < 0.0 else np.inf


# An interior point near the answer to a problem before.
#
# At every bound there are the slack s₀ that this answer has now, negative where the bound has moved past it, and its
# multiplier λ₀. Slack and multiplier that are both positive, whose product is that of a point on the central path and
# whose difference is as before,
#
#     s − κ λ = s₀ − κ λ₀,    s λ = τ ω,    κ = stress / displacement × size²,
#
# solve a quadratic equation. They differ from s₀ and λ₀ by √τ where a point is about to open or to slip, by τ
# elsewhere, and by as much as a bound has moved. Where contact opens or closes on a larger part than that a first step
# is short, and nothing is gained.


GAP = 1e-6
"""Gap, relative, at which such a point lies: with 1e-4 less is gained, with 1e-8 it is too close to the bounds."""

_LONGEST_NEAR = 0.999  # step that is taken at most from there, of the way to the nearest bound


def start_near(interior: InteriorPoint, y: Vector, start: Start) -> None:
    """Exchange the iterate of a method, already started, for one near a state with free trace coordinates y (k,)."""
    problem, split = interior.problem, len(interior.point.pull)
    interior.settle()
    interior.longest = max(interior.longest, _LONGEST_NEAR)
    unit = problem.stress * interior.displacement * problem.total_weight
    products = GAP * unit / float(problem.weights @ problem.shares) * interior.shares
    kink = products[len(products) - split :]
    normal = problem.split_normal(y)
    size = np.sqrt(normal**2 + 4.0 * kink)
    pull, push = _pair(normal, kink)
    slack = problem.slack(y, size)
    kappa = problem.stress / interior.displacement * problem.sizes**2
    lam = problem.bound_multipliers(start.multipliers, slack)
    s, lam = _pair(slack - kappa * lam, kappa * products[: len(products) - split])
    interior.point = Point.of(y, s, lam / kappa, pull, push)


def _pair(difference: Vector, product: Vector) -> tuple[Vector, Vector]:
    """The two positive numbers with this difference and this product."""
    larger = 0.5 * (np.abs(difference) + np.sqrt(difference**2 + 4.0 * product))
    smaller = product / larger
    return np.where(difference > 0.0, larger, smaller), np.where(difference > 0.0, smaller, larger)


# Following the central path by its arc length, where it turns back: (D7), in which pull and push count as further s and
# λ. Of the two directions of the tangent it takes the one in which τ falls where det of Newton's matrix is positive and
# rises where it is negative: at a turn both change their signs, so the curve from τ = ∞ is followed to its end, and no
# step across a sharp turn can make it go back. Where the sign is not known, it is the direction in which the curve was
# followed so far.


_FIRST_STEP, _LAST_STEP, _LEAST_STEP = 0.3, 3.0, 0.01
_GROWTH = 1.5
_NEAR = 0.5  # Newton corrections, relative to s and λ, up to which a point counts as on the curve
_REACH = 0.8  # relative change of any s or λ in one step at most
_HIGHEST = 7.0  # of log τ, after which the curve is given up
_LONGEST = 250  # steps along one curve: where contact opens edge by edge, several for each
_FOUND = 40  # steps to it
_BEYOND = 3.0  # the turn is passed when log τ has fallen by this much


class CentralPath:
    """The curve from the current point of an interior point method on; every `advance` is one factorisation."""

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
        """Whether the turn is behind: τ is well below its value at the start, and falling."""
        return self._tangent is not None and self._tangent[0] < 0.0 and self._log < self._start - _BEYOND

    @property
    def lost(self) -> bool:
        """Whether τ has risen so far, or the curve is so long or so far away, that no turn is to be hoped for."""
        longest = _LONGEST if self._tangent is not None else _FOUND
        return self._log > self._start + _HIGHEST or self._steps > longest

    def advance(self) -> float:
        """Correct, and step along the curve if it is near; returns the change of log τ."""
        method = self._method
        self._steps += 1
        point, residuals = method.point, method.residuals()
        target = np.exp(self._log) * method.shares
        newton = Newton(method.problem, point, residuals)
        along = newton.step(target, only=True)
        back = newton.step(target - point.products)
        tangent, change = self._relative(1.0, along), self._relative(0.0, back)
        tangent_unit = tangent / np.sqrt(self._metric @ tangent**2)
        backwards = tangent_unit[0] if self._tangent is None else -self._metric @ (self._tangent * tangent_unit)
        if (method.problem.system.orientation * tangent_unit[0] or backwards) > 0.0:
            tangent_unit = -tangent_unit
        # The Newton step with log τ free, normal to the tangent.
        slope = float(self._metric @ (tangent_unit * tangent))
        if not np.isfinite(slope) or slope == 0.0:
            raise LinAlgError("the central path has no tangent")
        shift = -float(self._metric @ (tangent_unit * change)) / slope
        correction = change + shift * tangent
        size = float(np.abs(correction[1:]).max(initial=0.0))
        fraction = 1.0
        if size > _NEAR:
            fraction = min(1.0, _REACH / size)
            self._length = max(0.5 * self._length, _LEAST_STEP)
        else:
            self._tangent = tangent_unit
            length = self._length
            while np.abs(correction[1:] + length * tangent_unit[1:]).max(initial=0.0) > _REACH:
                length *= 0.7
            shift += length * tangent_unit[0] / tangent[0]
            self._length = min(_GROWTH * length, _LAST_STEP)
        step = Point(back.y + shift * along.y, back.values + shift * along.values, back.count)
        method.point = point.moved(step, fraction)
        self._log += fraction * shift
        return fraction * shift

    def _relative(self, log: float, step: Point) -> Vector:
        return np.concatenate([[log], step.values / self._method.point.values])
