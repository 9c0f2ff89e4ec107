"""The number that a refinement is for, and what its error is relative to."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final, TypeAlias

from qvi_contact.basics.units import Units
from qvi_contact.discretization.scaling import Scales
from qvi_contact.errors import InputError
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from solvers.basics.names import known_name

Quantity: TypeAlias = str | Callable[[ContactResult], float]


@dataclass(frozen=True)
class LimitFactor:
    """The quantity of a limit analysis: the largest multiple of loads that the contacts can carry.

    Attributes
    ----------
    loads : sequence of str
        Names of the loads to multiply, see `limit_load_factor`.

    """

    loads: Sequence[str]


_FORCES: Final = ("normal_force", "tangential_force")
_PLATE_FORCES: Final = {"force_x": "x", "force_y": "y", "moment": "moment"}
_MOTIONS: Final = ("x", "y", "rotation")
_SMALL: Final = 1e-6  # of the problem's unit: numbers below count as this for relative errors

_UNITS: Final = {
    "energy": "engineering_energy",
    "moment": "engineering_moment",
    "x": "displacement",
    "y": "displacement",
    "rotation": "",
}
"""Which of the `Units` quantities are in whose names end so, all but forces."""


@dataclass(frozen=True)
class Measure:
    """A quantity: its name, its value, the unit of its relative error, and whether a bracket may bound it."""

    name: str
    value: Callable[[ContactResult], float]
    unit: Callable[[ContactResult], float]
    bounded: bool = True

    @property
    def of_a_force(self) -> bool:
        """Whether it is the force of a contact, which may have bounds where contacts slip."""
        return self.bounded and self.name.endswith(_FORCES)

    @classmethod
    def of(cls, problem: ContactProblem, quantity: Quantity) -> Measure:
        """The measure that `refine` calls by this name, or a function; `InputError` if there is none."""
        if not isinstance(quantity, str):
            if not callable(quantity):
                raise InputError("quantity", quantity, "give a name or a function of a ContactResult")
            function = quantity
            name = getattr(function, "__name__", "quantity")
            return cls(name, lambda result: float(function(result)), lambda result: abs(float(function(result))), False)
        if quantity == "energy":
            return cls(quantity, lambda result: result.energies.complementary, lambda result: result.energies.strain)
        known = dict(_known(problem))
        known_name("quantity", quantity, {"numbers": ["energy", *known]})
        value, kind = known[quantity], quantity.rpartition(".")[2]

        def unit(result: ContactResult) -> float:
            return max(abs(value(result)), _SMALL * _size(kind, result.discretization.scales))

        return cls(quantity, value, unit)


def unit_of(quantity: str, units: Units) -> str:
    """The unit of a quantity of a refinement by its name, that of forces for a function."""
    chosen = _UNITS.get(quantity.rpartition(".")[2], "engineering_force")
    return str(getattr(units, chosen)) if chosen else "rad"


def _known(problem: ContactProblem) -> Iterator[tuple[str, Callable[[ContactResult], float]]]:
    """Name → how it is read from a result, of the numbers of contacts and plates."""
    for contact in problem.contacts:
        own = contact.name
        yield from ((f"{own}.{kind}", partial(_of_contact, own, kind)) for kind in _FORCES)
        if contact.plate is not None:
            yield from ((f"{own}.{kind}", partial(_plate_force, own, part)) for kind, part in _PLATE_FORCES.items())
            yield from ((f"{own}.{kind}", partial(_plate_motion, own, kind)) for kind in _MOTIONS)


def _of_contact(name: str, kind: str, result: ContactResult) -> float:
    return float(getattr(result.contacts[name], kind))


def _plate_force(name: str, part: str, result: ContactResult) -> float:
    return float(getattr(result.plate_force(name), part))


def _plate_motion(name: str, part: str, result: ContactResult) -> float:
    return float(getattr(result.plates[name], part))


def _size(kind: str, scales: Scales) -> float:
    """The problem's unit of a force, moment, displacement or rotation."""
    if kind in _MOTIONS:
        return scales.displacement / (scales.length if kind == "rotation" else 1.0)
    return scales.stress * scales.length ** (2 if kind == "moment" else 1)
