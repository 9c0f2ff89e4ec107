"""Primal-dual interior point method for `Complementarity`, with Mehrotra's predictor and Gondzio's correctors.

Each iteration factorises, once, the Newton matrix of the conditions with s λ = τ ω, ω the shares of the bounds:

    (S + BᵀW diag(λ/s) C(y)) dy = …,    ds = slack(y) − s − C dy,    dλ = (target − s λ − λ ds) / s.

One step length is taken for everything, since the threshold couples slacks and multipliers. Sources: S. Mehrotra, SIAM
J. Optim. 2 (1992); J. Gondzio, Comput. Optim. Appl. 6 (1996), for convex problems; nothing is proved for this one,
which is not monotone, hence `central_path`, and the certificate.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.linalg import LinAlgError
from scipy.linalg.lapack import dgetrf, dgetrs

from solvers.basics.types import Matrix, Vector
from solvers.condensed.complementarity import Complementarity
from solvers.condensed.saddle import Saddle
from solvers.inequality.blocks import Rows

_STEP = 0.99  # of the way to the nearest bound
_NEIGHBOURHOOD = 1e-3  # s λ / (τ ω) may not fall below this
_SHORT = 0.1  # predictor steps shorter than this count little
_CORRECTORS = 2
_REFINEMENTS = 1
_GAIN = 0.02  # by which a corrector has to lengthen the step
_START = 0.1  # least slack and multiplier at the start, of the scales
_ROUNDING = 1e-14  # of slacks, relative to the tractions
_FINEST = 1e-17  # gap below which slacks and multipliers lose their digits
_LEAST = 1e-300


@dataclass(eq=False)
class Point:
    """An iterate: y (k,), slacks s > 0 and multipliers λ > 0 (q,)."""

    y: Vector
    s: Vector
    lam: Vector

    def moved(self, step: "Step", length: float) -> "Point":
        """The point a step further."""
        return Point(self.y + length * step.y, self.s + length * step.s, self.lam + length * step.lam)


class Step(NamedTuple):
    """Changes of y, s and λ."""

    y: Vector
    s: Vector
    lam: Vector


class Residuals(NamedTuple):
    """What is left of S y + c + BᵀWλ = 0 (k,), and s − slack(y) (q,)."""

    force: Vector
    slack: Vector


@dataclass(frozen=True)
class Measures:
    """How far an iterate is from a solution, relative.

    Attributes
    ----------
    gap : Σ W s λ over stress × displacement × Σ W, both as large as they are at the iterate
    slack : largest |s − slack(y)| over the stress, of friction bounds over 1 + mu times the stress
    force : largest residual of y, of its largest term or of what the scale of displacement would cause

    """

    gap: float
    slack: float
    force: float


class InteriorPoint:
    """The method's state for one problem; `displacement` is the scale of λ."""

    def __init__(self, problem: Complementarity, displacement: float) -> None:
        self.problem, self.displacement = problem, displacement
        self.least = 0.0  # τ is not made smaller
        self.accurate = False  # whether Newton steps are those of `saddle`
        y = np.zeros(problem.S.shape[0])
        self.point = Point(y, problem.sizes, _START * displacement * problem.shares / problem.sizes)
        self.start_at(y)
        self._force_scale = displacement * float(np.abs(problem.force(np.ones(len(problem.weights)))).max(initial=0.0))

    def start_at(self, y: Vector) -> None:
        """Start from trace coordinates, with slacks away from zero."""
        least = _START * self.problem.stress * self.problem.sizes
        self.point = Point(y, np.maximum(self.problem.slack(y), least), self.point.lam)

    def residuals(self) -> Residuals:
        """At the current point."""
        problem, point = self.problem, self.point
        force = problem.S @ point.y + problem.c + problem.force(point.lam)
        slack = point.s - problem.slack(point.y)
        slack[np.abs(slack) <= _ROUNDING * problem.stress * problem.sizes] = 0.0  # λ/s would make much of it
        return Residuals(force, slack)

    def measures(self, residuals: Residuals) -> Measures:
        """At the current point."""
        problem = self.problem
        stress = problem.stress_at(self.point.y)
        unit = stress * (stress / problem.stress * self.displacement) * float(problem.weights.sum())
        gap = float(problem.weights @ (self.point.s * self.point.lam)) / max(unit, _LEAST)
        slack = float(np.abs(residuals.slack / problem.sizes).max(initial=0.0)) / stress
        terms = (problem.S @ self.point.y, problem.c, problem.force(self.point.lam))
        size = max(self._force_scale, *(float(np.abs(term).max(initial=0.0)) for term in terms), _LEAST)
        self.least = _FINEST * unit / max(float(problem.weights @ problem.shares), _LEAST)
        return Measures(gap, slack, float(np.abs(residuals.force).max(initial=0.0)) / size)

    def iterate(self, residuals: Residuals) -> float:
        """One iteration; returns the length of its step."""
        point = self.point
        newton = Newton.at(self.problem, point, residuals, accurate=self.accurate)
        products = point.s * point.lam
        tau = self.parameter()
        affine = newton.step(-products)
        reach = min(1.0, _longest(point, affine))
        trial = point.moved(affine, reach)
        ahead = float(self.problem.weights @ (trial.s * trial.lam))
        now = max(float(self.problem.weights @ products), _LEAST)
        centring = min(1.0, max((max(ahead, 0.0) / now) ** 3, 1e-6, (1.0 - reach) ** 3))
        damping = 1.0 if reach >= _SHORT else reach**2
        target = max(centring * tau, self.least) * self.problem.shares
        comp = target - products - damping * affine.s * affine.lam
        step, length = _corrected(newton, point, comp, target)
        length = self._in_neighbourhood(step, min(1.0, _STEP * length))
        self.point = point.moved(step, length)
        return length

    def parameter(self) -> float:
        """τ of the current point: Σ W s λ / Σ W ω; 0 without bounds."""
        problem = self.problem
        total = float(problem.weights @ problem.shares)
        return float(problem.weights @ (self.point.s * self.point.lam)) / total if total > 0.0 else 0.0

    def _in_neighbourhood(self, step: Step, length: float) -> float:
        """Shorten the step until no product s λ is far below the others."""
        shares, weights = self.problem.shares, self.problem.weights
        total = float(weights @ shares)
        products = self.point.s * self.point.lam
        least = min(_NEIGHBOURHOOD, float((products / shares).min(initial=np.inf)) / max(self.parameter(), _LEAST))
        for _ in range(20):
            new = self.point.moved(step, length)
            products = new.s * new.lam
            if not total or float((products / shares).min()) >= 0.9 * least * float(weights @ products) / total:
                break
            length *= 0.8
        return length


@dataclass(frozen=True, eq=False)
class Newton:
    """The factorised Newton matrix at a point."""

    point: Point
    problem: Complementarity
    residuals: Residuals
    rows: Rows
    scale: Vector
    factor: Matrix
    pivots: Any
    saddle: Saddle | None = None

    @classmethod
    def at(cls, problem: Complementarity, point: Point, residuals: Residuals, *, accurate: bool = False) -> "Newton":
        """Assemble and factorise, scaled to a diagonal of 1; `accurate`: as in `saddle`."""
        rows = problem.slack_rows(point.y)
        if accurate:
            nothing = np.zeros(0)
            saddle = Saddle.at(problem, point.s, point.lam, rows)
            return cls(point, problem, residuals, rows, nothing, np.zeros((0, 0)), nothing, saddle)
        H = np.array(problem.S, order="F")
        problem.add_stiffness(H, point.lam / point.s, rows)
        scale = 1.0 / np.sqrt(np.maximum(H.diagonal(), 1.0))
        H *= scale
        H *= scale[:, None]
        factor, pivots, info = dgetrf(H, overwrite_a=1) if len(H) else (H, np.zeros(0, dtype=np.int32), 0)
        if info > 0 or not np.isfinite(factor).all():
            raise LinAlgError("it is singular")
        return cls(point, problem, residuals, rows, scale, factor, pivots)

    def step(self, comp: Vector, *, only: bool = False) -> Step:
        """The change that makes s λ grow by comp; `only`: without reducing the residuals."""
        force, slack = self.residuals
        if only:
            force, slack = 0.0 * force, 0.0 * slack
        if self.saddle is not None:
            return Step(*self.saddle.solve(force, slack, comp))
        problem = self.problem
        lam = (comp + self.point.lam * slack) / self.point.s
        step = self._completed(self._solve(-force - problem.force(lam)), comp, slack)
        for _ in range(_REFINEMENTS):  # the elimination of s and λ loses digits where s is small
            left = -force - problem.S @ step.y - problem.force(step.lam)
            step = self._completed(step.y + self._solve(left), comp, slack)
        return step

    def _solve(self, right: Vector) -> Vector:
        return np.asarray(self.scale * dgetrs(self.factor, self.pivots, self.scale * right)[0]) if len(right) else right

    def _completed(self, y: Vector, comp: Vector, slack: Vector) -> Step:
        """The changes of s and λ that belong to y."""
        s = -slack - self.rows @ y
        return Step(y, s, (comp - self.point.lam * s) / self.point.s)


def _corrected(newton: Newton, point: Point, comp: Vector, target: Vector) -> tuple[Step, float]:
    """Gondzio's correctors: bring outlying products nearer to the target as long as that lengthens the step."""
    step = newton.step(comp)
    length = _longest(point, step)
    for _ in range(_CORRECTORS):
        if length > 0.95:
            break
        trial = point.moved(step, min(1.0, 1.1 * length + 0.1))
        products = trial.s * trial.lam
        wanted = comp + np.maximum(np.clip(products, 0.1 * target, 10.0 * target) - products, -10.0 * target)
        new = newton.step(wanted)
        further = _longest(point, new)
        if further < length + _GAIN:
            break
        step, length, comp = new, further, wanted
    return step, length


def _longest(point: Point, step: Step) -> float:
    """The length at which a slack or multiplier reaches zero."""
    fall = np.concatenate([-step.s / point.s, -step.lam / point.lam])
    largest = float(fall.max(initial=0.0))
    return 1.0 / largest if largest > 0.0 else np.inf
