"""What the contacts put into (D2): points, laws and prescribed displacements, dimensionless."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, evaluate
from qvi_contact.discretization.loads import physical
from qvi_contact.discretization.scaling import Scales
from qvi_contact.discretization.traces import EdgePoints
from qvi_contact.element.bogner_fox_schmit import GAUSS_COUNT, Grid
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.problem.conditions import Contact, Law
from qvi_contact.problem.problem import ContactProblem


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
        Its rows in `FrictionQVI.N` and `FrictionQVI.T`, four Gauss points an edge; none for a tied contact, which
        limits no traction.
    points : EdgePoints
        The points in dimensionless coordinates.
    friction : (m,) array
        μ at the points.
    cohesion, shear_limit : (m,) arrays
        c and t_max at the points, dimensionless; infinity where there is no limit.
    gap, offset : (m,) arrays
        Obstacle position g and tangential offset w at the points, dimensionless.

    """

    name: str
    law: Law
    joint: bool
    rows: slice
    points: EdgePoints
    friction: FloatArray
    cohesion: FloatArray
    shear_limit: FloatArray
    gap: FloatArray
    offset: FloatArray

    @property
    def edges(self) -> slice:
        """Its edges among those of `FrictionQVI.edges`; none for a tied contact."""
        return slice(self.rows.start // self.points.count, self.rows.stop // self.points.count)

    @property
    def bilateral(self) -> BoolArray:
        """Whether σ_N may have either sign, at each point."""
        return np.full(len(self.gap), self.law != "unilateral")

    def bound(self, normal: FloatArray) -> FloatArray:
        """Bound min(c + μ|σ_N|, t_max) of |σ_T| for a normal traction, dimensionless; infinity if tied."""
        if self.law == "tied":
            return np.full(len(self.gap), np.inf)
        return np.minimum(self.cohesion + self.friction * np.abs(normal), self.shear_limit)

    def work(self) -> FloatArray:
        """∫ g τ_N + w τ_T ds as a vector over all degrees of freedom, the last term of (D1)."""
        weights = self.points.weights
        return np.asarray(
            self.points.normal().T @ (weights * self.gap) + self.points.shear().T @ (weights * self.offset)
        )

    def with_offset(self, offset: FloatArray) -> "ContactRows":
        """The same contact at another tangential offset (m,), dimensionless."""
        return replace(self, offset=offset)


def contact_rows(problem: ContactProblem, grid: Grid, scales: Scales) -> tuple[ContactRows, ...]:
    """All contacts in the order of the problem; `InputError` where a field gives bad values."""
    found, start = [], 0
    for contact in problem.contacts:
        points = EdgePoints(grid, problem.mesh.edges(contact.edges), GAUSS_COUNT)
        stop = start if contact.law == "tied" else start + len(points.weights)
        found.append(_rows(problem, scales, contact, points, slice(start, stop)))
        start = stop
    return tuple(found)


def _rows(problem: ContactProblem, scales: Scales, contact: Contact, points: EdgePoints, rows: slice) -> ContactRows:
    x, y = physical(problem, scales, points.coordinates)
    limit = np.full(len(x), np.inf)
    if contact.shear_limit is not None:
        limit = evaluate("Contact.shear_limit", contact.shear_limit, x, y, minimum=0.0) / scales.stress
    return ContactRows(
        contact.name,
        contact.law,
        contact in problem.joints,
        rows,
        points,
        evaluate("Contact.friction", contact.friction, x, y, minimum=0.0),
        evaluate("Contact.cohesion", contact.cohesion, x, y, minimum=0.0) / scales.stress,
        limit,
        evaluate("Contact.gap", contact.gap, x, y) / scales.displacement,
        evaluate("Contact.offset", contact.offset, x, y) / scales.displacement,
    )


def trace_rows(contacts: Sequence[ContactRows], grid: Grid) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Tractions at the contact points from the parameters of their traces: (Y, E) with [N; T] = E Y.

    Parameters are σ_N at the outer two Gauss points of each edge, since it is linear there, and σ_xy at nodes and σ_T
    at midpoints, since σ_T is quadratic on an edge and continuous; Y (r, all degrees of freedom), E (2m, r).
    """
    points = [rows.points for rows in contacts]
    if not points:
        return sparse.csr_array((0, 4 * grid.dof_scales.shape[0] * grid.dof_scales.shape[1])), sparse.csr_array((0, 0))
    t = gauss_legendre(GAUSS_COUNT)[0]
    first, last = t[0], t[-1]
    linear = np.column_stack([last - t, t - first]) / (last - first)
    quadratic = np.column_stack([(1 - t) * (1 - 2 * t), t * (2 * t - 1), 4 * t * (1 - t)])
    edges = int(sum(len(part.edges) for part in points))
    ends = np.concatenate([np.column_stack([part.edges.first, part.edges.second]) for part in points])
    signs = np.concatenate([part.edges.sign for part in points])
    nodes, local = np.unique(ends, return_inverse=True)
    local = local.reshape(ends.shape)
    total = 4 * grid.dof_scales.shape[0] * grid.dof_scales.shape[1]
    twist = -1.0 / grid.dof_scales.reshape(-1, 4)[nodes, 3]
    at_nodes = sparse.csr_array((twist, (np.arange(len(nodes)), 4 * nodes + 3)), shape=(len(nodes), total))
    at_midpoints = [EdgePoints(grid, part.edges, 1).shear() for part in points]
    outer = [part.normal()[_outer(len(part.edges))] for part in points]
    Y = stacked([*outer, at_nodes, *at_midpoints], total)

    number = np.arange(edges)
    first_T = 2 * edges + len(nodes)
    columns_T = np.column_stack([2 * edges + local, first_T + number])
    shapes_T = quadratic[None] * np.column_stack([signs, signs, np.ones(edges)])[:, None, :]
    shape = (edges * GAUSS_COUNT, Y.shape[0])
    E_N = _interpolation(
        np.column_stack([2 * number, 2 * number + 1]), np.broadcast_to(linear, (edges, *linear.shape)), shape
    )
    return Y, stacked([E_N, _interpolation(columns_T, shapes_T, shape)], Y.shape[0])


def _outer(edges: int) -> IntArray:
    """Numbers of the first and last Gauss points of each edge."""
    return np.asarray(np.add.outer(GAUSS_COUNT * np.arange(edges), [0, GAUSS_COUNT - 1])).ravel()


def _interpolation(columns: IntArray, shapes: FloatArray, shape: tuple[int, int]) -> sparse.csr_array:
    """Rows edge by edge: shapes (edges, points, j) at columns (edges, j)."""
    points = shapes.shape[1]
    rows = np.repeat(np.arange(len(columns) * points), columns.shape[1])
    return sparse.csr_array((shapes.ravel(), (rows, np.repeat(columns, points, axis=0).ravel())), shape=shape)


def stacked(rows: Sequence[sparse.csr_array], columns: int) -> sparse.csr_array:
    """Matrices on top of each other, also if there are none."""
    return sparse.csr_array(sparse.vstack(rows)) if rows else sparse.csr_array((0, columns))


def joined(arrays: Sequence[NDArray[Any]]) -> FloatArray:
    """Vectors one after the other, also if there are none."""
    return np.concatenate([np.empty(0), *arrays])
