"""The report on the paper's plate: terminal tables, CSV, JSON, pictures."""

import csv
import io
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from comparisons.paper.study import (
    TOLERANCE,
    PaperStudy,
    half_force,
    largest_principal_stress,
    traction_difference,
)
from qvi_contact import ContactResult
from qvi_contact.basics.terminal import Advance
from qvi_contact.basics.writing import replacing, write_text
from qvi_contact.plots import has_matplotlib
from qvi_contact.plots.style import settings
from solvers import Status

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

FORCE_TOLERANCE, TRACTION_TOLERANCE = 1e-7, 1e-5
LOW_FORCE_TOLERANCE, LOW_TRACTION_TOLERANCE = 1e-5, 1e-4

TABLES = ("table_1.csv", "figures_2_to_5.csv", "back_ends.csv")
PICTURES = ("figures_2_to_5", "contact_tractions", "convergence", "table_1")
FILES = (*TABLES, *PICTURES)


def percent(value: float, reference: float) -> float:
    """Difference in percent of the reference."""
    return 100.0 * (value - reference) / reference


def table_rows(study: PaperStudy) -> list[dict[str, float]]:
    """Table 1, one row for each friction coefficient; forces are P/2 in MPa × length."""
    return [
        {
            "friction": row.friction,
            "paper": row.printed,
            "uzawa_30": half_force(row.uzawa),
            "uzawa_30_printed_rule": half_force(row.uzawa_printed_rule),
            "uzawa_converged": half_force(row.uzawa_converged),
            "fixed_point_qp": half_force(row.best_qp),
            "fixed_point_socp": half_force(row.best_socp),
            "condensed": half_force(row.condensed),
            "strict": half_force(row.strict),
            "paper_minus_solution_percent": percent(row.printed, half_force(row.reference)),
        }
        for row in study.rows
    ]


def figure_rows(study: PaperStudy) -> list[dict[str, float]]:
    """Figures 2-5, one row each; largest |principal stress| in MPa."""
    return [
        {
            "figure": number,
            "friction": friction,
            "paper": printed,
            "uzawa_30": largest_principal_stress(study.row(friction).uzawa),
            "converged": largest_principal_stress(study.row(friction).reference),
        }
        for friction, (number, printed) in study.reference.figures.items()
    ]


def back_end_rows(study: PaperStudy) -> list[dict[str, Any]]:
    """One row for each inner solver: its worst agreement with the reference over all friction coefficients."""
    names = study.rows[0].back_ends
    rows = [_agreement(name, [(row.back_ends[name], row.reference) for row in study.rows]) for name in names]
    rows.append(_agreement("uzawa", [(row.uzawa_converged, row.reference) for row in study.rows]))
    return rows


def _agreement(name: str, pairs: list[tuple[ContactResult, ContactResult]]) -> dict[str, Any]:
    forces = [abs(half_force(ours) / half_force(best) - 1.0) for ours, best in pairs]
    force = float(np.max(forces))  # NaN if one run has no result
    traction = float(np.max([traction_difference(ours, best) for ours, best in pairs]))
    return {
        "solver": name,
        "certified": sum(ours.status is Status.SOLVED for ours, _ in pairs),
        "problems": len(pairs),
        "half_force_difference": force,
        "traction_difference": traction,
        "accuracy": float(np.max([ours.certificate.accuracy for ours, _ in pairs])),
        "outer_iterations": sum(ours.iterations for ours, _ in pairs),
        "seconds": sum(sum(ours.solution.timings.values()) for ours, _ in pairs),
        "verdict": _verdict(force, traction),
        "remark": next((ours.message for ours, _ in pairs if ours.status is not Status.SOLVED), ""),
    }


def _verdict(force: float, traction: float) -> str:
    """How far it agrees, against what the comparison asks for."""
    if force <= FORCE_TOLERANCE and traction <= TRACTION_TOLERANCE:
        return f"≤ {FORCE_TOLERANCE:.0e}"
    if force <= LOW_FORCE_TOLERANCE and traction <= LOW_TRACTION_TOLERANCE:
        return f"≤ {LOW_FORCE_TOLERANCE:.0e} only"
    return "falls short"


def as_document(study: PaperStudy) -> dict[str, Any]:
    """The whole report as plain data for JSON; what is not a number becomes null."""
    return {
        "schema": "qvi-contact/paper/1",
        "source": "Więckowski, Dual finite element method in friction problems, Mech. Teoret. Stos. (1992)",
        "units": {"forces": "MPa × length", "stresses": "MPa"},
        "rows": [_finite(row) for row in table_rows(study)],
        "figures": [_finite(row) for row in figure_rows(study)],
        "back_ends": [_finite(row) for row in back_end_rows(study)],
        "uzawa_without_friction": _finite(
            {
                "cycle_low": min(study.cycle),
                "cycle_high": max(study.cycle),
                "shrinking_step": half_force(study.row(0.0).uzawa_converged),
                "exact": study.reference.exact_without_friction,
            }
        ),
        "findings": findings(study),
        "versions": {name: version(name) for name in ("numpy", "scipy", "cvxpy", "clarabel", "osqp", "qpsolvers")},
    }


def _finite(row: Mapping[str, Any]) -> dict[str, Any]:
    """The row with None for what is not a finite number."""
    return {key: None if isinstance(v, float) and not np.isfinite(v) else v for key, v in row.items()}


def findings(study: PaperStudy) -> list[str]:
    """What the numbers say, in sentences computed from them."""
    rows = table_rows(study)
    exact_digits = sum(f"{row['uzawa_30']:.2f}" == f"{row['paper']:.2f}" for row in rows)
    printed_rule = [row for row in rows if f"{row['uzawa_30_printed_rule']:.2f}" != f"{row['paper']:.2f}"]
    worst = max(rows, key=lambda row: abs(row["paper_minus_solution_percent"]))
    low, high = min(study.cycle), max(study.cycle)
    sentences = [
        f"Uzawa's accumulating rule gives {exact_digits} of the {len(rows)} printed forces to every digit after "
        f"{study.reference.iterations} iterations.",
        "The rule as printed (sign of (4.1) corrected) gives the same except "
        + (
            ", ".join(
                f"{row['uzawa_30_printed_rule']:.2f} instead of {row['paper']:.2f} at μ = {row['friction']:.2f}"
                for row in printed_rule
            )
            or "nowhere"
        )
        + ".",
        f"Table 1 is not converged: at μ = {worst['friction']:.2f} the printed force is "
        f"{abs(worst['paper_minus_solution_percent']):.2f} % off the solution of the discrete problem.",
        f"Without friction the step never shrinks and the accumulating rule ends in a cycle, {high:.3f} / {low:.3f}; "
        f"with a shrinking step it reaches {half_force(study.row(0.0).uzawa_converged):.6f} "
        f"(exact {study.reference.exact_without_friction:.2f}).",
    ]
    sentences.append(_between_points(study))
    ends = back_end_rows(study)
    full = f"≤ {FORCE_TOLERANCE:.0e}"
    short = [f"{row['solver']} ({row['verdict']})" for row in ends if row["verdict"] != full]
    sentences.append(
        f"{len(ends) - len(short)} of {len(ends)} solvers agree in P/2 to {FORCE_TOLERANCE:.0e} and in the tractions "
        f"to {TRACTION_TOLERANCE:.0e} of the mean pressure"
        + (f"; short of that: {', '.join(short)}." if short else ".")
    )
    doubtful = [
        f"{row['solver']} ({row['certified']}/{row['problems']})" for row in ends if row["certified"] < row["problems"]
    ]
    if doubtful:
        sentences.append(f"Not certified at {TOLERANCE:.0e} on every problem: {', '.join(doubtful)}.")
    return sentences


def _between_points(study: PaperStudy) -> str:
    """What the bound at four points an edge leaves open, and what closing that costs."""
    row = max(study.rows, key=lambda row: row.reference.contacts["plate"].excess_between_points)
    mean = row.reference.contacts["plate"].normal_force / row.reference.contacts["plate"].weights.sum()
    excess, left = (
        max(0.0, result.contacts["plate"].excess_between_points) / mean for result in (row.reference, row.strict)
    )
    changes = {row.friction: percent(half_force(row.strict), half_force(row.reference)) for row in study.rows}
    friction = max(changes, key=lambda mu: abs(changes[mu]))
    return (
        f"The friction bound holds at four points of each edge: between them it is exceeded by up to "
        f"{100.0 * excess:.2g} % of the mean pressure (μ = {row.friction:.2f}), with strict bounds by {left:.0e}; "
        f"they change P/2 by up to {changes[friction]:+.3f} % (μ = {friction:.2f})."
    )


def show(study: PaperStudy, written: list[Path]) -> None:
    """Print the tables on standard output."""
    from rich.console import Console

    console = Console(highlight=False, markup=False)
    if not console.is_terminal:
        console = Console(highlight=False, markup=False, width=100)
    console.print(_table_1(study), _table_figures(study), _table_back_ends(study))
    for sentence in findings(study):
        console.print(f"• {sentence}")
    if written and not has_matplotlib():
        console.print("\nNo pictures: they need matplotlib, python -m pip install 'qvi-contact[plot]'")
    if written:
        console.print(f"\nWritten to {written[0].parent}: {', '.join(path.name for path in written)}", soft_wrap=True)


def _table_1(study: PaperStudy) -> "Table":
    n = study.reference.iterations
    table = _new_table(f"Table 1: P/2 [MPa × length], {study.reference.cells}×{study.reference.cells} elements")
    headings = ("μ", "paper", f"Uzawa\n{n} it.", f"as printed\n{n} it.", "Uzawa\nconverged", "fixed point\nQP")
    for heading in (*headings, "fixed point\nSOCP", "strict", "paper −\nsolution"):
        table.add_column(heading, justify="right")
    for row in table_rows(study):
        table.add_row(
            f"{row['friction']:.2f}",
            *(f"{row[key]:.2f}" for key in ("paper", "uzawa_30", "uzawa_30_printed_rule")),
            *(f"{row[key]:.6f}" for key in ("uzawa_converged", "fixed_point_qp", "fixed_point_socp", "strict")),
            f"{row['paper_minus_solution_percent']:+.2f} %",
        )
    return table


def _table_figures(study: PaperStudy) -> "Table":
    table = _new_table("Figures 2-5: largest |principal stress| [MPa] at the 4×4 Gauss points")
    for heading in ("figure", "μ", "paper", f"Uzawa {study.reference.iterations}", "converged"):
        table.add_column(heading, justify="right")
    for row in figure_rows(study):
        table.add_row(
            f"{row['figure']:.0f}",
            f"{row['friction']:.1f}",
            *(f"{row[k]:.2f}" for k in ("paper", "uzawa_30", "converged")),
        )
    return table


def _table_back_ends(study: PaperStudy) -> "Table":
    table = _new_table("Solvers on the seven problems: largest difference from direct Clarabel")
    table.add_column("solver")
    for heading in ("certified", "P/2\nrelative", "tractions /\nmean pressure", "time\n[s]"):
        table.add_column(heading, justify="right")
    table.add_column("agreement")
    for row in back_end_rows(study):
        table.add_row(
            row["solver"],
            f"{row['certified']}/{row['problems']}",
            f"{row['half_force_difference']:.1e}",
            f"{row['traction_difference']:.1e}",
            f"{row['seconds']:.2f}",
            row["verdict"],
        )
    return table


def _new_table(title: str) -> "Table":
    from rich import box
    from rich.table import Table

    return Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, title_style="bold", padding=(0, 1, 0, 0))


def write(study: PaperStudy, folder: Path, advance: Advance) -> list[Path]:
    """Write tables and, where matplotlib is installed, pictures; each file appears whole or not at all."""
    written = []
    for name, rows in zip(TABLES, (table_rows(study), figure_rows(study), back_end_rows(study)), strict=True):
        write_text(folder / name, _csv(rows))
        written.append(folder / name)
        advance(name)
    for name, draw in _drawings() if has_matplotlib() else ():
        with settings():
            written += _write_picture(draw(study), folder / name)
        advance(name)
    return written


def _write_picture(figure: "Figure", path: Path) -> list[Path]:
    """The figure as PNG and as SVG."""
    written = []
    for suffix in (".png", ".svg"):
        with replacing(path.with_suffix(suffix)) as temporary:
            figure.savefig(temporary, dpi=150, metadata={"Date": None} if suffix == ".svg" else None)
            figure.set_layout_engine("none")  # keep the layout just computed
        written.append(path.with_suffix(suffix))
    return written


def _drawings() -> Iterator[tuple[str, "Callable[[PaperStudy], Figure]"]]:
    from comparisons.paper import figures

    return zip(
        PICTURES,
        (figures.principal_stresses, figures.contact_tractions, figures.convergence, figures.table_1),
        strict=True,
    )


def _csv(rows: list[dict[str, Any]]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
