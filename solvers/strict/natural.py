"""How far σ_T is from its projection on the strict bound after a step along the slip: a bound of the natural map.

    |σ_T − P(σ_T + kλ_T)|,   P the projection on Σ = { |σ_T| ≤ θ on the edge },   | | the root of the mean square on it

For a pair (σ', λ') that obeys the law, P(σ' + kλ') = σ', and as P is a contraction

    |σ_T − P(σ_T + kλ_T)|  ≤  2 |σ_T − σ'| + k |λ_T − λ'|.

Pairs tried, the least bound of which is taken:

* slip in the direction of ℓ: with b = θ ∓ τ and v = b − κℓ in the coordinates below, b' = P_C(v) and κℓ' = b' − v are
  complementary (Moreau), and the pair counts if the other bound holds;
* stick, λ' = 0, of an admissible σ_T itself:  k |λ_T|;
* any pair at all:  2 max θ;
* for an admissible σ_T also  √(k (h(ℓ) − ℓ·τ) / w_e),  as (σ_T + kλ_T − π, σ_T − π) ≤ 0 for π = P(σ_T + kλ_T).

In the coordinates (b₀ + b₂, b₀ − b₂, 2b₁) C is the second-order cone and all that lies above it in the third one; it is
orthogonal to D in ((q₀ + q₂)/2, (q₀ − q₂)/2, q₁/2). Its projection is that on y₀ ≥ |y₁| where v₂ ≥ 0, else that on the
second-order cone, whose residual then is in D.

Where σ_T is not admissible, `friction` of the certificate says by how much.

Source of Moreau's decomposition: J.-J. Moreau, C. R. Acad. Sci. Paris 255 (1962).
"""

import numpy as np

from solvers.basics.types import Matrix, Vector
from solvers.strict.cones import cone_coordinates
from solvers.strict.quadratics import is_nonnegative

_ROUNDING = 1e-14  # of the bound


def natural_bound(
    tau: Matrix, ell: Matrix, theta: Matrix, slack: Vector, mass: Matrix, weights: Vector, k: float
) -> Vector:
    """The bound above (e,) [stress].

    Parameters
    ----------
    tau, theta : (e, 3)
        Bernstein coefficients of σ_T and of its bound.
    ell : (e, 3)
        The functional that the slip is.
    slack : (e,)
        h(ℓ) − ℓ·τ.
    mass : (e, 3, 3)
        ∫ of products of the basis on each edge.
    weights : (e,)
        Lengths of the edges w_e.
    k : float
        Stress a unit of displacement.

    """
    stick = k * slip_size(ell, mass, weights)
    products = np.sqrt(k * np.maximum(slack, 0.0) / weights)
    least = np.minimum(np.minimum(stick, products), 2.0 * theta.max(axis=1, initial=0.0))
    for sign in (1.0, -1.0):
        least = np.minimum(least, _slipping(sign * tau, sign * ell, theta, mass, weights, k))
    return np.asarray(least)


def slip_size(ell: Matrix, mass: Matrix, weights: Vector) -> Vector:
    """Root of the mean square (e,) of the quadratic slip λ_T with (λ_T, τ) = ℓ·τ."""
    if not len(ell):
        return np.zeros(0)
    slip = np.linalg.solve(mass, ell[:, :, None])[:, :, 0]
    return np.asarray(np.sqrt(np.maximum((slip * ell).sum(axis=1), 0.0) / weights))


def _slipping(tau: Matrix, ell: Matrix, theta: Matrix, mass: Matrix, weights: Vector, k: float) -> Vector:
    """The bound from the pair that slips at the upper bound, infinite where the lower one then fails."""
    kappa = (k / weights)[:, None]
    functional = 0.5 * np.column_stack([ell[:, 0] + ell[:, 2], ell[:, 0] - ell[:, 2], ell[:, 1]])
    v = cone_coordinates(theta - tau) - kappa * functional
    y = project(v)
    dual = (y - v) / kappa
    b = 0.5 * np.column_stack([y[:, 0] + y[:, 1], y[:, 2], y[:, 0] - y[:, 1]])
    other = np.column_stack([dual[:, 0] + dual[:, 1], 2.0 * dual[:, 2], dual[:, 0] - dual[:, 1]])
    away = theta - b - tau
    moved = np.sqrt(np.maximum(np.einsum("ei,eij,ej->e", away, mass, away), 0.0) / weights)
    bound = 2.0 * moved + k * slip_size(ell - other, mass, weights)
    holds = is_nonnegative(2.0 * theta - b, _ROUNDING * float(theta.max(initial=0.0)))
    return np.where(holds, bound, np.inf)


def project(v: Matrix) -> Matrix:
    """Projection on C (e, 3) in cone coordinates."""
    above = v[:, 2] >= 0.0
    plane = _second_order(v[:, :2])
    return np.where(above[:, None], np.column_stack([plane, v[:, 2]]), _second_order(v))


def _second_order(v: Matrix) -> Matrix:
    """Projection on y₀ ≥ |(y₁, …)| (e, d)."""
    size = np.linalg.norm(v[:, 1:], axis=1)
    share = 0.5 * (1.0 + np.divide(v[:, 0], size, out=np.zeros(len(v)), where=size > 0.0))
    surface = np.column_stack([share * size, share[:, None] * v[:, 1:]])
    inside, polar = v[:, 0] >= size, v[:, 0] <= -size
    return np.where(inside[:, None], v, np.where(polar[:, None], 0.0, surface))
