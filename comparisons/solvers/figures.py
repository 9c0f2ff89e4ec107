"""The pictures: performance profiles, how true "solved" is, accuracies, warm starts."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Final

from pandas import DataFrame, Series

from comparisons.lab.report import drawn
from comparisons.lab.report.drawing import grid, plain_ticks
from comparisons.solvers import measures
from comparisons.solvers.accuracies import LEVELS
from comparisons.solvers.measures import HIGHLIGHTED, UNTIL
from comparisons.solvers.outcomes import FALSE_ALARM, GAVE_UP, MODEST, NO_ANSWER, RIGHT, UNTRUE
from comparisons.solvers.tasks import INNER
from qvi_contact.plots import BLUE, GREEN, GREY, ORANGE, VERMILLION
from qvi_contact.plots.style import PURPLE, SKY, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_RATIOS: Final = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)  # that axes tell
KINDS: Final = ("inner", "sequence", "outer")
_PALE: Final = "#c8c8c8"
_COLOURS: Final = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, "#000000")
_MARKERS: Final = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "*", "p")
_LINES: Final = ("-", "--", "-.", ":")
_LEVEL_LOOKS: Final = ((BLUE, "o"), (VERMILLION, "s"), (GREEN, "^"))
_BARS: Final[Mapping[str, tuple[str, str]]] = {
    RIGHT: (BLUE, ""), UNTRUE: (VERMILLION, "////"), FALSE_ALARM: (PURPLE, "xxxx"), MODEST: (SKY, "...."),
    GAVE_UP: ("#dddddd", ""), NO_ANSWER: (GREY, "\\\\\\\\"),
}  # fmt: skip


def figures(runs: DataFrame) -> dict[str, str]:
    """Name → picture; empty where there is nothing to draw, or matplotlib is not installed."""
    pictures: dict[str, Callable[[], Figure | None]] = {
        "truth-shares": partial(truth, runs),
        **{f"profiles-{kind}": partial(profiles, measures.of_kind(runs, kind)) for kind in KINDS},
        "warmth": partial(warmth, runs),
        "accuracies": partial(accuracy, runs),
    }
    return {name: drawn(name, draw) for name, draw in pictures.items()}


def profiles(runs: DataFrame) -> "Figure | None":
    """A panel for each level, a step curve for each solver."""
    if runs.empty:
        return None
    levels = [level for level in LEVELS if level in set(runs.level)]
    figure = new_figure(3.9 * len(levels), 4.4)
    panels = figure.subplots(1, len(levels), sharey=True, squeeze=False)[0]
    ratios = [measures.performance_ratios(runs[runs.level == level]) for level in levels]
    looks = _looks([_coloured(each) for each in ratios])
    for axes, level, each in zip(panels, levels, ratios, strict=True):
        _profile_panel(axes, each, looks)
        axes.set_title(f"{level}: certified at {LEVELS[level]:.0e}", fontsize=9)
        axes.set_xlabel("time over that of the fastest [-]")
    panels[0].set_ylabel("share of problems solved [-]")
    return figure


def _coloured(ratios: DataFrame) -> list[str]:
    """The best solvers by area, those that solve nothing left out."""
    best = measures.area(ratios, UNTIL).sort_index().sort_values(ascending=False, kind="stable").index
    return [solver for solver in best if ratios[solver].min() < float("inf")][:HIGHLIGHTED]


def _looks(panels: Sequence[Sequence[str]]) -> dict[str, tuple[str, str, str]]:
    """Colour, marker and line of each solver of a picture; colours repeat from the eighth on, other markers do not."""
    solvers = dict.fromkeys(solver for panel in panels for solver in panel)
    return {
        solver: (_COLOURS[k % len(_COLOURS)], _MARKERS[k % len(_MARKERS)], _LINES[k % len(_LINES)])
        for k, solver in enumerate(solvers)
    }


def _profile_panel(axes: "Axes", ratios: DataFrame, looks: Mapping[str, tuple[str, str, str]]) -> None:
    """The best by area in colour with markers, the others in grey."""
    coloured = _coloured(ratios)
    for solver in ratios.columns.drop(coloured):
        axes.step(*measures.steps(ratios[solver], UNTIL), where="post", color=_PALE, linewidth=0.9, zorder=1)
    for solver in coloured:
        colour, marker, line = looks[solver]
        x, y = measures.steps(ratios[solver], UNTIL)
        label = f"{solver} ({(ratios[solver] < float('inf')).sum()} of {ratios[solver].count()})"
        axes.step(x, y, where="post", color=colour, linestyle=line, linewidth=1.5, marker=marker, markersize=4,
                  markevery=max(1, len(x) // 6), label=label, zorder=2)  # fmt: skip
    _log_axis(axes, _RATIOS[_RATIOS.index(1.0) :])
    axes.set(xlim=(1.0, UNTIL), ylim=(-0.02, 1.02))
    grid(axes)
    if coloured:
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), fontsize=8, frameon=False)


def _log_axis(axes: "Axes", ticks: Sequence[float]) -> None:
    """Ratios along a logarithmic axis."""
    from matplotlib.ticker import FixedLocator

    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    plain_ticks(axes.xaxis)


def truth(runs: DataFrame) -> "Figure | None":
    """A bar for each solver: what became of its inner problems, as shares."""
    told = measures.told_by(runs)[[*_BARS]]
    if told.empty:
        return None
    shares = told.div(told.sum(axis=1), axis=0).sort_index().sort_values(RIGHT, kind="stable")
    figure = new_figure(8.0, 0.9 + 0.27 * len(shares))
    axes = figure.subplots()
    starts = shares.cumsum(axis=1) - shares
    for outcome, (colour, hatch) in _BARS.items():
        if shares[outcome].any():
            axes.barh(shares.index, shares[outcome], left=starts[outcome], color=colour, hatch=hatch,
                      edgecolor="white", linewidth=0.4, label=outcome)  # fmt: skip
    axes.set(xlim=(0.0, 1.0), xlabel="share of the inner problems that have a solution [-]")
    figure.legend(loc="outside upper center", ncols=6, fontsize=8, frameon=False)
    return figure


def accuracy(runs: DataFrame) -> "Figure | None":
    """For each solver and level the accuracy of single inner problems: median, and from best to worst."""
    chosen = runs[(runs.task == INNER) & runs.feasible]
    if chosen.accuracy.isna().all():
        return None
    solvers = [*reversed(chosen.solver.unique())]
    figure = new_figure(8.0, 0.9 + 0.34 * len(solvers))
    axes = figure.subplots()
    for number, (level, (colour, marker)) in enumerate(zip(LEVELS, _LEVEL_LOOKS, strict=True)):
        axes.axvline(LEVELS[level], color=colour, linestyle=":", linewidth=1.0)
        for place, solver in enumerate(solvers):
            values = chosen[(chosen.solver == solver) & (chosen.level == level)].accuracy.dropna()
            _range(axes, values, place + 0.22 * (1 - number), colour, marker, level if place == 0 else "")
    axes.set_xscale("log")
    _solvers_down(axes, solvers, "smallest tolerance at which the certificate passes [-]")
    figure.legend(loc="outside upper center", ncols=3, fontsize=8, frameon=False)
    return figure


def _range(axes: "Axes", values: "Series[float]", height: float, colour: str, marker: str, label: str) -> None:
    """A line from the smallest to the largest value, a mark at the median."""
    if values.empty:
        return
    axes.plot([values.min(), values.max()], [height, height], color=colour, linewidth=1.0)
    axes.plot([values.median()], [height], color=colour, marker=marker, markersize=5, linestyle="none",
              label=label or None)  # fmt: skip


def _solvers_down(axes: "Axes", solvers: Sequence[str], label: str) -> None:
    """A line for each solver, and what is told along it."""
    axes.set_yticks(range(len(solvers)), solvers)
    axes.set_xlabel(label)
    grid(axes, along="x")


def warmth(runs: DataFrame) -> "Figure | None":
    """A dot for each sequence: warm over cold time, and the geometric mean of each solver."""
    ratios = measures.warm_ratios(runs).dropna(subset="ratio").groupby("solver", sort=False).ratio
    if not len(ratios):
        return None
    means = ratios.agg(measures.geometric_mean).sort_values(ascending=False, kind="stable")
    figure = new_figure(8.0, 1.0 + 0.3 * len(means))
    axes = figure.subplots()
    axes.axvline(1.0, color=GREY, linewidth=1.0, linestyle="--")
    for place, (solver, mean) in enumerate(means.items()):
        values = ratios.get_group(solver)
        axes.plot(values, [place] * len(values), color=SKY, marker="o", markersize=4, linestyle="none", alpha=0.7)
        axes.plot([mean], [place], color=VERMILLION, marker="D", markersize=6, linestyle="none")
    _log_axis(axes, _RATIOS)
    _solvers_down(axes, [*means.index], "time of the warm over that of the cold sequence [-]")
    return figure
