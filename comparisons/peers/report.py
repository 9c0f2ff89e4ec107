"""The report of a run, computed from its rows alone: as a document, and as JSON."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Final

from comparisons.peers.figures import COSTS, bounds_figure, error_figure
from comparisons.peers.findings import LARGE_SPREAD, findings
from comparisons.peers.points import Point, Reference, missing, points, reference
from comparisons.peers.tables import (
    bounds_table,
    failures_table,
    meshes_grid,
    missing_table,
    models_grid,
    references_grid,
    reported_table,
    rows_table,
)
from comparisons.report import Exhibit, Report, Section, Table, environment_grids
from comparisons.report.marks import plain
from comparisons.report.numbers import percent
from comparisons.study import Row

SCHEMA: Final = "qvi-contact/peers/2"

_LIMITATIONS: Final = (
    "One problem, the paper's plate: smooth but for one free corner, one material, one contact line.",
    "Each code as its documentation would have it, by scripts of this project, on one thread; other parameters, "
    "elements or solvers may be quicker.",
    "Unknowns are each code's own: GetFEM counts its multipliers, the equilibrium model its stress parameters before "
    "condensation, the companion its displacements.",
    "Memory is that of the whole process with all that its libraries load; on coarse meshes it is nothing else.",
    "A code's first solve in its process is one of the timed ones, after a tiny case that has loaded everything; what "
    "it keeps from one solve to the next is to its advantage.",
    "What displacement codes settle on was found once, with finer meshes of two of the codes that are compared here.",
)  # fmt: skip


def peers_report(rows: Sequence[Row], command: str) -> Report:
    """The report of these rows, which this command made."""
    found = points(rows)
    frictions = sorted({point.friction for point in found})
    known = {friction: reference(found, friction) for friction in frictions}
    sections = [_section(found, friction, known[friction]) for friction in frictions]
    others = _others(found, known)
    failures = failures_table(found)
    if failures:
        sections.append(Section("Failures", (), [failures]))
    if others:
        sections.append(Section("Other codes", ("Codes that did not take part in this run.",), others))
    return Report(
        "peers",
        "The plate by displacement codes",
        "The paper's plate, `qvi_contact.gallery.compressed_plate(μ, cells=(n, n), grading=q)`, on the same grid lines "
        "by each code in one run: stresses in equilibrium (the equilibrium model), this package's displacement model "
        "(the companion), NGSolve (degree p on quadrilaterals, Nitsche's method in the variant named) and GetFEM (Q2, "
        "its integral contact brick, r = E, tolerance 1e-8). Each case has a process of its own. "
        "In the findings an error counts for a mesh only if no finer mesh of the same model has a larger one, and is "
        "unconfirmed where no finer one is solved; times are medians, with smallest and largest where they differ by "
        f"more than {percent(LARGE_SPREAD)}. Made by `{command}`.",
        findings(found),
        sections,
        [
            references_grid([each for each in known.values() if each]),
            models_grid(found),
            meshes_grid(found),
            *environment_grids(rows),
        ],
        _LIMITATIONS,
    )


def _section(found: Sequence[Point], friction: float, known: Reference | None) -> Section:
    """Everything at one μ: bounds first, then errors against costs, then all rows."""
    here = [point for point in found if point.friction == friction]
    exhibits: list[Exhibit] = []
    if any(point.solved and point.bounds for point in here):
        exhibits.append(bounds_figure(found, known, friction))
    if known is not None and any(known.error(point) is not None for point in here):
        exhibits += [error_figure(found, known, cost) for cost in COSTS]
    exhibits += [bounds_table(found, friction), rows_table(found, known, friction)]
    return Section(f"μ = {friction:g}", (), exhibits)


def _others(found: Sequence[Point], known: dict[float, Reference | None]) -> list[Table]:
    reported = next((table for each in known.values() if (table := reported_table(found, each))), None)
    return [*([missing_table(found)] if missing(found) else []), *([reported] if reported else [])]


def as_json(rows: Sequence[Row]) -> str:
    """Values, points and findings as one document."""
    found = points(rows)
    known = [reference(found, friction) for friction in sorted({point.friction for point in found})]
    document = {
        "schema": SCHEMA,
        "units": {"half_force": "MPa × length", "seconds": "s, wall time", "memory": "bytes"},
        "references": [{**asdict(each), "floor": each.floor} for each in known if each],
        "missing": missing(found),
        "rows": [_row(point, known) for point in found],
        "findings": [plain(finding.text) for finding in findings(found)],
    }
    return json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False)


def _row(point: Point, known: Sequence[Reference | None]) -> dict[str, Any]:
    """A point in plain values."""
    model, bounds = point.model, point.bounds
    errors = [each.error(point) for each in known if each and each.friction == point.friction]
    names = ("friction", "cells", "status", "message", "half_force", "unknowns", "iterations", "residual",
             "setup", "solve", "seconds", "spread", "before", "peak", "version")  # fmt: skip
    return {
        "model": model.name, "code": model.code, "mesh": model.mesh,
        **{name: getattr(point, name) for name in names},
        "error": errors[0] if errors else None,
        "bounds": bounds._asdict() if bounds else None,
    }  # fmt: skip
