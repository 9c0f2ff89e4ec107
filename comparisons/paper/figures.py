"""Pictures of the paper's plate."""

from typing import TYPE_CHECKING

import numpy as np

from comparisons.lab.report.drawing import grid, legend_below
from comparisons.paper.study import PaperStudy, Row
from qvi_contact.basics.checks import FloatArray
from qvi_contact.plots import BLUE, GREEN, GREY, ORANGE, VERMILLION
from qvi_contact.plots.fields import stress_crosses
from qvi_contact.plots.style import new_figure
from solvers import QVISolution

_ALONG = np.linspace(0.0, 1.0, 101)  # of an edge, where tractions are drawn

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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
        converged = _map(lower, row, row.reference, largest)
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
    stress_crosses(axes, np.stack([x, y], axis=-1), stress, spacing, largest)
    axes.set_aspect("equal")
    return row.largest_principal_stress(solution)


def contact_tractions(study: PaperStudy) -> "Figure":
    """Converged pressure, friction bound and tangential traction on the contact, and the share of the bound used."""
    chosen = [row for row in study.rows if row.friction in (0.05, 0.1, 0.2, 0.3)]
    figure = new_figure(13.0, 6.0)
    axes = figure.subplots(2, len(chosen), sharex=True, sharey="row")
    for (upper, lower), row in zip(axes.T, chosen, strict=True):
        x, normal, shear = (_apart(part) for part in row.plate.tractions(row.reference.z, _ALONG))
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


def convergence(study: PaperStudy) -> "Figure":
    """Error of P/2 against the number of iterations, Uzawa and fixed point."""
    figure = new_figure(9.0, 4.4)
    left, right = figure.subplots(1, 2, sharey=True)
    chosen = [row for row in study.rows if row.friction in (0.05, 0.1, 0.2)]
    styles = [(BLUE, "-", "o"), (ORANGE, "--", "s"), (GREEN, ":", "^")]
    for row, (colour, line, marker) in zip(chosen, styles, strict=True):
        label = f"μ = {row.friction:g}"
        solution = -row.reference.history[-1].normal_resultant
        left.semilogy(*_errors(row.uzawa_converged, solution), color=colour, linestyle=line, label=label)
        right.semilogy(*_errors(row.plain, solution), color=colour, linestyle=line, marker=marker, label=label)
    left.axvline(study.reference.iterations, color=GREY, linewidth=0.8)
    stopped = study.reference.iterations
    left.annotate(
        f"the paper stopped here ({stopped})", (stopped, 0.97), xycoords=("data", "axes fraction"), xytext=(5, 0),
        textcoords="offset points", va="top", color=GREY,
    )  # fmt: skip
    left.set_title("Uzawa, accumulating rule")
    right.set_title("fixed point (plain), one convex QP each")
    for panel in (left, right):
        panel.set_xlabel("iterations")
        grid(panel)
        panel.legend()
    right.xaxis.get_major_locator().set_params(integer=True)
    left.set(ylabel="relative error of P/2", ylim=(1e-13, None))
    return figure


def _errors(result: QVISolution, solution: float) -> tuple[FloatArray, FloatArray]:
    number = np.array([float(record.number) for record in result.history])
    force = -np.array([record.normal_resultant for record in result.history])
    return number, np.maximum(np.abs(force / solution - 1.0), 1e-16)


def table_1(study: PaperStudy) -> "Figure":
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
