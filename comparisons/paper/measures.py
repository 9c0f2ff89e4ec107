"""The numbers of the report: Table 1, Figures 2-5, every inner solver, and what sentences say of them."""

from typing import Any

import numpy as np

from comparisons.paper.study import TOLERANCE, PaperStudy, half_force, largest_principal_stress, traction_difference
from qvi_contact import ContactResult
from solvers import Status

FORCE_TOLERANCE, TRACTION_TOLERANCE = 1e-7, 1e-5
LOW_FORCE_TOLERANCE, LOW_TRACTION_TOLERANCE = 1e-5, 1e-4


def percent(value: float, reference: float) -> float:
    """Difference in percent of the reference."""
    return 100.0 * (value - reference) / reference


def table_rows(study: PaperStudy) -> list[dict[str, float]]:
    """Table 1, one row for each friction coefficient; forces are P/2 in N/mm."""
    return [
        {
            "friction": row.friction, "paper": row.printed, "uzawa_30": half_force(row.uzawa),
            "uzawa_30_printed_rule": half_force(row.uzawa_printed_rule),
            "uzawa_converged": half_force(row.uzawa_converged), "fixed_point_qp": half_force(row.best_qp),
            "fixed_point_socp": half_force(row.best_socp), "condensed": half_force(row.condensed),
            "strict": half_force(row.strict),
            "paper_minus_solution_percent": percent(row.printed, half_force(row.reference)),
        }
        for row in study.rows
    ]  # fmt: skip


def figure_rows(study: PaperStudy) -> list[dict[str, float]]:
    """Figures 2-5, one row each; largest |principal stress| in MPa."""
    return [
        {
            "figure": number, "friction": friction, "paper": printed,
            "uzawa_30": largest_principal_stress(study.row(friction).uzawa),
            "converged": largest_principal_stress(study.row(friction).reference),
        }
        for friction, (number, printed) in study.reference.figures.items()
    ]  # fmt: skip


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
        "solver": name, "certified": sum(ours.status is Status.SOLVED for ours, _ in pairs), "problems": len(pairs),
        "half_force_difference": force, "traction_difference": traction,
        "accuracy": float(np.max([ours.certificate.accuracy for ours, _ in pairs])),
        "outer_iterations": sum(ours.iterations for ours, _ in pairs),
        "seconds": sum(sum(ours.solution.timings.values()) for ours, _ in pairs), "verdict": _verdict(force, traction),
        "remark": next((ours.message for ours, _ in pairs if ours.status is not Status.SOLVED), ""),
    }  # fmt: skip


def _verdict(force: float, traction: float) -> str:
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
    full = _verdict(0.0, 0.0)
    return {
        "iterations": study.reference.iterations, "cells": study.reference.cells, "printed": len(rows),
        "digits": sum(f"{row['uzawa_30']:.2f}" == f"{row['paper']:.2f}" for row in rows), "deviations": deviations,
        "off": abs(worst["paper_minus_solution_percent"]) / 100.0, "off_at": worst["friction"],
        "low": min(study.cycle), "high": max(study.cycle), "exact": study.reference.exact_without_friction,
        "shrinking": half_force(study.row(0.0).uzawa_converged), **_between_points(study), "solvers": len(ends),
        "short": [f"{row['solver']} ({row['verdict']})" for row in ends if row["verdict"] != full],
        "doubtful": [f"{row['solver']} ({row['certified']}/{row['problems']})" for row in ends
                     if row["certified"] < row["problems"]],
        "force_tolerance": FORCE_TOLERANCE, "traction_tolerance": TRACTION_TOLERANCE, "tolerance": TOLERANCE,
    }  # fmt: skip


def _between_points(study: PaperStudy) -> dict[str, float]:
    """What the bound at four points an edge leaves open, and what closing that costs."""
    row = max(study.rows, key=lambda row: row.reference.contacts["plate"].excess_between_points)
    mean = row.reference.contacts["plate"].normal_force / row.reference.contacts["plate"].weights.sum()
    excess, left = (
        max(0.0, result.contacts["plate"].excess_between_points) / mean for result in (row.reference, row.strict)
    )
    changes = {row.friction: percent(half_force(row.strict), half_force(row.reference)) for row in study.rows}
    friction = max(changes, key=lambda mu: abs(changes[mu]))
    return {"excess": excess, "left": left, "excess_at": row.friction, "change": changes[friction] / 100.0,
            "change_at": friction}  # fmt: skip
