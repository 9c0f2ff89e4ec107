"""The factor of safety on strength: by how much friction, cohesion and strengths may be divided.

Stresses of zero carry no load, and the multiples that are carried are an interval. So the loads are carried if and only
if the largest multiple of all of them together is 1 or more, which `limit_load_factor` bounds from both sides.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from qvi_contact.basics.checks import Field, positive_number
from qvi_contact.discretization.space import RowKind
from qvi_contact.errors import InputError
from qvi_contact.limit.load_factor import LimitProblem, loads_of, times
from qvi_contact.mechanism.works import BODY, FLUID
from qvi_contact.problem.conditions import Contact
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.problem.strength import Mises, MohrCoulomb, NoTension, Strength, Tresca
from solvers.basics.names import known_name
from solvers.basics.progress import watched

_FARTHEST: Final = 1e4  # factors beyond count as infinite, and below the inverse as zero
_STEP: Final = 2.0  # between the first trials


@dataclass(frozen=True)
class StrengthReduction:
    """Both sides of the factor of safety on strength.

    Attributes
    ----------
    lower : float
        Strengths divided by this carry the loads: stresses of the mesh show it. Zero if no factor was found.
    upper : float
        Strengths divided by this do not, on any mesh: a mechanism or a flow shows it. Infinity if no factor was found.

    """

    lower: float
    upper: float


def strength_reduction_factor(
    problem: ContactProblem,
    *,
    of: Sequence[str] | None = None,
    accuracy: float = 1e-3,
    degree: int | None = None,
    contact_rows: RowKind | None = None,
    time_limit: float | None = None,
) -> StrengthReduction:
    """The factor by which strengths may be divided until the loads are just carried, from both sides.

        μ/F,   c/F,   t_max/F   on contacts,       tan φ/F,   c/F   and other strengths of bodies

    Flow and slip are associated, as in `limit_load_factor`.

    Parameters
    ----------
    problem : ContactProblem
        The problem, with all its loads.
    of : sequence of str, optional
        What is divided: names of contacts, of regions, and "body" for the body's own material. By default everything.
    accuracy : float
        Relative width at which the bisections for both sides end.
    degree, contact_rows, time_limit
        As for `limit_load_factor`.

    Raises
    ------
    InputError
        If a name is unknown.
    SolveError
        If a program is not solved, or not in time.

    """
    if not isinstance(problem, ContactProblem):
        raise InputError("problem", problem, "give a ContactProblem")
    accuracy = positive_number("accuracy", accuracy)
    chosen = _chosen(problem, of)
    names = (*loads_of(problem), FLUID)
    space: dict[str, Any] = {"degree": degree, "contact_rows": contact_rows}

    def sides(factor: float) -> tuple[bool, bool]:
        """Whether the loads are carried, and whether it is not proved that they are not."""
        limit = LimitProblem.of(_reduced(problem, chosen, factor), names, **space).solved().limit
        return limit.lower >= 1.0, limit.upper >= 1.0

    with watched(time_limit):
        known: dict[float, tuple[bool, bool]] = {}
        found = []
        for side in (0, 1):
            holds, fails = 0.0, math.inf
            while True:
                for factor, answer in known.items():
                    holds = max(holds, factor) if answer[side] else holds
                    fails = fails if answer[side] else min(fails, factor)
                if holds > 0.0 and fails < math.inf:
                    if fails <= holds * (1.0 + accuracy):
                        break
                    factor = math.sqrt(holds * fails)
                else:
                    factor = 1.0 if not known else holds * _STEP if holds > 0.0 else fails / _STEP
                    if not 1.0 / _FARTHEST < factor < _FARTHEST:
                        break
                known[factor] = sides(factor)
            found.append((holds, fails))
    return StrengthReduction(found[0][0], found[1][1])


def _chosen(problem: ContactProblem, of: Sequence[str] | None) -> frozenset[str]:
    """The names of what is divided."""
    known = [contact.name for contact in problem.contacts if contact.law != "tied"]
    known += [BODY, *(region.name for region in problem.regions if region.name is not None)]
    if of is None:
        return frozenset(known)
    if isinstance(of, str) or not isinstance(of, Sequence) or not of:
        raise InputError("of", of, f"give a list of names out of {', '.join(known)}")
    return frozenset(known_name("of", name, {"contacts and regions": known}) for name in of)


def _reduced(problem: ContactProblem, chosen: frozenset[str], factor: float) -> ContactProblem:
    """The problem with strengths of what is chosen over the factor; regions without a name count as the body."""
    material = problem.material
    if BODY in chosen:
        material = replace(material, strength=_weaker(material.strength, factor))
    regions = [
        replace(region, material=replace(region.material, strength=_weaker(region.material.strength, factor)))
        if (region.name or BODY) in chosen
        else region
        for region in problem.regions
    ]
    conditions = [
        _slipperier(condition, factor)
        if isinstance(condition, Contact) and condition.name in chosen and condition.law != "tied"
        else condition
        for condition in problem.conditions
    ]
    return replace(problem, material=material, regions=regions, conditions=conditions)


def _slipperier(contact: Contact, factor: float) -> Contact:
    cap = contact.shear_limit
    return replace(
        contact,
        friction=times(contact.friction, 1.0 / factor),
        cohesion=times(contact.cohesion, 1.0 / factor),
        shear_limit=None if cap is None else times(cap, 1.0 / factor),
    )


def _weaker(strength: Strength | None, factor: float) -> Strength | None:
    def less(field: Field | None) -> Field | None:
        return None if field is None else times(field, 1.0 / factor)

    if isinstance(strength, Tresca):
        return Tresca(times(strength.c, 1.0 / factor))
    if isinstance(strength, Mises):
        return Mises(times(strength.yield_stress, 1.0 / factor))
    if isinstance(strength, MohrCoulomb):
        phi = math.atan(math.tan(strength.phi) / factor)
        return MohrCoulomb(times(strength.c, 1.0 / factor), phi, less(strength.tension))
    if isinstance(strength, NoTension):
        return NoTension(less(strength.crushing))
    return None
