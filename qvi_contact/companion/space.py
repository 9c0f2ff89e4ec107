"""The displacement space: Bernstein elements on the cells of the body, cut open along the joints.

A vertex on a joint belongs to each block that meets there: corners of cells are one vertex if they hang together over
edges that are not joints. Degree of freedom 2 k + c is component c of coefficient k.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.companion.curved import CurvedCells
from qvi_contact.companion.triangle import Triangle
from qvi_contact.mesh.edges import Edges
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.problem import ContactProblem


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
