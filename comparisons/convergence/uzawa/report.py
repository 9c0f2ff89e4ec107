"""The report of the study, from its rows alone."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from pandas import DataFrame, Series, to_numeric

from comparisons.convergence.bodies import PLACE, in_words
from comparisons.convergence.linearised import growth_order
from comparisons.convergence.uzawa.study import HALF, ITERATIONS, LONG, METHODS, MOST, NEAR, SEARCHED, STILL, TARGETS
from comparisons.lab.drawing import LOOKS, drawn, grid, legend_below, plain_ticks, powers_of_two
from comparisons.lab.numbers import NOTHING, count, fixed, listing, percent, scientific, seconds, significant, span
from comparisons.lab.reports import Form, Report, crossed, render
from comparisons.lab.studies import Row, frame_of, largest_of
from comparisons.paper.reference import load
from qvi_contact.plots.style import new_figure

if TYPE_CHECKING:
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
    paper, two = load(), partial(significant, digits=2)
    found, searches, equal, maps = paper_runs(runs), searches_of(runs), of(runs, *METHODS), of(runs, "map")
    rough, smooth = found[found.friction > 0.0], found[found.friction == 0.0]
    sliding = rough[rough.linearised > 0.0]
    met = {name: int(((found[name] - found.printed).abs() < _LAST_DIGIT).sum())
           for name in ("after", "after_printed_rule")}  # fmt: skip
    plate = searches[(searches.step == "ω_T") & (searches.problem == "plate")]
    both, exact = plate[plate.largest.notna() & plate.smallest.notna()], searches[searches.problem == "sliding"]
    local = both.largest / both.foreseen
    half = maps[(maps.tangential == HALF) & (maps.normal == HALF)].set_index(PLACE)[SOON]
    saved, counts = (half / _quickest(maps)).dropna(), {name: equal[equal.run == name] for name in METHODS}
    return {
        # after the paper's iterations: errors, what the step costs, how many printed values are met
        "worst": largest_of(rough.error, rough), "tractions": rough.tractions.max(), "frictions": len(rough),
        "needed": span(rough[SOON][rough[SOON] > paper.iterations]), "sliding": len(sliding),
        "shares": span(sliding.share, percent), "rates": span(sliding.linearised),
        "powers": span(sliding.linearised**paper.iterations, two), "quickest": span(sliding["quickest"]),
        "factors": span(sliding.factor, two), "printed": len(found), "accumulating": met["after"],
        "as_printed": met["after_printed_rule"], "smooth": largest_of(smooth.last_error, smooth),
        # observed limits of ω_T on the plate beside the two of theory, and the one known by hand
        "searches": len(plate), "safe": int((plate.largest >= 1.0).sum()), "largest": span(both.largest),
        "foreseen": int(local.notna().sum()), "early": int((both.smallest < both.foreseen).sum()),
        "local": span(local.dropna()), "beyond": int((local > 1.0).sum()),
        "sliding_limit": largest_of(exact.largest, exact),
        # how many targets each method meets, how much the best steps save, and finer meshes
        "targets": {name: (int((each.status == "solved").sum()), len(each)) for name, each in counts.items()},
        "saved": span(saved[saved.index.isin(equal.set_index(PLACE).index)]),
        "slow": int(of(runs, "mesh")["to 1e-06"].isna().sum()), "meshes": len(of(runs, "mesh")),
        "orders": span(growth(runs).order, lambda order: f"{-order:.2f}".replace("-", "−")),
        "iterations": paper.iterations, "omega": paper.omega_T, "half": HALF, "failed": int((~runs.has).sum()),
        "steps": ITERATIONS, "long": LONG, "longest": MOST, "searched": SEARCHED, "near": NEAR, "still": STILL,
        "methods": METHODS,
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


FORMS: Final[Mapping[str, Form]] = {
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


def tables_of(runs: DataFrame) -> dict[str, DataFrame]:
    """The tables by name; "settles" is the largest step that does, ">" where no share searched fails."""
    equal, searches = of(runs, *METHODS), searches_of(runs)
    settles = [NOTHING if good != good else f"{'> ' if bad != bad else ''}{significant(good)}"
               for good, bad in zip(searches.largest, searches.smallest, strict=True)]  # fmt: skip
    return {
        "paper": paper_runs(runs), "limit-table": searches.assign(settles=settles), "growth": growth(runs),
        "maps": _maps(of(runs, "map")), "accuracy": equal,
        "reach": crossed(  # the tightest target that is met
            equal.assign(problem=equal["where"]), "problem", "run",
            lambda found: scientific(found.target[found.status == "solved"].min(), 1), tuple(METHODS),
        ),
    }  # fmt: skip


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


def report(rows: Sequence[Row]) -> Report:
    """The report; the same rows give the same report."""
    runs = runs_of(rows)
    figures = {
        "history": drawn("uzawa-history", partial(_paper, of(runs, "paper"))),
        "limits": drawn("uzawa-limits", partial(_limit_picture, searches_of(runs))),
    }
    return render("comparisons.convergence.uzawa", "convergence-uzawa", values_of(runs), tables_of(runs), figures, rows,
                  forms=FORMS)  # fmt: skip
