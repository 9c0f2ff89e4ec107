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
from qvi_contact.problem.conditions import SHEAR_LAW, SPRINGS, Contact, Displacement, components
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from solvers import QVISolution
from solvers.basics.names import known_name
from solvers.basics.types import load
from solvers.derivative import Change, change

Side: TypeAlias = Literal["above", "below"]
"""From where a parameter comes to its value."""

_LAWS: Final = (*SHEAR_LAW, "gap", "offset")
_AGREE: Final = 1e-6  # relative difference of two one-sided derivatives that is none

_NEXT: Final = 1e-7  # of a datum: step between two programs whose rows are compared
_NEAR: Final = 1e-3  # the same for derivatives at either side of a change of mechanism
_SAME: Final = 1e-4  # relative difference of these that counts as none: they are extrapolated


@dataclass(frozen=True, eq=False)
class _Parameter:
    """A datum: the problem with it larger by a step, and the derivative by it over that by the step's direction."""

    moved: Callable[[], ContactProblem]
    factor: float


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
    parameters = dict(_parameters(result.problem, known.scales))
    chosen = parameters[known_name("parameter", parameter, {"parameters": parameters})]
    base = known.with_data(known.problem, known.scales)
    moved = known.with_data(chosen.moved(), known.scales)
    if moved.qvi.A.shape != base.qvi.A.shape or moved.qvi.n != base.qvi.n:
        raise InputError("parameter", parameter, "a step changes which unknowns there are: give its load a value first")
    value = measure.value
    at_rest = value(ContactResult(moved, replace(result.solution, problem=moved.qvi))) - value(
        ContactResult(base, replace(result.solution, problem=base.qvi))
    )

    def one_sided(sign: float) -> tuple[float, bool]:
        found = change(result.solution, base.qvi, moved.qvi, sign)
        there = value(ContactResult(known, _moved(result.solution, found))) - value(result)
        return chosen.factor * (there * sign + at_rest), found.changes_state

    above, changes = one_sided(1.0)
    if not changes or side == "above":
        return above
    below, _ = one_sided(-1.0)
    if side == "below" or abs(above - below) <= _AGREE * max(abs(above), abs(below)):
        return below
    remedy = f"a point changes its state here: the derivative is {below:.6g} from below and {above:.6g} from above; "
    raise InputError("side", None, remedy + "ask for one of them")


def _moved(solution: QVISolution, by: Change) -> QVISolution:
    return replace(
        solution,
        z=solution.z + by.z,
        normal_multiplier=solution.normal_multiplier + by.normal,
        tangential_multiplier=solution.tangential_multiplier + by.tangential,
        equality_multiplier=solution.equality_multiplier + by.equality,
    )


def _parameters(problem: ContactProblem, scales: Scales) -> Iterator[tuple[str, _Parameter]]:
    """All of them by name."""
    for number, condition in enumerate(problem.conditions):
        if isinstance(condition, Contact):
            yield from _of_contact(problem, scales, number, condition)
        elif isinstance(condition, Displacement):
            for name in components(condition):
                yield f"{condition.edges}.{name}", _of_condition(problem, scales, number, name)
    for name in loads_of(problem):
        yield f"load.{name}", _Parameter(partial(multiplied, problem, [name], 2.0), 1.0)
    yield from _of_body(problem, scales)


def _of_contact(
    problem: ContactProblem, scales: Scales, number: int, contact: Contact
) -> Iterator[tuple[str, _Parameter]]:
    """Law, place, springs and plate of one contact."""
    for name in _LAWS:
        if getattr(contact, name) is not None and (contact.law != "tied" or name in ("gap", "offset")):
            yield f"{contact.name}.{name}", _of_condition(problem, scales, number, name)
    for name in SPRINGS:
        stiffness = getattr(contact, name)
        if stiffness is not None and not callable(stiffness):
            softer = _changed(problem, number, **{name: stiffness / 2.0})
            yield f"{contact.name}.{name}", _Parameter(softer, -1.0 / stiffness)
    for name in ("x", "y", "rotation", "force_x", "force_y", "moment"):
        if getattr(contact.plate, name, None) is not None:
            yield f"{contact.name}.{name}", _of_condition(problem, scales, number, name, of_plate=True)


def _changed(problem: ContactProblem, number: int, **changes: Any) -> Callable[[], ContactProblem]:
    """The problem with other fields of one condition."""
    conditions = list(problem.conditions)
    conditions[number] = replace(conditions[number], **changes)
    return partial(replace, problem, conditions=conditions)


def _of_condition(
    problem: ContactProblem, scales: Scales, number: int, name: str, *, of_plate: bool = False
) -> _Parameter:
    """A field of a condition or of its plate, which grows by its unit."""
    units = dict.fromkeys(SHEAR_LAW, scales.stress) | {"friction": 1.0}
    units |= {"rotation": scales.displacement / scales.length, "moment": scales.stress * scales.length**2}
    units |= dict.fromkeys(("force_x", "force_y"), scales.stress * scales.length)
    step, condition = units.get(name, scales.displacement), problem.conditions[number]
    part: Any = condition.plate if of_plate and isinstance(condition, Contact) else condition
    changes = {name: _plus(getattr(part, name), step)}
    if of_plate:
        changes = {"plate": replace(part, **changes)}
    return _Parameter(_changed(problem, number, **changes), 1.0 / step)


def _of_body(problem: ContactProblem, scales: Scales) -> Iterator[tuple[str, _Parameter]]:
    """Temperature, which grows by what has the unit of stress, and moduli, where the compliance doubles."""
    swelling = max(abs(material.expansion) for material in problem.materials)
    step = scales.stress * scales.compliance / swelling if swelling else 0.0
    if swelling:
        yield (
            "temperature",
            _Parameter(lambda: replace(problem, temperature=_plus(problem.temperature, step)), 1 / step),
        )
    main = problem.material
    yield (
        "material.young",
        _Parameter(lambda: replace(problem, material=replace(main, young=main.young / 2.0)), -1.0 / main.young),
    )

    def with_region(number: int, **changes: Any) -> ContactProblem:
        regions = list(problem.regions)
        regions[number] = replace(regions[number], **changes)
        return replace(problem, regions=regions)

    for number, region in enumerate(problem.regions):
        if region.name is not None:
            young, softer = region.material.young, replace(region.material, young=region.material.young / 2.0)
            yield f"{region.name}.young", _Parameter(partial(with_region, number, material=softer), -1.0 / young)
            if swelling and region.temperature is not None:
                warmer = _plus(region.temperature, step)
                moved = partial(with_region, number, temperature=warmer)
                yield f"{region.name}.temperature", _Parameter(moved, 1.0 / step)


def _plus(field: Field, step: float) -> Field:
    """The field, larger by a step."""
    if not callable(field):
        return field + step

    def larger(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.asarray(field(x, y), dtype=float) + step

    return larger


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
    data = dict(_limit_data(problem, posed.low.scales))
    unit, least, moved = data[known_name("parameter", parameter, {"parameters": data})]

    def program(step: float) -> ConicProgram:
        low, high = (multiplied(moved(step * unit), posed.names, factor) for factor in (1.0, 2.0))
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
        return float(found.multipliers @ moved) / (_NEXT * unit)

    above = 2.0 * at(_NEAR) - at(2.0 * _NEAR)
    if not least or side == "above":
        return above
    below = 2.0 * at(-_NEAR) - at(-2.0 * _NEAR)
    if side == "below":
        return below
    if abs(above - below) <= _SAME * max(abs(above), abs(below), 1e-3 / unit):
        return at(0.0)
    remedy = f"another mechanism begins here: the derivative is {below:.6g} from below and {above:.6g} from above; "
    raise InputError("side", None, remedy + "ask for one of them")


_Datum: TypeAlias = tuple[float, bool, Callable[[float], ContactProblem]]
"""A unit, whether the datum may be less than it is, and the problem with it larger by a step."""


def _limit_data(problem: ContactProblem, scales: Scales) -> Iterator[tuple[str, _Datum]]:
    """Data of limit loads by name."""
    for number, contact in enumerate(problem.conditions):
        if isinstance(contact, Contact) and contact.law != "tied":
            for name in SHEAR_LAW:
                value = getattr(contact, name)
                if value is not None:
                    unit = _unit(value, 1.0 if name == "friction" else scales.stress)
                    yield f"{contact.name}.{name}", (*unit, partial(_rougher, problem, number, name))
    for name in loads_of(problem):
        yield f"load.{name}", (1.0, True, partial(_heavier, problem, name))
    owners = [("material", problem.material), *((region.name, region.material) for region in problem.regions)]
    for number, (title, material) in enumerate(owners):
        strength = material.strength
        for each in fields(strength) if strength is not None and title is not None else ():
            value = getattr(strength, each.name)
            if value is not None:
                unit = _unit(value, 1.0 if each.name == "phi" else scales.stress)
                yield f"{title}.{each.name}", (*unit, partial(_stronger, problem, number, each.name))


def _unit(value: Field, otherwise: float) -> tuple[float, bool]:
    return (otherwise, True) if callable(value) else (abs(float(value)) or otherwise, value != 0.0)


def _rougher(problem: ContactProblem, number: int, name: str, step: float) -> ContactProblem:
    return _changed(problem, number, **{name: _plus(getattr(problem.conditions[number], name), step)})()


def _heavier(problem: ContactProblem, name: str, step: float) -> ContactProblem:
    return multiplied(problem, [name], 1.0 + step)


def _stronger(problem: ContactProblem, number: int, name: str, step: float) -> ContactProblem:
    """With another strength of the body, 0, or of a region, from 1."""
    material = problem.material if number == 0 else problem.regions[number - 1].material
    changes: Any = {name: _plus(getattr(material.strength, name), step)}
    assert material.strength is not None  # as listed
    material = replace(material, strength=replace(material.strength, **changes))
    if number == 0:
        return replace(problem, material=material)
    regions = list(problem.regions)
    regions[number - 1] = replace(regions[number - 1], material=material)
    return replace(problem, regions=regions)
