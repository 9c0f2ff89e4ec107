"""How far the stresses of a model leave bodies out of balance: resultants of the tractions all around each of them."""

from collections.abc import Callable, Iterator

import numpy as np

from qvi_contact import ContactProblem, ContactResult
from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.companion import CompanionResult
from qvi_contact.discretization.edge_points import EdgePoints
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.mechanism.bodies import Bodies
from qvi_contact.mesh.edges import Edges
from qvi_contact.solution.work import traction

_Forces = Callable[[Edges, int], tuple[FloatArray, FloatArray]]

_POINTS = 12  # of Gauss an edge: exact for tractions of triangles, far more than displacements need


def of_stresses(result: ContactResult) -> float:
    """The largest resultant force or moment on a body over the sum of the forces on its edges; without body forces."""
    discretization, length = result.discretization, result.discretization.scales.length

    def forces(edges: Edges, side: int) -> tuple[FloatArray, FloatArray]:
        points = EdgePoints(discretization.space, edges, _POINTS)
        place = np.stack(result.problem.mesh.points_along(edges, points.reference), axis=-1)
        sign = -length if side else length
        force = sign * (points.weights * traction(discretization, result.dofs, points)).T
        return place, force.reshape(place.shape)

    return _imbalance(result.problem, forces)


def of_displacements(companion: CompanionResult) -> float:
    """The same of the stresses C ε(v) of displacements on a mesh of triangles, taken inside each body."""
    problem = companion.problem
    mesh, (t, weights) = problem.mesh, gauss_legendre(_POINTS)
    lines = np.stack([[1.0 - t, t], [0.0 * t, t], [t, 0.0 * t]])  # opposite to the first, second and third corner
    stresses = np.stack([companion.cell_stress(*line) for line in lines])
    places = np.stack([companion.cell_points(*line) for line in lines])

    def forces(edges: Edges, side: int) -> tuple[FloatArray, FloatArray]:
        cells = edges.cells[:, side]
        opposite = _opposite(mesh.cells[cells], edges)
        place, (xx, yy, xy) = places[opposite, cells], np.moveaxis(stresses[opposite, cells], -1, 0)
        x, y = np.moveaxis(_normals(place, edges, t) * (-1.0 if side else 1.0) * weights[:, None], -1, 0)
        return place, np.stack([xx * x + xy * y, xy * x + yy * y], axis=-1)

    return _imbalance(problem, forces)


def _normals(place: FloatArray, edges: Edges, t: FloatArray) -> FloatArray:
    """Normals n ds/dt (n, q, 2) of lines through points (n, q, 2) at t (q,), on the side of the edges' own normals."""
    legendre = np.polynomial.legendre
    derivative = legendre.legvander(t, len(t) - 2) @ legendre.legder(np.linalg.inv(legendre.legvander(t, len(t) - 1)))
    along = np.einsum("pq,nqd->npd", derivative, place)
    normal = np.stack([along[..., 1], -along[..., 0]], axis=-1)
    return np.asarray(normal * np.sign((normal * edges.normal[:, None]).sum(axis=-1, keepdims=True)))


def _opposite(cells: IntArray, edges: Edges) -> IntArray:
    """The corner (n,) of each triangle that is not on the edge."""
    on_edge = (cells == edges.first[:, None]) | (cells == edges.second[:, None])
    return np.asarray(np.argmin(on_edge, axis=1))


def _imbalance(problem: ContactProblem, forces: _Forces) -> float:
    """The largest of all bodies, from points (n, q, 2) of n edges and the forces there on the first or second side."""
    bodies, largest = Bodies.of(problem), 0.0
    sides = list(_around(problem, bodies))
    for body in range(bodies.blocks):
        total, size = np.zeros(3), 0.0
        for edges, side in sides:
            own = edges.take(bodies.of_cells[edges.cells[:, side]] == body)
            if not len(own):
                continue
            place, force = forces(own, side)
            arm = place - bodies.centre[body]
            moment = (arm[..., 0] * force[..., 1] - arm[..., 1] * force[..., 0]).sum() / bodies.size[body]
            total += [*force.sum(axis=(0, 1)), moment]
            size += float(np.hypot(*force.sum(axis=1).T).sum())
        largest = max(largest, float(np.abs(total).max()) / size if size else 0.0)
    return largest


def _around(problem: ContactProblem, bodies: Bodies) -> Iterator[tuple[Edges, int]]:
    """Edges that bound bodies, and on which side of them: 0 where normals point out of the body."""
    mesh = problem.mesh
    first, second = bodies.of_cells[mesh.interior.cells].T
    between = mesh.interior.take(first != second)
    yield from ((mesh.boundary, 0), (between, 0), (between, 1))
