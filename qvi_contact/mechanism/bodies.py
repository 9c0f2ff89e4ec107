"""What can move as a rigid body: the blocks that joints separate, and plates driven by force.

The motion of body k is u(x) = (a − θ (y − y_k)/r_k,  b + θ (x − x_k)/r_k): its three numbers have one unit, and r_k is
the distance of its farthest point from (x_k, y_k).
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.mesh.edges import Edges
from qvi_contact.problem.conditions import Contact, RigidPlate
from qvi_contact.problem.problem import ContactProblem


@dataclass(frozen=True, eq=False)
class Bodies:
    """Blocks, and after them the plates.

    Attributes
    ----------
    of_cells : (cells,) int array
        The block that each cell belongs to.
    blocks : int
        Number of blocks.
    plates : tuple of str
        Names of the contacts whose plates are driven by force.
    centre, size : (k, 2) and (k,) arrays
        (x_k, y_k) and r_k [length].
    free : (k, 3) bool array
        Which numbers of a motion may differ from zero: all of blocks, those of a plate that have a given force.

    """

    of_cells: IntArray
    blocks: int
    plates: tuple[str, ...]
    centre: FloatArray
    size: FloatArray
    free: BoolArray

    def __len__(self) -> int:
        return len(self.size)

    @classmethod
    def of(cls, problem: ContactProblem) -> "Bodies":
        """The bodies of a problem."""
        mesh, of_cells = problem.mesh, blocks_of_cells(problem)
        blocks = int(of_cells.max()) + 1
        centre, size, free = [], [], [np.ones(3, dtype=bool)] * blocks
        for block in range(blocks):
            corners = mesh.vertices[np.unique(mesh.cells[of_cells == block])]
            centre.append((corners.min(axis=0) + corners.max(axis=0)) / 2.0)
            size.append(np.hypot(*(corners - centre[-1]).T).max())
        driven = [contact for contact in problem.contacts if contact.plate is not None]
        for contact in driven:
            plate = plate_of(contact)
            ends = _ends(problem, contact)
            centre.append(np.array(plate.reference(*ends.mean(axis=0))))
            size.append(np.hypot(*(ends - centre[-1]).T).max())
            free.append(np.array([part is not None for part in (plate.force_x, plate.force_y, plate.moment)]))
        names = tuple(contact.name for contact in driven)
        return cls(of_cells, blocks, names, np.array(centre), np.array(size), np.array(free))

    def rows(self, body: IntArray, points: FloatArray, direction: FloatArray) -> FloatArray:
        """Rows (n, 3 k) of the velocities d·u of bodies (n,) at points (n, 2) along d (n, 2); zero for body −1."""
        found = np.zeros((len(body), len(self), 3))
        known = np.flatnonzero(body >= 0)
        at = body[known]
        arm, along = points[known] - self.centre[at], direction[known]
        turn = (arm[:, 0] * along[:, 1] - arm[:, 1] * along[:, 0]) / self.size[at]
        found[known, at] = np.column_stack([along, turn])
        return found.reshape(len(body), 3 * len(self))

    def number(self, contact: Contact) -> int:
        """The body that drives the obstacle of a contact; −1 for one that stands still."""
        return self.blocks + self.plates.index(contact.name) if contact.name in self.plates else -1


def plate_of(contact: Contact) -> RigidPlate:
    """The plate of a contact that has one."""
    assert contact.plate is not None
    return contact.plate


def _ends(problem: ContactProblem, contact: Contact) -> FloatArray:
    """Both ends of all edges of a contact (2 n, 2) [length]."""
    edges = problem.mesh.edges(contact.edges)
    return np.asarray(problem.mesh.vertices[np.concatenate([edges.first, edges.second])])


def enclosed_beyond(problem: ContactProblem, edges: Edges) -> BoolArray:
    """On which edges (n,) of a joint the block that the joint goes around is the one beyond, as on half of a circle.

    Joints that have one block below or to the left of them everywhere go around none.
    """
    bodies = Bodies.of(problem)
    first, second = bodies.of_cells[edges.cells].T
    found = np.zeros(len(edges), dtype=bool)
    for low, high in np.unique(np.sort(np.stack([first, second], axis=1), axis=1), axis=0).tolist():
        pair = (first == low) & (second == high), (first == high) & (second == low)
        if low != high and pair[0].any() and pair[1].any():
            found |= pair[0] if bodies.size[high] < bodies.size[low] else pair[1]
    return found


def blocks_of_cells(problem: ContactProblem) -> IntArray:
    """The block (cells,) of each cell: cells hang together across all edges but those of joints that are not tied."""
    mesh, cut = problem.mesh, np.zeros(len(problem.mesh.interior), dtype=bool)
    for joint in problem.joints:
        if joint.law != "tied":
            cut[mesh.joint_set(joint.edges)] = True
    first, second = mesh.interior.cells[~cut].T
    shape = (mesh.cell_count, mesh.cell_count)
    graph = sparse.csr_array((np.ones(len(first)), (first, second)), shape=shape)
    _, label = sparse.csgraph.connected_components(graph, directed=False)
    return np.asarray(label, dtype=np.int64)
