"""The convex problem that is bracketed, its friction bounds held fixed, and a stress that obeys it on whole edges."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket.outcome import BracketKind
from qvi_contact.bracket.parts import contact_tractions, largest, law_bound, traction_coefficients
from qvi_contact.discretization.discretization import Discretization, discretize
from qvi_contact.errors import InputError
from qvi_contact.problem.conditions import has_coulomb
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from solvers import FrictionQVI, Status, solve_qvi

LOOSEST: Final = 1e-6
"""Largest violation of the contact law, relative to the largest stress, that counts as admissible."""


@dataclass(frozen=True, eq=False)
class GivenProblem:
    """A problem whose friction bound s is data.

    Attributes
    ----------
    discretization : Discretization
        Of the problem, in the units of the result, with rows that hold the law on whole edges.
    kind : BracketKind
        What it has to do with the problem stated.
    threshold : (e, q) array
        Bernstein coefficients of s on all contact edges that have rows, dimensionless.
    lowered : bool
        Whether s is below a bound that is data, which is no polynomial of that degree on some edge.
    reasons : tuple of str
        Why its solution is not that of the problem stated.

    """

    discretization: Discretization
    kind: BracketKind
    threshold: FloatArray
    lowered: bool
    reasons: tuple[str, ...]

    @property
    def qvi(self) -> FrictionQVI:
        """The algebraic problem for the bound s, admissible on whole edges."""
        qvi = self.discretization.qvi
        if not qvi.m:
            return qvi
        return qvi.with_bound(np.maximum(self.threshold.ravel(), 0.0))

    @property
    def bounds(self) -> Mapping[str, FloatArray]:
        """The bound by contact, (edges, q) Bernstein coefficients [stress]; none for tied contacts."""
        physical = self.threshold * self.discretization.scales.stress
        return {rows.name: physical[rows.edges] for rows in self.discretization.contacts if rows.law != "tied"}


def given_problem(result: ContactResult) -> GivenProblem:
    """Hold the friction bound of a result fixed.

    * Contacts without Coulomb friction keep their law: the bound s = min(c, t_max) is data already.
    * With Coulomb friction s = min(c + μ p, t_max), p the pressure of the result.

    Raises
    ------
    InputError
        If the result has no stress state, or belongs to a step of a history.

    """
    check_no_history(result)
    sliding = [contact for contact in result.problem.contacts if has_coulomb(contact)]
    discretization, kind, reasons = result.discretization, BracketKind.PROBLEM, list[str]()
    if sliding:
        kind = BracketKind.GIVEN_BOUND
        names = ", ".join(repr(contact.name) for contact in sliding)
        reasons.append(f"The friction bound on {names} was taken from the computed pressure.")
    if discretization.rule.kind != "bernstein":
        discretization = posed_strictly(discretization, discretization.problem)
    threshold, exact = _threshold(discretization, result.dofs)
    lowered = not exact and kind is not BracketKind.GIVEN_BOUND
    return GivenProblem(discretization, kind, threshold, lowered, tuple(reasons))


def posed_strictly(known: Discretization, problem: ContactProblem) -> Discretization:
    """A problem on the elements and in the units of another one, with rows that hold the law on whole edges."""
    space = known.space
    return discretize(
        problem,
        degree=space.degree,
        contact_rows="bernstein",
        scales=known.scales,
    )


def check_no_history(result: ContactResult) -> None:
    """Refuse the result of a step of a history."""
    known = result.discretization
    moved = any(
        not np.array_equal(rows.offset, offset) for rows, offset in zip(known.contacts, known.offsets(), strict=True)
    )
    if moved:
        remedy = "bracket the result of one solve, with the earlier slip in `offset`"
        raise InputError("result", "a step of a history, after earlier slip", remedy)


def _threshold(discretization: Discretization, u: FloatArray) -> tuple[FloatArray, bool]:
    """Bernstein coefficients (e, q) of the bound from degrees of freedom u of Φ, and whether they are exact."""
    if not discretization.qvi.m:
        return np.zeros((0, discretization.space.traction_degree + 1)), True
    found, exact = law_bound(discretization, contact_tractions(discretization, u)[0])
    return found, bool(exact.all())


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
