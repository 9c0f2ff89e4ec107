"""The numbers of the report's sentences, from the curves of a study."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

from comparisons.convergence.mesh.data import Mesh
from comparisons.convergence.mesh.errors import ENERGY, FLOOR, FORCE, Curve
from comparisons.convergence.mesh.overview import Overview, cost, finest, slug
from comparisons.convergence.mesh.problems import Problem
from comparisons.convergence.mesh.study import APART, BRACKET, GRADED, STRICT, UNIFORM
from comparisons.lab.report.numbers import NOTHING, significant

TARGET: Final = 1e-4
"""Relative error of the force whose cost is told in a sentence."""

CLOSED: Final = 1e-12
"""A smaller relative gap or change is rounding."""

_ROUNDING: Final = 1e-9  # relative: bounds beside a reference without uncertainty


class Enclosing(NamedTuple):
    """Guaranteed brackets of a problem beside its reference: how many, how many enclose it, which is the closest.

    The relative gap is that of the closest; `own`: the reference comes from the same models, which proves nothing.
    """

    number: int
    inside: int
    best: Mesh
    gap: float
    own: bool


def values_of(overview: Overview) -> dict[str, Any]:
    """Name → number."""
    data = overview.data
    tried = [mesh for mesh in data.meshes if mesh.solved and mesh.model == BRACKET]
    changes = {name: change for name, (_, change) in changes_of(overview).items()}
    largest = max(changes, key=lambda name: abs(changes[name]), default=None)
    return {
        "target": TARGET, "problems": [_problem(overview, problem) for problem in overview.problems],
        "solves": len(data.meshes), "certified": len(data.meshes) - len(data.failures), "brackets": len(tried),
        "open": sum(mesh.record["gap"] is None for mesh in tried), "change_at": largest,
        "change": None if largest is None else abs(changes[largest]),
        "exact": [problem.title for problem in overview.problems if overview.is_exact(problem)],
        **_of_costs(overview), **_of_orders(overview), **_of_brackets(overview),
    }  # fmt: skip


def _problem(overview: Overview, problem: Problem) -> dict[str, Any]:
    """What the template needs for a problem's section."""
    known = overview.references[problem.name]
    ends = [measure for measure in known.measures if measure not in (FORCE, ENERGY, "tractions")]
    return {
        "title": problem.title, "slug": slug(problem), "tractions": "tractions" in known.measures, "ends": bool(ends)
    }  # fmt: skip


def _of_costs(overview: Overview) -> dict[str, Any]:
    """Unknowns for one error of the force: of the best meshes, and how many times more equal cells take."""
    judged = [
        problem for problem in overview.problems
        if not overview.is_exact(problem) and overview.references[problem.name].least(FORCE) <= TARGET
    ]  # fmt: skip
    best = [value for problem in judged if (value := _best(force_curves(overview, problem), TARGET)) is not None]
    found = [advantage(force_curves(overview, problem), TARGET) for problem in judged]
    both = [pair for pair in found if pair[0] is not None]
    curves = [overview.curve_of(problem, FORCE, UNIFORM) for problem in judged]
    missed = [curve for curve in curves if curve is not None and cost(curve, TARGET) is None]
    return {
        "judged": len(judged), "best": span(best), "missed": len(missed),
        "saved": span([end for pair in both for end in pair if end is not None]),
    }  # fmt: skip


def force_curves(overview: Overview, problem: Problem) -> dict[str, Curve]:
    """Sequence → errors of the force."""
    return {curve.sequence: curve for curve in overview.curves_of(problem, FORCE)}


def _best(curves: Mapping[str, Curve], target: float) -> float | None:
    """Unknowns of the best of the meshes that are not of equal cells."""
    costs = (cost(curve, target) for sequence, curve in curves.items() if sequence != UNIFORM)
    return min((value for value in costs if value is not None), default=None)


def advantage(curves: Mapping[str, Curve], target: float) -> tuple[float | None, float | None]:
    """How many times more unknowns equal cells take than the best of the others, as far as meshes of these sizes tell.

    At least and at most; the second is None where that is not known, both where nothing can be said.
    """
    uniform, best = curves.get(UNIFORM), _best(curves, target)
    if uniform is None or best is None:
        return None, None
    needed = cost(uniform, target)
    if needed is None:
        return max(mesh.unknowns for mesh in uniform.meshes) / best, None
    before = _before(uniform, needed)
    if before is None or before <= best:
        return None, None
    others = [(curve, value) for sequence, curve in curves.items()
              if sequence != UNIFORM and (value := cost(curve, target)) is not None]  # fmt: skip
    least = [_before(curve, value) for curve, value in others]
    known = [value for value in least if value is not None]
    return before / best, needed / min(known) if len(known) == len(least) else None


def _before(curve: Curve, unknowns: float) -> int | None:
    """The largest number of unknowns of the curve below this one."""
    return max((mesh.unknowns for mesh in curve.meshes if mesh.unknowns < unknowns), default=None)


def _of_orders(overview: Overview) -> dict[str, Any]:
    """Observed beside expected orders on equal cells."""
    curves = [curve for curve in overview.curves if curve.sequence == UNIFORM and curve.expected is not None]
    forces = [curve for curve in curves if curve.measure == FORCE and curve.problem.name.startswith("plate")]
    slips, sticks = [[c for c in forces if (c.problem.name == "plate 1") is sticking] for sticking in (False, True)]
    return {
        "expected": len(curves), "as_expected": sum(curve.as_expected for curve in curves),
        "slipping": span([curve.fitted for curve in slips]), "sticking": span([curve.fitted for curve in sticks]),
        "slipping_expected": span([curve.expected.order for curve in slips if curve.expected]),
        "sticking_expected": span([curve.expected.order for curve in sticks if curve.expected]),
    }  # fmt: skip


def _of_brackets(overview: Overview) -> dict[str, Any]:
    """Guaranteed brackets beside references from elsewhere."""
    found = [each for problem in overview.problems for each in enclosing(overview, problem) if not each.own]
    closed = [each.gap for each in found if each.gap >= CLOSED]
    return {
        "guaranteed": sum(each.number for each in found), "inside": sum(each.inside for each in found),
        "closest": min(closed, default=None),
    }  # fmt: skip


def enclosing(overview: Overview, problem: Problem) -> Iterator[Enclosing]:
    """The guaranteed brackets of a problem, if it has some and a reference."""
    reference = overview.references[problem.name].values.get(ENERGY)
    meshes = [mesh for sequence in (UNIFORM, GRADED, APART) for mesh in overview.brackets(problem, sequence)]
    if reference is None or not meshes:
        return
    slack = reference.uncertainty + _ROUNDING * reference.unit
    low, high = reference.value - slack, reference.value + slack
    inside = sum(mesh.record["lower"] <= high and mesh.record["upper"] >= low for mesh in meshes)
    best = min(meshes, key=lambda mesh: float(mesh.record["gap"]))
    gap = max(float(best.record["gap"]), 0.0) / reference.unit
    yield Enclosing(len(meshes), inside, best, gap, bool(reference.sequence))


def side_of(overview: Overview, problem: Problem, model: str | None) -> bool | None:
    """Whether all forces on equal cells are above the reference; None if they differ or are within its uncertainty."""
    reference = overview.references[problem.name].values.get(FORCE)
    if reference is None or overview.is_exact(problem):
        return None
    least = reference.uncertainty + FLOOR * reference.unit
    signs = {
        abs(mesh.force) > abs(reference.value)
        for mesh in overview.data.of(problem, UNIFORM, model)
        if abs(mesh.force - reference.value) > least
    }
    return signs.pop() if len(signs) == 1 else None


def changes_of(overview: Overview) -> dict[str, tuple[str, float]]:
    """Problem → cells, and what the law on whole edges changes in the force, on the finest equal mesh with both."""
    found = {}
    for problem in overview.problems:
        strict = finest(overview.data.of(problem, UNIFORM, STRICT))
        same = [m for m in overview.data.of(problem, UNIFORM) if strict is not None and m.size == strict.size]
        if strict is not None and same and not overview.is_exact(problem):
            before = abs(same[0].force)
            found[problem.name] = (f"{strict.cells} cells", (abs(strict.force) - before) / before)
    return found


def span(values: Sequence[float | None]) -> str:
    """Smallest and largest as texts, once if they are the same; "none" without any."""
    known = [value for value in values if value is not None]
    return " to ".join(dict.fromkeys(significant(end) for end in (min(known), max(known)))) if known else NOTHING
