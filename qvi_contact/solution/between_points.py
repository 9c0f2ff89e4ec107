"""What the contact law is violated by between the Gauss points, where the discrete problem does not ask for it.

With σ_N' = σ_N + p_w in the place of σ_N where a fluid presses in the contact:

On an edge of a rectangle σ_N is affine and σ_T quadratic. With μ affine, c and t_max quadratic along the edge, in
particular constant,

    |σ_T| − min(c + μs, t_max)  =  max over ± of the larger of  ±σ_T − c − μs  and  ±σ_T − t_max

is quadratic on each side of the point where σ_N changes sign, and its maximum a formula. Tractions of other degrees,
other fields, and a σ_N that a body force bends, are taken as the polynomials through the Gauss points, and the maximum
found from the roots of derivatives.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from qvi_contact.basics.checks import BoolArray, FloatArray
from qvi_contact.discretization.contact_rows import ContactRows
from solvers import EdgeRows
from solvers.strict.quadratics import largest, product

_ROUNDING = 1e-13  # of the largest traction: excess of a Bernstein coefficient that is rounding
_POLYNOMIAL = 1e-10  # of the values: difference from a polynomial of the degree expected that is rounding


class Violations(NamedTuple):
    """Largest (|σ_T| − bound)⁺ and (σ_N')⁺ on each edge (n,), dimensionless."""

    excess: FloatArray
    pull: FloatArray


def between_points(rows: ContactRows, normal: FloatArray, tangential: FloatArray) -> Violations:
    """Violations on the whole of each edge of a contact from σ_N' and σ_T at the Gauss points (m,), dimensionless.

    The bound is that of the pressure at each place, which where unilateral σ_N > 0 is none; tied contacts have no law.
    """
    space = rows.points.basis
    edges = EdgeRows(rows.points.reference, space.normal_degree, space.shear_degree)
    if rows.law == "tied":
        return Violations(np.zeros(len(rows.points.edges)), np.zeros(len(rows.points.edges)))
    fields = [normal, tangential, rows.friction, rows.cohesion, rows.shear_limit]
    n, tau, mu, cohesion, cap = (edges.grouped(values) for values in fields)
    simple = np.full(len(n), edges.affine_and_quadratic)
    for groups, parameters in ((n, 2), (tau, 3), (mu, 2), (cohesion, 3), (cap, 3)):
        simple &= edges.affine_and_quadratic and _is(edges, groups, parameters)
    both = rows.law != "unilateral"
    excess, pull = np.zeros(len(n)), np.zeros(len(n))
    if simple.any():
        found = _quadratic(edges, [part[simple] for part in (n, tau, mu, cohesion, cap)], both)
        excess[simple], pull[simple] = found
    admissible, most = _by_coefficients(rows, (n, tau, mu, cohesion, cap), both)
    settled = admissible & ~simple
    excess[settled], pull[settled] = most[settled].T
    for edge in np.flatnonzero(~simple & ~settled):
        parts = [part[edge] for part in (n, tau, mu, cohesion, cap)]
        excess[edge], pull[edge] = _general(edges.points, parts, both)
    return Violations(excess, pull)


def _by_coefficients(rows: ContactRows, parts: tuple[FloatArray, ...], both: bool) -> tuple[BoolArray, FloatArray]:
    """Edges (n,) where Bernstein coefficients obey a law that is constant along the edge, and bounds of both (n, 2).

    The tractions obey it then on the whole edge, up to the rounding of the coefficients, which is what the bounds are.
    """
    n, tau, mu, cohesion, cap = parts
    if rows.rule.to_points is None:
        return np.zeros(len(n), dtype=bool), np.zeros((len(n), 2))
    normal, shear = (rows.rule.at_rows(part.ravel()).reshape(part.shape) for part in (n, tau))
    constant = (np.ptp(mu, axis=1) == 0.0) & (np.ptp(cohesion, axis=1) == 0.0) & np.isinf(cap).all(axis=1)
    scale = _ROUNDING * max(float(np.abs(normal).max(initial=0.0)), float(np.abs(shear).max(initial=0.0)))
    pull = normal.max(axis=1)
    pressed = pull <= scale
    excess = (np.abs(shear) - (cohesion - mu * normal)).max(axis=1)
    found = np.maximum(np.column_stack([excess, np.zeros(len(n)) if both else pull]), 0.0)
    return constant & pressed & (excess <= scale), found


def _is(edges: EdgeRows, groups: FloatArray, parameters: int) -> BoolArray:
    """Edges (n,) on which values at points are affine (2 parameters) or quadratic (3), or infinite everywhere."""
    infinite = np.asarray(np.isinf(groups).all(axis=1))
    finite = np.where(infinite[:, None], 0.0, groups)
    fitted = edges.ends(finite.ravel()) if parameters == 2 else edges.bernstein(finite.ravel())
    error = np.abs(edges.at_points(fitted).reshape(finite.shape) - finite).max(axis=1, initial=0.0)
    return np.asarray(error <= _POLYNOMIAL * np.abs(finite).max(initial=0.0))


def _quadratic(edges: EdgeRows, parts: list[FloatArray], both: bool) -> tuple[FloatArray, FloatArray]:
    """Excess and pull by formulas."""
    normal, tangential, friction, limit, cap = (part.ravel() for part in parts)
    n, tau, mu = edges.ends(normal), edges.bernstein(tangential), edges.ends(friction)
    cohesion, ceiling = edges.bernstein(limit), edges.bernstein(np.where(np.isinf(cap), 0.0, cap))
    uncapped = np.isinf(cap).reshape(-1, edges.count).all(axis=1)
    changes = n[:, 0] * n[:, 1] < 0.0
    root = np.divide(n[:, 0], n[:, 0] - n[:, 1], out=np.zeros(len(n)), where=changes)
    excess = np.zeros(len(n))
    for start, stop in ((np.zeros_like(root), root), (root, np.ones_like(root))):
        pressure = -(n[:, 0] * (2.0 - start - stop) + n[:, 1] * (start + stop))  # in the middle: its sign on the piece
        sign = np.where(pressure >= 0.0, 1.0, -1.0 if both else 0.0)
        bound = cohesion + product(mu, -sign[:, None] * n)
        for side in (tau, -tau):
            law = largest(_restricted(side - bound, start, stop))
            capped = np.where(uncapped, 0.0, largest(_restricted(side - ceiling, start, stop)))
            excess = np.maximum(excess, np.maximum(law, capped))
    return excess, np.zeros(len(n)) if both else np.maximum(n.max(axis=1, initial=0.0), 0.0)


def _restricted(b: FloatArray, start: FloatArray, stop: FloatArray) -> FloatArray:
    """Bernstein coefficients (n, 3) of the same quadratics on [start, stop], by blossoms."""

    def blossom(u: FloatArray, v: FloatArray) -> FloatArray:
        cross = (1.0 - u) * v + u * (1.0 - v)
        return np.asarray((1.0 - u) * (1.0 - v) * b[:, 0] + cross * b[:, 1] + u * v * b[:, 2])

    return np.column_stack([blossom(start, start), blossom(start, stop), blossom(stop, stop)])


def _general(t: FloatArray, parts: list[FloatArray], both: bool) -> tuple[float, float]:
    """Excess and pull on one edge, of polynomials through the points."""
    n, tau, mu, cohesion, cap = (
        Polynomial.fit(t, np.where(np.isinf(part), 0.0, part), len(t) - 1, domain=[0.0, 1.0]) for part in parts
    )
    places = np.concatenate([[0.0], _roots(n), [1.0]])
    excess = 0.0
    for start, stop in pairwise(places.tolist()):
        sign = 1.0 if n(0.5 * (start + stop)) <= 0.0 else -1.0 if both else 0.0
        bounds = [cohesion - sign * mu * n] + ([] if np.isinf(parts[-1]).all() else [cap])
        excess = max([excess, *(_maximum(side - bound, start, stop) for side in (tau, -tau) for bound in bounds)])
    shear = max(_maximum(tau, 0.0, 1.0), _maximum(-tau, 0.0, 1.0))  # no bound is negative, though a cubic may be
    return min(excess, shear), 0.0 if both else max(_maximum(n, 0.0, 1.0), 0.0)


def _maximum(p: Polynomial, start: float, stop: float) -> float:
    inside = _roots(p.deriv())
    places = np.concatenate([[start, stop], inside[(inside > start) & (inside < stop)]])
    return float(p(places).max())


def _roots(p: Polynomial) -> FloatArray:
    """Real roots inside (0, 1), sorted."""
    scale = np.abs(p.coef).max()
    if scale == 0.0:
        return np.empty(0)
    roots = p.trim(1e-14 * scale).roots()
    real = np.real(roots[np.abs(np.imag(roots)) <= 1e-9])
    return np.asarray(np.sort(real[(real > 0.0) & (real < 1.0)]))
