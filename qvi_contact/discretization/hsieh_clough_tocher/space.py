"""Degrees of freedom of Hsieh-Clough-Tocher elements on a mesh of triangles, and their tractions on edges.

Degrees of freedom are those of `element.hsieh_clough_tocher` in units that make the energies of all of them alike,

    Φ/s, Φ_x, Φ_y   at vertices, from three times the vertex's number on,
    h N_k, h Q_k    on edges, behind those of the vertices

with s the length of the shortest edge at the vertex and h the edge's own.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.hsieh_clough_tocher.condensed import Differences
from qvi_contact.element.affine import AffineTriangles
from qvi_contact.element.hsieh_clough_tocher import HsiehCloughTocher, hsieh_clough_tocher
from qvi_contact.mesh.edges import Edges
from qvi_contact.mesh.triangles import TriangleMesh

Entries: TypeAlias = Sequence[tuple[IntArray, IntArray, FloatArray]]
"""Entries of a matrix: rows, columns, values; what stands in one place is summed."""


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
        return 3 * len(self.vertices) + self.element.on_edge * len(self.mesh.topology.ends)

    @cached_property
    def vertices(self) -> FloatArray:
        """Dimensionless coordinates, shape (v, 2)."""
        return np.asarray((self.mesh.vertices - self.mesh.origin) / self.mesh.length)

    @cached_property
    def triangles(self) -> AffineTriangles:
        """The triangles, dimensionless."""
        return AffineTriangles(self.vertices[self.mesh.cells])

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
        corners = self.triangles.corners
        return Differences(corners[:, 1:] - corners[:, :1], self.dofs, self.units[self.dofs], self.size)

    @cached_property
    def sizes(self) -> FloatArray:
        """Length of the shortest edge at each vertex, dimensionless."""
        return np.asarray(self.mesh.finest / self.mesh.length)

    @cached_property
    def units(self) -> FloatArray:
        """Φ, its slopes, N_k or Q_k over the degree of freedom that stands for it, shape (N,)."""
        first, second = self.vertices[self.mesh.topology.ends].swapaxes(0, 1)
        at_vertices = np.column_stack([self.sizes, np.ones((len(self.sizes), 2))]).ravel()
        return np.concatenate([at_vertices, np.repeat(1.0 / np.hypot(*(second - first).T), self.element.on_edge)])

    def number(self, edges: Edges) -> IntArray:
        """Edges (n,) as `mesh.topology` counts them."""
        return self.mesh.topology.number(np.column_stack([edges.first, edges.second]), len(self.vertices))

    def lengths(self, edges: Edges) -> FloatArray:
        """Dimensionless lengths of edges (n,)."""
        return edges.length / self.mesh.length

    def on_edges(self, edges: Edges, kind: int, k: int) -> tuple[IntArray, FloatArray]:
        """Degree of freedom of N_k (kind 0) or Q_k (kind 1) on edges, and its factor ±1 along the tangent (n,)."""
        place = k - 2 if kind == 0 else self.degree - 3 + k - 1
        sign = np.where(edges.first < edges.second, 1.0, -1.0) ** k
        return 3 * len(self.vertices) + self.element.on_edge * self.number(edges) + place, sign

    def normal_coefficients(self, edges: Edges) -> sparse.csr_array:
        """Coefficients of Legendre of σ_N without φ along edges, shape (n (p − 1), N)."""
        h, t = self.lengths(edges), edges.tangent
        a, b, row = 3 * edges.first, 3 * edges.second, (self.degree - 1) * np.arange(len(edges))
        entries = []
        for axis in (0, 1):
            slope = t[:, axis] / h
            entries += [(row, b + 1 + axis, slope), (row, a + 1 + axis, -slope)]
            entries += [(row + 1, b + 1 + axis, 3.0 * slope), (row + 1, a + 1 + axis, 3.0 * slope)]
        entries += [(row + 1, b, -6.0 / h**2), (row + 1, a, 6.0 / h**2)]
        entries += [(row + k, *self.on_edges(edges, 0, k)) for k in range(2, self.degree - 1)]
        return self.rows(entries, len(edges) * (self.degree - 1))

    def shear_coefficients(self, edges: Edges) -> sparse.csr_array:
        """Coefficients of Legendre of σ_T along edges, shape (n (p − 1), N)."""
        h = self.lengths(edges)
        m, factor = frame(edges)
        a, b, row = 3 * edges.first, 3 * edges.second, (self.degree - 1) * np.arange(len(edges))
        entries = []
        for axis in (0, 1):
            slope = factor * m[:, axis] / h
            entries += [(row, b + 1 + axis, slope), (row, a + 1 + axis, -slope)]
        for k in range(1, self.degree - 1):
            dof, sign = self.on_edges(edges, 1, k)
            entries.append((row + k, dof, factor * sign))
        return self.rows(entries, len(edges) * (self.degree - 1))

    def rows(self, entries: Entries, count: int) -> sparse.csr_array:
        """Rows on values of Φ and its derivatives as rows on degrees of freedom; zeros are left out."""
        rows, columns, data = (np.concatenate([part[i] for part in entries]) for i in range(3))
        kept = data != 0.0
        rows, columns, data = rows[kept], columns[kept], (data * self.units[columns])[kept]
        return sparse.csr_array(sparse.coo_array((data, (rows, columns)), shape=(count, self.size)))


def frame(edges: Edges) -> tuple[FloatArray, FloatArray]:
    """The normal m = (−t_y, t_x) left of the tangents of edges (n, 2), and −n·m (n,), the factor of Φ_tm in σ_T."""
    m = np.column_stack([-edges.tangent[:, 1], edges.tangent[:, 0]])
    return m, -np.sign((edges.normal * m).sum(axis=1))


def edgewise(map_: FloatArray, coefficients: sparse.csr_array) -> sparse.csr_array:
    """A map (q, j) of the j rows of each edge."""
    edges = coefficients.shape[0] // map_.shape[1]
    return sparse.csr_array(sparse.kron(sparse.eye_array(edges), map_, format="csr") @ coefficients)
