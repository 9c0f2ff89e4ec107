"""The loops that are compared: name, options, look."""

from collections.abc import Mapping
from typing import Any, Final, Literal, NamedTuple

from qvi_contact.plots import BLUE, GREEN, GREY, ORANGE, VERMILLION
from qvi_contact.plots.style import PURPLE

INNER: Final = "direct:clarabel"
"""Inner solver of all loops."""

TOLERANCE: Final = 1e-8
"""That of the residual and of the certificate."""

MAX_ITERATIONS: Final = 200

PATIENCE: Final = 60
"""Iterations without progress after which a loop is given up; long, so that slow convergence is seen for what it is."""


class Loop(NamedTuple):
    """A loop: `variant` of the fixed point (None: the condensed method) and step θ, and how it is drawn."""

    variant: Literal["plain", "damped", "anderson"] | None
    damping: float
    colour: str
    marker: str
    line: Any

    def options(self) -> dict[str, Any]:
        """Keyword arguments of `solve_qvi`."""
        if self.variant is None:
            return {"method": "condensed", "tolerance": TOLERANCE}
        return {
            "method": "fixed-point", "inner": INNER, "tolerance": TOLERANCE, "variant": self.variant,
            "damping": self.damping, "max_iterations": MAX_ITERATIONS, "patience": PATIENCE,
        }  # fmt: skip


PLAIN: Final = "plain"
ANDERSON: Final = "Anderson"
CONDENSED: Final = "condensed"

LOOPS: Final[Mapping[str, Loop]] = {
    PLAIN: Loop("plain", 1.0, VERMILLION, "o", "-"),
    "damped 0.75": Loop("damped", 0.75, ORANGE, "^", "--"),
    "damped 0.5": Loop("damped", 0.5, GREEN, "s", "-."),
    "damped 0.25": Loop("damped", 0.25, PURPLE, "v", ":"),
    ANDERSON: Loop("anderson", 0.5, BLUE, "D", (0, (5, 1))),
    CONDENSED: Loop(None, 1.0, GREY, "*", (0, (1, 1))),
}
"""All loops, in the order of tables and legends."""
