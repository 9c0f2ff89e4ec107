"""How far off is the answer: bounds of the energy from an admissible stress and an admissible displacement."""

from qvi_contact.bracket.bounds import Branches, bracket, other_solutions
from qvi_contact.bracket.coulomb import CoulombBounds
from qvi_contact.bracket.outcome import Bracket, BracketKind, Uniqueness
from qvi_contact.bracket.parts import Bounds, EdgeParts
from qvi_contact.units import Certainty
from solvers.basics.front import front

__all__ = [
    "Bounds", "Bracket", "BracketKind", "Branches", "Certainty", "CoulombBounds", "EdgeParts", "Uniqueness", "bracket",
    "other_solutions",
]  # fmt: skip

__getattr__ = front(__name__)
