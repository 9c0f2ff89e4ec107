"""The bodies that joints part, each as a problem of its own: to it the others are rigid obstacles.

An operator S of (D26) that takes the displacements of each body to the same body is one of the whole: on a joint, with
n and t of the joint on both sides, [Sv]_N = (S₁v₁)_N − (S₂v₂)_N = σμ [v]_T. Its norm is the largest of those of the
bodies.

In `docs/theory.md`: (D26).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np

from qvi_contact.basics.checks import IntArray
from qvi_contact.errors import InputError
from qvi_contact.mechanism.bodies import blocks_of_cells
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import Contact
from qvi_contact.problem.problem import ContactProblem


@dataclass(frozen=True, eq=False)
class Body:
    """A body alone.

    Attributes
    ----------
    problem : ContactProblem
        Its mesh and the conditions on its edges.
    beyond : mapping
        By contact that is a joint seen from the side its normal points to: the joint's name.

    """

    problem: ContactProblem
    beyond: Mapping[str, str]

    def edges_of(self, whole: ContactProblem, name: str) -> tuple[str, IntArray]:
        """The contact of the whole problem that one of its contacts is, and which of the edges there its own are."""
        joint = self.beyond.get(name, name)
        near, far = (
            problem.mesh.edges(next(each.edges for each in problem.contacts if each.name == known))
            for problem, known in ((self.problem, name), (whole, joint))
        )
        places = {
            tuple(place): number
            for number, place in enumerate(
                whole.mesh.vertices[np.column_stack([far.first, far.second])].reshape(-1, 4).tolist()
            )
        }
        own = self.problem.mesh.vertices[np.column_stack([near.first, near.second])].reshape(-1, 4)
        return joint, np.array([places[tuple(place)] for place in own.tolist()], dtype=np.int64)


def bodies_of(problem: ContactProblem) -> tuple[Body, ...]:
    """Each body alone, a joint that parts it from another one being a contact with an obstacle; tied joints part none.

    The same problem gives the same bodies again, with what they have computed.

    Raises
    ------
    InputError
        If a joint that is not tied has the same body on both sides, or a body is no mesh of its own.

    """
    joints = tuple(joint for joint in problem.joints if joint.law != "tied")
    if not joints:
        outside = [each for each in problem.conditions if each not in problem.joints]
        return (Body(replace(problem, conditions=outside) if problem.joints else problem, {}),)
    found = _PARTED.get(problem)
    if found is None:
        found = _PARTED[problem] = _parted(problem, joints)
    return found


_PARTED: WeakKeyDictionary[ContactProblem, tuple[Body, ...]] = WeakKeyDictionary()
"""What problems have been parted into, as long as these are there: one bracket asks for the bodies three times."""


def _parted(problem: ContactProblem, joints: tuple[Contact, ...]) -> tuple[Body, ...]:
    """The bodies on both sides of joints that are not tied."""
    body = blocks_of_cells(problem)
    for joint in joints:
        near, far = problem.mesh.edges(joint.edges).cells.T
        if (body[near] == body[far]).any():
            raise InputError("Contact.edges", joint.name, "has one body on both sides: let it part two bodies")
    return tuple(_alone(problem, np.flatnonzero(body == number), joints) for number in range(int(body.max()) + 1))


def _alone(problem: ContactProblem, cells: IntArray, joints: tuple[Contact, ...]) -> Body:
    """One body with the conditions on its edges; what a tied joint bonds is one body."""
    assert isinstance(problem.mesh, TriangleMesh)
    sets, beyond, contacts = dict(problem.mesh.edge_sets), {}, []
    for joint in joints:
        edges, other = problem.mesh.edges(joint.edges), f"{joint.name}, beyond"
        ends = np.column_stack([edges.first, edges.second])
        del sets[joint.edges]
        for side, name in enumerate((joint.name, other)):
            here = np.isin(edges.cells[:, side], cells)
            if here.any():
                sets[name] = ends[here]
                contacts.append(replace(joint, edges=name, name=name))
        if other in sets:
            beyond[other] = joint.name
    mesh = problem.mesh.part(cells, sets)
    kept = [each for each in problem.conditions if each not in problem.joints and each.edges in mesh.edge_sets]
    regions = [each for each in problem.regions if each.name in mesh.region_names]
    return Body(replace(problem, mesh=mesh, conditions=[*kept, *contacts], regions=regions), beyond)
