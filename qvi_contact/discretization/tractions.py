"""Prescribed tractions on edges of triangles as conditions on Φ, in an order that keeps their solution sparse.

On an edge of length h from a to b with tangent t and m = (−t_y, t_x), coefficients of Legendre N_k of Φ_tt and Q_k of
Φ_tm mean

    ∇Φ_b − ∇Φ_a = h (N₀ t + Q₀ m),   Φ_b − Φ_a − h t·(∇Φ_a + ∇Φ_b)/2 = −h² N₁/6

for the corners, resultant force and moment of the edge, and prescribe its other coefficients themselves. Where only
one component d·σn is given, σ_N = Φ_tt and σ_T = −(n·m) Φ_tm are combined. Since σ_T may jump at vertices, corners
where two edges meet need no care.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.discretization.curved import resultant_shapes
from qvi_contact.discretization.elimination import (
    EdgeFunctionals,
    Elimination,
    Rows,
    UnbalancedLoadError,
    solve_conditions,
)
from qvi_contact.discretization.space import StressSpace, frame
from qvi_contact.element import legendre
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.element.quadrature import EdgeQuadrature, adapted, constant
from qvi_contact.mesh.edges import Edges, frames_along, points_along, rounding_along, vectors_along

_POINTS: Final = 8  # Gauss points of edges and their parts for data given as functions, at least
_PARALLEL: Final = 1e-12  # component of a unit vector that counts as none
_ALIKE: Final = 1.5  # ratio of cells' sizes at vertices that counts as none when the gauge is placed
_BALANCED: Final = 1e-9  # imbalance of a closed part of the boundary, relative to the loads, that passes as round-off


@dataclass(frozen=True, eq=False)
class PrescribedTraction:
    """One component of the traction, prescribed on edges: d·σn = value.

    Attributes
    ----------
    name : str
        What messages call it, such as "Traction.x".
    edges : Edges
        n edges of the boundary.
    direction : (n, 2) array
        Unit vector d on each edge: a Cartesian one, or ± the edge's normal or tangent.
    turns : bool
        Whether d turns along arcs, as normals and tangents do.
    value : function of (x, y)
        The component [dimensionless] at points x, y [length], arrays of one shape; φ is part of it. Where d·n ≠ 0 the
        part of it that Φ makes up is value − φ d·n.
    potential : function of (x, y), or None
        φ [dimensionless] at points [length]; None where there is none.
    constant : float or None
        What Φ makes up of it, if that is known to be one number [dimensionless]; then `value` is that number.

    """

    name: str
    edges: Edges
    direction: FloatArray
    value: Callable[[FloatArray, FloatArray], FloatArray]
    potential: Callable[[FloatArray, FloatArray], FloatArray] | None = None
    turns: bool = False
    constant: float | None = None

    def take(self, index: IntArray | BoolArray) -> "PrescribedTraction":
        """The same on some of the edges."""
        return replace(self, edges=self.edges.take(index), direction=self.direction[index])

    def quadrature(self, vertices: FloatArray, points: int) -> EdgeQuadrature:
        """The part that Φ makes up, at Gauss points of parts of the edges; vertices (v, 2) [length]."""
        if self.constant is not None:
            return constant(self.constant, len(self.edges), points)

        def own(edge: IntArray, t: FloatArray) -> FloatArray:
            x, y = np.moveaxis(points_along(vertices, self.edges.take(edge), t), -1, 0)
            values = np.asarray(self.value(x, y))
            if self.potential is None:
                return values
            return np.asarray(values - self.potential(x, y) * self._outward(edge, t))

        return adapted(own, len(self.edges), points, rounding_along(vertices, self.edges))

    def _outward(self, edge: IntArray, t: FloatArray) -> FloatArray:
        """d·n (k, q) at reference points t (k, q) of edges (k,)."""
        if self.turns or not self.edges.curved:
            return np.asarray((self.direction * self.edges.normal).sum(axis=1)[edge, None])
        chosen = self.edges.take(edge)
        return np.asarray((self.direction[edge, None] * vectors_along(chosen, chosen.normal, t)).sum(axis=2))


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


def eliminate_tractions(space: StressSpace, given: Sequence[PrescribedTraction]) -> Elimination:
    """All degrees of freedom that meet the prescribed tractions, u = B z + u₀, with one affine function fixed.

    Data in the trace space are met exactly; of others each edge keeps the resultant force and moment. Stresses do not
    feel an affine function (the gauge), which is zero at the first centre, where cells are smallest.

    Rows are taken along lines, part by part of one centre and beginning at it or where cells are small, so that degrees
    of freedom there do not follow from large ones far away; edges across parts come last and tie the centres, and edges
    across the cut of a hole, whose jump nothing but these determines.

    Raises
    ------
    UnbalancedLoadError
        If the tractions on a closed part of the boundary are out of balance.

    """
    rows = _joined([_conditions(space, _projected(space, _on(given, arcs=False))), *_on_arcs(space, given)])
    numbers = np.unique(rows.number)
    lines = space.mesh.topology.ends[numbers]
    gauge = _gauge(space, lines)
    last = space.frames.across(lines) | space.cuts.across(_edges_of(space, numbers))
    place, age = _walked(space, lines, last, gauge)
    order = np.argsort(place[np.searchsorted(numbers, rows.number)], kind="stable")
    on_edges = np.repeat(age[space.mesh.topology.ends].max(axis=1), space.element.on_edge)
    C, d = _with_gauge(rows.C.take(order), gauge), np.concatenate([np.zeros(3), rows.d[order]])
    of_holes = np.zeros(3 * len(space.cuts), dtype=np.int64)
    found, misfit = solve_conditions(C, d, np.concatenate([np.repeat(age, 3), on_edges, of_holes]))
    imbalance = float(np.abs(misfit).max(initial=0.0))
    if imbalance > _BALANCED * float(np.abs(rows.d[rows.is_load]).max(initial=0.0)):
        raise UnbalancedLoadError(imbalance)
    return found


def _edges_of(space: StressSpace, numbers: IntArray) -> Edges:
    """Edges of the boundary by their numbers in `mesh.topology`."""
    boundary = np.flatnonzero(space.mesh.topology.boundary)
    return space.mesh.boundary.take(np.searchsorted(boundary, numbers))


def _with_gauge(rows: Rows, vertex: int) -> Rows:
    """Φ, Φ_x and Φ_y of the vertex on top of the rows."""
    width = rows.columns.shape[1]
    return Rows(
        np.concatenate([np.broadcast_to(3 * vertex + np.arange(width), (3, width)), rows.columns]),
        np.concatenate([np.eye(3, width), rows.values]),
    )


def _projected(space: StressSpace, given: Sequence[PrescribedTraction]) -> EdgeTractions:
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


def _conditions(space: StressSpace, tractions: EdgeTractions) -> Conditions:
    """Both components of edges that have two, one of those that have one."""
    order = np.argsort(tractions.number, kind="stable")
    twice = np.flatnonzero(tractions.number[order][1:] == tractions.number[order][:-1])
    one, other = order[twice], order[twice + 1]
    directions = np.stack([tractions.direction[one], tractions.direction[other]], axis=1)
    values = np.stack([tractions.coefficients[one], tractions.coefficients[other]], axis=1)
    single = np.setdiff1d(order, np.concatenate([one, other]))
    return _joined(
        [
            _of_vectors(space, tractions.take(one), np.asarray(np.linalg.solve(directions, values))),
            _of_components(space, tractions.take(single)),
        ]
    )


def _joined(parts: Sequence[Conditions]) -> Conditions:
    """All of them, part by part."""
    if len(parts) == 1:
        return parts[0]
    d, is_load, number = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("d", "is_load", "number")
    )
    columns, values = (np.concatenate([getattr(part.C, name) for part in parts]) for name in ("columns", "values"))
    return Conditions(Rows(columns, values), d, is_load, number)


def _on(given: Sequence[PrescribedTraction], *, arcs: bool) -> list[PrescribedTraction]:
    """What is prescribed on edges that are arcs, or on those that are not."""
    if not any(part.edges.curved for part in given):
        return [] if arcs else list(given)
    found = [part.take(part.edges.bent == arcs) for part in given]
    return [part for part in found if len(part.edges)]


def _on_arcs(space: StressSpace, given: Sequence[PrescribedTraction]) -> list[Conditions]:
    """Conditions on edges that are arcs: of both components where there are two, of one where there is one."""
    parts = _on(given, arcs=True)
    if not parts:
        return []
    numbers = [space.number(part.edges) for part in parts]
    parts = [part.take(np.argsort(number)) for part, number in zip(parts, numbers, strict=True)]
    numbers = [np.sort(number) for number in numbers]
    count = np.bincount(np.concatenate(numbers), minlength=len(space.mesh.topology.ends))
    found = []
    for k, (part, number) in enumerate(zip(parts, numbers, strict=True)):
        if (count[number] == 1).any():
            found.append(_of_component_on_arcs(space, part.take(count[number] == 1)))
        for other, its in zip(parts[k + 1 :], numbers[k + 1 :], strict=True):
            if np.isin(number, its).any():
                both = part.take(np.isin(number, its)), other.take(np.isin(its, number))
                found.append(_of_vectors_on_arcs(space, *both))
    return found


def _of_vectors_on_arcs(space: StressSpace, one: PrescribedTraction, other: PrescribedTraction) -> Conditions:
    """Both components on the same arcs: force and moment of the data, and their coefficients of Legendre."""
    edges, degree = one.edges, space.degree - 2
    h, (m, factor) = space.lengths(edges), frame(edges)
    d: FloatArray = np.zeros((len(edges), 2 * degree + 2))
    for part, its in ((one, other), (other, one)):
        found = part.quadrature(space.mesh.vertices, _POINTS + degree)
        chosen = edges.take(found.edge)
        own, against = (
            vectors_along(chosen, each.direction[found.edge], found.t, turns=each.turns) for each in (part, its)
        )
        dual = np.stack([-against[..., 1], against[..., 0]], axis=-1)  # at right angles to the other component
        dual /= (dual * own).sum(axis=-1, keepdims=True)
        normal, tangent = frames_along(chosen, found.t)
        N, Q = (dual * normal).sum(axis=-1), factor[found.edge, None] * (dual * tangent).sum(axis=-1)
        shapes = resultant_shapes(chosen.bend, found.t)
        resultants = N[..., None] * shapes[..., 0] + Q[..., None] * shapes[..., 1]
        scaled = legendre.basis(degree, found.t) * (2.0 * np.arange(degree + 1) + 1.0)
        parts = [resultants, N[..., None] * scaled[..., 2:], Q[..., None] * scaled[..., 1:]]
        d += found.integrals(np.concatenate(parts, axis=-1))
    force = h[:, None] * (d[:, :1] * edges.tangent + d[:, 1:2] * m)
    d[:, 2] *= h**2
    d[:, :2] = force
    is_load = np.tile(np.arange(d.shape[1]) < 3, len(edges))
    number = np.repeat(space.number(edges), d.shape[1])
    return Conditions(space.resultants(edges).rows(), d.ravel(), is_load, number)


def _of_component_on_arcs(space: StressSpace, given: PrescribedTraction) -> Conditions:
    """One component d·σn = (d·n) σ_N + (d·t) σ_T on arcs, in the mean square of each: p − 1 rows an edge."""
    edges, degree = given.edges, space.degree - 2
    h = space.lengths(edges)
    scale = np.column_stack([h, h**2 / 6.0, *[np.ones_like(h)] * (degree - 1)])
    t, w = gauss_legendre(degree + _POINTS)
    at = np.tile(t, (len(edges), 1))
    direction = vectors_along(edges, given.direction, at, turns=given.turns)
    values = legendre.basis(degree, t)
    project = (2.0 * np.arange(degree + 1)[:, None] + 1.0) * (values * w[:, None]).T
    normal, shear = space.normal(edges), space.shear(edges)
    columns = normal.columns
    combined: FloatArray = np.zeros((len(edges), degree + 1, columns.shape[1]))
    for axis, found in zip(frames_along(edges, at), (normal, shear), strict=True):
        share = (direction * axis).sum(axis=-1)
        share = np.where(np.abs(share) <= _PARALLEL, 0.0, share)
        combined = combined + (project @ (share[:, :, None] * values) * scale[:, :, None]) @ found.values
    wanted = given.quadrature(space.mesh.vertices, degree + _POINTS).coefficients(degree)
    is_load = np.tile(np.arange(degree + 1) < 2, len(edges))
    number = np.repeat(space.number(edges), degree + 1)
    return Conditions(EdgeFunctionals(columns, combined, space.size).rows(), (wanted * scale).ravel(), is_load, number)


def _of_vectors(space: StressSpace, tractions: EdgeTractions, vectors: FloatArray) -> Conditions:
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


def _of_components(space: StressSpace, tractions: EdgeTractions) -> Conditions:
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


def _walked(space: StressSpace, lines: IntArray, last: BoolArray, gauge: int) -> tuple[IntArray, IntArray]:
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


def _gauge(space: StressSpace, lines: IntArray) -> int:
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
