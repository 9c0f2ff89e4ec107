"""The Bogner-Fox-Schmit element on a rectilinear mesh: its basis, and what makes it fast and exact.

Shears are nodal (Φ_xy), so that tractions prescribed around a corner may disagree, and contact rows depend on each
other: what that takes stands here and nowhere else.
"""

from qvi_contact.discretization.bogner_fox_schmit.basis import BognerFoxSchmit

__all__ = ["BognerFoxSchmit"]
