"""The methods compared at equal accuracy: name, options, look."""

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from qvi_contact.plots import BLUE, GREEN, GREY, ORANGE, VERMILLION

MOST: Final = 20_000
"""Iterations of Uzawa at most."""

SHRINKING: Final = 100.0
"""Iterations in which a shrinking step halves at first; it goes down like 1/(1 + i / k0)."""


class Method(NamedTuple):
    """A method: options of `solve_qvi`, and how it is drawn."""

    options: Mapping[str, Any]
    colour: str
    marker: str
    line: Any

    @property
    def is_uzawa(self) -> bool:
        """Whether it takes steps."""
        return bool(self.options["method"] == "uzawa")


UZAWA: Final = "Uzawa"
SHRINKING_UZAWA: Final = "Uzawa, shrinking step"
CONDENSED: Final = "condensed"

_DECAY: Final = {"step_decay": SHRINKING, "decay": "harmonic"}

METHODS: Final[Mapping[str, Method]] = {
    UZAWA: Method({"method": "uzawa", "max_iterations": MOST}, VERMILLION, "o", "-"),
    SHRINKING_UZAWA: Method({"method": "uzawa", "max_iterations": MOST, **_DECAY}, ORANGE, "^", "--"),
    "fixed point, QP": Method({"method": "fixed-point", "inner": "qp:clarabel"}, BLUE, "s", "-."),
    "fixed point, SOCP": Method({"method": "fixed-point", "inner": "socp:clarabel"}, GREEN, "D", ":"),
    CONDENSED: Method({"method": "condensed"}, GREY, "*", (0, (5, 1))),
}
"""Name → method, in the order of tables and legends."""
