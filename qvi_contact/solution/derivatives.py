"""Derivatives of forces and motions with respect to the data of a problem, see `ContactResult.derivative`.

All data that are offered enter (D2) as sums: a second problem, in which the datum is larger by a step, has the
direction in which loads, bounds and energies change (`solvers.derivative`). Moduli and stiffnesses are one over a
factor of a compliance, which does.

In `docs/theory.md`: (D34).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, Final, Literal, NamedTuple, TypeAlias

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray
from qvi_contact.basics.schema import keys_of
from qvi_contact.discretization.scaling import Scales
from qvi_contact.errors import InputError
from qvi_contact.limit.conic import ConicProgram
from qvi_contact.limit.linear import both_signs
from qvi_contact.limit.load_factor import LimitProblem, checked_loads, loads_of, multiplied
from qvi_contact.limit.stresses import StressProgram
from qvi_contact.problem.conditions import DRIVES, SHEAR_LAW, SPRINGS, Contact, Displacement, RigidPlate, components
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from solvers import QVISolution
from solvers.basics.names import known_name
from solvers.basics.types import load
from solvers.derivative import Change, change

Side: TypeAlias = Literal["above", "below"]
"""From where a parameter comes to its value."""

_AGREE: Final = 1e-6  # relative difference of two one-sided derivatives that is none

_NEXT: Final = 1e-7  # of a datum: step between two programs whose rows are compared
_NEAR: Final = 1e-3  # the same for derivatives at either side of a change of mechanism
_SAME: Final = 1e-4  # relative difference of these that counts as none: they are extrapolated


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
    chosen = _datum(result.problem, known.scales, parameter, dict(_paths(result.problem)))
    base = known.with_data(known.problem, known.scales)
    moved = known.with_data(chosen.moved(1.0), known.scales)
    if moved.qvi.A.shape != base.qvi.A.shape or moved.qvi.n != base.qvi.n:
        raise InputError("parameter", parameter, "a step changes which unknowns there are: give its load a value first")
    value = measure.value
    at_rest = value(ContactResult(moved, replace(result.solution, problem=moved.qvi))) - value(
        ContactResult(base, replace(result.solution, problem=base.qvi))
    )

    def one_sided(sign: float) -> tuple[float, bool]:
        found = change(result.solution, base.qvi, moved.qvi, sign)
        there = value(ContactResult(known, _moved(result.solution, found))) - value(result)
        return (there * sign + at_rest) / chosen.unit, found.changes_state

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


_Path: TypeAlias = tuple[str | int, ...]
"""Fields and places in lists that lead from a problem to a datum; ("load", NAME) to the factor of a load."""


def _paths(problem: ContactProblem) -> Iterator[tuple[str, _Path]]:
    """All data by name."""
    for number, condition in enumerate(problem.conditions):
        at = "conditions", number
        if isinstance(condition, Contact):
            names = [name for name in SPRINGS if not callable(getattr(condition, name))]
            names += ["gap", "offset", *(() if condition.law == "tied" else SHEAR_LAW)]
            known: list[_Path] = [(name,) for name in names if getattr(condition, name) is not None]
            drives = [*DRIVES.values(), *DRIVES]
            known += [("plate", name) for name in drives if getattr(condition.plate, name, None) is not None]
            yield from ((f"{condition.name}.{path[-1]}", (*at, *path)) for path in known)
        elif isinstance(condition, Displacement):
            yield from ((f"{condition.edges}.{name}", (*at, name)) for name in components(condition))
    yield from ((f"load.{name}", ("load", name)) for name in loads_of(problem))
    if any(material.expansion for material in problem.materials):
        yield "temperature", ("temperature",)
        for number, region in enumerate(problem.regions):
            if region.name is not None and region.temperature is not None:
                yield f"{region.name}.temperature", ("regions", number, "temperature")
    yield from ((f"{name}.young", (*path, "young")) for name, path in _materials(problem))


def _limit_paths(problem: ContactProblem) -> Iterator[tuple[str, _Path]]:
    """Data of limit loads by name."""
    for number, contact in enumerate(problem.conditions):
        if isinstance(contact, Contact) and contact.law != "tied":
            known = (name for name in SHEAR_LAW if getattr(contact, name) is not None)
            yield from ((f"{contact.name}.{name}", ("conditions", number, name)) for name in known)
    yield from ((f"load.{name}", ("load", name)) for name in loads_of(problem))
    for title, path in _materials(problem):
        strength = _at(problem, path).strength
        known = (each.name for each in (() if strength is None else fields(strength)))
        yield from (
            (f"{title}.{name}", (*path, "strength", name)) for name in known if getattr(strength, name) is not None
        )


def _materials(problem: ContactProblem) -> Iterator[tuple[str, _Path]]:
    """That of the body, and those of regions that have a name."""
    yield "material", ("material",)
    for number, region in enumerate(problem.regions):
        if region.name is not None:
            yield region.name, ("regions", number, "material")


def _at(part: Any, path: _Path) -> Any:
    """What a path leads to."""
    for place in path:
        part = part[place] if isinstance(place, int) else getattr(part, place)
    return part


def _with(part: Any, path: _Path, value: Any) -> Any:
    """The same with another value at the end of a path."""
    place, *rest = path
    if rest:
        value = _with(_at(part, (place,)), tuple(rest), value)
    return [*part[:place], value, *part[place + 1 :]] if isinstance(place, int) else replace(part, **{place: value})


class _Datum(NamedTuple):
    """The problem with a datum larger by so many units, what a unit is, and whether the datum is 0 and may not be less.

    One unit more of a modulus makes its compliance twice as large: that is less than the modulus.
    """

    moved: Callable[[float], ContactProblem]
    unit: float
    least: bool


def _datum(
    problem: ContactProblem, scales: Scales, parameter: str, paths: Mapping[str, _Path], *, relative: bool = False
) -> _Datum:
    """The datum of a name, with its own size as unit if `relative`; temperatures grow by what has that of stress."""
    path = paths[known_name("parameter", parameter, {"parameters": paths})]
    name = str(path[-1])
    if path[0] == "load":
        return _Datum(lambda step: multiplied(problem, [name], 1.0 + step), 1.0, least=False)
    value = _at(problem, path)
    if name == "young" or name in SPRINGS:
        return _Datum(lambda step: _with(problem, path, value / (1.0 + step)), -value, least=False)
    force = scales.stress * scales.length
    units = {"": 1.0, "stress": scales.stress, "length": scales.displacement, "force": force}
    units |= {"moment": force * scales.length, "rad": scales.displacement / scales.length}
    part = _at(problem, path[:-1])
    if isinstance(part, Contact | RigidPlate):
        unit = units[keys_of(type(part))[name].unit]
    elif name == "temperature":
        unit = scales.stress * scales.compliance / max(abs(each.expansion) for each in problem.materials)
    elif name == "phi":
        unit = 1.0
    else:
        unit = scales.stress if "strength" in path else scales.displacement
    if relative and not callable(value):
        unit = abs(value) or unit
    return _Datum(
        lambda step: _with(problem, path, _plus(value, step * unit)), unit, not callable(value) and value == 0.0
    )


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
    datum = _datum(problem, posed.low.scales, parameter, dict(_limit_paths(problem)), relative=True)
    unit = datum.unit

    def program(step: float) -> ConicProgram:
        low, high = (multiplied(datum.moved(step), posed.names, factor) for factor in (1.0, 2.0))
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
    if datum.least or side == "above":
        return above
    below = 2.0 * at(-_NEAR) - at(-2.0 * _NEAR)
    if side == "below":
        return below
    if abs(above - below) <= _SAME * max(abs(above), abs(below), 1e-3 / unit):
        return at(0.0)
    remedy = f"another mechanism begins here: the derivative is {below:.6g} from below and {above:.6g} from above; "
    raise InputError("side", None, remedy + "ask for one of them")
