"""The numbers of the report's sentences, computed from the runs."""

from collections.abc import Mapping
from typing import Any, Final

from pandas import DataFrame, Series

from comparisons.lab.report.numbers import listing, percent, significant, span
from comparisons.solvers import measures
from comparisons.solvers.accuracies import LEVELS, MARGIN, METHODS
from comparisons.solvers.figures import HIGHLIGHTED, UNTIL
from comparisons.solvers.measures import EQUAL_CELLS, INSTANCE, NEGLIGIBLE, SHIFT
from comparisons.solvers.outcomes import FALSE_ALARM, NO_ANSWER, UNTRUE
from comparisons.solvers.study import FORMS, QUICK_NAME
from comparisons.solvers.tasks import INNER, OUTER

RARELY: Final = 0.05
"""Share of untrue answers below which a solver is not named in a sentence."""

_NAMED: Final = 3  # solvers that are ranked


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
    told, found = measures.told_by(runs), measures.judged(runs)
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
    chosen = measures.of_kind(runs, kind)
    levels = [level for level in LEVELS if level in set(chosen.level)]
    ratios = measures.performance_ratios(chosen[chosen.level == ("mid" if "mid" in levels else "".join(levels[:1]))])
    if ratios.shape[1] < 2 or ratios.isna().any(axis=None):
        return []
    solved = (ratios < float("inf")).sum()
    merit = solved.to_frame("solved").assign(given=len(ratios), within=measures.profile(ratios, 2.0))[solved > 0]
    best = merit.sort_index().sort_values(["solved", "within"], ascending=False, kind="stable")
    found = list(best.itertuples(name=None))
    last = [(solved, within) for _, solved, _, within in found[:_NAMED]][-1:]
    return [each for each in found if (each[1], each[3]) >= last[0]]


def method_of(runs: DataFrame, name: str) -> dict[str, Any]:
    """One of the package's own methods: its step, what it solves, and how much longer the fastest outer loop takes."""
    mine = runs[(runs.solver == name) & (runs.task == OUTER) & runs.feasible]
    loops = runs[(runs.task == OUTER) & ~runs.solver.isin(METHODS)]
    fastest = loops.groupby([*INSTANCE], as_index=False).time.min()
    quotients = 1.0 / measures.beside(mine, fastest, INSTANCE).ratio.dropna()
    steps = {options["omega_T"] for options in mine.options.dropna() if "omega_T" in options}
    return {
        "name": name, "solved": int(mine.certified.sum()), "given": len(mine), "both": len(quotients),
        "ratio": measures.geometric_mean(quotients), "span": _span(quotients),
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
    pairs, warm = measures.paired(runs, EQUAL_CELLS), measures.by_solver(measures.warm_ratios(runs))["mean"]
    forms = measures.by_solver(measures.condensed_ratios(runs, INNER))["mean"]
    graded = pairs.groupby("form")[["certified", "certified_beside"]].mean().reindex([*FORMS])
    return {
        "graded": graded.T.to_dict("list"),
        "gaining": listing([*warm.index[warm < 1.0 / NEGLIGIBLE]]),
        "losing": listing([*warm.index[warm > NEGLIGIBLE]]),
        "form": measures.geometric_mean(forms), "form_span": _span(forms),
    }  # fmt: skip


def _span(values: "Series[float]") -> str:
    return span(values, lambda value: significant(value, 2))
