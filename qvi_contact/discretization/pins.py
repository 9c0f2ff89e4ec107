"""Rigid pins whose centre lies where no pin can be: inside the body, or outside the hole that it should touch."""

import numpy as np

from qvi_contact.basics.checks import FloatArray, evaluate
from qvi_contact.mesh.edges import vectors_along
from qvi_contact.problem.conditions import Contact
from qvi_contact.problem.problem import ContactProblem

_STEPS = 8  # of an edge, at whose ends distances are taken
_SAME = 1e-9  # share of a distance up to which two are one


def misplaced_pins(problem: ContactProblem) -> dict[str, tuple[float, float]]:
    """Names of contacts with a pin where the edge nearest to its centre faces away from it, and the centre [length].

    A pin is a plate whose gap is the distance from a disc around its pivot. At a corner that is nearest the normals of
    both its edges count together, which is right whichever way it turns.
    """
    plates = [(contact, contact.plate.pivot) for contact in problem.contacts if contact.plate is not None]
    return {contact.name: pivot for contact, pivot in plates if _is_beyond(problem, contact, pivot)}


def _is_beyond(problem: ContactProblem, contact: Contact, pivot: tuple[float, float]) -> bool:
    edges, t = problem.mesh.edges(contact.edges), np.linspace(0.0, 1.0, _STEPS + 1)
    x, y = problem.mesh.points_along(edges, t)
    arm = np.stack([pivot[0] - x, pivot[1] - y], axis=-1)
    away = np.hypot(arm[..., 0], arm[..., 1])
    if not _is_disc(away, away - evaluate("Contact.gap", contact.gap, x, y)):
        return False
    nearest = away <= away.min() * (1.0 + _SAME)
    normals = vectors_along(edges, edges.normal, t, turns=True)[nearest]
    return bool((normals * arm[nearest]).sum() < 0.0)


def _is_disc(away: FloatArray, radius: FloatArray) -> bool:
    """Whether distances from a pivot are a gap and one radius."""
    return bool(np.ptp(radius) <= _SAME * away.max() and radius.min() > 0.0)
