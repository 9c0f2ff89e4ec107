"""Where there is no friction operator: at kinks of a contact, and where what meets it holds the normal displacement.

An operator S with (Sv)_N = ±μ v_T on a contact and values in H¹ needs (Sv)_N without jumps. At an end of the contact
every neighbour must leave the normal part of Sv free, or the tangential displacement v_T must be zero there.

In `docs/theory.md`: (D26).
"""

from collections.abc import Mapping

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket.bodies import bodies_of
from qvi_contact.bracket.friction_data import held_directions, spans, weight
from qvi_contact.companion.supports import PARALLEL
from qvi_contact.problem.conditions import Contact, bears_shear, has_coulomb
from qvi_contact.problem.problem import ContactProblem


def no_friction_operator(problem: ContactProblem, senses: Mapping[str, int]) -> str:
    """Why there is no friction operator, one sentence; empty if nothing speaks against it on any of the bodies."""
    reasons = (_missing_on(body.problem, body.senses(senses)) for body in bodies_of(problem))
    return next(filter(None, reasons), "")


def _missing_on(problem: ContactProblem, senses: Mapping[str, int]) -> str:
    """The same of one body."""
    boundary, vertices = problem.mesh.boundary, problem.mesh.vertices
    ends = np.concatenate([boundary.first, boundary.second])
    edge = np.tile(np.arange(len(boundary)), 2)
    order = np.argsort(ends, kind="stable")
    starts = np.searchsorted(ends[order], np.arange(len(vertices) + 1))
    held, laws = held_directions(problem), _laws(problem)
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
    held: list[FloatArray],
    laws: Mapping[int, Contact],
    senses: Mapping[str, int],
) -> bool:
    """Whether Sv of one edge, with Coulomb friction, is continuous with what the next edge demands."""
    boundary = problem.mesh.boundary
    normal, tangent = boundary.normal[one], boundary.tangent[one]
    if spans(held[other], tangent):
        return True
    if (np.abs(held[other] @ normal) > PARALLEL).any():
        return False
    law = laws.get(other)
    if law is None or law.law == "tied":
        return True
    own = weight(laws[one], senses)
    across = own * float(boundary.normal[other] @ normal) * tangent - weight(law, senses) * boundary.tangent[other]
    along = own * float(boundary.tangent[other] @ normal) if bears_shear(law) else 0.0
    return bool(np.abs(across).max() <= PARALLEL and abs(along) <= PARALLEL)


def _laws(problem: ContactProblem) -> dict[int, Contact]:
    """The contact of each boundary edge that has one."""
    return {number: contact for contact in problem.contacts for number in problem.mesh.edge_set(contact.edges).tolist()}
