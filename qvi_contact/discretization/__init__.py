"""From the continuous problem (D1) to the algebraic one (D2)."""

from qvi_contact.discretization.discretization import Discretization, discretize

__all__ = ["Discretization", "discretize"]
