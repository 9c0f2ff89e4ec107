"""How far off is the answer: bounds of the energy from an admissible stress and an admissible displacement."""

from qvi_contact.basics.certainty import Certainty
from qvi_contact.bracket.bounds import bracket
from qvi_contact.bracket.branches import Branches, other_solutions
from qvi_contact.bracket.coulomb import CoulombBounds
from qvi_contact.bracket.document import document as document
from qvi_contact.bracket.friction_norm import friction_norm as friction_norm
from qvi_contact.bracket.outcome import Bounds, Bracket, BracketKind, EdgeParts, ForceDifference, Uniqueness
from qvi_contact.bracket.star_norm import star_norm as star_norm
from solvers.basics.front import front

__all__ = [
    "Bounds",
    "Bracket",
    "BracketKind",
    "Branches",
    "Certainty",
    "CoulombBounds",
    "EdgeParts",
    "ForceDifference",
    "Uniqueness",
    "bracket",
    "other_solutions",
]

__getattr__ = front(
    __name__,
    {
        "bodies": ("bodies_of",),
        "document": ("lines",),
        "friction_norm": ("computed_norm", "proved_norm", "rectangle_constant", "rectangle_norm"),
        "given": ("given_problem",),
        "parts": ("CellFields", "bulk", "by_cell", "slip_work"),
        "coulomb": ("coulomb_bounds",),
        "share": ("Share", "SharedStress", "with_shares"),
        "slip_constants": ("amplification", "coercivity", "defect_bound", "error_bound"),
    },
)
