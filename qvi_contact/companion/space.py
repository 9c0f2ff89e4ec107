"""The displacement space: Bernstein elements on the body's grid, cut open along the joints.

A vertex on a joint belongs to each block that meets there: corners of cells are one vertex if they hang together over
edges that are not joints. Degree of freedom 2 k + c is component c of coefficient k.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from skfem import MeshQuad  # type: ignore[import-untyped]
from skfem.assembly import Dofs  # type: ignore[import-untyped]

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.companion.element import BernsteinQuad, lattice
from qvi_contact.mesh.rectilinear import HORIZONTAL, GridEdges, RectilinearMesh
from qvi_contact.problem.problem import ContactProblem


@dataclass(frozen=True, eq=False)
class Space:
    """Displacements of degree p on the cells of a mesh; lengths divided by L.

    Attributes
    ----------
    mesh : RectilinearMesh
        The grid.
    degree : int
        p.
    sizes : (cells, 2) array
        Width and height of the active cells, row by row, over L.
    corners : (cells, 2) array
        Their lower left corners, relative to that of the grid, over L.
    table : (cells, p + 1, p + 1) int array
        Coefficient of a scalar field at [cell, along y, along x].
    block : (cells,) int array
        Number of the block each cell belongs to; blocks are separated by joints.

    """

    mesh: RectilinearMesh
    degree: int
    sizes: FloatArray
    corners: FloatArray
    table: IntArray
    block: IntArray

    @classmethod
    def of(cls, problem: ContactProblem, degree: int, length: float) -> "Space":
        """The space of a problem."""
        mesh = problem.grid
        row, column = np.nonzero(mesh.active)
        sizes = np.column_stack([np.diff(mesh.x)[column], np.diff(mesh.y)[row]]) / length
        corners = np.column_stack([mesh.x[column] - mesh.x[0], mesh.y[row] - mesh.y[0]]) / length
        vertex, block = _vertices(problem)
        x = np.empty((vertex.max() + 1, 2))
        for k, (right, top) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
            x[vertex[:, k]] = corners + sizes * np.array([right, top])
        topology = MeshQuad(np.ascontiguousarray(x.T), np.ascontiguousarray(vertex.T))
        numbers = Dofs(topology, BernsteinQuad(degree)).element_dofs
        table = np.asarray(numbers.T[:, lattice(degree)], dtype=np.int64)
        return cls(mesh, degree, sizes, corners, table, block)

    @property
    def size(self) -> int:
        """Number of degrees of freedom, both components."""
        return 2 * (int(self.table.max()) + 1)

    @cached_property
    def places(self) -> FloatArray:
        """Where each coefficient sits: the point (i, j)/p of its cell, shape (size / 2, 2), over L.

        The coefficients of a linear function are its values there.
        """
        found = np.empty((self.size // 2, 2))
        step = np.arange(self.degree + 1) / self.degree
        for axis, t in enumerate((step[None, None, :], step[None, :, None])):
            values = self.corners[:, axis, None, None] + self.sizes[:, axis, None, None] * t
            found[self.table, axis] = np.broadcast_to(values, self.table.shape)
        return found

    @cached_property
    def owner(self) -> IntArray:
        """Block of each coefficient (size / 2,)."""
        found = np.empty(self.size // 2, dtype=np.int64)
        found[self.table] = self.block[:, None, None]
        return found

    @cached_property
    def number(self) -> IntArray:
        """Number of each active cell, −1 elsewhere, shape (ny, nx)."""
        return np.where(self.mesh.active, np.cumsum(self.mesh.active.ravel()).reshape(self.mesh.shape) - 1, -1)

    def along(self, edges: GridEdges, *, other: bool = False) -> IntArray:
        """Coefficients on edges (e, p + 1), along +x or +y; with `other` those of the cell beyond an interior edge."""
        axis, row, column = edges.axis, edges.row.copy(), edges.column.copy()
        high = edges.sign > 0
        if other:
            row += axis == HORIZONTAL
            column += axis != HORIZONTAL
            high = ~high
        cells = self.table[self.number[row, column]]
        p, e = self.degree, np.arange(len(edges))
        last = np.where(high, p, 0)
        return np.where((axis == HORIZONTAL)[:, None], cells[e, last, :], cells[e, :, last])

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


def _vertices(problem: ContactProblem) -> tuple[IntArray, IntArray]:
    """Vertex of each corner of each cell (cells, 4), counterclockwise from the bottom left, and the cells' blocks."""
    mesh = problem.grid
    active = mesh.active
    number = np.where(active, np.cumsum(active.ravel()).reshape(active.shape) - 1, -1)
    whole = np.ones(len(mesh.interior), dtype=bool)
    for joint in problem.joints:
        whole[mesh.joint_set(joint.edges)] = False
    edges = mesh.interior.take(whole)
    flat = edges.axis == HORIZONTAL
    near = number[edges.row, edges.column]
    far = number[edges.row + flat, edges.column + ~flat]
    # Corners at the lower or left end of an edge, then at the other one, seen from both cells.
    ends = [(np.where(flat, 3, 1), np.where(flat, 0, 0)), (np.where(flat, 2, 2), np.where(flat, 1, 3))]
    pairs = [(4 * near + mine, 4 * far + theirs) for mine, theirs in ends]
    count = int(active.sum())
    first, second = (np.concatenate(part) for part in zip(*pairs, strict=True))
    vertex = _components(first, second, 4 * count).reshape(count, 4)
    return vertex, _components(near, far, count)


def _components(first: IntArray, second: IntArray, count: int) -> IntArray:
    """Connected component of each of `count` things, joined in pairs."""
    graph = sparse.csr_array((np.ones(len(first)), (first, second)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
