"""Following the central path of `interior_point` by its arc length, where it turns back.

The points with s λ = τ ω form a curve. For a monotone problem τ falls along it all the way; with the moving threshold
of Coulomb friction it may rise for a while, and a method that forces τ down stalls at the turn. Here log τ is an
unknown like the others, and the step goes along the tangent

    T ∝ (dlog τ, ds/s, dλ/λ),   norm² = (dlog τ)² + Σ W ((ds/s)² + (dλ/λ)²) / Σ W,

pull and push counted as further s and λ, with Newton steps normal to it (pseudo-arclength continuation, H. B. Keller,
1977). Of the two directions it takes the one in which τ falls where det of Newton's matrix is positive and rises where
it is negative: at a turn both change their signs, so the curve from τ = ∞ is followed to its end, and no step across a
sharp turn can make it go back. Where the sign is not known, it is the direction in which the curve was followed so far.

In `docs/theory.md`: (D7).
"""

import numpy as np
from numpy.linalg import LinAlgError

from solvers.basics.types import Vector
from solvers.condensed.interior_point import InteriorPoint, Newton, Point

_FIRST_STEP, _LAST_STEP, _LEAST_STEP = 0.3, 3.0, 0.01
_GROWTH = 1.5
_NEAR = 0.5  # Newton corrections, relative to s and λ, up to which a point counts as on the curve
_REACH = 0.8  # relative change of any s or λ in one step at most
_RISE = 7.0  # of log τ, after which the curve is given up
_LONGEST = 250  # steps along one curve: where contact opens edge by edge, several for each
_FOUND = 40  # steps to it
_BEYOND = 3.0  # the turn is passed when log τ has fallen by this much


class CentralPath:
    """The curve from the current point of an interior point method on; every `advance` is one factorisation."""

    def __init__(self, method: InteriorPoint) -> None:
        self._method = method
        weights = method.problem.weights
        half, split = weights / weights.sum(), method.problem.split_weights / weights.sum()
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
        return self._log > self._start + _RISE or self._steps > longest

    def advance(self) -> float:
        """Correct, and step along the curve if it is near; returns the change of log τ."""
        method = self._method
        self._steps += 1
        point, residuals = method.point, method.residuals()
        target = np.exp(self._log) * method.shares
        newton = Newton.at(method.problem, point, residuals)
        along = newton.step(target, only=True)
        back = newton.step(target - point.products)
        tangent, change = self._relative(1.0, along), self._relative(0.0, back)
        tangent_unit = tangent / np.sqrt(self._metric @ tangent**2)
        if self._backwards(tangent_unit):
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
        method.point = point.moved(_sum(back, along, shift), fraction)
        self._log += fraction * shift
        return fraction * shift

    def _backwards(self, tangent: Vector) -> bool:
        """Whether a tangent points back along the curve."""
        orientation = self._method.problem.system.orientation
        if orientation:
            return bool(orientation * tangent[0] > 0.0)
        return bool((tangent[0] if self._tangent is None else -self._metric @ (self._tangent * tangent)) > 0.0)

    def _relative(self, log: float, step: Point) -> Vector:
        return np.concatenate([[log], step.values / self._method.point.values])


def _sum(first: Point, second: Point, factor: float) -> Point:
    return Point(first.y + factor * second.y, first.values + factor * second.values, len(first.s))
