"""The convex problem that is bracketed, its friction bounds held fixed, and a stress that obeys it on whole edges."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket.outcome import BracketKind
from qvi_contact.bracket.parts import EdgeTractions
from qvi_contact.discretization.discretization import Discretization, discretize
from qvi_contact.element import bernstein
from qvi_contact.errors import InputError
from qvi_contact.problem.conditions import has_coulomb
from qvi_contact.solution.result import ContactResult
from solvers import FrictionQVI, Status, solve_qvi

LOOSEST: Final = 1e-6
"""Largest violation of the contact law, relative to the largest stress, that counts as admissible."""


@dataclass(frozen=True, eq=False)
class FixedBoundProblem:
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


def fixed_bound_problem(result: ContactResult) -> FixedBoundProblem:
    """Hold the friction bound of a result fixed.

    * Contacts without Coulomb friction keep their law: the bound s = min(c, t_max) is data already.
    * With Coulomb friction s = min(c + μ p, t_max), p the pressure of the result.

    Raises
    ------
    InputError
        If the result has no stress state, or belongs to a step of a history.

    """
    check_no_history(result)
    names = ", ".join(repr(contact.name) for contact in result.problem.contacts if has_coulomb(contact))
    discretization = with_bernstein_rows(result.discretization)
    own = EdgeTractions.of(discretization, result.dofs)
    if names:
        reason = f"The friction bound on {names} was taken from the computed pressure."
        return FixedBoundProblem(discretization, BracketKind.GIVEN_BOUND, own.bound, False, (reason,))
    return FixedBoundProblem(discretization, BracketKind.PROBLEM, own.bound, not own.exact.all(), ())


def with_bernstein_rows(known: Discretization) -> Discretization:
    """The same problem on the same elements and in the same units, with rows that hold the law on whole edges."""
    if known.rule.law_on == "edges":
        return known
    return discretize(known.problem, degree=known.space.degree, law_on="edges", scales=known.scales)


def check_no_history(result: ContactResult) -> None:
    """Refuse the result of a step of a history."""
    known = result.discretization
    pairs = zip(known.contacts, known.offsets(), strict=True)
    if any(not np.array_equal(rows.offset, offset) for rows, offset in pairs):
        remedy = "bracket the result of one solve, with the earlier slip in `offset`"
        raise InputError("result", "a step of a history, after earlier slip", remedy)


@dataclass(frozen=True, eq=False)
class AdmissibleStress:
    """A stress of the given problem.

    Attributes
    ----------
    result : ContactResult
        It carries the stress; solved for the given bound if that of the bracketed result violates the law somewhere.
    excess, tension : (e,) arrays
        What is left of violations on each contact edge, largest (|τ_T| − s)⁺ and (τ_N)⁺, dimensionless.
    found : bool
        Whether there is such a stress at all.
    message : str
        If not, why.

    """

    result: ContactResult
    excess: FloatArray
    tension: FloatArray
    found: bool = True
    message: str = ""


def admissible_stress(
    given: FixedBoundProblem, result: ContactResult, tolerance: float, **options: Any
) -> AdmissibleStress:
    """The stress of the result where it is admissible for the given problem up to the tolerance, else the best that is.

    The tolerance is relative to the largest contact traction; options of the solve are those of `solve_qvi`.
    """
    discretization, bilateral = given.discretization, given.discretization.qvi.bilateral

    def violations(result: ContactResult) -> tuple[FloatArray, FloatArray, float]:
        """Largest (|τ_T| − s)⁺ and (τ_N)⁺ on each edge, and the larger of them all over the largest traction.

        That is the certificate's unit of stress where the contact is open.
        """
        own = EdgeTractions.of(discretization, result.dofs)
        if not len(own.shear):
            return np.zeros(0), np.zeros(0), 0.0
        excess = np.maximum(_largest(own.shear - given.threshold), _largest(-own.shear - given.threshold))
        keeps = bilateral.reshape(len(own.shear), -1).any(axis=1)
        excess, tension = np.maximum(excess, 0.0), np.maximum(np.where(keeps, 0.0, _largest(own.normal)), 0.0)
        size = float(max(own.size, result.certificate.scales.get("stress", 0.0))) or 1.0
        return excess, tension, float(max(excess.max(), tension.max())) / size

    excess, tension, worst = violations(result)
    if worst <= tolerance:
        return AdmissibleStress(result, excess, tension)
    try:
        qvi = given.qvi
    except InputError as error:
        return AdmissibleStress(result, excess, tension, False, f"No strictly admissible stress can be sought: {error}")
    solution = solve_qvi(qvi, tolerance=tolerance, **options)
    strict = ContactResult(discretization, solution)
    message = f"No strictly admissible stress was found: {solution.message}"
    if solution.status in (Status.INFEASIBLE, Status.INNER_INFEASIBLE):
        message = "No stress on this mesh obeys the contact law on whole edges for that bound: refine the mesh."
    if not strict.has_state:
        return AdmissibleStress(result, excess, tension, False, message)
    excess, tension, worst = violations(strict)
    found = worst <= LOOSEST
    return AdmissibleStress(strict, excess, tension, found, "" if found else message)


def _largest(polynomials: FloatArray) -> FloatArray:
    """The largest value (e,) of polynomials (e, q), or what is no less than that: exact up to degree 2."""
    return bernstein.largest_quadratic(polynomials) if polynomials.shape[1] == 3 else polynomials.max(axis=1)
