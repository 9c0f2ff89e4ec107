"""Tractions of a stress on edges, and what they do along prescribed displacements."""

import numpy as np

from qvi_contact.basics.checks import FloatArray, evaluate
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import LOAD_POINTS, physical, potential_at, prescribed_at_points
from qvi_contact.discretization.traces import EdgePoints
from qvi_contact.mesh.rectilinear import VERTICAL
from qvi_contact.problem.conditions import Contact, Displacement


def support_work(discretization: Discretization, nodal: FloatArray) -> float:
    """∫_{Γ_u} U·τn ds [stress × length²] of nodal values of Φ."""
    problem, grid, scales = discretization.problem, discretization.grid, discretization.scales
    work = 0.0
    for component, points, values in prescribed_at_points(problem, grid, scales, Displacement):
        work += scales.length * float(points.weights @ (values * traction(discretization, nodal, points)[component]))
    return work


def obstacle_work(discretization: Discretization, nodal: FloatArray) -> float:
    """∫_{Γ_μ} (g τ_N + w τ_T) ds [stress × length²] of nodal values of Φ, g and w as the problem prescribes them."""
    problem, scales = discretization.problem, discretization.scales
    work = 0.0
    for contact in problem.contacts:
        points = EdgePoints(discretization.grid, problem.mesh.edges(contact.edges), LOAD_POINTS)
        work += scales.length * float(points.weights @ _contact_work(discretization, nodal, contact, points))
    return work


def _contact_work(
    discretization: Discretization, nodal: FloatArray, contact: Contact, points: EdgePoints
) -> FloatArray:
    """G τ_N + w τ_T at points of a contact [stress × length]."""
    scales = discretization.scales
    x, y = physical(discretization.problem, scales, points.coordinates)
    normal, shear = normal_and_shear(discretization, nodal, points)
    gap, offset = evaluate("Contact.gap", contact.gap, x, y), evaluate("Contact.offset", contact.offset, x, y)
    return np.asarray(scales.stress * (gap * normal + offset * shear))


def normal_and_shear(
    discretization: Discretization, nodal: FloatArray, points: EdgePoints
) -> tuple[FloatArray, FloatArray]:
    """τ_N and τ_T at points of edges, dimensionless, of nodal values of Φ."""
    potential = potential_at(discretization.problem, discretization.scales, points.coordinates)
    return points.normal() @ nodal.ravel() + potential, points.shear() @ nodal.ravel()


def traction(discretization: Discretization, nodal: FloatArray, points: EdgePoints) -> FloatArray:
    """Traction τn at points of edges, shape (2, points) [stress]."""
    problem, scales = discretization.problem, discretization.scales
    stress = points.stress(nodal)
    stress[:, :2] += potential_at(problem, scales, points.coordinates)[:, None]
    vertical, (xx, yy, xy) = points.point_axis == VERTICAL, stress.T
    return np.asarray(scales.stress * points.point_sign * np.where(vertical, [xx, xy], [xy, yy]))
