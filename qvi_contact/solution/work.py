"""Tractions of a stress on edges: what they do along prescribed displacements, and how far they are from the data.

On an arc tractions are the polynomials whose coefficients are degrees of freedom: they have the resultants of the
stress, and its moments up to their degree. Between the two is a rest of the order of the element. Equilibrium holds up
to its work.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, evaluate
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import (
    LOAD_POINTS,
    EdgePoints,
    displacements_at_points,
    is_polynomial,
    physical,
    potential_at,
    prescribed_tractions,
)
from qvi_contact.element import legendre
from qvi_contact.element.quadrature import EdgeQuadrature
from qvi_contact.solution.stress import stress_rounding

_MISFIT: Final = 1e-9  # prescribed tractions missed beyond rounding, relative to the unit of stress, that count
_ROUNDED: Final = 1e-6  # the same that rounding in the smallest cells may explain
_ULPS: Final = 8.0  # times each degree of freedom may be rounded, solved along the boundary
_POINTS = 12


def support_work(discretization: Discretization, u: FloatArray) -> float:
    """∫_{Γ_u} U·τn ds [stress × length²] of degrees of freedom u of Φ."""
    problem, space, scales = discretization.problem, discretization.space, discretization.scales
    work = 0.0
    for direction, points, values in displacements_at_points(problem, space, scales):
        along = component(traction(discretization, u, points), direction)
        work += scales.length * float(points.weights @ (values * along))
    return work


def obstacle_work(discretization: Discretization, u: FloatArray) -> float:
    """∫_{Γ_μ} (g τ_N + w τ_T) ds [stress × length²] of u, g and w as the problem prescribes them, plates moved."""
    problem, scales, total = discretization.problem, discretization.scales, 0.0
    for contact in problem.contacts:
        points = EdgePoints(discretization.space, problem.mesh.edges(contact.edges), LOAD_POINTS)
        x, y = physical(problem, scales, points.coordinates)
        normal, shear = normal_and_shear(discretization, u, points)
        gap, offset = evaluate("Contact.gap", contact.gap, x, y), evaluate("Contact.offset", contact.offset, x, y)
        work = scales.stress * (gap * normal + offset * shear)
        if contact.plate is not None:
            work += (contact.plate.displacement(x, y) * traction(discretization, u, points)).sum(axis=0)
        total += scales.length * float(points.weights @ work)
    return total


def fluid_work(discretization: Discretization) -> float:
    """∫ g p_w ds [stress × length²] of fluids in contacts: τ_N + p_w is the traction that contacts feel."""
    problem, scales = discretization.problem, discretization.scales
    work = 0.0
    for contact in problem.contacts:
        if contact.has_fluid:
            points = EdgePoints(discretization.space, problem.mesh.edges(contact.edges), LOAD_POINTS)
            x, y = physical(problem, scales, points.coordinates)
            pressure = evaluate("Contact.pore_pressure", contact.pore_pressure, x, y, minimum=0.0)
            gap = evaluate("Contact.gap", contact.gap, x, y)
            if contact.plate is not None:
                gap = gap + component(contact.plate.displacement(x, y), points.normals)
            work += scales.length * float(points.weights @ (pressure * gap))
    return work


def normal_and_shear(
    discretization: Discretization, u: FloatArray, points: EdgePoints
) -> tuple[FloatArray, FloatArray]:
    """τ_N and τ_T at points of edges, dimensionless, of degrees of freedom u of Φ."""
    normal, shear = points.tractions(u.ravel())
    return normal + potential_at(discretization.problem, discretization.scales, points.coordinates), shear


def traction(discretization: Discretization, u: FloatArray, points: EdgePoints) -> FloatArray:
    """Traction τn at points of edges, shape (2, points) [stress]."""
    normal, shear = normal_and_shear(discretization, u, points)
    return np.asarray(discretization.scales.stress * (normal * points.normals.T + shear * points.tangents.T))


def misfit_of_tractions(discretization: Discretization, u: FloatArray) -> float:
    """Largest difference between prescribed tractions and those of degrees of freedom u of Φ at points [stress].

    The points are those that integrate the data, but for parts of edges that are next to nothing.
    """
    pairs = prescribed_and_computed(discretization, u)
    return discretization.scales.stress * max((wanted.misfit(computed) for wanted, computed in pairs), default=0.0)


def prescribed_and_computed(
    discretization: Discretization, u: FloatArray
) -> Iterator[tuple[EdgeQuadrature, FloatArray]]:
    """Each prescribed component of tractions on its n edges, and the computed one's coefficients of Legendre (n, k).

    Dimensionless, without φ.
    """
    problem, space, scales = discretization.problem, discretization.space, discretization.scales
    degree = space.traction_degree
    count = max(LOAD_POINTS, degree + 1)
    for given in prescribed_tractions(problem, scales):
        if given.edges.curved:  # normals turn: what is computed is no polynomial of the degree
            degree = count - 1
        points = EdgePoints(space, given.edges, count)
        normal, shear = points.tractions(u.ravel())
        directions = points.vectors(given.direction, given.turns)
        along = component(normal * points.normals.T + shear * points.tangents.T, directions)
        wanted = given.quadrature(problem.mesh.vertices, LOAD_POINTS)
        yield wanted, along.reshape(-1, count) @ legendre.from_values(degree, count).T


def component(vectors: FloatArray, directions: FloatArray) -> FloatArray:
    """The component of vectors (2, points) along a direction at each point (points, 2), shape (points,)."""
    return np.asarray((vectors * directions.T).sum(axis=0))


def allowed_misfit(unit: float, rounding: float) -> float:
    """Misfit of tractions that rounding explains, from the unit of stress and the rounding of stresses [stress]."""
    return _MISFIT * unit + min(_ULPS * rounding, _ROUNDED * unit)


def loads_followed(discretization: Discretization) -> bool:
    """Whether all stresses of the mesh meet the loads, and what enters tractions of contacts, point by point.

    That is so for tractions that a stress of the mesh can have, and where body potential and pore pressure are
    polynomials of the degree of σ_N on every edge of the contacts.
    """
    u, unit = discretization.values(np.zeros(discretization.qvi.n)), discretization.scales.stress
    rounding = unit * stress_rounding(discretization, u)
    if misfit_of_tractions(discretization, u) > allowed_misfit(unit, rounding):
        return False
    problem, most = discretization.problem, discretization.space.traction_degree
    for contact in problem.contacts:
        fields = {
            "Contact.pore_pressure": contact.pore_pressure,
            "ContactProblem.body_potential": problem.body_potential,
        }
        edges = problem.mesh.edges(contact.edges)
        for name, field in fields.items():
            if callable(field) and contact.law != "tied" and not is_polynomial(problem, edges, name, field, most):
                return False
    return True


def rest_on_arcs(discretization: Discretization, u: FloatArray) -> float:
    """Largest difference between σn of degrees of freedom u and their tractions at points of arcs [stress]."""
    mesh, space, largest = discretization.problem.mesh, discretization.space, 0.0
    coefficients = discretization.coefficients(u)
    for arcs in (edges.take(edges.bent) for edges in (mesh.boundary, mesh.interior) if edges.curved):
        points = EdgePoints(space, arcs, _POINTS)
        places = np.stack(mesh.points_along(arcs, points.reference), axis=-1).reshape(-1, 2)
        (nx, ny), (tx, ty) = points.normals.T, points.tangents.T
        normal, shear = points.tractions(u)
        for cells in arcs.cells.T:
            if (cells >= 0).all():  # beside the arcs, on one side of them
                cell = np.repeat(cells, _POINTS)
                xx, yy, xy = space.stress(coefficients, cell, mesh.reference(cell, places)[:, None])[:, 0].T
                x, y = xx * nx + xy * ny, xy * nx + yy * ny
                largest = max(largest, float(np.hypot(x * nx + y * ny - normal, x * tx + y * ty - shear).max()))
    return discretization.scales.stress * largest
