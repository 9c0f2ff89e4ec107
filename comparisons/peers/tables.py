"""Tables of a run."""

from collections.abc import Sequence

from comparisons.benchmark.ratios import median, ratio
from comparisons.benchmark.reference import CONVERGED_FRICTION, PEERS
from comparisons.lab.report.numbers import listing, percent, scientific, significant
from comparisons.lab.report.old import Table
from comparisons.lab.tables import Grid
from comparisons.peers.findings import slug
from comparisons.peers.meshes import FAMILIES
from comparisons.peers.meshes import ratio as shrinking
from comparisons.peers.models import BRACKET, CODES, MODELS, TRIANGLES
from comparisons.peers.points import KINDS, Point, Reference, missing, named
from comparisons.peers.reach import Reach, all_reached, confirmed, errors_at

_NOTHING = "-"
_MIB = 2.0**20
_READING = (
    "Times are processor times of set-up and solve together on one thread, the smallest over the runs of one process, "
    "after a tiny case that loads all libraries (spread: largest less smallest over the median). Memory: the largest "
    "resident memory of the process after its first solve; what its libraries take is in the table of models."
)


def costs_table(found: Sequence[Point], known: Reference) -> Table | None:
    """Time and unknowns of each code to reach an error, and how they compare; None if no error is reached."""
    rows_with_errors = errors_at(found, known)
    reaches = all_reached(rows_with_errors, known)
    own = {each.target: each for each in reaches if each.code == TRIANGLES}
    headings = ("error [-]", "code", "time [ms]", "over triangles", "by", "fewest unknowns", "over triangles", "by")
    rows = [
        (
            scientific(each.target, 1), CODES[each.code].name,
            *_reach(each.quickest, _milliseconds(each.quickest), each.quickest.seconds, own.get(each.target), 0),
            *_reach(each.smallest, str(each.smallest.unknowns), each.smallest.unknowns, own.get(each.target), 1),
        )
        for each in reaches
    ]  # fmt: skip
    unconfirmed = sorted({
        named(point) for each in reaches for point in each[2:] if not confirmed(rows_with_errors, point)
    })  # fmt: skip
    rest = f" Not confirmed by a finer mesh: {listing(unconfirmed)}." if unconfirmed else ""
    return Table(
        f"costs-{slug(known.friction)}",
        Grid(f"Time and unknowns to reach an error of P/2, μ = {known.friction:g}", headings, rows),
        "For each error the quickest model of each code, and the one with the fewest unknowns. An error counts for a "
        "mesh only if no finer mesh of the same model has a larger one, and the uncertainty of the reference counts "
        "against it. Unknowns are as each code counts them: NGSolve's include those inside cells, which it condenses, "
        "those on triangles do not. Over triangles: divided by the same of this package on triangles, so that a number "
        f"above 1 says that the code needs more.{rest}",
        "A code without a line reaches the error on no mesh here.",
    ) if rows else None  # fmt: skip


def _reach(point: Point, text: str, cost: float | None, own: Reach | None, which: int) -> tuple[str, str, str]:
    """A cost, its ratio to that of the triangles, model and mesh."""
    least = None if own is None else (own.quickest.seconds, own.smallest.unknowns)[which]
    relative = ratio(cost, least)
    return text, _NOTHING if relative is None else significant(relative, 2), named(point)


def _milliseconds(point: Point) -> str:
    return _NOTHING if point.seconds is None else significant(1e3 * point.seconds)


def rows_table(found: Sequence[Point], known: Reference | None, friction: float) -> Table:
    """Every model that gives a force, on every mesh, at one μ."""
    headings = ("model", "mesh", "unknowns", "status", "P/2 [MPa × length]", "error [-]", "set-up [s]", "time [s]",
                "spread", "memory [MiB]", "residual [-]")  # fmt: skip
    rows = [
        (
            p.model.name, _mesh(p), _number(p.unknowns, "d"), p.status, _number(p.half_force, ".7f"),
            _error(p, known), _seconds(min(p.setup, default=None)), *_costs(p), _number(p.residual, ".0e"),
        )
        for p in found
        if p.friction == friction and p.model.code != BRACKET
    ]  # fmt: skip
    return Table(
        f"rows-{slug(friction)}",
        Grid(f"All runs at μ = {friction:g}", headings, rows),
        f"{_errors(known)} {_READING} Displacement codes assemble in every Newton step, so that the whole time is to "
        "be compared.",
        "A status other than solved; such a row has no error. Residuals are those of each code's own check and cannot "
        "be compared between codes.",
    )


def bounds_table(found: Sequence[Point], friction: float) -> Table:
    """What brackets say at one μ."""
    headings = ("bracket", "mesh", "unknowns", "status", "lower P/2 [MPa × length]", "upper P/2 [MPa × length]",
                "half width [-]", "stress error [-]", "guaranteed", "time [s]", "spread", "memory [MiB]")  # fmt: skip
    rows = [
        (p.model.name, _mesh(p), _number(p.unknowns, "d"), p.status, *_bounds(p), *_costs(p))
        for p in found
        if p.friction == friction and p.model.code == BRACKET
    ]
    kinds = dict.fromkeys(KINDS[p.bounds.kind] for p in found if p.friction == friction and p.bounds)
    return Table(
        f"brackets-{slug(friction)}",
        Grid(f"Brackets at μ = {friction:g}", headings, rows),
        f"What is bracketed: {listing(list(kinds))}. The half width is half the difference of the two energies over "
        "their mean, and of P/2 where P has bounds. The stress error bounds that of the stresses, in the energy norm "
        "and relative. Guaranteed: up to rounding and the tolerance of the solves, 1e-8; where it says no, the numbers "
        f"are an indicator. {_READING} The solve of the equilibrium model is in them; unknowns are those of stress and "
        "displacement.",
        "A lower bound above the upper one, or a status other than solved.",
    )


def failures_table(found: Sequence[Point]) -> Table | None:
    """Every run without a solution and why; None if all have one."""
    failed = [point for point in found if not point.solved]
    rows = [(p.model.name, f"{p.friction:g}", _mesh(p), p.status, p.message or _NOTHING) for p in failed]
    return Table(
        "failures",
        Grid("Runs without a solution", ("model", "μ", "mesh", "status", "message"), rows),
        "What the code, its process or this report says of each. Inverted: the code gives bounds, the lower one above "
        "the upper one by more than rounding and the tolerance of the solves.",
        "Every line.",
    ) if rows else None  # fmt: skip


def missing_table(found: Sequence[Point]) -> Table:
    """Codes that are not installed."""
    rows = [(CODES[key].name, CODES[key].remedy) for key in missing(found)]
    reading = "The command that gets each code; the same run then needs another store."
    return Table("missing", Grid("Not installed, not run", ("code", "how to get it"), rows), reading)


def reported_table(found: Sequence[Point], known: Reference | None) -> Table | None:
    """What codes that are not in this run reported on another day; None without such codes."""
    names = {CODES[point.model.code].name for point in found}
    rows = [
        (peer.code, f"{peer.half_force:.5f}", scientific(abs(peer.half_force / known.value - 1.0)), f"{peer.seconds:g}")
        for peer in PEERS
        if known and known.friction == CONVERGED_FRICTION and peer.code.split(",")[0] not in names
    ]
    headings = ("code", "P/2 [MPa × length]", "error [-]", "reported time [s]")
    reading = (
        f"At μ = {CONVERGED_FRICTION:g}. Measured once on another day, the solve alone; not part of this run, and "
        "times not to be compared with those above."
    )
    return Table("reported", Grid("Reported, not run here", headings, rows), reading) if rows else None


def models_grid(found: Sequence[Point]) -> Grid:
    """How each model was set up, and the memory of its process before a case."""
    rows = []
    for model in MODELS:
        here = [point for point in found if point.model == model]
        said = {point.version for point in here if point.version} or {_NOTHING}
        before = median([point.before for point in here if point.before is not None])
        if here:
            options = ", ".join(f"{name} = {value}" for name, value in model.options.items()) or _NOTHING
            rows.append((model.name, CODES[model.code].name, ", ".join(sorted(said)), options, _mebibytes(before)))
    headings = ("model", "code", "version, as it says", "options", "memory with its libraries [MiB]")
    return Grid("Models", headings, rows)


def meshes_grid(found: Sequence[Point]) -> Grid:
    """What the families of meshes are."""
    used = {point.model.mesh for point in found}
    rows = [(name, family.reading, _numbers(found, name)) for name, family in FAMILIES.items() if name in used]
    return Grid("Meshes", ("family", "what it is", "cells a side, or levels"), rows)


def _numbers(found: Sequence[Point], family: str) -> str:
    numbers = sorted({point.number for point in found if point.model.mesh == family})
    if family == "graded":
        return listing([f"{number} (each cell {shrinking(number):g} of the one before it)" for number in numbers])
    return listing([str(number) for number in numbers])


def references_grid(references: Sequence[Reference]) -> Grid:
    """The values that errors are relative to."""
    rows = [
        (f"{each.friction:g}", f"{each.value:.7f}", scientific(each.uncertainty), scientific(each.floor), each.source)
        for each in references
    ]
    headings = ("μ", "P/2 [MPa × length]", "±", "smallest error resolved [-]", "from")
    return Grid("Values that errors are relative to", headings, rows)


def _mesh(point: Point) -> str:
    return point.model.family.label(point.number)


def _errors(known: Reference | None) -> str:
    if known is None:
        return "No value is known that errors could be relative to."
    return (
        f"Errors are relative to {known.value:.7f} ± {scientific(known.uncertainty)}, {known.source}: below "
        f"{scientific(known.floor)} nothing is resolved. There the table says what an error is at most, with this "
        "uncertainty (≤)."
    )


def _error(point: Point, known: Reference | None) -> str:
    value = known.error(point) if known else None
    if value is None or known is None:
        return _NOTHING
    return scientific(value) if value > known.floor else f"≤ {scientific(value + known.floor)}"


def _bounds(point: Point) -> tuple[str, ...]:
    found = point.bounds
    if found is None:
        return (_NOTHING,) * 5
    return (
        _number(found.lower, ".7f"), _number(found.upper, ".7f"), scientific(found.width),
        scientific(found.strain_error), "yes" if found.guaranteed else "no",
    )  # fmt: skip


def _costs(point: Point) -> tuple[str, ...]:
    """Time, spread, memory."""
    return _seconds(point.seconds), _NOTHING if point.spread is None else percent(point.spread), _mebibytes(point.peak)


def _seconds(value: float | None) -> str:
    return _NOTHING if value is None else significant(value)


def _number(value: float | None, form: str) -> str:
    return _NOTHING if value is None else format(value, form)


def _mebibytes(value: float | None) -> str:
    return _number(None if value is None else value / _MIB, ".0f")
