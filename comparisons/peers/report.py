"""The report of a run, computed from its rows alone: as a document, and as JSON."""

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from comparisons.lab.report import environment_grids
from comparisons.lab.report.marks import plain
from comparisons.lab.report.old import Exhibit, Report, Section, Table, write_report
from comparisons.lab.study import Row
from comparisons.peers.figures import COSTS, best_figure, bounds_figure, error_figure
from comparisons.peers.findings import findings
from comparisons.peers.models import BRACKET
from comparisons.peers.points import Point, Reference, missing, points, reference
from comparisons.peers.tables import (
    bounds_table,
    costs_table,
    failures_table,
    meshes_grid,
    missing_table,
    models_grid,
    references_grid,
    reported_table,
    rows_table,
)
from qvi_contact.basics.writing import write_text

SCHEMA: Final = "qvi-contact/peers/3"

_LIMITATIONS: Final = (
    "One problem, the paper's plate: smooth but for one free corner, one material, one contact line.",
    "Each code as its documentation would have it, by scripts of this project, on one thread; other parameters, "
    "elements or solvers may be quicker.",
    "Unknowns are each code's own: GetFEM counts its multipliers, NGSolve and the companion all displacements, this "
    "package its stress parameters without those inside triangles (3, 9 and 18 a triangle for p = 4, 5 and 6), which "
    "are condensed. NGSolve condenses the inside of cells too, but it is counted here; without it NGSolve has about as "
    "many unknowns as this package, or fewer.",
    "Memory is that of the whole process with all that its libraries load; on coarse meshes it is nothing else.",
    "A code's first solve in its process is one of the timed ones, after a tiny case that has loaded everything; what "
    "it keeps from one solve to the next is to its advantage.",
    "Meshes graded to corner and transition use what is known of the solution; a user finds the transition by looking "
    "at a first solution.",
    "NGSolve assembles cells below the contact in each Newton step, the others once, and condenses the unknowns inside "
    "cells; eliminating all but the contact, as this package does by default, might be quicker still.",
    "Errors are relative to values computed once, apart from this run, to which NGSolve and triangles agree.",
)  # fmt: skip


_COLUMNS: Final = (
    "friction", "number", "status", "half_force", "unknowns", "iterations", "residual", "setup", "solve", "before",
    "peak",
)  # fmt: skip


def write_peers(rows: Sequence[Row], command: str, folder: Path) -> tuple[Report, list[Path]]:
    """Write the report of these rows, which this command made, and `peers.csv` with one line for each run."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("model", *_COLUMNS))
    for point in points(rows):
        values = [getattr(point, name) for name in _COLUMNS]
        writer.writerow([point.model.name, *(_joined(each) if isinstance(each, tuple) else each for each in values)])
    document = peers_report(rows, command)
    written = write_report(document, folder)
    write_text(folder / "peers.csv", text.getvalue())
    return document, [*written, folder / "peers.csv"]


def _joined(times: tuple[float, ...]) -> str:
    return " ".join(f"{each:.5f}" for each in times)


def peers_report(rows: Sequence[Row], command: str) -> Report:
    """The report of these rows, which this command made."""
    found = points(rows)
    frictions = list(dict.fromkeys(point.friction for point in found))
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
        "The paper's plate, `qvi_contact.gallery.compressed_plate(μ)`, by each code in one run: this package on "
        "rectangles (element of Bogner, Fox and Schmit) and on triangles (Hsieh, Clough and Tocher, degree p), its "
        "displacement model (the companion), NGSolve (degree p, Nitsche's method in the variant named, static "
        "condensation) and GetFEM (Qp, its integral contact brick, r = E, tolerance 1e-8). Meshes have equal cells, or "
        "are graded to the free corner, or to corner and to the transition of stick and slip; the table of meshes says "
        "how. Each case has a process of its own. Times are processor times on one thread, set-up, solve and, for this "
        f"package, the certificate. Made by `{command}`.",
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
    """Everything at one μ: what errors cost, all errors, bounds, all rows."""
    here = [point for point in found if point.friction == friction]
    exhibits: list[Exhibit] = []
    if known is not None and any(known.error(point) is not None for point in here):
        costs = costs_table(found, known)
        exhibits += [*([costs] if costs else []), *(best_figure(found, known, cost) for cost in COSTS)]
        exhibits += [error_figure(found, known, cost) for cost in COSTS]
    if any(point.solved and point.bounds for point in here):
        exhibits.append(bounds_figure(found, known, friction))
    if any(point.model.code == BRACKET for point in here):
        exhibits.append(bounds_table(found, friction))
    exhibits.append(rows_table(found, known, friction))
    return Section(f"μ = {friction:g}", (), exhibits)


def _others(found: Sequence[Point], known: dict[float, Reference | None]) -> list[Table]:
    reported = next((table for each in known.values() if (table := reported_table(found, each))), None)
    return [*([missing_table(found)] if missing(found) else []), *([reported] if reported else [])]


def as_json(rows: Sequence[Row]) -> str:
    """Values, points and findings as one document."""
    found = points(rows)
    known = [reference(found, friction) for friction in list(dict.fromkeys(point.friction for point in found))]
    document = {
        "schema": SCHEMA,
        "units": {"half_force": "MPa × length", "seconds": "s, processor time", "memory": "bytes"},
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
    names = ("friction", "number", "status", "message", "half_force", "unknowns", "iterations", "residual",
             "setup", "solve", "seconds", "spread", "before", "peak", "version")  # fmt: skip
    return {
        "model": model.name, "code": model.code, "mesh": model.mesh,
        **{name: getattr(point, name) for name in names},
        "error": errors[0] if errors else None,
        "bounds": bounds._asdict() if bounds else None,
    }  # fmt: skip
