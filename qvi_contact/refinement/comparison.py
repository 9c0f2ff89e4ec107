"""How far off an answer is, by what it is compared with: bounds from a companion, where the contact laws allow them."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from qvi_contact.basics.certainty import Certainty
from qvi_contact.basics.checks import FloatArray
from qvi_contact.problem.conditions import Contact, has_coulomb
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement.quantity import Measure
from qvi_contact.solution.result import ContactResult

_CROSSED: Final = 1e-9  # of the strain energy: lower − upper that is more than rounding


@dataclass(frozen=True, eq=False)
class Comparison:
    """An answer beside something else.

    Attributes
    ----------
    error : float
        Of the quantity, in its own unit.
    certainty : Certainty
        Whether it is a bound.
    parts : (cells,) array
        What each cell has of the distance between the two [stress × length²], ≥ 0.
    looked : float
        The quantity in a closer look; NaN where there was none.

    """

    error: float
    certainty: Certainty
    parts: FloatArray
    looked: float = np.nan


def coulomb_contacts(problem: ContactProblem) -> list[Contact]:
    """The contacts whose friction bound depends on the pressure."""
    return [contact for contact in problem.contacts if has_coulomb(contact)]


def bounded(measure: Measure, value: float, result: ContactResult) -> Comparison | None:
    """The value of an answer beside bounds of it, if they are guaranteed: under Coulomb friction those of forces."""
    bracket = result.bracket
    coulomb = bracket.coulomb
    if coulomb is not None and coulomb.guaranteed and measure.name in coulomb.forces:
        lower, upper = coulomb.forces[measure.name]
        return Comparison(max(upper - value, value - lower, 0.0), Certainty.GUARANTEED, coulomb.cells)
    if bracket.reasons or not np.isfinite(bracket.gap) or bracket.gap < -_CROSSED * bracket.strain:
        return None
    if measure.name == "energy":
        lower, upper = -bracket.upper, -bracket.lower
    elif measure.name in bracket.forces:
        lower, upper = bracket.forces[measure.name].lower, bracket.forces[measure.name].upper
    else:
        return None
    return Comparison(max(upper - value, value - lower, 0.0), bracket.certainty, bracket.cell_gaps)
