"""The numbers of the report: Table 1, Figures 2-5, every inner solver, and what sentences say of them."""

from typing import Any

import numpy as np

from comparisons.paper.study import TOLERANCE, PaperStudy, Row
from solvers import QVISolution, Status

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
