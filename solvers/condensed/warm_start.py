"""An interior point near the answer to a problem before.

At every bound there are the slack s₀ that this answer has now, negative where the bound has moved past it, and its
multiplier λ₀. Slack and multiplier that are both positive, whose product is that of a point on the central path and
whose difference is as before,

    s − κ λ = s₀ − κ λ₀,    s λ = τ ω,    κ = stress / displacement × size²,

solve a quadratic equation. They differ from s₀ and λ₀ by √τ where a point is about to open or to slip, by τ elsewhere,
and by as much as a bound has moved. Where contact opens or closes on a larger part than that a first step is short, and
nothing is gained.
"""

import numpy as np

from solvers.basics.types import Vector
from solvers.condensed.interior_point import InteriorPoint, Point
from solvers.solution.start import Start

GAP = 1e-5
"""Gap, relative, at which such a point lies: with 1e-3 less is gained, with 1e-7 it is too close to the bounds."""


def start_near(interior: InteriorPoint, y: Vector, start: Start) -> None:
    """Exchange the iterate of a method, already started, for one near a state with free trace coordinates y (k,)."""
    problem, split = interior.problem, len(interior.point.pull)
    interior.settle()
    unit = problem.stress * interior.displacement * float(problem.weights.sum())
    products = GAP * unit / float(problem.weights @ problem.shares) * interior.shares
    kink = products[len(products) - split :]
    normal = problem.split_normal(y)
    size = np.sqrt(normal**2 + 4.0 * kink)
    pull, push = _pair(normal, kink)
    slack = problem.slack(y, size)
    kappa = problem.stress / interior.displacement * problem.sizes**2
    lam = problem.bound_multipliers(start.normal_multiplier, start.tangential_multiplier, slack)
    s, lam = _pair(slack - kappa * lam, kappa * products[: len(products) - split])
    interior.point = Point.of(y, s, lam / kappa, pull, push)


def _pair(difference: Vector, product: Vector) -> tuple[Vector, Vector]:
    """The two positive numbers with this difference and this product."""
    larger = 0.5 * (np.abs(difference) + np.sqrt(difference**2 + 4.0 * product))
    smaller = product / larger
    return np.where(difference > 0.0, larger, smaller), np.where(difference > 0.0, smaller, larger)
