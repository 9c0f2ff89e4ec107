"""Sentences computed from the runs, the most important first."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from comparisons.lab.report.numbers import count_of, listing, percent, significant
from comparisons.lab.report.old import Finding
from comparisons.lab.study.outcome import CRASHED, ERROR, MEMORY, TIMEOUT
from comparisons.solvers.accuracies import LEVELS, METHODS
from comparisons.solvers.measures import (
    CONE_ENERGY,
    EQUAL_CELLS,
    NEGLIGIBLE,
    UNDOUBLED,
    Run,
    condensed_ratios,
    error_powers,
    finite,
    geometric_mean,
    outcome_counts,
    paired,
    performance_ratios,
    profile,
    said_solved,
    times_of,
    unattained,
    untrue_on_unattained,
    untrue_share,
    warm_ratios,
)  # fmt: skip
from comparisons.solvers.outcomes import FALSE_ALARM, NO_ANSWER, UNTRUE
from comparisons.solvers.tables import KINDS, grouped_pairs, of_kind
from comparisons.solvers.tasks import INNER, OUTER

_NAMED: Final = 3  # solvers that a sentence names at most, where it ranks them
_LISTED: Final = 6  # things that a sentence lists at most, where there may be many
_RARELY: Final = 0.05  # share of untrue answers below which only their number is told
_SQUARE_ROOT: Final = (0.25, 0.75)  # powers that are nearer to 1/2 than to 0 and 1
_TWICE: Final = {
    "doubled_rows": "With every contact point given twice",
    "doubled_equation": "With every equation of balance given twice",
}
_ENDINGS: Final = {
    TIMEOUT: "out of time", MEMORY: "out of memory", CRASHED: "by the death of the process", ERROR: "by an error",
}  # fmt: skip


def findings(runs: Sequence[Run]) -> list[Finding]:
    """All there is to say."""
    return [
        *_size(runs), *_untrue(runs), *_nobody(runs), *_powers(runs), *_false_alarms(runs), *_fastest(runs),
        *_methods(runs), *_infeasible(runs), *_conditions(runs), *_redundant(runs), *_warm(runs), *_forms(runs),
        *_no_answer(runs),
    ]  # fmt: skip


def _size(runs: Sequence[Run]) -> Iterator[Finding]:
    solvers = dict.fromkeys(run.solver for run in runs)
    inner = [solver for solver in solvers if solver not in METHODS]
    own = [solver for solver in solvers if solver in METHODS]
    feasible = [run for run in runs if run.feasible]
    if not feasible:
        return
    certified = sum(run.certified for run in feasible)
    compared = [count_of(len(inner), "back end")] if inner else []
    compared += [f"{count_of(len(own), 'method')} of the package"] if own else []
    verb = "was" if len(solvers) == 1 else "were"
    yield Finding(
        f"{listing(compared)} {verb} compared in {count_of(len(runs), 'run')}; of the "
        f"{count_of(len(feasible), 'run')} on problems that have a solution the certificate confirms {certified} "
        f"({percent(certified / len(feasible))}).",
        "overview",
    )


def _untrue(runs: Sequence[Run]) -> Iterator[Finding]:
    """Who says "solved" of what is not, the worst share first; who only where nobody is right; who never."""
    counts, nobody = outcome_counts(runs), untrue_on_unattained(runs)
    said = {solver: share for solver in counts if (share := untrue_share(counts[solver])) is not None}
    ordered = sorted((solver for solver in said if said[solver]), key=lambda solver: (-said[solver], solver))
    excused = [solver for solver in ordered if counts[solver][UNTRUE] == nobody[solver]]
    often = [
        f"{solver} {percent(said[solver])} ({counts[solver][UNTRUE]} of {said_solved(counts[solver])})"
        for solver in ordered
        if said[solver] >= _RARELY and solver not in excused
    ]
    rarely = [
        f"{solver} ({counts[solver][UNTRUE]})" for solver in ordered if said[solver] < _RARELY and solver not in excused
    ]
    parts = [f"in the answers of {listing(often)}"] if often else []
    if rarely:
        parts.append(f"in less than {percent(_RARELY)} of the answers of {listing(rarely)}")
    if parts:
        start = '"Solved" of an inner problem was untrue, by the certificate at the tolerance of the level,'
        yield Finding(f"{start} {', and '.join(parts)}.", "truth")
    if excused:
        told = [f"{solver} ({counts[solver][UNTRUE]} of {said_solved(counts[solver])})" for solver in excused]
        yield Finding(
            f'{listing(told)} said an untrue "solved" only of inner problems on which no solver was certified.', "truth"
        )
    true = [f"{solver} ({count_of(said_solved(counts[solver]), 'time')})" for solver in said if said[solver] == 0.0]
    if true:
        yield Finding(
            f'Whenever {listing(true, "or")} said "solved" of an inner problem that has a solution, it was true.',
            "truth",
        )


def _nobody(runs: Sequence[Run]) -> Iterator[Finding]:
    """Inner problems that no solver solves, and how many untrue answers are about them."""
    found = unattained(runs)
    if not found:
        return
    names = [f"{problem} ({kind}, {form}, {level})" for level, problem, form, kind in found]
    if len(names) > _LISTED:
        names = [*names[:_LISTED], f"{len(names) - _LISTED} more"]
    untrue = untrue_on_unattained(runs).total()
    whole = sum(counts[UNTRUE] for counts in outcome_counts(runs).values())
    share = f"; {untrue} of the {count_of(whole, 'untrue answer')} of all solvers {'is' if untrue == 1 else 'are'} "
    share += "about them" if len(found) > 1 else "about it"
    yield Finding(
        "No answer of any solver is certified on the "
        f"{count_of(len(found), 'inner problem or sequence', 'inner problems or sequences')} "
        f"{listing(names)}{share if untrue else ''}.",
        "truth",
    )


def _powers(runs: Sequence[Run]) -> Iterator[Finding]:
    """Whose errors fall like the square root of what is asked, if those do that get the energy as a cone."""
    powers = error_powers(runs)
    least, most = _SQUARE_ROOT
    slow = [solver for solver in CONE_ENERGY if least < powers.get(solver, 0.0) < most]
    if not slow:
        return
    told = [f"{solver} ({significant(powers[solver], 2)})" for solver in slow]
    others = [power for solver, power in powers.items() if solver not in CONE_ENERGY and power > least]
    beside = ""
    if others:
        span = " to ".join(dict.fromkeys(significant(power, 2) for power in (min(others), max(others))))
        beside = f"; of solvers that take it as it is, and whose errors follow the tolerance at all, {span}"
    yield Finding(
        f"The median errors of {listing(told)} fall more like the square root of the tolerance asked for than in "
        f"proportion to it, the power in brackets: {'it gets' if len(slow) == 1 else 'they get'} the energy as one "
        f"more cone, see the limitations{beside}.",
        "errors",
    )


def _false_alarms(runs: Sequence[Run]) -> Iterator[Finding]:
    counts = outcome_counts(runs)
    told = [
        f"{solver} ({count_of(number, 'time')})"
        for solver in sorted(counts, key=lambda solver: (-counts[solver][FALSE_ALARM], solver))
        if (number := counts[solver][FALSE_ALARM])
    ]
    if told:
        yield Finding(
            f"Inner problems that have a solution were called infeasible or unbounded by {listing(told)}.", "truth"
        )
    elif counts:
        yield Finding("No inner problem that has a solution was called infeasible or unbounded.", "truth")


def _fastest(runs: Sequence[Run]) -> Iterator[Finding]:
    """For each kind of task and the accuracy in the middle that was run: most solved, then most within 2 ×."""
    for kind, name in KINDS:
        chosen = of_kind(runs, kind)
        levels = [level for level in LEVELS if any(run.level == level for run in chosen)]
        if not levels:
            continue
        level = "mid" if "mid" in levels else levels[0]
        times = times_of(run for run in chosen if run.level == level)
        told = _ranked(performance_ratios(times), len(times))
        if told:
            yield Finding(
                f"On {name} at accuracy {level}, ranked by how many are solved and then by how many within twice the "
                f"fastest time, {listing(told)} {'comes' if len(told) == 1 else 'come'} first.",
                f"times-{kind}",
            )


def _ranked(ratios: Mapping[str, Sequence[float]], every: int) -> list[str]:
    """The first few solvers that solve anything, and all that share the last place.

    None unless there are several solvers, and all of them were given every problem.
    """
    if len(ratios) < 2 or any(len(mine) < every for mine in ratios.values()):
        return []
    merit = {solver: (len(finite(mine)), profile(mine, 2.0)) for solver, mine in ratios.items() if finite(mine)}
    best = sorted(merit, key=lambda solver: (tuple(-part for part in merit[solver]), solver))
    last = merit[best[min(_NAMED, len(best)) - 1]] if best else (0, 0.0)
    told = [
        f"{solver} ({merit[solver][0]} of {every} solved, {percent(merit[solver][1])} within twice)"
        for solver in best
        if merit[solver] >= last
    ]
    return told if len(told) <= _LISTED else [*told[:_LISTED], f"{len(told) - _LISTED} more"]


def _methods(runs: Sequence[Run]) -> Iterator[Finding]:
    """The package's own methods beside the fastest outer loop with an inner solver."""
    for method in METHODS:
        mine = [run for run in runs if run.solver == method and run.feasible]
        if not mine:
            continue
        solved = sum(run.certified for run in mine)
        text = f"The method {method}{_step(mine)} solved {solved} of {count_of(len(mine), 'whole inequality')}"
        quotients = _beside_loops(runs, mine)
        mean = geometric_mean(quotients)
        if mean is not None:
            text += (
                f"; on the {len(quotients)} that an outer loop solved too, the fastest of the loops, chosen for each "
                f"anew, took {significant(mean, 2)} times as long{_span(quotients)}"
            )
        advice = " A step tuned to each problem was not tried, and may be about twice as fast." if _step(mine) else ""
        yield Finding(f"{text}.{advice}", "times-outer")


def _span(values: Sequence[float]) -> str:
    """That a number is a mean, and of what, if there are several."""
    if len(values) == 1:
        return ""
    return f" in the geometric mean ({significant(min(values), 2)} to {significant(max(values), 2)})"


def _step(runs: Sequence[Run]) -> str:
    """The one step that Uzawa's method was given everywhere; empty for other methods."""
    steps = {run.options["omega_T"] for run in runs if "omega_T" in run.options}
    return f", with the one step ω_T = {steps.pop():g} for all problems," if len(steps) == 1 else ""


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
    given = Counter(run.solver for run in chosen)
    recognised = Counter(run.solver for run in chosen if run.certified)
    every = len({run.instance for run in chosen})
    complete = [solver for solver in given if given[solver] == every]
    right = [solver for solver in complete if recognised[solver] == every]
    untrue = Counter(run.solver for run in chosen if run.outcomes.get(UNTRUE))
    out_of = f"out of {count_of(len(complete), 'back end')} given all of them"
    if right:
        yield Finding(
            f"Every inner problem without a solution was called infeasible by {listing(right)}, {out_of}.", "infeasible"
        )
    elif complete:
        yield Finding(f"No back end, {out_of}, called every inner problem without a solution infeasible.", "infeasible")
    if untrue:
        told = [f"{solver} ({count_of(number, 'time')})" for solver, number in untrue.items()]
        yield Finding(f'{listing(told)} said "solved" of inner problems without a solution.', "infeasible")
    else:
        yield Finding('No back end said "solved" of an inner problem without a solution.', "infeasible")


def _conditions(runs: Sequence[Run]) -> Iterator[Finding]:
    """Single inner problems on graded meshes, in both forms, beside the same on as many equal cells."""
    pairs = paired(runs, EQUAL_CELLS)
    parts = []
    for form, words in (("full", "in all unknowns"), ("condensed", "condensed on the contact")):
        chosen = [pair for pair in pairs if pair[0].form == form]
        if chosen:
            graded, equal = (percent(sum(pair[side].certified for pair in chosen) / len(chosen)) for side in (0, 1))
            parts.append(f"{words} {equal} on equal cells and {graded} on graded ones (of {len(chosen)} each)")
    if parts:
        told = [f"{name} against {EQUAL_CELLS[name]}" for name in dict.fromkeys(run.problem for run, _ in pairs)]
        yield Finding(
            f"Strongly graded cells against as many equal ones ({listing(told)}), all solvers together: of the runs on "
            f"single inner problems the certificate confirms {', '.join(parts)}.",
            "kinds",
        )


def _redundant(runs: Sequence[Run]) -> Iterator[Finding]:
    """What changes when rows are given twice, against the same problem with each given once."""
    for problem, pairs in grouped_pairs(runs).items():
        twice, once = (sum(pair[side].certified for pair in pairs) for side in (0, 1))
        gained, answered = Counter[str](), Counter[str]()
        for run, single in pairs:
            gained[run.solver] += run.certified - single.certified
            answered[run.solver] += single.lost - run.lost
        changes = (
            ("fewer are certified with", -gained), ("more are certified with", +gained),
            ("more have no answer with", -answered), ("fewer have no answer with", +answered),
        )  # fmt: skip
        parts = [
            f"{words} {listing([f'{solver} ({number})' for solver, number in changed.items()])}"
            for words, changed in changes
            if changed
        ]
        change = f": {'; '.join(parts)}" if parts else ", no solver differs"
        yield Finding(
            f"{_TWICE[problem]} ({problem}) the certificate confirms {twice} of {count_of(len(pairs), 'run')} on a "
            f"single inner problem, with each given once ({UNDOUBLED[problem]}) {once} of the same{change}.",
            "twins",
        )


def _warm(runs: Sequence[Run]) -> Iterator[Finding]:
    """Who gains by keeping something, who does not, and who loses."""
    ratios = warm_ratios(runs)
    means = {solver: geometric_mean(values) or 1.0 for solver, values in ratios.items()}
    ordered = sorted(means, key=lambda solver: (means[solver], solver))
    gaining = [solver for solver in ordered if means[solver] < 1.0 / NEGLIGIBLE]
    losing = [solver for solver in ordered if means[solver] > NEGLIGIBLE]
    parts = [
        f"{verb} with {listing([f'{solver} ({significant(means[solver], 2)})' for solver in chosen])}"
        for verb, chosen in (("less", gaining), ("more", losing))
        if chosen
    ]
    even = [solver for solver in ordered if solver not in (*gaining, *losing)]
    if even:
        parts.append(f"the same within a factor of {NEGLIGIBLE:g} with {listing(even)}")
    if parts:
        numbers = [len(values) for values in ratios.values()]
        few = count_of(max(numbers), "sequence")
        span = few if min(numbers) == max(numbers) else f"{min(numbers)} to {few}"
        start = f"A warm sequence takes, over the time of the cold one in the geometric mean of {span},"
        yield Finding(f"{start} {'; '.join(parts)}.", "warm")


def _forms(runs: Sequence[Run]) -> Iterator[Finding]:
    means = {solver: geometric_mean(values) or 0.0 for solver, values in condensed_ratios(runs, INNER).items()}
    if not means:
        return
    least, most = min(means, key=means.__getitem__), max(means, key=means.__getitem__)
    whole = geometric_mean(list(means.values())) or 0.0
    even = 1.0 / NEGLIGIBLE <= whole <= NEGLIGIBLE
    takes = "about as long as" if even else f"{significant(whole, 2)} times as long as"
    if len(means) > 1:
        span = (
            f"of all solvers: from {significant(means[least], 2)} ({least}) to {significant(means[most], 2)} ({most})"
        )
    else:
        span = f"of the problems that {most} solved in both forms"
    yield Finding(
        f"A single inner problem in all unknowns takes {takes} condensed on the contact, in the geometric mean {span}.",
        "forms",
    )


def _no_answer(runs: Sequence[Run]) -> Iterator[Finding]:
    """Runs that ended by a limit or a crash."""
    lost = [run for run in runs if NO_ANSWER in run.outcomes]
    if lost:
        words = Counter(run.status for run in lost)
        told = [f"{number} {_ENDINGS.get(word, word)}" for word, number in words.most_common()]
        yield Finding(f"{count_of(len(lost), 'run')} ended without an answer: {listing(told)}.", "failures")
    elif runs:
        yield Finding("No run was ended by a limit of time or memory, and no process died.", "failures")
