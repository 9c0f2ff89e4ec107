"""Fields over the whole body: bands with contour lines."""

import warnings
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.tri import TriContourSet

COMPONENT_LABELS: Final = {
    "xx": "$\\sigma_{xx}$",
    "yy": "$\\sigma_{yy}$",
    "xy": "$\\sigma_{xy}$",
    "von_mises": "von Mises stress",
    "first": "$\\sigma_1$ in the plane",
    "second": "$\\sigma_2$ in the plane",
}

_LEVELS: Final = 8  # about so many contour lines
_ALL_BUT_FEW: Final = 0.99  # share of the points whose values set the range of contour lines
_UNIFORM: Final = 1e-4  # range of values over their size below which there is nothing to see


def usual_range(values: FloatArray) -> tuple[float, float]:
    """The range of values, without a few that are much larger than all others, as in corners."""
    sizes = np.abs(values)
    size, usual = float(sizes.max()) or 1.0, float(np.quantile(sizes, _ALL_BUT_FEW))
    end = usual if usual < 0.7 * size else size
    return max(float(values.min()), -end), min(float(values.max()), end)


def draw_contours(
    axes: "Axes",
    points: FloatArray,
    places: FloatArray,
    triangles: IntArray,
    values: FloatArray,
    part: IntArray,
    ends: tuple[float, float] | None = None,
) -> "TriContourSet":
    """Draw values (n,) at points (n, 2) as bands with contour lines between, at the `places` (n, 2) of the drawing.

    Where points of one `part` (n,) coincide they have the mean of their values. Bands end at `ends`, by default at the
    `usual_range`. Values of both signs have a map that is white at zero.
    """
    from matplotlib import colormaps
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.ticker import MaxNLocator
    from matplotlib.tri import Triangulation

    rounded = np.round((points - points.min(axis=0)) / max(float(np.ptp(points, axis=0).max()), 1e-300), 9)
    _, first, one = np.unique(np.column_stack([rounded, part]), axis=0, return_index=True, return_inverse=True)
    one = one.ravel()
    means = np.bincount(one, values) / np.bincount(one)
    low, high = usual_range(means) if ends is None else ends
    end = max(abs(low), abs(high))
    size = float(np.abs(means).max()) or 1.0
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
    with warnings.catch_warnings():  # Matplotlib 3.10 cannot, and says so
        warnings.filterwarnings("ignore", "Rasterization")
        bands.set_rasterized(True)
    axes.tricontour(shape, means, levels, colors="#08306b", linewidths=0.35, linestyles="solid", zorder=0.6)
    return bands
