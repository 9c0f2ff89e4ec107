"""What the numbers of a run say, in sentences computed from them."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from comparisons.benchmark.ratios import growth
from comparisons.peers.models import CODES, EQUILIBRIUM, MESHES
from comparisons.peers.points import KINDS, Point, Reference, missing, named, reference
from comparisons.report import Finding
from comparisons.report.numbers import count_of, listing, scientific, seconds

BUDGETS: Final = (0.03, 0.1, 1.0, 10.0)
"""Seconds at which the nearest model is named."""

TARGETS: Final = (1e-4, 1e-5, 1e-6)
"""Relative errors of P/2 at which the codes are compared."""

_LONGEST: Final = 250  # of a failure's message


def slug(friction: float) -> str:
    """μ inside the name of a table or figure."""
    return f"mu-{friction:g}".replace(".", "_")


def findings(found: Sequence[Point]) -> list[Finding]:
    """The sentences: bounds, costs of errors, failures, then how the errors behave."""
    frictions = sorted({point.friction for point in found})
    known = {friction: reference(found, friction) for friction in frictions}
    parts: list[Iterable[Finding]] = [_bounds(found, known[friction], friction) for friction in frictions]
    parts += [_targets(found, each) for each in known.values() if each]
    parts += [_failures(found), _missing(found)]
    for friction, each in known.items():
        parts += [_behaviour(found, each)] if each else [_unknown(friction)]
    return [finding for part in parts for finding in part]


def _bounds(found: Sequence[Point], known: Reference | None, friction: float) -> Iterator[Finding]:
    """What brackets say at one μ: bounds of P, and who is outside; or an indicator, called so."""
    here = [point for point in found if point.friction == friction]
    brackets = [(point, point.bounds) for point in here if point.solved and point.bounds]
    sure = [(point, bounds.force) for point, bounds in brackets if bounds.force]
    if sure:
        point, (lower, upper) = min(sure, key=lambda pair: pair[1][1] - pair[1][0])
        yield Finding(
            f"At μ = {friction:g} P/2 is guaranteed to lie between {lower:.7f} and {upper:.7f} MPa × length, "
            f"{scientific(point.bounds.width if point.bounds else None)} either way ({named(point)}, "
            f"{seconds(point.seconds)}); {_peers_outside(here, lower, upper)}",
            f"bounds-{slug(friction)}",
        )
    elif brackets:
        point, bounds = min(brackets, key=lambda pair: pair[1].width)
        yield Finding(
            f"At μ = {friction:g} the contact slips and P has no guaranteed bounds: the bracket is an indicator, for "
            f"{KINDS[bounds.kind]}. It falls to {scientific(bounds.width)} of the energy either way ({named(point)})"
            + (f", while the error of P/2 on that mesh is {_beside(here, point, known)}." if known else "."),
            f"bounds-{slug(friction)}",
        )


def _peers_outside(here: Sequence[Point], lower: float, upper: float) -> str:
    """How many displacement codes' forces are proved to be off, without any reference."""
    forces = [point.half_force for point in here if CODES[point.model.code].remedy and point.solved]
    known = [force for force in forces if force is not None]
    if not known:
        return "no displacement code's force is there to be compared."
    outside = sum(not lower <= force <= upper for force in known)
    proved = "is" if outside == 1 else "are"
    return (
        f"the displacement codes give no bounds, and {outside} of their {count_of(len(known), 'force')} {proved} "
        "proved to be outside."
    )


def _beside(here: Sequence[Point], bracket: Point, known: Reference) -> str:
    """The error of the equilibrium model on the mesh of a bracket."""
    same = [p for p in here if p.model.code == EQUILIBRIUM and p.model.mesh == bracket.model.mesh]
    errors = [known.error(point) for point in same if point.cells == bracket.cells]
    return scientific(errors[0] if errors else None)


def _targets(found: Sequence[Point], known: Reference) -> Iterator[Finding]:
    """The quickest model of each code for each error."""
    rows = _with_errors(found, known)
    codes = [key for key in CODES if any(point.model.code == key for point, _ in rows)]
    for target in TARGETS if rows else ():
        if target <= known.floor:
            continue
        reached = [(point, error) for point, error in rows if lasting_error(rows, point) <= target]
        quickest = [
            min((point for point, _ in reached if point.model.code == key), key=_time, default=None) for key in codes
        ]
        start = f"An error of {scientific(target, 1)} at μ = {known.friction:g}"
        see = f"error-time-{slug(known.friction)}"
        if not reached:
            yield Finding(f"{start} is reached by no model on these meshes.", see)
            continue
        there = sorted((point for point in quickest if point is not None), key=_time)
        costs = [f"{named(point)}, {seconds(point.seconds)} and {point.unknowns} unknowns" for point in there]
        never = [CODES[key].name for key, point in zip(codes, quickest, strict=True) if point is None]
        rest = f"; {listing(never)}: on no mesh here" if never else ""
        yield Finding(f"{start} takes {'; '.join(costs)}{rest}.", see)


def _time(point: Point) -> float:
    return point.seconds or 0.0


def _with_errors(found: Sequence[Point], known: Reference) -> list[tuple[Point, float]]:
    """The points at one μ that have an error."""
    pairs = [(point, known.error(point)) for point in found if point.friction == known.friction]
    return [(point, error) for point, error in pairs if error is not None]


def lasting_error(rows: Sequence[tuple[Point, float]], point: Point) -> float:
    """The largest error of a point's model on its mesh and on all with more cells.

    Forces of contact with friction may cross the right value: an error that a finer mesh does not confirm is small by
    chance, and is not what the model is worth.
    """
    return max(error for other, error in rows if other.model == point.model and other.cells >= point.cells)


def _failures(found: Sequence[Point]) -> Iterator[Finding]:
    """How many runs have a solution, and which have not."""
    failed = [point for point in found if not point.solved]
    yield Finding(f"Runs that end with a solution: {len(found) - len(failed)} of {len(found)}.")
    for model in dict.fromkeys(point.model.name for point in failed):
        reasons: dict[str, list[str]] = {}
        for point in (point for point in failed if point.model.name == model):
            place = f"{point.cells}² at μ = {point.friction:g}"
            reasons.setdefault(f"{point.status}: {_short(point.message)}", []).append(place)
        where = "; ".join(f"{listing(places)} ({reason})" for reason, places in reasons.items())
        yield Finding(f"{model} fails on {where}.")


def _short(message: str) -> str:
    """A message cut where it gets long, without full stop."""
    return message.rstrip(".") if len(message) <= _LONGEST else f"{message[: _LONGEST - 1]}…"


def _missing(found: Sequence[Point]) -> Iterator[Finding]:
    for key in missing(found):
        yield Finding(f"{CODES[key].name} is not installed and was not run: {CODES[key].remedy}.", "missing")


def _unknown(friction: float) -> list[Finding]:
    text = f"At μ = {friction:g} neither bounds nor a value that codes settle on are known: no errors are given."
    return [Finding(text)]


def _behaviour(found: Sequence[Point], known: Reference) -> Iterator[Finding]:
    rows = _with_errors(found, known)
    yield from _nearest(rows, known)
    yield from _orders(rows, known)
    yield from _sides(rows, known)
    yield from _by_chance(rows, known)


def _nearest(rows: Sequence[tuple[Point, float]], known: Reference) -> Iterator[Finding]:
    """The model with the smallest error within each time; errors that are not resolved count alike."""
    said = None
    parts = []
    for budget in BUDGETS:
        within = [point for point, _ in rows if _time(point) <= budget]
        best = min(within, key=lambda p: (max(lasting_error(rows, p), known.floor), _time(p)), default=None)
        if best is None or best is said:
            continue
        said = best
        error = lasting_error(rows, best)
        small = f"not above the {scientific(known.floor)} that are resolved"
        parts.append(
            f"within {seconds(budget)} {named(best)} ({scientific(error) if error > known.floor else small}, "
            f"{seconds(best.seconds)}, {best.unknowns} unknowns)"
        )
    if parts:
        text = f"The smallest errors at μ = {known.friction:g}: {'; '.join(parts)}."
        yield Finding(text, f"error-time-{slug(known.friction)}")


def _orders(rows: Sequence[tuple[Point, float]], known: Reference) -> Iterator[Finding]:
    """How fast errors fall on uniform meshes, between the coarsest and the finest that are resolved."""
    slopes = []
    for name in dict.fromkeys(point.model.name for point, _ in rows if point.model.mesh == MESHES[0]):
        here = [(point, error) for point, error in rows if point.model.name == name and error > known.floor]
        if any(lasting_error(here, point) > error for point, error in here):
            continue  # it does not fall
        ends = [(point.unknowns or 0, error) for point, error in here]
        slope = growth(min(ends), max(ends)) if len(ends) > 1 else None
        if slope is not None:
            slopes.append(f"{-slope:.2f} ({name.removesuffix(', uniform')})")
    if slopes:
        text = f"On uniform meshes at μ = {known.friction:g} errors fall like unknowns to the power of −p"
        yield Finding(f"{text}, p = {', '.join(slopes)}.", f"error-unknowns-{slug(known.friction)}")


def _sides(rows: Sequence[tuple[Point, float]], known: Reference) -> Iterator[Finding]:
    """Which models stay on one side of the right value on all meshes."""
    sides: dict[str, list[str]] = {"below": [], "above": []}
    for name in dict.fromkeys(point.model.name for point, _ in rows):
        forces = [p.half_force or 0.0 for p, error in rows if p.model.name == name and error > known.floor]
        if forces and max(forces) < known.value:
            sides["below"].append(name)
        elif forces and min(forces) > known.value:
            sides["above"].append(name)
    for side, models in sides.items():
        if models:
            text = f"Always {side} the right value at μ = {known.friction:g}: {'; '.join(models)}."
            yield Finding(text, f"rows-{slug(known.friction)}")


def _by_chance(rows: Sequence[tuple[Point, float]], known: Reference) -> Iterator[Finding]:
    """The models whose errors grow somewhere as meshes get finer, beyond what is not resolved."""
    crossing = dict.fromkeys(p.model.name for p, error in rows if lasting_error(rows, p) > max(error, known.floor))
    if crossing:
        yield Finding(
            f"At μ = {known.friction:g} some errors of {'; '.join(crossing)} are smaller than on a finer mesh, that is "
            "by chance; above, an error counts as reached only if no finer mesh of the same model has a larger one.",
            f"rows-{slug(known.friction)}",
        )
