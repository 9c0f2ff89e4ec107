"""What is known of forces: bounds where one prescribed displacement drives the whole problem, else differences.

If the only datum that is not zero is a displacement a of one support or obstacle, constant along it, and no energy is
lost in friction, all equations and inequalities are homogeneous. Then ∫ σ : ε(u) dx = a R with R the resultant that
belongs to a, hence J(u) = ½ a R, and the bounds of J(u) are bounds of ½ a R: for a plate pressed into the body by U,
a = g = −U, R = −P and P lies between −2 J*(τ)/U and 2 J(v)/U.

In `docs/theory.md`: (D21).

Elsewhere the forces of two models of different kind are compared, the stress's and those of a displacement whose
contacts have the laws of the problem with the pressure of its own forces.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray
from qvi_contact.bracket.law import effective, traction_coefficients
from qvi_contact.bracket.outcome import Bounds, ForceDifference
from qvi_contact.companion import CompanionResult
from qvi_contact.companion.traces import Trace
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.element import bernstein
from qvi_contact.problem.conditions import DRIVES, Contact, Displacement, Traction, components
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.contact_path import leads_one_way, turning_senses
from qvi_contact.solution.result import ContactResult


@dataclass(frozen=True)
class _Datum:
    """A prescribed value: the key of its force, the value, and whether a displacement can be bounded by it."""

    name: str
    value: Field
    drives: bool
    sign: float = 1.0


def force_bounds(discretization: Discretization, frictionless: bool, lower: float, upper: float) -> dict[str, Bounds]:
    """Bounds of the force that belongs to the one displacement that is not zero, if the problem is of that kind.

    Parameters
    ----------
    discretization : Discretization
        The problem that is bracketed.
    frictionless : bool
        Whether its friction bounds are all zero.
    lower, upper : float
        Bounds of J(u) [stress × length²].

    Returns
    -------
    dict
        "NAME.normal_force" of a contact pressed by its gap (≥ 0 under pressure), "NAME.tangential_force" of a tied one
        driven by its offset, whose tangents do not turn back; "NAME.force_x", "NAME.force_y" or "NAME.moment" on the
        body where a plate moves; "EDGES.x", "EDGES.y" of a support, the force on the body [stress × length], of one
        given by components along slanted edges "EDGES.normal", ∫ σ_N ds, or "EDGES.tangential"; empty where the problem
        is of another kind.

    """
    problem = discretization.problem
    if not frictionless or any(callable(datum.value) for datum in _data(problem)):
        return {}
    acting = [datum for datum in _data(problem) if datum.value != 0.0]
    if len(acting) != 1 or not acting[0].drives or not np.isfinite([lower, upper]).all():
        return {}
    datum = acting[0]
    assert not callable(datum.value)
    ends = sorted(datum.sign * 2.0 * bound / datum.value for bound in (lower, upper))
    return {datum.name: Bounds(*ends)}


def _data(problem: ContactProblem) -> Iterator[_Datum]:
    """All prescribed values."""
    yield _Datum("body_potential", problem.body_potential, False)
    for condition in problem.cartesian_conditions:
        if isinstance(condition, Contact):
            yield _Datum(f"{condition.name}.normal_force", condition.gap, True, sign=-1.0)
            yield _Datum(f"{condition.name}.pore_pressure", condition.pore_pressure, False)
            tied = condition.law == "tied"
            if tied:
                straight = leads_one_way(problem.mesh.vertices, problem.mesh.edges(condition.edges))
                yield _Datum(f"{condition.name}.tangential_force", condition.offset, straight)
            plate = condition.plate
            for force, motion in DRIVES.items() if plate is not None else ():
                yield _Datum(f"{condition.name}.plate", getattr(plate, force) or 0.0, False)
                yield _Datum(f"{condition.name}.{force}", getattr(plate, motion) or 0.0, True)
        elif isinstance(condition, (Traction, Displacement)):
            for component, value in components(condition).items():
                yield _Datum(f"{condition.edges}.{component}", value, isinstance(condition, Displacement))


def force_differences(result: ContactResult, own: CompanionResult) -> dict[str, ForceDifference]:
    """By contact how far the forces of a stress are from those of a displacement, |Σ_i ∫ τ B_i ds − z_i|.

    The sum is over the coefficients that carry a force of the contact: what acts on a coefficient that supports hold is
    theirs. Shear counts in the sense of the tangential force.
    """
    assert own.state is not None
    known, contacts, unit = result.discretization, own.state.contacts, own.scales.stress * own.scales.length
    forces = contacts.weights * own.state.tractions * unit
    found, start = {}, 0
    for rows, trace in zip(known.contacts, contacts.traces, strict=True):
        chosen = slice(start, start + trace.count)
        senses = turning_senses(known.problem.mesh.vertices, trace.edges)
        parts = traction_coefficients(known, effective(known, result.dofs, rows))
        sums = []
        for part, theirs, live, sense in zip(
            parts,
            forces.reshape(2, -1),
            own.state.live.reshape(2, -1),
            (np.ones(len(senses)), senses),
            strict=True,
        ):
            ours = _moments(sense[:, None] * part, trace) * known.scales.stress * known.scales.length
            difference = ours - trace.by_coefficient(sense) * theirs[chosen]
            sums.append(float(difference[live[chosen]].sum()))
        found[trace.name] = ForceDifference(abs(sums[0]), abs(sums[1]))
        start += trace.count
    return found


def _moments(tractions: FloatArray, trace: Trace) -> FloatArray:
    """∫ τ B_i ds (n,) at the coefficients of a contact, dimensionless, from those of τ (e, q)."""
    products = bernstein.product_integrals(tractions.shape[1] - 1, trace.columns.shape[1] - 1)
    on_edges = trace.lengths[:, None] * (tractions @ products)
    return np.asarray(np.bincount(trace.columns.ravel(), on_edges.ravel(), minlength=trace.count))
