"""A stress that obeys the contact law on whole edges."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket.given import GivenProblem
from qvi_contact.bracket.law import contact_tractions, largest, traction_coefficients
from qvi_contact.errors import InputError
from qvi_contact.solution.result import ContactResult
from solvers import Status, solve_qvi

LOOSEST: Final = 1e-6
"""Largest violation of the contact law, relative to the largest stress, that counts as admissible."""


@dataclass(frozen=True, eq=False)
class AdmissibleStress:
    """A stress of the given problem.

    Attributes
    ----------
    result : ContactResult
        It carries the stress; solved for the given bound if that of the bracketed result violates the law somewhere.
    excess, pull : (e,) arrays
        What is left of violations on each contact edge, largest (|τ_T| − s)⁺ and (τ_N)⁺, dimensionless.
    found : bool
        Whether there is such a stress at all.
    message : str
        If not, why.

    """

    result: ContactResult
    excess: FloatArray
    pull: FloatArray
    found: bool = True
    message: str = ""


def admissible_stress(given: GivenProblem, result: ContactResult, tolerance: float, **options: Any) -> AdmissibleStress:
    """The stress of the result where it is admissible for the given problem up to the tolerance, else the best that is.

    The tolerance is relative to the largest contact traction; options of the solve are those of `solve_qvi`.
    """
    excess, pull, size = _violations(given, result)
    if max(excess.max(initial=0.0), pull.max(initial=0.0)) <= tolerance * size:
        return AdmissibleStress(result, excess, pull)
    try:
        qvi = given.qvi
    except InputError as error:
        return AdmissibleStress(result, excess, pull, False, f"No strictly admissible stress can be sought: {error}")
    solution = solve_qvi(qvi, tolerance=tolerance, **options)
    strict = ContactResult(given.discretization, solution)
    if not strict.has_state:
        return AdmissibleStress(result, excess, pull, False, _why_not(solution.status, solution.message))
    excess, pull, size = _violations(given, strict)
    found = max(excess.max(initial=0.0), pull.max(initial=0.0)) <= LOOSEST * size
    return AdmissibleStress(strict, excess, pull, found, "" if found else _why_not(solution.status, solution.message))


def _why_not(status: Status, message: str) -> str:
    if status in (Status.INFEASIBLE, Status.INNER_INFEASIBLE):
        return "No stress on this mesh obeys the contact law on whole edges for that bound: refine the mesh."
    return f"No strictly admissible stress was found: {message}"


def _violations(given: GivenProblem, result: ContactResult) -> tuple[FloatArray, FloatArray, float]:
    """Largest (|τ_T| − s)⁺ and (τ_N)⁺ on each contact edge (e,), and the largest stress they are compared with.

    That is the contact's largest traction, or the certificate's unit of stress where the contact is open.
    """
    discretization, qvi = given.discretization, given.discretization.qvi
    if not qvi.m:
        return np.zeros(0), np.zeros(0), 1.0
    at_points = contact_tractions(discretization, result.dofs)
    normal, shear = traction_coefficients(discretization, at_points)
    excess = np.maximum(largest(shear - given.threshold), largest(-shear - given.threshold))
    bilateral = qvi.bilateral.reshape(len(shear), -1).any(axis=1)
    pull = np.where(bilateral, 0.0, largest(normal))
    size = max(*(np.abs(part).max() for part in at_points), result.certificate.scales.get("stress", 0.0))
    return np.maximum(excess, 0.0), np.maximum(pull, 0.0), float(size) or 1.0
