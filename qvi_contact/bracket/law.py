"""Tractions and friction bounds on contact edges as polynomials, by Bernstein coefficients.

Arrays over edges hold those of all contacts that have rows, one after the other; tied ones have none.
"""

from functools import cache

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray
from qvi_contact.discretization.contact_rows import ContactRows, joined
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.element import bernstein
from qvi_contact.solution.work import normal_and_shear

_ROUNDING = 1e-10  # of a field's values: a coefficient below zero that is none


def contact_tractions(discretization: Discretization, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Effective σ_N, as the law takes it, and σ_T (m,) of degrees of freedom u of Φ at contact points that have rows.

    Dimensionless.
    """
    pairs = [effective(discretization, u, rows) for rows in _limited(discretization)]
    return joined([normal for normal, _ in pairs]), joined([shear for _, shear in pairs])


def effective(discretization: Discretization, u: FloatArray, rows: ContactRows) -> tuple[FloatArray, FloatArray]:
    """The same of one contact."""
    normal, shear = normal_and_shear(discretization, u, rows.points)
    return normal + rows.pore_pressure, shear


def coefficients(discretization: Discretization, values: FloatArray, degree: int) -> FloatArray:
    """Bernstein coefficients (e, degree + 1) of the polynomials nearest to values at the contact points (m,)."""
    nearest = _nearest(degree, tuple(discretization.rule.points.tolist()))
    return np.asarray(values.reshape(-1, nearest.shape[1]) @ nearest.T)


@cache
def _nearest(degree: int, points: tuple[float, ...]) -> FloatArray:
    """Matrix (degree + 1, q) from values at q points to the coefficients of the nearest polynomial."""
    matrix = np.asarray(np.linalg.pinv(bernstein.basis(degree, np.array(points))))
    matrix.flags.writeable = False
    return matrix


def traction_coefficients(
    discretization: Discretization, tractions: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Those of σ_N and σ_T, (e, q) each, from their values at the contact points (m,)."""
    normal, shear = tractions
    space = discretization.space
    return (
        coefficients(discretization, normal, space.traction_degree),
        coefficients(discretization, shear, space.traction_degree),
    )


def largest(polynomials: FloatArray) -> FloatArray:
    """The largest value (e,) of polynomials (e, q), or what is no less than that: exact up to degree 2."""
    return bernstein.largest_quadratic(polynomials) if polynomials.shape[1] == 3 else polynomials.max(axis=1)


def law_bound(discretization: Discretization, normal: FloatArray) -> tuple[FloatArray, BoolArray]:
    """The bound s ≥ 0 of |σ_T| for the pressure of σ_N (m,) at the contact points, and where it is the law's own.

    On triangles of degree p by p − 1 coefficients an edge, each of them min(c + μ|σ_N|, t_max) of the coefficients: no
    more than the law's where t_max comes into play inside an edge. A bound below which no polynomial has coefficients
    ≥ 0 is replaced by its least value.
    """
    qvi, rule = discretization.qvi, discretization.rule
    pressure = qvi.law.pressed(rule.at_rows(normal))
    law, exact = _data(discretization, "cohesion")
    cap, cap_exact = _data(discretization, "shear_limit")
    law = law + (qvi.mu * pressure).reshape(law.shape)
    bound = np.minimum(law, cap)
    return bound, np.where(_below(law, cap), exact, cap_exact & _below(cap, law))


def _below(first: FloatArray, second: FloatArray) -> BoolArray:
    """On which edges the first bound is the smaller one in all coefficients (e, q), rounding set aside."""
    return np.asarray((first <= second * (1.0 + _ROUNDING)).all(axis=1))


def _limited(discretization: Discretization) -> list[ContactRows]:
    return [rows for rows in discretization.contacts if rows.law != "tied"]


def _data(discretization: Discretization, name: str) -> tuple[FloatArray, BoolArray]:
    """Coefficients (e, q) ≥ 0 of a field of the law on all edges, and where they are those of the field."""
    q = discretization.rule.count
    values = joined([getattr(rows, name) for rows in _limited(discretization)]).reshape(-1, q)
    given: BoolArray = np.asarray(np.isfinite(values).all(axis=1))
    found = coefficients(discretization, np.where(given[:, None], values, 0.0), q - 1)
    size = np.where(given, np.abs(values).max(axis=1), 0.0)
    usable: BoolArray = np.asarray((found >= -_ROUNDING * size[:, None]).all(axis=1))
    inside = found @ bernstein.basis(q - 1, bernstein.SAMPLES).T
    least = np.maximum(np.minimum(inside.min(axis=1), values.min(axis=1)), 0.0)
    found = np.where(usable[:, None], np.maximum(found, 0.0), least[:, None])
    return np.where(given[:, None], found, np.inf), usable
