"""Sentences computed from the runs, the most important first."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Final

from comparisons.backends.accuracies import LEVELS, METHODS
from comparisons.backends.measures import (
    Run,
    area,
    condensed_ratios,
    finite,
    geometric_mean,
    outcome_counts,
    performance_ratios,
    profile,
    said_solved,
    times_of,
    unattained,
    untrue_share,
    warm_ratios,
)  # fmt: skip
from comparisons.backends.outcomes import FALSE_ALARM, NO_ANSWER, UNTRUE
from comparisons.backends.problems import PROBLEMS
from comparisons.backends.tables import KINDS, of_kind
from comparisons.backends.tasks import INNER, OUTER
from comparisons.report import Finding
from comparisons.report.numbers import count_of, listing, percent, significant

UNTIL: Final = 100.0
_NAMED: Final = 3  # solvers that a sentence names at most, where it ranks them
_RARELY: Final = 0.02  # share of untrue answers below which only their number is told
_GAIN: Final = 0.95  # ratio of times that counts as faster


def findings(runs: Sequence[Run]) -> list[Finding]:
    """All there is to say."""
    return [
        *_size(runs), *_untrue(runs), *_false_alarms(runs), *_nobody(runs), *_fastest(runs), *_methods(runs),
        *_infeasible(runs), *_conditions(runs), *_redundant(runs), *_warm(runs), *_forms(runs), *_no_answer(runs),
    ]  # fmt: skip


def _size(runs: Sequence[Run]) -> Iterator[Finding]:
    solvers = dict.fromkeys(run.solver for run in runs)
    inner = [solver for solver in solvers if solver not in METHODS]
    own = [solver for solver in solvers if solver in METHODS]
    feasible = [run for run in runs if run.feasible]
    if not feasible:
        return
    certified = sum(run.certified for run in feasible)
    beside = f" and {count_of(len(own), 'method')} of the package" if own else ""
    yield Finding(
        f"{count_of(len(inner), 'back end')}{beside} were compared in {count_of(len(runs), 'run')}; of the "
        f"{count_of(len(feasible), 'run')} on problems that have a solution, the certificate confirms {certified} "
        f"({percent(certified / len(feasible))}).",
        "overview",
    )


def _untrue(runs: Sequence[Run]) -> Iterator[Finding]:
    """Who says "solved" of what is not, the worst share first, and who never does."""
    counts = outcome_counts(runs)
    said = {solver: share for solver in counts if (share := untrue_share(counts[solver])) is not None}
    ordered = sorted(said, key=lambda solver: (-said[solver], solver))
    often = [
        f"{solver} {percent(said[solver])} ({counts[solver][UNTRUE]} of {said_solved(counts[solver])})"
        for solver in ordered
        if said[solver] >= _RARELY
    ]
    rarely = [f"{solver} ({counts[solver][UNTRUE]})" for solver in ordered if 0.0 < said[solver] < _RARELY]
    parts = [f"in the answers of {listing(often)}"] if often else []
    if rarely:
        parts.append(f"in less than {percent(_RARELY)} of the answers of {listing(rarely)}")
    if parts:
        start = '"Solved" was untrue, at a hundred times the tolerance asked for,'
        yield Finding(f"{start} {', and '.join(parts)}.", "truth")
    true = [solver for solver, share in said.items() if share == 0.0]
    if true:
        yield Finding(f'Whenever {listing(true, "or")} said "solved", it was true.', "truth")


def _false_alarms(runs: Sequence[Run]) -> Iterator[Finding]:
    counts = outcome_counts(runs)
    told = [f"{solver} ({count_of(number, 'time')})" for solver in counts if (number := counts[solver][FALSE_ALARM])]
    if told:
        yield Finding(
            f"Inner problems that have a solution were called infeasible or unbounded by {listing(told)}.", "truth"
        )
    elif counts:
        yield Finding("No inner problem that has a solution was called infeasible or unbounded.", "truth")


def _nobody(runs: Sequence[Run]) -> Iterator[Finding]:
    """Inner problems that no solver solves."""
    found = unattained(runs)
    if found:
        told = [f"{problem} ({form}, {level})" for level, problem, form in found]
        yield Finding(
            f"On {count_of(len(found), 'inner problem')} no answer of any solver is certified: {listing(told)}; "
            "whatever was said of them is not counted as untrue above.",
            "errors",
        )


def _fastest(runs: Sequence[Run]) -> Iterator[Finding]:
    """For each kind of task and the accuracy in the middle that was run: the best profiles."""
    for kind, name in KINDS:
        chosen = of_kind(runs, kind)
        levels = [level for level in LEVELS if any(run.level == level for run in chosen)]
        if not levels:
            continue
        level = "mid" if "mid" in levels else levels[0]
        ratios = performance_ratios(times_of(run for run in chosen if run.level == level))
        best = sorted(ratios, key=lambda solver: (-area(ratios[solver], UNTIL), solver))[:_NAMED]
        told = [
            f"{solver} ({len(finite(ratios[solver]))} of {len(ratios[solver])} solved, "
            f"{percent(profile(ratios[solver], 2.0))} within twice the fastest time)"
            for solver in best
        ]
        start = f"On {name} at accuracy {level} the best profiles are those of"
        yield Finding(f"{start} {listing(told)}.", f"profiles-{kind}")


def _methods(runs: Sequence[Run]) -> Iterator[Finding]:
    """The package's own methods beside the fastest outer loop with an inner solver."""
    for method in METHODS:
        mine = [run for run in runs if run.solver == method and run.feasible]
        if not mine:
            continue
        solved = sum(run.certified for run in mine)
        text = f"The method {method} solved {solved} of {count_of(len(mine), 'whole inequality')}"
        quotients = _beside_loops(runs, mine)
        mean = geometric_mean(quotients)
        if mean is not None:
            text += (
                f"; where an outer loop did too, the fastest one took {significant(mean, 2)} times as long in the "
                f"geometric mean ({significant(min(quotients), 2)} to {significant(max(quotients), 2)})"
            )
        yield Finding(f"{text}.", "times-outer")


def _beside_loops(runs: Sequence[Run], mine: Sequence[Run]) -> list[float]:
    """Time of the fastest certified fixed point over that of a method, on the same problem, level and form."""
    loops: dict[tuple[str, ...], float] = {}
    for run in runs:
        if run.task == OUTER and run.solver not in METHODS and run.time is not None:
            loops[run.instance] = min(run.time, loops.get(run.instance, run.time))
    return [loops[run.instance] / run.time for run in mine if run.time and run.instance in loops]


def _infeasible(runs: Sequence[Run]) -> Iterator[Finding]:
    """Who recognises inner problems without a solution, always; and who says "solved"."""
    chosen = [run for run in runs if not run.feasible and run.task == INNER]
    if not chosen:
        return
    solvers = dict.fromkeys(run.solver for run in chosen)
    right = [solver for solver in solvers if all(run.certified for run in chosen if run.solver == solver)]
    untrue = Counter(run.solver for run in chosen if run.outcomes.get(UNTRUE))
    yield Finding(
        f"Every inner problem without a solution was called infeasible by {listing(right)}, out of "
        f"{count_of(len(solvers), 'back end')}.",
        "infeasible",
    )
    if untrue:
        told = [f"{solver} ({count_of(number, 'time')})" for solver, number in untrue.items()]
        yield Finding(f'Of problems without a solution {listing(told)} said "solved".', "infeasible")
    else:
        yield Finding('Of problems without a solution none said "solved".', "infeasible")


def _conditions(runs: Sequence[Run]) -> Iterator[Finding]:
    """Single inner problems on graded meshes, in both forms, beside those on equal cells."""
    shares = {}
    for kind in ("well conditioned", "ill conditioned"):
        for form in ("full", "condensed"):
            chosen = [
                run for run in runs
                if run.task == INNER and run.feasible and PROBLEMS[run.problem].kind == kind and run.form == form
            ]  # fmt: skip
            if chosen:
                shares[kind, form] = percent(sum(run.certified for run in chosen) / len(chosen))
    if len(shares) == 4:
        yield Finding(
            f"In all unknowns {shares['well conditioned', 'full']} of the single inner problems on equal cells were "
            f"certified and {shares['ill conditioned', 'full']} of those on strongly graded cells; condensed on the "
            f"contact {shares['well conditioned', 'condensed']} and {shares['ill conditioned', 'condensed']}.",
            "kinds",
        )


def _redundant(runs: Sequence[Run]) -> Iterator[Finding]:
    """Whom doubled rows stop."""
    chosen = [run for run in runs if PROBLEMS[run.problem].kind == "redundant rows" and run.task == INNER]
    if not chosen:
        return
    lost = Counter(run.solver for run in chosen if run.status == "backend_failed" or run.seconds is None)
    told = [f"{solver} ({count_of(number, 'run')})" for solver, number in lost.items()]
    text = f"Rows given twice leave {listing(told)} without an answer" if told else "Rows given twice stop no back end"
    yield Finding(f"{text}, out of {count_of(len({run.solver for run in chosen}), 'back end')}.", "kinds")


def _warm(runs: Sequence[Run]) -> Iterator[Finding]:
    """Who gains by keeping something, who does not, and who loses."""
    means = {solver: geometric_mean(values) or 1.0 for solver, values in warm_ratios(runs).items()}
    ordered = sorted(means, key=lambda solver: (means[solver], solver))
    gaining = [solver for solver in ordered if means[solver] < _GAIN]
    losing = [solver for solver in ordered if means[solver] > 1.0 / _GAIN]
    parts = [
        f"{verb} with {listing([f'{solver} ({significant(means[solver], 2)})' for solver in chosen])}"
        for verb, chosen in (("less", gaining), ("more", losing))
        if chosen
    ]
    even = [solver for solver in ordered if solver not in (*gaining, *losing)]
    if even:
        parts.append(f"the same within {percent(1.0 - _GAIN)} with {listing(even)}")
    if parts:
        start = "A warm sequence takes, over the time of the cold one in the geometric mean,"
        yield Finding(f"{start} {'; '.join(parts)}.", "warm")


def _forms(runs: Sequence[Run]) -> Iterator[Finding]:
    means = {solver: geometric_mean(values) or 0.0 for solver, values in condensed_ratios(runs, INNER).items()}
    if not means:
        return
    least, most = min(means, key=means.__getitem__), max(means, key=means.__getitem__)
    whole = geometric_mean(list(means.values()))
    yield Finding(
        f"A single inner problem in all unknowns takes {significant(whole, 2)} times as long as condensed on the "
        f"contact, in the geometric mean of all solvers: from {significant(means[least], 2)} ({least}) to "
        f"{significant(means[most], 2)} ({most}).",
        "forms",
    )


def _no_answer(runs: Sequence[Run]) -> Iterator[Finding]:
    """Runs that ended by a limit or a crash."""
    lost = [run for run in runs if NO_ANSWER in run.outcomes]
    if lost:
        words = Counter(run.status for run in lost)
        told = [f"{number} by {word}" for word, number in sorted(words.items())]
        yield Finding(f"{count_of(len(lost), 'run')} ended without an answer: {listing(told)}.", "failures")
    else:
        yield Finding("No run was ended by a limit of time or memory, and no process died.", "failures")
