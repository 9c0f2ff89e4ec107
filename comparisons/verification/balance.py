"""How far the stresses of a model leave bodies out of balance: tractions all around each of them, and its own weight.

A body force −∇φ has the resultant −∮ φ n ds, and its moment likewise: both are integrals over the same edges.
"""

from collections.abc import Callable, Iterator

import numpy as np

from qvi_contact import ContactProblem, ContactResult
from qvi_contact.basics.checks import FloatArray, IntArray, evaluate
from qvi_contact.companion import CompanionResult
from qvi_contact.discretization.loads import EdgePoints
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.mechanism.bodies import Bodies
from qvi_contact.mesh.edges import Edges
from qvi_contact.solution.work import traction

_Forces = Callable[[Edges, int], tuple[FloatArray, FloatArray, FloatArray]]
"""Edges, and on which side of them a body is → points (n, q, 2), σn ds there, and n ds out of the body."""

_POINTS = 12  # of Gauss an edge: exact for tractions of triangles, far more than displacements need


def of_stresses(result: ContactResult) -> float:
    """The largest resultant force or moment on a body over the sum of the forces on its edges."""
    discretization, length = result.discretization, result.discretization.scales.length

    def forces(edges: Edges, side: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        points = EdgePoints(discretization.space, edges, _POINTS)
        place = np.stack(result.problem.mesh.points_along(edges, points.reference), axis=-1)
        weights = (-length if side else length) * points.weights[:, None]
        force, normal = weights * traction(discretization, result.dofs, points).T, weights * points.normals
        return place, force.reshape(place.shape), normal.reshape(place.shape)

    return _imbalance(result.problem, forces)


def of_displacements(companion: CompanionResult) -> float:
    """The same of the stresses C ε(v) of displacements on a mesh of triangles, taken inside each body."""
    problem = companion.problem
    mesh, (t, weights) = problem.mesh, gauss_legendre(_POINTS)
    lines = np.stack([[1.0 - t, t], [0.0 * t, t], [t, 0.0 * t]])  # opposite to the first, second and third corner
    stresses = np.stack([companion.cell_stress(*line) for line in lines])
    places = np.stack([companion.cell_points(*line) for line in lines])

    def forces(edges: Edges, side: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        cells = edges.cells[:, side]
        opposite = _opposite(mesh.cells[cells], edges)
        place, (xx, yy, xy) = places[opposite, cells], np.moveaxis(stresses[opposite, cells], -1, 0)
        normal = _normals(place, edges, t) * (-1.0 if side else 1.0) * weights[:, None]
        x, y = np.moveaxis(normal, -1, 0)
        return place, np.stack([xx * x + xy * y, xy * x + yy * y], axis=-1), normal

    return _imbalance(problem, forces)


def _normals(place: FloatArray, edges: Edges, t: FloatArray) -> FloatArray:
    """Normals n ds/dt (n, q, 2) of lines through points (n, q, 2) at t (q,), on the side of the edges' own normals."""
    legendre, s = np.polynomial.legendre, 2.0 * t - 1.0  # well-conditioned on [−1, 1] only
    derivative = legendre.legvander(s, len(s) - 2) @ legendre.legder(np.linalg.inv(legendre.legvander(s, len(s) - 1)))
    along = 2.0 * np.einsum("pq,nqd->npd", derivative, place)
    normal = np.stack([along[..., 1], -along[..., 0]], axis=-1)
    return np.asarray(normal * np.sign((normal * edges.normal[:, None]).sum(axis=-1, keepdims=True)))


def _opposite(cells: IntArray, edges: Edges) -> IntArray:
    """The corner (n,) of each triangle that is not on the edge."""
    on_edge = (cells == edges.first[:, None]) | (cells == edges.second[:, None])
    return np.asarray(np.argmin(on_edge, axis=1))


def _imbalance(problem: ContactProblem, forces: _Forces) -> float:
    """The largest of all bodies, from the forces on the first or second side of edges."""
    bodies, largest = Bodies.of(problem), 0.0
    sides = [(bodies.of_cells[edges.cells[:, side]], *forces(edges, side)) for edges, side in _around(problem, bodies)]
    for body in range(bodies.blocks):
        total, size = np.zeros(3), 0.0
        for owner, *values in sides:
            place, force, normal = (value[owner == body] for value in values)
            arm = (place - bodies.centre[body]) / bodies.size[body]
            total += _resultant(arm, force - _potential(problem, place)[..., None] * normal)
            size += float(np.hypot(*force.sum(axis=1).T).sum())
        largest = max(largest, float(np.abs(total).max()) / size if size else 0.0)
    return largest


def _potential(problem: ContactProblem, place: FloatArray) -> FloatArray:
    """φ at points (n, q, 2) [stress]."""
    field = problem.body_potential
    return evaluate("ContactProblem.body_potential", field, *np.moveaxis(place, -1, 0))


def _resultant(arm: FloatArray, force: FloatArray) -> FloatArray:
    """Sums (3,) of forces (n, q, 2), and of their moments over the length that arms are in."""
    moment = (arm[..., 0] * force[..., 1] - arm[..., 1] * force[..., 0]).sum()
    return np.array([*force.sum(axis=(0, 1)), moment])


def _around(problem: ContactProblem, bodies: Bodies) -> Iterator[tuple[Edges, int]]:
    """Edges that bound bodies, and on which side of them: 0 where normals point out of the body."""
    mesh = problem.mesh
    first, second = bodies.of_cells[mesh.interior.cells].T
    between = mesh.interior.take(first != second)
    yield from ((mesh.boundary, 0), (between, 0), (between, 1))
