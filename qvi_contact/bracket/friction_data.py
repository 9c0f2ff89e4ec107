"""What norms of friction operators share: numbers σμ, directions that are held, the material, angles for maxima."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.companion.supports import PARALLEL
from qvi_contact.problem.conditions import Contact, Displacement, has_coulomb
from qvi_contact.problem.problem import ContactProblem

ANGLES: Final = np.linspace(0.0, np.pi / 2.0, 4097)
"""Angles at which a smooth function is compared for its maximum."""

ROUNDED: Final = 1.0 + 1e-6
"""Factor from the maximum at these angles to what is no less than that of all."""


def weight(contact: Contact, senses: Mapping[str, int]) -> float:
    """σμ; 0 where there is no Coulomb friction."""
    if not has_coulomb(contact):
        return 0.0
    assert not callable(contact.friction)
    return senses[contact.name] * contact.friction


def held_directions(problem: ContactProblem) -> list[FloatArray]:
    """Directions (k, 2) in which each boundary edge holds displacements; tied contacts hold both."""
    found: list[list[FloatArray]] = [[] for _ in range(len(problem.mesh.boundary))]
    for given in problem.prescribed(Displacement):
        for edge, direction in zip(given.index.tolist(), given.direction, strict=True):
            found[edge].append(direction)
    for contact in problem.contacts:
        if contact.law == "tied":
            for edge in problem.mesh.edge_set(contact.edges).tolist():
                found[edge] += list(np.eye(2))
    return [np.array(directions).reshape(-1, 2) for directions in found]


def spans(directions: FloatArray, wanted: FloatArray) -> bool:
    """Whether a direction is a combination of given ones (k, 2)."""
    if not len(directions):
        return False
    known = np.linalg.lstsq(directions.T, wanted, rcond=PARALLEL)[0] @ directions
    return bool(np.abs(known - wanted).max() <= PARALLEL)


def one_ratio(problem: ContactProblem) -> float | None:
    """Poisson's ratio of the plane state, −c12/c11, of a body of one material; None where there are several."""
    if len(np.unique(problem.compliances.reshape(-1, 9), axis=0)) > 1:
        return None
    return -float(problem.compliances[0][0, 1] / problem.compliances[0][0, 0])
