"""In which sense contacts slip, and with what margin a stress keeps away from slipping the other way."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket.bodies import bodies_of
from qvi_contact.bracket.friction_ends import no_friction_operator
from qvi_contact.bracket.given import posed_strictly
from qvi_contact.bracket.law import effective, traction_coefficients
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.errors import InputError
from qvi_contact.problem.conditions import Contact, has_coulomb
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from solvers import solve_qvi

LEAST_MARGIN: Final = 1e-3
"""Share of the friction bound by which a stress must stay below it in the other sense."""

_SMALL = 1e-6  # of the largest bound of a contact: what is below counts as this


@dataclass(frozen=True, eq=False)
class SlippingStress:
    """A stress whose contacts slip in one sense each.

    Attributes
    ----------
    result : ContactResult
        It carries the stress; solved anew if the law did not hold on whole edges.
    senses : mapping
        By contact with Coulomb friction 1 where the body slips along the tangent, sense (u_T − w) ≥ 0, and −1 where
        against it.

    """

    result: ContactResult
    senses: Mapping[str, int]


def outside_scope(discretization: Discretization) -> str:
    """Why slip in one sense says nothing of the errors of a problem, as far as its data show; empty if it does."""
    problem = discretization.problem
    try:
        bodies_of(problem)
    except InputError as error:
        return f"Bounds under slip need joints between two bodies: {error}."
    reasons = (_not_of_the_kind(problem, contact) for contact in problem.contacts)
    return next(filter(None, reasons), "")


def _not_of_the_kind(problem: ContactProblem, contact: Contact) -> str:
    """Why a contact is not one of those that bounds under slip are for; empty if it is."""
    name, rough = repr(contact.name), has_coulomb(contact)
    found = {
        f"Bounds under slip are for obstacles whose motion is given: that of {name} is driven by force.": (
            contact.plate is not None and contact.plate.driven
        ),
        f"Bounds under slip are for dry contacts: a fluid presses in {name}.": contact.has_fluid,
        f"Bounds under slip are for contacts that may open: {name} keeps its distance.": (
            rough and contact.law != "unilateral"
        ),
        f"Bounds under slip are for straight contacts: {name} is an arc.": (
            rough and problem.mesh.edges(contact.edges).curved
        ),
        f"Bounds under slip need constant friction and cohesion: those of {name} are functions.": (
            rough and (callable(contact.friction) or callable(contact.cohesion))
        ),
        f"Bounds under slip are for Coulomb's law without a limit of the shear stress: {name} has one.": (
            rough and contact.shear_limit is not None
        ),
    }
    return next((reason for reason, applies in found.items() if applies), "")


def stress_under_slip(result: ContactResult, tolerance: float, **options: Any) -> SlippingStress | str:
    """The stress of a result with Coulomb friction, with its senses, or why its errors have no bounds.

    Options are those of `solve_qvi`, where the law between points has to be found first.
    """
    reason = outside_scope(result.discretization)
    if reason:
        return reason
    known = result.discretization
    if known.space.contact_rule.kind != "bernstein":
        strict = posed_strictly(known, known.problem)
        solution = solve_qvi(strict.qvi, tolerance=tolerance, **options)
        result = ContactResult(strict, solution)
        if not result.has_state:
            return f"No stress that obeys the contact law on whole edges was found: {solution.message}"
    found = {}
    for name, ratio in _ratios(result).items():
        margins = {sense: 1.0 - float((sense * ratio).max()) for sense in (1, -1)}
        found[name] = max(margins, key=lambda sense: margins[sense])
        if margins[found[name]] < LEAST_MARGIN:
            return f"{name!r} slips in both senses, or nearly so: bounds under slip need one sense for each contact."
    missing = no_friction_operator(result.problem, found)
    return missing or SlippingStress(result, found)


def margin_of(result: ContactResult, senses: Mapping[str, int]) -> float:
    """The margin with which a stress keeps away from slipping against given senses."""
    return float(min((1.0 - (senses[name] * ratio).max() for name, ratio in _ratios(result).items()), default=2.0))


def _ratios(result: ContactResult) -> dict[str, FloatArray]:
    """τ_T/(c + μ|τ_N|) by Bernstein coefficients (edges, q), for each contact with Coulomb friction."""
    known, found = result.discretization, {}
    for contact, rows in zip(known.problem.contacts, known.contacts, strict=True):
        if not has_coulomb(contact):
            continue
        normal, shear = traction_coefficients(known, effective(known, result.dofs, rows))
        assert not callable(contact.friction)
        assert not callable(contact.cohesion)
        bound = contact.cohesion / known.scales.stress - contact.friction * normal
        floor = _SMALL * max(float(bound.max(initial=0.0)), 1e-300)
        found[contact.name] = shear / np.maximum(bound, floor)
    return found
