"""How numbers are shown to people: the names of their units, as nothing is ever converted; rounding as 0; certainty."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar, Final

from qvi_contact.basics.schema import Name
from qvi_contact.errors import InputError

_FORCES: Final = {
    ("Pa", "m"): "N/m", ("N/m²", "m"): "N/m", ("kPa", "m"): "kN/m", ("kN/m²", "m"): "kN/m", ("MPa", "m"): "MN/m",
    ("GPa", "m"): "GN/m", ("MPa", "mm"): "N/mm", ("N/mm²", "mm"): "N/mm", ("GPa", "mm"): "kN/mm",
    ("kN/mm²", "mm"): "kN/mm", ("psi", "in"): "lbf/in", ("ksi", "in"): "kip/in",
}  # fmt: skip
"""Forces a unit of thickness by the units of stress and length, where their product has a name."""

_NUMBER: Final = re.compile(r"(?<=\d )\[(length|stress|stress × length)\]")
"""What stands behind a number in a sentence whose author does not know the user's units."""


@dataclass(frozen=True)
class Units:
    """What the user's numbers are measured in: labels for pictures and files.

    `InputError` if a label is not a non-empty text of one line.
    """

    length: Name = "length"
    """Unit of coordinates and displacements, such as "m" or "mm": `length = "mm"`."""
    stress: Name = "stress"
    """Unit of stresses and moduli, such as "Pa" or "MPa": `stress = "MPa"`."""
    rotation: ClassVar[str] = "rad"
    """Unit of rotations."""

    @classmethod
    def labels(cls, units: object, quantities: Mapping[str, str]) -> dict[str, str]:
        """Name → unit, of names and the quantity that each is; none where no units are given."""
        if units is None:
            return {}
        if not isinstance(units, cls):
            raise InputError("units", units, "give Units, such as Units('mm', 'MPa'), or leave them out")
        return {name: str(getattr(units, quantity)) for name, quantity in quantities.items()}

    def __post_init__(self) -> None:
        for name in ("length", "stress"):
            value = getattr(self, name)
            if not isinstance(value, str) or not value.strip() or not value.isprintable():
                raise InputError(f"Units.{name}", value, "give the unit's name, such as 'mm' or 'MPa'")
            object.__setattr__(self, name, value.strip())

    @property
    def displacement(self) -> str:
        """Unit of displacements, gaps and slips: that of length."""
        return self.length

    @property
    def force(self) -> str:
        """Unit of forces a unit of thickness as engineers write it: N/mm for MPa and mm; else stress × length."""
        return _FORCES.get((self.stress, self.length), f"{self.stress} {self.length}")

    @property
    def moment(self) -> str:
        """Unit of moments a unit of thickness, and of energies: N mm/mm for MPa and mm; else stress × length²."""
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
        """A sentence about a result with its numbers in these units: "0.2 MPa" for "0.2 [stress]".

        Remarks, and the reasons of a bracket, name the dimension in brackets. It stays where its unit has no name.
        """

        def called(found: re.Match[str]) -> str:
            names = {name: str(getattr(self, name)) for name in found[1].split(" × ")}
            unknown = any(name == unit for name, unit in names.items())
            return found[0] if unknown else names.get(found[1], self.force)

        return _NUMBER.sub(called, sentence)


SHARE: Final = 1e-9
"""Share of the units of a problem up to which a number is rounding."""


class Certainty(StrEnum):
    """How far bounds, and errors, can be trusted: the text says it."""

    ESTIMATE = "estimate"
    GUARANTEED = "guaranteed"


def shown(value: float, least: float = 0.0, digits: int = 6) -> str:
    """The number with so many digits; 0 where it is at most `least` in size."""
    return "0" if abs(value) <= least else f"{value:.{digits}g}"


@dataclass(frozen=True)
class Rounding:
    """Sizes up to which numbers of a result are rounding: 1e-9 of units of its problem or result, or another share.

    With S, D and L the units of stress, displacement and length, those of forces and moments a unit of thickness,
    rotations [rad] and energies are S L, S L², D/L and S D L.
    """

    stress: float = 0.0
    displacement: float = 0.0
    force: float = 0.0
    moment: float = 0.0
    rotation: float = 0.0
    energy: float = 0.0

    @classmethod
    def of(cls, stress: float, displacement: float, length: float, share: float = SHARE) -> "Rounding":
        """So large a share of the units S, D and L."""
        return cls(
            stress=share * stress,
            displacement=share * displacement,
            force=share * stress * length,
            moment=share * stress * length**2,
            rotation=share * displacement / length,
            energy=share * stress * displacement * length,
        )

    @classmethod
    def largest(cls, each: Iterable["Rounding"]) -> "Rounding":
        """That of several results which are shown together, such as the steps of a history."""
        found = list(each)
        return cls(*(max((getattr(one, name) for one in found), default=0.0) for name in cls.__dataclass_fields__))
