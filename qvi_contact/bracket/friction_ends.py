"""Where there is no friction operator: at kinks of a contact, and where what meets it holds the normal displacement.

An operator S with (Sv)_N = ±μ v_T on a contact and values in H¹ needs (Sv)_N without jumps. At an end of the contact
every neighbour must leave the normal part of Sv free, or the tangential displacement v_T must be zero there.

In `docs/theory.md`: (D26).
"""

from collections.abc import Iterator, Mapping

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.companion.supports import PARALLEL
from qvi_contact.problem.conditions import Contact, Displacement, bears_shear, has_coulomb
from qvi_contact.problem.problem import ContactProblem


def no_friction_operator(problem: ContactProblem, senses: Mapping[str, int]) -> str:
    """Why there is no friction operator, one sentence; empty if nothing speaks against it."""
    boundary, vertices = problem.mesh.boundary, problem.mesh.vertices
    ends = np.concatenate([boundary.first, boundary.second])
    edge = np.tile(np.arange(len(boundary)), 2)
    order = np.argsort(ends, kind="stable")
    starts = np.searchsorted(ends[order], np.arange(len(vertices) + 1))
    held, laws = _supports(problem), _laws(problem)
    for contact in problem.contacts:
        if not has_coulomb(contact):
            continue
        for one in problem.mesh.edge_set(contact.edges).tolist():
            for vertex in (int(boundary.first[one]), int(boundary.second[one])):
                for other in edge[order[starts[vertex] : starts[vertex + 1]]].tolist():
                    if other != one and not _fits(problem, one, other, held, laws, senses):
                        x, y = vertices[vertex]
                        return (
                            f"Bounds under slip need straight contacts whose ends are free: at ({x:.6g}, {y:.6g}) "
                            f"{contact.name!r} has a kink, or meets what holds its normal displacement."
                        )
    return ""


def _fits(
    problem: ContactProblem,
    one: int,
    other: int,
    held: Mapping[int, list[FloatArray]],
    laws: Mapping[int, Contact],
    senses: Mapping[str, int],
) -> bool:
    """Whether Sv of one edge, with Coulomb friction, is continuous with what the next edge demands."""
    boundary = problem.mesh.boundary
    normal, tangent = boundary.normal[one], boundary.tangent[one]
    directions = np.array(held.get(other, [])).reshape(-1, 2)
    if len(directions) and _spans(directions, tangent):
        return True
    weight = _weight(laws[one], senses)
    if (np.abs(directions @ normal) > PARALLEL).any():
        return False
    law = laws.get(other)
    if law is None or law.law == "tied":
        return True
    across = weight * float(boundary.normal[other] @ normal) * tangent - _weight(law, senses) * boundary.tangent[other]
    along = weight * float(boundary.tangent[other] @ normal) if bears_shear(law) else 0.0
    return bool(np.abs(across).max() <= PARALLEL and abs(along) <= PARALLEL)


def _spans(directions: FloatArray, wanted: FloatArray) -> bool:
    """Whether a direction is a combination of given ones (k, 2)."""
    known = np.linalg.lstsq(directions.T, wanted, rcond=PARALLEL)[0] @ directions
    return bool(np.abs(known - wanted).max() <= PARALLEL)


def _weight(contact: Contact, senses: Mapping[str, int]) -> float:
    if not has_coulomb(contact):
        return 0.0
    assert not callable(contact.friction)
    return senses[contact.name] * contact.friction


def _supports(problem: ContactProblem) -> dict[int, list[FloatArray]]:
    """Directions in which displacements are prescribed, by boundary edge; tied contacts included."""
    found: dict[int, list[FloatArray]] = {}
    for index, direction in _held(problem):
        for number, vector in zip(index.tolist(), direction, strict=True):
            found.setdefault(number, []).append(vector)
    return found


def _held(problem: ContactProblem) -> Iterator[tuple[IntArray, FloatArray]]:
    for given in problem.prescribed(Displacement):
        yield given.index, given.direction
    for contact in problem.contacts:
        if contact.law == "tied":
            index = problem.mesh.edge_set(contact.edges)
            for axis in np.eye(2):
                yield index, np.tile(axis, (len(index), 1))


def _laws(problem: ContactProblem) -> dict[int, Contact]:
    """The contact of each boundary edge that has one."""
    return {number: contact for contact in problem.contacts for number in problem.mesh.edge_set(contact.edges).tolist()}
