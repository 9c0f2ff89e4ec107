"""Names of the units that results are labelled with; nothing is ever converted."""

from dataclasses import dataclass

from qvi_contact.errors import InputError


@dataclass(frozen=True)
class Units:
    """What the user's numbers are measured in: labels for pictures and files.

    Parameters
    ----------
    length : str
        Unit of coordinates and displacements, such as "m" or "mm".
    stress : str
        Unit of stresses and moduli, such as "Pa" or "MPa".

    Raises
    ------
    InputError
        If a label is not a non-empty text of one line.

    """

    length: str = "length"
    stress: str = "stress"

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
        """Unit of forces a unit of thickness: stress × length."""
        return f"{self.stress} {self.length}"

    @property
    def moment(self) -> str:
        """Unit of moments a unit of thickness: stress × length²."""
        return f"{self.stress} {self.length}²"

    @property
    def energy(self) -> str:
        """Unit of energies a unit of thickness: stress × length²."""
        return f"{self.stress} {self.length}²"
