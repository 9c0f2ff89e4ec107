"""The deformed shape of the displacement model; needs the extra ``plot`` (matplotlib)."""

from typing import TYPE_CHECKING, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, positive_number
from qvi_contact.basics.units import Units
from qvi_contact.companion.result import CompanionResult
from qvi_contact.files.companion import sub_points, sub_quads
from qvi_contact.mesh.rectilinear import HORIZONTAL
from qvi_contact.plots.fields import colour_range
from qvi_contact.plots.style import GREY, VERMILLION, draw_outline, legend_below, lines, new_figure
from qvi_contact.solution.sampling import out_of_plane_factor, von_mises

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LONGEST: Final = 0.08  # share of the body's length at which the largest displacement is drawn
_LEAST: Final = 1e-5  # displacements below this share of what strains the body are not magnified any further
_SAMPLES: Final = 160  # quadrilaterals along the longer side
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
    units = units or Units()
    factor = _automatic(companion) if scale is None else positive_number("scale", scale)
    mesh = companion.problem.grid
    figure = new_figure(5.5, float(np.clip(4.5 * np.ptp(mesh.y) / np.ptp(mesh.x), 2.5, 8.0)) + 1.0)
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
    wanted = _LONGEST * companion.problem.grid.length / max(largest, _LEAST * companion.scales.displacement)
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= wanted * (1 + 1e-12)))


def _moved(companion: CompanionResult, tx: FloatArray, ty: FloatArray, factor: float) -> FloatArray:
    """Where points of every cell are drawn, (cells, k, 2)."""
    return companion.cell_points(tx, ty) + factor * companion.cell_displacement(tx, ty)


def _draw_stress(axes: "Axes", companion: CompanionResult, factor: float, units: Units) -> None:
    from matplotlib.collections import PolyCollection

    problem = companion.problem
    r = int(np.clip(np.ceil(_SAMPLES / max(problem.grid.shape)), 2, 24))
    corners = _moved(companion, *sub_points(r), factor).reshape(-1, 2)[sub_quads(companion.problem.mesh.cell_count, r)]
    middle = (np.arange(r) + 0.5) / r
    stress = companion.cell_stress(np.tile(middle, r), np.repeat(middle, r))
    values = von_mises(stress, out_of_plane_factor(problem)[problem.grid.active][:, None]).ravel()
    (low, high), colours = colour_range(values)
    field = PolyCollection(list(corners), array=values, cmap=colours, edgecolors="none", antialiased=False)
    field.set_clim(low, high)
    field.set_rasterized(True)
    axes.add_collection(field)
    axes.figure.colorbar(field, ax=axes, label=f"von Mises stress [{units.stress}]", shrink=0.8)


def _draw_cells(axes: "Axes", companion: CompanionResult, factor: float) -> None:
    """Outlines of the cells, curved as they are, thin; fine meshes are left to the colours."""
    if max(companion.problem.grid.shape) > _SAMPLES // 2:
        return
    t, zero = np.linspace(0.0, 1.0, _POINTS), np.zeros(_POINTS)
    tx = np.concatenate([t, zero + 1.0, t[::-1], zero])
    ty = np.concatenate([zero, t, zero + 1.0, t[::-1]])
    axes.add_collection(lines(_moved(companion, tx, ty, factor), "white", "solid", 0.4))


def _draw_obstacles(axes: "Axes", companion: CompanionResult, factor: float) -> None:
    t = np.linspace(0.0, 1.0, _POINTS)
    problem = companion.problem
    for contact in problem.contacts:
        if contact in problem.joints:
            continue
        edges = problem.grid.edges(contact.edges)
        x, y = problem.grid.points_along(edges, t)
        normal, tangential = companion.obstacle(contact.name, t)
        across = edges.sign[:, None] * normal
        flat = (edges.axis == HORIZONTAL)[:, None]
        x, y = x + factor * np.where(flat, tangential, across), y + factor * np.where(flat, across, tangential)
        axes.add_collection(lines(np.stack([x, y], axis=-1), VERMILLION, (0, (4, 2)), 1.2))


def _legend(axes: "Axes", companion: CompanionResult, factor: float) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color="#999999", linewidth=0.8, label="before")]
    if len(companion.problem.contacts) > len(companion.problem.joints):
        handles.append(Line2D([], [], color=VERMILLION, linestyle=(0, (4, 2)), label="obstacle"))
    handles.append(Line2D([], [], color=GREY, marker="s", linestyle="none", label="body, displaced"))
    legend_below(axes, handles, f"displacements × {factor:g}")
