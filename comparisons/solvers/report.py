"""The report of the comparison from the stored rows: one frame of runs, performance profiles, ratios, pictures.

A time counts only if the certificate passed; a failure has no time and is never given one.
"""

import math
import statistics
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from pandas import DataFrame, Series, concat

from comparisons.lab.drawing import LOOKS, drawn, grid, plain_ticks
from comparisons.lab.numbers import count, percent, seconds
from comparisons.lab.reports import Form, Report, render
from comparisons.lab.studies import Row, frame_of
from comparisons.solvers.accuracies import LEVELS, MARGIN, METHODS, TABLE
from comparisons.solvers.study import COLD, FALSE_ALARM, INNER, NO_ANSWER, OUTCOMES, OUTER, PROBLEMS, RIGHT, UNTRUE
from qvi_contact.plots.style import new_figure
from solvers.inner.registry import how_to_install

KINDS: Final = {
    "inner": "single inner problems",
    "sequence": "sequences of inner problems",
    "outer": "whole inequalities (condensed)",
}
"""Kind of task → its name."""

RARELY: Final = 0.05
"""Share of untrue answers from which a solver is named in a finding."""

UNTIL: Final = 100.0
"""Largest ratio of times that profiles show."""

HIGHLIGHTED: Final = 5
"""Curves of a panel that have a colour."""

INSTANCE: Final = ("level", "problem", "form")
"""Columns that identify an instance, on which the solvers of a task are compared."""

_NAMED: Final = 3  # solvers in a ranking
_WITHIN: Final = {"fastest": 1.0, "within 2 ×": 2.0, "within 10 ×": 10.0}  # multiples of the fastest time


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line for each row, also for rows without a result.

    The columns are those of `frame_of`, and: "seconds", the median wall time [s]; "certified", whether the certificate
    passed at the level's tolerance, or, for problems without a solution, whether the solver said so; for each outcome,
    the number of problems; "feasible", whether there is a solution; "time", the seconds of certified runs.
    """
    runs = frame_of(rows, (), ("seconds", "options"))
    counts = DataFrame([row.result.get("outcomes", {NO_ANSWER: 1}) for row in rows], columns=[*OUTCOMES])
    runs[[*OUTCOMES]] = counts.fillna(0).astype(int)
    runs["certified"] = [
        bool(row.certificate["passed"]) if row.certificate else set(row.result.get("outcomes", ())) == {RIGHT}
        for row in rows
    ]
    runs["seconds"] = runs.seconds.map(statistics.median, na_action="ignore").astype(float)
    runs["feasible"] = [PROBLEMS[name].feasible for name in runs.problem]
    return runs.assign(time=runs.seconds.where(runs.certified))


def of_kind(runs: DataFrame, kind: str) -> DataFrame:
    """The runs of a kind of task on problems that have a solution.

    Of outer loops only those in condensed form, with which the package's methods are compared.
    """
    task = COLD if kind == "sequence" else kind
    return runs[runs.feasible & (runs.task == task) & ((kind != OUTER) | (runs.form == "condensed"))]


def performance_ratios(runs: DataFrame) -> DataFrame:
    """Time over the best time, for each instance with a solution and each solver; ∞ if it failed, NaN if not run.

    An instance that no solver solves is ∞ for all solvers, and no profile reaches 1. Source: E. D. Dolan, J. J. Moré,
    Math. Program. 91 (2002).
    """
    tried = runs[runs.feasible]
    times = tried.assign(time=tried.time.fillna(math.inf)).pivot(index=[*INSTANCE], columns="solver", values="time")
    times = times[tried.solver.unique()]
    return times.div(times.min(axis=1), axis=0).where(times < math.inf, times)


def profile(ratios: Any, at: float) -> Any:
    """Share of the instances tried whose ratio is at most `at`: of one solver, or of each."""
    return (ratios <= at).sum() / ratios.count()


def geometric_mean(values: "Series[float]") -> float:
    """exp(mean log v); NaN of no values."""
    return math.exp(np.log(values).mean())


def outcome_counts(runs: DataFrame) -> DataFrame:
    """Solver → number of inner problems with a solution for each outcome; problems of sequences count one by one.

    "said" is the number of answers called solved, "share" the share of them that are untrue (NaN if there are none).
    """
    counts = runs[runs.feasible & (runs.task != OUTER)].groupby("solver", sort=False)[[*OUTCOMES]].sum()
    said = counts[RIGHT] + counts[UNTRUE]
    return counts.assign(said=said, share=counts[UNTRUE] / said)


def ranking(runs: DataFrame, kind: str) -> list[tuple[str, int, int, float]]:
    """The best solvers: name, problems solved, problems given, share within twice the fastest time.

    At the accuracy "mid", or else the first that was run; empty unless several solvers were run on every problem.
    """
    chosen = of_kind(runs, kind)
    levels = [level for level in LEVELS if level in set(chosen.level)]
    ratios = performance_ratios(chosen[chosen.level == ("mid" if "mid" in levels else "".join(levels[:1]))])
    if ratios.shape[1] < 2 or ratios.isna().any(axis=None):
        return []
    solved = (ratios < float("inf")).sum()
    merit = solved.to_frame("solved").assign(given=len(ratios), within=profile(ratios, 2.0))[solved > 0]
    best = merit.sort_index().sort_values(["solved", "within"], ascending=False, kind="stable")
    found = list(best.itertuples(name=None))
    last = [(solved, within) for _, solved, _, within in found[:_NAMED]][-1:]
    return [each for each in found if (each[1], each[3]) >= last[0]]


def method_of(runs: DataFrame, name: str) -> dict[str, Any]:
    """A method of the package: the problems it solves, and the time ratio of the fastest outer loop."""
    mine = runs[(runs.solver == name) & (runs.task == OUTER) & runs.feasible]
    loops = runs[(runs.task == OUTER) & ~runs.solver.isin(METHODS)]
    fastest = loops.groupby([*INSTANCE], as_index=False).time.min()
    both = mine.merge(fastest, on=[*INSTANCE], suffixes=("", "_fastest"))
    quotients = (both.time_fastest / both.time).dropna()
    return {
        "name": name, "solved": int(mine.certified.sum()), "given": len(mine), "both": len(quotients),
        "ratio": geometric_mean(quotients),
    }  # fmt: skip


def values_of(runs: DataFrame) -> dict[str, Any]:
    """The numbers of the report's sentences."""
    solvers, counts = set(runs.solver), outcome_counts(runs)
    often = counts[counts.share >= RARELY].sort_values("share", ascending=False, kind="stable")
    hopeless = runs[(runs.task == INNER) & ~runs.feasible]
    recognised = hopeless.groupby("solver", sort=False).certified.agg(["sum", "size"])
    every = len(hopeless.drop_duplicates([*INSTANCE]))
    return {
        "levels": LEVELS, "margin": MARGIN, "until": UNTIL, "highlighted": HIGHLIGHTED,
        "rarely": RARELY, "runs": len(runs), "problems": runs.problem.nunique(), "described": PROBLEMS,
        "backends": len(solvers - set(METHODS)), "first": ranking(runs, "inner"),
        "methods": [method_of(runs, name) for name in METHODS if name in solvers],
        "feasible": int(runs.feasible.sum()), "certified": int((runs.feasible & runs.certified).sum()),
        # solvers whose answers called solved are often untrue
        "often": [f"{each.Index} ({percent(each.share)} of {each.said})" for each in often.itertuples()],
        "seldom": int((counts.share < RARELY).sum()), "alarms": int(counts[FALSE_ALARM].sum()),
        # solvers that recognise all inner problems without a solution; how many of these problems are called solved
        "asked": int((recognised["size"] == every).sum()), "right": [*recognised.index[recognised["sum"] == every]],
        "called_solved": int(hopeless[UNTRUE].sum()),
    }  # fmt: skip


def tables_of(runs: DataFrame) -> dict[str, DataFrame]:
    """The tables by name."""
    first = [(name, solver, f"{solved} of {given}", within)
             for kind, name in KINDS.items() for solver, solved, given, within in ranking(runs, kind)]  # fmt: skip
    truth = outcome_counts(runs).reset_index()
    hopeless = runs[~runs.feasible]
    hopeless = hopeless.assign(column=hopeless.problem + ", " + hopeless.task + ", " + hopeless.form)
    return {
        "overview": overview(runs), "truth": truth.assign(true=1.0 - truth.share),
        "first": DataFrame(first, columns=["kind", "solver", "solved", "within"]),
        **{f"times-{kind}": speeds(of_kind(runs, kind)) for kind in KINDS},
        "infeasible": _crossed(hopeless, "column", "status", _words),
    }  # fmt: skip


def overview(runs: DataFrame) -> DataFrame:
    """Shares certified, by kind of task and level, and how often "solved" was untrue."""
    names = [f"{kind}, {level}" for kind in KINDS for level in LEVELS]
    by_kind = concat({kind: of_kind(runs, kind) for kind in KINDS}, names=["which"]).reset_index("which")
    columns = by_kind.which + ", " + by_kind.level
    shares = by_kind.certified.groupby([by_kind.solver, columns]).agg(_share).unstack().reindex(columns=names)
    table = shares.join(outcome_counts(runs)[["share", FALSE_ALARM]], how="outer").reindex(runs.solver.unique())
    return table.rename_axis("solver").reset_index()


def _share(certified: "Series[bool]") -> str:
    """How many of so many runs are certified."""
    return f"{percent(certified.mean())} of {len(certified)}"


def speeds(chosen: DataFrame) -> DataFrame:
    """Shares of the profile, and geometric means with the numbers of times, by solver, in texts."""
    parts = []
    for level in LEVELS:
        runs = chosen[chosen.level == level]
        ratios, times = performance_ratios(runs), runs.dropna(subset="time").groupby("solver").time
        columns = {
            **{name: profile(ratios, at).map(percent) for name, at in _WITHIN.items()},
            "mean time": times.agg(geometric_mean).map(seconds) + times.size().map(" ({})".format),
        }
        parts.append(DataFrame(columns).add_prefix(f"{level}: "))
    return concat(parts, axis=1).reindex(chosen.solver.unique()).rename_axis("solver").reset_index()


def _crossed(runs: DataFrame, column: str, value: str, cell: Callable[[Series], str]) -> DataFrame:
    """A line for each solver, under each value of the column a text of the values there, in the order of the runs."""
    table = runs.pivot_table(value, "solver", column, cell, sort=False)
    return table.reindex(runs.solver.unique(), columns=runs[column].unique()).rename_axis("solver").reset_index()


def _words(statuses: Series) -> str:
    counts = Counter(status.replace("_", " ") for status in statuses)
    return ", ".join(f"{word} ({number})" for word, number in sorted(counts.items()))


def profiles(runs: DataFrame) -> Figure | None:
    """A panel for each level, a step curve for each solver: the best by area in colour, the others grey."""
    if runs.empty:
        return None
    levels = [level for level in LEVELS if level in set(runs.level)]
    figure = new_figure(3.9 * len(levels), 4.4)
    panels = figure.subplots(1, len(levels), sharey=True, squeeze=False)[0]
    looks: dict[str, int] = {}  # solver → number of its colour, the same in all panels
    for axes, level in zip(panels, levels, strict=True):
        ratios = performance_ratios(runs[runs.level == level])
        best = np.log(ratios.clip(1.0, UNTIL)).mean().sort_index().sort_values(kind="stable").index
        coloured = [solver for solver in best if ratios[solver].min() < math.inf][:HIGHLIGHTED]
        for solver in best:
            look: dict[str, Any] = {"color": "#c8c8c8", "linewidth": 0.9, "zorder": 1}
            if solver in coloured:
                colour, marker, line = LOOKS[looks.setdefault(solver, len(looks)) % len(LOOKS)]
                label = f"{solver} ({(ratios[solver] < math.inf).sum()} of {ratios[solver].count()})"
                look = {"color": colour, "linestyle": line, "linewidth": 1.5, "marker": marker, "markersize": 4,
                        "markevery": max(1, ratios[solver].nunique() // 6), "label": label}  # fmt: skip
            axes.ecdf(ratios[solver].dropna().clip(upper=10.0 * UNTIL), **look)
        axes.set(xscale="log", xlim=(1.0, UNTIL), ylim=(-0.02, 1.02), xlabel="time over that of the fastest [-]")
        plain_ticks(axes.xaxis)
        axes.set_title(f"{level}: certified at {LEVELS[level]:.0e}", fontsize=9)
        grid(axes)
        if coloured:
            axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), fontsize=8, frameon=False)
    panels[0].set_ylabel("share of problems solved [-]")
    return figure


_FORMS: Final[Mapping[str, Form]] = {**dict.fromkeys(("share", "true", "within"), percent), FALSE_ALARM: count}


def report(rows: Sequence[Row]) -> Report:
    """The report, a function of the rows only."""
    runs = runs_of(rows)
    given = _crossed(
        runs.dropna(subset="options"), "level", "options",
        lambda found: ", ".join(f"{name}={value}" for name, value in sorted(found.iloc[0].items())) or "no option",
    )  # fmt: skip
    given.insert(1, "what it is", [TABLE[solver].remark for solver in given.solver])
    lacking = [(name, f"python -m {how_to_install(name)}") for name in TABLE if name not in {*runs.solver, *METHODS}]
    tables = {**tables_of(runs), "asked": given, "lacking": DataFrame(lacking, columns=["solver", "how to get it"])}
    drawings = {"profiles-inner": drawn("profiles-inner", partial(profiles, of_kind(runs, INNER)))}
    return render("comparisons.solvers", "solvers", values_of(runs), tables, drawings, rows, forms=_FORMS)
