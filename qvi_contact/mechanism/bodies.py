"""What can move as a rigid body: the blocks that joints separate, and plates driven by force; the work loads do on it.

The motion of body k is u(x) = (a − θ (y − y_k)/r_k,  b + θ (x − x_k)/r_k): its three numbers have one unit, and r_k is
the distance of its farthest point from (x_k, y_k). The body force b = −∇φ does the work −∮ φ n·u ds on it, around each
block. A fluid in a contact presses on both sides, and does the work −∫ p_w [v]_N ds there; what the contact law limits
is the rest, σ_N' = σ_N + p_w. Integrals are those that stresses take of the same data.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, IntArray
from qvi_contact.mesh.edges import Edges, linked, vectors_along
from qvi_contact.problem.conditions import LOCAL, Contact, Traction, components
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
            plate, edges = contact.plate, mesh.edges(contact.edges)
            assert plate is not None
            ends = mesh.vertices[np.concatenate([edges.first, edges.second])]
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
    first, second = whole_edges(problem).cells.T
    return linked(first, second, problem.mesh.cell_count)


def whole_edges(problem: ContactProblem) -> Edges:
    """Edges inside the body but those of joints that are not tied."""
    cut = np.zeros(len(problem.mesh.interior), dtype=bool)
    for joint in problem.joints:
        cut[problem.mesh.joint_set(joint.edges)] |= joint.law != "tied"
    return problem.mesh.interior.take(~cut)


@dataclass(frozen=True, eq=False)
class Work:
    """What one load does on motions."""

    row: FloatArray  # (3 k,): work [stress × length] of the motions of all bodies: forces, and moments over r_k
    # the largest work that the load could do on motions of size 1 if nothing of it cancelled [stress × length]
    size: float


def works(problem: ContactProblem, bodies: Bodies) -> dict[str, Work]:
    """Works of tractions, plates, body force and fluids by the names a limit analysis gives them."""
    rows, sizes = dict[str, FloatArray](), dict[str, float]()
    for name, row, size in _parts(problem, bodies):
        rows[name], sizes[name] = rows.get(name, 0.0) + row, sizes.get(name, 0.0) + size
    return {name: Work(np.where(np.abs(row) > _ROUNDING * sizes[name], row, 0.0), sizes[name])
            for name, row in rows.items()}  # fmt: skip


def _parts(problem: ContactProblem, bodies: Bodies) -> Iterator[tuple[str, FloatArray, float]]:
    """Parts of what each load does: its name, row and size of the work."""
    mesh, along = problem.mesh, partial(_along, problem, bodies)
    for condition in problem.conditions:
        if isinstance(condition, Traction):
            edges = mesh.edges(condition.edges)
            block = bodies.of_cells[edges.cells[:, 0]]
            for key, value in components(condition).items():
                direction, turns = direction_of(key, edges), key in LOCAL
                yield condition.name, *along(edges, block, direction, f"Traction.{key}", value, turns=turns)
        elif isinstance(condition, Contact) and condition.plate is not None:
            body, plate = bodies.number(condition), condition.plate
            moment = 0.0 if plate.moment is None else plate.moment_about(*bodies.centre[body]) / bodies.size[body]
            row = np.zeros((len(bodies), 3))
            row[body] = plate.force_x or 0.0, plate.force_y or 0.0, moment
            yield condition.name, row.ravel(), float(np.abs(row).sum())
    block, boundary = bodies.of_cells[mesh.interior.cells], mesh.boundary
    apart = np.flatnonzero(block[:, 0] != block[:, 1])  # of edges inside the body only those between two blocks count
    joints, (lower, upper) = mesh.interior.take(apart), block[apart].T
    for name, field in problem.body_forces.items():
        if callable(field):  # else no force
            datum = "ContactProblem.body_potential", field
            yield name, *along(boundary, bodies.of_cells[boundary.cells[:, 0]], -boundary.normal, *datum)
            yield name, *along(joints, lower, -joints.normal, *datum)
            yield name, *along(joints, upper, joints.normal, *datum)
    for contact in problem.contacts:
        if contact.has_fluid:  # −∫ p_w n·v ds on the first body, and the opposite on the second, or on the plate
            edges, pressure = mesh.edges(contact.edges), ("Contact.pore_pressure", contact.pore_pressure)
            beyond = np.full(len(edges), bodies.number(contact))
            second = bodies.of_cells[edges.cells[:, 1]] if contact in problem.joints else beyond
            yield FLUID, *along(edges, bodies.of_cells[edges.cells[:, 0]], -edges.normal, *pressure)
            yield FLUID, *along(edges, second, edges.normal, *pressure)


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
) -> tuple[FloatArray, float]:
    """∫ f d·u ds of a field f on edges whose blocks are (n,), along d (n, 2), which turns along arcs or does not."""
    found = along_edges(problem.mesh, edges, name, field)
    parts, weights = edges.take(found.edge), found.values * found.weights * edges.length[found.edge, None]
    along = vectors_along(parts, direction[found.edge], found.t, turns=turns)
    arms = np.stack(problem.mesh.points_along(parts, found.t), axis=-1) - bodies.centre[block[found.edge], None]
    turning = (arms[..., 0] * along[..., 1] - arms[..., 1] * along[..., 0]) / bodies.size[block[found.edge], None]
    work = (np.concatenate([along, turning[..., None]], axis=-1) * weights[..., None]).sum(axis=1)
    row, known = np.zeros((len(bodies), 3)), block[found.edge] >= 0
    np.add.at(row, block[found.edge][known], work[known])
    return row.ravel(), float(np.abs(weights).sum())
