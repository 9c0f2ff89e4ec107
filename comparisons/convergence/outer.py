"""How loops over the friction bound converge: problems × meshes × μ × loops, residuals, theory; and the report."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

import numpy as np
from pandas import DataFrame, Series

from comparisons.convergence.bodies import (
    PLACE,
    STATES,
    Reference,
    ending,
    exact_contraction,
    in_words,
    reference,
    timed,
)
from comparisons.convergence.linearised import rate_of
from comparisons.lab.drawing import drawn, failing_band, legend_below, panelled, plain_ticks
from comparisons.lab.numbers import NOTHING, count, fixed, listing, scientific, seconds, significant
from comparisons.lab.reports import Form, Report, render
from comparisons.lab.studies import Row, Study, frame_of, largest_of
from qvi_contact.plots import BLUE, GREEN, GREY, ORANGE, VERMILLION
from qvi_contact.plots.style import PURPLE
from solvers.certificate import uniqueness_bound

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

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
    ("three", 0): (2.0,),
}
"""(Problem, cells a side) → μ."""

QUICK: Final[Meshes] = {
    ("contacts", 0): (0.5, 1.0, 2.0),
    ("plate", 4): (0.1,),
    ("plate", 8): (0.1,),
    ("ssnv128", 8): (0.3, 1.0, 4.0),
    ("three", 0): (2.0,),
}

STARTS: Final = (0.0, 1.7, 10.0)
"""Pressures that loops start from where there are several solutions."""


def study(quick: bool) -> Study:
    """The study, or a few coarse meshes of it."""
    return Study("convergence-outer", 2, "comparisons.convergence.outer:run", [*cases(QUICK if quick else FULL)])


def cases(meshes: Meshes, loops: Sequence[str] = tuple(LOOPS)) -> Iterator[dict[str, Any]]:
    """All loops from the bonded state; on "three" each from several starts, but for the method that takes none."""
    for (problem, cells), frictions in meshes.items():
        for friction in frictions:
            for loop in loops:
                several = problem == "three" and LOOPS[loop].variant is not None
                for start in STARTS if several else (None,):
                    yield {"problem": problem, "cells": cells, "friction": friction, "loop": loop, "start": start}


def run(case: Mapping[str, Any]) -> dict[str, Any]:
    """Task of the study: solve a problem by a loop.

    Returns
    -------
    dict
        status, message, iterations : how it ended
        seconds : wall times of repeated solves, factorisation included
        residuals : of every outer iteration (of the interior point method where there is no loop)
        course, factor, low, high : see `rates.Rate`
        linearised : contraction by `linearised` at the solution of the condensed method; None without one
        exact : that known in closed form, None where none is
        sharper, kappa : 1/γ and κ^(−1/2) of `solvers.certificate`, None where they were not computed
        normal, tangential : resultants of σ_N and σ_T, in the unit of the problem's data × length
        slipping, open, points : numbers of contact points, slipping and open ones of the reference
        certificate : see `plain_certificate`

    """
    loop, place = LOOPS[case["loop"]], (case["problem"], case["cells"], case["friction"])
    start = {} if case["start"] is None else {"initial": np.full(1, case["start"])}
    known = reference(*place)
    solution, seconds = timed(place, **loop.options(), **start)
    residuals = [entry.residual for entry in solution.history]
    rate = rate_of(residuals, TOLERANCE)
    qvi, unit = solution.problem, known.body.force
    return {
        **ending(solution), "seconds": seconds, "residuals": residuals,
        "course": rate.course, "factor": rate.factor, "low": rate.low, "high": rate.high,
        **_theory(case, loop, known),
        "normal": unit * qvi.resultant(solution.z), "tangential": unit * float(qvi.W @ qvi.tangential(solution.z)),
    }  # fmt: skip


def _theory(case: Mapping[str, Any], loop: Loop, known: Reference) -> dict[str, Any]:
    step = loop.damping if loop.variant in ("plain", "damped") else None
    local, bound = known.linearised, uniqueness_bound(known.body.qvi)
    exact = case["problem"] == "contacts" and step is not None
    return {
        "linearised": None if local is None or step is None else local.outer_contraction(step),
        "exact": exact_contraction(case["friction"], step) if exact and step is not None else None,
        "sharper": bound.sharper, "kappa": bound.bound,
        "slipping": None if local is None else int(local.slipping.sum()),
        "open": None if local is None else int(local.open.sum()),
        "points": known.body.qvi.m,
    }  # fmt: skip


SOLUTIONS: Final = {state: STATES[state][0] for state in ("open", "slip", "stick")}
"""The three solutions of the problem that has them: state → pressure r_N."""

_NUMBERS: Final = (
    "start", "iterations", "factor", "low", "high", "linearised", "exact", "sharper", "kappa", "normal", "slipping",
    "open", "points",
)  # fmt: skip
"""Columns that are numbers, NaN where a run has none; see `run`."""

FORMS: Final[Mapping[str, Form]] = {
    "friction": fixed("g"), "steps": count, "seconds": seconds, "accuracy": scientific,
    **dict.fromkeys(("rate", "ratio", "linearised", "exact", "bound", "root"), significant),
    **dict.fromkeys(("quicker", "typical", "slowest", "smallest", "largest", "spread"), partial(significant, digits=2)),
}  # fmt: skip
"""Column of a table → how its numbers read."""


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line a run, by problem, mesh, μ and loop.

    The columns are those of `frame_of` and `in_words`, and solved, falling (stopped while its residuals fell), steps
    (iterations if solved), rate (contraction if the loop converges), ratio (time over that of the condensed method
    where both solve the problem), bound μγ and root μ√κ.
    """
    runs = in_words(frame_of(rows, _NUMBERS, ("seconds", "residuals", "course")))
    runs["solved"] = runs.status == "solved"
    runs["steps"] = runs.iterations.where(runs.solved)
    runs["rate"] = runs.factor.where(runs.course == "converges")
    runs["falling"] = ~runs.solved & (runs.course == "converges")
    runs["bound"], runs["root"] = runs.friction / runs.sharper, runs.friction / runs.kappa
    direct = runs[(runs.loop == CONDENSED) & runs.solved & (runs.problem != "three")].set_index(PLACE).seconds
    runs["ratio"] = (runs.seconds / runs[PLACE].apply(tuple, axis=1).map(direct.to_dict())).where(runs.solved)
    runs["order"] = runs.problem.map({name: place for place, name in enumerate(runs.problem.unique())})
    runs["number"] = runs.loop.map(list(LOOPS).index)
    return runs.sort_values(["order", "cells", "friction", "number"], kind="stable", ignore_index=True)


def single(runs: DataFrame) -> DataFrame:
    """Those of problems that all loops start from the bonded state."""
    return runs[runs.problem != "three"]


def main_bodies(runs: DataFrame) -> list[str]:
    """Of each problem the mesh with the most frictions, the finest of several."""
    found = []
    for _, several in single(runs).groupby("order"):
        counts = several.groupby(["cells", "body"]).friction.nunique().reset_index()
        found.append(str(counts.sort_values(["friction", "cells"]).body.iloc[-1]))
    return found


def by_loop(runs: DataFrame) -> list[tuple[str, "DataFrame"]]:
    """Loops that were run, in their order."""
    return [(loop, found) for loop in LOOPS if len(found := runs[runs.loop == loop])]


def values_of(runs: DataFrame) -> dict[str, Any]:
    """The numbers of the report's sentences."""
    found, several = single(runs), runs[runs.problem == "three"]
    direct, others = found[found.loop == CONDENSED], found[found.loop != CONDENSED]
    stopped, ratios = others[others.status == "max_iterations"].iterations, others[others.cells > 0].ratio.dropna()
    plain = found[found.loop == PLAIN]
    bounded, rated = plain[plain.bound.notna()], plain[plain.rate.notna()]
    sure, beyond = bounded[bounded.bound < 1.0], bounded[bounded.bound >= 1.0]
    exact, meshes = (rated.rate / rated.exact - 1.0).abs().dropna(), rated[rated.solved & (rated.cells > 0)]
    off = (meshes.rate / meshes.linearised - 1.0).abs().dropna()
    above, below = found[found.linearised >= 1.0], found[found.linearised < 1.0]
    stuck = below[~below.solved & ~below.falling]
    ends = [solution_found(run) for run in several.itertuples()]
    started, counts = several.assign(end=ends)[several.start.notna()], Counter(ends)
    known = [set(each.end) & set(SOLUTIONS) for _, each in started.groupby("loop")]
    return {
        "limit": None if stopped.empty else int(stopped.max()), "missing": int((~runs.has).sum()),
        "counts": {loop: (int(each.solved.sum()), len(each)) for loop, each in by_loop(found)},
        "least": direct.steps.min(), "most": direct.steps.max(), "low": found.friction.min(),
        "high": found.friction.max(), "worst": largest_of(ratios, runs),
        # the plain loop below and beyond the bound of uniqueness
        "sure": len(sure), "sure_solved": int(sure.solved.sum()), "beyond": len(beyond),
        "beyond_solved": int(beyond.solved.sum()), "farthest": bounded[bounded.solved].bound.max(),
        # how well theory foresees the contraction, and whether a linearised one below 1 is enough, one above too much
        "exact": exact.max(), "exact_runs": len(exact), "typical": off.median(), "mesh_runs": len(off),
        "off": off.max(), "far": largest_of(off, meshes), "above": len(above), "lucky": int(above.solved.sum()),
        "below": len(below), "stuck": len(stuck), "still": int(below.falling.sum()),
        "stuck_at": listing(list(dict.fromkeys(f"{run.body} at μ = {run.friction:g}" for run in stuck.itertuples()))),
        # which of the three solutions is found, and by how many loops in different ones from different starts
        "starts": {name: counts[name] for name in dict.fromkeys([*SOLUTIONS, *counts])}, "started": len(known),
        "different": sum(len(each) > 1 for each in known), "several": len(several),
        "loops": {name: loop.options() for name, loop in LOOPS.items()},
        "inner": INNER, "tolerance": TOLERANCE, "iterations": MAX_ITERATIONS, "patience": PATIENCE,
    }  # fmt: skip


def solution_found(run: Any) -> str:
    """Which of the three solutions a run ended in; the status if in none."""
    if not run.solved or run.normal != run.normal:
        return str(run.status)
    name = min(SOLUTIONS, key=lambda state: abs(SOLUTIONS[state] + run.normal))
    return name if abs(SOLUTIONS[name] + run.normal) < 1e-6 else "none of the three"


def tables_of(runs: DataFrame) -> dict[str, DataFrame]:
    """The tables by name."""
    found = single(runs)
    plain = found[found.loop == PLAIN]
    many = plain[plain.groupby(["problem", "friction"]).cells.transform("size") > 1].groupby(["problem", "friction"])
    spread = many.rate.agg(smallest="min", largest="max").assign(
        name=many.name.first(), share=many.rate.agg(lambda rates: _share(rates.notna()))
    )
    states = [" / ".join(map(count, (run.slipping, run.open, run.points))) for run in plain.itertuples()]
    return {
        "loops": _loops(found), "limits": _limits(found), "contraction": plain.assign(states=states), "runs": found,
        "spread": spread.assign(spread=spread.largest / spread.smallest).reset_index(),
        "solutions": _solutions(runs[runs.problem == "three"]),
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


def _limits(found: DataFrame) -> DataFrame:
    """Which frictions the plain loop solves on the main mesh of each problem."""
    lines = []
    for body in main_bodies(found):
        runs = found[(found.body == body) & (found.loop == PLAIN)]
        failed, falling = runs[~runs.solved & ~runs.falling], runs[runs.falling]
        lines.append({
            "body": body, "share": _share(runs.solved), "farthest": significant(runs[runs.solved].friction.max()),
            "fails": listing([f"{run.friction:g} ({run.status})" for run in failed.itertuples()]),
            "falling": listing([f"{run.friction:g} ({significant(run.rate)})" for run in falling.itertuples()]),
        })  # fmt: skip
    return DataFrame(lines)


def _share(good: Series) -> str:
    return f"{int(good.sum())} of {len(good)}"


def _solutions(several: DataFrame) -> DataFrame:
    """Which of three solutions each loop finds, from each start."""
    starts = sorted(several.start.dropna().unique())
    lines = []
    for loop, found in by_loop(several):
        ends = {run.start: solution_found(run) for run in found.itertuples()}
        only = next(iter(ends.values())) if found.start.isna().all() else NOTHING
        lines.append({"loop": loop, **{f"start s = {start:g}": ends.get(start, only) for start in starts}})
    return DataFrame(lines, columns=["loop", *(f"start s = {start:g}" for start in starts)])


_RATES: Final = (1e-2, 10.0, 60.0)
"""Lowest rate drawn, beginning of the band of what fails, top."""

_COUNTS: Final = (0.8, 300.0, 1000.0)


def _picture(runs: DataFrame, panel: "Callable[[Axes, str, DataFrame], None]") -> "Canvas":
    """A panel for the main mesh of each problem, and one legend for all."""
    found, names = single(runs), main_bodies(runs)
    canvas, panels = panelled(len(names), 8.0, 2.6, 0.9)
    for axes, name in zip(panels, names, strict=True):
        panel(axes, name, found[found.body == name])
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
        _failures(axes, loop, found, _RATES)


def _iterations_panel(axes: "Axes", title: str, runs: DataFrame) -> None:
    _frame(axes, title, "iterations to 1e-8 [-]", _COUNTS)
    for loop, found in by_loop(runs):
        known = found[found.steps.notna()]
        _marks(axes, loop, known.friction, known.steps)
        _failures(axes, loop, found, _COUNTS)


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


def report(rows: Sequence[Row]) -> Report:
    """The report; the same rows give the same report."""
    runs = runs_of(rows)
    panels = {"rates": _rate_panel, "iterations": _iterations_panel}
    figures = {name: drawn(f"outer-{name}", partial(_picture, runs, panel)) for name, panel in panels.items()}
    return render("comparisons.convergence", "convergence-outer", values_of(runs), tables_of(runs), figures, rows,
                  forms=FORMS, template="outer.md")  # fmt: skip
