"""The displacement space: Bernstein elements on the cells of the body, cut open along the joints.

A vertex on a joint belongs to each block that meets there: corners of cells are one vertex if they hang together over
edges that are not joints. Degree of freedom 2 k + c is component c of coefficient k.

Cells of the displacement model with sides that are arcs: a smooth map from the straight triangle.

With the barycentric coordinates λ of the reference triangle, corners X and the arc γ of a side from corner a to b,

    x(λ) = Σ λ_i X_i + Σ_sides λ_a λ_b q(λ_b − λ_a),   τ (1 − τ) q(2τ − 1) = γ(τ) − (1 − τ) X_a − τ X_b

which is γ on the side, the straight line on the others, and smooth, so that displacements that are polynomials of λ are
of full order. Neighbours agree on every side. q is a polynomial that differs from its definition by rounding.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.polynomial.legendre import legder, leggauss, legvander
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.companion.triangle import Triangle, barycentric
from qvi_contact.mesh.arcs import arc_offsets
from qvi_contact.mesh.edges import Edges
from qvi_contact.mesh.topology import OPPOSITE
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.problem import ContactProblem

_TERMS: Final = 12  # of q beside the coefficients of bends: its digits on an arc that turns by 90°
_STEPS: Final = 8  # of Newton's method for the inverse of the map; each doubles the digits
_SLOPES: Final = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])  # of λ = (1 − t₁ − t₂, t₁, t₂)


@dataclass(frozen=True, eq=False)
class CurvedCells:
    """What arcs add to the triangles of a mesh that have some; dimensionless.

    Attributes
    ----------
    numbers : (c,) int array
        The cells.
    corners : (c, 3, 2) array
        Their corners.
    bends : (c, 3, k) array
        How their sides bend, see `TriangleMesh.sides`.

    """

    numbers: IntArray
    corners: FloatArray
    bends: FloatArray

    @classmethod
    def of(cls, mesh: TriangleMesh, length: float) -> "CurvedCells":
        """Those of a mesh, whose lengths are divided by `length`."""
        bends = mesh.sides
        numbers = np.flatnonzero(bends.any(axis=(1, 2)))
        corners = (mesh.vertices[mesh.cells[numbers]] - mesh.origin) / length
        return cls(numbers, corners, bends[numbers])

    def __len__(self) -> int:
        return len(self.numbers)

    def among(self, cells: IntArray | slice, count: int) -> tuple[IntArray, IntArray]:
        """Places in `cells`, of so many cells, that have arcs, and which of these they are."""
        chosen = np.arange(count)[cells]
        place = np.full(count, -1)
        place[self.numbers] = np.arange(len(self))
        at = np.flatnonzero(place[chosen] >= 0)
        return at, place[chosen][at]

    @cached_property
    def _bulges(self) -> FloatArray:
        """Coefficients of Legendre of q of all sides, (3, c, terms, 2)."""
        terms = _TERMS + self.bends.shape[2]
        nodes, weights = leggauss(terms)
        t = (1.0 + nodes) / 2.0
        project = (np.arange(terms) + 0.5)[:, None] * (legvander(nodes, terms - 1) * weights[:, None]).T
        found = np.zeros((3, len(self), terms, 2))
        for s, (a, b) in enumerate(OPPOSITE):
            chord = self.corners[:, b] - self.corners[:, a]
            bulge = arc_offsets(chord, self.bends[:, s], t) - t[:, None] * chord[:, None]
            found[s] = project @ (bulge / (t * (1.0 - t))[:, None])
        return found

    def points(self, which: IntArray, t: FloatArray) -> FloatArray:
        """Points (k, q, 2) at reference points t, (q, 2) or (k, q, 2), of some of the cells (k,)."""
        barycentric = _barycentric(t, len(which))
        found = barycentric @ self.corners[which]
        for s, (a, b) in enumerate(OPPOSITE):
            bent = self._bent(which, s)
            first, second = barycentric[bent, :, a], barycentric[bent, :, b]
            found[bent] += (first * second)[..., None] * _sum(self._bulges[s, which[bent]], second - first)
        return np.asarray(found)

    def jacobians(self, which: IntArray, t: FloatArray) -> FloatArray:
        """∂x_b/∂t_a as [cell, point, b, a], shape (k, q, 2, 2)."""
        barycentric = _barycentric(t, len(which))
        found = np.broadcast_to(
            (self.corners[which].swapaxes(1, 2) @ _SLOPES)[:, None], (*barycentric.shape[:2], 2, 2)
        ).copy()
        for s, (a, b) in enumerate(OPPOSITE):
            bent = self._bent(which, s)
            first, second = barycentric[bent, :, a], barycentric[bent, :, b]
            q = self._bulges[s, which[bent]]
            product = first[..., None] * _SLOPES[b] + second[..., None] * _SLOPES[a]
            slope = (first * second)[..., None] * _sum(legder(q, axis=1), second - first)
            found[bent] += _sum(q, second - first)[..., None] * product[..., None, :]
            found[bent] += slope[..., None] * (_SLOPES[b] - _SLOPES[a])
        return np.asarray(found)

    def _bent(self, which: IntArray, side: int) -> IntArray:
        """Places in `which` of the cells whose side of this number is an arc: mostly one of three is."""
        return np.flatnonzero(self.bends[which, side].any(axis=1))

    def own(self, mesh: TriangleMesh, which: IntArray, t: FloatArray) -> FloatArray:
        """Reference points t (k, q, 2) of this map from those (k, q, 2) of the mesh."""
        placed = mesh.placed(self.numbers[which], _barycentric(t, len(which)))
        return self.reference(which, placed @ self.corners[which])

    def reference(self, which: IntArray, points: FloatArray) -> FloatArray:
        """Reference points t (k, q, 2) of points (k, q, 2) in some of the cells (k,)."""
        corners = self.corners[which]
        straight = np.linalg.inv(corners.swapaxes(1, 2) @ _SLOPES)
        t = (points - corners[:, :1]) @ straight.swapaxes(1, 2)
        for _ in range(_STEPS):
            miss = points - self.points(which, t)
            t = t + np.linalg.solve(self.jacobians(which, t), miss[..., None])[..., 0]
        return np.asarray(t)


def _barycentric(t: FloatArray, count: int) -> FloatArray:
    return barycentric(np.broadcast_to(t, (count, *np.shape(t)[-2:])))


def _sum(coefficients: FloatArray, at: FloatArray) -> FloatArray:
    """Σ c_k P_k of coefficients (n, terms, 2) at places (n, q), shape (n, q, 2)."""
    return np.asarray(legvander(at, coefficients.shape[1] - 1) @ coefficients)


@dataclass(frozen=True, eq=False)
class Space:
    """Displacements of degree p on the cells of a mesh; lengths divided by L, places relative to the mesh's origin.

    Attributes
    ----------
    mesh : TriangleMesh
        The mesh.
    cell : Triangle
        The reference triangle, with n coefficients.
    origins : (cells, 2) array
        Where the first corner of each cell lies.
    frames : (cells, 2, 2) array
        Its axes as columns: a reference point t lies at origin + frame t.
    table : (cells, n) int array
        Coefficients of a scalar field on each cell.
    block : (cells,) int array
        Number of the block each cell belongs to; blocks are separated by joints.
    curved : CurvedCells
        Cells with sides that are arcs.

    """

    mesh: TriangleMesh
    cell: Triangle
    origins: FloatArray
    frames: FloatArray
    table: IntArray
    block: IntArray
    curved: CurvedCells

    @classmethod
    def of(cls, problem: ContactProblem, cell: Triangle, length: float) -> "Space":
        """The space of a problem."""
        mesh = problem.mesh
        corners = mesh.vertices[mesh.cells]
        first, along, across = corners.swapaxes(0, 1)
        frames = np.stack([along - first, across - first], axis=-1) / length
        vertices, block = _vertices(problem)
        origins = (first - mesh.origin) / length
        curved = CurvedCells.of(mesh, length)
        return cls(mesh, cell, origins, frames, cell.table(vertices), block, curved)

    @property
    def degree(self) -> int:
        """The degree p."""
        return self.cell.degree

    @property
    def size(self) -> int:
        """Number of degrees of freedom, both components."""
        return 2 * (int(self.table.max()) + 1)

    @cached_property
    def slopes(self) -> FloatArray:
        """Gradients of the reference coordinates, ∂t_a/∂x_b as [cell, a, b]."""
        return np.asarray(np.linalg.inv(self.frames), dtype=np.float64)

    @cached_property
    def areas(self) -> FloatArray:
        """Of a cell to that of the reference cell (cells,)."""
        return np.asarray(np.abs(np.linalg.det(self.frames)))

    @property
    def dofs(self) -> IntArray:
        """Degrees of freedom of displacements of the cells (cells, 2 n)."""
        return np.asarray(2 * self.table[:, :, None] + np.arange(2)).reshape(len(self.table), -1)

    def assembled(self, blocks: FloatArray) -> sparse.csr_array:
        """The sum (size, size) of matrices of the cells (cells, 2 n, 2 n)."""
        dofs = self.dofs
        rows, columns = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
        found = sparse.coo_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(self.size, self.size))
        return sparse.csr_array(found.tocsr())

    def points(self, cells: IntArray | slice, t: FloatArray) -> FloatArray:
        """Coordinates of reference points (k, 2), or (cells, k, 2), in cells, shape (cells, k, 2)."""
        found = np.asarray(self.origins[cells][:, None] + t @ self.frames[cells].swapaxes(1, 2))
        if len(self.curved):
            at, which = self.curved.among(cells, len(self.table))
            found[at] = self.curved.points(which, t if np.ndim(t) == 2 else t[at])
        return found

    def own(self, cells: IntArray | slice, t: FloatArray) -> FloatArray:
        """Reference points of this space from those of the mesh, (k, 2) or (cells, k, 2), which differ beside arcs."""
        at, which = self.curved.among(cells, len(self.table))
        if not len(at):
            return t
        found = np.array(np.broadcast_to(t, (len(np.arange(len(self.table))[cells]), *np.shape(t)[-2:])))
        found[at] = self.curved.own(self.mesh, which, found[at])
        return found

    def measures(self, t: FloatArray, weights: FloatArray) -> FloatArray:
        """Weights (cells, q) of areas from those on the reference cell (q,), at its points t (q, 2)."""
        found = self.areas[:, None] * weights
        if len(self.curved):
            every = np.arange(len(self.curved))
            found[self.curved.numbers] = np.abs(np.linalg.det(self.curved.jacobians(every, t))) * weights
        return np.asarray(found)

    @cached_property
    def places(self) -> FloatArray:
        """Where each coefficient sits, shape (size / 2, 2): coefficients of a linear function are its values there."""
        found = np.empty((self.size // 2, 2))
        found[self.table] = self.points(slice(None), self.cell.places)
        return found

    @cached_property
    def owner(self) -> IntArray:
        """Block of each coefficient (size / 2,)."""
        found = np.empty(self.size // 2, dtype=np.int64)
        found[self.table] = self.block[:, None]
        return found

    def along(self, edges: Edges, *, other: bool = False) -> IntArray:
        """Coefficients on edges (e, p + 1), along the tangent; with `other` those of the cell beyond an edge inside."""
        cells = edges.cells[:, int(other)]
        first, second = (_corner(self.mesh, cells, vertices) for vertices in (edges.first, edges.second))
        return self.table[cells[:, None], self.cell.sides[first, second]]

    def rigid(self) -> FloatArray:
        """Rigid motions of every block, shape (size, 3 blocks): along x, along y, turning about its middle."""
        blocks = int(self.block.max()) + 1
        found = np.zeros((self.size // 2, 2, blocks, 3))
        for block in range(blocks):
            mine = np.flatnonzero(self.owner == block)
            x, y = (self.places[mine] - self.places[mine].mean(axis=0)).T
            found[mine, 0, block, 0] = found[mine, 1, block, 1] = 1.0
            found[mine, 0, block, 2], found[mine, 1, block, 2] = -y, x
        return found.reshape(self.size, 3 * blocks)


def _corner(mesh: TriangleMesh, cells: IntArray, vertices: IntArray) -> IntArray:
    """Which corner of each cell (e,) a vertex (e,) is."""
    return np.asarray(np.argmax(mesh.cells[cells] == vertices[:, None], axis=1))


def _vertices(problem: ContactProblem) -> tuple[IntArray, IntArray]:
    """Vertex of each corner of each cell (cells, 3), and the cells' blocks.

    Vertices of the mesh come in its order, those that joints divide one after the other.
    """
    mesh = problem.mesh
    whole = np.ones(len(mesh.interior), dtype=bool)
    for joint in problem.joints:
        whole[mesh.joint_set(joint.edges)] = False
    edges = mesh.interior.take(whole)
    near, far = edges.cells.T
    count = len(mesh.cells)
    pairs = [
        (3 * near + _corner(mesh, near, end), 3 * far + _corner(mesh, far, end)) for end in (edges.first, edges.second)
    ]
    first, second = (np.concatenate(part) for part in zip(*pairs, strict=True))
    parts = _components(first, second, 3 * count)
    _, vertex = np.unique(np.stack([mesh.cells.ravel(), parts]), axis=1, return_inverse=True)
    return vertex.reshape(count, 3), _components(near, far, count)


def _components(first: IntArray, second: IntArray, count: int) -> IntArray:
    """Connected component of each of `count` things, joined in pairs."""
    graph = sparse.csr_array((np.ones(len(first)), (first, second)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
