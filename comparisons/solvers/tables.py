"""The tables of the report, each with how to read it."""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, Final

from comparisons.lab.report.numbers import NOTHING, percent, scientific, seconds, significant
from comparisons.lab.report.old import Table
from comparisons.lab.study import Row
from comparisons.lab.tables import Grid
from comparisons.solvers import accuracies
from comparisons.solvers.accuracies import KEPT, LEVELS, REMARKS
from comparisons.solvers.measures import (
    SHIFT,
    UNDOUBLED,
    Run,
    as_used,
    condensed_ratios,
    finite,
    geometric_mean,
    grouped,
    mean_with_failures,
    median,
    outcome_counts,
    paired,
    performance_ratios,
    profile,
    shifted_mean,
    times_of,
    untrue_on_unattained,
    untrue_share,
    warm_ratios,
)  # fmt: skip
from comparisons.solvers.outcomes import FALSE_ALARM, GAVE_UP, MODEST, NO_ANSWER, RIGHT, UNTRUE
from comparisons.solvers.problems import PROBLEMS
from comparisons.solvers.tasks import INNER, OUTER

KINDS: Final = (
    ("inner", "single inner problems"),
    ("sequence", "sequences of inner problems"),
    ("outer", "whole inequalities (condensed)"),
)
"""Kind of task → its name; sequences are warm where the solver can keep something."""

OUTER_TIMES: Final = (
    "Of a whole inequality no time contains the factorisation of the stiffness. Outer loops with inner solvers make "
    "the condensed form anew in every run, if they use it; the method `condensed` takes the Schur complement of the "
    "contact's unknowns from the factor and changes variables; `uzawa` makes the compliance of the contact points. All "
    "that is in their times."
)
"""What the times of whole inequalities contain."""

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
        "problems, sequences (all steps), whole inequalities condensed, each at three levels of accuracy. "
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
        "solver", "said solved, true", "said solved, untrue", "of these where nobody was certified",
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
    reading = (
        "Numbers of inner problems that have a solution, those of sequences counted one by one (a run that ended "
        "without an answer counts once). True means that the certificate, computed on the original data, passes at "
        "the level's tolerance. *Of these where nobody was certified*: the part of the untrue said of problems on "
        "which no answer of any solver was certified at that level and in that form."
    )
    failure = (
        "*Said solved, untrue* and *said infeasible, untrue* are wrong answers; *gave up* and *no answer* are honest "
        "failures."
    )
    return Table("truth", Grid("What was said, and what was true", headings, rows), reading, failure)


def speeds(runs: Sequence[Run], kind: str, name: str) -> Table:
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
    grid = Grid(f"Times: {name}", tuple(headings), [(solver, *cells) for solver, cells in columns.items()])
    reading = (
        "Shares of the problems that a solver solved as fast as the fastest, within twice and within ten times its "
        "time, at each level: values of the performance profiles at 1, 2 and 10. *mean time*: geometric mean, "
        f"shifted by {seconds(SHIFT)}, over the problems this solver solved, with their number: where numbers "
        "differ, the means are of different problems and cannot be compared. *mean, failures at the limit*: the same "
        f"over all problems, every failure counted as if it had taken the whole time limit of a case{_limit(chosen)}, "
        "as benchmarks often do: comparable between solvers, but where there are failures it tells their number more "
        "than a time." + (f" {OUTER_TIMES}" if kind == OUTER else "")
    )
    failure = "A failure has no time: it lowers the shares, is not in the mean time, and counts the limit in the other."
    return Table(f"times-{kind}", grid, reading, failure)


def _limit(runs: Sequence[Run]) -> str:
    limits = {run.limit for run in runs}
    return f" ({seconds(limits.pop())})" if len(limits) == 1 else ""


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
            scientific(median(finite(getattr(run, name) for run in group)), 2)
            for name in ("accuracy", "primal", "dual", "complementarity")
        ]
        iterations = median([run.iterations for run in group if run.iterations])
        spreads = median(finite(run.spread for run in group))
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


def twins(runs: Sequence[Run]) -> Table:
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
    reading = (
        "Single inner problems with every contact point (doubled_rows) or every equation (doubled_equation) given "
        "twice, beside the same problems with each given once: shares that the certificate confirms, and runs in which "
        "the solver failed or was ended, over both forms and all levels that both were run at."
    )
    return Table("twins", Grid("Rows given twice", headings, rows), reading, "Both: no certificate, and no answer.")


def grouped_pairs(runs: Sequence[Run]) -> dict[str, list[tuple[Run, Run]]]:
    """Problem with rows given twice → (run, run on the same problem with each given once)."""
    found: dict[str, list[tuple[Run, Run]]] = {}
    for pair in paired(runs, UNDOUBLED):
        found.setdefault(pair[0].problem, []).append(pair)
    return found


def _certified_and_lost(runs: Sequence[Run]) -> tuple[str, str]:
    return _share(runs), str(sum(run.lost for run in runs)) if runs else NOTHING


def warm(runs: Sequence[Run]) -> Table:
    """Time of warm over that of cold sequences."""
    rows = []
    for solver, ratios in warm_ratios(runs).items():
        faster = sum(ratio < 1.0 for ratio in ratios)
        texts = [significant(value, 2) for value in (geometric_mean(ratios), min(ratios), max(ratios))]
        rows.append((solver, KEPT.get(solver, NOTHING), *texts, f"{faster} of {len(ratios)}"))
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
        "all solvers and is not in the times; that of an outer loop is made in every run, and is."
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
    chosen = [run for run in runs if run.lost]
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
