"""What the study says, in sentences computed from its rows."""

from collections import Counter
from collections.abc import Iterator, Sequence
from statistics import median
from typing import Final

from comparisons.convergence.outer.entries import NAMES, Entries, Entry, body_name
from comparisons.convergence.outer.loops import CONDENSED, PLAIN
from comparisons.convergence.outer.tables import SOLUTIONS, mesh_groups, solution_found
from comparisons.lab.report.numbers import count_of, listing, percent, significant
from comparisons.lab.report.old import Finding

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
    limit = _limit([entry for entry in entries.single if entry.loop != CONDENSED])
    within = f" within {limit} iterations" if limit else ""
    if parts:
        yield f"To a certificate at 1e-8{within} the loops solve: {listing(parts)}.", "runs"
    found = [entry for entry in entries.single if entry.loop == CONDENSED]
    steps = [entry.iterations for entry in found if entry.iterations]
    if steps:
        where = "" if len(steps) == len(found) else " where it is solved"
        yield (
            f"The condensed method has no outer loop and takes {min(steps)} to {max(steps)} iterations{where}, for "
            f"{_frictions(found)}.",
            "iterations",
        )


def _limit(entries: Sequence[Entry]) -> int | None:
    """The number of iterations at which runs were stopped; None if none was."""
    return max((e.result["iterations"] for e in entries if e.result and e.status == "max_iterations"), default=None)


def _frictions(entries: Sequence[Entry]) -> str:
    """The range of μ: "μ = 0.05 to 4"."""
    found = [entry.friction for entry in entries]
    return "μ = " + " to ".join(dict.fromkeys(f"{friction:g}" for friction in (min(found), max(found))))


def _ends(entries: Sequence[Entry]) -> str:
    """How they ended, and how many of them: "cycling (4) and stalled (1)"."""
    return listing([f"{word} ({number})" for word, number in sorted(Counter(e.status for e in entries).items())])


def _falling(entry: Entry) -> bool:
    """Whether the residuals of a run that was not solved were falling to its end."""
    return not entry.solved and entry.result.get("course") == "converges"


def _plain_fails(entries: Entries) -> Sentences:
    """Which frictions the plain loop solves on each main problem."""
    for body in entries.main_bodies:
        found = entries.along(body, PLAIN)
        good = [entry for entry in found if entry.solved]
        failed = [entry for entry in found if not entry.solved and not _falling(entry)]
        falling = [entry for entry in found if _falling(entry)]
        if not found:
            continue
        parts = [f"solves {len(good)} of {len(found)} μ" + (f", the largest {good[-1].friction:g}" if good else "")]
        if failed:
            parts.append(f"fails at μ = {listing([f'{entry.friction:g}' for entry in failed])}: {_ends(failed)}")
        if falling:
            stopped = [f"{e.friction:g} (contraction {significant(e.rate)}, {e.status})" for e in falling]
            parts.append(f"still converges where it was stopped at μ = {listing(stopped)}")
        see = "histories" if failed or falling else "rates"
        yield f"On {body_name(body)}, the plain loop {'; it '.join(parts)}.", see


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
    lucky, falling = [e for e in above if e.solved], [e for e in below if _falling(e)]
    stuck = [e for e in below if not e.solved and not _falling(e)]
    if above:
        solved = f"{len(lucky)} of them {'is' if len(lucky) == 1 else 'are'}" if lucky else "none of them is"
        yield (
            f"{count_of(len(above), 'run')} of plain and damped loops should not converge by the linearisation (1 or "
            f"more); {solved} solved.",
            "contraction",
        )
    if stuck:
        places = listing(list(dict.fromkeys(f"{body_name(e.body)} at μ = {e.friction:g}" for e in stuck)))
        yield (
            f"A linearised contraction below 1 is not always enough: of {len(below)} such runs {len(stuck)} "
            f"{'ends' if len(stuck) == 1 else 'end'} without a solution and without converging, {_ends(stuck)}, on "
            f"{places}.",
            "runs",
        )
    if falling:
        yield (
            f"Of the {count_of(len(below), 'run')} with a linearised contraction below 1, {len(falling)} still "
            f"{'converges where it was' if len(falling) == 1 else 'converge where they were'} stopped: "
            f"{_ends(falling)}.",
            "runs",
        )


def _bound(entries: Entries) -> Sentences:
    """What the plain loop does below and beyond the bound of uniqueness."""
    ratios = [
        (entry.friction / bound, entry)
        for entry in entries.single
        if entry.loop == PLAIN and (bound := entry.number("sharper"))
    ]
    parts = []
    for where, found in (
        ("below the bound μγ < 1", [pair for pair in ratios if pair[0] < 1.0]),
        ("beyond the bound μγ < 1", [pair for pair in ratios if pair[0] >= 1.0]),
    ):
        if found:
            parts.append(f"{sum(entry.solved for _, entry in found)} of {count_of(len(found), 'run')} {where}")
    far = max((pair for pair in ratios if pair[1].solved), key=lambda pair: pair[0], default=None)
    if parts:
        text = f"The plain loop solves {listing(parts)}"
        if far is not None and far[0] >= 1.0:
            name = body_name(far[1].body)
            text += f", up to μγ = {significant(far[0], 2)} ({name}, μ = {far[1].friction:g})"
        yield f"{text}.", "rates"


def _meshes(entries: Entries) -> Sentences:
    """On which problems the contraction depends on the mesh."""
    groups = mesh_groups(entries)
    for problem in dict.fromkeys(problem for problem, _ in groups):
        kinds: dict[str, list[str]] = {"steady": [], "varies": [], "unknown": []}
        for (name, friction), found in groups.items():
            if name == problem:
                kind, text = _change(friction, found)
                kinds[kind].append(text)
        said = {
            "steady": f"stays within a factor of {_SPREAD:g}",
            "varies": "changes by more",
            "unknown": "cannot be compared",
        }
        parts = [f"{words} at μ = {listing(kinds[kind])}" for kind, words in said.items() if kinds[kind]]
        if not kinds["steady"]:
            parts = [part.replace("changes by more", f"changes by more than a factor of {_SPREAD:g}") for part in parts]
        name = NAMES.get(problem, problem)
        yield f"From mesh to mesh the contraction of the plain loop ({name}) {listing(parts)}.", "mesh"


def _change(friction: float, found: Sequence[Entry]) -> tuple[str, str]:
    """What the contraction of one friction does from mesh to mesh, "steady", "varies" or "unknown", and μ with why."""
    rates = [entry.rate for entry in found if entry.rate]
    none = f"none on {len(found) - len(rates)} of {count_of(len(found), 'mesh')}"
    if len(rates) < 2:
        return "unknown", f"{friction:g} ({none})"
    missing = f", {none}" if len(rates) < len(found) else ""
    if max(rates) <= _SPREAD * min(rates):
        return "steady", f"{friction:g}" + (f" ({none})" if missing else "")
    return "varies", f"{friction:g} ({significant(min(rates), 2)} to {significant(max(rates), 2)}{missing})"


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
        yield (
            f"Iterations over those of the plain loop where both are solved (medians): {listing(parts)}.",
            "iterations",
        )
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
    """Which of the three solutions is found, and whether the start decides it."""
    if not entries.several:
        return
    known = [name for name, _ in SOLUTIONS]
    counts = Counter(solution_found(entry) for entry in entries.several)
    parts = [f"{name} in {counts[name]}" for name in dict.fromkeys([*known, *counts])]
    ends: dict[str, set[str]] = {}
    for entry in entries.several:
        if entry.start is not None:
            ends.setdefault(entry.loop, set()).add(solution_found(entry))
    differ = sum(len(found.intersection(known)) > 1 for found in ends.values())
    verb = "ends" if differ == 1 else "end"
    starts = f"{differ or 'none'} of {count_of(len(ends), 'loop')} {verb} in different ones from different starts; "
    yield (
        f"Where three solutions exist, {starts if ends else ''}{count_of(len(entries.several), 'run')} in all: "
        f"{listing(parts)}.",
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
