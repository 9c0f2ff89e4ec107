"""Stresses over the whole body: crosses of principal stresses, and components as coloured fields."""

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.basics.units import Units
from qvi_contact.plots.style import (
    BLUE,
    VERMILLION,
    bounding_box,
    colour_bar,
    draw_grid,
    draw_outline,
    frame,
    legend_below,
    lines,
    plain_units,
    points_per_length,
)
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.sampling import cell_factors, held_along_z, sample_body, stress_component
from qvi_contact.solution.stress import principal_stresses

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import TriMesh

COMPONENT_LABELS: Final = {
    "xx": "$\\sigma_{xx}$",
    "yy": "$\\sigma_{yy}$",
    "xy": "$\\sigma_{xy}$",
    "von_mises": "von Mises stress",
    "first": "$\\sigma_1$ in the plane",
    "second": "$\\sigma_2$ in the plane",
}

_SAMPLES: Final = 320  # triangles along the longer side that a field is drawn with
_LEAST_ROWS: Final = 3  # of crosses across a thin body
_DOT: Final = 0.1  # diameter of the dots at the ends of tensions, as a share of the distance of crosses


def principal_stress_map(
    axes: "Axes",
    result: ContactResult,
    largest: float | None = None,
    units: Units | None = None,
    legend: bool = False,
    crosses: int | None = None,
) -> float:
    """Draw the principal stresses as crosses at the Gauss points of each cell.

    A compressive stress is a solid line, a tensile one a dotted line with a round dot at each end; lengths are
    proportional to the stress, and to the size of the cell, so that crosses of neighbouring points just meet.

    Parameters
    ----------
    axes : matplotlib axes
        Where to draw; axes are in units of length.
    result : ContactResult
        The state.
    largest : float, optional
        Stress [stress] drawn at full length; the largest one by default.
    units : Units, optional
        Labels of the axes and of the legend; without them the axes are left bare.
    legend : bool
        Say below the axes what the lines mean and which stress a line of full length has.
    crosses : int, optional
        Only so many crosses along the body's longer side, at equal distances whatever the mesh is; the Gauss points
        of all cells by default.

    Returns
    -------
    float
        The largest |principal stress| at all Gauss points [stress].

    """
    mesh, (x, y, stress) = result.problem.mesh, result.gauss_stress()
    maximum = float(np.abs(principal_stresses(stress)[:2]).max())
    full = largest or maximum or 1.0
    sizes = np.sqrt(result.discretization.space.cell_sizes / x.shape[1]) * result.discretization.scales.length
    spacing = np.repeat(sizes[:, None], x.shape[1], axis=1)
    if crosses is not None:
        x, y, stress, spacing = _evenly(result, crosses) or (x, y, stress, spacing)
    draw_grid(axes, mesh)
    width = float(np.clip(0.25 * np.median(spacing) * points_per_length(axes, mesh), 0.2, 1.1))
    stress_crosses(axes, np.stack([x, y], axis=-1), stress, spacing, full, width)
    frame(axes, mesh, units and plain_units(units))
    if legend:
        from matplotlib.lines import Line2D

        handles = [
            Line2D([], [], color=BLUE, label="compression"),
            Line2D([], [], color=VERMILLION, linestyle=(0, (1, 1)), marker="o", markersize=3, label="tension"),
        ]
        legend_below(axes, handles, f"arm length: {full:.4g} {plain_units(units).stress}")
    return maximum


def stress_crosses(
    axes: "Axes", points: FloatArray, stress: FloatArray, spacing: FloatArray, full: float, width: float = 0.8
) -> None:
    """Draw principal stresses as crosses: compression solid, tension dotted with round ends.

    Parameters
    ----------
    axes : matplotlib axes
        Where to draw.
    points : (..., 2) array
        Middles of the crosses.
    stress : (..., 3) array
        σ_xx, σ_yy, σ_xy there.
    spacing : (...) array
        Distance of neighbouring points [length].
    full : float
        The stress [stress] that is drawn as long as this distance.
    width : float
        Of the lines, in points.

    """
    from matplotlib.collections import EllipseCollection

    first, second, angle = principal_stresses(stress)
    least = 1e-3 * float(max(np.abs(first).max(), np.abs(second).max()))
    for values, turn in ((first, 0.0), (second, np.pi / 2)):
        direction = np.stack([np.cos(angle + turn), np.sin(angle + turn)], axis=-1)
        half = direction * (0.5 * spacing * np.abs(values) / full)[..., None]
        ends = points[..., None, :] + half[..., None, :] * np.array([[-1.0], [1.0]])
        pushed, pulled = values < -least, values > least
        axes.add_collection(lines(ends[pushed], BLUE, "solid", width))
        axes.add_collection(lines(ends[pulled], VERMILLION, (0, (1, 1)), width))
        size = _DOT * np.repeat(spacing[pulled], 2)  # of round dots at both ends, smaller in small cells
        dots: dict[str, Any] = {"offsets": ends[pulled].reshape(-1, 2), "offset_transform": axes.transData}
        look: dict[str, Any] = {"units": "xy", "facecolors": VERMILLION, "edgecolors": "none"}
        axes.add_collection(EllipseCollection(size, size, np.zeros_like(size), **look, **dots))


def stress_field(
    axes: "Axes",
    result: ContactResult,
    component: str = "von_mises",
    units: Units | None = None,
    limits: tuple[float | None, float | None] = (None, None),
) -> "TriMesh":
    """Draw one scalar stress as a coloured field, each cell from its own element.

    Cells are divided into small triangles, whose colours run from corner to corner. Nothing is averaged or smoothed
    between cells: normal stresses may jump there, and the picture shows it.

    Parameters
    ----------
    axes : matplotlib axes
        Where to draw; axes are in units of length.
    result : ContactResult
        The state.
    component : str
        "xx", "yy", "xy" (tension positive), "von_mises" (with σ_zz = ν(σ_xx + σ_yy) in plane strain), or "first",
        "second": the principal stresses σ₁ ≥ σ₂ in the plane.
    units : Units, optional
        Labels.
    limits : (float, float), optional
        Stresses at the ends of the colour bar [stress]. None stands for the extreme of what is drawn; with both so, the
        range is centred on zero where both signs occur.

    Returns
    -------
    matplotlib TriMesh
        The field.

    """
    mesh, units = result.problem.mesh, plain_units(units)
    samples = sample_body(result, _SAMPLES)
    held = held_along_z(result.problem, samples.cells, *samples.points.T)
    values = stress_component(samples.stress, component, cell_factors(result.problem)[samples.cells], held)
    field = draw_values(axes, samples.points, samples.triangles, values, limits)
    draw_outline(axes, mesh)
    frame(axes, mesh, units)
    low, high = field.get_clim()
    beyond = (bool(values.min() < low), bool(values.max() > high))
    extend = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}[beyond]
    colour_bar(axes, field, f"{COMPONENT_LABELS[component]} [{units.stress}]", extend)
    return field


def draw_values(
    axes: "Axes",
    points: FloatArray,
    triangles: IntArray,
    values: FloatArray,
    limits: tuple[float | None, float | None] = (None, None),
) -> "TriMesh":
    """Draw values (n,) at points (n, 2) as colours that run through triangles (t, 3).

    Values of one sign get a sequential map, dark where they are small; values of both signs a diverging one that is
    white at zero. A field that is uniform up to rounding gets a range that does not show the rounding.
    """
    from matplotlib.tri import Triangulation

    extremes = float(np.nanmin(values)), float(np.nanmax(values))
    low, high = (extreme if limit is None else limit for extreme, limit in zip(extremes, limits, strict=True))
    size = max(abs(low), abs(high))
    if low < -1e-6 * size and high > 1e-6 * size:
        low, high, colours = (-size, size, "PuOr_r") if limits == (None, None) else (low, high, "PuOr_r")
    else:
        if high - low <= 1e-6 * size or size == 0.0:
            middle, half = (low + high) / 2.0, 0.05 * size or 1.0
            low, high = middle - half, middle + half
        colours = "cividis" if high > -low else "cividis_r"
    shape = Triangulation(points[:, 0], points[:, 1], triangles)
    field: TriMesh = axes.tripcolor(
        shape, values, shading="gouraud", cmap=colours, vmin=low, vmax=high, rasterized=True
    )
    field.set_in_layout(False)  # or a layout asks for the extent of every triangle
    return field


def _evenly(result: ContactResult, crosses: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray] | None:
    """Coordinates (m,), stresses (m, 3) and distances (m,) of points of the body in even rows, at least three.

    None where no such point lies in the body.
    """
    mesh = result.problem.mesh
    low, high = bounding_box(mesh)
    counts = [max(_LEAST_ROWS, round(crosses * side / mesh.length)) for side in (high - low).tolist()]
    steps = (high - low) / counts
    lines = (start + (np.arange(count) + 0.5) * step for start, count, step in zip(low, counts, steps, strict=True))
    points = np.stack(np.meshgrid(*lines), axis=-1).reshape(-1, 2)
    points = points[np.unique(mesh.around(points)[0])]
    if not len(points):
        return None
    return *points.T, result.stress(*points.T), np.full(len(points), steps.min())
