"""How numbers are shown to people: what is rounding beside the problem's own units is 0; how far to trust bounds."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

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

    With S, D and L the units of stress, displacement and length, those of forces, moments, rotations and energies are
    S L, S L², D/L and S D L.

    Attributes
    ----------
    stress : float
        1e-9 S [stress].
    displacement : float
        1e-9 D, for displacements, gaps and slips [length].
    force, moment : float
        1e-9 S L and 1e-9 S L², a unit of thickness [stress × length, stress × length²].
    rotation : float
        1e-9 D/L [rad].
    energy : float
        1e-9 S D L, a unit of thickness [stress × length²].

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
