"""How numbers are shown: names of their units, which are never converted; rounding as 0; certainty of bounds."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar, Final

from qvi_contact.basics.schema import Checked, Name
from qvi_contact.errors import InputError

_FORCES: Final = {
    ("Pa", "m"): "N/m", ("N/m²", "m"): "N/m", ("kPa", "m"): "kN/m", ("kN/m²", "m"): "kN/m", ("MPa", "m"): "MN/m",
    ("GPa", "m"): "GN/m", ("MPa", "mm"): "N/mm", ("N/mm²", "mm"): "N/mm", ("GPa", "mm"): "kN/mm",
    ("kN/mm²", "mm"): "kN/mm", ("psi", "in"): "lbf/in", ("ksi", "in"): "kip/in",
}  # fmt: skip
"""Unit of forces per unit of thickness by the units of stress and length, if their product has a name."""

_NUMBER: Final = re.compile(r"(?<=\d )\[(length|stress|stress × length)\]")
"""A dimension after a number, in sentences that are written without the user's units."""


@dataclass(frozen=True)
class Units(Checked):
    """The units of the user's numbers: labels for pictures and files.

    `InputError` if a label is not a text of one line.
    """

    length: Name = "length"
    """Unit of coordinates and displacements, such as "m" or "mm": `length = "mm"`."""
    stress: Name = "stress"
    """Unit of stresses and moduli, such as "Pa" or "MPa": `stress = "MPa"`."""
    rotation: ClassVar[str] = "rad"
    """Unit of rotations."""

    @classmethod
    def labels(cls, units: object, quantities: Mapping[str, str]) -> dict[str, str]:
        """Unit by name, from the quantity of each name that has one; empty without units."""
        if units is None:
            return {}
        if not isinstance(units, cls):
            raise InputError("units", units, "give Units, such as Units('mm', 'MPa'), or leave them out")
        return {name: str(getattr(units, quantity)) for name, quantity in quantities.items() if quantity}

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("length", "stress"):
            object.__setattr__(self, name, getattr(self, name).strip())

    @property
    def displacement(self) -> str:
        """Unit of displacements, gaps and slips: that of length."""
        return self.length

    @property
    def force(self) -> str:
        """Unit of forces per unit of thickness: N/mm for MPa and mm; else stress × length."""
        return _FORCES.get((self.stress, self.length), f"{self.stress} {self.length}")

    @property
    def moment(self) -> str:
        """Unit of moments per unit of thickness, and of energies: N mm/mm for MPa and mm; else stress × length²."""
        force = _FORCES.get((self.stress, self.length))
        return self.airy if force is None else f"{force.split('/')[0]} {self.length}/{self.length}"

    energy = moment

    @property
    def stiffness(self) -> str:
        """Unit of springs along contacts: stress / length."""
        return f"{self.stress}/{self.length}"

    @property
    def airy(self) -> str:
        """Unit of Airy functions: stress × length²."""
        return f"{self.stress} {self.length}²"

    def filled(self, sentence: str) -> str:
        """A sentence about a result with units in place of dimensions: "0.2 MPa" for "0.2 [stress]".

        Remarks, and the reasons of a bracket, have the dimension in brackets. A dimension without a unit stays.
        """
        if not isinstance(sentence, str):
            raise InputError("sentence", sentence, "give a text")

        def with_unit(match: re.Match[str]) -> str:
            names = {name: str(getattr(self, name)) for name in match[1].split(" × ")}
            unknown = any(name == unit for name, unit in names.items())
            return match[0] if unknown else names.get(match[1], self.force)

        return _NUMBER.sub(with_unit, sentence)


SHARE: Final = 1e-9
"""Size of a number, relative to the units of its problem, up to which it is rounding."""

LEAST_SHOWN: Final = 1e-6
"""A number is shown as 0 up to this share of the largest of its kind beside it, which is shown with six digits."""


class Certainty(StrEnum):
    """Whether a bound or error is an estimate or guaranteed."""

    ESTIMATE = "estimate"
    GUARANTEED = "guaranteed"


def shown(value: float, least: float = 0.0, digits: int = 6) -> str:
    """The text of a number with `digits` significant digits; "0" if it is at most `least` in size."""
    return "0" if abs(value) <= least else f"{value:.{digits}g}"


_COMPARED: Final = {"moment": "force", "rotation": "displacement"}


@dataclass(frozen=True)
class Rounding:
    """Sizes up to which numbers of a result are rounding: by default 1e-9 of the units of its problem or result.

    With units S, D and L of stress, displacement and length, the units of forces and moments per unit of thickness, of
    rotations [rad] and of energies are S L, S L², D/L and S D L.
    """

    stress: float = 0.0
    displacement: float = 0.0
    force: float = 0.0
    moment: float = 0.0
    rotation: float = 0.0
    energy: float = 0.0

    @classmethod
    def of(cls, stress: float, displacement: float, length: float, share: float = SHARE) -> "Rounding":
        """The fraction `share` of the units from S, D and L."""
        force, rotation = share * stress * length, share * displacement / length
        return cls(share * stress, share * displacement, force, force * length, rotation, force * displacement)

    def cleaned(self, numbers: Sequence[float], kinds: Collection[str]) -> list[float]:
        """The numbers in one row of a table; `kinds` has a field of this class for each.

        A number is 0 up to its rounding, and up to `LEAST_SHOWN` of the largest number of its kind beside it. Moments
        are compared with forces too, and rotations with displacements, through the unit of length; not the other way
        round, as the moment about a distant point is large whatever the forces are.
        """
        least = [getattr(self, kind) for kind in kinds]
        sizes = [abs(value) / (unit or 1.0) for value, unit in zip(numbers, least, strict=True)]
        beside = {kind: (kind, _COMPARED.get(kind, kind)) for kind in kinds}
        largest = {
            kind: max(size for size, of in zip(sizes, kinds, strict=True) if of in beside[kind]) for kind in kinds
        }
        limits = [max(unit > 0.0, LEAST_SHOWN * largest[kind]) for unit, kind in zip(least, kinds, strict=True)]
        return [0.0 if size <= limit else value for value, size, limit in zip(numbers, sizes, limits, strict=True)]

    @classmethod
    def largest(cls, roundings: Iterable["Rounding"]) -> "Rounding":
        """The largest of several results that are shown together, such as the steps of a history."""
        given = list(roundings)
        return cls(*(max((getattr(each, name) for each in given), default=0.0) for name in cls.__dataclass_fields__))
