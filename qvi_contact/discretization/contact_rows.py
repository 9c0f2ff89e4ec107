"""What the contacts put into (D2): points, laws and prescribed displacements, dimensionless.

In `docs/theory.md`: (D1).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qvi_contact.basics.checks import BoolArray, FloatArray, evaluate
from qvi_contact.discretization.loads import LOAD_POINTS, EdgePoints, physical
from qvi_contact.discretization.scaling import Scales
from qvi_contact.discretization.space import ContactRule, StressSpace
from qvi_contact.element import legendre
from qvi_contact.mesh.edges import points_along
from qvi_contact.problem.conditions import Contact, Law, has_coulomb
from qvi_contact.problem.fields import along_edges
from qvi_contact.problem.problem import ContactProblem

_LOOKED_AT: FloatArray = np.linspace(0.0, 1.0, 9)  # places on an edge where it is seen whether a law varies
_ROUNDING = 1e-12  # of the largest value


@dataclass(frozen=True, eq=False)
class Limits:
    """What bounds |σ_T| by min(c + μ|σ_N|, t_max), at points or for rows of a contact.

    Attributes
    ----------
    friction : (m,) array
        μ.
    cohesion, cap : (m,) arrays
        c and t_max, dimensionless; infinity where there is no limit.

    """

    friction: FloatArray
    cohesion: FloatArray
    cap: FloatArray


@dataclass(frozen=True, eq=False)
class ContactRows:
    """The rows of (D2) that belong to one contact.

    Attributes
    ----------
    name : str
        Name of the contact.
    law : "unilateral", "bilateral" or "tied"
        Law across the contact.
    joint : bool
        Whether it lies inside the body.
    rows : slice
        Its rows in `FrictionQVI.N` and `FrictionQVI.T`, `ContactRule.count` an edge; none for a tied contact, which
        limits no traction.
    rule : ContactRule
        What the rows of an edge are.
    points : EdgePoints
        The m Gauss points, as many as rows, where results are given.
    row_limits : Limits
        What bounds the rows.
    friction : (m,) array
        μ at the points.
    cohesion, shear_limit : (m,) arrays
        c and t_max at the points, dimensionless; infinity where there is no limit.
    gap, offset : (m,) arrays
        Obstacle position g and tangential offset w at the points, dimensionless.
    pore_pressure : (m,) array
        Pressure p_w of a fluid in the contact at the points, dimensionless; σ_N' = σ_N + p_w obeys the law. It is the
        polynomial through as many points an edge that is nearest in the mean square, so that every edge keeps its
        resultant force and moment.
    pore_misfit : float
        Largest difference of that polynomial from p_w, dimensionless.
    motion : (2, m) array
        Given displacement of a rigid plate at the points, along n and along t, dimensionless; beside gap and offset.
    reach : float
        An obstacle that is farther counts as that far, see `Scales`.

    """

    name: str
    law: Law
    joint: bool
    rows: slice
    rule: ContactRule
    points: EdgePoints
    row_limits: Limits
    friction: FloatArray
    cohesion: FloatArray
    shear_limit: FloatArray
    gap: FloatArray
    offset: FloatArray
    pore_pressure: FloatArray
    pore_misfit: float
    motion: FloatArray
    reach: float = np.inf

    @property
    def beyond(self) -> FloatArray:
        """By how much the obstacle stands beyond reach (m,), dimensionless: 0 where it does not, or is held."""
        return np.where(self.bilateral, 0.0, np.maximum(self.gap - self.reach, 0.0))

    @property
    def edges(self) -> slice:
        """Its edges among those of all contacts that have rows; none for a tied contact."""
        return slice(self.rows.start // self.points.count, self.rows.stop // self.points.count)

    @property
    def bilateral(self) -> BoolArray:
        """Whether σ_N may have either sign, at each point."""
        return np.full(len(self.gap), self.law != "unilateral")

    def bound(self, effective: FloatArray) -> FloatArray:
        """Bound min(c + μ|σ_N'|, t_max) of |σ_T| for effective normal tractions, dimensionless; infinity if tied."""
        if self.law == "tied":
            return np.full(len(self.gap), np.inf)
        return np.minimum(self.cohesion + self.friction * np.abs(effective), self.shear_limit)

    @property
    def row_weights(self) -> FloatArray:
        """Weights W of the rows, dimensionless, shape (m,)."""
        return np.outer(self.points.lengths, self.rule.shares).ravel()

    def work(self) -> FloatArray:
        """∫ g τ_N + w τ_T ds as a vector over all degrees of freedom, the last term of (D1); g within reach."""
        weights, (across, along) = self.points.weights, self.motion
        return self.points.load(weights * (self.gap - self.beyond + across), weights * (self.offset + along))

    def with_offset(self, offset: FloatArray) -> "ContactRows":
        """The same contact at another tangential offset (m,), dimensionless."""
        return replace(self, offset=offset)


def contact_rows(problem: ContactProblem, space: StressSpace, scales: Scales) -> tuple[ContactRows, ...]:
    """All contacts in the order of the problem; `InputError` where a field gives bad values."""
    found, start, rule = [], 0, space.contact_rule
    for contact in problem.contacts:
        points = EdgePoints(space, problem.mesh.edges(contact.edges), rule.count)
        stop = start if contact.law == "tied" else start + len(points.weights)
        found.append(_rows(problem, scales, contact, points, slice(start, stop)))
        start = stop
    return tuple(found)


def laws_vary(problem: ContactProblem) -> bool:
    """Whether Bernstein coefficients cannot hold a contact's law.

    They take μ times the coefficients of |σ_N| for those of the product, which is right for a constant μ and a σ_N of
    one sign only, and c and t_max at their places for coefficients, which is right for affine functions. So μ must not
    vary along an edge, c and t_max must not bend there, and σ_N must not change sign there, as it may on a bilateral
    contact. Else the law would neither hold on whole edges nor be met to the order of the element. Ends count, where a
    jump between two edges shows.
    """
    for contact in problem.contacts:
        if contact.law == "bilateral" and has_coulomb(contact):
            return True
        fields = {"friction": contact.friction, "cohesion": contact.cohesion, "shear_limit": contact.shear_limit}
        for name, field in fields.items():
            if callable(field):
                x, y = problem.mesh.points_along(problem.mesh.edges(contact.edges), _LOOKED_AT)
                values = evaluate(f"Contact.{name}", field, x, y, minimum=0.0)
                change = np.diff(values, n=1 if name == "friction" else 2, axis=1)
                if np.abs(change).max() > _ROUNDING * np.abs(values).max():
                    return True
    return False


def _rows(problem: ContactProblem, scales: Scales, contact: Contact, points: EdgePoints, rows: slice) -> ContactRows:
    rule = points.space.contact_rule
    x, y = physical(problem, scales, points.coordinates)
    limits = row_limits = _limits(contact, scales, x, y)
    if rule.to_points is not None:
        places = points_along(points.space.vertices, points.edges, rule.places).reshape(-1, 2)
        row_limits = _limits(contact, scales, *physical(problem, scales, places))
    return ContactRows(
        contact.name,
        contact.law,
        contact in problem.joints,
        rows,
        rule,
        points,
        row_limits,
        limits.friction,
        limits.cohesion,
        limits.cap,
        evaluate("Contact.gap", contact.gap, x, y) / scales.displacement,
        evaluate("Contact.offset", contact.offset, x, y) / scales.displacement,
        *_pore_pressure(problem, scales, contact, points),
        _motion(scales, contact, points, x, y),
        scales.reach,
    )


def _motion(scales: Scales, contact: Contact, points: EdgePoints, x: FloatArray, y: FloatArray) -> FloatArray:
    """The given motion of a plate at the points, along normals and tangents (2, m), dimensionless."""
    if contact.plate is None:
        return np.zeros((2, len(x)))
    moved = contact.plate.displacement(x, y).T / scales.displacement
    return np.stack([(moved * along).sum(axis=1) for along in (points.normals, points.tangents)])


def _pore_pressure(
    problem: ContactProblem, scales: Scales, contact: Contact, points: EdgePoints
) -> tuple[FloatArray, float]:
    """Pressure at the points of the polynomials taken for it, and their largest difference from it, dimensionless."""
    field = contact.pore_pressure
    if not callable(field):
        return np.full(len(points.weights), float(field) / scales.stress), 0.0
    name, degree = "Contact.pore_pressure", points.count - 1
    found = along_edges(problem.mesh, points.edges, name, field, max(LOAD_POINTS, degree + 3), minimum=0.0)
    coefficients = found.coefficients(degree)
    values = coefficients @ legendre.basis(degree, points.reference).T
    return values.ravel() / scales.stress, found.misfit(coefficients) / scales.stress


def _limits(contact: Contact, scales: Scales, x: FloatArray, y: FloatArray) -> Limits:
    """The fields at points [length]."""
    cap = np.full(len(x), np.inf)
    if contact.shear_limit is not None:
        cap = evaluate("Contact.shear_limit", contact.shear_limit, x, y, minimum=0.0) / scales.stress
    return Limits(
        evaluate("Contact.friction", contact.friction, x, y, minimum=0.0),
        evaluate("Contact.cohesion", contact.cohesion, x, y, minimum=0.0) / scales.stress,
        cap,
    )


def joined(arrays: Sequence[NDArray[Any]]) -> FloatArray:
    """Vectors one after the other, also if there are none."""
    return np.concatenate([np.empty(0), *arrays])
