"""The displacement model beside the equilibrium model: upper bounds of the energy, deformed shapes.

    from qvi_contact.companion import solve_companion
    companion = solve_companion(problem, degree=2)
    print(companion.message, companion.energy)

Conforming elements on the mesh of the problem; the contact problem is solved in its forces by `solvers`.
"""

from qvi_contact.companion.model import (
    CompanionContact,
    CompanionResult,
    CompanionState,
    solve_companion,
    solve_companions,
)
from solvers.basics.front import front

__all__ = ["CompanionContact", "CompanionResult", "CompanionState", "solve_companion", "solve_companions"]

__getattr__ = front(__name__)
