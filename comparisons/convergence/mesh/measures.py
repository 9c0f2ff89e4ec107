"""The numbers of the report's sentences."""

from itertools import pairwise
from typing import Any, Final

import numpy as np
from pandas import DataFrame

from comparisons.convergence.mesh.errors import NAMES, Overview, ends_among, slug
from comparisons.convergence.mesh.orders import EXPECTED, FLAT, SAME, STEADY, advantage, cost
from comparisons.convergence.mesh.problems import ENERGY, FORCE, TRACTIONS, Problem
from comparisons.convergence.mesh.references import FLOOR
from comparisons.convergence.mesh.study import BRACKET, COMPANION, INNER, MODELS, SEQUENCES, STRICT, TOLERANCE, UNIFORM
from comparisons.lab.report.numbers import span

TARGETS: Final = (1e-3, 1e-4, 1e-5)
"""Relative errors of the force whose cost is told."""

TARGET: Final = 1e-4
"""That of which a sentence tells."""

CLOSED: Final = 1e-12
"""A smaller relative gap or change is rounding."""

_ROUNDING: Final = 1e-9  # relative: bounds beside a reference without uncertainty


def values_of(overview: Overview) -> dict[str, Any]:
    """Name → number."""
    meshes, models = overview.meshes, models_of(overview)
    tried = meshes[meshes.solved & (meshes.model == BRACKET)]
    changes = models.set_index("problem").change.abs().dropna()
    return {
        "target": TARGET, "problems": [_problem(overview, problem) for problem in overview.problems],
        "solves": len(meshes), "certified": int(meshes.solved.sum()), "brackets": len(tried),
        "open": int(tried.gap.isna().sum()), "change_at": changes.idxmax() if len(changes) else None,
        "change": changes.max(), "exact": [problem.title for problem in overview.exact],
        "spacing": spacing(overview), "same": SAME, "steady": STEADY, "flat": FLAT, "tolerance": TOLERANCE,
        "inner": INNER, "sequences": SEQUENCES, "models": MODELS, **_of_costs(overview),
        **_of_orders(overview), **_of_brackets(overview),
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


def costs_of(overview: Overview) -> DataFrame:
    """One line a problem and target: unknowns for this error of the force by sequence, see `cost`, and `advantage`.

    All are NaN where the target is below what the reference can tell.
    """
    lines = []
    for problem in overview.problems:
        curves = {sequence: overview.curve(problem, FORCE, sequence) for sequence in NAMES}
        for target in TARGETS:
            line: dict[str, Any] = {"problem": problem.name, "target": target}
            if target >= overview.least(problem):
                low, high = advantage(curves, target)
                line |= {"low": low, "high": high, **{name: cost(points, target) for name, points in curves.items()}}
            lines.append(line)
    return DataFrame(lines, columns=["problem", "target", *NAMES, "low", "high"])


def _of_costs(overview: Overview) -> dict[str, Any]:
    """Unknowns for one error of the force: of the best meshes, and how many times more equal cells take."""
    costs, exact = costs_of(overview), [problem.name for problem in overview.exact]
    judged = costs[(costs.target == TARGET) & costs[UNIFORM].notna() & ~costs.problem.isin(exact)]
    others = judged[[sequence for sequence in NAMES if sequence != UNIFORM]]
    return {
        "judged": len(judged), "best": span(others.min(axis=1)), "missed": int((judged[UNIFORM] == np.inf).sum()),
        "saved": span([*judged.low, *judged.high]),
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


def brackets_of(overview: Overview) -> DataFrame:
    """One line a problem that has guaranteed brackets of the energy and a reference.

    The columns are problem, number (of brackets), inside (how many enclose the reference), own (whether that comes from
    the same models, which proves nothing), and of the closest bracket gap (relative) and on (cells and sequence).
    """
    lines = []
    for problem in overview.problems:
        known, meshes = overview.references[problem.name].get(ENERGY), overview.brackets(problem)
        if known is None or meshes.empty:
            continue
        slack = known.uncertainty + _ROUNDING * known.unit
        inside = (meshes.lower <= known.value + slack) & (meshes.upper >= known.value - slack)
        best = meshes.loc[meshes.gap.idxmin()]
        gap, on = max(best.gap, 0.0) / known.unit, f"{best.cells} cells, {NAMES[best.sequence]}"
        lines.append((problem.name, len(meshes), int(inside.sum()), bool(known.sequence), gap, on))
    return DataFrame(lines, columns=["problem", "number", "inside", "own", "gap", "on"]).astype({"own": bool})


def _of_brackets(overview: Overview) -> dict[str, Any]:
    """Guaranteed brackets beside references from elsewhere."""
    found = brackets_of(overview)
    found = found[~found.own]
    return {
        "guaranteed": int(found.number.sum()), "inside": int(found.inside.sum()),
        "closest": found.gap[found.gap >= CLOSED].min(),
    }  # fmt: skip


def models_of(overview: Overview) -> DataFrame:
    """One line a problem: the sides of the reference that forces by stresses and displacements are on, and two models.

    The change is what the law on whole edges makes of the force, relative, on the finest equal mesh with both models;
    "on" tells its cells.
    """
    lines = []
    for problem in overview.problems:
        strict, plain = overview.of(problem, UNIFORM, STRICT), overview.of(problem, UNIFORM)
        same = strict.merge(plain[["size", "force"]], on="size", suffixes=("", "_plain"))
        change, on = np.nan, ""
        finest = same[same["size"] == strict["size"].max()]
        if len(finest) and problem not in overview.exact:
            mesh, before = finest.iloc[0], abs(finest.force_plain.iloc[0])
            change, on = (abs(mesh.force) - before) / before, f"{mesh.cells} cells"
        sides = _side_of(overview, problem), _side_of(overview, problem, COMPANION)
        lines.append((problem.name, *sides, change, on))
    return DataFrame(lines, columns=["problem", "stresses", "displacements", "change", "on"])


def _side_of(overview: Overview, problem: Problem, model: str = "") -> str | None:
    """On which side of the reference the forces on equal cells are; None if on both, or within its uncertainty."""
    known = overview.references[problem.name].get(FORCE)
    if known is None or problem in overview.exact:
        return None
    forces = overview.of(problem, UNIFORM, model).force
    off = forces[(forces - known.value).abs() > known.uncertainty + FLOOR * known.unit]
    signs = set(off.abs() > abs(known.value))
    return {True: "too large", False: "too small"}[signs.pop()] if len(signs) == 1 else None
