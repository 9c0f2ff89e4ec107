"""The tables of the report."""

from collections.abc import Iterator
from itertools import pairwise

from comparisons.convergence.mesh.data import Mesh
from comparisons.convergence.mesh.errors import (
    ENERGY,
    FORCE,
    TRACTIONS,
    Curve,
    References,
    end_of,
    error_of,
)
from comparisons.convergence.mesh.measures import CLOSED, advantage, changes_of, enclosing, force_curves, side_of
from comparisons.convergence.mesh.overview import NAMES, SHOWN, TARGETS, Overview, cost, ends_of, slug
from comparisons.convergence.mesh.problems import Problem
from comparisons.convergence.mesh.study import APART, BRACKET, COMPANION, GRADED, STRICT, UNIFORM
from comparisons.lab.report.numbers import NOTHING, scientific, seconds, significant
from comparisons.lab.tables import Grid

_NOT_REACHED = "not reached"
_ORDERS = ("observed, last two", "observed, last three", "expected", "because", "verdict")


def tables_of(overview: Overview) -> dict[str, Grid]:
    """The tables by name."""
    return {
        "costs": costs_table(overview), "orders": orders_table(overview), "brackets": brackets_table(overview),
        "models": models_table(overview), "zones": zones_table(overview), "references": references_table(overview),
        "failures": failures_table(overview),
        **{f"meshes-{slug(problem)}": meshes_table(overview, problem) for problem in overview.problems},
    }  # fmt: skip


def references_table(overview: Overview) -> Grid:
    """What errors are taken against."""
    rows = [row for problem in overview.problems for row in _reference_rows(problem, overview.references[problem.name])]
    headings = ("problem", "measure", "value", "relative uncertainty", "source")
    return Grid("", headings, rows)


def _reference_rows(problem: Problem, known: References) -> Iterator[tuple[str, ...]]:
    for measure in known.measures:
        if measure == TRACTIONS:
            yield problem.name, measure, "a function", scientific(known.traction_uncertainty), known.traction_source
        else:
            value = known.values[measure]
            share = scientific(value.uncertainty / value.unit)
            yield problem.name, measure, significant(value.value, 9), share, value.source


def costs_table(overview: Overview) -> Grid:
    """Unknowns needed for given errors of the force."""
    rows = []
    for problem in overview.problems:
        for target in TARGETS:
            costs = [_cost(overview, problem, sequence, target) for sequence in SHOWN]
            rows.append((problem.name, scientific(target, 1), *costs, _advantage(overview, problem, target)))
    shown = (f"unknowns, {NAMES[each]}" for each in SHOWN)
    headings = ("problem", "relative error of the force", *shown, "equal cells over the best of the others")
    return Grid("", headings, rows)


def spacing(overview: Overview) -> float | None:
    """The largest ratio of unknowns on two successive meshes of a sequence."""
    found = [
        after.unknowns / before.unknowns
        for curve in overview.curves
        if curve.measure == FORCE
        for before, after in pairwise(sorted(curve.meshes, key=lambda mesh: mesh.unknowns))
    ]
    return max(found, default=None)


def _advantage(overview: Overview, problem: Problem, target: float) -> str:
    low, high = advantage(force_curves(overview, problem), target)
    if low is None or target < overview.references[problem.name].least(FORCE):
        return ""
    return f"> {significant(low, 2)}" if high is None else f"{significant(low, 2)} to {significant(high, 2)}"


def _cost(overview: Overview, problem: Problem, sequence: str, target: float) -> str:
    if target < overview.references[problem.name].least(FORCE):
        return ""
    curve = overview.curve_of(problem, FORCE, sequence)
    if curve is None:
        return ""
    found = cost(curve, target)
    return _NOT_REACHED if found is None else f"{found:.0f}"


def orders_table(overview: Overview) -> Grid:
    """Observed beside expected orders."""
    rows = [
        (curve.problem.name, curve.measure, NAMES[curve.sequence], *_orders(curve))
        for curve in overview.curves
        if not overview.is_exact(curve.problem)
    ]
    return Grid("", ("problem", "measure", "meshes", *_ORDERS), rows)


def _orders(curve: Curve) -> tuple[str, ...]:
    expected = curve.expected
    order, reason = ("", "") if expected is None else (f"{expected.order:.3g}", expected.reason)
    return _number(curve.last_order), _number(curve.fitted), order, reason, verdict(curve)


def verdict(curve: Curve) -> str:
    """What the orders of a curve are worth."""
    if curve.fitted is None:
        return "too few points for an order"
    if curve.flat:
        return "does not fall"
    if curve.as_expected:
        return "as expected"
    if not curve.settled:
        return "orders still change"
    return "settled" if curve.expected is None else "settled on another order"


def brackets_table(overview: Overview) -> Grid:
    """Whether guaranteed bounds enclose the reference, and how close they get."""
    rows = []
    for problem in overview.problems:
        for found in enclosing(overview, problem):
            gap = "closed" if found.gap < CLOSED else scientific(found.gap)
            where = f"{found.best.cells} cells, {NAMES[found.best.sequence]}"
            source = "these models" if found.own else "elsewhere"
            rows.append((problem.name, str(found.number), str(found.inside), source, gap, where))
    headings = (
        "problem",
        "guaranteed brackets",
        "enclose the reference",
        "which is from",
        "closest, relative gap",
        "on",
    )
    return Grid("", headings, rows)


def models_table(overview: Overview) -> Grid:
    """On which side of the reference both models are, and what the law on whole edges changes."""
    rows = []
    words = {None: NOTHING, True: "too large", False: "too small"}
    changes = changes_of(overview)
    for problem in overview.problems:
        cells, change = changes.get(problem.name, ("", None))
        shown = "" if change is None else "0" if abs(change) < CLOSED else f"{scientific(change)}"
        sides = [words[side_of(overview, problem, model)] for model in (None, COMPANION)]
        rows.append((problem.name, *sides, shown, cells))
    headings = (
        "problem",
        "force by stresses",
        "force by displacements",
        "law on whole edges changes the force by",
        "on",
    )
    return Grid("", headings, rows)


def zones_table(overview: Overview) -> Grid:
    """Where zones end, and how far off the finest equal cells are."""
    rows = [
        (problem.name, kind, *_zone(overview, problem, kind))
        for problem in overview.problems
        for kind in ends_of(overview.references[problem.name])
    ]
    headings = ("problem", "end", "at x", "uncertainty", "unit", "finest equal cells", "are off by", "not shown on")
    return Grid("", headings, rows)


def _zone(overview: Overview, problem: Problem, kind: str) -> tuple[str, ...]:
    place, unit = overview.references[problem.name].values[kind], problem.units[1]
    known = (significant(place.value, 4), scientific(place.uncertainty) if place.uncertainty else "exact", unit)
    curve = overview.curve_of(problem, kind, UNIFORM)
    if curve is None:
        return (*known, NOTHING, "", "all")
    missed = [mesh.cells for mesh in overview.data.of(problem, UNIFORM) if end_of(mesh, kind) is None]
    off = scientific(curve.errors[-1] * place.unit) if curve.meant[-1] else "within the uncertainty"
    own = "gave the value" if place.sequence == UNIFORM else off
    return (*known, curve.meshes[-1].cells, own, ", ".join(missed))


def meshes_table(overview: Overview, problem: Problem) -> Grid:
    """Every mesh of a problem."""
    known = overview.references[problem.name]
    ends = ends_of(known)
    rows = [
        _mesh_row(overview, known, sequence, mesh, ends)
        for sequence in SHOWN
        for mesh in overview.data.of(problem, sequence)
    ]
    stress, length = problem.units
    headings = (
        "meshes", "cells", "unknowns", f"force [{stress} {length}]", "its error", "energy error", "tractions' error",
        *(f"{end} at [{length}]" for end in ends), "force, law on whole edges", "force by displacements",
        "lower energy", "upper energy", "bounds", "time",
    )  # fmt: skip
    return Grid("", headings, rows)


def _mesh_row(overview: Overview, known: References, sequence: str, mesh: Mesh, ends: list[str]) -> tuple[str, ...]:
    others = {model: _same_mesh(overview, mesh, model) for model in (STRICT, COMPANION, BRACKET)}
    strict, companion, bounded = others[STRICT], others[COMPANION], others[BRACKET]
    bounds = ("", "", "") if bounded is None else _bounds(bounded)
    return (
        NAMES[sequence], mesh.cells, str(mesh.unknowns), significant(mesh.force, 9),
        *(_error(mesh, measure, known) for measure in (FORCE, ENERGY, TRACTIONS)), *(_end(mesh, end) for end in ends),
        "" if strict is None else significant(strict.force, 9),
        "" if companion is None else significant(companion.force, 9), *bounds, seconds(mesh.record["seconds"]),
    )  # fmt: skip


def _same_mesh(overview: Overview, mesh: Mesh, model: str) -> Mesh | None:
    """What another model gave on the same mesh."""
    if mesh.sequence == APART:
        return mesh if model == BRACKET else None
    if mesh.sequence not in (UNIFORM, GRADED):
        return None
    found = overview.data.of(mesh.problem, mesh.sequence, model)
    return next((other for other in found if other.size == mesh.size), None)


def _bounds(mesh: Mesh) -> tuple[str, str, str]:
    kind = "guaranteed" if mesh.record["guaranteed"] else "indicator"
    if mesh.record["gap"] is None:
        kind = "one is missing"
    values = (mesh.record[end] for end in ("lower", "upper"))
    lower, upper = ("" if value is None else significant(value, 9) for value in values)
    return lower, upper, kind


def _error(mesh: Mesh, measure: str, known: References) -> str:
    if measure not in known.measures:
        return ""
    error = error_of(mesh, measure, known)
    if error is None:
        return ""
    return scientific(error) if error > known.least(measure) else f"({scientific(error)})"


def _end(mesh: Mesh, kind: str) -> str:
    end = end_of(mesh, kind)
    if end is None:
        return ""
    other = "" if end["extrapolated"] is None else f"; {significant(end['extrapolated'], 4)}"
    return f"{significant(end['position'], 4)}{other}"


def failures_table(overview: Overview) -> Grid:
    """Meshes without a certified answer, and bounds that are missing."""
    rows = [
        (mesh.problem.name, mesh.sequence, mesh.cells, mesh.model, mesh.status, mesh.message)
        for mesh in overview.data.failures
    ]
    rows += [
        (mesh.problem.name, mesh.sequence, mesh.cells, mesh.model, "bound missing", " ".join(mesh.record["reasons"]))
        for mesh in overview.data.meshes
        if mesh.solved and mesh.model == BRACKET and mesh.record["gap"] is None
    ]
    return Grid("", ("problem", "meshes", "cells", "model", "status", "message"), rows)


def _number(order: float | None) -> str:
    return "" if order is None else f"{round(order, 2) + 0.0:.2f}"
