"""The number that a refinement is for, and what its error is relative to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

from qvi_contact.errors import InputError
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult

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
_SMALL_FORCE: Final = 1e-6  # of the problem's unit: forces below count as this for relative errors


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
        contact, _, force = quantity.rpartition(".")
        if force not in _FORCES or contact not in [known.name for known in problem.contacts]:
            names = [f"{known.name}.{kind}" for known in problem.contacts for kind in _FORCES]
            raise InputError(
                "quantity", quantity, f"there is no such number; there are {', '.join(['energy', *names])}"
            )

        def value(result: ContactResult) -> float:
            return float(getattr(result.contacts[contact], force))

        def unit(result: ContactResult) -> float:
            scales = result.discretization.scales
            return max(abs(value(result)), _SMALL_FORCE * scales.stress * scales.length)

        return cls(quantity, value, unit)
