"""The figures of the report; runs that fail stand in a shaded band at the top."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Final

from pandas import DataFrame, Series

from comparisons.convergence.bodies import NAMES
from comparisons.convergence.outer.measures import by_loop, main_bodies, on_meshes, single
from comparisons.convergence.outer.study import CONDENSED, LOOPS, PLAIN, TOLERANCE
from comparisons.lab.report.drawing import (
    LOOKS,
    drawn,
    failing_band,
    legend_below,
    panelled,
    plain_ticks,
    powers_of_two,
)  # fmt: skip

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

    Panel = Callable[[Axes, str, DataFrame], None]

_SIZE: Final = (8.0, 2.6, 0.9)  # of pictures, see `panelled` [inch]

_RATES: Final = (1e-2, 10.0, 60.0)
"""Lowest rate drawn, beginning of the band of what fails, top."""

_COUNTS: Final = (0.8, 300.0, 1000.0)
_RATIOS: Final = (0.3, 3e3, 1e4)


def figures(runs: DataFrame) -> dict[str, str]:
    """Name → picture; empty where matplotlib is not installed."""
    found = single(runs)
    main = {body: found[found.body == body] for body in main_bodies(runs)}
    iterations = partial(_numbers_panel, column="steps", label="iterations to 1e-8 [-]", limits=_COUNTS)
    times = partial(_numbers_panel, column="ratio", label="time over condensed [-]", limits=_RATIOS)
    drawings: dict[str, Callable[[], Canvas]] = {
        "rates": partial(_drawing, main, _rate_panel), "iterations": partial(_drawing, main, iterations),
        "times": partial(_drawing, main, times), "histories": partial(_drawing, shown_places(main), _history_panel),
        "mesh": partial(_drawing, dict(iter(on_meshes(runs).groupby("problem"))), _mesh_panel, shared=False),
    }  # fmt: skip
    return {name: drawn(f"outer-{name}", draw) for name, draw in drawings.items()}


def _drawing(groups: dict[str, DataFrame], panel: "Panel", shared: bool = True) -> "Canvas":
    """A panel for each group, and one legend for all."""
    canvas, panels = panelled(len(groups), *_SIZE)
    for axes, (title, runs) in zip(panels, groups.items(), strict=True):
        panel(axes, title, runs)
    if shared:
        legend_below(canvas)
    return canvas


def _rate_panel(axes: "Axes", title: str, runs: DataFrame) -> None:
    _frame(axes, title, "contraction [-]", _RATES)
    axes.axhline(1.0, color="black", linewidth=0.8)
    plain = runs[runs.loop == PLAIN]
    for name, style, label in (("linearised", "-", "plain, linearised"), ("bound", ":", "bound μγ of plain")):
        known = plain[(plain[name] > _RATES[0]) & (plain[name] < _RATES[1])]
        if len(known):
            axes.plot(known.friction, known[name], color="black", linestyle=style, linewidth=0.9, label=label)
    for loop, found in by_loop(runs[runs.loop != CONDENSED]):
        rated = found[found.rate > _RATES[0]]
        _marks(axes, loop, rated.friction, rated.rate)
        for run in rated.dropna(subset=["low", "high"]).itertuples():
            ends = [max(run.low, _RATES[0]), min(run.high, _RATES[1])]
            axes.plot([run.friction] * 2, ends, color=LOOPS[loop].colour, linewidth=1.0)
        _failures(axes, loop, found, _RATES)


def _numbers_panel(
    axes: "Axes", title: str, runs: DataFrame, column: str, label: str, limits: tuple[float, float, float]
) -> None:
    """A column of the runs of each loop that has it."""
    _frame(axes, title, label, limits)
    if column == "ratio":
        axes.axhline(1.0, color="black", linewidth=0.8)
    for loop, found in by_loop(runs[(runs.loop != CONDENSED) | (column != "ratio")]):
        known = found[found[column].notna()]
        _marks(axes, loop, known.friction, known[column])
        _failures(axes, loop, found, limits)


def _history_panel(axes: "Axes", title: str, runs: DataFrame) -> None:
    axes.set(xscale="log", yscale="log", ylim=(1e-10, 3.0), xlabel="iteration [-]", ylabel="residual [-]")
    plain_ticks(axes.xaxis, axes.yaxis)
    axes.set_title(title, fontsize=9)
    axes.axhline(TOLERANCE, color="black", linewidth=0.8, linestyle="--")
    for run in runs[runs.has & (runs.residuals.str.len() > 0)].itertuples():
        look, shown = LOOPS[run.loop], [max(value, 1e-10) for value in run.residuals]
        axes.plot(range(1, len(shown) + 1), shown, color=look.colour, linestyle=look.line, linewidth=1.1,
                  label=run.loop, marker=look.marker, markersize=4, markevery=max(1, len(shown) // 6))  # fmt: skip
        if not run.solved:
            axes.plot([len(shown)], [shown[-1]], color=look.colour, marker="x", markersize=8, markeredgewidth=2)


def shown_places(main: dict[str, DataFrame]) -> dict[str, DataFrame]:
    """Of each main problem the runs at the middle μ of those the plain loop solves, and of those it does not."""
    shown = {}
    for body, runs in main.items():
        for solved in (True, False):
            found = runs[(runs.loop == PLAIN) & (runs.solved == solved)].friction.tolist()
            for friction in found[len(found) // 2 : len(found) // 2 + 1]:
                shown[f"{body}, μ = {friction:g}"] = runs[runs.friction == friction]
    return shown


def _mesh_panel(axes: "Axes", problem: str, plain: DataFrame) -> None:
    """Contraction of the plain loop against the mesh."""
    _frame(axes, NAMES.get(problem, problem), "contraction [-]", _RATES)
    powers_of_two(axes)
    axes.set_xlabel("cells a side [-]")
    axes.axhline(1.0, color="black", linewidth=0.8)
    for number, (friction, found) in enumerate(plain.groupby("friction")):
        colour, marker, _ = LOOKS[number % len(LOOKS)]
        rated, local = found[found.rate > 0.0], found[found.linearised > 0.0]
        axes.plot(rated.cells, rated.rate, color=colour, marker=marker, markersize=5, label=f"μ = {friction:g}")
        if len(local):
            axes.plot(local.cells, local.linearised, color=colour, linestyle=":", linewidth=1.0)
        failed = found[~found.solved].cells
        axes.plot(failed, [20.0 * 1.15**number] * len(failed), "x", color=colour, markersize=7, markeredgewidth=2)
    axes.legend(fontsize=7, frameon=False, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.2))  # not over curves


def _frame(axes: "Axes", title: str, label: str, limits: tuple[float, float, float]) -> None:
    bottom, band, top = limits
    axes.set(yscale="log", ylim=(bottom, top), xlabel="friction μ [-]", ylabel=label)
    plain_ticks(axes.yaxis)
    failing_band(axes, band, top)
    axes.set_title(title, fontsize=9)


def _marks(axes: "Axes", loop: str, x: Series, y: Series) -> None:
    look = LOOPS[loop]
    axes.plot(x, y, color=look.colour, linestyle=look.line, marker=look.marker, markersize=5, linewidth=1.1,
              label=loop)  # fmt: skip


def _failures(axes: "Axes", loop: str, runs: DataFrame, limits: tuple[float, float, float]) -> None:
    """Crosses in the band for runs that fail, each loop at its own height."""
    _, band, top = limits
    share = (1 + list(LOOPS).index(loop)) / (len(LOOPS) + 1)
    frictions = runs[~runs.solved].friction
    axes.plot(frictions, [band * (top / band) ** share] * len(frictions), "x", color=LOOPS[loop].colour, markersize=6,
              markeredgewidth=1.5)  # fmt: skip
