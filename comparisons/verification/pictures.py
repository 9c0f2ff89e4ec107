"""What the published benchmarks look like: their bodies, loads, supports and contacts, on coarse meshes."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from comparisons.lab.report import drawn
from qvi_contact import ContactProblem
from qvi_contact.gallery import (
    block_corner,
    cylinder_in_bore,
    cylinder_on_block,
    half_discs,
    loaded_pin,
    press_fit,
    press_fit_torque,
    rings,
)
from qvi_contact.plots import problem_figure
from qvi_contact.units import Units

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STEEL: Final = Units(length="mm", stress="MPa")
_SI: Final = Units(length="m", stress="Pa")

PICTURES: Final[dict[str, tuple[Callable[[], ContactProblem], Units | None]]] = {
    "rings": (lambda: rings(4), _SI),
    "press-fit": (lambda: press_fit(2), _STEEL),
    "cylinder-in-bore": (lambda: cylinder_in_bore(2, extent=2.0), _STEEL),
    "loaded-pin": (lambda: loaded_pin(4), _STEEL),
    "sliding-corner": (lambda: block_corner(0.3, 1, 3), None),
    "cylinder-on-block": (lambda: cylinder_on_block(1.0, 2, 0), _STEEL),
    "half-discs": (lambda: half_discs(1.0, 2, 0), _STEEL),
    "slip-torque": (lambda: press_fit_torque(0.2, 47066.77, sectors=2), _STEEL),
}
"""Name of a problem of the manual → what is drawn, in its units; the bore's plate as far as two radii."""


def pictures(names: Iterable[str]) -> dict[str, str]:
    """Name → picture, as SVG, of those of these problems that have one; empty where matplotlib is not installed."""
    return {name: drawn(f"verification-{name}", partial(_draw, name)) for name in names if name in PICTURES}


def _draw(name: str) -> "Figure":
    problem, units = PICTURES[name]
    return problem_figure(problem(), **_options(units))


def _options(units: Units | None) -> dict[str, Any]:
    return {} if units is None else {"units": units}
