"""The report of the study, from its rows alone."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from pandas import DataFrame, Series, to_numeric

from comparisons.convergence.bodies import PLACE
from comparisons.convergence.rates import growth_order
from comparisons.convergence.solves import in_words
from comparisons.convergence.uzawa.study import HALF, ITERATIONS, LONG, METHODS, MOST, NEAR, SEARCHED, STILL, TARGETS
from comparisons.lab.report import Document, environment_grids, render
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
from comparisons.lab.report.numbers import (
    NOTHING,
    count,
    fixed,
    listing,
    percent,
    scientific,
    seconds,
    significant,
    span,
)
from comparisons.lab.study import Row, frame_of, largest_of
from comparisons.lab.tables import Grid, crossed
from comparisons.paper.reference import load
from qvi_contact.basics.checks import FloatArray
from qvi_contact.plots import GREY, VERMILLION
from qvi_contact.plots.style import new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

SOON: Final = "to 1e-04"
"""Iterations until the normal force is within 1e-4 for good."""

_NUMBERS: Final = (
    "tangential", "normal", "target", "omega_T", "omega_N", "limit_T", "limit_N", "slipping_T", "open_N", "linearised",
    "condition", "open", "points", "force", "iterations", "settles", "last_error", "last_change", "largest", "smallest",
    "foreseen", "printed", "after", "after_printed_rule", "before", "tractions",
)  # fmt: skip
"""Columns that are numbers, NaN where a run has none; see `study.run`."""

_TARGETS: Final = tuple(f"to {target:.0e}" for target in TARGETS)

_LAST_DIGIT: Final = 0.00501  # of P/2: half of the last digit printed, and rounding


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line a run, by problem, mesh and μ.

    The columns are those of `frame_of` and `in_words`, the place as problem, cells (0 without a mesh), friction, and
    where (the three in words), and "to 1e-02" and so on, iterations to that error for good.
    """
    runs = frame_of(rows, _NUMBERS, ("seconds", "needed", "errors"))
    for place, name in enumerate(PLACE):
        runs[name] = runs.place.str[place]
    runs["friction"] = runs.friction.astype(float)
    runs = in_words(runs)
    runs["where"] = runs.body + runs.friction.map(", μ = {:g}".format)
    for name in _TARGETS:
        runs[name] = to_numeric(runs.needed.str.get(name.removeprefix("to ")))
    return runs.sort_values(PLACE, kind="stable", ignore_index=True)


def of(runs: DataFrame, *names: str) -> DataFrame:
    """The runs of these names that have a result."""
    return runs[runs.run.isin(names) & runs.has]


def _quickest(maps: DataFrame) -> Series:
    """By problem, mesh and μ: iterations to 1e-4 of the quickest pair of steps that settles."""
    return maps[maps.settles == 1].groupby(PLACE)[SOON].min()


def paper_runs(runs: DataFrame) -> DataFrame:
    """The paper's runs, with the quickest one of the map of the same problem beside them."""
    maps, found = of(runs, "map"), of(runs, "paper")
    found = found.join(_quickest(maps).rename("quickest"), on=PLACE)
    return found.assign(
        error=(found.after / found.force - 1.0).abs(), share=found.omega_T / found.limit_T,
        factor=found[SOON] / found.quickest,
    )  # fmt: skip


def searches_of(runs: DataFrame) -> DataFrame:
    """Searches for the largest step, with shares of 2 / λ_max over all points."""
    found = of(runs, "tangential limit", "normal limit").copy()
    tangential = found.run == "tangential limit"
    found["step"] = tangential.map({True: "ω_T", False: "ω_N"})
    found["limit"] = found.limit_T.where(tangential, found.limit_N)
    found["part"] = found.slipping_T.where(tangential, found.open_N) / found.limit
    found["observed"] = found.omega_T.where(tangential, found.omega_N)
    return found


def values_of(runs: DataFrame) -> dict[str, Any]:
    """The numbers of the report's sentences."""
    paper = load()
    return {
        "iterations": paper.iterations, "omega": paper.omega_T, "half": HALF, "failed": int((~runs.has).sum()),
        **_of_paper(paper_runs(runs)), **_of_limits(searches_of(runs)), **_of_accuracy(runs),
        "slow": int(of(runs, "mesh")["to 1e-06"].isna().sum()), "meshes": len(of(runs, "mesh")),
        "orders": span(growth(runs).order, lambda order: f"{-order:.2f}".replace("-", "−")),
        "steps": ITERATIONS, "long": LONG, "longest": MOST, "searched": SEARCHED, "near": NEAR, "still": STILL,
        "methods": {name: method.options for name, method in METHODS.items()},
    }  # fmt: skip


def _of_paper(found: DataFrame) -> dict[str, Any]:
    """After the paper's iterations: errors, what the step costs, how many printed values are met."""
    rough = found[found.friction > 0.0]
    sliding = rough[rough.linearised > 0.0]
    smooth = found[found.friction == 0.0]
    digits = {
        name: int(((found[name] - found.printed).abs() < _LAST_DIGIT).sum()) for name in ("after", "after_printed_rule")
    }
    return {
        "worst": largest_of(rough.error, rough), "tractions": rough.tractions.max(),
        "needed": span(rough[SOON][rough[SOON] > load().iterations]),
        "frictions": len(rough),
        "sliding": len(sliding), "shares": span(sliding.share, percent), "rates": span(sliding.linearised),
        "powers": span(sliding.linearised ** load().iterations, lambda value: significant(value, 2)),
        "quickest": span(sliding["quickest"]), "factors": span(sliding.factor, lambda value: significant(value, 2)),
        "printed": len(found), "accumulating": digits["after"], "as_printed": digits["after_printed_rule"],
        "smooth": largest_of(smooth.last_error, smooth),
    }  # fmt: skip


def _of_limits(found: DataFrame) -> dict[str, Any]:
    """Observed limits of ω_T on the plate beside the two of theory, and the one known by hand."""
    plate = found[(found.step == "ω_T") & (found.problem == "plate")]
    both = plate[plate.largest.notna() & plate.smallest.notna()]
    local = both.largest / both.foreseen
    exact = found[found.problem == "sliding"]
    return {
        "searches": len(plate), "safe": int((plate.largest >= 1.0).sum()), "largest": span(both.largest),
        "foreseen": int(local.notna().sum()), "early": int((both.smallest < both.foreseen).sum()),
        "local": span(local.dropna()), "beyond": int((local > 1.0).sum()),
        "sliding_limit": largest_of(exact.largest, exact),
    }  # fmt: skip


def _of_accuracy(runs: DataFrame) -> dict[str, Any]:
    """How many targets each method meets, and how much the best steps save."""
    equal, maps = of(runs, *METHODS), of(runs, "map")
    half = maps[(maps.tangential == HALF) & (maps.normal == HALF)].set_index(PLACE)[SOON]
    saved = (half / _quickest(maps)).dropna()
    counts = {name: equal[equal.run == name] for name in METHODS}
    return {
        "targets": {name: (int((found.status == "solved").sum()), len(found)) for name, found in counts.items()},
        "saved": span(saved[saved.index.isin(equal.set_index(PLACE).index)]),
    }  # fmt: skip


def growth(runs: DataFrame) -> DataFrame:
    """For each μ: how iterations to 1e-4 and the condition grow with the cells a side, and where ω_T is too long."""
    searches, lines = searches_of(runs), []
    for friction, found in of(runs, "mesh").sort_values("cells").groupby("friction"):
        bounded = searches[(searches.step == "ω_T") & (searches.problem == "plate") & (searches.friction == friction)]
        short = bounded[bounded.smallest.notna() & (bounded.observed < load().omega_T)]
        lines.append({
            "friction": friction, "order": growth_order(found.cells, found[SOON]),
            "growth": growth_order(found.cells, found.condition), "most": found[SOON].max(),
            "beyond": listing([f"{cells}²" for cells in short.cells]),
        })  # fmt: skip
    return DataFrame(lines, columns=["friction", "order", "growth", "most", "beyond"])


def _power(order: float | None) -> str:
    """Of a quantity that grows like (cells a side)^order: "h^−1.50"."""
    return NOTHING if order is None or order != order else f"h^{'−' if order >= 0.0 else ''}{abs(order):.2f}"


FORMS: Final[Mapping[str, Callable[[Any], str]]] = {
    "friction": fixed("g"), "seconds": seconds, "accuracy": scientific,
    **dict.fromkeys(("printed", "after", "after_printed_rule", "force"), fixed(".2f")),
    **dict.fromkeys(("before", "error", "tractions"), partial(percent, digits=2)),
    **dict.fromkeys((*_TARGETS, "quickest", "open", "iterations", "most"), count),
    **dict.fromkeys(("factor", "share"), partial(significant, digits=2)),
    **dict.fromkeys(("condition", "linearised", "smallest", "foreseen", "part", "best"), significant),
    **dict.fromkeys(("limit", "observed", "omega_T"), partial(scientific, digits=3)),
    "target": partial(scientific, digits=1), **dict.fromkeys(("order", "growth"), _power),
}  # fmt: skip
"""Column of a table → how its numbers read."""


def tables_of(runs: DataFrame) -> dict[str, DataFrame | Grid]:
    """The tables by name."""
    meshes, equal = of(runs, "mesh").sort_values(["friction", "cells"]), of(runs, *METHODS)
    close = meshes.linearised.map(partial(significant, digits=4))
    return {
        "paper": paper_runs(runs), "limit-table": _limits(searches_of(runs)), "growth": growth(runs),
        "meshes": meshes.assign(contraction=close), "maps": _maps(of(runs, "map")), "accuracy": equal,
        "reach": crossed(equal.assign(problem=equal["where"]), "problem", "run", _tightest, tuple(METHODS)),
    }  # fmt: skip


def _limits(found: DataFrame) -> DataFrame:
    """With the largest step that settles in words, ">" where no share searched fails."""
    ends = zip(found.largest, found.smallest, strict=True)
    return found.assign(settles=[
        NOTHING if good != good else f"{'> ' if bad != bad else ''}{significant(good)}" for good, bad in ends
    ])  # fmt: skip


def _maps(found: DataFrame) -> DataFrame:
    """The quickest pair of steps of each map, and whether ω_N changes anything."""
    lines = []
    for where, runs in found.groupby("where", sort=False):
        settled = runs[runs.settles == 1].sort_values(SOON, kind="stable").dropna(subset=SOON)
        one = runs.groupby("tangential", dropna=False)[["settles", SOON]].nunique(dropna=False)
        lines.append({
            "where": where, "pairs": len(runs), "failing": int((runs.settles != 1).sum()),
            SOON: settled[SOON].min(), "best": next(iter(settled.tangential), None),
            "matters": "yes" if (one > 1).any(axis=None) else "no",
        })  # fmt: skip
    return DataFrame(lines)


def _tightest(found: DataFrame) -> str:
    """The tightest target that is met."""
    return scientific(found.target[found.status == "solved"].min(), 1)


_TICKS: Final = (0.125, 0.25, 0.5, 1, 2, 4)


def figures(runs: DataFrame) -> dict[str, str]:
    """Name → picture; empty where matplotlib is not installed."""
    maps, plate = of(runs, "map"), of(runs, "map").problem == "plate"
    drawings: dict[str, Callable[[], Canvas]] = {
        "history": partial(_paper, of(runs, "paper")), "map-plate": partial(_map_panels, maps[plate]),
        "map-open": partial(_map_panels, maps[~plate]), "limits": partial(_limit_picture, searches_of(runs)),
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
    counts = [number for _, runs in maps for number in _reached(runs).dropna()]
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
    for run, reached in zip(found.itertuples(), _reached(found), strict=True):
        i, j = tangential.index(run.tangential), normal.index(run.normal)
        hatch = None if np.isfinite(reached) else "..." if run.settles == 1 else "////"
        face = "white" if hatch else scale.to_rgba(reached)
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


def _limit_picture(searches: DataFrame) -> "Canvas":
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


def report(rows: Sequence[Row], quick: bool = False) -> Document:
    """The report; the same rows give the same report."""
    runs = runs_of(rows)
    return render(
        "comparisons.convergence.uzawa", "convergence-uzawa-quick" if quick else "convergence-uzawa",
        {"quick": quick, **values_of(runs)}, tables_of(runs), figures(runs), environment_grids(rows), forms=FORMS,
    )  # fmt: skip
