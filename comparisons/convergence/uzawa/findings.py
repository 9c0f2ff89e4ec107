"""What the study says, in sentences computed from its rows."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final

from comparisons.convergence.rates import growth_order
from comparisons.convergence.uzawa.entries import Entries, Entry, Place, place_name
from comparisons.convergence.uzawa.methods import CONDENSED, METHODS, MOST, SHRINKING_UZAWA, UZAWA
from comparisons.convergence.uzawa.study import HALF
from comparisons.convergence.uzawa.tables import error_after
from comparisons.convergence.uzawa.task import SEARCHED
from comparisons.lab.report.numbers import count_of, is_number, listing, percent, scientific, seconds, significant
from comparisons.lab.report.old import Finding
from comparisons.paper.reference import load

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
        text += f", and it is not reached for good in {_length(_rough(entries))} iterations for {never} of {len(need)}"
    yield f"{text}.", "history"


def _length(found: Sequence[Entry]) -> int:
    """Iterations of the longest of these runs."""
    return max((int(entry.result["iterations"]) for entry in found), default=0)


def _why(entries: Entries) -> Sentences:
    """What the printed step costs, and what is left at the best step of the map."""
    sliding = [entry for entry in _rough(entries) if is_number(rate := entry.number("linearised")) and rate]
    shares = [share for entry in sliding if (share := entry.ratio("omega_T", "limit_T")) is not None]
    rates = [entry.number("linearised") or 0.0 for entry in sliding]
    if shares:
        count, powers = load().iterations, [rate ** load().iterations for rate in rates]
        yield (
            f"Where points slip ({len(sliding)} of {len(_rough(entries))} μ), ω_T = {load().omega_T:g} is "
            f"{_span(shares, percent)} of the limit 2 / λ_max on the paper's mesh; the iteration linearised at the "
            f"solution multiplies errors by {_range(rates)} in each step, by {_span(powers)} in {count}.",
            "paper",
        )
    both = [(entry, best) for entry in sliding if (best := _best(entries, entry.place)) and entry.needed(_DIGIT)]
    if both:
        yield _step_and_condition(both), "map-plate"


def _best(entries: Entries, place: Place) -> Entry | None:
    """The quickest run of the map of a place, if it has one."""
    return _quickest(entries.maps.get(place, []))


def _step_and_condition(both: Sequence[tuple[Entry, Entry]]) -> str:
    """How much of the iterations the step explains, and how many are left at the best one of the map."""
    parts, left = [], []
    for paper, best in both:
        printed, quickest = paper.needed(_DIGIT) or 0, best.needed(_DIGIT) or 1
        condition = paper.number("condition")
        parts.append(
            f"{quickest} instead of {printed} at μ = {paper.friction:g} (the step costs a factor of "
            f"{significant(printed / quickest, 2)}; condition {significant(condition)})"
        )
        if quickest > load().iterations:
            left.append(f"{paper.friction:g}")
    most = load().iterations
    rest = (
        f"more than {most} are left at μ = {listing(left)}, which no constant step of the map saves"
        if left
        else f"no more than {most} are left"
    )
    return (
        f"With the quickest step of the map on that mesh the iterations to 1e-4 are {listing(parts)}; {rest}. The "
        "conditions are those of the dual operator on the slipping points."
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
            count = f"{_length([entry])} iterations"
            text = (
                f"Without friction the printed step {'settles' if entry.settles else 'does not settle'} in {count}: in "
                f"their last quarter P/2 stays within {percent(entry.number('last_error'), 2)} of E U and multipliers "
                f"change by {percent(entry.number('last_change'))} per iteration"
            )
            none = "; no point has a friction bound above zero, so that there is no limit 2 / λ_max to stay below"
            yield f"{text}{none if entry.number('limit_T') is None else ''}.", "history"
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
    searches = [entry for entry in entries.runs("tangential limit") if entry.place[0] == "plate"]
    if not searches:
        return
    safe = sum((entry.number("largest") or 0.0) >= 1.0 for entry in searches)
    text = (
        f"A step ω_T of 2 / λ_max of the dual operator over all points was safe in {safe} of "
        f"{count_of(len(searches), 'search', 'searches')} on the plate"
    )
    found = bounded(entries)
    if found:
        shares = [entry.number("largest") or 0.0 for entry in found]
        finest = max(entry.cells for entry in found)
        fine = [entry.number("largest") or 0.0 for entry in found if entry.cells == finest]
        text += f"; the largest that settles is {_range(shares)} times that, on {finest}² cells {_range(fine)} times"
    local = [ratio for entry in found if (ratio := entry.ratio("largest", "foreseen")) is not None]
    if local:
        early = sum((entry.ratio("smallest", "foreseen") or 1.0) < 1.0 for entry in found)
        text += (
            f". Steps below the limit of the iteration linearised at the solution fail in {early} of {len(local)}: the "
            f"largest that settles is {_range(local)} times that limit, and beyond it in "
            f"{sum(ratio > 1.0 for ratio in local)}"
        )
    yield f"{text}.", "limits"


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
        where = f"On {place_name(entry.place)}"
        if smallest is None:
            none = ", so that λ_N stays zero" if not entry.result["open"] else ""
            yield (
                f"{where}, ω_N has no limit up to {SEARCHED[1]:g} times 2 / λ_max: {entry.result['open']} of "
                f"{entry.result['points']} points are open{none}.",
                "limit-table",
            )
        elif largest is None:
            yield f"{where}, no ω_N from {SEARCHED[0]:g} times 2 / λ_max on settles.", "limit-table"
        else:
            alone = entry.ratio("open_N", "limit_N")
            coupled = ": the two steps limit each other" if alone is not None and smallest < alone else ""
            yield (
                f"{where}, runs settle up to {significant(largest)} times 2 / λ_max in ω_N, where the linearised "
                f"iteration says {significant(entry.number('foreseen'))} and open points alone "
                f"{significant(alone)}{coupled}.",
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
        lasting = bad and all(entry.cells in bad for entry in found if entry.cells > min(bad))
        meshes = f"from {min(bad)}² cells on" if lasting else f"on {listing([f'{cells}²' for cells in bad])} cells"
        parts.append(f"{meshes if bad else 'on no mesh tried'} at μ = {friction:g}")
    if parts:
        yield f"The printed ω_T is beyond the limit {listing(parts)}.", "limits"


def _growth(entries: Entries) -> Sentences:
    """How iterations grow with the mesh."""
    parts = [_growing(friction, found) for friction, found in entries.meshes.items()]
    if parts:
        yield f"At half the limits the iterations to 1e-4 go like {listing(parts)}.", "mesh"
    runs = [entry for found in entries.meshes.values() for entry in found]
    failed = sum(entry.needed("1e-06") is None for entry in runs)
    if failed:
        yield (
            f"An error of 1e-6 is not reached for good in {_length(runs)} iterations on {failed} of {len(runs)} pairs "
            "of mesh and μ.",
            "meshes",
        )


def _growing(friction: float, found: Sequence[Entry]) -> str:
    """Order of the iterations to 1e-4 in h, their numbers, and meshes where they are not reached."""
    shown = [(entry.cells, count) for entry in found if (count := entry.needed(_DIGIT)) is not None]
    missed = [f"{entry.cells}²" for entry in found if entry.needed(_DIGIT) is None]
    notes = [power_and_course(shown)] if shown else []
    if missed:
        notes.append(f"not reached for good in {_length(found)} on {listing(missed)} cells")
    order = growth_order([cells for cells, _ in shown], [float(count) for _, count in shown])
    power = "an unknown power of h" if order is None else power_of_h(order)
    return f"{power} at μ = {friction:g} ({'; '.join(notes)})"


def power_of_h(order: float) -> str:
    """Of a quantity that grows like (cells a side)^order: "h^−1.50"."""
    return f"h^{'−' if order >= 0.0 else ''}{abs(order):.2f}"


def power_and_course(shown: Sequence[tuple[int, float]]) -> str:
    """Values by mesh, from coarse to fine: the first, the last, and the largest and that they are not monotone."""
    (coarse, first), (fine, last) = shown[0], shown[-1]
    if len(shown) == 1:
        return f"{significant(first)} on {coarse}² cells"
    values = [value for _, value in shown]
    text = f"{significant(first)} on {coarse}² cells, {significant(last)} on {fine}²"
    if values == sorted(values):
        return text
    cells, largest = max(shown, key=lambda pair: pair[1])
    return f"{text}; not monotone, the largest is {significant(largest)} on {cells}²"


def condition_growth(entries: Entries) -> str:
    """A sentence on the condition of the dual operator against the mesh; empty without three meshes of any μ."""
    parts = []
    for friction, found in entries.meshes.items():
        known = [(entry.cells, value) for entry in found if (value := entry.number("condition")) is not None]
        order = growth_order([cells for cells, _ in known], [value for _, value in known])
        if order is not None:
            parts.append(f"{power_of_h(order)} at μ = {friction:g} ({power_and_course(known)})")
    return f"The condition of the dual operator on the slipping points goes like {listing(parts)}." if parts else ""


def _equal(entries: Entries) -> Sentences:
    """Uzawa beside the others at equal accuracy: a sentence for each problem at the tightest target Uzawa meets."""
    saved = half_over_best(entries)
    if saved:
        yield (
            f"At equal accuracy Uzawa takes steps of {HALF:g} of their limits; in the maps of the same problems the "
            f"quickest step takes {_range(saved)} times fewer iterations to 1e-4 than that, once it is known.",
            "map-plate",
        )
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
        tighter = max((e.target for e in found if e.target and e.target < (best.target or 0.0)), default=None)
        end = "the tightest target" if tighter is None else f"not {scientific(tighter, 1)}"
        yield (
            f"On {place_name(place)}, Uzawa meets {scientific(best.target, 1)}, {end}: {best.run} takes "
            f"{count_of(best.result['iterations'], 'iteration')} and {seconds(best.seconds, 2)}"
            f"{', ' + listing(parts) if parts else ''}.",
            "work",
        )


def half_over_best(entries: Entries) -> list[float]:
    """Iterations to 1e-4 at half of both limits over the fewest of the map, where a comparison has such a map."""
    found = []
    for place in entries.accuracies:
        runs, best = entries.maps.get(place, []), _best(entries, place)
        half = [e.needed(_DIGIT) for e in runs if (e.tangential, e.normal) == (HALF, HALF)]
        if best is not None and half and half[0]:
            found.append(half[0] / (best.needed(_DIGIT) or 1))
    return found


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
        lost = f"; on {len(maps) - len(best)} none gets there" if len(best) < len(maps) else ""
        yield (
            f"{where}, {failing}; the quickest take {_range(counts)} iterations to 1e-4, no more than "
            f"{load().iterations} on {soon} of {count_of(len(maps), 'map')}, with ω_T at {_range(steps)} of its "
            f"limit{lost}; ω_N {'makes a' if _matters(found) else 'makes no'} difference.",
            _map_name(maps),
        )


def _counts(found: list[Entry]) -> list[int]:
    return [count for entry in found if (count := entry.needed(_DIGIT)) is not None]


def _quickest(found: list[Entry]) -> Entry | None:
    good = [(count, entry) for entry in found if entry.settles and (count := entry.needed(_DIGIT)) is not None]
    return min(good, key=lambda pair: pair[0])[1] if good else None


def _span(values: Sequence[float], text: Callable[[float], str] = lambda value: significant(value, 2)) -> str:
    """Smallest and largest as texts of this kind, once if they are the same."""
    return " to ".join(dict.fromkeys(text(value) for value in (min(values), max(values))))


def _range(values: Sequence[float]) -> str:
    """Smallest and largest, once if they are the same."""
    return _span(values, significant)


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
