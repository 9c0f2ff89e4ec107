"""The report on convergence in the mesh: its numbers, tables and figure, from the stored rows alone."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from pandas import DataFrame, to_numeric

from comparisons.convergence.mesh.study import ADAPTIVE, EQUAL, GRADED, PAPER, PROBLEMS, SEQUENCES, TOLERANCE
from comparisons.lab.drawing import LOOKS, drawn, grid, legend_below, panelled
from comparisons.lab.numbers import fixed, scientific, seconds, significant, span
from comparisons.lab.reports import Form, Report, render
from comparisons.lab.studies import DONE, Row
from qvi_contact.plots.style import GREY

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FLOOR: Final = 1e-8
"""Relative errors that the accuracy of the solves leaves."""

TARGETS: Final = (1e-4, 1e-5, 1e-6)
"""Relative errors of the force whose cost is told."""

TARGET: Final = 1e-5
"""That of which sentences tell."""

_USUAL: Final = 4  # the degree that `solve` takes
_NUMBERS: Final = ("force", "energy", "unknowns", "cells", "h", "seconds", "lower", "upper", "strain", "estimate")
_CASE: Final = ("problem", "sequence", "degree", "size")
_REFERENCE_DEGREE: Final = 8
_ROUNDING: Final = 1e-9  # relative, of bounds beside a reference


def meshes_of(rows: Sequence[Row]) -> DataFrame:
    """One line a mesh, in the order of the rows.

    The columns are those of the case and of the record, see `study.run`, and solved, error (relative, of the force),
    least (what the reference's uncertainty and the solves leave), meant, whether the error is above that.
    """
    lines = [
        {**{name: row.case[name] for name in _CASE}, **record}
        for row in rows
        for record in (row.result["meshes"] if row.status == DONE else [{"status": row.status, "message": row.reason}])
    ]
    meshes = DataFrame(lines, columns=[*_CASE, "status", "message", "guaranteed", "force_bounds", *_NUMBERS])
    meshes[list(_NUMBERS)] = meshes[list(_NUMBERS)].apply(to_numeric)
    meshes["solved"] = meshes.status == "solved"
    known = references_of(meshes).set_index("problem")
    value, uncertainty = meshes.problem.map(known.value), meshes.problem.map(known.uncertainty)
    error = (meshes.force / value - 1.0).abs()
    least = (uncertainty / value).clip(lower=FLOOR)
    return meshes.assign(error=error, least=least, meant=error > least)


def references_of(meshes: DataFrame) -> DataFrame:
    """One line a problem: the force, its uncertainty and its source; from elsewhere, or of our finest graded meshes."""
    lines = []
    for name in meshes.problem.unique():
        problem = PROBLEMS[name]
        if problem.known is not None:
            value, uncertainty = problem.known
            lines.append((name, value, uncertainty, problem.source))
            continue
        graded = meshes[(meshes.problem == name) & (meshes.sequence == GRADED) & meshes.solved]
        finest = graded[graded.degree == min(_REFERENCE_DEGREE, graded.degree.max())].tail(2)
        if len(finest) == 2:
            before, last = finest.force
            source = (
                f"graded {finest.cells.iloc[-1]:.0f} triangles of degree {finest.degree.iloc[-1]}; ± the mesh before"
            )
            lines.append((name, last, abs(last - before), source))
    return DataFrame(lines, columns=["problem", "value", "uncertainty", "source"])


def cost(points: DataFrame, target: float) -> float:
    """The least number of unknowns from which on all errors stay within the target.

    NaN without errors, infinite if even the last one does not. An error that a finer mesh does not confirm is small by
    chance and does not count.
    """
    found = float("inf") if len(points) else float("nan")
    for unknowns, error in sorted(zip(points.unknowns, points.error, strict=True), reverse=True):
        if error > target:
            break
        found = float(unknowns)
    return found


def fitted_order(sizes: Sequence[float], errors: Sequence[float]) -> float:
    """Slope of log e over log h by least squares over the last three meshes whose error is not NaN.

    NaN with fewer: two meshes make a straight line of anything.
    """
    pairs = np.array([sizes, errors], dtype=float)
    h, e = np.log(pairs[:, ~np.isnan(pairs[1])][:, -3:])
    return float(np.polynomial.polynomial.polyfit(h - h.mean(), e, 1)[1]) if len(h) == 3 else float("nan")


def _curves(meshes: DataFrame) -> dict[tuple[str, str, int], DataFrame]:
    """Solved meshes with an error by problem, sequence and degree."""
    shown = meshes[meshes.solved & meshes.error.notna()]
    return dict(list(shown.groupby(["problem", "sequence", "degree"], sort=False)))


def costs_of(meshes: DataFrame) -> DataFrame:
    """One line a problem and target that its reference can tell: unknowns by sequence, and the degree that is best."""
    curves, lines = _curves(meshes), []
    for problem, found in meshes.groupby("problem", sort=False):
        for target in TARGETS:
            if not target >= found.least.max():
                continue
            costs = {key[1:]: cost(curve, target) for key, curve in curves.items() if key[0] == problem}
            graded = {degree: value for (sequence, degree), value in costs.items() if sequence == GRADED}
            best = min(graded, key=lambda degree: graded[degree], default=0)
            lines.append({
                "problem": problem, "target": target, PAPER: costs.get((PAPER, 3)), EQUAL: costs.get((EQUAL, _USUAL)),
                GRADED: graded.get(best), "degree": best if graded.get(best, np.inf) < np.inf else None,
                ADAPTIVE: next((value for (sequence, _), value in costs.items() if sequence == ADAPTIVE), None),
                **{f"degree {degree}": value for degree, value in graded.items()},
            })  # fmt: skip
    named = ["problem", "target", PAPER, EQUAL, GRADED, "degree", ADAPTIVE]
    degrees = [f"degree {degree}" for degree in sorted(meshes.degree[meshes.sequence == GRADED].unique())]
    return DataFrame(lines, columns=[*named, *degrees]).astype(dict.fromkeys((PAPER, EQUAL, GRADED, ADAPTIVE), float))


def orders_of(meshes: DataFrame) -> DataFrame:
    """One line a problem and kind of equal cells: the observed order of the force, and the expected one."""
    lines = [
        {"problem": problem, "sequence": sequence, "degree": degree,
         "expected": PROBLEMS[problem].order if sequence == PAPER or PROBLEMS[problem].sticks else None,
         "fitted": fitted_order(curve.h, curve.error.where(curve.meant))}
        for (problem, sequence, degree), curve in _curves(meshes).items() if sequence in (EQUAL, PAPER)
    ]  # fmt: skip
    return DataFrame(lines, columns=["problem", "sequence", "degree", "fitted", "expected"]).astype({"expected": float})


def brackets_of(meshes: DataFrame) -> DataFrame:
    """One line a problem: brackets of the energy, how many are guaranteed, the closest gap, and bounds of the force.

    Of those with bounds of the force it is told how many enclose the reference from elsewhere.
    """
    tried = meshes[meshes.solved & meshes.lower.notna() & meshes.upper.notna()]
    known, lines = references_of(meshes).set_index("problem"), []
    for problem, found in tried.groupby("problem", sort=False):
        gap = (found.upper - found.lower) / found.strain
        bounded = found[found.force_bounds.notna()]
        value, slack = known.value[problem], known.uncertainty[problem] + _ROUNDING * known.value[problem]
        inside = [
            low - slack <= value <= high + slack
            for low, high in (sorted(map(abs, each)) for each in bounded.force_bounds)
        ]
        lines.append((problem, len(found), int((found.guaranteed == True).sum()), gap.min(), len(inside), sum(inside)))  # noqa: E712
    return DataFrame(lines, columns=["problem", "number", "guaranteed", "gap", "bounded", "inside"])


def values_of(meshes: DataFrame) -> dict[str, Any]:
    """The numbers of the report's sentences."""
    costs, orders, brackets = costs_of(meshes), orders_of(meshes), brackets_of(meshes)
    chosen = costs[costs.target == TARGET]
    plates = chosen[chosen[PAPER].notna()]
    missed = plates[plates[PAPER] == np.inf]
    known = orders[orders.expected.notna() & orders.fitted.notna()]
    usual = known[(known.sequence == EQUAL)]
    by_degree = {name: chosen[name].replace(np.inf, np.nan) for name in chosen if name.startswith("degree ")}
    reached = {name: int(found.notna().sum()) for name, found in by_degree.items()}
    return {
        "target": TARGET, "problems": meshes.problem.nunique(), "judged": len(chosen), "plates": len(plates),
        "paper_missed": len(missed), "paper_most": meshes.unknowns[meshes.sequence == PAPER].max(),
        "plate_graded": span(plates[GRADED]), "equal_missed": int((chosen[EQUAL] == np.inf).sum()),
        "graded": span(chosen[GRADED]), "graded_missed": int((chosen[GRADED] == np.inf).sum()),
        "adaptive": span(chosen[ADAPTIVE]), "adaptive_missed": int((chosen[ADAPTIVE] == np.inf).sum()),
        "orders": span(usual.fitted), "expected": span(usual.expected), "usual": _USUAL,
        "paper_orders": span(known.fitted[known.sequence == PAPER]),
        "paper_expected": span(known.expected[known.sequence == PAPER]),
        "reached": reached, "solves": len(meshes), "certified": int(meshes.solved.sum()), "tolerance": TOLERANCE,
        "brackets": int(brackets.number.sum()), "guaranteed": int(brackets.guaranteed.sum()),
        "bounded": int(brackets.bounded.sum()), "inside": int(brackets.inside.sum()),
        "closest": brackets.gap[brackets.gap > _ROUNDING].min(), "sequences": SEQUENCES,
    }  # fmt: skip


def _known(form: Form) -> Form:
    """What is missing is left empty."""
    return lambda value: "" if value is None or value != value else form(value)


def _cost(unknowns: float) -> str:
    return "not reached" if unknowns == float("inf") else f"{unknowns:.0f}"


_NINE: Final = _known(partial(significant, digits=10))
FORMS: Final[dict[str, Form]] = {
    "target": partial(scientific, digits=1), **dict.fromkeys((PAPER, EQUAL, GRADED, ADAPTIVE), _known(_cost)),
    **dict.fromkeys((f"degree {degree}" for degree in range(3, 13)), _known(_cost)),
    **dict.fromkeys(("fitted", "expected"), _known("{:.2f}".format)), "degree": _known(fixed(".0f")),
    **dict.fromkeys(("unknowns", "cells"), fixed(".0f")), "seconds": seconds, "error": _known(scientific),
    **dict.fromkeys(("force", "lower", "upper", "value"), _NINE), "gap": scientific, "uncertainty": scientific,
}  # fmt: skip
"""Column of a table → how its values read."""


_LINES: Final[Sequence[tuple[str, Callable[[DataFrame], DataFrame]]]] = (
    ("the paper's element, equal cells", lambda found: found[found.sequence == PAPER]),
    ("degree 4, equal cells", lambda found: found[(found.sequence == EQUAL) & (found.degree == _USUAL)]),
    ("degree 8, equal cells", lambda found: found[(found.sequence == EQUAL) & (found.degree == 8)]),
    ("degree 4, graded", lambda found: found[(found.sequence == GRADED) & (found.degree == _USUAL)]),
    ("degree 6, graded", lambda found: found[(found.sequence == GRADED) & (found.degree == 6)]),
    ("adaptive", lambda found: found[found.sequence == ADAPTIVE]),
)
"""Curves of the figure."""


def _picture(meshes: DataFrame) -> "Figure":
    """Errors of the force against unknowns, a panel for each problem."""
    shown = meshes[meshes.solved & (meshes.error > 0.0)]
    groups = list(shown.groupby("problem", sort=False))
    figure, panels = panelled(len(groups), 9.0, 2.6, 0.9)
    for axes, (name, found) in zip(panels, groups, strict=True):
        axes.set(xscale="log", yscale="log", xlabel="unknowns [-]", ylabel="relative error of the force [-]")
        axes.minorticks_off()
        grid(axes)
        for (label, chosen), (colour, marker, line) in zip(_LINES, LOOKS, strict=False):
            points = chosen(found)
            if len(points):
                axes.plot(points.unknowns, points.error, color=colour, marker=marker, linestyle=line, markersize=4,
                          linewidth=1.1, label=label)  # fmt: skip
        least = found.least.max()
        bottom = min(found.error.min(), least) / 3.0
        axes.axhspan(bottom, least, color=GREY, alpha=0.2, linewidth=0)
        axes.set_ylim(bottom=bottom)
        axes.set_title(PROBLEMS[str(name)].title, fontsize=9)
    legend_below(figure, 3)
    return figure


def report(rows: Sequence[Row]) -> Report:
    """The report; the same rows give the same report."""
    meshes = meshes_of(rows)
    costs = costs_of(meshes)
    tables = {
        "costs": costs, "degrees": costs, "orders": orders_of(meshes), "brackets": brackets_of(meshes),
        "references": references_of(meshes), "failures": meshes[~meshes.solved], "meshes": meshes,
    }  # fmt: skip
    figures = {"errors": drawn("errors", partial(_picture, meshes))}
    return render("comparisons.convergence.mesh", "convergence-mesh", values_of(meshes), tables, figures, rows,
                  forms=FORMS)  # fmt: skip
