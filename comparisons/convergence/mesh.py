"""Convergence in the mesh: the problems with their singular points and known forces, the study and its report.

All bodies are rectangles. On equal cells the singularity where a contact ends in a corner dominates the error.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from pandas import DataFrame

from comparisons.lab.drawing import LOOKS, drawn, grid, legend_below, panelled
from comparisons.lab.numbers import fixed, scientific, significant, span
from comparisons.lab.reports import Form, Report, render
from comparisons.lab.studies import Row, Study, frame_of
from comparisons.settled import LIMITS, LIMITS_SOURCE, TRANSITIONS
from qvi_contact import ContactResult, TriangleMesh, paper, refine, solve
from qvi_contact.gallery import compressed_plate, ssnv128, stick_slip_block
from qvi_contact.plots.style import GREY
from qvi_contact.problem import Contact, ContactProblem, Material, Polynomial, Symmetry, Traction
from qvi_contact.refinement import RefinementRound
from qvi_contact.types import Condition
from solvers import QVISolution, Status, solve_qvi

_PUSH: Final = 1e-3  # displacement of the punch [mm]
_RADIUS: Final = 800.0  # radius of the punch [mm]
_STICKING: Final = 0.25  # μ from which on all of the plate sticks


@dataclass(frozen=True)
class Problem:
    """A problem of the study.

    `force` is a component of the force on `contact` that balance alone does not determine; `known` is its value and
    uncertainty, from `source`. The body is a rectangle of this size [length], with `coarse` cells along x and y on the
    coarsest mesh. At `singular` points stresses are singular, or a zone of the contact ends.
    """

    name: str
    title: str
    contact: str
    force: str
    size: tuple[float, float]
    coarse: tuple[int, int]
    singular: Sequence[tuple[float, float]]
    stated: Callable[[], ContactProblem]
    known: tuple[float, float]
    source: str

    def equal(self, times: int) -> ContactProblem:
        """The problem on equal cells, in each direction `times` as many as on the coarsest mesh."""
        across, up = self.coarse
        return replace(self.stated(), mesh=TriangleMesh.rectangle((times * across, times * up), *self.size))

    def graded(self, depth: int) -> ContactProblem:
        """The problem on a mesh twice as fine as the coarsest, triangles at singular points halved `depth` times."""
        problem = self.equal(2)
        assert isinstance(problem.mesh, TriangleMesh)
        return replace(problem, mesh=problem.mesh.graded(self.singular, depth))


def punch(friction: float) -> ContactProblem:
    """Right half of a block on a smooth foundation, pressed by a rigid punch of parabolic shape.

    [0, 4] × [0, 2] mm, steel in plane strain, symmetry on x = 0 and y = 0, x = 4 mm free. The punch goes down by 1e-3
    mm and has the radius 800 mm: u_y ≤ −1e-3 + x²/1600 on the top.
    """
    gap = Polynomial([[-_PUSH], [0.0], [1.0 / (2.0 * _RADIUS)]])
    contact = Contact("top", friction=friction, gap=gap, name="punch")
    sides: list[Condition] = [Symmetry("left"), Symmetry("bottom"), Traction("right", x=0.0, y=0.0)]
    return ContactProblem(TriangleMesh.rectangle((2, 1), 4.0, 2.0), Material(2.1e5, 0.3, "strain"), [*sides, contact])


def _block() -> ContactProblem:
    return stick_slip_block((4, 2), transition=1.0, slip=0.02, pressure_drop=40.0)[0]


def _plate(friction: float) -> Problem:
    sticks = friction >= _STICKING
    ends = [(1.0, 1.0), *([] if sticks else [(TRANSITIONS[friction], 1.0)])]
    title = f"The plate, μ = {friction:g}{' (sticks everywhere)' if sticks else ''}"
    return Problem(
        f"plate {friction:g}", title, "plate", "normal_force", (1.0, 1.0), (2, 2), ends,
        lambda: compressed_plate(friction), LIMITS[friction], LIMITS_SOURCE,
    )  # fmt: skip


_OWN: Final = "degree 8 on graded meshes twice as fine, halved 14 times, and refine with up to 25 000 unknowns, agree"

_ALL: Final = [
    *map(_plate, LIMITS),
    Problem("ssnv128", "SSNV128: opens, slips and sticks", "base", "tangential_force", (0.04, 0.04), (4, 4),
            [(0.0, 0.0), (3.3203e-3, 0.0), (2.98465e-2, 0.0)], lambda: ssnv128((2, 2)), (1405346.37, 0.05), _OWN),
    Problem("punch smooth", "Parabolic punch, frictionless: closed and open", "punch", "normal_force", (4.0, 2.0),
            (4, 2), [(0.94127, 2.0)], partial(punch, 0.0), (111.2775392, 1e-7), _OWN),
    Problem("punch rough", "Parabolic punch, μ = 0.3: sticks, slips and opens", "punch", "normal_force", (4.0, 2.0),
            (4, 2), [(0.6853, 2.0), (0.9258, 2.0)], partial(punch, 0.3), (111.4186933, 2e-7), _OWN),
    # the change from stick to slip, x = 1, is on no vertex of equal cells; ∫ 3a x² dx with a = 30/(3·2²) over [0, 2]
    Problem("block", "Block with an exact solution: sticks and slips", "base", "tangential_force", (2.0, 1.0), (3, 2),
            [(1.0, 0.0)], _block, (20.0, 0.0), "closed form, gallery.stick_slip_block"),
]  # fmt: skip

PROBLEMS: Final = {problem.name: problem for problem in _ALL}
"""Name → problem."""


# The study: problems × meshes × degrees, each solved and bracketed; the paper's element on the plate beside them.


TOLERANCE: Final = 1e-8
"""Tolerance of every certificate."""

EQUAL, GRADED, ADAPTIVE, PAPER = "equal", "graded", "adaptive", "paper"
"""Sequences of meshes, see `mesh.md`; "paper" are equal cells of the paper's element."""

DEGREES: Final = (3, 4, 5, 6, 8)
REFINED_DEGREE: Final = 5
"""Degree on adaptive meshes, the default of `refine`."""

TIMES: Final = (1, 2, 4, 8, 16)
DEPTHS: Final = (0, 2, 4, 6, 8, 10)
PAPER_CELLS: Final = (2, 4, 8, 16, 32, 64, 128)

_MOST: Final = 30_000  # largest number of unknowns of equal cells
_OUT_OF_REACH: Final = 1e-9  # target of `refine`, so small that it refines to its limit of unknowns
_MOST_REFINED: Final = 3_000  # that limit

Record = dict[str, Any]


def study(quick: bool) -> Study:
    """The study, or coarse meshes and few degrees of two problems."""
    degrees, most = ((4, 5), 3) if quick else (DEGREES, None)
    cases = []
    for problem in PROBLEMS.values():
        if quick and problem.name not in ("plate 0.2", "block"):
            continue
        few = 6 * problem.coarse[0] * problem.coarse[1]  # unknowns for each degree above 2
        meshes = [(EQUAL, degree, times) for degree in degrees for times in TIMES[:most]
                  if few * (degree - 2) * times**2 <= _MOST]  # fmt: skip
        meshes += [(GRADED, degree, depth) for degree in degrees for depth in DEPTHS[:most]]
        meshes += [(ADAPTIVE, REFINED_DEGREE, 200 if quick else _MOST_REFINED)]
        meshes += [(PAPER, 3, cells) for cells in PAPER_CELLS[: 4 if quick else None] if problem.contact == "plate"]
        cases += [{"problem": problem.name, "sequence": sequence, "degree": degree, "size": size}
                  for sequence, degree, size in meshes]  # fmt: skip
    return Study("convergence-mesh", 6, "comparisons.convergence.mesh:run", cases)


def run(case: Mapping[str, Any]) -> Record:
    """Task of the study: one mesh, or all rounds of an adaptive mesh.

    "meshes" are records with status, message, unknowns, number of cells, and force.
    """
    problem, sequence, size, degree = PROBLEMS[case["problem"]], case["sequence"], case["size"], case["degree"]
    if sequence == ADAPTIVE:
        return {"meshes": _adaptive(problem, degree, size)}
    found: ContactResult | QVISolution
    if sequence == PAPER:
        plate = paper.plate(float(problem.name.split()[1]), (size, size))
        found = solve_qvi(plate.qvi, method="condensed", tolerance=TOLERANCE)
        unknowns, cells = plate.qvi.n, size**2
    else:
        stated = problem.equal(size) if sequence == EQUAL else problem.graded(size)
        found = solve(stated, degree=degree, tolerance=TOLERANCE)
        unknowns, cells = found.discretization.qvi.n, stated.mesh.cell_count
    record: Record = {
        "status": found.status.value, "message": found.message, "unknowns": int(unknowns), "cells": cells,
        "accuracy": float(found.certificate.accuracy),
    }  # fmt: skip
    if found.status is Status.SOLVED:
        if isinstance(found, ContactResult):
            force = getattr(found.contacts[problem.contact], problem.force)
        else:
            force = plate.force(found.z)
        record |= {"message": "", "force": abs(float(force))}
    return {"meshes": [record]}


def _adaptive(problem: Problem, degree: int, most: int) -> list[Record]:
    """A record for each round of `refine`."""
    records: list[Record] = []

    def keep(done: RefinementRound) -> None:
        records.append({"status": Status.SOLVED.value, "message": "", "unknowns": done.unknowns, "cells": done.cells,
                        "force": abs(done.value)})  # fmt: skip

    quantity = f"{problem.contact}.{problem.force}"
    refine(problem.equal(1), None, _OUT_OF_REACH, quantity, degree=degree, max_unknowns=most, callback=keep,
           tolerance=TOLERANCE)  # fmt: skip
    return records


FLOOR: Final = 1e-8
"""Relative errors below this are not resolved by the solves."""

TARGETS: Final = (1e-4, 1e-5, 1e-6)
"""Relative errors of the force whose cost is reported."""

TARGET: Final = 1e-5
"""The error in the findings."""

_USUAL: Final = 4  # the degree that `solve` takes
_NUMBERS: Final = ("force", "unknowns")


def meshes_of(rows: Sequence[Row]) -> DataFrame:
    """One line a mesh, in the order of the rows.

    The columns are those of `frame_of` and of the records, see `run`, and "solved", "error" (relative, of the force),
    "least" (the smallest error that the reference's uncertainty and the solves resolve).
    """
    meshes = frame_of(rows, _NUMBERS, parts="meshes")
    meshes["solved"] = meshes.status == "solved"
    known = references_of(meshes).set_index("problem")
    value, uncertainty = meshes.problem.map(known.value), meshes.problem.map(known.uncertainty)
    error = (meshes.force / value - 1.0).abs()
    least = (uncertainty / value).clip(lower=FLOOR)
    return meshes.assign(error=error, least=least)


def references_of(meshes: DataFrame) -> DataFrame:
    """One line a problem: the force, its uncertainty and source."""
    lines = [(name, *PROBLEMS[name].known, PROBLEMS[name].source) for name in meshes.problem.unique()]
    return DataFrame(lines, columns=["problem", "value", "uncertainty", "source"])


def cost(points: DataFrame, target: float) -> float:
    """The least number of unknowns from which on all errors stay within the target.

    NaN without errors, infinite if the finest mesh misses the target. A small error does not count if a finer mesh has
    a larger one.
    """
    finest_first = points.sort_values(["unknowns", "error"], ascending=False)
    lasting = finest_first.unknowns[finest_first.error.cummax() <= target]
    return float(lasting.min()) if len(lasting) else float("inf") if len(points) else float("nan")


def costs_of(meshes: DataFrame) -> DataFrame:
    """One line a problem and target that its reference resolves: unknowns by sequence, and the best degree."""
    shown, lines = meshes[meshes.solved & meshes.error.notna()], []
    curves = dict(list(shown.groupby(["problem", "sequence", "degree"], sort=False)))
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


def values_of(meshes: DataFrame) -> dict[str, Any]:
    """The numbers of the report's sentences."""
    costs = costs_of(meshes)
    chosen = costs[costs.target == TARGET]
    plates = chosen[chosen[PAPER].notna()]
    missed = plates[plates[PAPER] == np.inf]
    by_degree = {name: chosen[name].replace(np.inf, np.nan) for name in chosen if name.startswith("degree ")}
    reached = {name: int(found.notna().sum()) for name, found in by_degree.items()}
    return {
        "target": TARGET, "problems": meshes.problem.nunique(), "judged": len(chosen), "plates": len(plates),
        "paper_missed": len(missed), "paper_most": meshes.unknowns[meshes.sequence == PAPER].max(),
        "plate_graded": span(plates[GRADED]), "equal_missed": int((chosen[EQUAL] == np.inf).sum()),
        "graded": span(chosen[GRADED]), "graded_missed": int((chosen[GRADED] == np.inf).sum()),
        "adaptive": span(chosen[ADAPTIVE]), "adaptive_missed": int((chosen[ADAPTIVE] == np.inf).sum()),
        "usual": _USUAL, "reached": reached, "solves": len(meshes), "certified": int(meshes.solved.sum()),
        "tolerance": TOLERANCE,
    }  # fmt: skip


def _known(form: Form) -> Form:
    """The form, with an empty text for missing values."""
    return lambda value: "" if value is None or value != value else form(value)


_cost: Final[Form] = _known(lambda unknowns: "not reached" if unknowns == np.inf else f"{unknowns:.0f}")
FORMS: Final[dict[str, Form]] = {
    "target": partial(scientific, digits=1), "degree": _known(fixed(".0f")), "uncertainty": scientific,
    **dict.fromkeys((PAPER, EQUAL, GRADED, ADAPTIVE, *(f"degree {degree}" for degree in DEGREES)), _cost),
    "value": _known(partial(significant, digits=10)),
}  # fmt: skip
"""Column of a table → how its values read."""


_LINES: Final = (
    ("the paper's element, equal cells", PAPER, 3), ("degree 4, equal cells", EQUAL, 4),
    ("degree 8, equal cells", EQUAL, 8), ("degree 4, graded", GRADED, 4), ("degree 6, graded", GRADED, 6),
    ("adaptive", ADAPTIVE, REFINED_DEGREE),
)  # fmt: skip
"""Curves of the figure: label, meshes, degree."""


def _picture(meshes: DataFrame) -> Figure:
    """Errors of the force against unknowns, a panel for each problem."""
    shown = meshes[meshes.solved & (meshes.error > 0.0)]
    groups = list(shown.groupby("problem", sort=False))
    figure, panels = panelled(len(groups), 9.0, 2.6, 0.9)
    for axes, (name, found) in zip(panels, groups, strict=True):
        axes.set(xscale="log", yscale="log", xlabel="unknowns [-]", ylabel="relative error of the force [-]")
        axes.minorticks_off()
        grid(axes)
        for (label, sequence, degree), (colour, marker, line) in zip(_LINES, LOOKS, strict=False):
            points = found[(found.sequence == sequence) & (found.degree == degree)]
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
    """The report, a function of the rows only."""
    meshes = meshes_of(rows)
    costs = costs_of(meshes)
    degrees = costs.drop(columns=[PAPER, EQUAL, GRADED, "degree", ADAPTIVE])
    tables = {"costs": costs, "degrees": degrees, "references": references_of(meshes),
              "failures": meshes[~meshes.solved]}  # fmt: skip
    figures = {"errors": drawn("errors", partial(_picture, meshes))}
    return render("comparisons.convergence", "convergence-mesh", values_of(meshes), tables, figures, rows,
                  forms=FORMS, template="mesh.md")  # fmt: skip
