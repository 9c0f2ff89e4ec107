"""Loads that cannot be carried: by the body, which a mechanism proves, or only by the stresses of a mesh.

The algebraic problem of a mesh may be infeasible although the body carries the load: its stresses cannot follow the
tractions, which crowd in corners shortly before a body slides or tips. So the status is decided anew, see `mechanism`.

The other way round an answer of a mesh may keep a contact law at its points, or by its coefficients, and exceed it
between them. Where μ and c are constant and there is no cap, the rows of an edge integrate the work of the contact
against rigid motions, which stays what the law allows. Else a load beyond the limit of the body may look carried.
"""

from contextlib import suppress
from dataclasses import replace

from qvi_contact.errors import InputError, SolveError
from qvi_contact.mechanism import Mechanism, find_mechanism
from qvi_contact.problem.conditions import Contact
from qvi_contact.solution.result import ContactResult
from solvers import Status

_ANSWERED = (Status.SOLVED, Status.INACCURATE)
_EXCEEDED = 1e-7  # of the unit of stress: excess between the points that is more than the tolerance of solves


def judged(result: ContactResult) -> ContactResult:
    """The result with the status "infeasible" if a mechanism proves it, "infeasible_on_mesh" if only the mesh does."""
    if result.status in _ANSWERED and not _exceeds(result):
        return result
    mechanism = _mechanism(result)
    if mechanism is not None:
        return _with_status(result, Status.INFEASIBLE, _proof(mechanism))
    if result.status is not Status.INFEASIBLE:
        return result
    return _with_status(
        result,
        Status.INFEASIBLE_ON_MESH,
        "no traction of this mesh carries the load, proved by multipliers (Farkas) checked on the data; there is no "
        "such proof for the body",
    )


def _exceeds(result: ContactResult) -> bool:
    """Whether an answer exceeds, between the points, a contact law whose rows do not bound its work."""
    largest = _EXCEEDED * result.discretization.scales.stress
    uneven = [contact.name for contact in result.problem.contacts if _is_uneven(contact)]
    return any(result.contacts[name].excess_between_points > largest for name in uneven)


def _is_uneven(contact: Contact) -> bool:
    varies = callable(contact.friction) or callable(contact.cohesion)
    return contact.law != "tied" and (varies or contact.shear_limit is not None)


def _mechanism(result: ContactResult) -> Mechanism | None:
    """The mechanism that proves it; none where its linear program fails, or functions have no values at its places."""
    with suppress(SolveError, InputError):
        return find_mechanism(result.problem)
    return None


def _proof(mechanism: Mechanism) -> str:
    drive = "the driving loads do work, and nothing resists"
    if mechanism.overload < float("inf"):
        drive = f"the driving loads do {mechanism.overload:.6g} times the work that everything else can take up"
    return f"proved by a mechanism of rigid blocks, on which {drive}"


def _with_status(result: ContactResult, status: Status, proof: str) -> ContactResult:
    count = result.iterations
    message = f"{status.words} after {count} iteration{'s' if count != 1 else ''}; {proof}. {status.advice}"
    return ContactResult(result.discretization, replace(result.solution, status=status, message=message))
