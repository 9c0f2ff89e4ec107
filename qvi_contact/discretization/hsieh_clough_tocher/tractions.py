"""Prescribed tractions on edges of triangles as conditions on Φ, in an order that keeps their solution sparse.

On an edge of length h from a to b with tangent t and m = (−t_y, t_x), coefficients of Legendre N_k of Φ_tt and Q_k of
Φ_tm mean

    ∇Φ_b − ∇Φ_a = h (N₀ t + Q₀ m),   Φ_b − Φ_a − h t·(∇Φ_a + ∇Φ_b)/2 = −h² N₁/6

for the corners, resultant force and moment of the edge, and prescribe its other coefficients themselves. Where only
one component d·σn is given, σ_N = Φ_tt and σ_T = −(n·m) Φ_tm are combined. Since σ_T may jump at vertices, corners
where two edges meet need no care.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.discretization.basis import PrescribedTraction
from qvi_contact.discretization.constraints import Rows, solve_conditions
from qvi_contact.discretization.elimination import Elimination, UnbalancedLoadError
from qvi_contact.discretization.hsieh_clough_tocher.functionals import EdgeFunctionals
from qvi_contact.discretization.hsieh_clough_tocher.space import TriangleSpace, frame
from qvi_contact.mesh.edges import Edges

_POINTS: Final = 8  # Gauss points of edges and their parts for data given as functions, at least
_PARALLEL: Final = 1e-12  # component of a unit vector that counts as none
_ALIKE: Final = 1.5  # ratio of cells' sizes at vertices that counts as none when the gauge is placed
_BALANCED: Final = 1e-9  # imbalance of a closed part of the boundary, relative to the loads, that passes as round-off


@dataclass(frozen=True, eq=False)
class EdgeTractions:
    """Coefficients of Legendre of components of the traction on edges; an edge may be there once or twice.

    Attributes
    ----------
    number : (n,) int array
        Edges as `mesh.topology` counts them.
    edges : Edges
        The edges.
    direction : (n, 2) array
        Unit vector d.
    coefficients : (n, p − 1) array
        Those of d·σn without φ, along the tangent.

    """

    number: IntArray
    edges: Edges
    direction: FloatArray
    coefficients: FloatArray

    def take(self, index: IntArray) -> "EdgeTractions":
        """Some of them."""
        return EdgeTractions(
            self.number[index], self.edges.take(index), self.direction[index], self.coefficients[index]
        )


@dataclass(frozen=True, eq=False)
class Conditions:
    """Rows C u = d.

    Attributes
    ----------
    C, d : Rows of (r, N), (r,) array
        The rows, scaled so that d are forces, moments and degrees of freedom, dimensionless.
    is_load : (r,) bool array
        Rows whose d is a force or moment.
    number : (r,) int array
        The edge that each belongs to.

    """

    C: Rows
    d: FloatArray
    is_load: BoolArray
    number: IntArray


def eliminate_tractions(space: TriangleSpace, given: Sequence[PrescribedTraction]) -> Elimination:
    """Solve the prescribed tractions and the gauge, which is zero at the first centre, where cells are smallest.

    Rows are taken along lines, part by part of one centre and beginning at it or where cells are small, so that degrees
    of freedom there do not follow from large ones far away; edges across parts come last and tie the centres, and edges
    across the cut of a hole, whose jump nothing but these determines.

    Raises
    ------
    UnbalancedLoadError
        If the tractions on a closed part of the boundary are out of balance.

    """
    tractions = _projected(space, given)
    numbers, first = np.unique(tractions.number, return_index=True)
    lines = space.mesh.topology.ends[numbers]
    gauge = _gauge(space, lines)
    last = space.frames.across(lines) | space.cuts.across(tractions.edges.take(first))
    place, age = _walked(space, lines, last, gauge)
    rows = _conditions(space, tractions)
    order = np.argsort(place[np.searchsorted(numbers, rows.number)], kind="stable")
    on_edges = np.repeat(age[space.mesh.topology.ends].max(axis=1), space.element.on_edge)
    C, d = _with_gauge(rows.C.take(order), gauge), np.concatenate([np.zeros(3), rows.d[order]])
    of_holes = np.zeros(3 * len(space.cuts), dtype=np.int64)
    found, misfit = solve_conditions(C, d, np.concatenate([np.repeat(age, 3), on_edges, of_holes]))
    imbalance = float(np.abs(misfit).max(initial=0.0))
    if imbalance > _BALANCED * float(np.abs(rows.d[rows.is_load]).max(initial=0.0)):
        raise UnbalancedLoadError(imbalance)
    return found


def _with_gauge(rows: Rows, vertex: int) -> Rows:
    """Φ, Φ_x and Φ_y of the vertex on top of the rows."""
    width = rows.columns.shape[1]
    return Rows(
        np.concatenate([np.broadcast_to(3 * vertex + np.arange(width), (3, width)), rows.columns]),
        np.concatenate([np.eye(3, width), rows.values]),
    )


def _projected(space: TriangleSpace, given: Sequence[PrescribedTraction]) -> EdgeTractions:
    """All prescribed components in the mean square of each edge, which keeps resultant force and moment."""
    degree = space.degree - 2
    none = np.empty(0, dtype=np.int64)
    parts = [EdgeTractions(none, space.mesh.boundary.take(none), np.empty((0, 2)), np.empty((0, degree + 1)))]
    for part in given:
        found = part.quadrature(space.mesh.vertices, max(_POINTS, degree + 3))
        parts.append(EdgeTractions(space.number(part.edges), part.edges, part.direction, found.coefficients(degree)))
    edges = [np.concatenate([getattr(part.edges, name) for part in parts]) for name in Edges.__annotations__]
    number, direction, coefficients = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("number", "direction", "coefficients")
    )
    return EdgeTractions(number, Edges(*edges), direction, coefficients)


def _conditions(space: TriangleSpace, tractions: EdgeTractions) -> Conditions:
    """Both components of edges that have two, one of those that have one."""
    order = np.argsort(tractions.number, kind="stable")
    twice = np.flatnonzero(tractions.number[order][1:] == tractions.number[order][:-1])
    one, other = order[twice], order[twice + 1]
    directions = np.stack([tractions.direction[one], tractions.direction[other]], axis=1)
    values = np.stack([tractions.coefficients[one], tractions.coefficients[other]], axis=1)
    single = np.setdiff1d(order, np.concatenate([one, other]))
    parts = (
        _of_vectors(space, tractions.take(one), np.asarray(np.linalg.solve(directions, values))),
        _of_components(space, tractions.take(single)),
    )
    d, is_load, number = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("d", "is_load", "number")
    )
    columns, values = (np.concatenate([getattr(part.C, name) for part in parts]) for name in ("columns", "values"))
    return Conditions(Rows(columns, values), d, is_load, number)


def _of_vectors(space: TriangleSpace, tractions: EdgeTractions, vectors: FloatArray) -> Conditions:
    """Whole traction vectors of Cartesian coefficients (n, 2, p − 1): 2p − 2 rows an edge."""
    edges, h = tractions.edges, space.lengths(tractions.edges)[:, None]
    m, factor = frame(edges)
    N = (edges.normal[:, :, None] * vectors).sum(axis=1)
    Q = factor[:, None] * (edges.tangent[:, :, None] * vectors).sum(axis=1)
    forces = h * (N[:, :1] * edges.tangent + Q[:, :1] * m)
    d = np.hstack([forces, -(h**2) * N[:, 1:2] / 6.0, N[:, 2:], Q[:, 1:]])
    rows = d.shape[1]
    is_load = np.tile(np.arange(rows) < 3, len(edges))
    return Conditions(space.resultants(edges).rows(), d.ravel(), is_load, np.repeat(tractions.number, rows))


def _of_components(space: TriangleSpace, tractions: EdgeTractions) -> Conditions:
    """One component d·σn = (d·n) σ_N + (d·t) σ_T, coefficient by coefficient: p − 1 rows an edge."""
    edges, rows = tractions.edges, space.degree - 1
    h = space.lengths(edges)
    scale = np.column_stack([h, h**2 / 6.0, *[np.ones_like(h)] * (rows - 2)])
    parts = [(tractions.direction * axis).sum(axis=1) for axis in (edges.normal, edges.tangent)]
    n, t = (np.where(np.abs(part) <= _PARALLEL, 0.0, part)[:, None] * scale for part in parts)
    normal, shear = space.normal(edges), space.shear(edges)
    combined = n[:, :, None] * normal.values + t[:, :, None] * shear.values
    C = EdgeFunctionals(normal.columns, combined, space.size).rows()
    is_load = np.tile(np.arange(rows) < 2, len(edges))
    return Conditions(C, (tractions.coefficients * scale).ravel(), is_load, np.repeat(tractions.number, rows))


def _walked(space: TriangleSpace, lines: IntArray, last: BoolArray, gauge: int) -> tuple[IntArray, IntArray]:
    """`walk` along the lines (n, 2), the last ones at the end; centres are solved for where nothing else is left."""
    frames, seeds = space.frames, [gauge]
    if frames.several:
        small = np.argsort(np.round(np.log2(space.sizes)), kind="stable")
        seeds = [*frames.centres.tolist(), *small[np.isin(small, lines)].tolist()]
    inside, age = walk(lines[~last], seeds, len(space.vertices))
    place = np.full(len(lines), len(lines))
    place[~last] = inside
    if frames.several:
        age[frames.centres] = 0
    return place, age


def _gauge(space: TriangleSpace, lines: IntArray) -> int:
    """The first of several centres; else the vertex with the smallest cells.

    Of several vertices it is one on the lines (n, 2), and of those the one of lowest number.
    """
    if space.frames.several:
        return int(space.frames.centres[0])
    small = space.sizes <= _ALIKE * space.sizes.min()
    on_lines = np.zeros_like(small)
    on_lines[lines] = True
    return int(np.argmax(small & on_lines if (small & on_lines).any() else small))


def walk(ends: IntArray, start: int | Sequence[int], vertices: int) -> tuple[IntArray, IntArray]:
    """An order of edges in which each one, if it can, meets those before it in one vertex.

    Parameters
    ----------
    ends : (n, 2) int array
        Vertices of the edges.
    start : int, or sequence of int
        The vertices to begin at. Lines that hold none of them begin at their end of lowest number, closed ones at their
        vertex of lowest number.
    vertices : int
        Number of vertices.

    Returns
    -------
    place : (n,) int array
        Place of each edge in the order, from 0.
    age : (vertices,) int array
        The later a vertex is met the larger, from 1; 0 where none is met.

    """
    at: dict[int, list[int]] = {}
    pairs = ends.tolist()
    for edge, pair in enumerate(pairs):
        for vertex in pair:
            at.setdefault(vertex, []).append(edge)
    place, age = np.full(len(ends), -1), np.zeros(vertices, dtype=np.int64)
    step, met = 0, 0
    line_ends = sorted(vertex for vertex, edges in at.items() if len(edges) == 1)
    for seed in (*([start] if isinstance(start, int) else start), *line_ends, *sorted(at)):
        waiting = [seed] if seed in at and not age[seed] else []
        while waiting:
            vertex = waiting.pop()
            if not age[vertex]:
                met += 1
                age[vertex] = met
            ahead = next((edge for edge in at[vertex] if place[edge] < 0), None)
            if ahead is not None:
                place[ahead] = step
                step += 1
                waiting += [vertex, sum(pairs[ahead]) - vertex]  # to the end of the line first
    return place, age
