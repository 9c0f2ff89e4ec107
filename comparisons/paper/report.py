"""The report on the paper's plate: as a document, as CSV, as JSON."""

from collections.abc import Callable, Mapping
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from pandas import DataFrame

from comparisons.lab.report import Document, drawn, findings_of, render, write_report
from comparisons.lab.report.numbers import fixed, scientific, seconds
from comparisons.lab.study.rows import finite_json
from comparisons.lab.tables import Form, Grid
from comparisons.paper import figures
from comparisons.paper.study import TOLERANCE, PaperStudy, Row
from qvi_contact.basics.writing import write_text
from solvers import QVISolution, Status

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORCE_TOLERANCE, TRACTION_TOLERANCE = 1e-7, 1e-5
LOW_FORCE_TOLERANCE, LOW_TRACTION_TOLERANCE = 1e-5, 1e-4


def percent(value: float, reference: float) -> float:
    """Difference in percent of the reference."""
    return 100.0 * (value - reference) / reference


def table_rows(study: PaperStudy) -> list[dict[str, float]]:
    """Table 1, one row for each friction coefficient; forces are P/2 in N/mm."""
    return [
        {
            "friction": row.friction, "paper": row.printed, "uzawa_30": row.half_force(row.uzawa),
            "uzawa_30_printed_rule": row.half_force(row.uzawa_printed_rule),
            "uzawa_converged": row.half_force(row.uzawa_converged), "fixed_point_qp": row.half_force(row.best_qp),
            "fixed_point_socp": row.half_force(row.best_socp), "condensed": row.half_force(row.condensed),
            "paper_minus_solution_percent": percent(row.printed, row.half_force(row.reference)),
        }
        for row in study.rows
    ]  # fmt: skip


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
    names = study.rows[0].back_ends
    rows = [_agreement(name, [(row, row.back_ends[name]) for row in study.rows]) for name in names]
    rows.append(_agreement("uzawa", [(row, row.uzawa_converged) for row in study.rows]))
    return rows


def _agreement(name: str, pairs: list[tuple[Row, QVISolution]]) -> dict[str, Any]:
    forces = [abs(row.half_force(ours) / row.half_force(row.reference) - 1.0) for row, ours in pairs]
    force = float(np.max(forces))  # NaN if one run has no result
    traction = float(np.max([row.traction_difference(ours) for row, ours in pairs]))
    return {
        "solver": name, "certified": sum(ours.status is Status.SOLVED for _, ours in pairs), "problems": len(pairs),
        "half_force_difference": force, "traction_difference": traction,
        "accuracy": float(np.max([ours.certificate.accuracy for _, ours in pairs])),
        "outer_iterations": sum(ours.iterations for _, ours in pairs),
        "seconds": sum(sum(ours.timings.values()) for _, ours in pairs), "verdict": verdict(force, traction),
        "remark": next((ours.message for _, ours in pairs if ours.status is not Status.SOLVED), ""),
    }  # fmt: skip


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
    return {
        "iterations": study.reference.iterations, "cells": study.reference.cells, "printed": len(rows),
        "digits": sum(f"{row['uzawa_30']:.2f}" == f"{row['paper']:.2f}" for row in rows), "deviations": deviations,
        "off": abs(worst["paper_minus_solution_percent"]) / 100.0, "off_at": worst["friction"],
        "low": min(study.cycle), "high": max(study.cycle), "exact": study.reference.exact_without_friction,
        "shrinking": study.row(0.0).half_force(study.row(0.0).uzawa_converged), "solvers": len(ends),
        **_between_points(study),
        "short": [f"{row['solver']} ({row['verdict']})" for row in ends if row["verdict"] != full],
        "doubtful": [f"{row['solver']} ({row['certified']}/{row['problems']})" for row in ends
                     if row["certified"] < row["problems"]],
        "force_tolerance": FORCE_TOLERANCE, "traction_tolerance": TRACTION_TOLERANCE, "tolerance": TOLERANCE,
    }  # fmt: skip


def _between_points(study: PaperStudy) -> dict[str, float]:
    """What the bound at four points an edge leaves open, as a share of the mean pressure, and where."""
    shares = {row.friction: row.plate.excess_between_points(row.reference.z) * row.plate.x[-1]
              / row.half_force(row.reference) for row in study.rows}  # fmt: skip
    friction = max(shares, key=lambda mu: shares[mu])
    return {"excess": shares[friction], "excess_at": friction}


TABLES = {"table_1.csv": table_rows, "figures_2_to_5.csv": figure_rows, "back_ends.csv": back_end_rows}
"""Name of a file → its rows."""

PICTURES: "Mapping[str, Callable[[PaperStudy], Figure]]" = {
    "table-1": figures.table_1,
    "figures-2-to-5": figures.principal_stresses,
    "contact-tractions": figures.contact_tractions,
    "convergence": figures.convergence,
}

_FORMS: Final[dict[str, Form]] = {
    **dict.fromkeys(("friction", "paper", "uzawa_30", "uzawa_30_printed_rule", "converged"), fixed(".2f")),
    **dict.fromkeys(("uzawa_converged", "fixed_point_qp", "fixed_point_socp", "condensed"), fixed(".6f")),
    **dict.fromkeys(("half_force_difference", "traction_difference"), scientific), "seconds": seconds,
    "paper_minus_solution_percent": "{:+.2f} %".format,
}  # fmt: skip


def report(study: PaperStudy) -> Document:
    """The report; the same study gives the same one, but for times."""
    return _filled(study, {name: drawn(f"paper-{name}", partial(draw, study)) for name, draw in PICTURES.items()})


def _filled(study: PaperStudy, pictures: Mapping[str, str]) -> Document:
    versions = Grid("Versions", ("package", "version"), list(_versions().items()))
    ends = DataFrame(back_end_rows(study))
    tables = {
        "forces": DataFrame(table_rows(study)), "stresses": DataFrame(figure_rows(study)),
        "solvers": ends.assign(share=ends.certified.astype(str) + "/" + ends.problems.astype(str)),
    }  # fmt: skip
    return render("comparisons.paper", "paper", values_of(study), tables, pictures, [versions], forms=_FORMS)


def as_document(study: PaperStudy) -> dict[str, Any]:
    """The whole report as plain data for JSON; what is not a number becomes null."""
    document = {
        "schema": "qvi-contact/paper/3",
        "source": "Więckowski, Dual finite element method in friction problems, Mech. Teoret. Stos. (1992)",
        "units": {"forces": "N/mm", "stresses": "MPa"},
        "rows": table_rows(study),
        "figures": figure_rows(study),
        "back_ends": back_end_rows(study),
        "uzawa_without_friction": {
            "cycle_low": min(study.cycle), "cycle_high": max(study.cycle),
            "shrinking_step": study.row(0.0).half_force(study.row(0.0).uzawa_converged),
            "exact": study.reference.exact_without_friction,
        },
        "findings": findings_of(_filled(study, dict.fromkeys(PICTURES, "")).text),
        "versions": _versions(),
    }  # fmt: skip
    return dict(finite_json(document, null=True))


def _versions() -> dict[str, str]:
    return {name: version(name) for name in ("numpy", "scipy", "cvxpy", "clarabel", "osqp", "qpsolvers")}


def write(study: PaperStudy, folder: Path) -> tuple[Document, list[Path]]:
    """Write the report and its tables as CSV; each file appears whole or not at all."""
    for name, rows in TABLES.items():
        write_text(folder / name, DataFrame(rows(study)).to_csv(index=False, lineterminator="\n"))
    made = report(study)
    return made, [*write_report(made, folder), *(folder / name for name in TABLES)]
