"""The tables of the report."""

from collections.abc import Iterator
from itertools import pairwise

from comparisons.convergence.mesh.data import Mesh
from comparisons.convergence.mesh.errors import (
    ENERGY,
    FLAT,
    FORCE,
    SAME,
    STEADY,
    TRACTIONS,
    Curve,
    References,
    end_of,
    error_of,
)
from comparisons.convergence.mesh.overview import NAMES, SHOWN, TARGETS, Overview, cost, ends_of
from comparisons.convergence.mesh.problems import Problem
from comparisons.convergence.mesh.study import APART, BRACKET, COMPANION, GRADED, STRICT, UNIFORM
from comparisons.lab.report.numbers import percent, scientific, seconds, significant
from comparisons.lab.report.old import Table
from comparisons.lab.tables import Grid

_NOT_REACHED = "not reached"
_ORDERS = ("observed, last two", "observed, last three", "expected", "because", "verdict")


def slug(problem: Problem) -> str:
    """The problem's name as a word for links."""
    return problem.name.replace(" ", "-").replace(".", "_")


def references_table(overview: Overview) -> Table:
    """What errors are taken against."""
    rows = [row for problem in overview.problems for row in _reference_rows(problem, overview.references[problem.name])]
    headings = ("problem", "measure", "value", "relative uncertainty", "source")
    return Table(
        "references",
        Grid("What the meshes are compared with", headings, rows),
        "The uncertainty is relative to the value, for ends of zones to the length of the contact, for tractions to "
        "their L² norm. Errors below it are shown in brackets and are not used for orders.",
        "An uncertainty as large as the errors that are judged by it: then no order is given.",
    )


def _reference_rows(problem: Problem, known: References) -> Iterator[tuple[str, ...]]:
    for measure in known.measures:
        if measure == TRACTIONS:
            yield problem.name, measure, "a function", scientific(known.traction_uncertainty), known.traction_source
        else:
            value = known.values[measure]
            share = scientific(value.uncertainty / value.unit)
            yield problem.name, measure, significant(value.value, 9), share, value.source


def costs_table(overview: Overview) -> Table:
    """Unknowns needed for given errors of the force."""
    rows = []
    for problem in overview.problems:
        for target in TARGETS:
            costs = [_cost(overview, problem, sequence, target) for sequence in SHOWN]
            rows.append((problem.name, scientific(target, 1), *costs))
    headings = ("problem", "relative error of the force", *(f"unknowns, {NAMES[each]}" for each in SHOWN))
    return Table(
        "costs",
        Grid("Unknowns for a given error of the force", headings, rows),
        "The unknowns of the smallest mesh from which on all errors of the sequence stay within the target. Meshes of "
        f"a sequence are up to {significant(_spacing(overview), 2)} times apart in unknowns, and numbers are known to "
        "that factor. Those of adaptive sequences are of the mesh alone and leave out the solves before it. Targets "
        "below the reference's uncertainty have no entry.",
        f"“{_NOT_REACHED}”: the finest mesh of the sequence is still above.",
    )


def _spacing(overview: Overview) -> float | None:
    """The largest ratio of unknowns on two successive meshes of a sequence."""
    found = [
        after.unknowns / before.unknowns
        for curve in overview.curves
        if curve.measure == FORCE
        for before, after in pairwise(sorted(curve.meshes, key=lambda mesh: mesh.unknowns))
    ]
    return max(found, default=None)


def _cost(overview: Overview, problem: Problem, sequence: str, target: float) -> str:
    if target < overview.references[problem.name].least(FORCE):
        return ""
    curve = overview.curve_of(problem, FORCE, sequence)
    if curve is None:
        return ""
    found = cost(curve, target)
    return _NOT_REACHED if found is None else f"{found:.0f}"


def orders_table(overview: Overview) -> Table:
    """Observed beside expected orders."""
    rows = [
        (curve.problem.name, curve.measure, NAMES[curve.sequence], *_orders(curve))
        for curve in overview.curves
        if not overview.is_exact(curve.problem)
    ]
    return Table(
        "orders",
        Grid("Orders of convergence", ("problem", "measure", "meshes", *_ORDERS), rows),
        "p of error ~ hᵖ with h = (number of cells)^−½, which is the cells' side where they are equal. The second "
        "order is by least squares. Expected ones are those of the singularity on equal cells. For ends of zones the "
        f"position is the root described with the figures. “As expected” is within {percent(SAME)} of the expected "
        f"order; orders have settled if the last three are within {percent(STEADY)} of each other; where both "
        f"orders are {FLAT:g} or less the error does not fall.",
        "A verdict other than “as expected” where an order is expected: not in the asymptotic range, or not that "
        "order.",
    )


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


def meshes_table(overview: Overview, problem: Problem) -> Table:
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
    return Table(
        f"meshes-{slug(problem)}",
        Grid(f"{problem.title}: all meshes", headings, rows),
        "Errors are relative; those in brackets are below the reference's uncertainty. Ends of zones stand with the "
        "extrapolated value behind the root. Bounds of the energy [stress length²] are guaranteed for the problem, or "
        "indicators with the friction bound held fixed. The time is that of one solve, for adaptive meshes all that "
        "was spent up to it.",
        "A cell without a number where the column has them: that model was not run on so fine a mesh, or failed (see "
        "the table of failures), or the mesh shows other zones than the reference.",
    )


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


def failures_table(overview: Overview) -> Table:
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
    return Table(
        "failures",
        Grid("Failures", ("problem", "meshes", "cells", "model", "status", "message"), rows),
        "Every mesh on which a model gave no certified answer, or a bound of the energy could not be computed. Chains "
        "of adaptive meshes end there.",
        "Every line of it. “Bound missing” is what the theory allows: on coarse meshes no stress may obey the contact "
        "law on whole edges.",
    )


def _number(order: float | None) -> str:
    return "" if order is None else f"{round(order, 2) + 0.0:.2f}"
