"""The contact law on whole edges: what `residuals` measures at points, for strict bounds.

Row multipliers are the functionals π (e, 2) of end values and ℓ (e, 3) of Bernstein coefficients that they are on the
tractions of an edge (`edges`); more than these the stresses do not feel. With the end values n of σ_N, the coefficients
τ of σ_T, the bound θ of `threshold` at n, the work h(ℓ) of `support`, and the share w of the quadrature weights (e, 2)
that belongs to each end, λ = π / w,

    normal                      max n⁺ / S, unilateral edges
    friction                    max over whole edges of (|σ_T| − θ)⁺ / S, exact
    sign                        max of (−λ)⁺ / D, bilateral |λ| / D, and (−ℓ·τ)⁺ / (w_e S max(D, |λ_T|))
    complementarity_normal      Σ |π n| / E, open gaps λ counted up to 10 E / (S Σ W)
    complementarity_tangential  Σ |h(ℓ) − ℓ·τ| / E
    natural_map                 max of |n − min(n + kλ, 0)| / S, bilateral k|λ| / S, and r / S, r of `natural`
    alart_curnier               max of the first two and of r + max |θ(−π_N) − θ|, over 1 + mu,
                                with π_N = min(n + kλ, 0) in place of n, bilateral n
    bipotential                 |Σ (h(ℓ) − ℓ·τ − π n)| / E

w_e is the sum of an edge's weights, |λ_T| the root of the mean square of the slip that ℓ is.

Where the bound vanishes at one end of an edge, h(ℓ) grows with the root of the bound there: coefficients of θ below
1e-10 S, which a bound met to 1e-8 S need not distinguish from zero, count as zero in h.

The energy gap takes the same sums for the bound at hand, and π made ≥ 0.
"""

import numpy as np

from solvers.basics.types import Matrix, Vector
from solvers.inequality.problem import FrictionQVI
from solvers.inequality.residuals import LawResiduals, largest, largest_gap
from solvers.strict import quadratics
from solvers.strict.natural import natural_bound, slip_size
from solvers.strict.support import support
from solvers.strict.threshold import bilateral_edges, edge_rows, end_pressure, strict_bound, threshold_of_ends

_CLOSED = 1e-10  # share of S below which a coefficient of the bound is none


def strict_residuals(qvi: FrictionQVI, z: Vector, m_N: Vector, m_T: Vector, scales: dict[str, float]) -> LawResiduals:
    """All measures of the contact law on the edges of the QVI at z (n,) with row multipliers m_N, m_T (m,)."""
    S, D, E = scales["stress"], scales["displacement"], scales["energy"]
    edges, both = edge_rows(qvi), bilateral_edges(qvi)[:, None]
    n, tau = edges.ends(qvi.normal(z)), edges.bernstein(qvi.tangential(z))
    ell, ends = edges.on_bernstein(m_T), edges.on_ends(m_N)
    shares = edges.on_ends(qvi.W)
    pushes, near = ends / shares, np.minimum(ends, largest_gap(qvi, scales) * shares)
    theta = strict_bound(qvi, qvi.normal(z)).coefficients
    work = (ell * tau).sum(axis=1)
    nothing = (np.abs(theta) <= _CLOSED * S) & (theta[:, 1:2] >= 0.0)
    slack = support(ell, np.where(nothing, 0.0, theta)) - work
    mass, weights = _mass(qvi), shares.sum(axis=1)
    slip = slip_size(ell, mass, weights)
    projected = np.where(both, n + S / D * pushes, np.minimum(n + S / D * pushes, 0.0))
    natural_N = np.abs(n - projected).max(axis=1, initial=0.0)
    natural_T = natural_bound(tau, ell, theta, slack, mass, weights, S / D)
    change = _change_of_bound(qvi, np.where(both, n, projected), theta)
    friction = np.maximum(quadratics.largest(tau - theta), quadratics.largest(-tau - theta))
    wrong_T = np.maximum(-work, 0.0) / weights
    bipotential = float(slack.sum() - (near * n).sum())
    measures = {
        "normal": largest(np.where(both, 0.0, np.maximum(n, 0.0))) / S,
        "friction": largest(np.maximum(friction, 0.0)) / S,
        "sign": max(
            largest(np.where(both, pushes, np.maximum(-pushes, 0.0))) / D,
            largest(wrong_T) / (S * max(D, largest(slip))),
        ),
        "complementarity_normal": float(np.abs(near * n).sum()) / E,
        "complementarity_tangential": float(np.abs(slack).sum()) / E,
        "natural_map": max(largest(natural_N), largest(natural_T)) / S,
        "alart_curnier": largest(np.maximum(natural_N, natural_T + change) / (1.0 + _friction(qvi))) / S,
        "bipotential": abs(bipotential) / E,
    }
    return LawResiduals(measures, float(slack.sum() - (np.maximum(near, 0.0) * n).sum()), bipotential)


def admissible_change(qvi: FrictionQVI, m_N: Vector) -> Vector:
    """What to add to m_N (m,) so that no end is pulled: the functionals π become max(π, 0)."""
    edges = edge_rows(qvi)
    return edges.rows(np.maximum(-edges.on_ends(m_N), 0.0))


def _mass(qvi: FrictionQVI) -> Matrix:
    """∫ of products of the quadratic basis on each edge (e, 3, 3)."""
    edges = edge_rows(qvi)
    return np.asarray(np.einsum("eq,qi,qj->eij", edges.grouped(qvi.W), edges.quadratic, edges.quadratic))


def _change_of_bound(qvi: FrictionQVI, normal: Matrix, theta: Matrix) -> Vector:
    """Largest change (e,) of the bound on each edge if σ_N had these end values (e, 2)."""
    edges = edge_rows(qvi)
    pressure = end_pressure(qvi, edges.at_points(normal))
    other = threshold_of_ends(qvi, pressure).coefficients
    return np.asarray(np.maximum(quadratics.largest(other - theta), quadratics.largest(theta - other)))


def _friction(qvi: FrictionQVI) -> Vector:
    """The largest coefficient of each edge (e,)."""
    return np.asarray(edge_rows(qvi).grouped(qvi.mu).max(axis=1, initial=0.0))
