"""Everything that is computed about the paper's plate; the report, its tables, also as CSV, and its pictures."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from pandas import DataFrame

from comparisons.lab.drawing import drawn, grid
from comparisons.lab.numbers import fixed
from comparisons.lab.reports import Form, Report, render
from comparisons.paper.reference import Reference, load
from qvi_contact import principal_stresses as principal
from qvi_contact.basics.checks import FloatArray
from qvi_contact.basics.terminal import Advance
from qvi_contact.basics.writing import write_text
from qvi_contact.paper import QuarterPlate
from qvi_contact.plots import BLUE, VERMILLION
from qvi_contact.plots.style import lines, new_figure
from solvers import QVISolution, Status, solve_qvi

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHRINKING: Final = 100.0
"""Iterations after which the shrinking step of the frictionless Uzawa run has halved."""

TOLERANCE: Final = 1e-8


@dataclass(frozen=True, eq=False)
class Row:
    """All runs for one friction coefficient, and P/2 as Table 1 prints it.

    "uzawa" and "uzawa_printed_rule" are the paper's number of iterations, with the accumulating rule and with that as
    printed, "uzawa_converged" is the former to the tolerance, at μ = 0 with a shrinking step; "qp" and "socp" are fixed
    points with quadratic and with second-order cone programs, "condensed" solves the inequality directly.
    """

    friction: float
    printed: float
    plate: QuarterPlate
    uzawa: QVISolution
    uzawa_printed_rule: QVISolution
    uzawa_converged: QVISolution
    qp: QVISolution
    socp: QVISolution
    condensed: QVISolution

    def half_force(self, solution: QVISolution) -> float:
        """P/2: the quarter's contact force [N/mm], NaN without a stress state."""
        return self.plate.force(solution.z)

    def largest_principal_stress(self, solution: QVISolution) -> float:
        """Largest |principal stress| [MPa] over the 4×4 Gauss points of each element, NaN without a stress state."""
        return float(np.abs(self.plate.principal_stress(solution.z)[:2]).max())


@dataclass(frozen=True, eq=False)
class PaperStudy:
    """A row for each friction coefficient of Table 1, and the values of P/2 between which the first one alternates."""

    reference: Reference
    rows: tuple[Row, ...]
    cycle: tuple[float, ...]

    def row(self, friction: float) -> Row:
        """The row of one friction coefficient."""
        return next(row for row in self.rows if row.friction == friction)


def step_count() -> int:
    """Progress steps of `run`."""
    return len(load().table)


def run(advance: Advance) -> PaperStudy:
    """Compute everything; `advance` is called after each step."""
    reference, rows = load(), []
    for friction, printed in reference.table.items():
        plate = reference.plate(friction)
        accumulating, as_printed = (
            reference.uzawa(plate.qvi, rule=rule, iterations=reference.iterations)
            for rule in ("accumulating", "printed")
        )
        decay = SHRINKING if friction == 0.0 else None
        converged = reference.uzawa(plate.qvi, tolerance=TOLERANCE, step_decay=decay)
        qp, socp = (solve_qvi(plate.qvi, inner=f"{kind}:clarabel", tolerance=TOLERANCE) for kind in ("qp", "socp"))
        condensed = solve_qvi(plate.qvi, method="condensed", tolerance=TOLERANCE)
        rows.append(Row(friction, printed, plate, accumulating, as_printed, converged, qp, socp, condensed))
        advance(f"μ = {friction:.2f}")
    # values of P/2 in the last iterations of the frictionless run with a constant step, each once
    smooth = rows[0].plate
    history = reference.uzawa(smooth.qvi).history[-8:]
    forces = [-smooth.stress_unit * smooth.length_unit * record.normal_resultant for record in history]
    distinct = [b for a, b in pairwise(sorted(forces)) if b - a > 1e-6 * abs(b)]
    return PaperStudy(reference, tuple(rows), (min(forces), *distinct))


def table_rows(study: PaperStudy) -> list[dict[str, float]]:
    """Table 1, one row for each friction coefficient; forces are P/2 in N/mm."""
    rows = []
    for row in study.rows:
        runs = {
            "uzawa_30": row.uzawa, "uzawa_30_printed_rule": row.uzawa_printed_rule,
            "uzawa_converged": row.uzawa_converged, "fixed_point_qp": row.qp, "fixed_point_socp": row.socp,
            "condensed": row.condensed,
        }  # fmt: skip
        forces = {name: row.half_force(run) for name, run in runs.items()}
        percent = 100.0 * (row.printed / forces["condensed"] - 1.0)
        rows.append({
            "friction": row.friction, "paper": row.printed, **forces, "paper_minus_solution_percent": percent,
        })  # fmt: skip
    return rows


def figure_rows(study: PaperStudy) -> list[dict[str, float]]:
    """Figures 2-5, one row each; largest |principal stress| in MPa."""
    return [
        {
            "figure": number, "friction": friction, "paper": printed,
            "uzawa_30": study.row(friction).largest_principal_stress(study.row(friction).uzawa),
            "converged": study.row(friction).largest_principal_stress(study.row(friction).condensed),
        }
        for friction, (number, printed) in study.reference.figures.items()
    ]  # fmt: skip


def values_of(study: PaperStudy) -> dict[str, Any]:
    """The numbers of the report's sentences."""
    rows, methods = table_rows(study), ("uzawa_converged", "fixed_point_qp", "fixed_point_socp")
    worst = max(rows, key=lambda row: abs(row["paper_minus_solution_percent"]))
    deviations = [row for row in rows if f"{row['uzawa_30_printed_rule']:.2f}" != f"{row['paper']:.2f}"]
    # what the bound at four points an edge leaves open between them, as a share of the mean pressure
    shares = {row.friction: row.plate.excess_between_points(row.condensed.z) * row.plate.x[-1]
              / row.half_force(row.condensed) for row in study.rows}  # fmt: skip
    between = max(shares, key=lambda mu: shares[mu])
    return {
        "iterations": study.reference.iterations, "cells": study.reference.cells, "printed": len(rows),
        "digits": sum(f"{row['uzawa_30']:.2f}" == f"{row['paper']:.2f}" for row in rows), "deviations": deviations,
        "off": abs(worst["paper_minus_solution_percent"]) / 100.0, "off_at": worst["friction"],
        "low": min(study.cycle), "high": max(study.cycle), "exact": study.reference.exact_without_friction,
        "shrinking": study.row(0.0).half_force(study.row(0.0).uzawa_converged),
        "excess": shares[between], "excess_at": between,
        "apart": max(abs(row[name] / row["condensed"] - 1.0) for row in rows for name in methods),
        "certified": all(each.status is Status.SOLVED for row in study.rows
                         for each in (row.uzawa_converged, row.qp, row.socp, row.condensed)),
    }  # fmt: skip


def principal_stresses(study: PaperStudy) -> "Figure":
    """Figures 2-5 (upper row, after the paper's iterations) and the converged states (lower row)."""
    figure = new_figure(13.0, 7.9)
    axes = figure.subplots(2, 4, sharex=True, sharey=True)
    largest = max(printed for _, printed in study.reference.figures.values())
    for column, (friction, (number, printed)) in enumerate(study.reference.figures.items()):
        row = study.row(friction)
        upper, lower = axes[:, column]
        ours = _map(upper, row, row.uzawa, largest)
        upper.set_title(f"Fig. {number}, μ = {friction:g}, Uzawa {study.reference.iterations}\n"
                        f"max {ours:.2f}, printed {printed:.2f} MPa")  # fmt: skip
        converged = _map(lower, row, row.condensed, largest)
        lower.set_title(f"converged, μ = {friction:g}\nmax {converged:.2f} MPa")
        lower.set_xlabel("x [length]")
    for left in axes[:, 0]:
        left.set_ylabel("y [length]")
    figure.suptitle("Principal stresses of the quarter plate: compression solid, tension dotted with round ends")
    return figure


def _map(axes: "Axes", row: Row, solution: QVISolution, largest: float) -> float:
    """Grid lines and crosses, or a word where there is no stress state."""
    if not np.isfinite(solution.z).all():
        axes.text(0.5, 0.5, f"no stress state: {solution.status}", ha="center", transform=axes.transAxes)
        return float("nan")
    plate = row.plate
    axes.vlines(plate.x, plate.y[0], plate.y[-1], color="#cccccc", linewidth=0.6)
    axes.hlines(plate.y, plate.x[0], plate.x[-1], color="#cccccc", linewidth=0.6)
    x, y, stress = plate.stress(solution.z)
    spacing = np.full(len(x), np.sqrt(plate.x[-1] * plate.y[-1] / len(x)))
    _crosses(axes, np.stack([x, y], axis=-1), stress, spacing, largest)
    axes.set_aspect("equal")
    return row.largest_principal_stress(solution)


def _crosses(axes: "Axes", points: FloatArray, stress: FloatArray, spacing: FloatArray, full: float) -> None:
    """Principal stresses (..., 3) as crosses at points (..., 2): compression solid, tension dotted with round ends.

    A stress of the size `full` is drawn as long as the distance (...) of neighbouring points.
    """
    from matplotlib.collections import EllipseCollection

    first, second, angle = principal(stress)
    least = 1e-3 * float(max(np.abs(first).max(), np.abs(second).max()))
    for values, turn in ((first, 0.0), (second, np.pi / 2)):
        direction = np.stack([np.cos(angle + turn), np.sin(angle + turn)], axis=-1)
        half = direction * (0.5 * spacing * np.abs(values) / full)[..., None]
        ends = points[..., None, :] + half[..., None, :] * np.array([[-1.0], [1.0]])
        pushed, pulled = values < -least, values > least
        axes.add_collection(lines(ends[pushed], BLUE, "solid", 0.8))
        axes.add_collection(lines(ends[pulled], VERMILLION, (0, (1, 1)), 0.8))
        size = 0.1 * np.repeat(spacing[pulled], 2)  # of round dots at both ends, smaller in small cells
        dots: dict[str, Any] = {"offsets": ends[pulled].reshape(-1, 2), "offset_transform": axes.transData}
        look: dict[str, Any] = {"units": "xy", "facecolors": VERMILLION, "edgecolors": "none"}
        axes.add_collection(EllipseCollection(size, size, np.zeros_like(size), **look, **dots))


def table_1(study: PaperStudy) -> "Figure":
    """Table 1 as a picture: printed forces, Uzawa after the same iterations, the solution."""
    figure = new_figure(6.4, 4.4)
    axes = figure.subplots()
    friction = [row.friction for row in study.rows]
    n = study.reference.iterations
    axes.plot(friction, [row.half_force(row.condensed) for row in study.rows], color=BLUE, marker="o", markersize=4,
              label="solution")  # fmt: skip
    axes.plot(friction, [row.half_force(row.uzawa) for row in study.rows], color=VERMILLION, linestyle="--",
              label=f"Uzawa after {n} iterations")  # fmt: skip
    axes.plot(friction, [row.printed for row in study.rows], color="black", marker="x", linestyle="none",
              markersize=7, label="paper, Table 1")  # fmt: skip
    axes.set(xlabel="friction coefficient μ [-]", ylabel="P/2 [N/mm]")
    axes.set_title("Table 1 is the state after 30 iterations, not the solution" if n == 30 else "Table 1")
    grid(axes)
    axes.legend()
    return figure


TABLES: Final = {"table_1.csv": table_rows, "figures_2_to_5.csv": figure_rows}
"""Name of a file → its rows."""

PICTURES: "Final[Mapping[str, Callable[[PaperStudy], Figure]]]" = {
    "table-1": table_1,
    "figures-2-to-5": principal_stresses,
}

_FORMS: Final[dict[str, Form]] = {
    **dict.fromkeys(("friction", "paper", "uzawa_30", "uzawa_30_printed_rule", "converged"), fixed(".2f")),
    **dict.fromkeys(("uzawa_converged", "fixed_point_qp", "fixed_point_socp", "condensed"), fixed(".6f")),
    "paper_minus_solution_percent": "{:+.2f} %".format,
}  # fmt: skip


def write(study: PaperStudy, folder: Path) -> tuple[Report, list[Path]]:
    """Write the report, which is the same for the same study, and its tables as CSV; each file whole or not at all."""
    pictures = {name: drawn(f"paper-{name}", partial(draw, study)) for name, draw in PICTURES.items()}
    packages = ("numpy", "scipy", "cvxpy", "clarabel", "qpsolvers")
    settings = {"Versions": DataFrame({"package": packages, "version": [version(name) for name in packages]})}
    frames = {name: DataFrame(rows(study)) for name, rows in TABLES.items()}
    tables = dict(zip(("forces", "stresses"), frames.values(), strict=True))
    made = render(
        "comparisons.paper", "paper", values_of(study), tables, pictures, settings=settings, forms=_FORMS
    )  # fmt: skip
    for name, frame in frames.items():
        write_text(folder / name, frame.to_csv(index=False, lineterminator="\n"))
    return made, [*made.write(folder), *(folder / name for name in frames)]
