"""The bound θ of |σ_T| on whole edges from the pressure there: exact where it is a quadratic, else from below.

With the pressure s affine on an edge, θ = min(c + μs, t_max) is a quadratic, and exact, where

* μ is affine, c quadratic along the edge (in particular constant), and t_max above c + μs on the whole edge;
* t_max is quadratic and below c + μs on the whole edge.

Anything else is replaced by something smaller, so that what keeps it keeps the law: fields that are no such polynomials
by an affine function ≥ 0 below their values at the points of the edge and below the polynomial through these (what they
do between the points nobody knows here), and where t_max comes into play inside an edge both bounds by affine functions
below them, and the minimum of these, which is concave, by its chord.

Unilateral pressure is s = max(−σ_N, 0) of the end values. Bilateral |σ_N| has a kink where σ_N changes sign, and no
quadratic but zero lies between that and 0: there s = 0. So that s depends continuously on σ_N, without which a fixed
point need not exist, the larger of two end values counts up to 4 times the smaller one.
"""

from typing import NamedTuple

import numpy as np

from solvers.basics.types import BoolVector, Matrix, Vector
from solvers.inequality.edges import EdgeRows, affine_basis
from solvers.inequality.problem import FrictionQVI
from solvers.strict.quadratics import affine_below, is_nonnegative, product, raised, smallest

_ROUNDING = 1e-10  # of the values of a field: difference from a polynomial that is none
_FINE = 33  # places between the points where fields are looked at
_KINK = 4.0  # ratio of the end values of a bilateral pressure


class Threshold(NamedTuple):
    """Bernstein coefficients (e, 3) of the bound θ ≥ 0, and whether it is the law's own bound on each edge (e,)."""

    coefficients: Matrix
    exact: BoolVector


def edge_rows(qvi: FrictionQVI) -> EdgeRows:
    """The problem's `EdgeRows`; a strict problem has them."""
    assert qvi.edges is not None
    return qvi.edges


def end_pressure(qvi: FrictionQVI, normal: Vector) -> Matrix:
    """End values (e, 2) ≥ 0 of the pressure on each edge from σ_N at the points (m,)."""
    ends = edge_rows(qvi).ends(normal)
    one_sign = np.asarray(ends[:, :1] * ends[:, 1:] >= 0.0)
    size = np.where(one_sign, np.abs(ends), 0.0)
    both = bilateral_edges(qvi)[:, None]
    return np.where(both, np.minimum(size, _KINK * size[:, ::-1]), np.maximum(-ends, 0.0))


def strict_bound(qvi: FrictionQVI, normal: Vector) -> Threshold:
    """The bound on each edge from σ_N at the points (m,), not exact either where it moves with a pressure ≠ |σ_N|."""
    pressure = end_pressure(qvi, normal)
    found = threshold_of_ends(qvi, pressure)
    whole = (pressure == np.abs(edge_rows(qvi).ends(normal))).all(axis=1)
    fixed = ~edge_rows(qvi).grouped(qvi.mu).any(axis=1)
    return Threshold(found.coefficients, found.exact & (whole | fixed | ~bilateral_edges(qvi)))


def strict_pressure(qvi: FrictionQVI, normal: Vector) -> Vector:
    """The pressure `end_pressure` at the points (m,)."""
    return edge_rows(qvi).at_points(end_pressure(qvi, normal))


def bound_at(qvi: FrictionQVI, z: Vector) -> Vector:
    """The bound of |σ_T| at the contact points (m,) for the pressure at z; NaN where z is not finite."""
    if not np.isfinite(z).all():
        return np.full(qvi.m, np.nan)
    if not qvi.strict:
        return qvi.threshold(qvi.pressure(z))
    pressure = strict_pressure(qvi, qvi.normal(z))
    return edge_rows(qvi).at_points(strict_threshold(qvi, pressure).coefficients)


def affine_pressure(qvi: FrictionQVI, pressure: Vector) -> Vector:
    """The pressure (m,) nearest to a given one that is affine on each edge and ≥ 0 at its ends."""
    edges = edge_rows(qvi)
    return edges.at_points(np.maximum(edges.ends(pressure), 0.0))


def bilateral_edges(qvi: FrictionQVI) -> BoolVector:
    """Edges with a bilateral point (e,)."""
    return np.asarray(edge_rows(qvi).grouped(qvi.bilateral).any(axis=1))


def frictionless_edges(qvi: FrictionQVI) -> BoolVector:
    """Edges whose bound is zero whatever the pressure (e,)."""
    with_pressure = threshold_of_ends(qvi, np.ones((len(bilateral_edges(qvi)), 2))).coefficients
    return np.asarray((with_pressure == 0.0).all(axis=1))


def strict_threshold(qvi: FrictionQVI, pressure: Vector) -> Threshold:
    """The bound on each edge from a pressure at the points (m,), affine on each edge and ≥ 0.

    Another pressure counts as the affine one nearest to it, raised to 0 at ends where that is negative.
    """
    return threshold_of_ends(qvi, np.maximum(edge_rows(qvi).ends(pressure), 0.0))


def threshold_of_ends(qvi: FrictionQVI, pressure: Matrix) -> Threshold:
    """`strict_threshold` from the end values (e, 2) ≥ 0 of the pressure."""
    edges = edge_rows(qvi)
    mu, mu_exact = _affine_field(edges, qvi.mu)
    cohesion, cohesion_exact = _quadratic_field(edges, qvi.cohesion)
    law = cohesion + product(mu, pressure)
    exact = cohesion_exact & (mu_exact | (pressure == 0.0).all(axis=1))
    capped = np.asarray(np.isfinite(edges.grouped(qvi.cap)).any(axis=1))
    if not capped.any():
        return Threshold(law, exact)
    cap, cap_exact = _cap_field(edges, qvi.cap)
    above, below = is_nonnegative(cap - law), is_nonnegative(law - cap)
    chord = raised(np.minimum(affine_below(cap), affine_below(law)))
    smaller = np.where(above[:, None], law, np.where(below[:, None], cap, chord))
    least = cap_exact & np.where(above, exact, below)
    return Threshold(np.where(capped[:, None], smaller, law), np.where(capped, least, exact))


def _affine_field(edges: EdgeRows, values: Vector) -> tuple[Matrix, BoolVector]:
    """End values (e, 2) of a field ≥ 0, and where it is affine along the edge."""
    groups = edges.grouped(values)
    ends = edges.ends(values)
    exact = _fits(edges, ends, groups) & (ends >= -_size(groups)[:, None]).all(axis=1)
    if exact.all():
        return np.maximum(ends, 0.0), exact
    return np.where(exact[:, None], np.maximum(ends, 0.0), _below(edges, groups)), exact


def _quadratic_field(edges: EdgeRows, values: Vector) -> tuple[Matrix, BoolVector]:
    """Bernstein coefficients (e, 3) of a field ≥ 0, and where it is quadratic along the edge."""
    groups = edges.grouped(values)
    if not groups.any():
        return np.zeros((len(groups), 3)), np.ones(len(groups), dtype=bool)
    ends, is_affine = _affine_field(edges, values)
    b = edges.bernstein(values)
    b = b + np.maximum(-smallest(b), 0.0)[:, None] * (smallest(b) >= -_size(groups))[:, None]  # rounding below zero
    exact = _fits(edges, b, groups) & is_nonnegative(b)
    return np.where((exact & ~is_affine)[:, None], b, raised(ends)), exact | is_affine


def _cap_field(edges: EdgeRows, values: Vector) -> tuple[Matrix, BoolVector]:
    """The same for the cap, where it is finite at all points; else the smallest value."""
    groups = edges.grouped(values)
    finite = np.asarray(np.isfinite(groups).all(axis=1))
    b, exact = _quadratic_field(edges, np.where(np.isfinite(groups), groups, 0.0).ravel())
    least = np.min(np.where(np.isfinite(groups), groups, np.inf), axis=1)
    least = np.where(np.isfinite(least), least, 0.0)
    return np.where(finite[:, None], b, least[:, None]), exact & finite


def _below(edges: EdgeRows, groups: Matrix) -> Matrix:
    """End values (e, 2) ≥ 0 of affine functions below the values at the points and the polynomial through them.

    The fit lowered; the smallest value as a constant where that would be negative.
    """
    ends = groups @ edges.to_ends.T
    t = np.concatenate([edges.points, np.linspace(0.0, 1.0, _FINE)])
    powers = np.arange(edges.count)
    through = (t[:, None] ** powers) @ np.linalg.inv(edges.points[:, None] ** powers)
    values = groups @ through.T
    excess = np.maximum((ends @ affine_basis(t).T - values).max(axis=1, initial=0.0), 0.0)
    lowered = ends - excess[:, None]
    least = np.maximum(values.min(axis=1, initial=np.inf), 0.0)
    usable: BoolVector = np.asarray((lowered >= 0.0).all(axis=1))
    return np.asarray(np.where(usable[:, None], lowered, least[:, None]))


def _fits(edges: EdgeRows, coefficients: Matrix, groups: Matrix) -> BoolVector:
    fitted = edges.at_points(coefficients).reshape(groups.shape)
    return np.asarray((np.abs(fitted - groups) <= _size(groups)[:, None]).all(axis=1))


def _size(groups: Matrix) -> Vector:
    """What counts as rounding of the values of each edge (e,)."""
    return np.asarray(_ROUNDING * np.abs(groups).max(axis=1, initial=0.0))
