"""What can move as a rigid body: the blocks that joints separate, and plates driven by force; the work loads do on it.

The motion of body k is u(x) = (a − θ (y − y_k)/r_k,  b + θ (x − x_k)/r_k): its three numbers have one unit, and r_k is
the distance of its farthest point from (x_k, y_k). The body force b = −∇φ does the work −∮ φ n·u ds on it, around each
block. A fluid in a contact presses on both sides, and does the work −∫ p_w [v]_N ds there; what the contact law limits
is the rest, σ_N' = σ_N + p_w. Integrals are those that stresses take of the same data.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, IntArray
from qvi_contact.mesh.edges import Edges, vectors_along
from qvi_contact.problem.conditions import LOCAL, Contact, RigidPlate, Traction, components
from qvi_contact.problem.fields import along_edges
from qvi_contact.problem.problem import ContactProblem, direction_of

BODY = "body"
"""What the body force is called among the loads; of several, all of them together."""
FLUID = "pore pressure"
"""What the fluids in contacts are called among the loads."""
_ROUNDING = 1e-13  # share of a load's size below which a resultant is rounding


@dataclass(frozen=True, eq=False)
class Bodies:
    """Blocks, and after them the plates."""

    of_cells: IntArray  # (cells,): the block that each cell belongs to
    blocks: int  # number of blocks
    plates: tuple[str, ...]  # names of the contacts whose plates are driven by force
    centre: FloatArray  # (x_k, y_k), and r_k (k,) [length]
    size: FloatArray
    # (k, 3): which numbers of a motion may differ from zero: all of blocks, those of a plate that have a given force
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


@dataclass(frozen=True, eq=False)
class Work:
    """What one load does on motions."""

    row: FloatArray  # (3 k,): work [stress × length] of the motions of all bodies: forces, and moments over r_k
    # the largest work that the load could do on motions of size 1 if nothing of it cancelled [stress × length]
    size: float

    def __add__(self, other: "Work") -> "Work":
        return Work(self.row + other.row, self.size + other.size)


def works(problem: ContactProblem, bodies: Bodies) -> dict[str, Work]:
    """Works of tractions, plates, body force and fluids by the names a limit analysis gives them."""
    given, found = list[tuple[str, Work]](), dict[str, Work]()
    for condition in problem.conditions:
        if isinstance(condition, Traction):
            given.append((condition.name, _of_traction(problem, bodies, condition)))
        elif isinstance(condition, Contact) and condition.plate is not None:
            given.append((condition.name, _of_plate(bodies, condition)))
    forces = problem.body_forces.items()
    given += [(name, _of_body(problem, bodies, field)) for name, field in forces if callable(field)]  # else no force
    given += [(FLUID, _of_fluid(problem, bodies, contact)) for contact in problem.contacts if contact.has_fluid]
    for name, work in given:
        found[name] = found[name] + work if name in found else work
    return {name: Work(np.where(np.abs(work.row) > _ROUNDING * work.size, work.row, 0.0), work.size)
            for name, work in found.items()}  # fmt: skip


def _of_traction(problem: ContactProblem, bodies: Bodies, load: Traction) -> Work:
    mesh, total = problem.mesh, Work(np.zeros(3 * len(bodies)), 0.0)
    edges = mesh.edges(load.edges)
    block = bodies.of_cells[edges.cells[:, 0]]
    for name, value in components(load).items():
        given = f"Traction.{name}", value
        total = total + _along(problem, bodies, edges, block, direction_of(name, edges), *given, turns=name in LOCAL)
    return total


def _of_body(problem: ContactProblem, bodies: Bodies, field: Field) -> Work:
    """−∮ φ n·u ds around all blocks; of edges inside the body only those between two blocks count."""
    mesh = problem.mesh
    block = bodies.of_cells[mesh.interior.cells]
    apart = np.flatnonzero(block[:, 0] != block[:, 1])
    joints, boundary = mesh.interior.take(apart), mesh.boundary
    name = "ContactProblem.body_potential"
    outer = _along(problem, bodies, boundary, bodies.of_cells[boundary.cells[:, 0]], -boundary.normal, name, field)
    lower = _along(problem, bodies, joints, block[apart, 0], -joints.normal, name, field)
    return outer + lower + _along(problem, bodies, joints, block[apart, 1], joints.normal, name, field)


def _of_fluid(problem: ContactProblem, bodies: Bodies, contact: Contact) -> Work:
    """−∫ p_w n·v ds on the first body of a contact, and the opposite on the second body, or on the plate."""
    edges = problem.mesh.edges(contact.edges)
    first = bodies.of_cells[edges.cells[:, 0]]
    plate = np.full(len(edges), bodies.number(contact))
    second = bodies.of_cells[edges.cells[:, 1]] if contact in problem.joints else plate
    name, field = "Contact.pore_pressure", contact.pore_pressure
    pushed = _along(problem, bodies, edges, first, -edges.normal, name, field)
    return pushed + _along(problem, bodies, edges, second, edges.normal, name, field)


def _along(
    problem: ContactProblem,
    bodies: Bodies,
    edges: Edges,
    block: IntArray,
    direction: FloatArray,
    name: str,
    field: Field,
    *,
    turns: bool = True,
) -> Work:
    """∫ f d·u ds of a field f on edges whose blocks are (n,), along d (n, 2), which turns along arcs or does not."""
    mesh = problem.mesh
    found = along_edges(mesh, edges, name, field)
    size = np.abs(found.values * found.weights).sum(axis=1) @ edges.length[found.edge]
    at_ends = found.integrals(np.stack([1.0 - found.t, found.t], axis=-1)) * edges.length[:, None]
    row = np.zeros(3 * len(bodies))
    bent = edges.bent[found.edge]
    if bent.any():
        at_ends[edges.bent] = 0.0
        number, t = found.edge[bent], found.t[bent]
        arcs = edges.take(number)
        points = np.stack(mesh.points_along(arcs, t), axis=-1).reshape(-1, 2)
        along = vectors_along(arcs, direction[number], t, turns=turns)
        force = (found.values * found.weights)[bent] * edges.length[number, None]
        row += force.ravel() @ bodies.rows(np.repeat(block[number], t.shape[1]), points, along.reshape(-1, 2))
    for force, vertices in zip(at_ends.T, (edges.first, edges.second), strict=True):  # of the same force and moment
        row += force @ bodies.rows(block, mesh.vertices[vertices], direction)
    return Work(row, float(size))


def _of_plate(bodies: Bodies, contact: Contact) -> Work:
    body, plate = bodies.number(contact), plate_of(contact)
    centre, size = bodies.centre[body], float(bodies.size[body])
    moment = 0.0 if plate.moment is None else plate.moment_about(*centre) / size
    given = np.array([plate.force_x or 0.0, plate.force_y or 0.0, moment])
    row = np.zeros((len(bodies), 3))
    row[body] = given
    return Work(row.ravel(), float(np.abs(given).sum()))
