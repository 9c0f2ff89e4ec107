"""Stresses over the whole body: components as coloured fields, contour lines, crosses of principal stresses."""

from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.basics.units import Units
from qvi_contact.plots.style import (
    BLUE,
    VERMILLION,
    colour_bar,
    draw_outline,
    frame,
    lines,
    plain_units,
)
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.sampling import cell_factors, held_along_z, sample_body, stress_component
from qvi_contact.solution.stress import principal_stresses

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import TriMesh
    from matplotlib.tri import TriContourSet

COMPONENT_LABELS: Final = {
    "xx": "$\\sigma_{xx}$",
    "yy": "$\\sigma_{yy}$",
    "xy": "$\\sigma_{xy}$",
    "von_mises": "von Mises stress",
    "first": "$\\sigma_1$ in the plane",
    "second": "$\\sigma_2$ in the plane",
}

_SAMPLES: Final = 320  # triangles along the longer side that a field is drawn with
_LEVELS: Final = 8  # about so many contour lines
_ALL_BUT_FEW: Final = 0.99  # share of the points whose values set the range of contour lines
_UNIFORM: Final = 1e-4  # range of values over their size below which there is nothing to see
_DOT: Final = 0.1  # diameter of the dots at the ends of tensions, as a share of the distance of crosses


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


def draw_contours(
    axes: "Axes", points: FloatArray, places: FloatArray, triangles: IntArray, values: FloatArray, part: IntArray
) -> "TriContourSet":
    """Draw values (n,) at points (n, 2) as bands with contour lines between, at the `places` (n, 2) of the drawing.

    Where points of one `part` (n,) coincide they have the mean of their values. If a few values are much larger than
    all others, as in corners, the bands end below them. Values of both signs have a map that is white at zero.
    """
    from matplotlib import colormaps
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.ticker import MaxNLocator
    from matplotlib.tri import Triangulation

    rounded = np.round((points - points.min(axis=0)) / max(float(np.ptp(points, axis=0).max()), 1e-300), 9)
    _, first, one = np.unique(np.column_stack([rounded, part]), axis=0, return_index=True, return_inverse=True)
    one = one.ravel()
    means = np.bincount(one, values) / np.bincount(one)
    size = float(np.abs(means).max()) or 1.0
    usual = float(np.quantile(np.abs(means), _ALL_BUT_FEW))
    end = usual if usual < 0.7 * size else size
    low, high = max(float(means.min()), -end), min(float(means.max()), end)
    if high - low <= _UNIFORM * size:
        middle = (low + high) / 2.0
        low, high = middle - 0.05 * size, middle + 0.05 * size
    both = low < -0.05 * end and high > 0.05 * end
    low, high = (-end, end) if both else (low, high)
    levels = MaxNLocator(_LEVELS, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
    share = np.linspace(0.0, 1.0, len(levels) + 1)
    colours = colormaps["PuOr_r" if both else "Blues"](
        share if both else 0.04 + 0.62 * (share if high > -low else share[::-1])
    )
    beyond = (bool(means.min() < levels[0]), bool(means.max() > levels[-1]))
    extend: Literal["neither", "min", "max", "both"] = (("neither", "max"), ("min", "both"))[beyond[0]][beyond[1]]
    used = colours[0 if beyond[0] else 1 : len(colours) if beyond[1] else -1]
    norm = BoundaryNorm(levels, len(used), extend=extend)
    shape = Triangulation(places[first, 0], places[first, 1], one[triangles])
    look: dict[str, Any] = {"levels": levels, "norm": norm, "cmap": ListedColormap(used), "extend": extend}
    bands: TriContourSet = axes.tricontourf(shape, means, zorder=0.5, **look)
    bands.set_rasterized(True)
    axes.tricontour(shape, means, levels, colors="#08306b", linewidths=0.35, linestyles="solid", zorder=0.6)
    return bands
