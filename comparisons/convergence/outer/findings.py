"""What the study says, in sentences computed from its rows."""

from collections import Counter
from collections.abc import Iterator
from statistics import median
from typing import Final

from comparisons.convergence.outer.entries import NAMES, Entries, Entry, body_name
from comparisons.convergence.outer.loops import CONDENSED, PLAIN
from comparisons.convergence.outer.tables import SOLUTIONS, mesh_groups, solution_found
from comparisons.report.document import Finding
from comparisons.report.numbers import count_of, listing, percent, significant

_SPREAD: Final = 1.5
"""Largest over smallest contraction on several meshes up to which it is called independent of the mesh."""


def findings(entries: Entries) -> list[Finding]:
    """The sentences, the most important first."""
    parts = (_solved, _plain_fails, _linearised, _locally, _bound, _meshes, _damping, _times, _solutions, _not_run)
    return [Finding(text, see) for part in parts for text, see in part(entries)]


Sentences = Iterator[tuple[str, str]]


def _solved(entries: Entries) -> Sentences:
    """How many problems each loop solves."""
    counts = {}
    for loop in entries.loops:
        found = [entry for entry in entries.single if entry.loop == loop]
        counts[loop] = (sum(entry.solved for entry in found), len(found))
    parts = [
        f"{loop} {solved} of {number}" for loop, (solved, number) in sorted(counts.items(), key=lambda c: -c[1][0])
    ]
    yield f"To a certificate at 1e-8 the loops solve: {listing(parts)}.", "runs"
    steps = [entry.iterations for entry in entries.single if entry.loop == CONDENSED and entry.iterations]
    if steps:
        yield (
            f"The condensed method has no outer loop and takes {min(steps)} to {max(steps)} iterations whatever the "
            "friction.",
            "iterations",
        )


def _plain_fails(entries: Entries) -> Sentences:
    """Up to which friction the plain loop goes on each main problem."""
    for body in entries.main_bodies:
        found = entries.along(body, PLAIN)
        failed = [entry for entry in found if not entry.solved]
        if not failed:
            top = max(entry.friction for entry in found)
            yield f"On {body_name(body)}, the plain loop solves every μ tried, up to {top:g}.", "rates"
            continue
        good = [entry.friction for entry in found if entry.solved]
        upto = f"up to μ = {max(good):g}" if good else "for no μ tried"
        ends = listing([f"{word} ({number})" for word, number in sorted(Counter(e.status for e in failed).items())])
        yield (
            f"On {body_name(body)}, the plain loop converges {upto} and fails at μ = "
            f"{listing([f'{entry.friction:g}' for entry in failed])}: {ends}.",
            "histories",
        )


def rated(entries: Entries) -> list[Entry]:
    """Solved runs of plain and damped loops with an observed and a linearised contraction."""
    return [entry for entry in entries.single if entry.solved and entry.rate and entry.number("linearised")]


def _linearised(entries: Entries) -> Sentences:
    """How well theory foresees the contraction."""
    exact = [entry for entry in entries.single if entry.loop == PLAIN and entry.rate and entry.number("exact")]
    if exact:
        worst = max(abs((entry.rate or 0.0) / (entry.number("exact") or 1.0) - 1.0) for entry in exact)
        yield (
            "Where the contraction of the plain loop is known by hand (8 contacts, 0.8 μ), the observed one differs "
            f"from it by {percent(worst, 2)} at most in {count_of(len(exact), 'run')}.",
            "contraction",
        )
    found = [entry for entry in rated(entries) if entry.loop == PLAIN and entry.cells]
    if found:
        off = sorted(
            (abs((entry.rate or 0.0) / (entry.number("linearised") or 1.0) - 1.0), entry.place) for entry in found
        )
        typical, (problem, cells, friction) = median(part for part, _ in off), off[-1][1]
        yield (
            f"On meshes, the plain loop linearised at the solution foresees its contraction to {percent(typical)} "
            f"(median of {count_of(len(off), 'run')}); the worst is {percent(off[-1][0])} on "
            f"{body_name((problem, cells))} at μ = {friction:g}.",
            "contraction",
        )


def _locally(entries: Entries) -> Sentences:
    """Whether a linearised contraction below 1 is enough, and one above 1 too much."""
    known = [entry for entry in entries.single if entry.number("linearised") is not None]
    above = [entry for entry in known if (entry.number("linearised") or 0.0) >= 1.0]
    below = [entry for entry in known if (entry.number("linearised") or 0.0) < 1.0]
    lucky, stuck = [e for e in above if e.solved], [e for e in below if not e.solved]
    if above:
        solved = f"{len(lucky)} of them {'is' if len(lucky) == 1 else 'are'}" if lucky else "none of them is"
        yield (
            f"{count_of(len(above), 'run')} of plain and damped loops should not converge by the linearisation (1 or "
            f"more); {solved} solved.",
            "contraction",
        )
    if stuck:
        ends = listing([f"{word} ({number})" for word, number in sorted(Counter(e.status for e in stuck).items())])
        places = listing(list(dict.fromkeys(f"{body_name(e.body)} at μ = {e.friction:g}" for e in stuck)))
        yield (
            f"A linearised contraction below 1 is not always enough: of {len(below)} such runs {len(stuck)} "
            f"end without a solution, {ends}, on {places}.",
            "runs",
        )


def _bound(entries: Entries) -> Sentences:
    """How far beyond the bound of uniqueness the plain loop still converges."""
    ratios = [
        (entry.friction / bound, entry)
        for entry in entries.single
        if entry.loop == PLAIN and entry.solved and (bound := entry.number("sharper"))
    ]
    beyond = [pair for pair in ratios if pair[0] >= 1.0]
    if beyond:
        ratio, entry = max(beyond, key=lambda pair: pair[0])
        yield (
            f"The bound μγ < 1 is sufficient and far from necessary: {len(beyond)} of {len(ratios)} runs that the "
            f"plain loop solves are beyond it, up to μγ = {significant(ratio, 2)} ({body_name(entry.body)}, μ = "
            f"{entry.friction:g}).",
            "rates",
        )


def _meshes(entries: Entries) -> Sentences:
    """On which problems the contraction depends on the mesh."""
    groups = mesh_groups(entries)
    for problem in dict.fromkeys(problem for problem, _ in groups):
        steady, others = [], []
        for (name, friction), found in groups.items():
            rates = [entry.rate for entry in found if entry.rate]
            if name != problem or len(rates) < 2:
                continue
            if max(rates) <= _SPREAD * min(rates) and len(rates) == len(found):
                steady.append(f"{friction:g}")
            else:
                others.append(f"{friction:g} ({significant(min(rates), 2)} to {significant(max(rates), 2)})")
        parts = [
            *([f"stays within a factor of {_SPREAD:g} at μ = {listing(steady)}"] if steady else []),
            *(
                [f"does not at μ = {listing(others)}" if steady else f"varies at μ = {listing(others)}"]
                if others
                else []
            ),
        ]
        if parts:
            name = NAMES.get(problem, problem)
            yield f"From mesh to mesh the contraction of the plain loop ({name}) {listing(parts)}.", "mesh"


def _damping(entries: Entries) -> Sentences:
    """What damping and acceleration cost where the plain loop converges, and save where it does not."""
    easy = [place for place in entries.places if (plain := entries.get(place, PLAIN)) is not None and plain.solved]
    hard = [place for place in entries.places if place not in easy]
    parts, saved = [], []
    for loop in entries.loops:
        if loop in (PLAIN, CONDENSED):
            continue
        ratios = [
            entry.iterations / plain.iterations
            for place in easy
            if (entry := entries.get(place, loop)) is not None and (plain := entries.get(place, PLAIN)) is not None
            and entry.iterations and plain.iterations
        ]  # fmt: skip
        rescued = sum((entry := entries.get(place, loop)) is not None and entry.solved for place in hard)
        if ratios:
            parts.append(f"{loop} {significant(median(ratios), 2)}")
        saved.append(f"{loop} {rescued}")
    if parts:
        yield f"Iterations over those of the plain loop where that converges (medians): {listing(parts)}.", "iterations"
    if hard and saved:
        yield (
            f"Of the {count_of(len(hard), 'problem')} that the plain loop does not solve, the others do: "
            f"{listing(saved)}.",
            "runs",
        )


def _times(entries: Entries) -> Sentences:
    """Time of loops over the condensed method: the median, and the worst of all."""
    ratios = [(ratio, entry) for entry in entries.single if entry.cells and (ratio := entries.ratio(entry)) is not None]
    found = {
        loop: [ratio for ratio, entry in ratios if entry.loop == loop] for loop in entries.loops if loop != CONDENSED
    }
    parts = [f"{loop} {significant(median(several), 2)}" for loop, several in found.items() if several]
    if parts:
        worst, slowest = max(ratios, key=lambda pair: pair[0])
        yield (
            f"Times over that of the condensed method (medians of meshes that both solve): {listing(parts)}; at most "
            f"{significant(worst, 2)}, by {slowest.loop} on {body_name(slowest.body)} at μ = {slowest.friction:g}.",
            "times",
        )


def _solutions(entries: Entries) -> Sentences:
    """Which of the three solutions is found."""
    if entries.several:
        counts = Counter(solution_found(entry) for entry in entries.several)
        parts = [f"{name} in {counts[name]}" for name in dict.fromkeys([*(name for name, _ in SOLUTIONS), *counts])]
        yield (
            f"Where three solutions exist the start decides which one is found: {listing(parts)} of "
            f"{count_of(len(entries.several), 'run')}.",
            "solutions",
        )


def _not_run(entries: Entries) -> Sentences:
    missing = [entry for entry in entries.all if not entry.result]
    if missing:
        ends = Counter(entry.status for entry in missing)
        yield (
            f"{count_of(len(missing), 'run')} ended without a result "
            f"({listing([f'{word}: {number}' for word, number in sorted(ends.items())])}).",
            "runs",
        )
