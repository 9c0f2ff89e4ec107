"""What the meshes say, in sentences computed from them."""

from collections.abc import Iterator, Mapping

from comparisons.convergence.mesh.errors import ENERGY, FLOOR, FORCE, Curve, end_of
from comparisons.convergence.mesh.overview import NAMES, SHOWN, Overview, cost, ends_of, finest
from comparisons.convergence.mesh.problems import Problem
from comparisons.convergence.mesh.study import APART, BRACKET, COMPANION, GOAL, GRADED, STRICT, UNIFORM
from comparisons.convergence.mesh.tables import slug
from comparisons.lab.report.numbers import count_of, listing, scientific, significant
from comparisons.lab.report.old import Finding

_TARGET = 1e-4
_CLOSED = 1e-12  # relative gap
_ROUNDING = 1e-9  # relative: bounds beside a reference without uncertainty


def findings(overview: Overview) -> list[Finding]:
    """The sentences, the most important first."""
    return [
        *_costs(overview), *_orders(overview), *_bounds(overview), *_sides(overview), *_zones(overview),
        *_strict(overview), *_exact(overview), *_failures(overview),
    ]  # fmt: skip


def _costs(overview: Overview) -> Iterator[Finding]:
    """Unknowns for one error of the force, on equal cells and on the others."""
    adaptive = False
    for problem in overview.problems:
        if overview.is_exact(problem) or overview.references[problem.name].least(FORCE) > _TARGET:
            continue
        found = {
            sequence: curve for sequence in SHOWN if (curve := overview.curve_of(problem, FORCE, sequence)) is not None
        }
        if not found:
            continue
        costs = {sequence: cost(curve, _TARGET) for sequence, curve in found.items()}
        adaptive = adaptive or any(costs.get(sequence) is not None for sequence in (GOAL, APART))
        parts = [f"{NAMES[sequence]} {_needed(value)}" for sequence, value in costs.items()]
        text = f"{problem.title}: an error of {scientific(_TARGET, 1)} in the force takes {listing(parts)}"
        yield Finding(f"{text}{advantage(costs, found)}.", "costs")
    if adaptive:
        yield Finding("Unknowns of adaptive meshes are those of the last one; the solves before it are extra.", "costs")


def _needed(value: float | None) -> str:
    return "more unknowns than were tried" if value is None else f"{value:.0f} unknowns"


def advantage(costs: Mapping[str, float | None], curves: Mapping[str, Curve]) -> str:
    """How many times more unknowns equal cells take than the best of the others, as far as the meshes tell."""
    others = {sequence: value for sequence, value in costs.items() if sequence != UNIFORM and value is not None}
    if not others or UNIFORM not in costs:
        return ""
    uniform, best = costs[UNIFORM], min(others.values())
    if uniform is None:
        most = max(mesh.unknowns for mesh in curves[UNIFORM].meshes)
        return f"; equal cells do not reach it with {most}"
    before = _before(curves[UNIFORM], uniform)
    if before is None or before <= best:
        return ""
    least = [_before(curves[sequence], value) for sequence, value in others.items()]
    known = [value for value in least if value is not None]
    low = significant(before / best, 2)
    high = f" to {significant(uniform / min(known), 2)}" if len(known) == len(least) else " or more"
    return (
        f"; equal cells take {low}{high} times as many as the best of the others, which is all that meshes of these "
        "sizes tell"
    )


def _before(curve: Curve, unknowns: float) -> int | None:
    """The largest number of unknowns of the curve below this one."""
    return max((mesh.unknowns for mesh in curve.meshes if mesh.unknowns < unknowns), default=None)


def _orders(overview: Overview) -> Iterator[Finding]:
    """Observed beside expected orders on equal cells, one sentence for each problem."""
    for problem in overview.problems:
        curves = [
            curve
            for measure in overview.references[problem.name].measures
            if (curve := overview.curve_of(problem, measure, UNIFORM)) is not None and curve.expected is not None
        ]
        if curves:
            reasons = dict.fromkeys(curve.expected.reason for curve in curves if curve.expected is not None)
            orders = listing([_order(curve) for curve in curves])
            text = f"{problem.title}: observed orders on equal cells are {orders} [{'; '.join(reasons)}]."
            yield Finding(text + _not_reached(curves), "orders")


def _order(curve: Curve) -> str:
    assert curve.expected is not None
    found = "none" if curve.fitted is None else f"{curve.fitted:.2f}"
    return f"{found} for the {curve.measure} (expected {curve.expected.order:.3g})"


def _not_reached(curves: list[Curve]) -> str:
    """Which measures are not at their asymptotic order, and what they do instead."""
    parts = []
    for curve in curves:
        known = [f"{order:.2f}" for order in curve.orders if order is not None][-2:]
        if curve.fitted is None:
            parts.append(f"{curve.measure} (too few errors above the uncertainty)")
        elif curve.flat:
            parts.append(f"{curve.measure} (it does not fall, the last were {listing(known)})")
        elif not curve.as_expected and curve.settled:
            parts.append(f"{curve.measure} (settled on another one)")
        elif not curve.as_expected:
            parts.append(f"{curve.measure} (the last were {listing(known)})")
    return f" The asymptotic order is not reached for the {listing(parts)}." if parts else ""


def _bounds(overview: Overview) -> Iterator[Finding]:
    """Whether guaranteed bounds enclose the reference, and how close they get."""
    for problem in overview.problems:
        reference = overview.references[problem.name].values.get(ENERGY)
        meshes = [mesh for sequence in (UNIFORM, GRADED, APART) for mesh in overview.brackets(problem, sequence)]
        if reference is None or not meshes:
            continue
        slack = reference.uncertainty + _ROUNDING * reference.unit
        outside = [
            mesh
            for mesh in meshes
            if mesh.record["lower"] > reference.value + slack or mesh.record["upper"] < reference.value - slack
        ]
        best = min(meshes, key=lambda mesh: float(mesh.record["gap"]))
        enclosed = f"{len(meshes) - len(outside)} of {count_of(len(meshes), 'guaranteed bracket')} of the energy"
        one = len(meshes) - len(outside) == 1
        if reference.sequence:  # made of the same models: no proof of the brackets
            verb = f"{'is' if one else 'are'} consistent with the reference, which comes from the same models"
        else:
            verb = "encloses the reference" if one else "enclose the reference"
        gap = max(float(best.record["gap"]), 0.0) / reference.unit
        close = "up to rounding" if gap < _CLOSED else f"to {scientific(gap)} of it"
        where = f"on {best.cells} cells ({NAMES[best.sequence]})"
        yield Finding(f"{problem.title}: {enclosed} {verb}; the closest is closed {close} {where}.", "gaps")


def _sides(overview: Overview) -> Iterator[Finding]:
    """On which side of the reference stresses and displacements are on all equal meshes, and for which problems."""
    for name, model in (("Stresses", None), ("Displacements", COMPANION)):
        sides: dict[bool, list[str]] = {}
        for problem in overview.problems:
            above = _side(overview, problem, model)
            if above is not None and not overview.is_exact(problem):
                sides.setdefault(above, []).append(problem.name)
        for above, problems in sides.items():
            yield Finding(
                f"{name} give too {'large' if above else 'small'} a force on all equal meshes whose error is above the "
                f"reference's uncertainty, of {listing(problems)}."
            )


def _side(overview: Overview, problem: Problem, model: str | None) -> bool | None:
    """Whether all forces are larger than the reference; None if some are smaller, or all within its uncertainty."""
    reference = overview.references[problem.name].values.get(FORCE)
    if reference is None:
        return None
    least = reference.uncertainty + FLOOR * reference.unit
    signs = {
        abs(mesh.force) > abs(reference.value)
        for mesh in overview.data.of(problem, UNIFORM, model)
        if abs(mesh.force - reference.value) > least
    }
    return signs.pop() if len(signs) == 1 else None


def _zones(overview: Overview) -> Iterator[Finding]:
    """Where zones end, and how far off the finest equal cells are; one sentence for each problem."""
    for problem in overview.problems:
        parts = [_zone(overview, problem, kind) for kind in ends_of(overview.references[problem.name])]
        if parts:
            yield Finding(f"{problem.title}: {'; '.join(parts)}.", f"ends-{slug(problem)}")


def _zone(overview: Overview, problem: Problem, kind: str) -> str:
    place, unit = overview.references[problem.name].values[kind], problem.units[1]
    uncertain = f" ± {scientific(place.uncertainty)}" if place.uncertainty else " (exact)"
    text = f"{kind} at x = {significant(place.value, 4)}{uncertain} {unit}"
    curve = overview.curve_of(problem, kind, UNIFORM)
    if curve is None:
        return f"{text}, which no mesh of equal cells shows"
    missed = [mesh.cells for mesh in overview.data.of(problem, UNIFORM) if end_of(mesh, kind) is None]
    blind = f", and {listing(missed)} cells do not show it as it is" if missed else ""
    cells = f"{curve.meshes[-1].cells} equal cells"
    if place.sequence == UNIFORM:
        return f"{text}, a value that {cells} gave themselves{blind}"
    if not curve.meant[-1]:
        return f"{text}, {cells} are within that{blind}"
    return f"{text}, {cells} are {scientific(curve.errors[-1] * place.unit)} {unit} off{blind}"


def _strict(overview: Overview) -> Iterator[Finding]:
    """What the friction law on whole edges changes in the force, on the finest mesh with both."""
    parts = []
    for problem in overview.problems:
        strict = finest(overview.data.of(problem, UNIFORM, STRICT))
        same = [m for m in overview.data.of(problem, UNIFORM) if strict is not None and m.size == strict.size]
        if strict is None or not same or overview.is_exact(problem):
            continue
        change = (abs(strict.force) - abs(same[0].force)) / abs(same[0].force)
        sign = "+" if change > 0.0 else "−"
        said = "nothing" if abs(change) < _CLOSED else f"{sign}{scientific(abs(change))}"
        parts.append(f"{said} ({problem.name}, {strict.cells} cells)")
    if parts:
        yield Finding(
            f"The friction law on whole edges instead of at four points of each changes the force by {listing(parts)}."
        )


def _exact(overview: Overview) -> Iterator[Finding]:
    """Problems whose answer every mesh has."""
    for problem in filter(overview.is_exact, overview.problems):
        worst = max(error for curve in overview.curves_of(problem, FORCE) for error in curve.errors)
        yield Finding(
            f"{problem.title}: every mesh gives the force exactly, up to {scientific(worst)}.",
            f"meshes-{slug(problem)}",
        )


def _failures(overview: Overview) -> Iterator[Finding]:
    """How many meshes have a certified answer, and how many brackets both bounds."""
    failed, total = overview.data.failures, len(overview.data.meshes)
    where = dict.fromkeys(f"{mesh.problem.name} ({mesh.sequence}, {mesh.cells}, {mesh.model})" for mesh in failed)
    text = f"{total - len(failed)} of {count_of(total, 'solve')} ended with a certified answer"
    yield Finding(f"{text}; not so {listing(list(where))}." if failed else f"{text}.", "failures")
    tried = [mesh for mesh in overview.data.meshes if mesh.solved and mesh.model == BRACKET]
    missing = sum(mesh.record["gap"] is None for mesh in tried)
    if missing:
        yield Finding(
            f"{missing} of {count_of(len(tried), 'bracket')} {'lacks' if missing == 1 else 'lack'} a bound: see the "
            "reasons in the table.",
            "failures",
        )
