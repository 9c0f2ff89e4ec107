"""Everything that is computed about the paper's plate; the report, its tables, also as CSV, and its pictures."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure
from pandas import DataFrame

from comparisons.lab.drawing import drawn, grid, legend_below
from comparisons.lab.numbers import fixed, scientific, seconds
from comparisons.lab.reports import Form, Report, render
from comparisons.paper.reference import Reference, load
from qvi_contact import principal_stresses as principal
from qvi_contact.basics.checks import FloatArray
from qvi_contact.basics.terminal import Advance
from qvi_contact.basics.writing import write_text
from qvi_contact.paper import QuarterPlate
from qvi_contact.plots.style import BLUE, GREY, VERMILLION, lines, new_figure
from solvers import QVISolution, Status, available, solve_qvi

SHRINKING: Final = 100.0
"""Iterations after which the shrinking step of the frictionless Uzawa run has halved."""

TOLERANCE: Final = 1e-8
PATIENCE: Final = 3
"""Outer iterations without progress after which a back end is taken at its word that it can do no better."""


@dataclass(frozen=True, eq=False)
class Row:
    """All runs for one friction coefficient, and P/2 as Table 1 prints it.

    "uzawa" and "uzawa_printed_rule" are the paper's number of iterations, with the accumulating rule and with that as
    printed, "uzawa_converged" is the former to the tolerance, at μ = 0 with a shrinking step; "back_ends" are fixed
    points by inner solver, "condensed" solves the inequality directly.
    """

    friction: float
    printed: float
    plate: QuarterPlate
    uzawa: QVISolution
    uzawa_printed_rule: QVISolution
    uzawa_converged: QVISolution
    back_ends: dict[str, QVISolution]
    condensed: QVISolution

    @property
    def reference(self) -> QVISolution:
        """The fixed point that all others are compared with."""
        return self.back_ends["direct:clarabel"]

    def half_force(self, solution: QVISolution) -> float:
        """P/2: the quarter's contact force [N/mm], NaN without a stress state."""
        return self.plate.force(solution.z)

    def largest_principal_stress(self, solution: QVISolution) -> float:
        """Largest |principal stress| [MPa] over the 4×4 Gauss points of each element, NaN without a stress state."""
        return float(np.abs(self.plate.principal_stress(solution.z)[:2]).max())

    def traction_difference(self, solution: QVISolution) -> float:
        """Largest difference of tractions from the reference's over its mean pressure, NaN without a stress state."""
        qvi, states = self.plate.qvi, (solution.z, self.reference.z)
        ours, theirs = (np.stack([qvi.normal(z), qvi.tangential(z)]) for z in states)
        mean_pressure = self.half_force(self.reference) / float(self.plate.x[-1])
        return self.plate.stress_unit * float(np.abs(ours - theirs).max()) / mean_pressure


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
    return len(load().table) * (1 + len(available()))


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
        condensed = solve_qvi(plate.qvi, method="condensed", tolerance=TOLERANCE)
        advance(f"μ = {friction:.2f}")
        back_ends = {}
        for inner in available():
            back_ends[inner] = solve_qvi(plate.qvi, inner=inner, tolerance=TOLERANCE, patience=PATIENCE)
            advance(f"μ = {friction:.2f}, {inner}")
        rows.append(Row(friction, printed, plate, accumulating, as_printed, converged, back_ends, condensed))
    # values of P/2 in the last iterations of the frictionless run with a constant step, each once
    smooth = rows[0].plate
    history = reference.uzawa(smooth.qvi).history[-8:]
    forces = [-smooth.stress_unit * smooth.length_unit * record.normal_resultant for record in history]
    distinct = [b for a, b in pairwise(sorted(forces)) if b - a > 1e-6 * abs(b)]
    return PaperStudy(reference, tuple(rows), (min(forces), *distinct))


FORCE_TOLERANCE, TRACTION_TOLERANCE = 1e-7, 1e-5
LOW_FORCE_TOLERANCE, LOW_TRACTION_TOLERANCE = 1e-5, 1e-4


def table_rows(study: PaperStudy) -> list[dict[str, float]]:
    """Table 1, one row for each friction coefficient; forces are P/2 in N/mm."""
    rows = []
    for row in study.rows:
        runs = {
            "uzawa_30": row.uzawa, "uzawa_30_printed_rule": row.uzawa_printed_rule,
            "uzawa_converged": row.uzawa_converged, "fixed_point_qp": row.back_ends["qp:clarabel"],
            "fixed_point_socp": row.back_ends["socp:clarabel"], "condensed": row.condensed,
        }  # fmt: skip
        forces, solution = {name: row.half_force(run) for name, run in runs.items()}, row.half_force(row.reference)
        percent = 100.0 * (row.printed - solution) / solution
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
            "converged": study.row(friction).largest_principal_stress(study.row(friction).reference),
        }
        for friction, (number, printed) in study.reference.figures.items()
    ]  # fmt: skip


def back_end_rows(study: PaperStudy) -> list[dict[str, Any]]:
    """One row for each inner solver: its worst agreement with the reference over all friction coefficients."""
    runs = {name: [(row, row.back_ends[name]) for row in study.rows] for name in study.rows[0].back_ends}
    runs["uzawa"] = [(row, row.uzawa_converged) for row in study.rows]
    rows = []
    for name, pairs in runs.items():
        # NaN if one run has no result
        force = float(np.max([abs(row.half_force(ours) / row.half_force(row.reference) - 1.0) for row, ours in pairs]))
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
    """How far it agrees, against what the comparison asks for."""
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
    # what the bound at four points an edge leaves open between them, as a share of the mean pressure
    shares = {row.friction: row.plate.excess_between_points(row.reference.z) * row.plate.x[-1]
              / row.half_force(row.reference) for row in study.rows}  # fmt: skip
    between = max(shares, key=lambda mu: shares[mu])
    return {
        "iterations": study.reference.iterations, "cells": study.reference.cells, "printed": len(rows),
        "digits": sum(f"{row['uzawa_30']:.2f}" == f"{row['paper']:.2f}" for row in rows), "deviations": deviations,
        "off": abs(worst["paper_minus_solution_percent"]) / 100.0, "off_at": worst["friction"],
        "low": min(study.cycle), "high": max(study.cycle), "exact": study.reference.exact_without_friction,
        "shrinking": study.row(0.0).half_force(study.row(0.0).uzawa_converged), "solvers": len(ends),
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
    largest = max(printed for _, printed in study.reference.figures.values())
    for column, (friction, (number, printed)) in enumerate(study.reference.figures.items()):
        row = study.row(friction)
        upper, lower = axes[:, column]
        ours = _map(upper, row, row.uzawa, largest)
        upper.set_title(f"Fig. {number}, μ = {friction:g}, Uzawa {study.reference.iterations}\n"
                        f"max {ours:.2f}, printed {printed:.2f} MPa")  # fmt: skip
        converged = _map(lower, row, row.reference, largest)
        lower.set_title(f"converged, μ = {friction:g}\nmax {converged:.2f} MPa")
        lower.set_xlabel("x [length]")
    for left in axes[:, 0]:
        left.set_ylabel("y [length]")
    figure.suptitle("Principal stresses of the quarter plate: compression solid, tension dotted with round ends")
    return figure


def _map(axes: Axes, row: Row, solution: QVISolution, largest: float) -> float:
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


def _crosses(axes: Axes, points: FloatArray, stress: FloatArray, spacing: FloatArray, full: float) -> None:
    """Principal stresses (..., 3) as crosses at points (..., 2): compression solid, tension dotted with round ends.

    A stress of the size `full` is drawn as long as the distance (...) of neighbouring points.
    """
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


def contact_tractions(study: PaperStudy) -> Figure:
    """Converged pressure, friction bound and tangential traction on the contact, and the share of the bound used."""
    chosen = [row for row in study.rows if row.friction in (0.05, 0.1, 0.2, 0.3)]
    figure = new_figure(13.0, 6.0)
    axes, along = figure.subplots(2, len(chosen), sharex=True, sharey="row"), np.linspace(0.0, 1.0, 101)
    for (upper, lower), row in zip(axes.T, chosen, strict=True):
        x, normal, shear = (_apart(part) for part in row.plate.tractions(row.reference.z, along))
        upper.plot(x, -normal, color=GREY, label="pressure $-\\sigma_N$")
        upper.plot(x, row.friction * np.abs(normal), color=BLUE, linestyle="--", label="bound $\\mu|\\sigma_N|$")
        upper.plot(x, np.abs(shear), color=VERMILLION, linestyle=":", label="$|\\sigma_T|$")
        upper.set_title(f"μ = {row.friction:g}")
        upper.set_ylim(bottom=0.0, auto=None)
        x, normal, shear = (part.ravel() for part in row.plate.tractions(row.reference.z))
        lower.axhline(1.0, color=BLUE, linestyle="--", linewidth=1.0)
        used = np.abs(shear / (row.friction * normal))
        lower.plot(x, used, color=VERMILLION, linestyle=":", marker="o", markersize=3)
        lower.set_ylim(0.0, 1.1)
        lower.set_xlabel("x [length]")
    axes[0, 0].set_ylabel("traction [MPa]")
    axes[1, 0].set_ylabel("$|\\sigma_T|$ / bound [-]")
    legend_below(figure, 9, 9)
    figure.suptitle("Contact tractions, converged, and the share of the friction bound used at the Gauss points")
    return figure


def _apart(values: FloatArray) -> FloatArray:
    """Values edge by edge (n, q) as one curve that is broken between edges, where tractions may jump."""
    return np.pad(values, ((0, 0), (0, 1)), constant_values=np.nan).ravel()


def table_1(study: PaperStudy) -> Figure:
    """Table 1 as a picture: printed forces, Uzawa after the same iterations, the solution."""
    figure = new_figure(6.4, 4.4)
    axes = figure.subplots()
    friction = [row.friction for row in study.rows]
    n = study.reference.iterations
    axes.plot(friction, [row.half_force(row.reference) for row in study.rows], color=BLUE, marker="o", markersize=4,
              label="solution (fixed point, QP and SOCP)")  # fmt: skip
    axes.plot(friction, [row.half_force(row.uzawa) for row in study.rows], color=VERMILLION, linestyle="--",
              label=f"Uzawa after {n} iterations")  # fmt: skip
    axes.plot(friction, [row.printed for row in study.rows], color="black", marker="x", linestyle="none",
              markersize=7, label="paper, Table 1")  # fmt: skip
    axes.set(xlabel="friction coefficient μ [-]", ylabel="P/2 [N/mm]")
    axes.set_title("Table 1 is the state after 30 iterations, not the solution" if n == 30 else "Table 1")
    grid(axes)
    axes.legend()
    return figure


TABLES: Final = {"table_1.csv": table_rows, "figures_2_to_5.csv": figure_rows, "back_ends.csv": back_end_rows}
"""Name of a file → its rows."""

PICTURES: Final[Mapping[str, Callable[[PaperStudy], Figure]]] = {
    "table-1": table_1,
    "figures-2-to-5": principal_stresses,
    "contact-tractions": contact_tractions,
}

_FORMS: Final[dict[str, Form]] = {
    **dict.fromkeys(("friction", "paper", "uzawa_30", "uzawa_30_printed_rule", "converged"), fixed(".2f")),
    **dict.fromkeys(("uzawa_converged", "fixed_point_qp", "fixed_point_socp", "condensed"), fixed(".6f")),
    **dict.fromkeys(("half_force_difference", "traction_difference"), scientific), "seconds": seconds,
    "paper_minus_solution_percent": "{:+.2f} %".format,
}  # fmt: skip


def write(study: PaperStudy, folder: Path) -> tuple[Report, list[Path]]:
    """Write the report, which is the same for the same study, and its tables as CSV; each file whole or not at all."""
    pictures = {name: drawn(f"paper-{name}", partial(draw, study)) for name, draw in PICTURES.items()}
    packages = ("numpy", "scipy", "cvxpy", "clarabel", "osqp", "qpsolvers")
    versions = DataFrame({"package": packages, "version": [version(name) for name in packages]})
    frames = {name: DataFrame(rows(study)) for name, rows in TABLES.items()}
    forces, stresses, ends = frames.values()
    ends = ends.assign(share=ends.certified.astype(str) + "/" + ends.problems.astype(str))
    tables = {"forces": forces, "stresses": stresses, "solvers": ends, "versions": versions}
    made = render("comparisons.paper", "paper", values_of(study), tables, pictures, forms=_FORMS)
    for name, frame in frames.items():
        write_text(folder / name, frame.to_csv(index=False, lineterminator="\n"))
    return made, [*made.write(folder), *(folder / name for name in frames)]
