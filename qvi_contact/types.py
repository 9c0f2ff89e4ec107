"""Names of the types in public signatures, for your own typed code.

from qvi_contact.types import Field, Law

def pressed(friction: Field, law: Law = "unilateral") -> Contact: ...
"""

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, IntArray
from qvi_contact.discretization.space import LawOn
from qvi_contact.problem.conditions import Condition, Law
from qvi_contact.problem.material import Plane
from qvi_contact.refinement.measure import Quantity

__all__ = ["BoolArray", "Condition", "Field", "FloatArray", "IntArray", "Law", "LawOn", "Plane", "Quantity"]
