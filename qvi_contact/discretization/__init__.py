"""From the continuous problem (D1) to the algebraic one (D2)."""

from qvi_contact.discretization.discretization import Discretization, discretize
from solvers.basics.front import front

__all__ = ["Discretization", "discretize"]

__getattr__ = front(__name__)
