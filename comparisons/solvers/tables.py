"""The tables of the report."""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, Final

from comparisons.lab.report.numbers import NOTHING, percent, scientific, seconds, significant
from comparisons.lab.study import Row, StoredStudy
from comparisons.lab.tables import Grid
from comparisons.solvers import accuracies
from comparisons.solvers.accuracies import KEPT, LEVELS, METHODS, REMARKS
from comparisons.solvers.measures import (
    CONE_ENERGY,
    UNDOUBLED,
    Run,
    condensed_ratios,
    error_powers,
    finite,
    geometric_mean,
    grouped,
    mean_with_failures,
    median,
    of_kind,
    outcome_counts,
    paired,
    performance_ratios,
    profile,
    runs_of,
    shifted_mean,
    times_of,
    untrue_on_unattained,
    untrue_share,
    warm_ratios,
)  # fmt: skip
from comparisons.solvers.outcomes import FALSE_ALARM, GAVE_UP, MODEST, NO_ANSWER, RIGHT, UNTRUE
from comparisons.solvers.problems import PROBLEMS
from comparisons.solvers.tasks import INNER, OUTER
from comparisons.solvers.values import ranking
from solvers.inner.registry import how_to_install

KINDS: Final = {
    "inner": "single inner problems",
    "sequence": "sequences of inner problems",
    "outer": "whole inequalities (condensed)",
}
"""Kind of task → its name; sequences are warm where the solver can keep something."""

_TRUE_AT: Final = (1.0, 2.0, 10.0)
_LONGEST_LIST: Final = 40


def tables_of(study: StoredStudy) -> dict[str, Grid]:
    """The tables by name."""
    runs = runs_of(study.rows)
    return {
        "overview": overview(runs), "truth": truth(runs), "first": first(runs),
        **{f"times-{kind}": speeds(runs, kind) for kind in KINDS},
        "kinds": kinds(runs), "twins": twins(runs), "warm": warm(runs), "forms": forms(runs),
        "infeasible": infeasible(runs), "errors": errors(runs), "powers": powers(runs),
        "problems": problems(study.rows), "failures": failures(runs),
    }  # fmt: skip


def first(runs: Sequence[Run]) -> Grid:
    """Who solves most at the accuracy in the middle, and then most within twice the fastest time."""
    rows = [
        (name, solver, f"{solved} of {given}", percent(within))
        for kind, name in KINDS.items()
        for solver, solved, given, within in ranking(runs, kind)
    ]
    return Grid("", ("kind of task", "solver", "solved", "within 2 × of the fastest"), rows)


def powers(runs: Sequence[Run]) -> Grid:
    """How the median error follows the tolerance asked for."""
    rows = [
        (solver, significant(power, 2), "one more cone" if solver in CONE_ENERGY else "as it is")
        for solver, power in error_powers(runs).items()
    ]
    return Grid("", ("solver", "power of the tolerance", "how it gets the energy"), rows)


def overview(runs: Sequence[Run]) -> Grid:
    """Shares certified, by kind of task and level, and how often "solved" was untrue."""
    headings = ["solver", *(f"{kind}, {level}" for kind in KINDS for level in LEVELS), "untrue", "false alarms"]
    counts = outcome_counts(runs)
    rows = []
    for solver in dict.fromkeys(run.solver for run in runs):
        mine = [run for run in runs if run.solver == solver]
        shares = [
            _share([run for run in of_kind(mine, kind) if run.level == level]) for kind in KINDS for level in LEVELS
        ]
        told = counts.get(solver, Counter())
        rows.append((solver, *shares, percent(untrue_share(told)), str(told[FALSE_ALARM]) if told else NOTHING))
    return Grid("", tuple(headings), rows)


def _share(runs: Sequence[Run]) -> str:
    if not runs:
        return NOTHING
    return f"{percent(sum(run.certified for run in runs) / len(runs))} of {len(runs)}"


def truth(runs: Sequence[Run]) -> Grid:
    """What was said of each inner problem, beside whether it was true."""
    headings = (
        "solver", "said solved, true", "said solved, untrue", "of these without any certified answer",
        "said infeasible, untrue", "gave up, certified", "gave up", "no answer", "\"solved\" true",
    )  # fmt: skip
    rows = []
    nobody = untrue_on_unattained(runs)
    for solver, counts in outcome_counts(runs).items():
        share = untrue_share(counts)
        right, untrue, *others = (
            str(counts[each]) for each in (RIGHT, UNTRUE, FALSE_ALARM, MODEST, GAVE_UP, NO_ANSWER)
        )
        share = None if share is None else 1.0 - share
        rows.append((solver, right, untrue, str(nobody[solver]), *others, percent(share)))
    return Grid("", headings, rows)


def speeds(runs: Sequence[Run], kind: str) -> Grid:
    """Shares of the profile, and shifted geometric means, by solver."""
    chosen = of_kind(runs, kind)
    headings = ["solver"]
    headings += [
        f"{level}: {text}"
        for level in LEVELS
        for text in ("fastest", "within 2 ×", "within 10 ×", "mean time", "mean, failures at the limit")
    ]
    columns: dict[str, list[str]] = {solver: [] for solver in dict.fromkeys(run.solver for run in chosen)}
    for level in LEVELS:
        at_level = [run for run in chosen if run.level == level]
        ratios = performance_ratios(times_of(at_level))
        for solver, cells in columns.items():
            mine = ratios.get(solver, [])
            cells += [percent(profile(mine, at)) if mine else NOTHING for at in _TRUE_AT]
            own = [run for run in at_level if run.solver == solver]
            cells += [_mean_time(own), seconds(mean_with_failures(own))]
    return Grid("", tuple(headings), [(solver, *cells) for solver, cells in columns.items()])


def _mean_time(runs: Sequence[Run]) -> str:
    times = finite(run.time for run in runs)
    return f"{seconds(shifted_mean(times))} ({len(times)})" if times else NOTHING


def errors(runs: Sequence[Run]) -> Grid:
    """Medians of the certificate's errors of single inner problems, and of iterations."""
    chosen = [run for run in runs if run.task == INNER and run.feasible]
    headings = (
        "solver",
        "level",
        "accuracy",
        "primal",
        "dual",
        "complementarity",
        "iterations",
        "spread of times",
        "failed",
    )
    rows = []
    for (solver, level), group in grouped(chosen, lambda run: (run.solver, run.level)).items():
        medians = [
            scientific(median(finite(getattr(run, name) for run in group)), 2)
            for name in ("accuracy", "primal", "dual", "complementarity")
        ]
        iterations = median([run.iterations for run in group if run.iterations])
        spreads = median(finite(run.spread for run in group))
        failed = sum(not run.certified for run in group)
        rows.append((solver, level, *medians, significant(iterations), percent(spreads), f"{failed} of {len(group)}"))
    return Grid("", headings, rows)


def kinds(runs: Sequence[Run]) -> Grid:
    """Shares certified of single inner problems, by kind of problem and form."""
    chosen = [run for run in runs if run.task == INNER and run.feasible]
    columns = grouped(chosen, lambda run: (PROBLEMS[run.problem].kind, run.form))
    headings = ("solver", *(f"{kind}, {form}" for kind, form in columns))
    rows = [
        (solver, *(_share([run for run in group if run.solver == solver]) for group in columns.values()))
        for solver in dict.fromkeys(run.solver for run in chosen)
    ]
    return Grid("", headings, rows)


def twins(runs: Sequence[Run]) -> Grid:
    """Single inner problems with rows given twice, beside the same with each given once."""
    columns = grouped_pairs(runs)
    solvers = dict.fromkeys(run.solver for pairs in columns.values() for run, _ in pairs)
    rows = [
        (solver, *(
            text
            for pairs in columns.values()
            for side in (0, 1)
            for text in _certified_and_lost([pair[side] for pair in pairs if pair[side].solver == solver])
        ))
        for solver in solvers
    ]  # fmt: skip
    names = (name for doubled in columns for name in (doubled, UNDOUBLED[doubled]))
    headings = ("solver", *(f"{name}: {text}" for name in names for text in ("certified", "no answer")))
    return Grid("", headings, rows)


def grouped_pairs(runs: Sequence[Run]) -> dict[str, list[tuple[Run, Run]]]:
    """Problem with rows given twice → (run, run on the same problem with each given once)."""
    found: dict[str, list[tuple[Run, Run]]] = {}
    for pair in paired(runs, UNDOUBLED):
        found.setdefault(pair[0].problem, []).append(pair)
    return found


def _certified_and_lost(runs: Sequence[Run]) -> tuple[str, str]:
    return _share(runs), str(sum(run.lost for run in runs)) if runs else NOTHING


def warm(runs: Sequence[Run]) -> Grid:
    """Time of warm over that of cold sequences."""
    rows = []
    for solver, ratios in warm_ratios(runs).items():
        faster = sum(ratio < 1.0 for ratio in ratios)
        texts = [significant(value, 2) for value in (geometric_mean(ratios), min(ratios), max(ratios))]
        rows.append((solver, KEPT.get(solver, NOTHING), *texts, f"{faster} of {len(ratios)}"))
    headings = ("solver", "what it keeps", "mean ratio", "smallest", "largest", "faster")
    return Grid("", headings, rows)


def forms(runs: Sequence[Run]) -> Grid:
    """Time in all unknowns over that of the condensed form."""
    rows = [
        (solver, name, *(significant(value, 2) for value in (geometric_mean(ratios), min(ratios), max(ratios))),
         str(len(ratios)))
        for task, name in ((INNER, "inner problem"), (OUTER, "outer loop"))
        for solver, ratios in condensed_ratios(runs, task).items()
    ]  # fmt: skip
    headings = ("solver", "what", "mean ratio", "smallest", "largest", "problems")
    return Grid("", headings, rows)


def infeasible(runs: Sequence[Run]) -> Grid:
    """What was said of problems without a solution."""
    chosen = [run for run in runs if not run.feasible]
    columns = grouped(chosen, lambda run: (run.problem, run.task, run.form))
    headings = ("solver", *(f"{problem}, {task}, {form}" for problem, task, form in columns))
    rows = [
        (solver, *(_words(run for run in group if run.solver == solver) for group in columns.values()))
        for solver in dict.fromkeys(run.solver for run in chosen)
    ]
    return Grid("", headings, rows)


def _words(runs: Iterable[Run]) -> str:
    counts = Counter(run.status.replace("_", " ") for run in runs)
    return ", ".join(f"{word} ({number})" for word, number in sorted(counts.items())) or NOTHING


def failures(runs: Sequence[Run]) -> Grid:
    """Runs that ended without an answer or by a failure of the back end, grouped by what was said."""
    chosen = [run for run in runs if run.lost]
    groups = grouped(chosen, lambda run: (run.solver, run.status, run.reason[:120]))
    rows = [
        (solver, status.replace("_", " "), str(len(group)), _where(group), reason or NOTHING)
        for (solver, status, reason), group in sorted(groups.items(), key=lambda item: (-len(item[1]), item[0]))
    ][:_LONGEST_LIST]
    headings = ("solver", "what happened", "runs", "for example", "in its words")
    return Grid("", headings, rows)


def _where(group: Sequence[Run]) -> str:
    run = group[0]
    return f"{run.problem}, {run.form}, {run.task}, {run.level}"


def problems(rows: Sequence[Row]) -> Grid:
    """Sizes and conditions of the problems."""
    facts: dict[str, Any] = {}
    for row in rows:
        if "facts" in row.result:
            facts.setdefault(str(row.case["problem"]), row.result["facts"])
    lines = [
        (
            name, PROBLEMS[name].kind, str(fact["unknowns"]), str(fact["condensed"]), str(fact["points"]),
            str(fact["equations"]), scientific(fact["condition"]), percent(fact["open"]), percent(fact["stick"]),
            percent(fact["slip"]),
        )
        for name, fact in facts.items()
    ]  # fmt: skip
    headings = ("problem", "kind", "unknowns", "condensed", "contact points", "equations", "condition of K", "open",
                "stick", "slip")  # fmt: skip
    return Grid("", headings, lines)


def settings(rows: Sequence[Row]) -> Grid:
    """The table of accuracies, as the runs were given it."""
    given: dict[str, dict[str, Any]] = {}
    for row in rows:
        if "options" in row.result:
            given.setdefault(str(row.case["solver"]), {}).setdefault(str(row.case["level"]), row.result["options"])
    lines = [
        (solver, REMARKS.get(solver, NOTHING), *(_options(levels.get(level)) for level in LEVELS))
        for solver, levels in given.items()
    ]
    headings = ("solver", "what it is", *(f"{level}: certified at {LEVELS[level]:.0e}" for level in LEVELS))
    return Grid("What every solver was asked for", headings, lines)


def _options(options: accuracies.Options | None) -> str:
    if options is None:
        return NOTHING
    return ", ".join(f"`{name}={value}`" for name, value in options.items()) or "no option"


def left_out(compared: Sequence[str]) -> Grid:
    """Solvers that were not compared, and how to get them."""
    rows = [(name, _how_to_compare(name)) for name in accuracies.TABLE if name not in compared]
    return Grid("Not compared", ("solver", "how to get it"), rows)


def _how_to_compare(name: str) -> str:
    return "name it by --only" if name in METHODS else f"python -m {how_to_install(name)}, unless --only left it out"
