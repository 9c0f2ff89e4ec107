"""The displacement model of a result, solved once for all files that show it."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from qvi_contact.errors import InputError
from qvi_contact.solution.result import ContactResult

if TYPE_CHECKING:
    from qvi_contact.basics.units import Units
    from qvi_contact.bracket import Bracket
    from qvi_contact.companion import CompanionResult


class SecondModel:
    """The bracket of a result and its displacement, computed when first asked for, in at most so many seconds.

    Attributes
    ----------
    result : ContactResult
        The stress model's result.
    missing : str
        Why there is no bracket, or no displacement in it, once one of them was asked for.

    """

    def __init__(self, result: ContactResult, time_limit: float | None = None) -> None:
        self.result, self.missing = result, ""
        self._time_limit = time_limit

    @cached_property
    def bracket(self) -> Bracket | None:
        """The bracket; None without a stress state, for a step of a history, and for incompressible materials."""
        from qvi_contact.bracket import bracket

        if not self.result.has_state:
            self.missing = "there is no stress state"
            return None
        try:
            return bracket(self.result, time_limit=self._time_limit)
        except InputError as error:
            self.missing = error.remedy
            return None

    @cached_property
    def companion(self) -> CompanionResult | None:
        """The result of the displacement model that has a displacement."""
        if self.bracket is None:
            return None
        found = self.bracket.companion
        if found is None or not found.has_state:
            self.missing = self.bracket.message
            return None
        return found

    def write(self, path: str, units: Units) -> None:
        """Write the fields of the body, with the displacement if there is one, and those of contacts beside them."""
        from qvi_contact.files.vtu import contacts_path, write_contacts_vtu, write_vtu

        write_vtu(path, self.result, units, bracket=None if self.companion is None else self.bracket)
        if self.result.contacts:
            write_contacts_vtu(contacts_path(path), self.result, units)

    def draw(self, path: str, units: Units) -> None:
        """Draw the deformed body; `InputError` if there is no displacement."""
        from qvi_contact.plots import deformed_figure, save_figure

        if self.companion is None:
            raise InputError("output", path, f"there is no displacement to draw: {self.missing}")
        save_figure(path, deformed_figure(self.companion, units=units))
