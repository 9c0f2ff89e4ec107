"""The data of a problem, dimensionless: prescribed tractions and displacements, body forces, contacts.

In `docs/theory.md`: (D1).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, IntArray, acts, evaluate
from qvi_contact.discretization.scaling import Scales
from qvi_contact.discretization.space import EdgeRule, StressSpace
from qvi_contact.element.edge import SAMPLES, EdgeQuadrature, adapted, constant, gauss_legendre, legendre_basis
from qvi_contact.mesh.edges import Edges, points_along, rounding_along, vectors_along
from qvi_contact.problem.conditions import SHEAR_LAW, Contact, Displacement, Law, has_coulomb
from qvi_contact.problem.fields import along_edges
from qvi_contact.problem.material import is_strained, stress_at_rest
from qvi_contact.problem.problem import ContactProblem, Prescribed

LOAD_POINTS = 8
"""Gauss points per edge for data given as functions, exact up to degree 15; tractions have them on parts of edges."""

_ROUNDING = 1e-9  # difference from a polynomial over the largest value, up to which it is rounding
_SAMPLES: FloatArray = np.linspace(0.0, 1.0, 9)  # places on an edge where a contact law is sampled
_ON_ARCS: Final = 8  # more Gauss points on arcs, whose normals and tangents turn by 90° at most


@dataclass(frozen=True, eq=False)
class EdgePoints:
    """Gauss points on edges of the boundary or of joints."""

    space: StressSpace
    edges: Edges
    count: int  # number q of Gauss points on each of the n edges; arrays over points have shape (n q,), edge by edge

    @property
    def reference(self) -> FloatArray:
        """Reference coordinates of the points of each edge, 0 to 1 along the tangent, shape (q,)."""
        return gauss_legendre(self.count)[0]

    @cached_property
    def lengths(self) -> FloatArray:
        """Dimensionless lengths of the edges, shape (n,)."""
        return np.asarray(self.edges.length / self.space.mesh.length)

    @cached_property
    def weights(self) -> FloatArray:
        """Quadrature weights, the edge's length included, shape (n q,)."""
        return np.outer(self.lengths, gauss_legendre(self.count)[1]).ravel()

    @cached_property
    def coordinates(self) -> FloatArray:
        """Dimensionless coordinates, shape (n q, 2)."""
        return points_along(self.space.vertices, self.edges, self.reference).reshape(-1, 2)

    @property
    def normals(self) -> FloatArray:
        """The edge's normal at each point, shape (n q, 2)."""
        return self.vectors(self.edges.normal, turns=True)

    @property
    def tangents(self) -> FloatArray:
        """The edge's tangent at each point, shape (n q, 2)."""
        return self.vectors(self.edges.tangent, turns=True)

    def for_resultants(self) -> "EdgePoints":
        """These points, or more of them if edges are arcs: normals turn there, and resultants shall be exact."""
        return replace(self, count=self.count + _ON_ARCS) if self.edges.curved else self

    def vectors(self, direction: FloatArray, turns: bool) -> FloatArray:
        """Directions (n, 2) of edges at the points (n q, 2); with `turns` they turn along arcs as the tangent does."""
        return vectors_along(self.edges, direction, self.reference, turns=turns).reshape(-1, 2)

    def traction_load(self, direction: FloatArray, weights: FloatArray) -> FloatArray:
        """Σ weights (n q,) d·σn without φ, directions d (n q, 2), as a vector over all degrees of freedom (N,)."""
        normal, shear = (weights * (direction * axis).sum(axis=1) for axis in (self.normals, self.tangents))
        return self.space.traction_load(normal, shear, self.edges, self.reference)

    def nearest(self, field: EdgeQuadrature) -> FloatArray:
        """Values (n q,) of a field's projections, in the mean square, on polynomials of degree q − 1 on each edge.

        Tractions, polynomials of that degree or less, do the same work on field and projection.
        """
        degree = self.count - 1
        return np.asarray(field.coefficients(degree) @ legendre_basis(degree, self.reference).T).ravel()

    def tractions(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """σ_N without φ and σ_T of degrees of freedom u (N,), shape (n q,) each."""
        return self.space.tractions(u, self.edges, self.reference)


def potential_at(problem: ContactProblem, scales: Scales, points: FloatArray) -> FloatArray:
    """Body-force potential φ/S (...) at dimensionless points (..., 2)."""
    x, y = physical(problem, scales, points)
    return evaluate("ContactProblem.body_potential", problem.body_potential, x, y) / scales.stress


def physical(problem: ContactProblem, scales: Scales, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coordinates x, y [length] of dimensionless points (..., 2)."""
    origin = problem.mesh.origin
    return origin[0] + scales.length * points[..., 0], origin[1] + scales.length * points[..., 1]


def traction_data(problem: ContactProblem, scales: Scales, given: Prescribed, points: int) -> EdgeQuadrature:
    """The part of a prescribed traction that Φ has to carry, d·σn − φ d·n over S, at Gauss points of parts of edges."""
    has_body_force, mesh = acts(problem.body_potential), problem.mesh
    if not has_body_force and not callable(given.value):
        return constant(given.value / scales.stress, len(given.edges), points)

    def traction(edge: IntArray, t: FloatArray) -> FloatArray:
        edges = given.edges.take(edge)
        x, y = mesh.points_along(edges, t)
        values = evaluate(given.name, given.value, x, y)
        if has_body_force:
            direction = vectors_along(edges, given.direction[edge], t, turns=given.turns)
            outward = (direction * vectors_along(edges, edges.normal, t)).sum(axis=2)
            values -= outward * evaluate("ContactProblem.body_potential", problem.body_potential, x, y)
        return values / scales.stress

    return adapted(traction, len(given.edges), points, rounding_along(mesh.vertices, given.edges))


def cell_stress(problem: ContactProblem, space: StressSpace, scales: Scales) -> FloatArray | None:
    """φI − σ⁰ over S at the quadrature points of cells (cells, g, 3); None without body force and initial strain."""
    has_body_force, has_strain = acts(problem.body_potential), is_strained(problem)
    if not has_body_force and not has_strain:
        return None
    cells = np.arange(problem.mesh.cell_count)
    points = space.points(cells, space.cell_quadrature[0])
    stress = np.zeros((*points.shape[:2], 3))
    if has_body_force:
        stress[..., :2] = potential_at(problem, scales, points)[..., None]
    if has_strain:
        stress -= scaled_stress_at_rest(problem, scales, cells, points)
    return stress


def scaled_stress_at_rest(problem: ContactProblem, scales: Scales, cells: IntArray, points: FloatArray) -> FloatArray:
    """σ⁰/S (k, …, 3) of the initial strain at dimensionless points (k, …, 2) of cells (k,)."""
    return stress_at_rest(problem, cells, *physical(problem, scales, points)) / scales.stress


def is_polynomial(problem: ContactProblem, edges: Edges, name: str, field: Field, most: int, unit: float = 0.0) -> bool:
    """Whether a field is a polynomial of degree `most` or less along each edge, judged at many points.

    Its rounding is relative to its values, or to a larger `unit`: what is that much smaller counts as zero.
    """
    values = evaluate(name, field, *problem.mesh.points_along(edges, SAMPLES))
    # a body potential may be mere rounding along the edges: its size is that in the whole body
    scale = evaluate(name, field, *problem.mesh.vertices.T) if field is problem.body_potential else values
    return spanned(values, legendre_basis(most, SAMPLES), max(unit, float(np.abs(scale).max())))


def spanned(values: FloatArray, functions: FloatArray, size: float = 0.0) -> bool:
    """Whether rows of values (n, k) are combinations of functions (k, c), up to rounding of numbers of a `size`."""
    basis = np.linalg.qr(functions)[0]
    return bool(np.abs(values - values @ basis @ basis.T).max() <= _ROUNDING * max(size, np.abs(values).max()))


class Limits(NamedTuple):
    """Data of the bound min(c + μ|σ_N|, t_max) of |σ_T|, at the points or for the rows of a contact."""

    friction: FloatArray  # (m,): μ
    cohesion: FloatArray  # (m,): c, dimensionless
    cap: FloatArray  # (m,): t_max, dimensionless; infinity without a cap


@dataclass(frozen=True, eq=False)
class ContactRows:
    """The rows of (D2) of one contact, and its data at the Gauss points; all arrays are dimensionless."""

    name: str
    law: Law  # unilateral, bilateral or tied
    joint: bool  # whether the contact lies inside the body
    rows: slice  # its rows in `FrictionQVI.N` and `FrictionQVI.T`, `EdgeRule.count` an edge; empty for a tied contact
    rule: EdgeRule
    points: EdgePoints  # the m Gauss points, as many as rows, where results are given
    row_limits: Limits
    limits: Limits  # at the points
    gap: FloatArray  # (m,): position g of the obstacle; projected by `EdgePoints.nearest` if the law holds on edges
    offset: FloatArray  # (m,): tangential offset w of the obstacle, likewise
    # (m,): projected pressure p_w of a fluid, with the right force and moment on every edge; σ_N' = σ_N + p_w
    pore_pressure: FloatArray
    pore_misfit: float  # largest difference of that polynomial from p_w
    motion: FloatArray  # (2, m): given displacement of a rigid plate along n and t
    beyond: FloatArray  # (m,): distance of a unilateral obstacle less `Scales.reach`, where that is positive
    slip: FloatArray  # (m,): slip in earlier load steps, which is added to w

    @property
    def edges(self) -> slice:
        """The range of its edges among the edges of all contacts with rows; empty for a tied contact."""
        return slice(self.rows.start // self.points.count, self.rows.stop // self.points.count)

    @cached_property
    def bilateral(self) -> BoolArray:
        """Whether σ_N may have either sign, at each point."""
        return np.full(len(self.gap), self.law != "unilateral")

    def bound(self, effective: FloatArray) -> FloatArray:
        """Bound min(c + μ|σ_N'|, t_max) of |σ_T| for effective normal tractions, dimensionless; infinity if tied."""
        if self.law == "tied":
            return np.full(len(self.gap), np.inf)
        return np.minimum(self.limits.cohesion + self.limits.friction * np.abs(effective), self.limits.cap)

    def pressure(self, problem: ContactProblem, scales: Scales) -> FloatArray:
        """φ + p_w (m,), the part of σ_N' that Φ does not hold, dimensionless."""
        return potential_at(problem, scales, self.points.coordinates) + self.pore_pressure

    @property
    def row_weights(self) -> FloatArray:
        """Weights W of the rows, dimensionless, shape (m,)."""
        return np.outer(self.points.lengths, self.rule.shares).ravel()

    @property
    def obstacle(self) -> tuple[FloatArray, FloatArray]:
        """Position and tangential offset of the obstacle (m,), with the plate's motion and the earlier slip."""
        slip = 0.0 if self.law == "tied" else self.slip  # a tied contact has not slipped
        return self.gap + self.motion[0], self.offset + self.motion[1] + slip


def contact_rows(
    problem: ContactProblem, space: StressSpace, rule: EdgeRule, scales: Scales, slip: Sequence[FloatArray] | None
) -> tuple[ContactRows, ...]:
    """All contacts in the order of the problem, after earlier slip; `InputError` where a field gives bad values."""
    contacts, start = [], 0
    for number, contact in enumerate(problem.contacts):
        edges = problem.mesh.edges(contact.edges)
        key = space, rule.count, edges.number.tobytes()
        points = problem.mesh.kept(EdgePoints, key, partial(EdgePoints, space, edges, rule.count))
        m = len(points.weights)
        stop, motion = start if contact.law == "tied" else start + m, np.zeros((2, m))
        if contact.plate is not None:
            x, y = physical(problem, scales, points.coordinates)
            displacement = contact.plate.displacement(x, y).T / scales.displacement
            motion = np.stack([(displacement * axis).sum(axis=1) for axis in (points.normals, points.tangents)])
        pressure, misfit = np.zeros(m), 0.0
        if contact.has_fluid:
            given = ("Contact.pore_pressure", contact.pore_pressure, max(LOAD_POINTS, points.count + 2))
            fluid = along_edges(problem.mesh, points.edges, *given, minimum=0.0)
            pressure, misfit = points.nearest(fluid), fluid.misfit(fluid.coefficients(points.count - 1))
        # with the law at points g is taken there: a projection that is below g at a point would make contact too early
        obstacle = []
        for name in ("gap", "offset"):
            field: Field = getattr(contact, name)
            if not callable(field):
                values = np.full(m, float(field))
            elif rule.law_on == "points":
                values = evaluate(f"Contact.{name}", field, *physical(problem, scales, points.coordinates))
            else:
                given = (f"Contact.{name}", field, max(LOAD_POINTS, points.count + 2))
                values = points.nearest(along_edges(problem.mesh, points.edges, *given))
            obstacle.append(values / scales.displacement)
        gap, offset = obstacle
        beyond = np.maximum(gap - scales.reach, 0.0) * (contact.law == "unilateral")
        contacts.append(ContactRows(
            contact.name, contact.law, contact in problem.joints, slice(start, stop), rule, points,
            *limits_of(problem, contact, scales, rule, points), gap, offset, pressure / scales.stress,
            misfit / scales.stress, motion, beyond, np.zeros(m) if slip is None else slip[number],
        ))  # fmt: skip
        start = stop
    return tuple(contacts)


def works_of(
    problem: ContactProblem, space: StressSpace, scales: Scales, contacts: Sequence[ContactRows]
) -> tuple[FloatArray, float]:
    """`Discretization.works` of obstacles and prescribed displacements; φ, which is not in u, adds a constant."""
    works, constant, has_body_force = np.zeros(space.size), 0.0, acts(problem.body_potential)
    for rows in contacts:  # ∫_{Γ_μ} (g τ_N' + w τ_T) ds
        points, weights, (gap, offset) = rows.points, rows.points.weights, rows.obstacle
        across = weights * (gap - rows.beyond)
        works += space.traction_load(across, weights * offset, points.edges, points.reference)
        if has_body_force or rows.pore_pressure.any():
            constant += float(across @ rows.pressure(problem, scales))
    for given in problem.prescribed(Displacement):  # ∫_{Γ_u} U·τn ds
        if acts(given.value):
            points = EdgePoints(space, given.edges, max(LOAD_POINTS, space.degree - 1))
            field = along_edges(problem.mesh, given.edges, given.name, given.value, points.count)
            direction = points.vectors(given.direction, given.turns)
            weights = points.weights * points.nearest(field) / scales.displacement
            works += points.traction_load(direction, weights)
            if has_body_force:
                normal_parts = weights * (direction * points.normals).sum(axis=1)
                constant += float(normal_parts @ potential_at(problem, scales, points.coordinates))
    return works, constant


def laws_vary(problem: ContactProblem) -> bool:
    """Whether Bernstein coefficients cannot represent the law of some contact.

    They represent μ|σ_N| exactly if μ is constant and σ_N has one sign, and c and t_max if these are affine along each
    edge. Otherwise the law would not hold on whole edges, nor to the order of the element. So the answer is yes for a
    bilateral contact with friction, whose σ_N has either sign, and where samples show another μ, c or t_max.
    """
    for contact in problem.contacts:
        if contact.law == "bilateral" and has_coulomb(contact):
            return True
        for name in SHEAR_LAW:
            field = getattr(contact, name)
            if callable(field):
                x, y = problem.mesh.points_along(problem.mesh.edges(contact.edges), _SAMPLES)
                values = evaluate(f"Contact.{name}", field, x, y, minimum=0.0)
                most, unit = (0, 1.0) if name == "friction" else (1, Scales.of(problem).stress)
                if not spanned(values, legendre_basis(most, _SAMPLES), unit):  # its terms may cancel each other
                    return True
    return False


def limits_of(
    problem: ContactProblem, contact: Contact, scales: Scales, rule: EdgeRule, points: EdgePoints
) -> tuple[Limits, Limits]:
    """The limits for the rows of a contact, and at its points."""

    def at(coordinates: FloatArray) -> Limits:
        values_of_fields = []
        for name in SHEAR_LAW:
            field, unit = getattr(contact, name), 1.0 if name == "friction" else scales.stress
            if callable(field):
                values = evaluate(f"Contact.{name}", field, *physical(problem, scales, coordinates), minimum=0.0)
            else:
                values = np.full(len(coordinates), np.inf if field is None else field)
            values_of_fields.append(values / unit)
        return Limits(*values_of_fields)

    limits = at(points.coordinates)
    if rule.law_on == "points" or not any(callable(getattr(contact, name)) for name in SHEAR_LAW):
        return limits, limits
    return at(points_along(points.space.vertices, points.edges, rule.places).reshape(-1, 2)), limits


def joined(arrays: Sequence[NDArray[Any]]) -> FloatArray:
    """Vectors one after the other; an empty vector if there are no vectors."""
    return np.concatenate([np.empty(0), *arrays])
