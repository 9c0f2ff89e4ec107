"""How much work friction can do: h(ℓ) = sup { ℓ·τ : |τ| ≤ θ on the whole edge } for functionals ℓ of quadratics.

By conic duality, with D the dual cone of `quadratics`,

    h(ℓ) = min { (q₊ + q₋)·θ :  q₊ − q₋ = ℓ,  q₊, q₋ ∈ D },

so that every decomposition gives an upper bound, and ±ℓ ∈ D, slip in one direction, gives h = |ℓ·θ|. Where ℓ is not
quite in D the decomposition is (ℓ + δe, δe) with e = (1, 1, 1), three times the mean value, and the least such δ; where
that is more than rounding, slip goes both ways on one edge, or ±ℓ is no slip of one direction at all, and the least
decomposition is found by an interior point method, whose points are feasible all along.

Source: Boyd, Vandenberghe, Convex Optimization, 2004, ch. 11 (barrier method) and 9.6 (damped Newton steps).

In `docs/theory.md`: (D17).
"""

import numpy as np

from solvers.basics.types import Matrix, Vector

_WORTH = 1e-10  # of the largest work: what a better decomposition must be able to save
_FIRST, _LAST, _FACTOR = 1.0, 1e13, 6.0  # weights of the objective against the barrier
_NEWTON = 12  # steps for each
_CENTRED = 1e-6  # Newton decrement that ends them
_G = np.array([[0.0, 0.0, 4.0], [0.0, -2.0, 0.0], [4.0, 0.0, 0.0]])  # second derivatives of 4 q₀q₂ − q₁²


def support(functionals: Matrix, bound: Matrix) -> Vector:
    """Upper bounds (e,) of h, close to it, for functionals ℓ (e, 3) and the bound's Bernstein coefficients θ (e, 3)."""
    lift = bound.sum(axis=1)
    upper, lower = ((sign * functionals * bound).sum(axis=1) for sign in (1.0, -1.0))
    least = np.minimum(
        upper + 2.0 * distance_to_dual(functionals) * lift, lower + 2.0 * distance_to_dual(-functionals) * lift
    )
    known = np.maximum(upper, lower)  # h is not below |ℓ·θ|
    work = np.abs(functionals).max(axis=1, initial=0.0) * bound.max(axis=1, initial=0.0)
    rough = np.flatnonzero(least - known > _WORTH * work.max(initial=0.0))
    if len(rough):
        ell, theta = functionals[rough], bound[rough]
        parts = ell + 2.0 * least_part(ell, theta, _LAST)
        least[rough] = np.minimum(least[rough], (parts * theta).sum(axis=1))
    return np.asarray(least)


def distance_to_dual(q: Matrix) -> Vector:
    """The least δ ≥ 0 (e,) with q + δ(1, 1, 1) in D."""
    linear = 4.0 * (q[:, 0] + q[:, 2]) - 2.0 * q[:, 1]  # of 3δ² + linear δ + constant = 4 q₀q₂ − q₁² at q + δ(1, 1, 1)
    constant = 4.0 * q[:, 0] * q[:, 2] - q[:, 1] ** 2
    root = np.sqrt(np.maximum(linear**2 - 12.0 * constant, 0.0))
    total = linear + root
    far = np.divide(-2.0 * constant, total, out=np.zeros(len(q)), where=total > 0.0)
    larger = np.where(linear > 0.0, far, (root - linear) / 6.0)
    return np.asarray(np.maximum(np.maximum(larger, -q.min(axis=1)), 0.0))


def least_part(functionals: Matrix, bound: Matrix, last: float) -> Matrix:
    """The x (e, 3) inside D with ℓ + x inside D that makes (ℓ + 2x)·θ least, up to 6/last of max |ℓ| max θ."""
    size, unit = np.abs(functionals).max(axis=1, keepdims=True), bound.max(axis=1, keepdims=True)
    ell, theta = functionals / size, bound / unit
    best = (1.0 + distance_to_dual(ell))[:, None] * np.ones(3)
    x, weight = best, _FIRST
    while weight <= last:
        x = _centred(x, ell, weight * 2.0 * theta)
        best = np.where(((x - best) * theta).sum(axis=1)[:, None] < 0.0, x, best)
        weight *= _FACTOR
    return np.asarray(size * best)


def _centred(x: Matrix, ell: Matrix, cost: Matrix) -> Matrix:
    """Minimiser of cost·x plus the barriers of x and ℓ + x, by damped Newton steps, which stay inside."""
    for _ in range(_NEWTON):
        gradient, hessian = _barrier(x)
        other, curvature = _barrier(x + ell)
        gradient, hessian = gradient + other + cost, hessian + curvature
        try:
            step = -np.linalg.solve(hessian, gradient[:, :, None])[:, :, 0]
        except np.linalg.LinAlgError:  # rounding: as far as it goes
            return x
        decrement = np.sqrt(np.maximum(-(gradient * step).sum(axis=1), 0.0))
        candidate = x + step / (1.0 + decrement * (decrement > 0.25))[:, None]
        inside = _inside(candidate) & _inside(candidate + ell)
        x = np.where(inside[:, None], candidate, x)
        if (decrement[inside] < _CENTRED).all():
            break
    return x


def _inside(q: Matrix) -> np.ndarray:
    return np.asarray((q > 0.0).all(axis=1) & (4.0 * q[:, 0] * q[:, 2] - q[:, 1] ** 2 > 0.0))


def _barrier(q: Matrix) -> tuple[Matrix, np.ndarray]:
    """Gradient (e, 3) and second derivatives (e, 3, 3) of −log(4 q₀q₂ − q₁²) − log q₁."""
    g = (4.0 * q[:, 0] * q[:, 2] - q[:, 1] ** 2)[:, None]
    slope = q @ _G / g
    gradient = -slope
    hessian = slope[:, :, None] * slope[:, None, :] - _G / g[:, :, None]
    gradient[:, 1] -= 1.0 / q[:, 1]
    hessian[:, 1, 1] += 1.0 / q[:, 1] ** 2
    return gradient, hessian
