"""The tables of the report, each with how to read it."""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, Final

from comparisons.backends import accuracies
from comparisons.backends.accuracies import KEPT, LEVELS, REMARKS
from comparisons.backends.measures import (
    SHIFT,
    Run,
    as_used,
    condensed_ratios,
    finite,
    geometric_mean,
    grouped,
    outcome_counts,
    performance_ratios,
    profile,
    shifted_mean,
    times_of,
    untrue_share,
    warm_ratios,
)  # fmt: skip
from comparisons.backends.outcomes import FALSE_ALARM, GAVE_UP, MODEST, NO_ANSWER, RIGHT, UNTRUE
from comparisons.backends.problems import PROBLEMS
from comparisons.backends.tasks import INNER, OUTER
from comparisons.report import Table
from comparisons.report.numbers import NOTHING, percent, scientific, seconds, significant
from comparisons.study import Row
from comparisons.tables import Grid

KINDS: Final = (
    ("inner", "single inner problems"),
    ("sequence", "sequences of inner problems"),
    ("outer", "condensed outer loops"),
)
"""Kind of task → its name; sequences are warm where the solver can keep something."""

_TRUE_AT: Final = (1.0, 2.0, 10.0)
_LONGEST_LIST: Final = 40


def of_kind(runs: Sequence[Run], kind: str) -> list[Run]:
    """The runs of a kind of task on problems that have a solution.

    Outer loops are those in condensed form, which is what the package's own methods are compared with.
    """
    chosen = as_used(runs) if kind == "sequence" else [run for run in runs if run.task == kind]
    return [run for run in chosen if run.feasible and (kind != OUTER or run.form == "condensed")]


def overview(runs: Sequence[Run]) -> Table:
    """Shares certified, by kind of task and level, and how often "solved" was untrue."""
    headings = ["solver", *(f"{kind}, {level}" for kind, _ in KINDS for level in LEVELS), "untrue", "false alarms"]
    counts = outcome_counts(runs)
    rows = []
    for solver in dict.fromkeys(run.solver for run in runs):
        mine = [run for run in runs if run.solver == solver]
        shares = [
            _share([run for run in of_kind(mine, kind) if run.level == level]) for kind, _ in KINDS for level in LEVELS
        ]
        told = counts.get(solver, Counter())
        rows.append((solver, *shares, percent(untrue_share(told)), str(told[FALSE_ALARM]) if told else NOTHING))
    reading = (
        "Share of the runs whose answers the certificate confirms, on problems that have a solution: single inner "
        "problems, sequences (all steps), condensed outer loops, each at three levels of accuracy. "
        '*untrue*: how often "solved" was said of an inner problem without being true; *false alarms*: how often a '
        "problem with a solution was called infeasible or unbounded. *none*: not part of this study."
    )
    failure = (
        "A run fails if the certificate does not pass at the level's tolerance, whatever the solver said, or if "
        "there is no answer within the limits of time and memory."
    )
    return Table("overview", Grid("Certified answers", tuple(headings), rows), reading, failure)


def _share(runs: Sequence[Run]) -> str:
    if not runs:
        return NOTHING
    return f"{percent(sum(run.certified for run in runs) / len(runs))} of {len(runs)}"


def truth(runs: Sequence[Run]) -> Table:
    """What was said of each inner problem, beside whether it was true."""
    headings = (
        "solver", "said solved, true", "said solved, untrue", "said infeasible, untrue", "gave up, certified",
        "gave up", "no answer", "\"solved\" true",
    )  # fmt: skip
    rows = []
    for solver, counts in outcome_counts(runs).items():
        share = untrue_share(counts)
        cells = [str(counts[each]) for each in (RIGHT, UNTRUE, FALSE_ALARM, MODEST, GAVE_UP, NO_ANSWER)]
        rows.append((solver, *cells, percent(None if share is None else 1.0 - share)))
    reading = (
        "Numbers of inner problems that at least one solver solved at that level and in that form, those of "
        "sequences counted one by one (a run that ended without an answer counts once). "
        "True means that the certificate, computed on the original data, passes at the "
        "level's tolerance; the solver was asked for a hundredth of that."
    )
    failure = "Columns two, three, five and six are failures; two and three are wrong answers, the others honest ones."
    return Table("truth", Grid("What was said, and what was true", headings, rows), reading, failure)


def speeds(runs: Sequence[Run], kind: str, name: str) -> Table:
    """Shares of the profile, and shifted geometric means, by solver."""
    chosen = of_kind(runs, kind)
    headings = ["solver"]
    headings += [
        f"{level}: {text}" for level in LEVELS for text in ("fastest", "within 2 ×", "within 10 ×", "mean time")
    ]
    columns: dict[str, list[str]] = {solver: [] for solver in dict.fromkeys(run.solver for run in chosen)}
    for level in LEVELS:
        at_level = [run for run in chosen if run.level == level]
        ratios = performance_ratios(times_of(at_level))
        for solver, cells in columns.items():
            mine = ratios.get(solver, [])
            cells += [percent(profile(mine, at)) if mine else NOTHING for at in _TRUE_AT]
            cells.append(_mean_time([run for run in at_level if run.solver == solver]))
    grid = Grid(f"Times: {name}", tuple(headings), [(solver, *cells) for solver, cells in columns.items()])
    reading = (
        "Shares of the problems that a solver solved as fast as the fastest, within twice and within ten times its "
        "time, at each level: values of the performance profiles at 1, 2 and 10. *mean time*: geometric mean, "
        f"shifted by {seconds(SHIFT)}, over the problems this solver solved, with their number: where numbers "
        "differ, the means are of different problems and cannot be compared."
    )
    return Table(f"times-{kind}", grid, reading, "A failure has no time: it lowers the shares and is not in the mean.")


def _mean_time(runs: Sequence[Run]) -> str:
    times = finite(run.time for run in runs)
    return f"{seconds(shifted_mean(times))} ({len(times)})" if times else NOTHING


def errors(runs: Sequence[Run]) -> Table:
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
            scientific(_median(finite(getattr(run, name) for run in group)), 2)
            for name in ("accuracy", "primal", "dual", "complementarity")
        ]
        iterations = _median([run.iterations for run in group if run.iterations])
        spreads = _median(finite(run.spread for run in group))
        failed = sum(not run.certified for run in group)
        rows.append((solver, level, *medians, significant(iterations), percent(spreads), f"{failed} of {len(group)}"))
    reading = (
        "Medians over the single inner problems. *accuracy* is the smallest tolerance at which the certificate passes; "
        "*primal* the largest violation of equations and bounds, *dual* of stationarity and signs, *complementarity* "
        "that of both products, all relative. Iterations are counted as each solver counts, none if it does not tell. "
        "*spread*: largest less smallest time of a case over its median."
    )
    failure = "The last column counts the runs whose certificate fails; the medians are over all runs with an answer."
    return Table("errors", Grid("Errors and iterations", headings, rows), reading, failure)


def _median(values: Sequence[float]) -> float | None:
    ordered = sorted(values)
    return ordered[len(ordered) // 2] if ordered else None


def kinds(runs: Sequence[Run]) -> Table:
    """Shares certified of single inner problems, by kind of problem and form."""
    chosen = [run for run in runs if run.task == INNER and run.feasible]
    columns = grouped(chosen, lambda run: (PROBLEMS[run.problem].kind, run.form))
    headings = ("solver", *(f"{kind}, {form}" for kind, form in columns))
    rows = [
        (solver, *(_share([run for run in group if run.solver == solver]) for group in columns.values()))
        for solver in dict.fromkeys(run.solver for run in chosen)
    ]
    reading = (
        "Share of the single inner problems, over all levels, that the certificate confirms: by what is difficult "
        "about them, and in all unknowns (full) or on the contact alone (condensed)."
    )
    failure = "As in the first table: no certificate at the level's tolerance."
    return Table("kinds", Grid("What is difficult for whom", headings, rows), reading, failure)


def warm(runs: Sequence[Run]) -> Table:
    """Time of warm over that of cold sequences."""
    rows = []
    for solver, ratios in warm_ratios(runs).items():
        faster = sum(ratio < 1.0 for ratio in ratios)
        texts = [significant(value, 2) for value in (geometric_mean(ratios), min(ratios), max(ratios))]
        rows.append((solver, KEPT[solver], *texts, f"{faster} of {len(ratios)}"))
    headings = ("solver", "what it keeps", "mean ratio", "smallest", "largest", "faster")
    reading = (
        "Time of a sequence of inner problems solved warm, over that of the same problems solved cold, where both were "
        "certified: geometric mean, smallest and largest ratio, and how many were faster warm. Below 1 warm is faster."
    )
    return Table("warm", Grid("Warm against cold", headings, rows), reading, "Failed sequences have no ratio.")


def forms(runs: Sequence[Run]) -> Table:
    """Time in all unknowns over that of the condensed form."""
    rows = [
        (solver, name, *(significant(value, 2) for value in (geometric_mean(ratios), min(ratios), max(ratios))),
         str(len(ratios)))
        for task, name in ((INNER, "inner problem"), (OUTER, "outer loop"))
        for solver, ratios in condensed_ratios(runs, task).items()
    ]  # fmt: skip
    headings = ("solver", "what", "mean ratio", "smallest", "largest", "problems")
    reading = (
        "Time of a single inner problem, and of a whole outer loop, in all unknowns over that of the same problem "
        "condensed on the contact, where both were certified. The condensation of an inner problem is made once for "
        "all solvers and is not in the times; that of an outer loop is."
    )
    return Table("forms", Grid("All unknowns against condensed", headings, rows), reading, "Failed runs have no ratio.")


def infeasible(runs: Sequence[Run]) -> Table:
    """What was said of problems without a solution."""
    chosen = [run for run in runs if not run.feasible]
    columns = grouped(chosen, lambda run: (run.problem, run.task, run.form))
    headings = ("solver", *(f"{problem}, {task}, {form}" for problem, task, form in columns))
    rows = [
        (solver, *(_words(run for run in group if run.solver == solver) for group in columns.values()))
        for solver in dict.fromkeys(run.solver for run in chosen)
    ]
    reading = (
        "What was said of problems that have no solution, with the number of levels at which it was said. Right is "
        "*infeasible*. DAQP and HiGHS are read through `qpsolvers`, which does not hand on that word: what they say "
        "counts as giving up. In outer loops the package itself proves infeasibility, by multipliers checked on the "
        "data."
    )
    failure = "*solved* is a wrong answer; anything but *infeasible* is no answer."
    return Table("infeasible", Grid("Problems without a solution", headings, rows), reading, failure)


def _words(runs: Iterable[Run]) -> str:
    counts = Counter(run.status.replace("_", " ") for run in runs)
    return ", ".join(f"{word} ({number})" for word, number in sorted(counts.items())) or NOTHING


def failures(runs: Sequence[Run]) -> Table:
    """Runs that ended without an answer or by a failure of the back end, grouped by what was said."""
    chosen = [run for run in runs if run.seconds is None or run.status == "backend_failed"]
    groups = grouped(chosen, lambda run: (run.solver, run.status, run.reason[:120]))
    rows = [
        (solver, status.replace("_", " "), str(len(group)), _where(group), reason or NOTHING)
        for (solver, status, reason), group in sorted(groups.items(), key=lambda item: (-len(item[1]), item[0]))
    ][:_LONGEST_LIST]
    headings = ("solver", "what happened", "runs", "for example", "in its words")
    reading = (
        f"Runs without an answer: out of time or memory, a process that died, a back end that failed. At most "
        f"{_LONGEST_LIST} lines, the most frequent first."
    )
    return Table("failures", Grid("Runs without an answer", headings, rows), reading, "All of these are failures.")


def _where(group: Sequence[Run]) -> str:
    run = group[0]
    return f"{run.problem}, {run.form}, {run.task}, {run.level}"


def problems(rows: Sequence[Row]) -> Table:
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
    reading = (
        "Each contact point has three inequalities. *condition*: quotient of the largest and smallest eigenvalue of "
        "the stiffness in all unknowns; the condensed one is 1. *open, stick, slip*: shares of the contact's length "
        "in the solution."
    )
    return Table("problems", Grid("Problems", headings, lines), reading)


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
    rows = [
        (name, "python -m pip install 'qvi-contact[solvers]', unless it was left out by --only")
        for name in accuracies.TABLE
        if name not in compared
    ]
    return Grid("Not compared", ("solver", "how to get it"), rows)
