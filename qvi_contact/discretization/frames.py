"""Frames: affine functions that Φ is measured from, near small cells and on one side of the cuts around holes.

An affine function has no stress. Φ at the corner of a triangle in the vertex v is the sum of the vertex's own degree of
freedom and of the affine functions f, the *frames* of the corner,

    Φ(x_v) = own degree of freedom + Σ a_f(x_v),     a_f(x) = a + (x − x_f)·b,     and likewise ∇Φ with b.

A frame has three degrees of freedom (a, b). Stresses and tractions depend on differences between corners only. So a
frame that all corners of a triangle, or both ends of an edge, have in common drops out. There are two kinds.

**Centres** save digits. Stresses are second differences of Φ. If Φ and ∇Φ vanish at a point at a distance r, a cell of
size h computes its stresses from numbers that are (r/h)² times as large, and loses that factor to rounding. So every
vertex belongs to a *centre* c, a vertex with the frame x_f = x_c, a = Φ(x_c), b = ∇Φ(x_c): the centre's own degrees of
freedom. If one centre is enough, the gauge makes these zero, and there is no frame. Centres are chosen one after the
other, each where r/h is largest, until it is small everywhere.

**Cuts** are lines across which Φ jumps, so that holes may carry forces. Along a closed path around a hole whose
tractions have the resultant (F_x, F_y), φ included, ∇Φ grows by (−F_y, F_x), with the sign of the sense of the path,
and Φ by a term of the moment. So Φ is multivalued. The body is cut along edges of the mesh, from every hole to the
outside or to another hole. On the cut of the hole k, corners of triangles on its right have Φ⁻, and on its left

    Φ⁺ = Φ⁻ + a_k + (x − x_k)·b_k,     ∇Φ⁺ = ∇Φ⁻ + b_k

with the vertex x_k where the cut begins on the rim. Stationarity in a_k and b_k means that displacements are
single-valued around the hole. The path of a cut affects Φ only, not the stresses.
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

_FAR: Final = 500.5  # largest distance to the centre over size of cells, r/h; the relative error of stresses is ε r²/h²
_ALIKE: Final = 1.47  # vertices with r/h within this factor of the largest are equal candidates for a centre
_NEARER: Final = 1.0 - 1e-9  # factor by which a distance to a new centre must be less than to the old one
# Regular meshes have no such ratios of lengths: so rounding never chooses the centres, which stored results depend on.


@dataclass(frozen=True, eq=False)
class Frames:
    """The f affine functions that Φ at corners of triangles is measured from: first of centres, then of cuts."""

    mesh: TriangleMesh
    vertices: FloatArray  # (v, 2): dimensionless coordinates
    centres: IntArray  # (c,): vertices that are centres, the one with the smallest cells first; empty if one is enough
    owner: IntArray  # (v,): the centre of each vertex
    cuts: tuple[IntArray, ...]  # vertices along each cut, from the rim of its hole to the outside or to another hole
    start: int  # number of the first degree of freedom of cuts, which have three each

    @classmethod
    def of(cls, mesh: TriangleMesh, vertices: FloatArray, sizes: FloatArray, start: int) -> "Frames":
        """The frames of a mesh, from the size of cells at each vertex (v,); centres are on the boundary if possible."""
        preferred = np.zeros(len(vertices), dtype=bool)
        preferred[mesh.boundary.first] = True
        ratio, centres = np.asarray(1.0 / sizes), list[int]()
        owner, distance = np.zeros(len(vertices), dtype=np.int64), np.full(len(vertices), np.inf)
        while not centres or ratio.max() > _FAR:
            alike = ratio * _ALIKE >= ratio.max()
            centre = int(np.argmax(alike & preferred if (alike & preferred).any() else alike))
            from_centre = np.hypot(*(vertices - vertices[centre]).T)
            nearer = from_centre < _NEARER * distance
            owner[nearer], distance[nearer] = centre, from_centre[nearer]
            centres.append(centre)
            ratio = distance / sizes
        several = np.array(centres if len(centres) > 1 else [], dtype=np.int64)
        return cls(mesh, vertices, several, owner, shortest_cuts(mesh), start)

    @cached_property
    def is_centre(self) -> BoolArray:
        """Whether each vertex (v,) is a centre: its degrees of freedom are those of its frame."""
        is_centre = np.zeros(len(self.vertices), dtype=bool)
        is_centre[self.centres] = True
        return is_centre

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
        """The degrees of freedom (a, b) of each frame, shape (f, 3)."""
        first = np.concatenate([3 * self.centres, self.start + 3 * np.arange(len(self.cuts))])
        return np.asarray(first[:, None] + np.arange(3))

    @cached_property
    def of_corners(self) -> sparse.csr_array:
        """1 for the frames of each corner of a triangle, else 0; shape (3 cells, f)."""
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
        """Whether the ends of each edge have different frames, shape (n,)."""
        return np.asarray(np.diff(self._jumps(*self._ends(edges)).indptr) > 0)

    @cached_property
    def cells_across(self) -> IntArray:
        """Numbers of the triangles whose corners have different frames."""
        return np.flatnonzero(np.diff(self._relative.indptr).reshape(-1, 2).any(axis=1))

    @cached_property
    def _relative(self) -> sparse.csr_array:
        """Frames of the second and third corner of each triangle less the frames of the first, shape (2 cells, f)."""
        corners = np.arange(self.mesh.cells.size).reshape(-1, 3)
        return self._jumps(np.repeat(corners[:, 0], 2), corners[:, 1:].ravel())

    def beyond(self, units: FloatArray) -> sparse.csr_array | None:
        """The frames' part of `Differences` in the second and third corner of triangles, (6 cells, N)."""
        return self._rows(self._relative, self.mesh.cells[:, 1:].ravel(), units) if len(self.origins) else None

    def at_first(self, units: FloatArray) -> sparse.csr_array:
        """The frames' part of (Φ, Φ_x, Φ_y) in the first corner of each triangle, (3 cells, N)."""
        return self._rows(self.of_corners[::3], self.mesh.cells[:, 0], units)

    def _rows(self, frames: sparse.csr_array, at: IntArray, units: FloatArray) -> sparse.csr_array:
        """(Φ, Φ_x, Φ_y) of sums of frames (n, f) at vertices (n,), as rows on degrees of freedom, shape (3 n, N)."""
        factors = frames.tocoo()
        row, number = (np.asarray(part, dtype=np.int64) for part in (factors.row, factors.col))
        columns = np.repeat(self.columns[number][:, None], 3, axis=1)
        values = self._affine(at[row], number) * factors.data[:, None, None] * units[columns]
        rows = np.repeat(3 * row[:, None] + np.arange(3), 3, axis=1)
        shape = (3 * len(at), len(units))
        return sparse.csr_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape)

    def on_edges(self, edges: Edges, at_second: FloatArray) -> tuple[IntArray, FloatArray]:
        """The frames' degrees of freedom (n, 3 m) in functionals on edges, and factors (n, r, 3 m), without `units`.

        m is the largest number of frames in which two corners of a triangle differ. The functionals are zero on affine
        functions. So only the difference of the frames at the two ends matters, and it acts through the factors
        `at_second` (n, r, 3) of Φ, Φ_x and Φ_y at the second end.
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
        """The largest number of frames in which two corners of a triangle differ."""
        first = 3 * np.arange(len(self.mesh.cells))
        one, other = (np.concatenate([first + edge[end] for edge in EDGES]) for end in (0, 1))
        return int(np.diff(self._jumps(one, other).indptr).max(initial=0))

    def _affine(self, at: IntArray, frames: IntArray) -> FloatArray:
        """Matrices (n, 3, 3) from (a, b) of frames (n,) to a_f and its gradient at vertices (n,)."""
        matrices = np.tile(np.eye(3), (len(at), 1, 1))
        matrices[:, 0, 1:] = self.vertices[at] - self.vertices[self.origins[frames]]
        return matrices

    def _ends(self, edges: Edges) -> tuple[IntArray, IntArray]:
        """The ends of edges as corners of the first triangle there, shape (n,) each."""
        cell = edges.cells[:, 0]
        return _corner(self.mesh, cell, edges.first), _corner(self.mesh, cell, edges.second)

    def _jumps(self, one: IntArray, other: IntArray) -> sparse.csr_array:
        """Frames of the `other` corners (n,) less the frames of `one` (n,), zeros left out, shape (n, f)."""
        jumps = sparse.csr_array(self.of_corners[other] - self.of_corners[one])
        jumps.eliminate_zeros()
        jumps.sort_indices()
        return jumps


def shortest_cuts(mesh: TriangleMesh) -> tuple[IntArray, ...]:
    """A path along edges inside the body from each hole to the outside, or to a hole that has a path already.

    Each path has the least number of edges, which keeps it away from small cells, and touches a joint only if it must.
    Of paths with equal numbers of edges, vertex numbers choose one. So no choice depends on rounding.
    """
    if len(mesh.vertices) - len(mesh.topology.ends) + len(mesh.cells) == 1:  # Euler: one less for every hole
        return ()
    vertices, topology = np.arange(len(mesh.vertices)), mesh.topology
    rims = topology.ends[topology.outer]
    on_hole, reached = (np.isin(vertices, rims[chosen]) for chosen in (mesh.hole_edges, ~mesh.hole_edges))
    on_joints = [topology.ends[mesh.numbers(name)].ravel() for name in mesh.joint_names]
    joints = np.isin(vertices, np.concatenate([np.empty(0, dtype=np.int64), *on_joints])).astype(np.int64)
    ends = topology.ends[topology.inner]
    length = 1.0 + len(ends) * joints[ends].sum(axis=1)  # an edge at a joint is longer than any path without
    at = np.concatenate([ends, ends[:, ::-1]]).T
    lengths = sparse.csr_array((np.tile(length, 2), tuple(at)), shape=(len(joints), len(joints)))
    paths = list[IntArray]()
    while on_hole.any():  # the nearest hole that has no path yet
        distance = csgraph.dijkstra(lengths, indices=np.flatnonzero(reached), min_only=True)
        path = [int(np.argmin(np.where(on_hole, distance, np.inf)))]
        while distance[path[-1]] > 0.0:  # of several nearer neighbours, to that of lowest number
            row = slice(lengths.indptr[path[-1]], lengths.indptr[path[-1] + 1])
            neighbours = lengths.indices[row]
            path.append(int(neighbours[distance[neighbours] + lengths.data[row] == distance[path[-1]]].min()))
        rim = _rim(mesh, path[0])
        on_hole[rim], reached[rim] = False, True
        paths.append(np.array(path))
    return tuple(paths)


def _rim(mesh: TriangleMesh, vertex: int) -> IntArray:
    """The vertices of the closed boundary line through a vertex."""
    lines = (mesh.topology.ends[line] for line in mesh.outlines)
    return np.unique(next(line for line in lines if vertex in line))


def _left_of(mesh: TriangleMesh, path: IntArray) -> IntArray:
    """Corners (3 cell + corner) at the vertices of a path, in all triangles that lie left of the path.

    Around a vertex, two triangles are linked if they share an edge that is not on the path. The triangles linked with
    one directly left of an edge of the path lie left.
    """
    topology = mesh.topology
    pairs = np.column_stack([path[:-1], path[1:]])
    cut, inside = topology.number(pairs), ~topology.boundary
    inside[cut] = False
    # links between corners at a vertex of the path, across edges inside the body that are not on the path
    edges, end = np.nonzero(np.isin(topology.ends, path) & inside[:, None])
    vertex = topology.ends[edges, end]
    links = np.stack([_corner(mesh, topology.cells[edges, side], vertex) for side in (0, 1)])
    # the corners directly left of the path's edges, then all that are linked with them
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
