"""Whether stresses of a mesh follow the loads at every point, or only in their resultants."""

from typing import Final

import numpy as np

from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import is_polynomial
from qvi_contact.solution.stress import stress_rounding
from qvi_contact.solution.work import misfit_of_tractions

_MISFIT: Final = 1e-9  # prescribed tractions missed beyond rounding, relative to the unit of stress, that count
_ROUNDED: Final = 1e-6  # the same that rounding in the smallest cells may explain
_ULPS: Final = 8.0  # times each degree of freedom may be rounded, solved along the boundary


def allowed_misfit(unit: float, rounding: float) -> float:
    """Misfit of tractions that rounding explains, from the unit of stress and the rounding of stresses [stress]."""
    return _MISFIT * unit + min(_ULPS * rounding, _ROUNDED * unit)


def loads_followed(discretization: Discretization) -> bool:
    """Whether all stresses of the mesh meet the loads, and what enters tractions of contacts, point by point.

    That is so for tractions that a stress of the mesh can have, and where body potential and pore pressure are
    polynomials of the degree of σ_N on every edge of the contacts.
    """
    u, unit = discretization.values(np.zeros(discretization.qvi.n)), discretization.scales.stress
    rounding = unit * stress_rounding(discretization, u)
    if misfit_of_tractions(discretization, u) > allowed_misfit(unit, rounding):
        return False
    problem, most = discretization.problem, discretization.space.traction_degree
    for contact in problem.contacts:
        fields = {
            "Contact.pore_pressure": contact.pore_pressure,
            "ContactProblem.body_potential": problem.body_potential,
        }
        edges = problem.mesh.edges(contact.edges)
        for name, field in fields.items():
            if callable(field) and contact.law != "tied" and not is_polynomial(problem, edges, name, field, most):
                return False
    return True
