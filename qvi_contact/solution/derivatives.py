"""Derivatives of forces and motions with respect to the data of a problem, see `ContactResult.derivative`.

All data that are offered enter (D2) as sums: a second problem, in which the datum is larger by a step, has the
direction in which loads, bounds and energies change (`solvers.derivative`). Moduli and stiffnesses are one over a
factor of a compliance, which does.

In `docs/theory.md`: (D34).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any, Final, Literal, TypeAlias

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray
from qvi_contact.discretization.scaling import Scales
from qvi_contact.errors import InputError
from qvi_contact.limit.conic import ConicProgram
from qvi_contact.limit.linear import both_signs
from qvi_contact.limit.load_factor import LimitProblem, checked_loads, loads_of, multiplied
from qvi_contact.limit.stresses import StressProgram
from qvi_contact.problem.conditions import Contact, Displacement
from qvi_contact.problem.material import Material
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from solvers import QVISolution
from solvers.basics.names import known_name
from solvers.basics.types import load
from solvers.derivative import Change, change

Side: TypeAlias = Literal["above", "below"]
"""From where a parameter comes to its value."""

_Grow: TypeAlias = Callable[[Any, float], Any]  # a value and a step, the larger value

_AGREE: Final = 1e-6  # relative difference of two one-sided derivatives that is none

_NEXT: Final = 1e-7  # of a datum: step between two programs whose rows are compared
_NEAR: Final = 1e-3  # the same for derivatives at either side of a change of mechanism
_SAME: Final = 1e-4  # relative difference of these that counts as none: they are extrapolated


@dataclass(frozen=True, eq=False)
class _Datum:
    """A number or function among the data."""

    unit: float  # a step of its size; of moduli and stiffnesses minus themselves, which doubles their compliance
    larger: Callable[[float], ContactProblem]  # the problem with it larger by a step, to first order
    may_be_less: bool = True


def derivative(result: ContactResult, quantity: str, parameter: str, side: Side | None = None) -> float:
    """See `ContactResult.derivative`."""
    if not result.certificate.passed:
        raise InputError("result", result.status.value, "derivatives need a solved result")
    if side not in (None, "above", "below"):
        raise InputError("side", side, "give 'above' or 'below', or leave it out")
    measure = load("qvi_contact.refinement.measure").Measure.of(result.problem, quantity)  # that room builds on this
    if not measure.linear:
        remedy = "give a force, a motion of a plate, or at a point NAME.slip(x, y), xx(x, y), yy(x, y) or xy(x, y)"
        raise InputError("quantity", quantity, remedy)
    known = result.discretization
    given = result.problem, known.scales
    data = {**_laws(*given), **_moved(*given), **_elastic(*given)}
    datum = data[known_name("parameter", parameter, {"parameters": data})]
    base = known.with_data(known.problem, known.scales)
    moved = known.with_data(datum.larger(datum.unit), known.scales)
    if moved.qvi.A.shape != base.qvi.A.shape or moved.qvi.n != base.qvi.n:
        raise InputError("parameter", parameter, "a step changes which unknowns there are: give its load a value first")
    value = measure.value
    at_rest = value(ContactResult(moved, replace(result.solution, problem=moved.qvi))) - value(
        ContactResult(base, replace(result.solution, problem=base.qvi))
    )

    def one_sided(sign: float) -> tuple[float, bool]:
        found = change(result.solution, base.qvi, moved.qvi, sign)
        there = value(ContactResult(known, _changed(result.solution, found))) - value(result)
        return (there * sign + at_rest) / datum.unit, found.changes_state

    above, changes = one_sided(1.0)
    if not changes or side == "above":
        return above
    below, _ = one_sided(-1.0)
    if side == "below" or abs(above - below) <= _AGREE * max(abs(above), abs(below)):
        return below
    remedy = f"a point changes its state here: the derivative is {below:.6g} from below and {above:.6g} from above; "
    raise InputError("side", None, remedy + "ask for one of them")


def _changed(solution: QVISolution, by: Change) -> QVISolution:
    return replace(
        solution,
        z=solution.z + by.z,
        normal_multiplier=solution.normal_multiplier + by.normal,
        tangential_multiplier=solution.tangential_multiplier + by.tangential,
        equality_multiplier=solution.equality_multiplier + by.equality,
    )


def limit_derivative(
    problem: ContactProblem, loads: Sequence[str], parameter: str, side: Side | None = None, **space: Any
) -> float:
    """See `LimitFactor.derivative`.

    With the rows A x ≤ b of the cone program of stresses and their multipliers y the derivative is y·(b' − A' x), where
    b' and A' are those of the rows in x (envelope theorem). Where several mechanisms have one limit, derivatives from
    both sides differ. They are those a little to either side, extrapolated.
    """
    posed = LimitProblem.of(problem, checked_loads(problem, loads), **space)
    if both_signs(posed.low).any():
        raise InputError("problem", "bilateral", "bilateral contacts with friction have no derivative: give none")
    if side not in (None, "above", "below"):
        raise InputError("side", side, "give 'above' or 'below', or leave it out")
    data = {**_laws(problem, posed.low.scales), **_strengths(problem, posed.low.scales)}
    datum = data[known_name("parameter", parameter, {"parameters": data})]

    def program(step: float) -> ConicProgram:
        low, high = (multiplied(datum.larger(step * datum.unit), posed.names, factor) for factor in (1.0, 2.0))
        first = posed.low.with_data(low, posed.low.scales)
        return StressProgram(first, first.with_data(high, posed.low.scales)).program()

    def at(step: float) -> float:
        base, further = program(step), program(step + _NEXT)
        found = base.solve()
        if isinstance(found, str):
            raise InputError(
                "loads", ", ".join(posed.names), "there is no finite limit load here: it has no derivative"
            )
        moved = further.b - base.b - (further.A @ found.x - base.A @ found.x)
        return float(found.multipliers @ moved) / (_NEXT * datum.unit)

    above = 2.0 * at(_NEAR) - at(2.0 * _NEAR)
    if not datum.may_be_less or side == "above":
        return above
    below = 2.0 * at(-_NEAR) - at(-2.0 * _NEAR)
    if side == "below":
        return below
    if abs(above - below) <= _SAME * max(abs(above), abs(below), 1e-3 / datum.unit):
        return at(0.0)
    remedy = f"another mechanism begins here: the derivative is {below:.6g} from below and {above:.6g} from above; "
    raise InputError("side", None, remedy + "ask for one of them")


# Data by name.


def _laws(problem: ContactProblem, scales: Scales) -> dict[str, _Datum]:
    """What stresses and limit loads both depend on: friction, cohesion and caps of contacts, factors of loads."""
    found = {f"load.{name}": _Datum(1.0, partial(_heavier, problem, name)) for name in loads_of(problem)}
    for number, contact in enumerate(problem.conditions):
        if isinstance(contact, Contact) and contact.law != "tied":
            for name in ("friction", "cohesion", "shear_limit"):
                value = getattr(contact, name)
                if value is not None:
                    larger = partial(_condition, problem, number, name, _plus)
                    otherwise = 1.0 if name == "friction" else scales.stress
                    found[f"{contact.name}.{name}"] = _of_size(value, otherwise, larger)
    return found


def _strengths(problem: ContactProblem, scales: Scales) -> dict[str, _Datum]:
    """What limit loads alone depend on."""
    found = dict[str, _Datum]()
    for number, (title, material) in enumerate(_named_materials(problem)):
        for each in fields(material.strength) if material.strength is not None and title is not None else ():
            value = getattr(material.strength, each.name)
            if value is not None:
                larger = partial(_material, problem, number, each.name, _plus)
                found[f"{title}.{each.name}"] = _of_size(value, 1.0 if each.name == "phi" else scales.stress, larger)
    return found


def _moved(problem: ContactProblem, scales: Scales) -> dict[str, _Datum]:
    """Places and motions of obstacles and supports, forces on plates, springs."""
    found, moved, force = dict[str, _Datum](), scales.displacement, scales.stress * scales.length
    units = dict.fromkeys(("gap", "offset", "x", "y", "normal", "tangential"), moved)
    units |= {"rotation": moved / scales.length, "force_x": force, "force_y": force, "moment": force * scales.length}
    for number, condition in enumerate(problem.conditions):
        changed = partial(_condition, problem, number)
        parts: list[Any] = [condition] if isinstance(condition, Displacement) else []
        title = condition.edges
        if isinstance(condition, Contact):
            parts, title = [condition, condition.plate], condition.name
            for name in ("normal_stiffness", "tangential_stiffness"):
                stiffness = getattr(condition, name)
                if stiffness is not None and not callable(stiffness):
                    found[f"{title}.{name}"] = _Datum(-stiffness, partial(changed, name, _stiffer))
        for of_plate, part in enumerate(parts):
            for name in units:
                if getattr(part, name, None) is not None:
                    larger = partial(changed, name, _plus, of_plate=bool(of_plate))
                    found[f"{title}.{name}"] = _Datum(units[name], larger)
    return found


def _elastic(problem: ContactProblem, scales: Scales) -> dict[str, _Datum]:
    """Temperatures, and moduli of materials."""
    found = dict[str, _Datum]()
    for number, (title, material) in enumerate(_named_materials(problem)):
        if title is not None:
            larger = partial(_material, problem, number, "young", _stiffer)
            found[f"{title}.young"] = _Datum(-material.young, larger)
    swelling = max(abs(material.expansion) for material in problem.materials)
    if swelling:
        rise = scales.stress * scales.compliance / swelling  # strains as the unit of stress does
        found["temperature"] = _Datum(rise, lambda step: replace(problem, temperature=_plus(problem.temperature, step)))
        for number, region in enumerate(problem.regions):
            if region.name is not None and region.temperature is not None:
                found[f"{region.name}.temperature"] = _Datum(rise, partial(_warmer, problem, number))
    return found


def _of_size(value: Field, otherwise: float, larger: Callable[[float], ContactProblem]) -> _Datum:
    """A datum that is not negative, whose unit is its own size where it has one."""
    if callable(value):
        return _Datum(otherwise, larger)
    return _Datum(abs(float(value)) or otherwise, larger, may_be_less=value != 0.0)


def _named_materials(problem: ContactProblem) -> Iterator[tuple[str | None, Material]]:
    """In the order of `ContactProblem.materials`."""
    return zip(("material", *(region.name for region in problem.regions)), problem.materials, strict=True)


# Problems with a datum that is larger by a step.


def _heavier(problem: ContactProblem, name: str, step: float) -> ContactProblem:
    return multiplied(problem, [name], 1.0 + step)


def _condition(
    problem: ContactProblem, number: int, name: str, grow: _Grow, step: float, *, of_plate: bool = False
) -> ContactProblem:
    """With a field of a condition, or of its plate."""
    conditions: list[Any] = list(problem.conditions)
    part = conditions[number].plate if of_plate else conditions[number]
    part = replace(part, **{name: grow(getattr(part, name), step)})
    conditions[number] = replace(conditions[number], plate=part) if of_plate else part
    return replace(problem, conditions=conditions)


def _material(problem: ContactProblem, number: int, name: str, grow: _Grow, step: float) -> ContactProblem:
    """With Young's modulus or a strength of the body, 0, or of a region, from 1."""
    material: Any = problem.materials[number]
    owner = material if name == "young" else material.strength
    owner = replace(owner, **{name: grow(getattr(owner, name), step)})
    material = owner if name == "young" else replace(material, strength=owner)
    return replace(problem, material=material) if number == 0 else _region(problem, number - 1, material=material)


def _warmer(problem: ContactProblem, number: int, step: float) -> ContactProblem:
    """With a region's own temperature."""
    return _region(problem, number, temperature=_plus(problem.regions[number].temperature or 0.0, step))


def _region(problem: ContactProblem, number: int, **changes: Any) -> ContactProblem:
    regions = list(problem.regions)
    regions[number] = replace(regions[number], **changes)
    return replace(problem, regions=regions)


def _stiffer(modulus: float, step: float) -> float:
    """Larger by a step to first order; its compliance grows linearly with the step."""
    return modulus / (1.0 - step / modulus)


def _plus(field: Field, step: float) -> Field:
    """The field, larger by a step."""
    if not callable(field):
        return field + step

    def larger(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.asarray(field(x, y), dtype=float) + step

    return larger
