"""How loops over the friction bound converge: problems × meshes × μ × loops, their residuals; and the report."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from matplotlib.figure import Figure as Canvas
from pandas import DataFrame, Series

from comparisons.convergence.bodies import PLACE, ending, in_words, timed
from comparisons.lab.drawing import drawn, grid, legend_below, panelled, plain_ticks
from comparisons.lab.numbers import count, fixed, scientific, seconds, significant
from comparisons.lab.reports import Form, Report, render
from comparisons.lab.studies import Row, Study, frame_of, largest_of
from qvi_contact.plots.style import BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILLION
from solvers.certificate.uniqueness import uniqueness_bound

INNER: Final = "direct:clarabel"
"""Inner solver of all loops."""

TOLERANCE: Final = 1e-8
"""That of the residual and of the certificate."""

MAX_ITERATIONS: Final = 200

PATIENCE: Final = 60
"""Iterations without progress after which a loop is given up; long, so that slow convergence is seen for what it is."""


class Loop(NamedTuple):
    """A loop: `variant` of the fixed point (None: the condensed method) and step θ, and how it is drawn."""

    variant: Literal["plain", "damped", "anderson"] | None
    damping: float
    colour: str
    marker: str
    line: Any

    def options(self) -> dict[str, Any]:
        """Keyword arguments of `solve_qvi`."""
        if self.variant is None:
            return {"method": "condensed", "tolerance": TOLERANCE}
        return {
            "method": "fixed-point", "inner": INNER, "tolerance": TOLERANCE, "variant": self.variant,
            "damping": self.damping, "max_iterations": MAX_ITERATIONS, "patience": PATIENCE,
        }  # fmt: skip


PLAIN: Final = "plain"
ANDERSON: Final = "Anderson"
CONDENSED: Final = "condensed"

LOOPS: Final[Mapping[str, Loop]] = {
    PLAIN: Loop("plain", 1.0, VERMILLION, "o", "-"),
    "damped 0.75": Loop("damped", 0.75, ORANGE, "^", "--"),
    "damped 0.5": Loop("damped", 0.5, GREEN, "s", "-."),
    "damped 0.25": Loop("damped", 0.25, PURPLE, "v", ":"),
    ANDERSON: Loop("anderson", 0.5, BLUE, "D", (0, (5, 1))),
    CONDENSED: Loop(None, 1.0, GREY, "*", (0, (1, 1))),
}
"""All loops, in the order of tables and legends."""

Meshes = Mapping[tuple[str, int], tuple[float, ...]]

FULL: Final[Meshes] = {
    ("contacts", 0): (0.25, 0.5, 1.0, 1.1, 1.2, 1.3, 1.5, 2.0, 3.0, 4.0),
    ("plate", 4): (0.05, 0.1, 0.15, 0.2, 0.25),
    ("plate", 8): (0.05, 0.1, 0.15, 0.2, 0.25),
    ("plate", 16): (0.05, 0.1, 0.15, 0.2, 0.25),
    ("plate", 32): (0.1, 0.2),
    ("block", 4): (0.12, 0.15, 0.2, 0.3),
    ("block", 8): (0.105, 0.11, 0.12, 0.15, 0.2, 0.3),
    ("block", 16): (0.12, 0.2),
    ("ssnv128", 4): (0.3, 0.5, 1.0),
    ("ssnv128", 8): (0.3, 0.5, 1.0, 2.0),
    ("ssnv128", 16): (0.1, 0.3, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0),
    ("ssnv128", 24): (0.3, 0.5, 1.0),
}
"""(Problem, cells a side) → μ."""

QUICK: Final[Meshes] = {
    ("contacts", 0): (0.5, 1.0, 2.0),
    ("plate", 4): (0.1,),
    ("plate", 8): (0.1,),
    ("ssnv128", 8): (0.3, 1.0, 4.0),
}

_ROUNDING: Final = 1e-12  # residuals below this are


def study(quick: bool) -> Study:
    """The study, or a few coarse meshes of it."""
    cases = [
        {"problem": problem, "cells": cells, "friction": friction, "loop": loop}
        for (problem, cells), frictions in (QUICK if quick else FULL).items()
        for friction in frictions
        for loop in LOOPS
    ]
    return Study("convergence-outer", 3, "comparisons.convergence.outer:run", cases)


def run(case: Mapping[str, Any]) -> dict[str, Any]:
    """Task of the study: solve a problem by a loop.

    Returns
    -------
    dict
        status, message, iterations : how it ended
        seconds : wall times of repeated solves, factorisation included
        residuals : of every outer iteration (of the interior point method where there is no loop)
        sharper : of the plain loop, 1/γ of `solvers.certificate`, None where it was not computed
        certificate : see `bodies.ending`

    """
    loop, place = case["loop"], (case["problem"], case["cells"], case["friction"])
    solution, seconds = timed(place, **LOOPS[loop].options())
    return {
        **ending(solution), "seconds": seconds, "residuals": [entry.residual for entry in solution.history],
        **({"sharper": uniqueness_bound(solution.problem).sharper} if loop == PLAIN else {}),
    }  # fmt: skip


def contraction(residuals: Sequence[float], target: float = 0.0) -> float | None:
    """The factor by which the residuals (k,) ≥ 0 of a loop shrink in an iteration; None if they do not.

    The last ones above rounding, half of them and 40 at most, are fitted by log r_k = a + b k, b the slope of Theil and
    Sen (the median over all pairs, so that single lucky or spoilt iterations do not count). They shrink if the last is
    at the target, or the upper end of the slope's interval of 95 % makes less than half of them in the fitted piece.
    After an iteration without a residual (its inner problem failed, say) the loop begins anew. Source: P. K. Sen, J.
    Amer. Statist. Assoc. 63 (1968).
    """
    from scipy.stats import theilslopes  # as long to load as all else of a worker

    values = np.asarray(residuals, dtype=float)
    missing = np.flatnonzero(~np.isfinite(values))
    values = values[missing[-1] + 1 :] if len(missing) else values
    above = np.flatnonzero(values > _ROUNDING)
    number = above[-min(max((len(above) + 1) // 2, min(len(above), 8)), 40) :]
    if len(number) < 4:
        return None
    slope, _, _, high = theilslopes(np.log(values[number]), number, 0.95)
    shrinks = values[-1] <= max(target, _ROUNDING) or high * (number[-1] - number[0]) < -np.log(2.0)
    return float(np.exp(slope)) if shrinks else None


FORMS: Final[Mapping[str, Form]] = {
    "friction": fixed("g"), "steps": count, "seconds": seconds, "accuracy": scientific,
    **dict.fromkeys(("rate", "ratio"), significant),
    **dict.fromkeys(("quicker", "typical", "slowest"), partial(significant, digits=2)),
}  # fmt: skip
"""Column of a table → how its numbers read."""


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line a run, by problem, mesh, μ and loop.

    The columns are those of `frame_of` and `in_words`, and solved, steps (iterations if solved), rate (the
    `contraction`), ratio (time over that of the condensed method where both solve the problem), and of the plain loop
    the bound μγ.
    """
    runs = in_words(frame_of(rows, ("iterations", "sharper"), ("seconds", "residuals")))
    runs["solved"] = runs.status == "solved"
    runs["steps"] = runs.iterations.where(runs.solved)
    runs["rate"] = [contraction(each, TOLERANCE) if isinstance(each, list) else None for each in runs.residuals]
    runs["rate"] = runs.rate.astype(float)
    runs["bound"] = runs.friction / runs.sharper
    direct = runs[(runs.loop == CONDENSED) & runs.solved].set_index(PLACE).seconds
    runs["ratio"] = (runs.seconds / runs[PLACE].apply(tuple, axis=1).map(direct.to_dict())).where(runs.solved)
    runs["order"] = runs.problem.map({name: place for place, name in enumerate(runs.problem.unique())})
    runs["number"] = runs.loop.map(list(LOOPS).index)
    return runs.sort_values(["order", "cells", "friction", "number"], kind="stable", ignore_index=True)


def main_bodies(runs: DataFrame) -> list[str]:
    """Of each problem the mesh with the most frictions, the finest of several."""
    found = []
    for _, several in runs.groupby("order"):
        counts = several.groupby(["cells", "body"]).friction.nunique().reset_index()
        found.append(str(counts.sort_values(["friction", "cells"]).body.iloc[-1]))
    return found


def by_loop(runs: DataFrame) -> list[tuple[str, "DataFrame"]]:
    """Loops that were run, in their order."""
    return [(loop, found) for loop in LOOPS if len(found := runs[runs.loop == loop])]


def values_of(runs: DataFrame) -> dict[str, Any]:
    """The numbers of the report's sentences."""
    direct, others = runs[runs.loop == CONDENSED], runs[runs.loop != CONDENSED]
    stopped, ratios = others[others.status == "max_iterations"].iterations, others[others.cells > 0].ratio.dropna()
    plain = runs[runs.loop == PLAIN]
    sure, beyond = plain[plain.bound < 1.0], plain[plain.bound >= 1.0]
    return {
        "limit": None if stopped.empty else int(stopped.max()), "missing": int((~runs.has).sum()),
        "counts": {loop: (int(each.solved.sum()), len(each)) for loop, each in by_loop(runs)},
        "least": direct.steps.min(), "most": direct.steps.max(), "low": runs.friction.min(),
        "high": runs.friction.max(), "worst": largest_of(ratios, runs),
        # the plain loop below and beyond the bound of uniqueness
        "sure": len(sure), "sure_solved": int(sure.solved.sum()), "beyond": len(beyond),
        "beyond_solved": int(beyond.solved.sum()), "farthest": plain[plain.solved].bound.max(),
        "loops": {name: loop.options() for name, loop in LOOPS.items()},
        "inner": INNER, "tolerance": TOLERANCE, "iterations": MAX_ITERATIONS, "patience": PATIENCE,
    }  # fmt: skip


def _loops(found: DataFrame) -> DataFrame:
    """Each loop beside the plain one and beside the condensed method."""
    plain = found[found.loop == PLAIN].set_index(PLACE)[["steps", "solved"]].add_suffix("_plain")
    lines = []
    for loop, runs in by_loop(found):
        beside = runs.set_index(PLACE).join(plain)
        hard = beside[beside.solved_plain == False]  # noqa: E712 - not where there is no plain run
        times = runs[runs.cells > 0].ratio.dropna()
        lines.append({
            "loop": loop, "share": _share(runs.solved), "hard": _share(hard.solved),
            "quicker": (beside.steps / beside.steps_plain).dropna().median(), "typical": times.median(),
            "slowest": times.max(),
        })  # fmt: skip
    return DataFrame(lines)


def _share(good: Series) -> str:
    return f"{int(good.sum())} of {len(good)}"


_RATES: Final = (1e-2, 10.0, 60.0)
"""Lowest rate drawn, beginning of the band of what fails, top."""


def _picture(runs: DataFrame) -> Canvas:
    """A panel for the main mesh of each problem, and one legend for all; crosses for runs that fail."""
    names = main_bodies(runs)
    canvas, panels = panelled(len(names), 8.0, 2.6, 0.9)
    bottom, band, top = _RATES
    for axes, name in zip(panels, names, strict=True):
        axes.set(yscale="log", ylim=(bottom, top), xlabel="friction μ [-]", ylabel="contraction [-]")
        plain_ticks(axes.yaxis)
        axes.axhspan(band, top, color=GREY, alpha=0.18, linewidth=0)
        axes.text(0.01, 0.985, "fails", transform=axes.transAxes, fontsize=7, va="top", color=GREY)
        grid(axes)
        axes.set_title(name, fontsize=9)
        axes.axhline(1.0, color="black", linewidth=0.8)
        here = runs[(runs.body == name) & (runs.loop != CONDENSED)]
        known = here[(here.loop == PLAIN) & (here.bound > bottom) & (here.bound < band)]
        if len(known):
            axes.plot(
                known.friction, known.bound, color="black", linestyle=":", linewidth=0.9, label="bound μγ of plain"
            )
        for place, (loop, several) in enumerate(by_loop(here), start=1):
            look, rated = LOOPS[loop], several[several.rate > bottom]
            axes.plot(rated.friction, rated.rate, color=look.colour, linestyle=look.line, marker=look.marker,
                      markersize=5, linewidth=1.1, label=loop)  # fmt: skip
            height = band * (top / band) ** (place / (len(LOOPS) + 1))  # each loop at its own
            failed = several[~several.solved].friction
            axes.plot(failed, [height] * len(failed), "x", color=look.colour, markersize=6, markeredgewidth=1.5)
    legend_below(canvas)
    return canvas


def report(rows: Sequence[Row]) -> Report:
    """The report; the same rows give the same report."""
    runs = runs_of(rows)
    tables, figures = {"loops": _loops(runs), "runs": runs}, {"rates": drawn("outer-rates", partial(_picture, runs))}
    return render("comparisons.convergence", "convergence-outer", values_of(runs), tables, figures, rows,
                  forms=FORMS, template="outer.md")  # fmt: skip
