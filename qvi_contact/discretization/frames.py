"""From where Φ counts: frames for small cells far from each other, and cuts around holes.

**Frames** are affine functions from which degrees of freedom at vertices count, so that small cells lose no digits.

Stresses are second differences of Φ. Where Φ counts from an affine function that vanishes with its slopes at a distance
r, a cell of size h takes them from numbers that are (r/h)² times as large, and rounding takes as many digits. So every
vertex v belongs to a *centre* c(v), a vertex, and its degrees of freedom are values and slopes of

    Φ − a_c,     a_c(x) = Φ(x_c) + (x − x_c)·∇Φ(x_c),

those of the centre are Φ(x_c) and ∇Φ(x_c) themselves. Where all vertices have one centre, the gauge makes these zero,
and nothing changes. Where there are several, nothing changes inside the part of each, since stresses do not feel a_c.
Only edges and triangles *across* parts see the centres: at a vertex v of theirs

    Φ(x_v) = its own degree of freedom + a_c(x_v).

Centres are chosen one after the other, each where r/h is largest, until it is small everywhere.

**Cuts** are lines across which Φ jumps by an affine function, so that holes may carry forces.

Around a hole whose tractions have the resultant (F_x, F_y), φ included, the slopes of Φ grow by (−F_y, F_x), turned
with the sense of going round, and Φ by what the moment adds: Φ has several values. The body is cut along edges of the
mesh from every hole to the outside or to another hole, and across the cut of the hole k

    Φ⁺ = Φ⁻ + J_k,     J_k(x) = a_k + (x − x_k)·b_k,     ∇Φ⁺ = ∇Φ⁻ + b_k

with three more degrees of freedom a_k, b_k a hole; x_k is the vertex where the cut begins on the rim. Stresses do not
feel J_k, so only triangles whose corners lie on both branches see it. The degrees of freedom at a vertex v of a cut are
those of Φ⁻, and a triangle left of the cut, which a row in `left` tells, has there

    Φ⁺(x_v) = its own degree of freedom + J_k(x_v).

Stationarity with respect to a_k and b_k says that displacements are single-valued around the hole. Which way a cut runs
changes nothing but Φ itself.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.element.triangle import EDGES
from qvi_contact.mesh.edges import Edges, cross
from qvi_contact.mesh.triangles import TriangleMesh

_FAR: Final = 500.5  # distance to the centre over size of cells that is allowed: its square times ε is lost
_ALIKE: Final = 1.47  # ratio that counts as none when a centre is chosen
_NEARER: Final = 1.0 - 1e-9  # share of a distance that is less
# None is a ratio of lengths in regular meshes: rounding must not choose centres, by which stored results are read.


@dataclass(frozen=True, eq=False)
class Frames:
    """From which vertex each vertex of a mesh counts."""

    vertices: FloatArray  # (v, 2): dimensionless coordinates
    centres: IntArray  # (c,): vertices that are centres, the one with the smallest cells first
    owner: IntArray  # (v,): the centre of each vertex

    @classmethod
    def of(cls, vertices: FloatArray, sizes: FloatArray, preferred: BoolArray) -> "Frames":
        """Centres of vertices with cells of these sizes (v,); of several that are alike a preferred one (v,)."""
        ratio, centres = np.asarray(1.0 / sizes), list[int]()
        owner, distance = np.zeros(len(vertices), dtype=np.int64), np.full(len(vertices), np.inf)
        while not centres or ratio.max() > _FAR:
            alike = ratio * _ALIKE >= ratio.max()
            centre = int(np.argmax(alike & preferred if (alike & preferred).any() else alike))
            away = np.hypot(*(vertices - vertices[centre]).T)
            nearer = away < _NEARER * distance
            owner[nearer], distance[nearer] = centre, away[nearer]
            centres.append(centre)
            ratio = distance / sizes
        return cls(vertices, np.array(centres), owner)

    @property
    def several(self) -> bool:
        """Whether there is more than one centre, so that degrees of freedom are not those of Φ."""
        return len(self.centres) > 1

    @cached_property
    def is_centre(self) -> BoolArray:
        """Whether vertices are centres (v,)."""
        found = np.zeros(len(self.vertices), dtype=bool)
        found[self.centres] = True
        return found

    def across(self, groups: IntArray) -> BoolArray:
        """Which edges (n, 2) or triangles (n, 3) have vertices of several centres, shape (n,)."""
        owners = self.owner[groups]
        return np.asarray((owners != owners[:, :1]).any(axis=1))

    def affine(self, at: IntArray) -> FloatArray:
        """(a_c, its slopes) at vertices (n,) of (Φ, Φ_x, Φ_y) at their centres, shape (n, 3, 3)."""
        return shifts(self.vertices[at] - self.vertices[self.owner[at]])

    def columns(self, at: IntArray) -> IntArray:
        """The degrees of freedom of the centres of vertices (n,), shape (n, 3)."""
        return 3 * self.owner[at][:, None] + np.arange(3)

    def beyond(self, cells: IntArray, size: int) -> sparse.csr_array:
        """What triangles (n, 3) across parts have at their corners beside their own degrees of freedom.

        That is a_c of each corner less a_c of the first, as rows (Φ, Φ_x, Φ_y) of the three corners, shape
        (9 n, size). Degrees of freedom of centres count in their own units.
        """
        first = np.repeat(cells[:, 0], 3)
        corner = cells.ravel()
        apart = np.flatnonzero(self.owner[corner] != self.owner[first])
        at, origin = corner[apart], first[apart]
        away = shifts(self.vertices[at] - self.vertices[self.owner[origin]])
        rows = np.repeat(3 * apart[:, None] + np.arange(3), 6, axis=1)
        columns = np.repeat(np.hstack([self.columns(at), self.columns(origin)])[:, None], 3, axis=1)
        values = np.concatenate([self.affine(at), -away], axis=2)
        shape = (3 * len(corner), size)
        return sparse.coo_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape).tocsr()


def shifts(arms: FloatArray) -> FloatArray:
    """Maps of value and slopes of affine functions from one point to another, arms (n, 2) away: shape (n, 3, 3)."""
    found = np.tile(np.eye(3), (len(arms), 1, 1))
    found[:, 0, 1:] = arms
    return found


@dataclass(frozen=True, eq=False)
class Cuts:
    """The cuts of a mesh, one for each hole."""

    mesh: TriangleMesh
    paths: tuple[IntArray, ...]  # vertices along each cut, from the rim of its hole to the outside or to another hole
    start: int  # the first of their degrees of freedom; three a cut

    def __len__(self) -> int:
        return len(self.paths)

    @cached_property
    def vertices(self) -> IntArray:
        """The vertices of all cuts, one cut after the other."""
        return np.concatenate([np.empty(0, dtype=np.int64), *self.paths])

    @cached_property
    def origins(self) -> IntArray:
        """The vertices x_k, shape (k,)."""
        return np.array([path[0] for path in self.paths], dtype=np.int64)

    @cached_property
    def left(self) -> sparse.csr_array:
        """1 where a corner of a triangle lies on the left branch of a cut, shape (3 cells, k)."""
        corners = [_left_of(self.mesh, path) for path in self.paths]
        rows = np.concatenate([np.empty(0, dtype=np.int64), *corners])
        columns = np.repeat(np.arange(len(self)), [len(found) for found in corners])
        return sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=(self.mesh.cells.size, len(self)))

    @cached_property
    def holes(self) -> FloatArray:
        """The longer side of the bounding box of each hole, shape (k,) [length]."""
        rims = [self.mesh.vertices[_rim(self.mesh, int(vertex))] for vertex in self.origins]
        return np.array([np.ptp(rim, axis=0).max() for rim in rims])

    def across(self, edges: Edges) -> BoolArray:
        """Which edges have their ends on different branches, shape (n,)."""
        if not self.paths:
            return np.zeros(len(edges), dtype=bool)
        return np.asarray(np.diff(self._jumps(self._corners(edges)).indptr) > 0)

    @cached_property
    def cells_across(self) -> BoolArray:
        """Which triangles have corners on different branches, shape (cells,)."""
        if not self.paths:
            return np.zeros(len(self.mesh.cells), dtype=bool)
        found = np.diff(self._relative.indptr) > 0
        return np.asarray(found.reshape(-1, 3).any(axis=1))

    @cached_property
    def _relative(self) -> sparse.csr_array:
        """Branches of all corners less that of the first corner of their triangle, shape (3 cells, k)."""
        first = np.repeat(3 * np.arange(len(self.mesh.cells)), 3)
        return self._jumps(np.column_stack([first, np.arange(self.mesh.cells.size)]))

    def beyond(self, cells: IntArray, vertices: FloatArray, units: FloatArray) -> sparse.csr_array:
        """What triangles (n,) have at their corners beside their own degrees of freedom, shape (9 n, N).

        That is J_k of each corner less that of the first, as rows (Φ, Φ_x, Φ_y) of the three corners; vertices (v, 2)
        are dimensionless, units (N,) those of the degrees of freedom.
        """
        corners = (3 * cells[:, None] + np.arange(3)).ravel()
        found = self._relative[corners].tocoo()
        rows, cut = found.row, np.asarray(found.col, dtype=np.int64)
        values = self._affine(self.mesh.cells.ravel()[corners[rows]], cut, vertices) * found.data[:, None, None]
        columns = np.repeat(self.columns(cut)[:, None], 3, axis=1)
        at = np.repeat(3 * rows[:, None] + np.arange(3), 3, axis=1).reshape(-1, 3, 3)
        values = values * units[columns]
        shape = (3 * len(corners), len(units))
        return sparse.csr_array((values.ravel(), (at.ravel(), columns.ravel())), shape=shape)

    def on_edges(self, edges: Edges, at_second: FloatArray, vertices: FloatArray) -> tuple[IntArray, FloatArray]:
        """More columns (n, 3 m) of functionals on edges, and their values (n, r, 3 m), units left out.

        m is the number of cuts between two corners of a triangle at most. `at_second` (n, r, 3) are the functionals of
        Φ, Φ_x and Φ_y at the second end, which counts J_k against the first: on affine functions functionals are zero.
        """
        jumps = self._jumps(self._corners(edges))
        cut = np.asarray(jumps.indices, dtype=np.int64)
        counts, n, r = np.diff(jumps.indptr), len(edges), at_second.shape[1]
        columns = np.full((n, self._most, 3), self.start, dtype=np.int64)
        values = np.zeros((n, self._most, r, 3))
        edge = np.repeat(np.arange(len(edges)), counts)
        place = np.arange(len(edge)) - np.repeat(jumps.indptr[:-1], counts)
        columns[edge, place] = self.columns(cut)
        affine = self._affine(edges.second[edge], cut, vertices)
        values[edge, place] = jumps.data[:, None, None] * (at_second[edge] @ affine)
        width = 3 * self._most
        return columns.reshape(n, width), values.swapaxes(1, 2).reshape(n, r, width)

    @cached_property
    def _most(self) -> int:
        """The number of cuts between two corners of a triangle at most."""
        first = 3 * np.arange(len(self.mesh.cells))
        pairs = np.concatenate([np.column_stack([first + a, first + b]) for a, b in EDGES])
        return int(np.diff(self._jumps(pairs).indptr).max(initial=0))

    def columns(self, cut: IntArray) -> IntArray:
        """The degrees of freedom of cuts (n,), shape (n, 3)."""
        return self.start + 3 * cut[:, None] + np.arange(3)

    def _affine(self, at: IntArray, cut: IntArray, vertices: FloatArray) -> FloatArray:
        """(J_k, its slopes) at vertices (n,) of (a_k, b_k), shape (n, 3, 3)."""
        return shifts(vertices[at] - vertices[self.origins[cut]])

    def _corners(self, edges: Edges) -> IntArray:
        """The ends of edges as corners of the first triangle there, shape (n, 2)."""
        cell = edges.cells[:, 0]
        return np.column_stack([_corner(self.mesh, cell, ends) for ends in (edges.first, edges.second)])

    def _jumps(self, corners: IntArray) -> sparse.csr_array:
        """Branches of the second of two corners (n, 2) less those of the first, zeros left out, shape (n, k)."""
        found = sparse.csr_array(self.left[corners[:, 1]] - self.left[corners[:, 0]])
        found.eliminate_zeros()
        found.sort_indices()
        return found


def shortest_cuts(mesh: TriangleMesh) -> tuple[IntArray, ...]:
    """A path along edges inside the body from each hole to the outside, or to a hole that has one already.

    It has as few edges as can be, which keeps it away from small cells, and does not touch a joint where another way is
    left; of several that are alike one is chosen by the numbers of vertices. Lengths are whole numbers: rounding
    chooses nothing.
    """
    if len(mesh.vertices) - len(mesh.topology.ends) + len(mesh.cells) == 1:  # Euler: one less for every hole
        return ()
    waiting = np.zeros(len(mesh.vertices), dtype=bool)
    waiting[np.concatenate([mesh.boundary.first[mesh.hole_edges], mesh.boundary.second[mesh.hole_edges]])] = True
    reached = np.zeros(len(mesh.vertices), dtype=bool)
    reached[mesh.boundary.first[~mesh.hole_edges]] = reached[mesh.boundary.second[~mesh.hole_edges]] = True
    ends, joints = mesh.topology.ends[~mesh.topology.boundary], np.zeros(len(mesh.vertices), dtype=np.int64)
    for name in mesh.joint_names:
        joints[mesh.topology.ends[mesh.numbers(name)]] = 1
    length = 1.0 + len(ends) * joints[ends].sum(axis=1)  # more than all others where a joint is touched
    at = np.concatenate([ends, ends[:, ::-1]]).T
    lengths, paths = (
        sparse.csr_array((np.tile(length, 2), tuple(at)), shape=(len(joints), len(joints))),
        list[IntArray](),
    )
    while waiting.any():
        distance = csgraph.dijkstra(lengths, indices=np.flatnonzero(reached), min_only=True)
        path = [int(np.argmin(np.where(waiting, distance, np.inf)))]
        while distance[path[-1]] > 0.0:  # down by the neighbour of lowest number wherever there are several
            row = slice(lengths.indptr[path[-1]], lengths.indptr[path[-1] + 1])
            neighbours = lengths.indices[row]
            path.append(int(neighbours[distance[neighbours] + lengths.data[row] == distance[path[-1]]].min()))
        rim = _rim(mesh, path[0])
        waiting[rim], reached[rim] = False, True
        paths.append(np.array(path))
    return tuple(paths)


def _rim(mesh: TriangleMesh, vertex: int) -> IntArray:
    """The vertices of the closed line of the boundary that holds a vertex."""
    lines = (mesh.topology.ends[line] for line in mesh.outlines)
    return np.unique(next(line for line in lines if vertex in line))


def _left_of(mesh: TriangleMesh, path: IntArray) -> IntArray:
    """Corners, 3 cell + corner, at the vertices of a path whose triangles lie left of it.

    Around a vertex triangles are neighbours if they share an edge that is not one of the path: what hangs together with
    the triangle left of an edge of the path lies left.
    """
    topology = mesh.topology
    pairs = np.column_stack([path[:-1], path[1:]])
    cut, inside = topology.number(pairs), ~topology.boundary
    inside[cut] = False
    edges, end = np.nonzero(np.isin(topology.ends, path) & inside[:, None])
    vertex = topology.ends[edges, end]
    links = np.stack([_corner(mesh, topology.cells[edges, side], vertex) for side in (0, 1)])
    first, second = mesh.vertices[pairs].swapaxes(0, 1)
    cells = topology.cells[cut]
    is_left = cross(second - first, mesh.corners[cells[:, 0]].mean(axis=1) - first) > 0.0
    beside = np.where(is_left, cells[:, 0], cells[:, 1])
    seeds = np.concatenate([_corner(mesh, beside, pairs[:, end]) for end in (0, 1)])
    nodes, number = np.unique(np.concatenate([links.ravel(), seeds]), return_inverse=True)
    numbered = number[: links.size].reshape(links.shape)
    graph = sparse.coo_array((np.ones(links.shape[1]), numbered), shape=(len(nodes), len(nodes)))
    label = csgraph.connected_components(graph, directed=False)[1]
    return np.asarray(nodes[np.isin(label, label[number[links.size :]])])


def _corner(mesh: TriangleMesh, cells: IntArray, vertices: IntArray) -> IntArray:
    """3 cell + corner of vertices (n,) in triangles (n,)."""
    return np.asarray(3 * cells + np.argmax(mesh.cells[cells] == vertices[:, None], axis=1))
