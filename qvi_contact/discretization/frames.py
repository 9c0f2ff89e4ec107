"""From where Φ counts: affine functions, of small cells far from each other, and across the cuts around holes.

Stresses do not feel affine functions. A corner of a triangle at the vertex v has its own degrees of freedom and
those of the functions f, *frames*, that it counts from,

    Φ(x_v) = its own degree of freedom + Σ a_f(x_v),     a_f(x) = a + (x − x_f)·b,     ∇Φ likewise with b

three degrees of freedom (a, b) each. Inside a triangle, and along an edge, only the differences between corners count:
edges and triangles whose corners have the same frames see none of them. There are two kinds.

**Centres** keep digits. Stresses are second differences of Φ. Where Φ counts from an affine function that vanishes with
its slopes at a distance r, a cell of size h takes them from numbers that are (r/h)² times as large, and rounding takes
as many digits. So every vertex belongs to a *centre* c, a vertex, whose frame has x_c, Φ(x_c) and ∇Φ(x_c): the degrees
of freedom of the centre itself. Where one centre does for all, the gauge makes these zero, and there is no frame.
Centres are chosen one after the other, each where r/h is largest, until it is small everywhere.

**Cuts** are lines across which Φ jumps, so that holes may carry forces. Around a hole whose tractions have the
resultant (F_x, F_y), φ included, the slopes of Φ grow by (−F_y, F_x), turned with the sense of going round, and Φ by
what the moment adds: Φ has several values. The body is cut along edges of the mesh from every hole to the outside or to
another hole, and from the cut of the hole k, Φ⁻ on its right, all corners on it whose triangles lie left of it count,

    Φ⁺ = Φ⁻ + a_k + (x − x_k)·b_k,     ∇Φ⁺ = ∇Φ⁻ + b_k

with the vertex x_k where the cut begins on the rim. Stationarity with respect to a_k and b_k says that displacements
are single-valued around the hole. Which way a cut runs changes nothing but Φ itself.
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
from solvers.basics.linked import linked

_FAR: Final = 500.5  # distance to the centre over size of cells that is allowed: its square times ε is lost
_ALIKE: Final = 1.47  # ratio that counts as none when a centre is chosen
_NEARER: Final = 1.0 - 1e-9  # share of a distance that is less
# None is a ratio of lengths in regular meshes: rounding must not choose centres, by which stored results are read.


@dataclass(frozen=True, eq=False)
class Frames:
    """The affine functions that corners of triangles count from: f of them, of centres and then of cuts."""

    mesh: TriangleMesh
    vertices: FloatArray  # (v, 2): dimensionless coordinates
    centres: IntArray  # (c,): vertices that are centres, the one with the smallest cells first; none if one would do
    owner: IntArray  # (v,): the centre of each vertex
    cuts: tuple[IntArray, ...]  # vertices along each, from the rim of its hole to the outside or to another hole
    start: int  # the first degree of freedom of cuts; three a cut

    @classmethod
    def of(cls, mesh: TriangleMesh, vertices: FloatArray, sizes: FloatArray, start: int) -> "Frames":
        """Those of a mesh with cells of these sizes at its vertices (v,); centres lie on the boundary if they can."""
        preferred = np.zeros(len(vertices), dtype=bool)
        preferred[mesh.boundary.first] = True
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
        several = np.array(centres if len(centres) > 1 else [], dtype=np.int64)
        return cls(mesh, vertices, several, owner, shortest_cuts(mesh), start)

    @cached_property
    def is_centre(self) -> BoolArray:
        """Whether vertices are centres, which have no degrees of freedom but those of their frame (v,)."""
        found = np.zeros(len(self.vertices), dtype=bool)
        found[self.centres] = True
        return found

    @cached_property
    def on_cuts(self) -> IntArray:
        """The vertices of all cuts, one cut after the other."""
        return np.concatenate([np.empty(0, dtype=np.int64), *self.cuts])

    @cached_property
    def origins(self) -> IntArray:
        """The vertices x_f, shape (f,)."""
        return np.concatenate([self.centres, np.array([path[0] for path in self.cuts], dtype=np.int64)])

    @cached_property
    def columns(self) -> IntArray:
        """The degrees of freedom (a, b) of each, shape (f, 3)."""
        first = np.concatenate([3 * self.centres, self.start + 3 * np.arange(len(self.cuts))])
        return np.asarray(first[:, None] + np.arange(3))

    @cached_property
    def of_corners(self) -> sparse.csr_array:
        """1 where a corner of a triangle counts from a frame, shape (3 cells, f)."""
        cells, corners, frames = self.mesh.cells, [np.empty(0, np.int64)], [np.empty(0, np.int64)]
        if len(self.centres):
            order = np.argsort(self.centres)
            corners.append(np.arange(cells.size))
            frames.append(order[np.searchsorted(self.centres, self.owner[cells.ravel()], sorter=order)])
        for number, path in enumerate(self.cuts, len(self.centres)):
            corners.append(_left_of(self.mesh, path))
            frames.append(np.full(len(corners[-1]), number))
        at = np.concatenate(corners), np.concatenate(frames)
        return sparse.csr_array((np.ones(len(at[0])), at), shape=(cells.size, len(self.origins)))

    @cached_property
    def holes(self) -> FloatArray:
        """The longer side of the bounding box of each hole, shape (k,) [length]."""
        rims = [self.mesh.vertices[_rim(self.mesh, int(path[0]))] for path in self.cuts]
        return np.array([np.ptp(rim, axis=0).max() for rim in rims])

    def across(self, edges: Edges) -> BoolArray:
        """Which edges have ends that count from different frames, shape (n,)."""
        return np.asarray(np.diff(self._jumps(*self._ends(edges)).indptr) > 0)

    @cached_property
    def cells_across(self) -> IntArray:
        """Triangles whose corners count from different frames."""
        return np.flatnonzero(np.diff(self._relative.indptr).reshape(-1, 2).any(axis=1))

    @cached_property
    def _relative(self) -> sparse.csr_array:
        """Frames of the second and third corner of each triangle less those of the first, shape (2 cells, f)."""
        corners = np.arange(self.mesh.cells.size).reshape(-1, 3)
        return self._jumps(np.repeat(corners[:, 0], 2), corners[:, 1:].ravel())

    def beyond(self, units: FloatArray) -> sparse.csr_array | None:
        """What is added to differences in the second and third corner of triangles, see `Differences`; (6 cells, N)."""
        return self._rows(self._relative, self.mesh.cells[:, 1:].ravel(), units) if len(self.origins) else None

    def at_first(self, units: FloatArray) -> sparse.csr_array:
        """What (Φ, Φ_x, Φ_y) in the first corner of each triangle count from, shape (3 cells, N)."""
        return self._rows(self.of_corners[::3], self.mesh.cells[:, 0], units)

    def _rows(self, frames: sparse.csr_array, at: IntArray, units: FloatArray) -> sparse.csr_array:
        """(Φ, Φ_x, Φ_y) of sums of frames (n, f) at vertices (n,), as rows on degrees of freedom, shape (3 n, N)."""
        found = frames.tocoo()
        row, number = (np.asarray(part, dtype=np.int64) for part in (found.row, found.col))
        columns = np.repeat(self.columns[number][:, None], 3, axis=1)
        values = self._affine(at[row], number) * found.data[:, None, None] * units[columns]
        rows = np.repeat(3 * row[:, None] + np.arange(3), 3, axis=1)
        shape = (3 * len(at), len(units))
        return sparse.csr_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape)

    def on_edges(self, edges: Edges, at_second: FloatArray) -> tuple[IntArray, FloatArray]:
        """More columns (n, 3 m) of functionals on edges, and their values (n, r, 3 m), units left out.

        m is the number of frames between two corners of a triangle at most. `at_second` (n, r, 3) are the functionals
        of Φ, Φ_x and Φ_y at the second end, which counts against the first: on affine functions functionals are zero.
        """
        jumps = self._jumps(*self._ends(edges))
        number = np.asarray(jumps.indices, dtype=np.int64)
        counts, n, r = np.diff(jumps.indptr), len(edges), at_second.shape[1]
        columns = np.zeros((n, self._most, 3), dtype=np.int64)
        values = np.zeros((n, self._most, r, 3))
        edge = np.repeat(np.arange(n), counts)
        place = np.arange(len(edge)) - np.repeat(jumps.indptr[:-1], counts)
        columns[edge, place] = self.columns[number]
        affine = self._affine(edges.second[edge], number)
        values[edge, place] = jumps.data[:, None, None] * (at_second[edge] @ affine)
        width = 3 * self._most
        return columns.reshape(n, width), values.swapaxes(1, 2).reshape(n, r, width)

    @cached_property
    def _most(self) -> int:
        """The number of frames between two corners of a triangle at most."""
        first = 3 * np.arange(len(self.mesh.cells))
        one, other = (np.concatenate([first + edge[end] for edge in EDGES]) for end in (0, 1))
        return int(np.diff(self._jumps(one, other).indptr).max(initial=0))

    def _affine(self, at: IntArray, frames: IntArray) -> FloatArray:
        """(a_f, its slopes) at vertices (n,) of the degrees of freedom (a, b) of frames (n,), shape (n, 3, 3)."""
        found = np.tile(np.eye(3), (len(at), 1, 1))
        found[:, 0, 1:] = self.vertices[at] - self.vertices[self.origins[frames]]
        return found

    def _ends(self, edges: Edges) -> tuple[IntArray, IntArray]:
        """The ends of edges as corners of the first triangle there, shape (n,) each."""
        cell = edges.cells[:, 0]
        return _corner(self.mesh, cell, edges.first), _corner(self.mesh, cell, edges.second)

    def _jumps(self, one: IntArray, other: IntArray) -> sparse.csr_array:
        """Frames of some corners (n,) less those of others (n,), zeros left out, shape (n, f)."""
        found = sparse.csr_array(self.of_corners[other] - self.of_corners[one])
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
    every, topology = np.arange(len(mesh.vertices)), mesh.topology
    rims = topology.ends[topology.outer]
    waiting, reached = (np.isin(every, rims[chosen]) for chosen in (mesh.hole_edges, ~mesh.hole_edges))
    on_joints = [topology.ends[mesh.numbers(name)].ravel() for name in mesh.joint_names]
    joints = np.isin(every, np.concatenate([np.empty(0, dtype=np.int64), *on_joints])).astype(np.int64)
    ends = topology.ends[topology.inner]
    length = 1.0 + len(ends) * joints[ends].sum(axis=1)  # more than all others where a joint is touched
    at = np.concatenate([ends, ends[:, ::-1]]).T
    lengths = sparse.csr_array((np.tile(length, 2), tuple(at)), shape=(len(joints), len(joints)))
    paths = list[IntArray]()
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
    label = linked(numbered[0], numbered[1], len(nodes))
    return np.asarray(nodes[np.isin(label, label[number[links.size :]])])


def _corner(mesh: TriangleMesh, cells: IntArray, vertices: IntArray) -> IntArray:
    """3 cell + corner of vertices (n,) in triangles (n,)."""
    return np.asarray(3 * cells + np.argmax(mesh.cells[cells] == vertices[:, None], axis=1))
