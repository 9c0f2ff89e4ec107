"""The deformed shape of the displacement model; needs the extra ``plot`` (matplotlib)."""

from typing import TYPE_CHECKING, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, positive_number
from qvi_contact.basics.units import Units
from qvi_contact.companion.result import CompanionResult
from qvi_contact.mesh.edges import frames_along
from qvi_contact.plots.fields import draw_values
from qvi_contact.plots.style import (
    GREY,
    VERMILLION,
    bounding_box,
    draw_outline,
    legend_below,
    lines,
    new_figure,
    plain_units,
)
from qvi_contact.solution.sampling import cell_factors, von_mises

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LONGEST: Final = 0.08  # share of the body's length at which the largest displacement is drawn
_LEAST: Final = 1e-5  # displacements below this share of what strains the body are not magnified any further
_SAMPLES: Final = 160  # parts of cells along the longer side
_MOST_CELLS: Final = 6400  # whose outlines are drawn
_POINTS: Final = 9  # of a curved edge


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

    Returns
    -------
    matplotlib Figure
        For `qvi_contact.plots.save_figure`.

    Raises
    ------
    InputError
        If there is no displacement, the scale is no positive number, or matplotlib is missing.

    """
    units = plain_units(units)
    factor = _automatic(companion) if scale is None else positive_number("scale", scale)
    mesh = companion.problem.mesh
    low, high = bounding_box(mesh)
    figure = new_figure(5.5, float(np.clip(4.5 * (high[1] - low[1]) / (high[0] - low[0]), 2.5, 8.0)) + 1.0)
    axes = figure.add_subplot()
    draw_outline(axes, mesh, "#999999")
    _draw_stress(axes, companion, factor, units)
    _draw_cells(axes, companion, factor)
    _draw_obstacles(axes, companion, factor)
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.locator_params(nbins=6)
    axes.set_xlabel(f"x [{units.length}]")
    axes.set_ylabel(f"y [{units.length}]")
    _legend(axes, companion, factor)
    return figure


def _automatic(companion: CompanionResult) -> float:
    """The largest of 1, 2, 5 times a power of ten that keeps displacements within `_LONGEST` of the body's length."""
    largest = float(np.abs(companion.nodal_displacements).max())
    wanted = _LONGEST * companion.problem.mesh.length / max(largest, _LEAST * companion.scales.displacement)
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= wanted * (1 + 1e-12)))


def _moved(companion: CompanionResult, t: FloatArray, factor: float) -> FloatArray:
    """Where reference points (k, 2) of every cell are drawn, (cells, k, 2)."""
    return companion.cell_points(*t.T) + factor * companion.cell_displacement(*t.T)


def _draw_stress(axes: "Axes", companion: CompanionResult, factor: float, units: Units) -> None:
    problem = companion.problem
    count = problem.mesh.cell_count
    t, parts = companion.space.cell.lattice(int(np.clip(np.ceil(_SAMPLES / np.sqrt(count)), 2, 24)))
    values = von_mises(companion.cell_stress(*t.T), cell_factors(problem)[:, None]).ravel()
    triangles = (len(t) * np.arange(count)[:, None, None] + parts).reshape(-1, 3)
    field = draw_values(axes, _moved(companion, t, factor).reshape(-1, 2), triangles, values)
    axes.figure.colorbar(field, ax=axes, label=f"von Mises stress [{units.stress}]", shrink=0.8)


def _draw_cells(axes: "Axes", companion: CompanionResult, factor: float) -> None:
    """Outlines of the cells, curved as they are, thin; fine meshes are left to the colours."""
    if companion.problem.mesh.cell_count > _MOST_CELLS:
        return
    cell = companion.space.cell
    corners = cell.places[cell.corners]
    sides = np.roll(corners, -1, axis=0) - corners
    t = (corners[:, None] + np.linspace(0.0, 1.0, _POINTS)[:, None] * sides[:, None]).reshape(-1, 2)
    axes.add_collection(lines(_moved(companion, t, factor), "white", "solid", 0.4))


def _draw_obstacles(axes: "Axes", companion: CompanionResult, factor: float) -> None:
    t = np.linspace(0.0, 1.0, _POINTS)
    problem = companion.problem
    for contact in problem.contacts:
        if contact in problem.joints:
            continue
        edges = problem.mesh.edges(contact.edges)
        normal, tangential = companion.obstacle(contact.name, t)
        normals, tangents = frames_along(edges, t)
        moved = normal[..., None] * normals + tangential[..., None] * tangents
        place = np.stack(problem.mesh.points_along(edges, t), axis=-1) + factor * moved
        axes.add_collection(lines(place, VERMILLION, (0, (4, 2)), 1.2))


def _legend(axes: "Axes", companion: CompanionResult, factor: float) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color="#999999", linewidth=0.8, label="undeformed")]
    if len(companion.problem.contacts) > len(companion.problem.joints):
        handles.append(Line2D([], [], color=VERMILLION, linestyle=(0, (4, 2)), label="obstacle"))
    handles.append(Line2D([], [], color=GREY, marker="s", linestyle="none", label="deformed"))
    legend_below(axes, handles, f"displacements × {factor:g}")
