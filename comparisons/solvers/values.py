"""The numbers of the report's sentences, computed from the runs."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Final

from comparisons.lab.report.numbers import NOTHING, listing, percent, significant
from comparisons.lab.study import StoredStudy
from comparisons.solvers.accuracies import LEVELS, MARGIN, METHODS
from comparisons.solvers.figures import HIGHLIGHTED, UNTIL
from comparisons.solvers.measures import (
    EQUAL_CELLS,
    NEGLIGIBLE,
    SHIFT,
    Run,
    condensed_ratios,
    finite,
    geometric_mean,
    of_kind,
    outcome_counts,
    paired,
    performance_ratios,
    profile,
    runs_of,
    said_solved,
    times_of,
    unattained,
    untrue_on_unattained,
    untrue_share,
    warm_ratios,
)  # fmt: skip
from comparisons.solvers.outcomes import FALSE_ALARM, NO_ANSWER, UNTRUE
from comparisons.solvers.study import QUICK_NAME
from comparisons.solvers.tasks import INNER, OUTER

RARELY: Final = 0.05
"""Share of untrue answers below which a solver is not named in a sentence."""

_NAMED: Final = 3  # solvers that are ranked


def values_of(study: StoredStudy) -> dict[str, Any]:
    """Name → number, or names of solvers."""
    quick, cases = study.declaration["name"] == QUICK_NAME, int(study.declaration["cases"])
    return {"quick": quick, "cases": cases, **numbers_of(runs_of(study.rows))}


def numbers_of(runs: Sequence[Run]) -> dict[str, Any]:
    """What is computed of the runs alone."""
    return {
        "levels": LEVELS, "margin": MARGIN, "until": UNTIL, "highlighted": HIGHLIGHTED, "negligible": NEGLIGIBLE,
        "shift": SHIFT, "rarely": RARELY, "runs": len(runs), "problems": len({run.problem for run in runs}),
        "backends": len({run.solver for run in runs} - set(METHODS)),
        "methods": [method_of(runs, name) for name in METHODS if any(run.solver == name for run in runs)],
        "feasible": sum(run.feasible for run in runs), "certified": sum(run.feasible and run.certified for run in runs),
        "first": ranking(runs, "inner"), "lost": sum(NO_ANSWER in run.outcomes for run in runs),
        **_of_truth(runs), **_of_infeasible(runs), **_of_ratios(runs),
    }  # fmt: skip


def _of_truth(runs: Sequence[Run]) -> dict[str, Any]:
    """Who says "solved" of what is not, and how much of that is about problems that nobody solves."""
    counts, nobody = outcome_counts(runs), unattained(runs)
    said = {solver: share for solver in counts if (share := untrue_share(counts[solver])) is not None}
    often = sorted((solver for solver in said if said[solver] >= RARELY), key=lambda solver: -said[solver])
    return {
        "often": [f"{solver} ({percent(said[solver])} of {said_solved(counts[solver])})" for solver in often],
        "seldom": len(said) - len(often), "untrue": sum(count[UNTRUE] for count in counts.values()),
        "alarms": sum(count[FALSE_ALARM] for count in counts.values()), "nobody": len(nobody),
        "nobody_untrue": untrue_on_unattained(runs).total(),
        "nobody_at": [f"{problem} ({kind}, {form}, {level})" for level, problem, form, kind in nobody],
    }  # fmt: skip


def ranking(runs: Sequence[Run], kind: str) -> list[tuple[str, int, int, float]]:
    """Solver, problems solved of how many, share within twice the fastest time: the best ones.

    At the accuracy in the middle that was run; none unless there are several solvers, all given every problem.
    """
    chosen = of_kind(runs, kind)
    levels = [level for level in LEVELS if any(run.level == level for run in chosen)]
    level = "mid" if "mid" in levels else "".join(levels[:1])
    times = times_of(run for run in chosen if run.level == level)
    ratios = performance_ratios(times)
    if len(ratios) < 2 or any(len(mine) < len(times) for mine in ratios.values()):
        return []
    merit = {solver: (len(finite(mine)), profile(mine, 2.0)) for solver, mine in ratios.items() if finite(mine)}
    best = sorted(merit, key=lambda solver: (tuple(-part for part in merit[solver]), solver))
    last = merit[best[min(_NAMED, len(best)) - 1]] if best else (0, 0.0)
    return [(solver, merit[solver][0], len(times), merit[solver][1]) for solver in best if merit[solver] >= last]


def method_of(runs: Sequence[Run], name: str) -> dict[str, Any]:
    """One of the package's own methods beside the fastest outer loop with an inner solver."""
    mine = [run for run in runs if run.solver == name and run.feasible]
    quotients = beside_loops(runs, mine)
    steps = {run.options["omega_T"] for run in mine if "omega_T" in run.options}
    return {
        "name": name, "solved": sum(run.certified for run in mine), "given": len(mine), "both": len(quotients),
        "ratio": geometric_mean(quotients), "span": span(quotients), "step": steps.pop() if len(steps) == 1 else None,
    }  # fmt: skip


def beside_loops(runs: Sequence[Run], mine: Sequence[Run]) -> list[float]:
    """Time of the fastest certified fixed point over that of a method, on the same problem, level and form."""
    loops: dict[tuple[str, ...], float] = {}
    for run in runs:
        if run.task == OUTER and run.solver not in METHODS and run.time is not None:
            loops[run.instance] = min(run.time, loops.get(run.instance, run.time))
    return [loops[run.instance] / run.time for run in mine if run.time and run.instance in loops]


def _of_infeasible(runs: Sequence[Run]) -> dict[str, Any]:
    """Who recognises inner problems without a solution, always; and who says "solved"."""
    chosen = [run for run in runs if not run.feasible and run.task == INNER]
    given, every = Counter(run.solver for run in chosen), len({run.instance for run in chosen})
    complete = [solver for solver in given if given[solver] == every]
    recognised = Counter(run.solver for run in chosen if run.certified)
    return {
        "asked": len(complete), "right": [solver for solver in complete if recognised[solver] == every],
        "lied": sum(run.outcomes.get(UNTRUE, 0) for run in chosen),
    }  # fmt: skip


def _of_ratios(runs: Sequence[Run]) -> dict[str, Any]:
    """Graded cells beside equal ones, warm sequences beside cold ones, all unknowns beside condensed."""
    graded: Mapping[str, list[tuple[Run, Run]]] = {form: [] for form in ("full", "condensed")}
    for pair in paired(runs, EQUAL_CELLS):
        graded[pair[0].form].append(pair)
    means = {solver: geometric_mean(values) or 1.0 for solver, values in warm_ratios(runs).items()}
    forms = [geometric_mean(values) or 1.0 for values in condensed_ratios(runs, INNER).values()]
    return {
        "graded": {form: [share(pair[side] for pair in pairs) for side in (0, 1)] for form, pairs in graded.items()},
        "gaining": listing([solver for solver in means if means[solver] < 1.0 / NEGLIGIBLE]),
        "losing": listing([solver for solver in means if means[solver] > NEGLIGIBLE]),
        "form": geometric_mean(forms), "form_span": span(forms),
    }  # fmt: skip


def share(runs: Any) -> float | None:
    """Share that the certificate confirms; None of no runs."""
    chosen = list(runs)
    return sum(run.certified for run in chosen) / len(chosen) if chosen else None


def span(values: Sequence[float]) -> str:
    """Smallest and largest as texts, once if they are the same; "none" without any."""
    ends = (min(values), max(values)) if values else ()
    return " to ".join(dict.fromkeys(significant(end, 2) for end in ends)) or NOTHING
