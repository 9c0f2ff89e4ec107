"""Prescribed tractions, displacements, body forces and obstacles as conditions and load vectors, dimensionless.

In `docs/theory.md`: (D1).
"""

from collections.abc import Iterator

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, evaluate
from qvi_contact.discretization.basis import Basis, PrescribedTraction
from qvi_contact.discretization.edge_points import EdgePoints
from qvi_contact.discretization.scaling import Scales
from qvi_contact.mesh.edges import edge_ends
from qvi_contact.problem.conditions import Contact, Displacement, Traction
from qvi_contact.problem.problem import ContactProblem, Prescribed

LOAD_POINTS = 8
"""Gauss points for data given as functions, on edges: exact up to degree 15; for tractions on parts too."""


def potential_at(problem: ContactProblem, scales: Scales, points: FloatArray) -> FloatArray:
    """Body-force potential φ/S at dimensionless points, shape (..., 2) to (...)."""
    return _potential(problem, scales, *physical(problem, scales, points))


def _potential(problem: ContactProblem, scales: Scales, x: FloatArray, y: FloatArray) -> FloatArray:
    return evaluate("ContactProblem.body_potential", problem.body_potential, x, y) / scales.stress


def has_body_force(problem: ContactProblem) -> bool:
    """Whether there is a potential, be it constant."""
    return callable(problem.body_potential) or problem.body_potential != 0.0


def physical(problem: ContactProblem, scales: Scales, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coordinates x, y [length] of dimensionless points (..., 2)."""
    origin = problem.mesh.origin
    return origin[0] + scales.length * points[..., 0], origin[1] + scales.length * points[..., 1]


def prescribed_tractions(problem: ContactProblem, scales: Scales) -> list[PrescribedTraction]:
    """All prescribed tractions, symmetry lines included, in the order of the problem."""
    return [_traction(problem, scales, given) for given in problem.prescribed(Traction)]


def _traction(problem: ContactProblem, scales: Scales, given: Prescribed) -> PrescribedTraction:
    def value(x: FloatArray, y: FloatArray) -> FloatArray:
        return evaluate(given.name, given.value, x, y) / scales.stress

    def potential(x: FloatArray, y: FloatArray) -> FloatArray:
        return _potential(problem, scales, x, y)

    edges = given.edges
    own = potential if has_body_force(problem) else None
    number = None if own is not None or callable(given.value) else given.value / scales.stress
    return PrescribedTraction(given.name, edges, given.direction, value, own, given.turns, number)


def frictionless_corners(problem: ContactProblem) -> list[int]:
    """Vertices of contacts that carry no shear there, and that a prescribed shear other than zero reaches.

    The two disagree, and the corner is treated as one between two prescribed shears.
    """
    found = []
    for vertex, name in shear_beside_contacts(problem):
        contact = contact_named(problem, name)
        x, y = problem.mesh.vertices[[vertex]].T
        friction = evaluate("Contact.friction", contact.friction, x, y, minimum=0.0)
        cohesion = evaluate("Contact.cohesion", contact.cohesion, x, y, minimum=0.0)
        limit = contact.shear_limit if contact.shear_limit is not None else np.inf
        capped = callable(limit) and evaluate("Contact.shear_limit", limit, x, y, minimum=0.0)[0] == 0.0
        if friction[0] == cohesion[0] == 0.0 or limit == 0.0 or capped:
            found.append(vertex)
    return found


def contact_named(problem: ContactProblem, name: str) -> Contact:
    """The contact of that name."""
    return next(contact for contact in problem.contacts if contact.name == name)


def shear_beside_contacts(problem: ContactProblem) -> list[tuple[int, str]]:
    """Vertices where a prescribed shear other than zero meets a contact that limits shear, with the contact's name."""
    found = []
    for contact in problem.contacts:
        if contact.law == "tied":
            continue
        ends = edge_ends(problem.mesh.edges(contact.edges))
        for given in problem.prescribed(Traction):
            shear = given.edges.take(_along(given, given.edges.tangent))
            vertices = np.intersect1d(np.concatenate([shear.first, shear.second]), ends)
            values = evaluate(given.name, given.value, *problem.mesh.vertices[vertices].T)
            found += [(int(vertex), contact.name) for vertex in vertices[values != 0.0]]
    return found


def _along(given: Prescribed, vectors: FloatArray) -> BoolArray:
    """Edges on which the component is that along the given unit vectors (n, 2)."""
    return np.asarray(np.abs((given.direction * vectors).sum(axis=1)) == 1.0)


def displacements_at_points(
    problem: ContactProblem, basis: Basis, scales: Scales
) -> Iterator[tuple[FloatArray, EdgePoints, FloatArray]]:
    """Prescribed displacements as (directions (m, 2), m Gauss points of edges, values there [length])."""
    for given in problem.prescribed(Displacement):
        points = EdgePoints(basis, given.edges, LOAD_POINTS)
        x, y = physical(problem, scales, points.coordinates)
        yield points.vectors(given.direction, given.turns), points, evaluate(given.name, given.value, x, y)


def displacement_load(problem: ContactProblem, basis: Basis, scales: Scales) -> FloatArray:
    """∫_{Γ_u} U·τn ds as a vector over all degrees of freedom, the first term on the right of (D1)."""
    load = np.zeros(basis.size)
    for direction, points, values in displacements_at_points(problem, basis, scales):
        if values.any():
            load += points.traction_load(direction, points.weights * values / scales.displacement)
    return load


def cell_potential(problem: ContactProblem, basis: Basis, scales: Scales) -> FloatArray | None:
    """φ at the quadrature points of the cells (cells, g), dimensionless; None without body force."""
    if not has_body_force(problem):
        return None
    return potential_at(problem, scales, basis.points(np.arange(problem.mesh.cell_count), basis.cell_points))
