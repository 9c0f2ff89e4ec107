"""Prescribed tractions, displacements, body forces and obstacles as links and load vectors, dimensionless."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, IntArray, evaluate
from qvi_contact.discretization.elimination import Links
from qvi_contact.discretization.scaling import Scales
from qvi_contact.discretization.traces import EdgePoints
from qvi_contact.element.bogner_fox_schmit import GAUSS_COUNT, Grid
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.mesh.rectilinear import HORIZONTAL, GridEdges
from qvi_contact.problem.conditions import Contact, Displacement, Traction
from qvi_contact.problem.problem import ContactProblem

LOAD_POINTS = 8
"""Gauss points an edge for data given as functions: exact up to degree 15."""


def potential_at(problem: ContactProblem, scales: Scales, points: FloatArray) -> FloatArray:
    """Body-force potential φ/S at dimensionless points, shape (..., 2) to (...)."""
    x, y = physical(problem, scales, points)
    return evaluate("ContactProblem.body_potential", problem.body_potential, x, y) / scales.stress


def physical(problem: ContactProblem, scales: Scales, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coordinates x, y [length] of dimensionless points (..., 2)."""
    mesh = problem.mesh
    return mesh.x[0] + scales.length * points[..., 0], mesh.y[0] + scales.length * points[..., 1]


def traction_links(problem: ContactProblem, grid: Grid, scales: Scales) -> Links:
    """What the prescribed tractions demand of the nodal values; see `elimination`.

    With m the sign of the outward normal and p = Φ'' along the edge (Φ_xx on horizontal, Φ_yy on vertical edges):

        normal component t:   p = m t − φ,   shear component t:   Φ_xy = −m t

    Resultants ∫p and moments ∫(h − s)p of each edge are taken by quadrature, so loads outside the trace space are
    projected without a change of resultant force or moment.
    """
    slopes, values, twists = [], [], []
    for component, index, field in problem.prescribed(Traction):
        edges = problem.mesh.boundary.take(index)
        normal = (edges.axis == HORIZONTAL) == (component == 1)
        slope_kind = 2 - component  # t_x acts on Φ_y (2), t_y on Φ_x (1)
        name = f"Traction.{'xy'[component]}"
        chosen = edges.take(normal)
        if len(chosen):
            force, moment, length = _normal_integrals(problem, grid, scales, chosen, name, field)
            slope = 4 * chosen.first + slope_kind
            slopes.append((slope, 4 * chosen.second + slope_kind, force))
            values.append((chosen.first, chosen.second, slope, length, moment))
        chosen = edges.take(~normal)
        if len(chosen):
            slopes.append(_shear_link(problem, grid, scales, chosen, name, field, slope_kind))
            twists += list(_shear_values(problem, scales, chosen, name, field))
    twists += list(_frictionless_twists(problem))
    return Links(*_stack(slopes, 2, 1), *_stack(values, 3, 2), *_stack(twists, 1, 1))


def _normal_integrals(
    problem: ContactProblem, grid: Grid, scales: Scales, edges: GridEdges, name: str, field: Field
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """∫p ds, ∫(h − s) p ds and h for each edge."""
    points = EdgePoints(grid, edges, LOAD_POINTS)
    stress = evaluate(name, field, *physical(problem, scales, points.coordinates)) / scales.stress
    curvature = stress * points.point_sign - potential_at(problem, scales, points.coordinates)
    weighted = (curvature * points.weights).reshape(len(edges), LOAD_POINTS)
    rest = 1.0 - gauss_legendre(LOAD_POINTS)[0]
    return weighted.sum(axis=1), points.lengths * (weighted @ rest), points.lengths


def _shear_link(
    problem: ContactProblem, grid: Grid, scales: Scales, edges: GridEdges, name: str, field: Field, slope_kind: int
) -> tuple[IntArray, IntArray, FloatArray]:
    points = EdgePoints(grid, edges, LOAD_POINTS)
    stress = evaluate(name, field, *physical(problem, scales, points.coordinates)) / scales.stress
    force = (stress * points.weights).reshape(len(edges), LOAD_POINTS).sum(axis=1)
    return 4 * edges.first + slope_kind, 4 * edges.second + slope_kind, -edges.sign * force


def _shear_values(
    problem: ContactProblem, scales: Scales, edges: GridEdges, name: str, field: Field
) -> Iterator[tuple[IntArray, FloatArray]]:
    """Prescribed Φ_xy at both ends of the edges."""
    for nodes in (edges.first, edges.second):
        x, y = problem.mesh.coordinates[nodes].T
        yield nodes, -edges.sign * evaluate(name, field, x, y) / scales.stress


def _frictionless_twists(problem: ContactProblem) -> Iterator[tuple[IntArray, FloatArray]]:
    """Φ_xy = 0 at nodes of contacts without friction that a prescribed shear reaches.

    Where that shear is not zero the two disagree, and the corner is treated as one between two prescribed shears.
    """
    for node, name in shear_beside_contacts(problem):
        contact = contact_named(problem, name)
        x, y = problem.mesh.coordinates[[node]].T
        friction = evaluate("Contact.friction", contact.friction, x, y, minimum=0.0)
        cohesion = evaluate("Contact.cohesion", contact.cohesion, x, y, minimum=0.0)
        limit = contact.shear_limit if contact.shear_limit is not None else np.inf
        capped = callable(limit) and evaluate("Contact.shear_limit", limit, x, y, minimum=0.0)[0] == 0.0
        if friction[0] == cohesion[0] == 0.0 or limit == 0.0 or capped:
            yield np.array([node]), np.zeros(1)


def contact_named(problem: ContactProblem, name: str) -> Contact:
    """The contact of that name."""
    return next(contact for contact in problem.contacts if contact.name == name)


def shear_beside_contacts(problem: ContactProblem) -> list[tuple[int, str]]:
    """Nodes where a prescribed shear other than zero meets a contact that limits shear, with the contact's name."""
    boundary, found = problem.mesh.boundary, []
    for contact in problem.contacts:
        if contact.law == "tied":
            continue
        edges = problem.mesh.edges(contact.edges)
        ends = np.unique(np.concatenate([edges.first, edges.second]))
        for component, index, field in problem.prescribed(Traction):
            shear = boundary.take(index)
            shear = shear.take((shear.axis == HORIZONTAL) == (component == 0))
            nodes = np.intersect1d(np.concatenate([shear.first, shear.second]), ends)
            values = evaluate(f"Traction.{'xy'[component]}", field, *problem.mesh.coordinates[nodes].T)
            found += [(int(node), contact.name) for node in nodes[values != 0.0]]
    return found


def _stack(rows: Sequence[tuple[Any, ...]], integers: int, floats: int) -> list[Any]:
    """Concatenate tuples of arrays, first integer then float ones, column by column; no tuples give empty arrays."""
    empty = (*[np.empty(0, dtype=np.int64)] * integers, *[np.empty(0)] * floats)
    return [np.concatenate(column) for column in zip(empty, *rows, strict=True)]


def prescribed_at_points(
    problem: ContactProblem, grid: Grid, scales: Scales, kind: type[Traction] | type[Displacement]
) -> Iterator[tuple[int, EdgePoints, FloatArray]]:
    """Prescribed data of one kind as (component, Gauss points, values there in physical units)."""
    for component, index, field in problem.prescribed(kind):
        points = EdgePoints(grid, problem.mesh.boundary.take(index), LOAD_POINTS)
        x, y = physical(problem, scales, points.coordinates)
        yield component, points, evaluate(f"{kind.__name__}.{'xy'[component]}", field, x, y)


def displacement_load(problem: ContactProblem, grid: Grid, scales: Scales) -> FloatArray:
    """∫_{Γ_u} U·τn ds as a vector over all degrees of freedom, the first term on the right of (D1)."""
    load = np.zeros(4 * problem.mesh.node_count)
    for component, points, values in prescribed_at_points(problem, grid, scales, Displacement):
        if values.any():
            load += points.traction(component).T @ (points.weights * values / scales.displacement)
    return load


def body_load(problem: ContactProblem, grid: Grid, scales: Scales) -> FloatArray:
    """−∫ c φI : τ dx, what the particular stress φI of the body force contributes to the load vector."""
    load = np.zeros(4 * problem.mesh.node_count)
    if not callable(problem.body_potential) and problem.body_potential == 0.0:
        return load
    row, column = np.nonzero(problem.mesh.active)
    points, weights, (tx, ty) = cell_points(grid, column, row)
    strain = problem.compliances[:, :, :2].sum(axis=2) / scales.compliance
    factor = -weights * potential_at(problem, scales, points)
    rows = grid.stress_rows(column[:, None], row[:, None], tx, ty)
    np.add.at(load, grid.cell_dofs(column, row), np.einsum("cg,ck,cgkd->cd", factor, strain, rows))
    return load


def cell_points(
    grid: Grid, column: IntArray, row: IntArray, count: int = GAUSS_COUNT
) -> tuple[FloatArray, FloatArray, tuple[FloatArray, FloatArray]]:
    """Gauss points of cells: dimensionless coordinates (n, g, 2), weights (n, g), reference coordinates (n, g) each."""
    t, w = gauss_legendre(count)
    tx, ty = np.tile(t, count), np.repeat(t, count)
    size_x, size_y = grid.x.sizes[column][:, None], grid.y.sizes[row][:, None]
    x = grid.x.lines[column][:, None] + size_x * tx
    y = grid.y.lines[row][:, None] + size_y * ty
    weights = size_x * size_y * (np.tile(w, count) * np.repeat(w, count))
    shape = x.shape
    return np.stack([x, y], axis=-1), weights, (np.broadcast_to(tx, shape), np.broadcast_to(ty, shape))
