"""Degrees of freedom of Hsieh-Clough-Tocher elements on a mesh of triangles, and their tractions on edges.

Degrees of freedom are those of `element.hsieh_clough_tocher` in units that make the energies of all of them alike,

    Φ/s, Φ_x, Φ_y   at vertices, from three times the vertex's number on,
    h N_k, h Q_k    on edges, behind those of the vertices
    a_k/d, b_k      of holes, behind those of the edges

with s the length of the shortest edge at the vertex, h the edge's own and d the size of the hole. Where a mesh has
small cells in places far from each other, Φ counts from an affine function in each, see `frames`; around holes it has
several values, see `cuts`.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.hsieh_clough_tocher.arcs import from_corners
from qvi_contact.discretization.hsieh_clough_tocher.condensed import Differences
from qvi_contact.discretization.hsieh_clough_tocher.curved import CurvedTriangles
from qvi_contact.discretization.hsieh_clough_tocher.cuts import Cuts, shortest_cuts
from qvi_contact.discretization.hsieh_clough_tocher.frames import Frames
from qvi_contact.discretization.hsieh_clough_tocher.functionals import EdgeFunctionals
from qvi_contact.element.affine import AffineTriangles
from qvi_contact.element.hsieh_clough_tocher import HsiehCloughTocher, hsieh_clough_tocher
from qvi_contact.mesh.edges import Edges
from qvi_contact.mesh.triangles import TriangleMesh

_FIRST: Final = slice(1, 3)  # slopes at the first end of an edge
_SECOND: Final = slice(4, 6)


@dataclass(frozen=True, eq=False)
class TriangleSpace:
    """The C1 functions of one degree on a mesh, dimensionless.

    Attributes
    ----------
    mesh : TriangleMesh
        The mesh.
    degree : int
        p.

    """

    mesh: TriangleMesh
    degree: int

    @cached_property
    def element(self) -> HsiehCloughTocher:
        """The element."""
        return hsieh_clough_tocher(self.degree)

    @cached_property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return self.cuts.start + 3 * len(self.cuts)

    @cached_property
    def cuts(self) -> Cuts:
        """Where Φ jumps."""
        start = 3 * len(self.vertices) + self.element.on_edge * len(self.mesh.topology.ends)
        return Cuts(self.mesh, shortest_cuts(self.mesh), start)

    @cached_property
    def vertices(self) -> FloatArray:
        """Dimensionless coordinates, shape (v, 2)."""
        return np.asarray((self.mesh.vertices - self.mesh.origin) / self.mesh.length)

    @cached_property
    def triangles(self) -> AffineTriangles:
        """The triangles, dimensionless."""
        return AffineTriangles(self.vertices[self.mesh.cells])

    @cached_property
    def curved(self) -> CurvedTriangles:
        """Those that have arcs."""
        numbers = np.flatnonzero(self.mesh.curved)
        return CurvedTriangles(self.element, numbers, self.triangles.take(self.mesh.curved), self.mesh.sides[numbers])

    @cached_property
    def dofs(self) -> IntArray:
        """Degrees of freedom of each triangle in the order of the element, shape (cells, shared)."""
        cells, edges, on_edge = self.mesh.cells, self.mesh.topology.of_cells, self.element.on_edge
        at_vertices = (3 * cells[:, :, None] + np.arange(3)).reshape(len(cells), 9)
        on_edges = (3 * len(self.vertices) + on_edge * edges[:, :, None] + np.arange(on_edge)).reshape(len(cells), -1)
        return np.hstack([at_vertices, on_edges])

    @cached_property
    def differences(self) -> Differences:
        """Degrees of freedom triangle by triangle."""
        corners, frames = self.triangles.corners, self.frames
        units = self.units[self.dofs]
        if frames.several:
            units[:, :9] *= np.repeat(~frames.is_centre[self.mesh.cells], 3, axis=1)
        across = np.flatnonzero(frames.across(self.mesh.cells) | self.cuts.cells_across)
        beyond = frames.beyond(self.mesh.cells[across], self.size)
        if len(self.cuts):
            beyond = beyond + self.cuts.beyond(across, self.vertices, self.units)
        return Differences(corners[:, 1:] - corners[:, :1], self.dofs, units, self.size, across, beyond)

    @cached_property
    def frames(self) -> Frames:
        """From where Φ counts; centres lie on the boundary rather than inside."""
        return Frames.of(self.vertices, self.sizes, np.isin(np.arange(len(self.vertices)), self.mesh.boundary.first))

    @cached_property
    def sizes(self) -> FloatArray:
        """Length of the shortest edge at each vertex, dimensionless."""
        return np.asarray(self.mesh.finest / self.mesh.length)

    @cached_property
    def units(self) -> FloatArray:
        """Φ, its slopes, N_k, Q_k, a_k or b_k over the degree of freedom that stands for it, shape (N,)."""
        first, second = self.vertices[self.mesh.topology.ends].swapaxes(0, 1)
        values = np.where(self.frames.is_centre & self.frames.several, 1.0, self.sizes)
        at_vertices = np.column_stack([values, np.ones((len(self.sizes), 2))]).ravel()
        on_edges = np.repeat(1.0 / np.hypot(*(second - first).T), self.element.on_edge)
        of_holes = np.column_stack([self.cuts.holes / self.mesh.length, np.ones((len(self.cuts), 2))]).ravel()
        return np.concatenate([at_vertices, on_edges, of_holes])

    def number(self, edges: Edges) -> IntArray:
        """Edges (n,) as `mesh.topology` counts them."""
        return self.mesh.topology.number(np.column_stack([edges.first, edges.second]), len(self.vertices))

    def lengths(self, edges: Edges) -> FloatArray:
        """Dimensionless lengths of edges (n,), of arcs those of their chords."""
        length = edges.length / edges.stretch if edges.curved else edges.length
        return length / self.mesh.length

    def normal(self, edges: Edges) -> EdgeFunctionals:
        """Coefficients of Legendre, p − 1 an edge, of σ_N without φ along edges."""
        found, sign, h = self._blank(edges, self.degree - 1)
        values, slope = found.values, edges.tangent / self.lengths(edges)[:, None]
        values[:, 0, _FIRST], values[:, 0, _SECOND] = -slope, slope
        values[:, 1, _FIRST] = values[:, 1, _SECOND] = 3.0 * slope
        values[:, 1, 0], values[:, 1, 3] = 6.0 / h**2, -6.0 / h**2
        for k in range(2, self.degree - 1):
            values[:, k, self._place("N", k)] = sign**k
        if edges.curved:
            values[edges.bent] = self._on_arcs(edges.take(edges.bent))[:, : self.degree - 1]
        return self._scaled(edges, found)

    def shear(self, edges: Edges) -> EdgeFunctionals:
        """Coefficients of Legendre, p − 1 an edge, of σ_T along edges."""
        found, sign, h = self._blank(edges, self.degree - 1)
        m, factor = frame(edges)
        slope = factor[:, None] * m / h[:, None]
        found.values[:, 0, _FIRST], found.values[:, 0, _SECOND] = -slope, slope
        for k in range(1, self.degree - 1):
            found.values[:, k, self._place("Q", k)] = factor * sign**k
        if edges.curved:
            bent = edges.bent
            on_arcs = self._on_arcs(edges.take(bent))[:, self.degree - 1 :]
            found.values[bent] = factor[bent, None, None] * on_arcs
        return self._scaled(edges, found)

    def resultants(self, edges: Edges) -> EdgeFunctionals:
        """What both tractions prescribe, 2p − 2 an edge: ∇Φ_b − ∇Φ_a, Φ_b − Φ_a − h t·(∇Φ_a + ∇Φ_b)/2, N_k, Q_k."""
        return self._scaled(edges, self._resultants(edges))

    def _on_arcs(self, edges: Edges) -> FloatArray:
        """N_0 … N_(p−2), Q_0 … Q_(p−2) of Φ_ττ and Φ_τμ along arcs (n, 2p − 2, …), see `arcs`."""
        known = self._resultants(edges).values
        h, m = self.lengths(edges)[:, None], frame(edges)[0]
        force = known[:, :2].copy()
        known[:, 0] = (edges.tangent[:, :, None] * force).sum(axis=1) / h
        known[:, 1] = (m[:, :, None] * force).sum(axis=1) / h
        known[:, 2] /= h**2
        return np.asarray(from_corners(edges.bend, self.degree - 2) @ known)

    def _resultants(self, edges: Edges) -> EdgeFunctionals:
        """`resultants` on values of Φ, its slopes and N_k, Q_k as such."""
        found, sign, h = self._blank(edges, 2 * self.degree - 2)
        values = found.values
        for axis in (0, 1):
            values[:, axis, 1 + axis], values[:, axis, 4 + axis] = -1.0, 1.0
        values[:, 2, 0], values[:, 2, 3] = -1.0, 1.0
        values[:, 2, _FIRST] = values[:, 2, _SECOND] = -h[:, None] * edges.tangent / 2.0
        for kind, first in (("N", 2), ("Q", 1)):
            for k in range(first, self.degree - 1):
                place = self._place(kind, k)
                values[:, place - 3, place] = sign**k
        return found

    def _place(self, kind: str, k: int) -> int:
        """Where N_k, k ≥ 2, or Q_k, k ≥ 1, stands among the degrees of freedom of an edge and its ends."""
        return 6 + (k - 2 if kind == "N" else self.degree - 3 + k - 1)

    def _blank(self, edges: Edges, count: int) -> tuple[EdgeFunctionals, FloatArray, FloatArray]:
        """Functionals that are zero, whether edges run along their tangents (±1), and their lengths."""
        own = 3 * len(self.vertices) + self.element.on_edge * self.number(edges)[:, None]
        at_ends = [3 * ends[:, None] + np.arange(3) for ends in (edges.first, edges.second)]
        columns = np.hstack([*at_ends, own + np.arange(self.element.on_edge)])
        sign = np.where(edges.first < edges.second, 1.0, -1.0)
        values = np.zeros((len(edges), count, columns.shape[1]))
        return EdgeFunctionals(columns, values, self.size), sign, self.lengths(edges)

    def _scaled(self, edges: Edges, on_values: EdgeFunctionals) -> EdgeFunctionals:
        """Functionals on values of Φ, its slopes and N_k, Q_k as such on degrees of freedom."""
        values = on_values.values * self.units[on_values.columns][:, None]
        found = EdgeFunctionals(on_values.columns, values, self.size)
        found = self._framed(on_values, found) if self.frames.several else found
        return self._cut(edges, on_values, found) if len(self.cuts) else found

    def _cut(self, edges: Edges, on_values: EdgeFunctionals, found: EdgeFunctionals) -> EdgeFunctionals:
        """The same with three more columns an edge for every cut between its ends."""
        columns, values = self.cuts.on_edges(edges, on_values.values[:, :, 3:6], self.vertices)
        values = values * self.units[columns][:, None]
        return EdgeFunctionals(
            np.hstack([found.columns, columns]), np.concatenate([found.values, values], axis=2), self.size
        )

    def _framed(self, on_values: EdgeFunctionals, found: EdgeFunctionals) -> EdgeFunctionals:
        """The same with six more columns an edge, of the centres of its ends, which count on edges across parts."""
        frames, values, ends = self.frames, found.values, on_values.columns[:, [0, 3]] // 3
        across = frames.across(ends)
        more: FloatArray = np.zeros((*values.shape[:2], 6))
        for end in (0, 1):
            own = slice(3 * end, 3 * end + 3)
            values[:, :, own] *= ~frames.is_centre[ends[:, end], None, None]
            more[across, :, own] = on_values.values[across, :, own] @ frames.affine(ends[across, end])
        columns = np.hstack([found.columns, frames.columns(ends[:, 0]), frames.columns(ends[:, 1])])
        return EdgeFunctionals(columns, np.concatenate([values, more], axis=2), self.size)


def frame(edges: Edges) -> tuple[FloatArray, FloatArray]:
    """The normal m = (−t_y, t_x) left of the tangents of edges (n, 2), and −n·m (n,), the factor of Φ_tm in σ_T."""
    m = np.column_stack([-edges.tangent[:, 1], edges.tangent[:, 0]])
    return m, -np.sign((edges.normal * m).sum(axis=1))
