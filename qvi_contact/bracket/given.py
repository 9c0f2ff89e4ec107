"""The convex problem that is bracketed: friction bounds held fixed, sticking contacts tied."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket.outcome import BracketKind
from qvi_contact.discretization.contact_rows import joined
from qvi_contact.discretization.discretization import Discretization, discretize
from qvi_contact.errors import InputError
from qvi_contact.problem.conditions import Contact
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.contact_line import ContactState
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.work import normal_and_shear
from solvers import FrictionQVI
from solvers.strict.threshold import strict_bound


@dataclass(frozen=True, eq=False)
class GivenProblem:
    """A problem whose friction bound s is data.

    Attributes
    ----------
    discretization : Discretization
        Of the problem, contacts that stick everywhere tied; in the units of the result.
    kind : BracketKind
        What it has to do with the problem stated.
    threshold : (e, 3) array
        Bernstein coefficients of s on all contact edges that have rows, dimensionless.
    lowered : bool
        Whether s is below a bound that is data, which is no quadratic on some edge.
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
        if qvi.edges is None or not qvi.m:
            return qvi
        bound = np.maximum(qvi.edges.at_points(self.threshold), 0.0)
        return qvi.changed(mu=np.zeros(qvi.m), cohesion=bound, cap=np.full(qvi.m, np.inf)).strictly()

    @property
    def bounds(self) -> Mapping[str, FloatArray]:
        """The bound by contact, (edges, 3) Bernstein coefficients [stress]; none for tied contacts."""
        physical = self.threshold * self.discretization.scales.stress
        return {rows.name: physical[rows.edges] for rows in self.discretization.contacts if rows.law != "tied"}


def given_problem(result: ContactResult) -> GivenProblem:
    """Hold the friction bound of a result fixed.

    * Contacts without Coulomb friction keep their law: the bound s = min(c, t_max) is data already.
    * If every contact with Coulomb friction sticks at every point, all of these are tied. The bracket is then that of
      the tied problem, whose solution solves the problem stated wherever it obeys the friction law.
    * Else s = min(c + μ p, t_max) with p the pressure of the result, linear on every edge.

    Raises
    ------
    InputError
        If the result has no stress state, or belongs to a step of a history.

    """
    _check_no_history(result)
    sliding = [contact for contact in result.problem.contacts if _is_coulomb(contact)]
    sticking = bool(sliding) and all(_sticks(result, contact) for contact in sliding)
    known = result.discretization
    discretization, kind, reasons = known, BracketKind.PROBLEM, list[str]()
    if sticking:
        discretization = discretize(_tied(result.problem, sliding), scales=known.scales, freed=known.freed)
        kind = BracketKind.STICKING
    elif sliding:
        kind = BracketKind.GIVEN_BOUND
        names = ", ".join(repr(contact.name) for contact in sliding if not _sticks(result, contact))
        reasons.append(f"The friction bound on {names} depends on the pressure, which the bracket holds fixed.")
    threshold, exact = _threshold(discretization, result.nodal)
    lowered = not exact and kind is not BracketKind.GIVEN_BOUND
    return GivenProblem(discretization, kind, threshold, lowered, tuple(reasons))


def contact_tractions(discretization: Discretization, nodal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """σ_N and σ_T (m,) of nodal values of Φ at the contact points that have rows, dimensionless."""
    limited = [rows.points for rows in discretization.contacts if rows.law != "tied"]
    pairs = [normal_and_shear(discretization, nodal, points) for points in limited]
    return joined([normal for normal, _ in pairs]), joined([shear for _, shear in pairs])


def _check_no_history(result: ContactResult) -> None:
    known = result.discretization
    moved = any(
        not np.array_equal(rows.offset, offset) for rows, offset in zip(known.contacts, known.offsets(), strict=True)
    )
    if moved:
        remedy = "bracket the result of one solve, with the earlier slip in `offset`"
        raise InputError("result", "a step of a history, after earlier slip", remedy)


def _is_coulomb(contact: Contact) -> bool:
    """Whether the friction bound depends on the pressure."""
    limited = not callable(contact.shear_limit) and contact.shear_limit == 0.0
    return contact.law != "tied" and not limited and (callable(contact.friction) or contact.friction != 0.0)


def _sticks(result: ContactResult, contact: Contact) -> bool:
    return bool((result.contacts[contact.name].state == int(ContactState.STICK)).all())


def _tied(problem: ContactProblem, sticking: list[Contact]) -> ContactProblem:
    tied = {
        contact.name: replace(contact, friction=0.0, cohesion=0.0, shear_limit=None, law="tied") for contact in sticking
    }
    conditions = [
        tied.get(condition.name, condition) if isinstance(condition, Contact) else condition
        for condition in problem.conditions
    ]
    return replace(problem, conditions=conditions)


def _threshold(discretization: Discretization, nodal: FloatArray) -> tuple[FloatArray, bool]:
    """Bernstein coefficients (e, 3) of the bound from nodal values of Φ, dimensionless, and whether they are exact."""
    qvi = discretization.qvi
    if qvi.edges is None or not qvi.m:
        return np.zeros((0, 3)), True
    coefficients, exact = strict_bound(qvi, contact_tractions(discretization, nodal)[0])
    return coefficients, bool(exact.all())
