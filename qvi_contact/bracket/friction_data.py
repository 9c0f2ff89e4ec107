"""What norms of friction operators share: numbers σμ, the material, angles for maxima."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from qvi_contact.problem.conditions import Contact, has_coulomb
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


def one_ratio(problem: ContactProblem) -> float | None:
    """Poisson's ratio of the plane state, −c12/c11, of a body of one material; None where there are several."""
    if len(np.unique(problem.compliances.reshape(-1, 9), axis=0)) > 1:
        return None
    return -float(problem.compliances[0][0, 1] / problem.compliances[0][0, 0])
