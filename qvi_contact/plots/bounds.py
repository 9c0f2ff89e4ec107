"""The displacement model's deformed body, and where the bounds of the energy are apart."""

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from qvi_contact.basics.units import Units
from qvi_contact.bracket import Bracket
from qvi_contact.errors import InputError
from qvi_contact.mesh.edges import cross
from qvi_contact.plots.style import (
    BLUE,
    GREEN,
    ORANGE,
    colour_bar,
    draw_outline,
    edge_lines,
    lines,
    new_figure,
    plain_text,
    plain_units,
    show_all,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DECADES: Final = 6.0  # shown below the largest share
_LOOKS: Final = {"bulk": (BLUE, ""), "contact": (ORANGE, "//"), "friction": (GREEN, ".."), "springs": ("0.6", "xx")}
_SAMPLES: Final = 160  # parts of cells along the longer side
_MOST_CELLS: Final = 6400  # whose outlines are drawn
_POINTS: Final = 9  # of a curved edge


def bracket_figure(bracket: Bracket, units: Units | None = None, title: str = "") -> "Figure":
    """The map of the gap, contacts as lines, the gap by origin: bulk, contact, friction, springs [stress × length²].

    `InputError` where a bound is missing: there is no gap to draw.
    """
    units = plain_units(units)
    if not np.isfinite(bracket.gap):
        raise InputError("bracket", bracket.gap, f"there is no duality gap to draw: {bracket.message}")
    figure = new_figure(9.0, 4.2)
    left, _, right = figure.subplots(1, 3, width_ratios=(1.6, 0.12, 1.0))
    _.set_axis_off()
    _gap_map(left, bracket, units)
    parts = bracket.parts
    for number, (name, value) in enumerate(parts.items()):
        colour, hatch = _LOOKS[name]
        right.bar(number, value, color=colour, hatch=hatch, edgecolor="white")
        right.annotate(f"{value:.3g}", (number, value), ha="center", va="bottom")
    right.set_xticks(range(len(parts)), list(parts))
    right.margins(y=0.15)
    right.set_ylabel(f"part of the duality gap [{units.engineering_energy}]")
    right.spines[["top", "right"]].set_visible(False)
    energies = f"Energy between {bracket.lower:.7g} and {bracket.upper:.7g} {units.engineering_energy}"
    above = f"{energies} ({bracket.certainty})\nfor {bracket.kind.value}".replace("-", "−")
    figure.suptitle(plain_text("\n".join(filter(None, [title, above]))), fontsize=9)
    return figure


def _gap_map(axes: "Axes", bracket: Bracket, units: Units) -> None:
    """What each cell adds to the gap between the energy's bounds, by its area, on a logarithmic scale; contacts."""
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import LogNorm

    mesh = bracket.problem.mesh
    a, b, c = mesh.corners.swapaxes(0, 1)
    density = bracket.cell_gaps / (np.abs(cross(b - a, c - a)) / 2.0)
    largest = float(density.max()) or 1.0
    least = max(float(density[density > 0.0].min(initial=largest)), largest * 10.0**-_DECADES)
    norm = LogNorm(least, largest if largest > least else 10.0 * least)
    shown = np.maximum(density, least)
    look: dict[str, Any] = {"edgecolors": "face", "linewidths": 0.2}
    cells = PolyCollection(list(mesh.corners), array=shown, norm=norm, cmap="cividis", **look)
    cells.set_rasterized(True)
    axes.add_collection(cells)
    draw_outline(axes, mesh)
    for contact in bracket.problem.contacts:
        ends = edge_lines(mesh, mesh.edges(contact.edges))
        axes.add_collection(lines(ends, "white", "solid", 2.4))
        axes.add_collection(lines(ends, "black", "solid", 1.0))
    show_all(axes, mesh.vertices, units)
    colour_bar(axes, cells, f"duality gap per area [{units.stress}]")
