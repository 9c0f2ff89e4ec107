"""What the numbers of a run say: sentences written here, with the numbers filled in."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final

from comparisons.lab.report.numbers import count_of, listing, scientific, seconds, significant
from comparisons.lab.report.old import Finding
from comparisons.peers.models import CODES, EQUILIBRIUM, TRIANGLES
from comparisons.peers.points import (
    RESOLUTION,
    Point,
    Reference,
    contradictory,
    guaranteed,
    missing,
    named,
    reference,
)
from comparisons.peers.reach import (
    Comparison,
    Reach,
    all_reached,
    comparison,
    confirmed,
    errors_at,
    lasting_error,
)

_SPOKEN: Final = (3e-6, 1e-6, 1e-8)
"""Errors whose cost is told in a sentence; the table has all of `reach.TARGETS`."""

RESOLVED: Final = 5.0
"""The uncertainty of the reference is told beside errors that are not larger than so many times as much."""


def slug(friction: float) -> str:
    """μ inside the name of a table or figure."""
    return f"mu-{friction:g}".replace(".", "_")


def findings(found: Sequence[Point]) -> list[Finding]:
    """The sentences: costs, what the element on rectangles reaches, bounds, failures and codes that are missing."""
    frictions = list(dict.fromkeys(point.friction for point in found))
    references = {friction: reference(found, friction) for friction in frictions}
    known = {friction: each for friction, each in references.items() if each is not None}
    sure = [friction for friction in frictions if guaranteed(found, friction)]
    parts: list[Iterable[Finding]] = [_costs(found, each) for each in known.values()]
    parts += [_rectangles(found, known)]
    parts += [_bounds(found, friction) for friction in sure]
    parts += [_unknown(friction) for friction in frictions if friction not in known]
    parts += [_failures(found), _missing(found)]
    return [finding for part in parts for finding in part]


def _costs(found: Sequence[Point], known: Reference) -> Iterator[Finding]:
    """What errors cost on triangles and by the best other code."""
    reaches = all_reached(errors_at(found, known), known)
    compared = [each for target in _SPOKEN if (each := comparison(reaches, target))]
    see = f"costs-{slug(known.friction)}"
    if compared:
        counted = "Unknowns inside cells are counted for other codes only, see the limitations."
        yield Finding(f"At μ = {known.friction:g} {'; '.join(map(_beside, compared))}. {counted}", see)
    elif reaches:
        yield Finding(_best_so_far(reaches, known), see)


def _beside(found: Comparison) -> str:
    own, other = found.own, found.quickest
    return (
        f"an error of {scientific(own.target, 1)} takes {seconds(own.quickest.seconds)} on triangles and "
        f"{seconds(other.seconds)} with {CODES[other.model.code].name}, {significant(found.time, 2)} times as long, "
        f"and {own.smallest.unknowns} unknowns beside {found.smallest.unknowns}"
    )


def _best_so_far(reaches: Sequence[Reach], known: Reference) -> str:
    """The smallest error reached by each code, where triangles and others cannot be compared."""
    least = {each.code: each for each in sorted(reaches, key=lambda each: -each.target)}
    parts = [
        f"{CODES[code].name} {scientific(each.target, 1)} in {seconds(each.quickest.seconds)}"
        for code, each in least.items()
    ]
    return f"At μ = {known.friction:g} the smallest error asked for that is reached: {'; '.join(parts)}."


def _rectangles(found: Sequence[Point], known: Mapping[float, Reference]) -> Iterator[Finding]:
    """The smallest errors on rectangles and on triangles."""
    parts = []
    for friction, each in known.items():
        best = [_least(errors_at(found, each), code) for code in (EQUILIBRIUM, TRIANGLES)]
        rectangles, triangles = best
        if rectangles is None or triangles is None:
            continue
        parts.append(
            f"{error_text(rectangles[1], each)} with {rectangles[0].unknowns} unknowns at μ = {friction:g} "
            f"(triangles: {error_text(triangles[1], each)} with {triangles[0].unknowns})"
        )
    if parts:
        yield Finding(
            "On rectangles, whose element has no shear stress in a free corner, the smallest error of this package is "
            f"{'; '.join(parts)}.",
            f"best-unknowns-{slug(next(iter(known)))}",
        )


def _least(rows: Sequence[tuple[Point, float]], code: str) -> tuple[Point, float] | None:
    """The point of a code with the smallest lasting error that a finer mesh confirms."""
    own = [(point, lasting_error(rows, point)) for point, _ in rows if point.model.code == code]
    return min(((p, e) for p, e in own if confirmed(rows, p)), key=lambda pair: pair[1], default=None)


def _bounds(found: Sequence[Point], friction: float) -> Iterator[Finding]:
    """The guaranteed bounds of P/2 at one μ; or that the bounds are wrong."""
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
        f"{scientific((upper - lower) / abs(upper + lower))} either way, by {named(point)} in {seconds(point.seconds)}"
        f". This includes {scientific(RESOLUTION, 1)} on either side for the tolerance of the solves. The other codes "
        "give a force without bounds.",
        see,
    )


def error_text(error: float, known: Reference) -> str:
    """An error, with the uncertainty of the reference where that matters; not resolved, what it is at most."""
    if error <= known.floor:
        return f"at most {scientific(error + known.floor)}"
    return scientific(error) + ("" if error > RESOLVED * known.floor else f" ± {scientific(known.floor)}")


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
    labels = {each: [p.model.family.label(p.number) for p in here if p.status == each] for each in statuses}
    return f"μ = {friction:g}: {', '.join(f'{each} on {listing(meshes)}' for each, meshes in labels.items())}"


def _missing(found: Sequence[Point]) -> Iterator[Finding]:
    for key in missing(found):
        yield Finding(f"{CODES[key].name} is not installed and was not run: {CODES[key].remedy}.", "missing")


def _unknown(friction: float) -> list[Finding]:
    return [Finding(f"At μ = {friction:g} no value of P/2 is known from elsewhere: no errors are given.")]
