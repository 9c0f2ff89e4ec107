"""The work that loads do on rigid motions, with the integrals that stresses take of the same data.

The body force b = −∇φ does the work −∮ φ n·u ds on a rigid motion, around each block. A fluid in a contact presses on
both sides, and does the work −∫ p_w [v]_N ds there; what the contact law limits is the rest, σ_N' = σ_N + p_w.
"""

from dataclasses import dataclass

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, IntArray
from qvi_contact.mechanism.bodies import Bodies, plate_of
from qvi_contact.mesh.edges import Edges, vectors_along
from qvi_contact.problem.conditions import LOCAL, Contact, Traction, components
from qvi_contact.problem.integrals import along_edges
from qvi_contact.problem.problem import ContactProblem, direction_of

BODY = "body"
"""What the body force is called among the loads; of several, all of them together."""

FLUID = "pore pressure"
"""What the fluids in contacts are called among the loads."""

_ROUNDING = 1e-13  # share of a load's size below which a resultant is rounding


@dataclass(frozen=True, eq=False)
class Work:
    """What one load does on motions.

    Attributes
    ----------
    row : (3 k,) array
        Work [stress × length] of the motions of all bodies: forces, and moments over r_k.
    size : float
        The largest work that the load could do on motions of size 1 if nothing of it cancelled [stress × length].

    """

    row: FloatArray
    size: float

    def __add__(self, other: "Work") -> "Work":
        return Work(self.row + other.row, self.size + other.size)


def works(problem: ContactProblem, bodies: Bodies) -> dict[str, Work]:
    """Works of tractions, plates, body force and fluids by the names a limit analysis gives them."""
    found: dict[str, Work] = {}
    for condition in problem.conditions:
        work = None
        if isinstance(condition, Traction):
            work = _of_traction(problem, bodies, condition)
        elif isinstance(condition, Contact) and condition.plate is not None:
            work = _of_plate(bodies, condition)
        if work is not None and isinstance(condition, (Traction, Contact)):
            found[condition.name] = found[condition.name] + work if condition.name in found else work
    for name, potential in problem.body_forces.items():
        if callable(potential):  # a constant one is no force
            work = _of_body(problem, bodies, potential)
            found[name] = found[name] + work if name in found else work
    wet = [_of_fluid(problem, bodies, contact) for contact in problem.contacts if contact.has_fluid]
    for work in wet:
        found[FLUID] = found[FLUID] + work if FLUID in found else work
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
