"""What a stress and its own tractions differ by along arcs.

On an arc tractions are the polynomials whose coefficients are degrees of freedom: they have the resultants of the
stress, and its moments up to their degree. Between the two is a rest of the order of the element. Equilibrium holds up
to its work.
"""

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import EdgePoints
from qvi_contact.mesh.edges import Edges

_POINTS = 12


def rest_on_arcs(discretization: Discretization, u: FloatArray) -> float:
    """Largest difference between σn of degrees of freedom u and their tractions at points of arcs [stress]."""
    mesh, largest = discretization.problem.mesh, 0.0
    coefficients = discretization.energy.coefficients(u)
    for edges in (mesh.boundary, mesh.interior):
        if edges.curved:
            arcs = edges.take(edges.bent)
            for cells in arcs.cells.T:
                if (cells >= 0).all():
                    largest = max(largest, _difference(discretization, coefficients, u, arcs, cells))
    return discretization.scales.stress * largest


def _difference(
    discretization: Discretization, coefficients: FloatArray, u: FloatArray, arcs: Edges, cells: IntArray
) -> float:
    """The largest difference in the cells (n,) beside the arcs, dimensionless."""
    mesh, points = discretization.problem.mesh, EdgePoints(discretization.space, arcs, _POINTS)
    cell = np.repeat(cells, _POINTS)
    places = np.stack(mesh.points_along(arcs, points.reference), axis=-1).reshape(-1, 2)
    t = mesh.reference(cell, places)[:, None]
    xx, yy, xy = discretization.space.stress(coefficients, cell, t)[:, 0].T
    (nx, ny), (tx, ty) = points.normals.T, points.tangents.T
    x, y = xx * nx + xy * ny, xy * nx + yy * ny
    normal, shear = points.tractions(u)
    return float(np.hypot(x * nx + y * ny - normal, x * tx + y * ty - shear).max())
