"""What the numbers of a run say, in sentences computed from them."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Final

from comparisons.benchmark.ratios import growth
from comparisons.peers.models import CODES, EQUILIBRIUM, MESHES, NAMED, Model
from comparisons.peers.points import (
    KINDS,
    RESOLUTION,
    Point,
    Reference,
    contradictory,
    guaranteed,
    missing,
    named,
    reference,
)
from comparisons.report import Finding
from comparisons.report.numbers import count_of, listing, scientific, seconds

BUDGETS: Final = (0.1, 1.0, 10.0)
"""Seconds at which the nearest model is named."""

TARGETS: Final = (1e-4, 1e-6)
"""Relative errors of P/2 at which the codes are compared."""

RESOLVED: Final = 5.0
"""An order is read off errors that are larger than so many times what is resolved."""

LARGE_SPREAD: Final = 0.1
"""Largest less smallest time over the median; above this the range stands beside the median."""

_UNCONFIRMED: Final = "unconfirmed: no finer mesh of it is solved"

Errors = Sequence[tuple[Point, float]]
"""Points at one μ that have an error, and the error."""


def slug(friction: float) -> str:
    """μ inside the name of a table or figure."""
    return f"mu-{friction:g}".replace(".", "_")


def findings(found: Sequence[Point]) -> list[Finding]:
    """The sentences: bounds, failures, what errors cost, then how errors behave."""
    frictions = sorted({point.friction for point in found})
    known = {friction: reference(found, friction) for friction in frictions}
    sure = [friction for friction in frictions if guaranteed(found, friction)]
    parts: list[Iterable[Finding]] = [_bounds(found, friction) for friction in sure]
    parts += [_indicator(found, known[friction], friction) for friction in frictions if friction not in sure]
    parts += [_failures(found), _missing(found)]
    parts += [_targets(_with_errors(found, each), each) for each in known.values() if each]
    for friction, each in known.items():
        parts += [_behaviour(_with_errors(found, each), each)] if each else [_unknown(friction)]
    return [finding for part in parts for finding in part]


def timed(point: Point) -> str:
    """The median time; where `LARGE_SPREAD` is exceeded also the smallest and the largest."""
    text = seconds(point.seconds)
    if point.range is None or (point.spread or 0.0) <= LARGE_SPREAD:
        return text
    (least, unit), (most, last) = (seconds(end).split(" ") for end in point.range)
    return f"{text} ({least}{'' if unit == last else f' {unit}'} to {most} {last})"


def _bounds(found: Sequence[Point], friction: float) -> Iterator[Finding]:
    """The guaranteed bounds of P/2 at one μ, and where the codes' forces lie; or that the bounds are wrong."""
    sure = guaranteed(found, friction)
    see = f"bounds-{slug(friction)}"
    if contradictory(found, friction):
        yield Finding(
            f"At μ = {friction:g} the guaranteed bounds of {count_of(len(sure), 'mesh')} contradict each other: no "
            "value of P/2 is inside all of them, none is used here, and something is wrong.",
            see,
        )
        return
    point, (lower, upper) = sure[0]
    yield Finding(
        f"At μ = {friction:g} P/2 is guaranteed to lie between {lower:.7f} and {upper:.7f} MPa × length, "
        f"{scientific((upper - lower) / abs(upper + lower))} either way, by {named(point)} in {timed(point)}; this "
        f"includes {scientific(RESOLUTION, 1)} on either side, up to which the solves hold. A force alone, by any of "
        "these codes, comes without such bounds.",
        see,
    )
    text = _places(found, sure, friction)
    if text:
        yield Finding(text, see)


def _places(found: Sequence[Point], sure: Sequence[tuple[Point, tuple[float, float]]], friction: float) -> str:
    """How many forces of each code are inside, above and below the guaranteed bounds of their own mesh."""
    ends = {(point.model.mesh, point.cells): each for point, each in sure}
    forces = [(p, p.half_force) for p in found if p.friction == friction and p.solved and p.half_force is not None]
    placed: dict[str, list[int]] = {}
    for point, force in forces:
        if (point.model.mesh, point.cells) in ends:
            lower, upper = ends[point.model.mesh, point.cells]
            placed.setdefault(point.model.code, []).append(0 if lower <= force <= upper else 1 if force > upper else -1)
    if not placed:
        return ""
    rest = len(forces) - sum(map(len, placed.values()))
    without = f" {count_of(rest, 'force')} on meshes without bounds: not counted." if rest else ""
    return (
        f"Forces at μ = {friction:g} inside the guaranteed bounds of their own mesh (same cells and grading): "
        f"{'; '.join(_place(code, placed[code]) for code in CODES if code in placed)}. Outside, a force is off by at "
        "least its distance from the bounds; inside, nothing is said of it beyond them. The lower ends are the "
        "equilibrium model's own forces, the upper ends those of the companion of the bracket's degree, so that these "
        f"could be outside by a mistake only.{without}"
    )


def _place(code: str, places: Sequence[int]) -> str:
    above, below = places.count(1), places.count(-1)
    outside = [f"{number} {side}" for number, side in ((above, "above"), (below, "below")) if number]
    return f"{CODES[code].name} {places.count(0)} of {len(places)}" + (f" ({listing(outside)})" if outside else "")


def _indicator(found: Sequence[Point], known: Reference | None, friction: float) -> Iterator[Finding]:
    """What brackets say at one μ where P has no bounds."""
    brackets = [(p, p.bounds) for p in found if p.friction == friction and p.solved and p.bounds]
    if not brackets:
        return
    point, bounds = min(brackets, key=lambda pair: pair[1].width)
    yield Finding(
        f"At μ = {friction:g} P has no guaranteed bounds: the bracket is an indicator, for {KINDS[bounds.kind]}. Its "
        f"smallest half width is {scientific(bounds.width)} of the energy ({named(point)})"
        f"{_beside(found, point, known)}.",
        f"bounds-{slug(friction)}",
    )


def _beside(found: Sequence[Point], bracket: Point, known: Reference | None) -> str:
    """The error of the equilibrium model on the mesh of a bracket, if there is one."""
    place = (EQUILIBRIUM, bracket.model.mesh, bracket.cells)
    pairs = [] if known is None else _with_errors(found, known)
    errors = [error for point, error in pairs if (point.model.code, point.model.mesh, point.cells) == place]
    if known is None or not errors:
        return ""
    return f", while the error of the equilibrium model's P/2 on that mesh is {error_text(errors[0], known)}"


def error_text(error: float, known: Reference) -> str:
    """An error, with the uncertainty of the reference where that matters; not resolved, what it is at most."""
    if error <= known.floor:
        return f"at most {scientific(error + known.floor)}"
    return scientific(error) + ("" if error > RESOLVED * known.floor else f" ± {scientific(known.floor)}")


def _targets(rows: Errors, known: Reference) -> Iterator[Finding]:
    """The quickest model of each code for each error."""
    codes = [key for key in CODES if any(point.model.code == key for point, _ in rows)]
    for target in TARGETS if rows else ():
        if target <= known.floor:
            continue
        # with the uncertainty of the reference, or it would not be known to be reached
        reached = [point for point, _ in rows if lasting_error(rows, point) + known.floor <= target]
        start = f"An error of {scientific(target, 1)} at μ = {known.friction:g}"
        see = f"error-time-{slug(known.friction)}"
        if not reached:
            yield Finding(f"{start} is reached by no model on these meshes.", see)
            continue
        best = [_best(rows, [point for point in reached if point.model.code == key], _time) for key in codes]
        there = sorted((point for point in best if point is not None), key=_time)
        costs = [
            f"{named(point)}: {timed(point)}, {point.unknowns} unknowns" + ("" if sure else f" ({_UNCONFIRMED})")
            for point in there
            for sure in (confirmed(rows, point),)
        ]
        never = [CODES[key].name for key, point in zip(codes, best, strict=True) if point is None]
        rest = f"; {listing(never)}: on no mesh here" if never else ""
        yield Finding(f"{start} takes {'; '.join(costs)}{rest}.", see)


def _best(rows: Errors, candidates: Iterable[Point], key: Callable[[Point], float]) -> Point | None:
    """The best of them, those that a finer mesh confirms before all others."""
    return min(candidates, key=lambda point: (not confirmed(rows, point), key(point), _time(point)), default=None)


def _time(point: Point) -> float:
    return point.seconds or 0.0


def _with_errors(found: Sequence[Point], known: Reference) -> list[tuple[Point, float]]:
    """The points at one μ that have an error."""
    pairs = [(point, known.error(point)) for point in found if point.friction == known.friction]
    return [(point, error) for point, error in pairs if error is not None]


def lasting_error(rows: Errors, point: Point) -> float:
    """The largest error of a point's model on its mesh and on all with more cells that are solved.

    Forces of contact with friction may cross the right value: an error that a finer mesh contradicts is small by
    chance, and is not what the model is worth. Where no finer mesh is solved nothing is known of that, see `confirmed`.
    """
    return max(error for other, error in rows if other.model == point.model and other.cells >= point.cells)


def confirmed(rows: Errors, point: Point) -> bool:
    """Whether a finer mesh of the same model is solved, so that `lasting_error` could show chance."""
    return any(other.model == point.model and other.cells > point.cells for other, _ in rows)


def _failures(found: Sequence[Point]) -> Iterator[Finding]:
    """How many runs have a solution, and which have not."""
    failed = [point for point in found if not point.solved]
    without = []
    for name in dict.fromkeys(point.model.name for point in failed):
        here = [point for point in failed if point.model.name == name]
        places = [_places_of(here, friction) for friction in sorted({point.friction for point in here})]
        without.append(f"{name} ({'; '.join(places)})")
    text = f"Runs that end with a solution: {len(found) - len(failed)} of {len(found)}."
    yield Finding(f"{text} Without: {'; '.join(without)}." if without else text, "failures" if without else "")


def _places_of(failed: Sequence[Point], friction: float) -> str:
    """Meshes and status of a model's failures at one μ."""
    here = [point for point in failed if point.friction == friction]
    statuses = dict.fromkeys(point.status for point in here)
    meshes = (f"{each} on {listing([f'{p.cells}²' for p in here if p.status == each])}" for each in statuses)
    return f"μ = {friction:g}: {', '.join(meshes)}"


def _missing(found: Sequence[Point]) -> Iterator[Finding]:
    for key in missing(found):
        yield Finding(f"{CODES[key].name} is not installed and was not run: {CODES[key].remedy}.", "missing")


def _unknown(friction: float) -> list[Finding]:
    text = f"At μ = {friction:g} neither bounds nor a value that codes settle on are known: no errors are given."
    return [Finding(text)]


def _behaviour(rows: Errors, known: Reference) -> Iterator[Finding]:
    yield from _nearest(rows, known)
    yield from _orders(rows, known)
    yield from _sides(rows, known)


def _nearest(rows: Errors, known: Reference) -> Iterator[Finding]:
    """The model with the smallest error within each time; errors that are not resolved count alike."""

    def size(point: Point) -> float:
        return max(lasting_error(rows, point), known.floor)

    said = None
    parts = []
    for budget in BUDGETS:
        best = _best(rows, [point for point, _ in rows if _time(point) <= budget], size)
        if best is None or best is said:
            continue
        said = best
        parts.append(
            f"within {seconds(budget)} {named(best)}: {error_text(lasting_error(rows, best), known)}, {timed(best)}, "
            f"{best.unknowns} unknowns{'' if confirmed(rows, best) else f' ({_UNCONFIRMED})'}"
        )
    if parts:
        text = (
            f"The smallest errors at μ = {known.friction:g}, taken over the mesh and all finer ones of its model: "
            f"{'; '.join(parts)}."
        )
        yield Finding(text, f"error-time-{slug(known.friction)}")


def _orders(rows: Errors, known: Reference) -> Iterator[Finding]:
    """How fast errors fall on uniform meshes, between the coarsest and the finest; by code."""
    orders: dict[str, list[float]] = {}
    without: dict[str, int] = {}
    for model, here in _by_model(rows):
        if model.mesh != MESHES[0] or len(here) < 2:
            continue
        order = _order(here, known)
        if order is None:
            without[model.code] = without.get(model.code, 0) + 1
        else:
            orders.setdefault(model.code, []).append(order)
    if not orders and not without:
        return
    start = f"On uniform meshes at μ = {known.friction:g}, from the coarsest to the finest that is solved,"
    parts = [f"{_span(slopes)} for {_models(code, len(slopes))}" for code, slopes in orders.items()]
    text = f" errors fall like unknowns to the power of −p, p = {', '.join(parts)}" if parts else ""
    if without:
        some = listing([_models(code, number) for code, number in without.items()])
        reason = "their errors change side, grow, or come near what is resolved"
        text += f"{';' if parts else ''} no order can be given for {some}: {reason}"
    yield Finding(f"{start}{text}.", f"error-unknowns-{slug(known.friction)}")


def _order(here: Errors, known: Reference) -> float | None:
    """The order of one model; None where its errors change side, grow, or are not well above what is resolved."""
    pairs = sorted(here, key=lambda pair: pair[0].cells)
    errors = [error for _, error in pairs]
    clear = min(errors) > RESOLVED * known.floor and len({known.side(point) for point, _ in pairs}) == 1
    if not clear or errors != sorted(errors, reverse=True):
        return None
    first, last = ((point.unknowns or 0, error) for point, error in (pairs[0], pairs[-1]))
    slope = growth(first, last)
    return None if slope is None else -slope


def _span(values: Sequence[float]) -> str:
    """Smallest and largest to two decimals, once where they are the same."""
    return " to ".join(dict.fromkeys(f"{value:.2f}" for value in (min(values), max(values))))


def _models(code: str, number: int) -> str:
    """A code and how many of its models."""
    return f"{CODES[code].name} ({count_of(number, 'model')})"


def _by_model(rows: Errors) -> list[tuple[Model, Errors]]:
    """The rows of each model."""
    names = dict.fromkeys(point.model.name for point, _ in rows)
    return [(NAMED[name], [pair for pair in rows if pair[0].model.name == name]) for name in names]


_SIDES: Final = ("below on all meshes", "above on all meshes", "on both sides", "too close on some mesh to tell")


def _sides(rows: Errors, known: Reference) -> Iterator[Finding]:
    """On which side of the value the models of each code are, and where errors are small by chance."""
    counts: dict[str, list[int]] = {}
    crossing: dict[str, int] = {}
    for model, here in _by_model(rows):
        counts.setdefault(model.code, [0] * len(_SIDES))[_side(here, known)] += 1
        if any(lasting_error(here, point) > error + 2.0 * known.floor for point, error in here):
            crossing[model.code] = crossing.get(model.code, 0) + 1
    parts = []
    for code, numbers in counts.items():
        several = [f"{number} {side}" for number, side in zip(numbers, _SIDES, strict=True) if number]
        parts.append(f"{CODES[code].name}: {', '.join(several)}")
    if not parts:
        return
    text = f"Forces below or above the reference at μ = {known.friction:g}, number of models: {'; '.join(parts)}."
    if crossing:
        some = listing([_models(code, number) for code, number in crossing.items()])
        text += f" Some errors are smaller than on a finer mesh of the same model, that is by chance: {some}."
    yield Finding(text, f"rows-{slug(known.friction)}")


def _side(here: Errors, known: Reference) -> int:
    """Index in `_SIDES` of a model's forces."""
    sides = {known.side(point) for point, _ in here}
    if {-1, 1} <= sides:
        return 2
    return 3 if 0 in sides else 0 if sides == {-1} else 1
