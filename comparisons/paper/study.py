"""The plate of Więckowski (1992): printed and computed numbers; report, tables as CSV, Figures 2-5."""

import tomllib
from dataclasses import dataclass
from functools import cache, partial
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from pandas import DataFrame

from comparisons.lab.drawing import drawn
from comparisons.lab.numbers import fixed, scientific, seconds
from comparisons.lab.reports import Form, Report, render
from comparisons.lab.studies import versions
from qvi_contact import paper
from qvi_contact.basics.terminal import Advance
from qvi_contact.basics.writing import write_text
from qvi_contact.paper import QuarterPlate
from qvi_contact.plots.style import BLUE, VERMILLION, lines, new_figure
from solvers import FrictionQVI, QVISolution, Status, available, solve_qvi


@dataclass(frozen=True)
class Reference:
    """Data of the paper's section 5; E in MPa, U and ω_T in the paper's length.

    `table` maps the friction coefficient to P/2 of Table 1, `figures` to the number of Figs 2-5 and the largest
    |principal stress| [MPa]; without friction P/2 = E U.
    """

    young: float
    poisson: float
    displacement: float
    cells: int
    iterations: int
    omega_T: float  # noqa: N815  # the paper's symbol
    table: dict[float, float]
    figures: dict[float, tuple[int, float]]
    exact_without_friction: float

    def plate(self, friction: float) -> QuarterPlate:
        """The example in the paper's own system."""
        data: dict[str, Any] = {"young": self.young, "poisson": self.poisson, "displacement": self.displacement}
        return paper.plate(friction, (self.cells, self.cells), **data)

    def uzawa(self, qvi: FrictionQVI, **options: Any) -> QVISolution:
        """The paper's iteration with its step; the problem's unit of displacement is U."""
        return solve_qvi(qvi, method="uzawa", omega_T=self.omega_T / self.displacement, **options)


@cache
def load() -> Reference:
    """Read the data file of the package."""
    data = tomllib.loads(files("comparisons.paper").joinpath("wieckowski_1992.toml").read_text(encoding="utf-8"))
    table, figures = data.pop("table_1"), data.pop("figures")
    shown = zip(figures["number"], figures["max_principal_stress"], strict=True)
    return Reference(
        **data,
        table=dict(zip(table["friction"], table["half_force"], strict=True)),
        figures=dict(zip(figures["friction"], shown, strict=True)),
        exact_without_friction=table["half_force_without_friction"],
    )


SHRINKING: Final = 100.0
"""Iterations after which the shrinking step of the frictionless Uzawa run has halved."""

TOLERANCE: Final = 1e-8
PATIENCE: Final = 3
"""Outer iterations without progress after which the fixed point with a back end stops."""


@dataclass(frozen=True, eq=False)
class Row:
    """All runs for one friction coefficient, and P/2 as printed in Table 1.

    "back_ends" are fixed points by inner solver. "runs" are the columns of the table: Uzawa for the paper's number of
    iterations, by the accumulating and by the printed rule; the accumulating rule to the tolerance, at μ = 0 with a
    shrinking step; two fixed points; the condensed method.
    """

    friction: float
    printed: float
    plate: QuarterPlate
    back_ends: dict[str, QVISolution]
    runs: dict[str, QVISolution]

    @property
    def reference(self) -> QVISolution:
        """The solution that all others are compared with: the fixed point with direct Clarabel."""
        return self.back_ends["direct:clarabel"]

    def traction_difference(self, solution: QVISolution) -> float:
        """Largest difference of tractions to the reference, over its mean pressure; NaN without a stress state."""
        ours, theirs = (np.stack(self.plate.tractions(z)[1:]) for z in (solution.z, self.reference.z))
        mean_pressure = self.plate.force(self.reference.z) / float(self.plate.x[-1])
        return float(np.abs(ours - theirs).max()) / mean_pressure


@dataclass(frozen=True, eq=False)
class PaperStudy:
    """A row for each friction coefficient of Table 1, and the ends of the cycle of P/2 without friction."""

    reference: Reference
    rows: tuple[Row, ...]
    cycle: tuple[float, float]

    def row(self, friction: float) -> Row:
        """The row of one friction coefficient."""
        return next(row for row in self.rows if row.friction == friction)


def step_count() -> int:
    """Progress steps of `run`."""
    return len(load().table) * (1 + len(available()))


def run(advance: Advance) -> PaperStudy:
    """Compute everything; `advance` is called after each step."""
    reference, rows = load(), []
    for friction, printed in reference.table.items():
        plate = reference.plate(friction)
        uzawa, decay = partial(reference.uzawa, plate.qvi), SHRINKING if friction == 0.0 else None
        runs = {
            "uzawa_30": uzawa(rule="accumulating", iterations=reference.iterations),
            "uzawa_30_printed_rule": uzawa(rule="printed", iterations=reference.iterations),
            "uzawa_converged": uzawa(tolerance=TOLERANCE, step_decay=decay),
        }
        condensed = solve_qvi(plate.qvi, method="condensed", tolerance=TOLERANCE)
        advance(f"μ = {friction:.2f}")
        back_ends = {}
        for inner in available():
            back_ends[inner] = solve_qvi(plate.qvi, inner=inner, tolerance=TOLERANCE, patience=PATIENCE)
            advance(f"μ = {friction:.2f}, {inner}")
        runs |= {"fixed_point_qp": back_ends["qp:clarabel"], "fixed_point_socp": back_ends["socp:clarabel"]}
        rows.append(Row(friction, printed, plate, back_ends, {**runs, "condensed": condensed}))
    smooth = rows[0].plate  # its last iterations with a constant step
    history = reference.uzawa(smooth.qvi).history[-8:]
    forces = [-smooth.stress_unit * smooth.length_unit * record.normal_resultant for record in history]
    return PaperStudy(reference, tuple(rows), (min(forces), max(forces)))


FORCE_TOLERANCE, TRACTION_TOLERANCE = 1e-7, 1e-5
LOW_FORCE_TOLERANCE, LOW_TRACTION_TOLERANCE = 1e-5, 1e-4


def table_rows(study: PaperStudy) -> list[dict[str, float]]:
    """Table 1, one row for each friction coefficient; forces are P/2 in N/mm."""
    rows = []
    for row in study.rows:
        forces = {name: row.plate.force(run.z) for name, run in row.runs.items()}
        solution = row.plate.force(row.reference.z)
        percent = 100.0 * (row.printed - solution) / solution
        rows.append({
            "friction": row.friction, "paper": row.printed, **forces, "paper_minus_solution_percent": percent,
        })  # fmt: skip
    return rows


def figure_rows(study: PaperStudy) -> list[dict[str, float]]:
    """Figures 2-5, one row each; largest |principal stress| in MPa."""
    rows = []
    for friction, (number, printed) in study.reference.figures.items():
        row = study.row(friction)
        ours, converged = (float(np.abs(row.plate.principal_stress(each.z)[:2]).max())
                           for each in (row.runs["uzawa_30"], row.reference))  # fmt: skip
        rows.append({
            "figure": number, "friction": friction, "paper": printed, "uzawa_30": ours, "converged": converged,
        })  # fmt: skip
    return rows


def back_end_rows(study: PaperStudy) -> list[dict[str, Any]]:
    """One row for each inner solver: its worst agreement with the reference over all friction coefficients."""
    runs = {name: [(row, row.back_ends[name]) for row in study.rows] for name in study.rows[0].back_ends}
    runs["uzawa"] = [(row, row.runs["uzawa_converged"]) for row in study.rows]
    rows = []
    for name, pairs in runs.items():
        # NaN if one run has no result
        ratios = [row.plate.force(ours.z) / row.plate.force(row.reference.z) for row, ours in pairs]
        force = float(np.abs(np.array(ratios) - 1.0).max())
        traction = float(np.max([row.traction_difference(ours) for row, ours in pairs]))
        rows.append({
            "solver": name, "certified": sum(ours.status is Status.SOLVED for _, ours in pairs), "problems": len(pairs),
            "half_force_difference": force, "traction_difference": traction,
            "accuracy": float(np.max([ours.certificate.accuracy for _, ours in pairs])),
            "outer_iterations": sum(ours.iterations for _, ours in pairs),
            "seconds": sum(sum(ours.timings.values()) for _, ours in pairs), "verdict": verdict(force, traction),
            "remark": next((ours.message for _, ours in pairs if ours.status is not Status.SOLVED), ""),
        })  # fmt: skip
    return rows


def verdict(force: float, traction: float) -> str:
    """The agreement with the reference, in words, by the tolerances above."""
    if force <= FORCE_TOLERANCE and traction <= TRACTION_TOLERANCE:
        return f"≤ {FORCE_TOLERANCE:.0e}"
    if force <= LOW_FORCE_TOLERANCE and traction <= LOW_TRACTION_TOLERANCE:
        return f"≤ {LOW_FORCE_TOLERANCE:.0e} only"
    return "falls short"


def values_of(study: PaperStudy) -> dict[str, Any]:
    """The numbers of the report's sentences."""
    rows, ends = table_rows(study), back_end_rows(study)
    worst = max(rows, key=lambda row: abs(row["paper_minus_solution_percent"]))
    deviations = [row for row in rows if f"{row['uzawa_30_printed_rule']:.2f}" != f"{row['paper']:.2f}"]
    full = verdict(0.0, 0.0)
    # by how much the friction bound is exceeded between the four points of an edge, over the mean pressure
    shares = {row.friction: row.plate.excess_between_points(row.reference.z) * row.plate.x[-1]
              / row.plate.force(row.reference.z) for row in study.rows}  # fmt: skip
    between = max(shares, key=lambda mu: shares[mu])
    return {
        "iterations": study.reference.iterations, "cells": study.reference.cells, "printed": len(rows),
        "digits": sum(f"{row['uzawa_30']:.2f}" == f"{row['paper']:.2f}" for row in rows), "deviations": deviations,
        "off": abs(worst["paper_minus_solution_percent"]) / 100.0, "off_at": worst["friction"],
        "low": study.cycle[0], "high": study.cycle[1], "exact": study.reference.exact_without_friction,
        "shrinking": rows[0]["uzawa_converged"], "solvers": len(ends),
        "excess": shares[between], "excess_at": between,
        "short": [f"{row['solver']} ({row['verdict']})" for row in ends if row["verdict"] != full],
        "doubtful": [f"{row['solver']} ({row['certified']}/{row['problems']})" for row in ends
                     if row["certified"] < row["problems"]],
        "force_tolerance": FORCE_TOLERANCE, "traction_tolerance": TRACTION_TOLERANCE, "tolerance": TOLERANCE,
    }  # fmt: skip


def principal_stresses(study: PaperStudy) -> Figure:
    """Figures 2-5 (upper row, after the paper's iterations) and the converged states (lower row)."""
    figure = new_figure(13.0, 7.9)
    axes = figure.subplots(2, 4, sharex=True, sharey=True)
    full = max(printed for _, printed in study.reference.figures.values())
    for (upper, lower), numbers in zip(axes.T, figure_rows(study), strict=True):
        row = study.row(numbers["friction"])
        _crosses(upper, row.plate, row.runs["uzawa_30"], full)
        _crosses(lower, row.plate, row.reference, full)
        upper.set_title(f"Fig. {numbers['figure']}, μ = {row.friction:g}, Uzawa {study.reference.iterations}\n"
                        f"max {numbers['uzawa_30']:.2f}, printed {numbers['paper']:.2f} MPa")  # fmt: skip
        lower.set_title(f"converged, μ = {row.friction:g}\nmax {numbers['converged']:.2f} MPa")
        lower.set_xlabel("x [length]")
    for left in axes[:, 0]:
        left.set_ylabel("y [length]")
    figure.suptitle("Principal stresses of the quarter plate: compression solid, tension dotted with round ends")
    return figure


def _crosses(axes: Axes, plate: QuarterPlate, solution: QVISolution, full: float) -> None:
    """Principal stresses as crosses; an arm for the stress `full` is as long as the distance of neighbouring points."""
    axes.vlines(plate.x, plate.y[0], plate.y[-1], color="#cccccc", linewidth=0.6)
    axes.hlines(plate.y, plate.x[0], plate.x[-1], color="#cccccc", linewidth=0.6)
    axes.set_aspect("equal")
    x, y, _ = plate.stress(solution.z)
    first, second, angle = plate.principal_stress(solution.z)
    least = 1e-3 * float(max(np.abs(first).max(), np.abs(second).max()))
    scale = 0.5 * np.sqrt(plate.x[-1] * plate.y[-1] / len(x)) / full
    for values, turn in ((first, 0.0), (second, np.pi / 2)):
        half = scale * np.abs(values) * np.stack([np.cos(angle + turn), np.sin(angle + turn)])
        ends = np.stack([x, y])[..., None] + half[..., None] * np.array([-1.0, 1.0])
        pressed, tensed = (np.moveaxis(ends[:, chosen], 0, -1) for chosen in (values < -least, values > least))
        axes.add_collection(lines(pressed, BLUE, "solid", 0.8))
        axes.add_collection(lines(tensed, VERMILLION, (0, (1, 1)), 0.8))
        axes.plot(*tensed.reshape(-1, 2).T, "o", color=VERMILLION, markersize=2.0, markeredgewidth=0.0)


TABLES: Final = {"table_1.csv": table_rows, "figures_2_to_5.csv": figure_rows, "back_ends.csv": back_end_rows}
"""Name of a file → its rows."""

_FORMS: Final[dict[str, Form]] = {
    **dict.fromkeys(("friction", "paper", "uzawa_30", "uzawa_30_printed_rule", "converged"), fixed(".2f")),
    **dict.fromkeys(("uzawa_converged", "fixed_point_qp", "fixed_point_socp", "condensed"), fixed(".6f")),
    **dict.fromkeys(("half_force_difference", "traction_difference"), scientific), "seconds": seconds,
    "paper_minus_solution_percent": "{:+.2f} %".format,
}  # fmt: skip


def write(study: PaperStudy, folder: Path) -> tuple[Report, list[Path]]:
    """Write the report and its tables as CSV, each file whole or not at all."""
    picture = drawn("paper-figures-2-to-5", partial(principal_stresses, study))
    used = versions(("numpy", "scipy", "cvxpy", "clarabel", "osqp", "qpsolvers"))
    frames = {name: DataFrame(rows(study)) for name, rows in TABLES.items()}
    forces, stresses, ends = frames.values()
    ends = ends.assign(share=ends.certified.astype(str) + "/" + ends.problems.astype(str))
    tables = {"forces": forces, "stresses": stresses, "solvers": ends,
              "versions": DataFrame(used.items(), columns=["package", "version"])}  # fmt: skip
    made = render("comparisons.paper", "paper", values_of(study), tables, {"figures-2-to-5": picture}, forms=_FORMS)
    for name, frame in frames.items():
        write_text(folder / name, frame.to_csv(index=False, lineterminator="\n"))
    return made, [*made.write(folder), *(folder / name for name in frames)]
