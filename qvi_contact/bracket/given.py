"""The convex problem that is bracketed: friction bounds held fixed."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket.law import contact_tractions, law_bound
from qvi_contact.bracket.outcome import BracketKind
from qvi_contact.discretization.discretization import Discretization, discretize
from qvi_contact.errors import InputError
from qvi_contact.problem.conditions import has_coulomb
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from solvers import FrictionQVI


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
