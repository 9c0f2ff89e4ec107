"""The figures of the report; runs that fail are hatched, or stand in a shaded band."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from pandas import DataFrame, Series

from comparisons.convergence.uzawa.measures import SOON, of, searches_of
from comparisons.convergence.uzawa.study import METHODS
from comparisons.lab.report.drawing import (
    LOOKS,
    drawn,
    failing_band,
    grid,
    legend_below,
    panelled,
    plain_ticks,
    powers_of_two,
)  # fmt: skip
from comparisons.lab.report.numbers import scientific
from comparisons.paper.reference import load
from qvi_contact.basics.checks import FloatArray
from qvi_contact.plots import GREY, VERMILLION
from qvi_contact.plots.style import new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

_TICKS: Final = (0.125, 0.25, 0.5, 1, 2, 4)


def figures(runs: DataFrame) -> dict[str, str]:
    """Name → picture; empty where matplotlib is not installed."""
    maps, plate = of(runs, "map"), of(runs, "map").problem == "plate"
    drawings: dict[str, Callable[[], Canvas]] = {
        "history": partial(_paper, of(runs, "paper")), "map-plate": partial(_map_panels, maps[plate]),
        "map-open": partial(_map_panels, maps[~plate]), "limits": partial(_limits, searches_of(runs)),
        "mesh": partial(_meshes, of(runs, "mesh")), "work": partial(_work, of(runs, *METHODS)),
    }  # fmt: skip
    return {name: drawn(f"uzawa-{name}", draw) for name, draw in drawings.items()}


def _paper(found: DataFrame) -> "Canvas":
    """Errors of P/2 after each iteration of the paper's run."""
    paper = load()
    canvas = new_figure(8.0, 4.2)
    axes = canvas.subplots()
    axes.set(xscale="log", yscale="log", ylim=(1e-10, 0.1), xlabel="iteration [-]", ylabel="relative error of P/2 [-]")
    plain_ticks(axes.xaxis, axes.yaxis)
    axes.axvline(paper.iterations, color="black", linestyle="--", linewidth=0.8, label=f"{paper.iterations} iterations")
    for number, run in enumerate(found.itertuples()):
        colour, marker, line = LOOKS[number % len(LOOKS)]
        errors = np.maximum(np.array(run.errors), 1e-10)
        axes.plot(np.arange(1, len(errors) + 1), errors, color=colour, linestyle=line, marker=marker, markersize=4,
                  markevery=(number, 40), linewidth=1.2, label=f"μ = {run.friction:g}")  # fmt: skip
    grid(axes)
    axes.legend(fontsize=8, frameon=False, ncols=2, loc="lower left")
    return canvas


def _map_panels(found: DataFrame) -> "Canvas":
    """A panel for each problem: iterations against both steps."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm

    maps = [(str(where), runs) for where, runs in found.groupby("where", sort=False)]
    counts = [count for _, runs in maps for count in _reached(runs).dropna()]
    scale = ScalarMappable(LogNorm(max(1, min(counts, default=1)), max(2, *counts, 2)), "cividis")
    canvas, panels = panelled(len(maps), *((6.0, 3.3, 1.3) if len(maps) == 1 else (8.7, 1.75, 1.3)), columns=3)
    for axes, (where, runs) in zip(panels, maps, strict=True):
        _map(axes, scale, runs)
        axes.set_title(where, fontsize=8)
    canvas.colorbar(scale, ax=canvas.axes, label="iterations to 1e-4 [-]")
    canvas.supxlabel("ω_T / (2 / λ_max) [-]", fontsize=9)
    canvas.supylabel("ω_N / (2 / λ_max) [-]", fontsize=9)
    return canvas


def _reached(found: DataFrame) -> Series:
    """Iterations to 1e-4 of the runs that settle, NaN for the others."""
    return found[SOON].where(found.settles == 1)


def _map(axes: "Axes", scale: Any, found: DataFrame) -> None:
    """One rectangle for each pair of steps; lines of theory."""
    from matplotlib.patches import Rectangle

    tangential, normal = (sorted(found[name].unique()) for name in ("tangential", "normal"))
    x, y = _borders(tangential), _borders(normal)
    axes.set(xscale="log", yscale="log", xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    for run, count in zip(found.itertuples(), _reached(found), strict=True):
        i, j = tangential.index(run.tangential), normal.index(run.normal)
        hatch = None if np.isfinite(count) else "..." if run.settles == 1 else "////"
        face = "white" if hatch else scale.to_rgba(count)
        box = ((x[i], y[j]), x[i + 1] - x[i], y[j + 1] - y[j])
        axes.add_patch(Rectangle(*box, facecolor=face, edgecolor=GREY if hatch else face, hatch=hatch, linewidth=0.0))
    for draw in (axes.axvline, axes.axhline):
        draw(1.0, color=VERMILLION, linestyle="--", linewidth=1.2)
    if found.limit_T.notna().any() and found.problem.iloc[0] == "plate":
        axes.axvline(load().omega_T / found.limit_T.dropna().iloc[0], color=VERMILLION, linestyle=":", linewidth=1.4)
    values = found.pivot_table("linearised", "normal", "tangential").to_numpy()
    if min(values.shape) > 1 and np.nanmin(values) < 1.0 < np.nanmax(values):
        axes.contour(tangential, normal, values, levels=[1.0], colors=[VERMILLION], linewidths=1.4)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_ticks(_TICKS, [f"{tick:g}" for tick in _TICKS], fontsize=7)
        axis.set_ticks([], minor=True)
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))


def _borders(values: Sequence[float]) -> FloatArray:
    """Borders of the rectangles about these values, in the middle between them in logarithms."""
    logs = np.log(np.array(values))
    if len(logs) == 1:
        return np.asarray(np.exp(logs[0] + np.array([-0.35, 0.35])))
    middle = (logs[1:] + logs[:-1]) / 2.0
    return np.asarray(np.exp(np.concatenate([[2.0 * logs[0] - middle[0]], middle, [2.0 * logs[-1] - middle[-1]]])))


def _limits(searches: DataFrame) -> "Canvas":
    """The largest ω_T that settle on the plate, beside theory."""
    plate = searches[(searches.step == "ω_T") & (searches.problem == "plate")].sort_values("cells")
    canvas = new_figure(8.0, 4.4)
    axes = canvas.subplots()
    axes.set(yscale="log", xlabel="cells a side [-]", ylabel="ω_T [length]")
    powers_of_two(axes)
    for number, (friction, found) in enumerate(plate.groupby("friction")):
        colour, marker, _ = LOOKS[number % len(LOOKS)]
        bounded = found[found.largest.notna() & found.smallest.notna()]
        for name, line in (("omega_T", ""), ("limit_T", "--"), ("slipping_T", ":")):
            shown = (found if line else bounded).dropna(subset=[name])
            if len(shown):
                axes.plot(shown.cells, shown[name], color=colour, linestyle=line or "none",
                          marker=None if line else marker, markersize=6, linewidth=1.2,
                          label=f"μ = {friction:g}: {_LIMIT_LABELS[name]}")  # fmt: skip
    axes.axhline(load().omega_T, color="black", linewidth=0.9, label="the paper's ω_T")
    grid(axes)
    legend_below(canvas, 3, 7)
    return canvas


_LIMIT_LABELS: Final = {
    "omega_T": "observed", "limit_T": "2 / λ_max, all points", "slipping_T": "2 / λ_max, slipping points",
}  # fmt: skip


def _meshes(meshes: DataFrame) -> "Canvas":
    """Iterations to two accuracies against the mesh."""
    canvas = new_figure(8.0, 3.8)
    panels = canvas.subplots(1, 2)
    for axes, target in zip(panels, (SOON, "to 1e-06"), strict=True):
        axes.set(yscale="log", ylim=(0.8, 1e5), xlabel="cells a side [-]", ylabel=f"iterations {target} [-]")
        plain_ticks(axes.yaxis)
        failing_band(axes, 2e4, 1e5)
        powers_of_two(axes)
        for number, (friction, found) in enumerate(meshes.sort_values("cells").groupby("friction")):
            colour, marker, line = LOOKS[number % len(LOOKS)]
            shown, failed = found[found[target].notna()], found[found[target].isna()]
            axes.plot(
                shown.cells, shown[target], color=colour, marker=marker, linestyle=line, label=f"μ = {friction:g}"
            )
            heights = [3e4 * 1.3**number] * len(failed)
            axes.plot(failed.cells, heights, "x", color=colour, markersize=7, markeredgewidth=2)
        cells = np.unique(meshes.cells)
        axes.plot(cells, 8.0 * cells, color="black", linewidth=0.9, linestyle="--", label="∝ 1/h")
    legend_below(canvas)
    return canvas


def _work(equal: DataFrame) -> "Canvas":
    """Time against the accuracy asked for, a panel for each problem."""
    groups = list(equal.groupby("where", sort=False))
    canvas, panels = panelled(len(groups), 8.0, 2.6, 0.9)
    for axes, (where, found) in zip(panels, groups, strict=True):
        _work_panel(axes, found)
        axes.set_title(str(where), fontsize=9)
    legend_below(canvas, 3)
    return canvas


def _work_panel(axes: "Axes", found: DataFrame) -> None:
    targets = sorted(found.target.unique())
    axes.set(xscale="log", yscale="log", xlabel="target [-]", ylabel="time [s]", ylim=(3e-3, 100.0))
    plain_ticks(axes.yaxis)
    axes.set_xticks(targets, [scientific(target, 1) for target in targets])
    axes.set_xticks([], minor=True)
    axes.set_xlim(max(targets) * 5.0, min(targets) / 5.0)
    failing_band(axes, 30.0, 100.0)
    for number, (name, look) in enumerate(METHODS.items()):
        runs = found[found.run == name].sort_values("target", ascending=False)
        shown, failed = runs[runs.status == "solved"], runs[runs.status != "solved"]
        axes.plot(shown.target, shown.seconds, color=look.colour, marker=look.marker, linestyle=look.line,
                  markersize=5, linewidth=1.1, label=name)  # fmt: skip
        heights = [38.0 * 1.25**number] * len(failed)
        axes.plot(failed.target, heights, "x", color=look.colour, markersize=6, markeredgewidth=1.5)
