"""Two-sided bounds of a force where one prescribed displacement drives the whole problem.

If the only datum that is not zero is a displacement a of one support or obstacle, constant along it, and no energy is
lost in friction, all equations and inequalities are homogeneous. Then ∫ σ : ε(u) dx = a R with R the resultant that
belongs to a, hence J(u) = ½ a R, and the bounds of J(u) are bounds of ½ a R: for a plate pressed into the body by U,
a = g = −U, R = −P and P lies between −2 J*(τ)/U and 2 J(v)/U.

In `docs/theory.md`: (D21).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from qvi_contact.basics.checks import Field
from qvi_contact.bracket.outcome import Bounds
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.problem.conditions import Contact, Displacement, Traction, components
from qvi_contact.problem.problem import ContactProblem


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
        driven by its offset, or "EDGES.x", "EDGES.y" of a support, the force on the body [stress × length], of one
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
            tied = condition.law == "tied"
            if tied:
                yield _Datum(f"{condition.name}.tangential_force", condition.offset, True)
            plate = condition.plate
            for force in (plate.force_x, plate.force_y, plate.moment) if plate is not None else ():
                yield _Datum(f"{condition.name}.plate", force or 0.0, False)
        elif isinstance(condition, (Traction, Displacement)):
            for component, value in components(condition).items():
                yield _Datum(f"{condition.edges}.{component}", value, isinstance(condition, Displacement))
