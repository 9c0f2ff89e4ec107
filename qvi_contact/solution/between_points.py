"""What the contact law is violated by between the Gauss points, where the discrete problem does not ask for it.

With σ_N' = σ_N + p_w in the place of σ_N where a fluid presses in the contact:

    |σ_T| − min(c + μs, t_max)  =  max over ± of the larger of  ±σ_T − c − μs  and  ±σ_T − t_max

is a polynomial on each side of the points where σ_N changes sign. Tractions and fields of the law are taken as the
polynomials through the Gauss points, and the maximum is found from the roots of derivatives. Where Bernstein
coefficients obey the law there is nothing to look for.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from qvi_contact.basics.checks import BoolArray, FloatArray
from qvi_contact.discretization.contact_rows import ContactRows

_ROUNDING = 1e-13  # of the largest traction: excess of a Bernstein coefficient that is rounding


class Violations(NamedTuple):
    """Largest (|σ_T| − bound)⁺ and (σ_N')⁺ on each edge (n,), dimensionless."""

    excess: FloatArray
    pull: FloatArray


def between_points(rows: ContactRows, normal: FloatArray, tangential: FloatArray) -> Violations:
    """Violations on the whole of each edge of a contact from σ_N' and σ_T at the Gauss points (m,), dimensionless.

    The bound is that of the pressure at each place, which where unilateral σ_N > 0 is none; tied contacts have no law.
    """
    if rows.law == "tied":
        return Violations(np.zeros(len(rows.points.edges)), np.zeros(len(rows.points.edges)))
    fields = (normal, tangential, rows.friction, rows.cohesion, rows.shear_limit)
    parts = tuple(values.reshape(-1, rows.points.count) for values in fields)
    both = rows.law != "unilateral"
    admissible, most = _by_coefficients(rows, parts, both)
    excess, pull = np.where(admissible[:, None], most, 0.0).T
    for edge in np.flatnonzero(~admissible):
        excess[edge], pull[edge] = _general(rows.points.reference, [part[edge] for part in parts], both)
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
