"""The numbers of the report's sentences."""

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from comparisons.convergence.mesh.errors import NAMES, Overview, ends_among, slug
from comparisons.convergence.mesh.orders import EXPECTED, advantage, cost
from comparisons.convergence.mesh.problems import ENERGY, FORCE, TRACTIONS, Problem
from comparisons.convergence.mesh.references import FLOOR
from comparisons.convergence.mesh.study import BRACKET, STRICT, UNIFORM
from comparisons.lab.report.numbers import span

if TYPE_CHECKING:
    from pandas import DataFrame

TARGET: Final = 1e-4
"""Relative error of the force whose cost is told in a sentence."""

CLOSED: Final = 1e-12
"""A smaller relative gap or change is rounding."""

_ROUNDING: Final = 1e-9  # relative: bounds beside a reference without uncertainty


class Enclosing(NamedTuple):
    """Guaranteed brackets of a problem beside its reference: how many, how many enclose it, and the closest.

    Of that the cells with their sequence, and the relative gap; `own`: the reference comes from the same models, which
    proves nothing.
    """

    number: int
    inside: int
    on: str
    gap: float
    own: bool


def values_of(overview: Overview) -> dict[str, Any]:
    """Name → number."""
    meshes = overview.meshes
    tried = meshes[meshes.solved & (meshes.model == BRACKET)]
    changes = {name: abs(change) for name, (_, change) in changes_of(overview).items()}
    largest = max(changes, key=lambda name: changes[name], default="")
    return {
        "target": TARGET, "problems": [_problem(overview, problem) for problem in overview.problems],
        "solves": len(meshes), "certified": int(meshes.solved.sum()), "brackets": len(tried),
        "open": int(tried.gap.isna().sum()), "change_at": largest or None, "change": changes.get(largest),
        "exact": [problem.title for problem in overview.exact],
        "spacing": spacing(overview), **_of_costs(overview), **_of_orders(overview), **_of_brackets(overview),
    }  # fmt: skip


def _problem(overview: Overview, problem: Problem) -> dict[str, Any]:
    """What the template needs for a problem's section."""
    known = overview.references[problem.name]
    return {
        "title": problem.title, "slug": slug(problem), "tractions": TRACTIONS in known, "ends": bool(ends_among(known))
    }  # fmt: skip


def spacing(overview: Overview) -> float | None:
    """The largest ratio of unknowns on two successive meshes of a sequence."""
    forces = overview.errors[overview.errors.measure == FORCE]
    found = [
        after / before
        for _, points in forces.groupby(["problem", "sequence"])
        for before, after in pairwise(sorted(points.unknowns))
    ]
    return max(found, default=None)


def force_curves(overview: Overview, problem: Problem) -> "dict[str, DataFrame]":
    """Sequence → errors of the force."""
    return {sequence: overview.curve(problem, FORCE, sequence) for sequence in NAMES}


def _of_costs(overview: Overview) -> dict[str, Any]:
    """Unknowns for one error of the force: of the best meshes, and how many times more equal cells take."""
    judged = [
        force_curves(overview, problem) for problem in overview.problems
        if problem not in overview.exact and overview.least(problem) <= TARGET
    ]  # fmt: skip
    costs = [{sequence: cost(points, TARGET) for sequence, points in curves.items()} for curves in judged]
    best = [min((value for name, value in each.items() if name != UNIFORM and value == value), default=None)
            for each in costs]  # fmt: skip
    return {
        "judged": len(judged), "best": span(best), "missed": sum(each[UNIFORM] != each[UNIFORM] for each in costs),
        "saved": span([end for curves in judged for end in advantage(curves, TARGET)]),
    }  # fmt: skip


def _of_orders(overview: Overview) -> dict[str, Any]:
    """Observed beside expected orders on equal cells."""
    known = overview.orders[overview.orders.expected.notna()]
    forces = known[(known.measure == FORCE) & known.problem.str.startswith("plate")]
    sticks = forces.problem == "plate 1"
    return {
        "expected": len(known), "as_expected": int((known.verdict == EXPECTED).sum()),
        "slipping": span(forces.fitted[~sticks]), "slipping_expected": span(forces.expected[~sticks]),
        "sticking": span(forces.fitted[sticks]), "sticking_expected": span(forces.expected[sticks]),
    }  # fmt: skip


def _of_brackets(overview: Overview) -> dict[str, Any]:
    """Guaranteed brackets beside references from elsewhere."""
    found = [each for problem in overview.problems for each in enclosing(overview, problem) if not each.own]
    return {
        "guaranteed": sum(each.number for each in found), "inside": sum(each.inside for each in found),
        "closest": min((each.gap for each in found if each.gap >= CLOSED), default=None),
    }  # fmt: skip


def enclosing(overview: Overview, problem: Problem) -> Iterator[Enclosing]:
    """The guaranteed brackets of a problem, if it has some and a reference."""
    known, meshes = overview.references[problem.name].get(ENERGY), overview.brackets(problem)
    if known is None or meshes.empty:
        return
    slack = known.uncertainty + _ROUNDING * known.unit
    inside = (meshes.lower <= known.value + slack) & (meshes.upper >= known.value - slack)
    best = meshes.loc[meshes.gap.idxmin()]
    on = f"{best.cells} cells, {NAMES[best.sequence]}"
    yield Enclosing(len(meshes), int(inside.sum()), on, max(best.gap, 0.0) / known.unit, bool(known.sequence))


def side_of(overview: Overview, problem: Problem, model: str = "") -> str | None:
    """On which side of the reference the forces on equal cells are; None if on both, or within its uncertainty."""
    known = overview.references[problem.name].get(FORCE)
    if known is None or problem in overview.exact:
        return None
    forces = overview.of(problem, UNIFORM, model).force
    off = forces[(forces - known.value).abs() > known.uncertainty + FLOOR * known.unit]
    signs = set(off.abs() > abs(known.value))
    return {True: "too large", False: "too small"}[signs.pop()] if len(signs) == 1 else None


def changes_of(overview: Overview) -> dict[str, tuple[str, float]]:
    """Problem → cells, and what the law on whole edges changes in the force, on the finest equal mesh with both."""
    found = {}
    for problem in overview.problems:
        strict, plain = overview.of(problem, UNIFORM, STRICT), overview.of(problem, UNIFORM)
        same = strict.merge(plain[["size", "force"]], on="size", suffixes=("", "_plain"))
        finest = same[same["size"] == strict["size"].max()]
        if len(finest) and problem not in overview.exact:
            mesh, before = finest.iloc[0], abs(finest.force_plain.iloc[0])
            found[problem.name] = (f"{mesh.cells} cells", (abs(mesh.force) - before) / before)
    return found
