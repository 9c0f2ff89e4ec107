"""How far off is the answer: bounds of the energy from an admissible stress and an admissible displacement."""

from qvi_contact.basics.certainty import Certainty
from qvi_contact.bracket.bounds import bracket
from qvi_contact.bracket.branches import Branches, other_solutions
from qvi_contact.bracket.marking import refined_where_apart
from qvi_contact.bracket.outcome import Bounds, Bracket, BracketKind, EdgeParts, ForceDifference
from qvi_contact.bracket.slip import SlipBounds

__all__ = [
    "Bounds",
    "Bracket",
    "BracketKind",
    "Branches",
    "Certainty",
    "EdgeParts",
    "ForceDifference",
    "SlipBounds",
    "bracket",
    "other_solutions",
    "refined_where_apart",
]
