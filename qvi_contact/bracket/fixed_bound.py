"""The convex problem that is bracketed, its friction bounds held fixed, and a stress that obeys it on whole edges."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, evaluate
from qvi_contact.bracket.outcome import BracketKind
from qvi_contact.bracket.parts import EdgeTractions, coefficients
from qvi_contact.companion.data import PARALLEL
from qvi_contact.discretization.discretization import Discretization, discretize
from qvi_contact.element import bernstein
from qvi_contact.errors import InputError
from qvi_contact.problem.conditions import Contact, has_coulomb
from qvi_contact.solution.result import ContactResult
from solvers import Status, solve_qvi

LOOSEST: Final = 1e-6
"""Largest violation of the contact law, relative to the largest stress, that counts as admissible."""

_AT_ONCE: Final = 1000  # points that are looked for among edges


@dataclass(frozen=True, eq=False)
class FixedBoundProblem:
    """A problem whose friction bound s is data."""

    # of the problem, in the units of the result, with rows that hold the law on whole edges
    discretization: Discretization
    kind: BracketKind  # what it has to do with the problem stated
    threshold: FloatArray  # (e, q): Bernstein coefficients of s on all contact edges that have rows, dimensionless
    lowered: bool  # whether s is below a bound that is data, which is no polynomial of that degree on some edge
    reasons: tuple[str, ...]  # why its solution is not that of the problem stated

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
        If the result has no stress state.

    """
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


@dataclass(frozen=True, eq=False)
class EarlierSlip:
    """An offset of a contact and what the contact has slipped before, as a function of (x, y) [length]."""

    offset: Field  # what the problem prescribes
    first: FloatArray  # first, along, (e, 2) each: where edges begin, and the vectors to their ends
    along: FloatArray
    slip: FloatArray  # (e, q): Bernstein coefficients on each edge

    def __call__(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """The sum at points of the edges."""
        places, found = np.stack([np.ravel(x), np.ravel(y)], axis=1), list[FloatArray]()
        for some in np.split(places, range(_AT_ONCE, len(places), _AT_ONCE)):
            away = some[:, None] - self.first
            t = np.clip((away * self.along).sum(axis=2) / (self.along**2).sum(axis=1), 0.0, 1.0)
            edge = np.square(away - t[..., None] * self.along).sum(axis=2).argmin(axis=1)
            shapes = bernstein.basis(self.slip.shape[1] - 1, t[np.arange(len(some)), edge])
            found.append((shapes * self.slip[edge]).sum(axis=1))
        slip = np.concatenate(found).reshape(np.shape(x))
        return np.asarray(evaluate("Contact.offset", self.offset, x, y) + slip)


def after_earlier_slip(result: ContactResult) -> tuple[ContactResult, tuple[str, ...]]:
    """A step of a history as the result of one problem, with the slip computed before in its offsets, and a reason.

    Where edges go on straight that slip is made continuous, as displacements are. Other results stay as they are,
    without a reason.

    Raises
    ------
    InputError
        If a contact has slipped before along arcs.

    """
    known, changed, mesh = result.discretization, dict[str, Contact](), result.problem.mesh
    for rows, contact in zip(known.contacts, result.problem.contacts, strict=True):
        if not rows.slip.any():
            continue
        edges = mesh.edges(contact.edges)
        if edges.curved:
            remedy = "this step of a history has slipped before along arcs: bracket the result of one solve"
            raise InputError("result", contact.name, remedy)
        slip = coefficients(known, rows.slip * known.scales.displacement)
        meeting: dict[int, list[tuple[int, int]]] = {}
        for end, vertices in enumerate((edges.first, edges.second)):
            for edge, vertex in enumerate(vertices.tolist()):
                meeting.setdefault(vertex, []).append((edge, -end))
        for ends in meeting.values():
            at = tuple(np.array(ends).T)
            sense = edges.tangent[at[0]] @ edges.tangent[at[0][0]]
            if (np.abs(sense) > 1.0 - PARALLEL).all():
                slip[at] = np.sign(sense) * np.mean(np.sign(sense) * slip[at])
        first, second = mesh.vertices[edges.first], mesh.vertices[edges.second]
        changed[contact.name] = replace(contact, offset=EarlierSlip(contact.offset, first, second - first, slip))
    if not changed:
        return result, ()
    conditions = [
        changed.get(each.name, each) if isinstance(each, Contact) else each for each in result.problem.conditions
    ]
    step = known.with_data(replace(result.problem, conditions=conditions), known.scales)
    names = ", ".join(map(repr, changed))
    reason = (
        f"The slip of {names} in the steps before is taken as it was computed: bounds are those of this step alone."
    )
    return ContactResult(step, result.solution), (reason,)


@dataclass(frozen=True, eq=False)
class AdmissibleStress:
    """A stress of the given problem."""

    # it carries the stress; solved for the given bound if that of the bracketed result violates the law somewhere
    result: ContactResult
    own: EdgeTractions  # its tractions
    # (e,) each: what is left of violations on each contact edge, largest (|τ_T| − s)⁺ and (τ_N)⁺, dimensionless
    left: tuple[FloatArray, FloatArray]
    message: str = ""  # why there is no such stress; empty if there is


def admissible_stress(
    given: FixedBoundProblem, result: ContactResult, tolerance: float, **options: Any
) -> AdmissibleStress:
    """The stress of the result where it is admissible for the given problem up to the tolerance, else the best that is.

    The tolerance is relative to the largest contact traction; options of the solve are those of `solve_qvi`.
    """
    discretization = given.discretization

    def violating(result: ContactResult) -> tuple[AdmissibleStress, float]:
        """A stress, and its largest violation over the largest traction, where all is open the unit of stress."""
        own = EdgeTractions.of(discretization, result.dofs)
        left = own.violations(given.threshold, discretization.qvi.bilateral)
        size = float(max(own.size, result.certificate.scales.get("stress", 0.0))) or 1.0
        return AdmissibleStress(result, own, left), float(max(part.max(initial=0.0) for part in left)) / size

    found, worst = violating(result)
    if worst <= tolerance:
        return found
    qvi = discretization.qvi  # with m > 0, as something is violated
    solution = solve_qvi(qvi.with_bound(np.maximum(given.threshold.ravel(), 0.0)), tolerance=tolerance, **options)
    strict = ContactResult(discretization, solution)
    message = f"No strictly admissible stress was found: {solution.message}"
    if solution.status in (Status.INFEASIBLE, Status.INNER_INFEASIBLE):
        message = "No stress on this mesh obeys the contact law on whole edges for that bound: refine the mesh."
    if not strict.has_state:
        return replace(found, message=message)
    found, worst = violating(strict)
    return found if worst <= LOOSEST else replace(found, message=message)
