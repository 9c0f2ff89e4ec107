"""What is computed from the rows: one frame of runs, performance profiles, shifted geometric means, ratios.

A time counts only if the certificate passed; a failure has no time and is never given one.
"""

import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from pandas import DataFrame, Series

from comparisons.lab.ratios import spread
from comparisons.lab.report.numbers import listing, percent, significant, span
from comparisons.lab.study import DONE, Row
from comparisons.solvers.accuracies import LEVELS, MARGIN, METHODS, asked
from comparisons.solvers.outcomes import FALSE_ALARM, GAVE_UP, MODEST, NO_ANSWER, RIGHT, UNTRUE
from comparisons.solvers.problems import PROBLEMS
from comparisons.solvers.study import FORMS, QUICK_NAME
from comparisons.solvers.tasks import COLD, INNER, OUTER, WARM

SHIFT: Final = 1e-3
"""Shift of geometric means [s]: differences far below a millisecond do not count."""

RARELY: Final = 0.05
"""Share of untrue answers below which a solver is not named in a sentence."""

UNTIL: Final = 100.0
"""Largest ratio of times that profiles show."""

HIGHLIGHTED: Final = 5
"""Curves of a panel that have a colour."""

NEGLIGIBLE: Final = 1.2
"""Ratio of times below which, and above whose inverse, times count as equal."""

CONE_ENERGY: Final = ("qp:ecos", "socp:cvxopt", "socp:ecos")
"""Solvers that take linear objectives only: `qpsolvers` and `cvxpy` give them the energy as one more cone."""

UNDOUBLED: Final[Mapping[str, str]] = MappingProxyType({"doubled_rows": "plate_8", "doubled_equation": "punch"})
"""Problem with rows given twice → the same problem with each given once."""

EQUAL_CELLS: Final[Mapping[str, str]] = MappingProxyType({"graded_8": "plate_8", "graded_16": "plate_16"})
"""Problem on graded cells → the same on equal ones."""

OUTCOMES: Final = (RIGHT, UNTRUE, FALSE_ALARM, MODEST, GAVE_UP, NO_ANSWER)
ERRORS: Final = ("accuracy", "primal", "dual", "complementarity")
INSTANCE: Final = ("level", "problem", "form")
"""What solvers are compared on, task by task."""

_NAMED: Final = 3  # solvers that are ranked
_FACTORS: Final = ("solver", "task", *INSTANCE)
_NUMBERS: Final = ("seconds", "spread", "iterations", "limit", *ERRORS)


def runs_of(rows: Iterable[Row]) -> DataFrame:
    """One line a row, those without a result too; see `frame_of`."""
    return frame_of([_run(row) for row in rows])


def frame_of(runs: Sequence[Mapping[str, Any]]) -> DataFrame:
    """The runs with what follows from their entries.

    The columns are solver, task, problem, form, level; seconds (median wall time [s]), spread (largest less smallest
    time over the median), iterations (of all its problems), the errors of the certificate, limit (wall time after which
    the case was ended [s]), NaN where there is none; certified, whether the certificate passed at the level's
    tolerance, or where there is no solution, whether that was said; status and reason, what was said last, or why there
    is no answer; a number of problems for each outcome; options, which the solver was given, and facts of the problem,
    None without an answer; feasible, whether there is a solution, and kind of the problem; time of a success; lost,
    whether the run was ended or the solver failed.
    """
    texts = ("certified", "status", "reason", "options", "facts")
    frame = DataFrame(runs, columns=[*_FACTORS, *_NUMBERS, *OUTCOMES, *texts])
    frame = frame.astype({**dict.fromkeys((*_NUMBERS, *OUTCOMES), float), "certified": bool})
    frame[[*_NUMBERS]] = frame[[*_NUMBERS]].replace(math.inf, math.nan)
    frame[[*OUTCOMES]] = frame[[*OUTCOMES]].fillna(0).astype(int)
    frame["iterations"] = frame.iterations.where(frame.iterations > 0)  # some do not tell
    described = [PROBLEMS[name] for name in frame.problem]
    frame["feasible"] = np.array([each.feasible for each in described], dtype=bool)
    frame["kind"] = [each.kind for each in described]
    frame["time"] = frame.seconds.where(frame.certified)
    frame["lost"] = frame.seconds.isna() | (frame.status == "backend_failed")
    return frame


def _run(row: Row) -> dict[str, Any]:
    case = {name: row.case[name] for name in _FACTORS} | {"limit": row.environment.get("timeout_seconds")}
    if row.status != DONE:
        return {**case, "certified": False, "status": row.status, "reason": row.reason, NO_ANSWER: 1}
    found, seconds = row.result, row.result["seconds"]
    right = row.certificate["passed"] if row.certificate else set(found["outcomes"]) == {RIGHT}
    told = {name: found.get(name) for name in ("status", "iterations", "options", "facts", *ERRORS)}
    return {
        **case, **told, **found["outcomes"], "certified": right, "reason": found["message"],
        "seconds": statistics.median(seconds), "spread": spread(seconds),
    }  # fmt: skip


def of_kind(runs: DataFrame, kind: str) -> DataFrame:
    """The runs of a kind of task on problems that have a solution.

    Sequences are warm by the solvers that can, cold by the others. Outer loops are those in condensed form, which is
    what the package's own methods are compared with.
    """
    runs = runs[runs.feasible]
    if kind != "sequence":
        return runs[(runs.task == kind) & ((kind != OUTER) | (runs.form == "condensed"))]
    sequences = runs[runs.task.isin([COLD, WARM])]
    warm = sequences.task == WARM
    return sequences[warm | ~warm.groupby([sequences[name] for name in ("solver", *INSTANCE)]).transform("any")]


def performance_ratios(runs: DataFrame) -> DataFrame:
    """For each instance and solver its time over the best time; infinite where it failed, NaN where it was not tried.

    Of problems that have a solution. An instance that nobody solves is infinite for everybody: no profile reaches 1
    then. Source: E. D. Dolan, J. J. Moré, Math. Program. 91 (2002).
    """
    tried = runs[runs.feasible]
    times = tried.assign(time=tried.time.fillna(math.inf)).pivot(index=[*INSTANCE], columns="solver", values="time")
    times = times[tried.solver.unique()]
    return times.div(times.min(axis=1), axis=0).where(times < math.inf, times)


def profile(ratios: Any, at: float) -> Any:
    """Share of the instances tried whose ratio is at most `at`: of one solver, or of each."""
    return (ratios <= at).sum() / ratios.count()


def steps(ratios: "Series[float]", until: float) -> tuple[list[float], list[float]]:
    """The profile as a step function: where it rises, from 1 to `until`, and its value from there on."""
    x = sorted({1.0, until, *ratios[(ratios > 1.0) & (ratios < until)]})
    return x, [profile(ratios, value) for value in x]


def area(ratios: DataFrame, until: float) -> "Series[float]":
    """Mean height of each profile from 1 to `until` on a logarithmic axis: 1 for always the fastest, 0 for never."""
    return (1.0 - np.log(ratios.clip(lower=1.0)) / math.log(until)).clip(lower=0.0).mean()


def shifted_mean(times: "Series[float]", shift: float = SHIFT) -> float:
    """exp(mean log(t + shift)) − shift [s]; NaN of no times, and if one is unknown."""
    return math.exp(np.log(times + shift).mean(skipna=False)) - shift


def geometric_mean(values: "Series[float]") -> float:
    """exp(mean log v); NaN of no values."""
    return math.exp(np.log(values).mean())


def beside(runs: DataFrame, others: DataFrame, on: Sequence[str]) -> DataFrame:
    """The runs with the entries of the other one that agrees in these columns, named …_beside, where there is one.

    The ratio is that of their times, NaN unless both succeeded.
    """
    both = runs.merge(others, on=[*on], suffixes=("", "_beside"))
    return both.assign(ratio=both.time / both.time_beside)


def warm_ratios(runs: DataFrame) -> DataFrame:
    """Warm sequences beside cold ones."""
    return beside(runs[runs.task == WARM], runs[runs.task == COLD], ("solver", *INSTANCE))


def condensed_ratios(runs: DataFrame, task: str) -> DataFrame:
    """Runs of a task in all unknowns beside those of the condensed form."""
    full, condensed = (runs[(runs.task == task) & (runs.form == form)] for form in ("full", "condensed"))
    return beside(full, condensed, ("solver", "level", "problem"))


def by_solver(found: DataFrame) -> DataFrame:
    """Solver → geometric mean, smallest, largest and number of its ratios, and how many are below 1; if it has any."""
    ratios = found.assign(below=found.ratio < 1.0).groupby("solver", sort=False)
    spans = ratios.ratio.agg(mean=geometric_mean, smallest="min", largest="max", number="count")
    return spans.assign(below=ratios.below.sum())[spans.number > 0]


def paired(runs: DataFrame, twins: Mapping[str, str]) -> DataFrame:
    """Single inner problems beside their twins, same solver, form and level."""
    single = runs[runs.task == INNER]
    some = single[single.problem.isin([*twins])]
    on = ("twin", "solver", "form", "level")
    return beside(some.assign(twin=some.problem.map(twins)), single.assign(twin=single.problem), on)


def judged(runs: DataFrame) -> DataFrame:
    """Runs of inner problems that have a solution, single ones and sequences: what was said of them can be true.

    The column nobody says whether no answer of any solver was certified, of a sequence of no step, at this level and in
    this form; what is "single" or "sequence".
    """
    found = runs[runs.feasible & (runs.task != OUTER)]
    what = np.where(found.task == INNER, "single", "sequence")
    certified = (found[RIGHT] + found[MODEST]).groupby([what, *(found[name] for name in INSTANCE)]).transform("sum")
    return found.assign(what=what, nobody=certified == 0)


def told_by(runs: DataFrame) -> DataFrame:
    """Solver → number of inner problems that have a solution for each outcome, those of sequences one by one.

    The column nobody counts untrue answers where no answer of anybody was certified, said how often "solved" was said,
    share how much of that was untrue (NaN if it was never said).
    """
    found = judged(runs)
    found = found.assign(nobody=found[UNTRUE].where(found.nobody, 0))
    counts = found.groupby("solver", sort=False)[[*OUTCOMES, "nobody"]].sum()
    said = counts[RIGHT] + counts[UNTRUE]
    return counts.assign(said=said, share=counts[UNTRUE] / said)


def error_powers(runs: DataFrame) -> dict[str, float]:
    """Solver → p, where the median error of single inner problems falls like ε**p with the tolerance ε asked for.

    Between the lowest and the highest level, over the problems that have an answer at both. Solvers without
    such problems, or whose median error is 0, are left out.
    """
    low, *_, high = LEVELS
    single = runs[runs.feasible & (runs.task == INNER)]
    both = beside(single[single.level == low], single[single.level == high], ("solver", "problem", "form"))
    errors = both[["accuracy", "accuracy_beside"]].where(both.accuracy.notna() & both.accuracy_beside.notna())
    medians = errors.groupby(both.solver, sort=False).median()
    medians = medians[(medians > 0.0).all(axis=1)]
    powers = np.log(medians.accuracy / medians.accuracy_beside) / math.log(asked(low) / asked(high))
    return {str(solver): float(power) for solver, power in powers.items()}


def values_of(declaration: Mapping[str, Any], runs: DataFrame) -> dict[str, Any]:
    """Name → number, or names of solvers."""
    return {"quick": declaration["name"] == QUICK_NAME, "cases": int(declaration["cases"]), **numbers_of(runs)}


def numbers_of(runs: DataFrame) -> dict[str, Any]:
    """What is computed of the runs alone."""
    solvers = set(runs.solver)
    return {
        "levels": LEVELS, "margin": MARGIN, "until": UNTIL, "highlighted": HIGHLIGHTED, "negligible": NEGLIGIBLE,
        "shift": SHIFT, "rarely": RARELY, "runs": len(runs), "problems": runs.problem.nunique(),
        "backends": len(solvers - set(METHODS)),
        "methods": [method_of(runs, name) for name in METHODS if name in solvers],
        "feasible": int(runs.feasible.sum()), "certified": int((runs.feasible & runs.certified).sum()),
        "first": ranking(runs, "inner"), "lost": int((runs[NO_ANSWER] > 0).sum()),
        **_of_truth(runs), **_of_infeasible(runs), **_of_ratios(runs),
    }  # fmt: skip


def _of_truth(runs: DataFrame) -> dict[str, Any]:
    """Who says "solved" of what is not, and how much of that is about problems that nobody solves."""
    told, found = told_by(runs), judged(runs)
    often = told[told.share >= RARELY].sort_values("share", ascending=False, kind="stable")
    nobody = found[found.nobody].drop_duplicates(["what", *INSTANCE])
    return {
        "often": [f"{each.Index} ({percent(each.share)} of {each.said})" for each in often.itertuples()],
        "seldom": int((told.share < RARELY).sum()), "untrue": int(told[UNTRUE].sum()),
        "alarms": int(told[FALSE_ALARM].sum()), "nobody": len(nobody), "nobody_untrue": int(told.nobody.sum()),
        "nobody_at": [f"{each.problem} ({each.what}, {each.form}, {each.level})" for each in nobody.itertuples()],
    }  # fmt: skip


def ranking(runs: DataFrame, kind: str) -> list[tuple[str, int, int, float]]:
    """Solver, problems solved of how many, share within twice the fastest time: the best ones.

    At the accuracy in the middle that was run; none unless there are several solvers, all given every problem.
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
    """One of the package's own methods: its step, what it solves, and how much longer the fastest outer loop takes."""
    mine = runs[(runs.solver == name) & (runs.task == OUTER) & runs.feasible]
    loops = runs[(runs.task == OUTER) & ~runs.solver.isin(METHODS)]
    fastest = loops.groupby([*INSTANCE], as_index=False).time.min()
    quotients = 1.0 / beside(mine, fastest, INSTANCE).ratio.dropna()
    steps = {options["omega_T"] for options in mine.options.dropna() if "omega_T" in options}
    return {
        "name": name, "solved": int(mine.certified.sum()), "given": len(mine), "both": len(quotients),
        "ratio": geometric_mean(quotients), "span": _span(quotients),
        "step": steps.pop() if len(steps) == 1 else None,
    }  # fmt: skip


def _of_infeasible(runs: DataFrame) -> dict[str, Any]:
    """Who recognises inner problems without a solution, always; and who says "solved"."""
    chosen = runs[~runs.feasible & (runs.task == INNER)]
    recognised = chosen.groupby("solver", sort=False).certified.agg(["sum", "size"])
    every = len(chosen.drop_duplicates([*INSTANCE]))
    return {
        "asked": int((recognised["size"] == every).sum()), "right": [*recognised.index[recognised["sum"] == every]],
        "lied": int(chosen[UNTRUE].sum()),
    }  # fmt: skip


def _of_ratios(runs: DataFrame) -> dict[str, Any]:
    """Graded cells beside equal ones, warm sequences beside cold ones, all unknowns beside condensed."""
    pairs, warm = paired(runs, EQUAL_CELLS), by_solver(warm_ratios(runs))["mean"]
    forms = by_solver(condensed_ratios(runs, INNER))["mean"]
    graded = pairs.groupby("form")[["certified", "certified_beside"]].mean().reindex([*FORMS])
    return {
        "graded": graded.T.to_dict("list"),
        "gaining": listing([*warm.index[warm < 1.0 / NEGLIGIBLE]]),
        "losing": listing([*warm.index[warm > NEGLIGIBLE]]),
        "form": geometric_mean(forms), "form_span": _span(forms),
    }  # fmt: skip


def _span(values: "Series[float]") -> str:
    return span(values, lambda value: significant(value, 2))
