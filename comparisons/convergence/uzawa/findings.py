"""What the study says, in sentences computed from its rows."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from comparisons.convergence.rates import growth_order
from comparisons.convergence.uzawa.entries import Entries, Entry, Place, place_name
from comparisons.convergence.uzawa.methods import CONDENSED, METHODS, MOST, SHRINKING_UZAWA, UZAWA
from comparisons.convergence.uzawa.tables import error_after
from comparisons.convergence.uzawa.task import SEARCHED
from comparisons.paper.reference import load
from comparisons.report.document import Finding
from comparisons.report.numbers import count_of, listing, percent, scientific, seconds, significant

Sentences = Iterator[tuple[str, str]]

_DIGIT: Final = "1e-04"
_LAST_DIGIT: Final = 0.00501  # of P/2: half of the last digit printed, and rounding


def findings(entries: Entries) -> list[Finding]:
    """The sentences, the most important first."""
    parts = (
        _thirty, _why, _printed, _frictionless, _limits, _exact_limit, _normal, _finer, _growth, _equal, _certified,
        _maps, _missing,
    )  # fmt: skip
    return [Finding(text, see) for part in parts for text, see in part(entries)]


def _rough(entries: Entries) -> list[Entry]:
    """The paper's runs with friction."""
    return [entry for entry in entries.runs("paper") if entry.friction > 0.0]


def _thirty(entries: Entries) -> Sentences:
    """How far 30 iterations are from the solution."""
    errors = [(error, entry) for entry in _rough(entries) if (error := error_after(entry)) is not None]
    if not errors:
        return
    largest, at = max(errors, key=lambda pair: pair[0])
    need = [entry.needed(_DIGIT) for entry in _rough(entries)]
    late = [count for count in need if count is not None and count > load().iterations]
    never = sum(count is None for count in need)
    text = (
        f"After the paper's {load().iterations} iterations P/2 is still wrong by up to {percent(largest, 2)} "
        f"(μ = {at.friction:g}) and tractions by up to "
        f"{percent(max(entry.number('tractions') or 0.0 for entry in _rough(entries)))} of the mean pressure"
    )
    if late:
        several = f"{len(late)} of {len(need)} μ"
        text += f"; with its ω_T an error of 1e-4 takes {_range(late)} iterations for {several}"
    if never:
        text += f", and is never reached for {never}"
    yield f"{text}.", "history"


def _why(entries: Entries) -> Sentences:
    """The contraction that the printed step allows."""
    rates = [rate for entry in _rough(entries) if (rate := entry.number("linearised"))]
    shares = [share for entry in _rough(entries) if (share := entry.ratio("omega_T", "limit_T")) is not None]
    if rates and shares:
        yield (
            f"The reason is the step: ω_T = {load().omega_T:g} is {percent(min(shares))} to {percent(max(shares))} of "
            "the limit 2 / λ_max on the paper's mesh, and the iteration linearised at the solution shrinks errors by "
            f"{significant(min(rates))} to {significant(max(rates))} in each step, "
            f"{significant(min(rates) ** load().iterations, 2)} to {significant(max(rates) ** load().iterations, 2)} "
            f"in {load().iterations}.",
            "paper",
        )


def _printed(entries: Entries) -> Sentences:
    """Whether the state after 30 iterations is what the paper prints."""
    found = entries.runs("paper")
    exact = {
        rule: sum(abs((entry.number(name) or 0.0) - (entry.number("printed") or 0.0)) < _LAST_DIGIT for entry in found)
        for rule, name in (("accumulating", "after"), ("printed", "after_printed_rule"))
    }
    if found:
        yield (
            f"That state is what Table 1 prints: the accumulating rule gives {exact['accumulating']} of {len(found)} "
            f"printed values to the last digit, the rule as printed {exact['printed']}.",
            "paper",
        )


def _frictionless(entries: Entries) -> Sentences:
    """What is different without friction."""
    for entry in entries.runs("paper"):
        if entry.friction == 0.0:
            yield (
                "Without friction a constant step does not converge at all: every change of λ_T is ω_T itself, and "
                f"P/2 stays within {percent(entry.number('last_error'), 2)} of E U for ever while multipliers change "
                f"by {percent(entry.number('last_change'))} per iteration; no step below a limit helps, as the limit "
                "is zero.",
                "history",
            )
    for place, found in entries.accuracies.items():
        if place[2] == 0.0:
            ends = {name: _reach([entry for entry in found if entry.run == name]) for name in (UZAWA, SHRINKING_UZAWA)}
            parts = [f"{name}: {reach}" for name, reach in ends.items()]
            yield f"On {place_name(place)}, the certificate confirms: {listing(parts)}.", "accuracy"


def _reach(found: list[Entry]) -> str:
    """The tightest target that a method meets."""
    met = [entry.target for entry in found if entry.solved and entry.target]
    return scientific(min(met), 1) if met else "no target"


def bounded(entries: Entries) -> list[Entry]:
    """Searches for ω_T on the plate that found its limit from both sides."""
    return [
        entry
        for entry in entries.runs("tangential limit")
        if entry.place[0] == "plate" and entry.number("largest") and entry.number("smallest")
    ]


def _limits(entries: Entries) -> Sentences:
    """The observed limits of ω_T on the plate beside theory."""
    found = bounded(entries)
    if not found:
        return
    shares = [entry.number("largest") or 0.0 for entry in found]
    upper = [(entry.number("foreseen"), entry) for entry in found]
    beyond = [entry for limit, entry in upper if limit is not None and (entry.number("largest") or 0.0) > limit]
    below = sum(share < 1.0 for share in shares)
    safe = "never below it" if not below else f"below it in {below}"
    most = max(
        ((entry.number("largest") or 0.0) / (entry.number("foreseen") or 1.0) - 1.0 for entry in beyond), default=0.0
    )
    excess = f"{len(beyond)}, by {percent(most, 1)} at most" if beyond else "none"
    finest = max(entry.cells for entry in found)
    fine = [entry.number("largest") or 0.0 for entry in found if entry.cells == finest]
    yield (
        f"Theory foresees the limit of ω_T: on the plate the largest step that settles is {significant(min(shares))} "
        f"to {significant(max(shares))} times 2 / λ_max of the dual operator over all points, {safe} in "
        f"{count_of(len(found), 'search', 'searches')}, and {significant(min(fine))} to {significant(max(fine))} "
        f"times on {finest}² cells; it exceeds the limit of the iteration linearised at the solution in {excess}.",
        "limits",
    )


def _exact_limit(entries: Entries) -> Sentences:
    """The problem with a limit known by hand."""
    for entry in entries.runs("tangential limit"):
        if entry.place[0] == "sliding" and entry.number("largest") and entry.number("smallest"):
            low, high = (significant(entry.number(name)) for name in ("largest", "smallest"))
            yield (
                f"Where the limit is known by hand (8 contacts, all sliding, constant bound) runs settle up to {low} "
                f"of it and fail from {high} on.",
                "limit-table",
            )


def _normal(entries: Entries) -> Sentences:
    """Whether ω_N has a limit."""
    for entry in entries.runs("normal limit"):
        largest, smallest = entry.number("largest"), entry.number("smallest")
        if smallest is None:
            yield (
                f"On {place_name(entry.place)}, ω_N has no limit up to {SEARCHED[1]:g} times 2 / λ_max: "
                f"{entry.result['open']} of {entry.result['points']} points are open, so that λ_N stays zero.",
                "limit-table",
            )
        elif largest is not None:
            yield (
                f"On {place_name(entry.place)}, runs settle up to {significant(largest)} times 2 / λ_max in ω_N, "
                f"where the linearised iteration says {significant(entry.number('foreseen'))}: the two steps limit "
                "each other.",
                "map-open",
            )


def _finer(entries: Entries) -> Sentences:
    """From which mesh on the printed step is too large."""
    step, parts = load().omega_T, []
    by_friction: dict[float, list[Entry]] = {}
    for entry in bounded(entries):
        by_friction.setdefault(entry.friction, []).append(entry)
    for friction, found in by_friction.items():
        bad = [entry.cells for entry in found if (entry.number("omega_T") or 0.0) < step]
        parts.append(
            f"from {min(bad)}² cells on at μ = {friction:g}" if bad else f"on no mesh tried at μ = {friction:g}"
        )
    if parts:
        yield f"The printed ω_T is beyond the limit {listing(parts)}.", "limits"


def _growth(entries: Entries) -> Sentences:
    """How iterations grow with the mesh."""
    parts, failed = [], 0
    for friction, found in entries.meshes.items():
        shown = [(entry.cells, count) for entry in found if (count := entry.needed(_DIGIT)) is not None]
        failed += sum(entry.needed("1e-06") is None for entry in found)
        order = growth_order([c for c, _ in shown], [float(n) for _, n in shown])
        if order is not None:
            parts.append(f"h^−{order:.2f} at μ = {friction:g} (from {shown[0][1]} to {shown[-1][1]})")
    if parts:
        yield f"At half the limits the iterations to 1e-4 grow like {listing(parts)}.", "mesh"
    number = sum(len(found) for found in entries.meshes.values())
    if failed:
        yield (
            f"An error of 1e-6 is not reached in {MOST} iterations on {failed} of {number} pairs of mesh and μ.",
            "meshes",
        )


def _equal(entries: Entries) -> Sentences:
    """Uzawa beside the others at equal accuracy: a sentence for each problem at the tightest target Uzawa meets."""
    for place, found in entries.accuracies.items():
        met = [entry for entry in found if METHODS[entry.run].is_uzawa and entry.solved and entry.target]
        if not met:
            yield f"On {place_name(place)}, no run of Uzawa meets any target in {MOST} iterations.", "work"
            continue
        best = min(met, key=lambda entry: (entry.target or 0.0, entry.seconds or 0.0))
        others = [
            entry for entry in found if entry.target == best.target and not METHODS[entry.run].is_uzawa and entry.solved
        ]
        parts = [f"{e.run} {count_of(e.result['iterations'], 'iteration')} and {seconds(e.seconds, 2)}" for e in others]
        yield (
            f"On {place_name(place)}, Uzawa meets {scientific(best.target, 1)} and no tighter target: {best.run} takes "
            f"{count_of(best.result['iterations'], 'iteration')} and {seconds(best.seconds, 2)}"
            f"{', ' + listing(parts) if parts else ''}.",
            "work",
        )


def _certified(entries: Entries) -> Sentences:
    """How many targets each method meets."""
    counts: Counter[str] = Counter()
    totals: Counter[str] = Counter()
    for entry in entries.runs(*METHODS):
        totals[entry.run] += 1
        counts[entry.run] += entry.solved
    parts = [f"{name} {counts[name]} of {totals[name]}" for name in METHODS if totals[name]]
    if parts:
        best = f"; {CONDENSED} does it without any step to choose" if counts[CONDENSED] == totals[CONDENSED] else ""
        yield f"Targets confirmed by the certificate: {listing(parts)}{best}.", "accuracy"


def _maps(entries: Entries) -> Sentences:
    """Best steps of the maps, what fails, and whether ω_N matters: a sentence for the plate, and one for each other."""
    plates = {place: found for place, found in entries.maps.items() if place[0] == "plate"}
    for maps in (plates, *({place: found} for place, found in entries.maps.items() if place[0] != "plate")):
        if not maps:
            continue
        found = [entry for several in maps.values() for entry in several]
        best = [entry for several in maps.values() if (entry := _quickest(several)) is not None]
        counts, steps = sorted(_counts(best)), sorted(entry.tangential or 0.0 for entry in best)
        where = "On the plate" if maps is plates else f"On {place_name(next(iter(maps)))}"
        failing = f"{sum(not entry.settles for entry in found)} of {len(found)} pairs of steps do not settle"
        if not best:
            yield f"{where}, {failing}, and none gets within 1e-4 in time.", _map_name(maps)
            continue
        soon = sum(count <= load().iterations for count in counts)
        yield (
            f"{where}, {failing}; the quickest take {_range(counts)} iterations to 1e-4, no more than "
            f"{load().iterations} on {soon} of {count_of(len(maps), 'map')}, with ω_T at {_range(steps)} of its "
            f"limit; ω_N {'makes a' if _matters(found) else 'makes no'} difference.",
            _map_name(maps),
        )


def _counts(found: list[Entry]) -> list[int]:
    return [count for entry in found if (count := entry.needed(_DIGIT)) is not None]


def _quickest(found: list[Entry]) -> Entry | None:
    good = [(count, entry) for entry in found if entry.settles and (count := entry.needed(_DIGIT)) is not None]
    return min(good, key=lambda pair: pair[0])[1] if good else None


def _range(values: Sequence[float]) -> str:
    """Smallest and largest, once if they are the same."""
    return " to ".join(dict.fromkeys(significant(value) for value in (min(values), max(values))))


def _matters(found: list[Entry]) -> bool:
    """Whether runs that differ in ω_N alone take different numbers of iterations, or only some of them settle."""
    seen: dict[tuple[Any, ...], set[tuple[Any, ...]]] = {}
    for entry in found:
        seen.setdefault((entry.place, entry.tangential), set()).add((entry.settles, entry.needed(_DIGIT)))
    return any(len(several) > 1 for several in seen.values())


def _map_name(maps: Mapping[Place, list[Entry]]) -> str:
    return "map-plate" if next(iter(maps))[0] == "plate" else "map-open"


def _missing(entries: Entries) -> Sentences:
    if entries.missing:
        reasons = listing([f"{word}: {n}" for word, n in sorted(Counter(e.status for e in entries.missing).items())])
        yield f"{count_of(len(entries.missing), 'run')} ended without a result ({reasons}).", ""
