"""What is to be solved: mesh, material and conditions as one problem."""

from qvi_contact.problem.conditions import Contact, Displacement, RigidPlate, Symmetry, Traction
from qvi_contact.problem.fields import BodyForces, Expression, PointData, Polynomial
from qvi_contact.problem.material import Material, Mises, MohrCoulomb, NoTension, Region, Strength, Tresca
from qvi_contact.problem.problem import ContactProblem
from solvers.basics.front import front

__all__ = [
    "BodyForces", "Contact", "ContactProblem", "Displacement", "Expression", "Material", "Mises", "MohrCoulomb",
    "NoTension", "PointData", "Polynomial", "Region", "RigidPlate", "Strength", "Symmetry", "Traction", "Tresca",
]  # fmt: skip

__getattr__ = front(__name__)
