"""Where the bounds of the energy are apart."""

from typing import TYPE_CHECKING

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.basics.units import Units
from qvi_contact.bracket import Bracket
from qvi_contact.errors import InputError
from qvi_contact.plots.style import (
    BLUE,
    GREEN,
    ORANGE,
    draw_outline,
    edge_lines,
    frame,
    lines,
    new_figure,
    plain_text,
    plain_units,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

_DECADES = 6.0  # shown below the largest share
_LOOKS = {"bulk": (BLUE, ""), "contact": (ORANGE, "//"), "friction": (GREEN, "..")}


def bracket_map(axes: "Axes", bracket: Bracket, units: Units | None = None) -> "PolyCollection":
    """Draw what each cell adds to the gap between the energy's bounds, divided by its area, on a logarithmic scale.

    Parameters
    ----------
    axes : matplotlib axes
        Where to draw; axes are in units of length.
    bracket : Bracket
        With an admissible displacement.
    units : Units, optional
        Labels.

    """
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import LogNorm

    mesh, units = bracket.problem.mesh, plain_units(units)
    corners = mesh.vertices[mesh.cells]
    density = bracket.cell_gaps / _areas(corners)
    largest = float(density.max()) or 1.0
    least = max(float(density[density > 0.0].min(initial=largest)), largest * 10.0**-_DECADES)
    norm = LogNorm(least, largest if largest > least else 10.0 * least)
    shown = np.maximum(density, least)
    cells = PolyCollection(list(corners), array=shown, norm=norm, cmap="cividis", edgecolors="face", linewidths=0.2)
    cells.set_rasterized(True)
    axes.add_collection(cells)
    draw_outline(axes, mesh)
    _draw_contacts(axes, bracket)
    frame(axes, mesh)
    axes.set_xlabel(f"x [{units.length}]")
    axes.set_ylabel(f"y [{units.length}]")
    label = f"duality gap per area [{units.stress}]"
    axes.figure.colorbar(cells, cax=axes.inset_axes((1.04, 0.0, 0.05, 1.0)), label=label)
    return cells


def _areas(corners: FloatArray) -> FloatArray:
    """Areas of cells with these corners in order (cells, c, 2)."""
    following = np.roll(corners, -1, axis=1)
    twice = (corners[..., 0] * following[..., 1] - corners[..., 1] * following[..., 0]).sum(axis=1)
    return np.asarray(np.abs(twice) / 2.0)


def _draw_contacts(axes: "Axes", bracket: Bracket) -> None:
    """Contacts and joints as white and black lines."""
    mesh = bracket.problem.mesh
    for contact in bracket.problem.contacts:
        edges = mesh.edges(contact.edges)
        ends = edge_lines(mesh, edges)
        axes.add_collection(lines(ends, "white", "solid", 2.4))
        axes.add_collection(lines(ends, "black", "solid", 1.0))


def bracket_figure(bracket: Bracket, units: Units | None = None, title: str = "") -> "Figure":
    """The map of the gap, contacts as lines, and the gap by origin: bulk, contact, friction [stress × length²].

    `InputError` where a bound is missing: there is no gap to draw.
    """
    units = plain_units(units)
    if not np.isfinite(bracket.gap):
        raise InputError("bracket", bracket.gap, f"there is no duality gap to draw: {bracket.message}")
    figure = new_figure(9.0, 4.2)
    left, _, right = figure.subplots(1, 3, width_ratios=(1.6, 0.12, 1.0))
    _.set_axis_off()
    bracket_map(left, bracket, units)
    parts = bracket.shown_parts
    for number, (name, value) in enumerate(parts.items()):
        colour, hatch = _LOOKS[name]
        right.bar(number, value, color=colour, hatch=hatch, edgecolor="white")
        right.annotate(f"{value:.3g}", (number, value), ha="center", va="bottom")
    right.set_xticks(range(len(parts)), list(parts))
    right.margins(y=0.15)
    right.set_ylabel(f"part of the duality gap [{units.engineering_energy}]")
    right.spines[["top", "right"]].set_visible(False)
    figure.suptitle(plain_text("\n".join(filter(None, [title, _title(bracket, units)]))), fontsize=9)
    return figure


def _title(bracket: Bracket, units: Units) -> str:
    text = (
        f"Energy between {bracket.lower:.7g} and {bracket.upper:.7g} {units.engineering_energy} ({bracket.certainty})"
    )
    return f"{text}\nfor {bracket.kind.value}".replace("-", "−")
