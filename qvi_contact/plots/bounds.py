"""The displacement model's deformed body, and where the bounds of the energy are apart."""

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, positive_number
from qvi_contact.basics.units import Units
from qvi_contact.bracket import Bracket
from qvi_contact.companion.result import CompanionResult
from qvi_contact.errors import InputError
from qvi_contact.mesh.arcs import cross
from qvi_contact.mesh.edges import frames_along
from qvi_contact.plots.fields import draw_values
from qvi_contact.plots.style import (
    BLUE,
    GREEN,
    GREY,
    LEAST,
    ORANGE,
    VERMILLION,
    bounding_box,
    colour_bar,
    draw_outline,
    edge_lines,
    frame,
    legend_below,
    lines,
    magnified,
    new_figure,
    plain_text,
    plain_units,
)
from qvi_contact.solution.sampling import cell_factors, held_along_z, von_mises

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DECADES: Final = 6.0  # shown below the largest share
_LOOKS: Final = {"bulk": (BLUE, ""), "contact": (ORANGE, "//"), "friction": (GREEN, "..")}
_SAMPLES: Final = 160  # parts of cells along the longer side
_MOST_CELLS: Final = 6400  # whose outlines are drawn
_POINTS: Final = 9  # of a curved edge


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
    _gap_map(left, bracket, units)
    parts = bracket.shown_parts
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
    frame(axes, mesh, units)
    colour_bar(axes, cells, f"duality gap per area [{units.stress}]")


def deformed_figure(companion: CompanionResult, scale: float | None = None, units: Units | None = None) -> "Figure":
    """The body displaced, its cells coloured by the von Mises stress, over its outline before.

    Displacements are exaggerated by one stated factor, and obstacles drawn where they stand in that picture: at g along
    the normal and w along the tangent, beyond the motion of a plate.

    Parameters
    ----------
    companion : CompanionResult
        A result with a displacement.
    scale : float, optional
        By how much displacements are exaggerated; by default so much that the largest one spans about 8 % of the
        body's length.
    units : Units, optional
        Labels.

    Raises
    ------
    InputError
        If there is no displacement, the scale is no positive number, or matplotlib is missing.

    """
    from matplotlib.lines import Line2D

    units = plain_units(units)
    mesh = companion.problem.mesh
    if scale is None:
        least = LEAST * companion.scales.displacement
        factor = magnified(max(float(np.abs(companion.nodal_displacements).max()), least), mesh.length)
    else:
        factor = positive_number("scale", scale)
    low, high = bounding_box(mesh)
    figure = new_figure(5.5, float(np.clip(4.5 * (high[1] - low[1]) / (high[0] - low[0]), 2.5, 8.0)) + 1.0)
    axes = figure.add_subplot()
    draw_outline(axes, mesh, "#999999")
    cell, count = companion.space.cell, mesh.cell_count
    t, parts = cell.lattice(int(np.clip(np.ceil(_SAMPLES / np.sqrt(count)), 2, 24)))
    held = held_along_z(companion.problem, np.arange(count), *np.moveaxis(companion.cell_points(*t.T), -1, 0))
    values = von_mises(companion.cell_stress(*t.T), cell_factors(companion.problem)[:, None], held).ravel()
    triangles = (len(t) * np.arange(count)[:, None, None] + parts).reshape(-1, 3)
    field = draw_values(axes, _moved(companion, t, factor).reshape(-1, 2), triangles, values)
    figure.colorbar(field, ax=axes, label=f"von Mises stress [{units.stress}]", shrink=0.8)
    if count <= _MOST_CELLS:  # their outlines, curved as they are; fine meshes are left to the colours
        corners = cell.places[cell.corners]
        sides = np.roll(corners, -1, axis=0) - corners
        t = (corners[:, None] + np.linspace(0.0, 1.0, _POINTS)[:, None] * sides[:, None]).reshape(-1, 2)
        axes.add_collection(lines(_moved(companion, t, factor), "white", "solid", 0.4))
    obstacles = [contact for contact in companion.problem.contacts if contact not in companion.problem.joints]
    for contact in obstacles:
        edges, t = mesh.edges(contact.edges), np.linspace(0.0, 1.0, _POINTS)
        normal, tangential = companion.obstacle(contact.name, t)
        normals, tangents = frames_along(edges, t)
        moved = normal[..., None] * normals + tangential[..., None] * tangents
        place = np.stack(mesh.points_along(edges, t), axis=-1) + factor * moved
        axes.add_collection(lines(place, VERMILLION, (0, (4, 2)), 1.2))
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.locator_params(nbins=6)
    axes.set_xlabel(f"x [{units.length}]")
    axes.set_ylabel(f"y [{units.length}]")
    handles = [Line2D([], [], color="#999999", linewidth=0.8, label="undeformed")]
    if obstacles:
        handles.append(Line2D([], [], color=VERMILLION, linestyle=(0, (4, 2)), label="obstacle"))
    handles.append(Line2D([], [], color=GREY, marker="s", linestyle="none", label="deformed"))
    legend_below(axes, handles, f"displacements × {factor:g}")
    return figure


def _moved(companion: CompanionResult, t: FloatArray, factor: float) -> FloatArray:
    """Where reference points (k, 2) of every cell are drawn, (cells, k, 2)."""
    return companion.cell_points(*t.T) + factor * companion.cell_displacement(*t.T)
