"""The reports on the plate and on walls, from stored rows alone."""

from functools import partial
from typing import Any

from comparisons.benchmark import measures
from comparisons.benchmark.figures import picture
from comparisons.benchmark.reference import CONVERGED_FRICTION
from comparisons.benchmark.study import WALL, WHOLE
from comparisons.benchmark.tables import FORMS, WALL_FORMS, peers, tables_of, wall_tables
from comparisons.lab.report import Document, drawn, environment_grids, render
from comparisons.lab.study import StoredStudy


def frames_of(whole: StoredStudy, graded: StoredStudy, loops: StoredStudy | None = None) -> dict[str, Any]:
    """What was measured on the plate, as frames by name."""
    solves = measures.solves_of(whole.rows)
    return {
        "solves": solves, "plain": measures.plain_of(whole.rows), "memory": measures.memory_of(whole.rows),
        "growth": measures.plate_growth(solves), "loops": measures.loops_of(loops.rows if loops else (), solves),
        "graded": measures.graded_of(graded.rows), "peers": peers(),
    }  # fmt: skip


def report(whole: StoredStudy, graded: StoredStudy, loops: StoredStudy | None = None) -> Document:
    """The report on the plate; the same rows give the same one."""
    frames = frames_of(whole, graded, loops)
    solves, rows = frames["solves"], [*whole.rows, *graded.rows, *(loops.rows if loops else ())]
    measured = solves.friction.unique()
    friction = CONVERGED_FRICTION if CONVERGED_FRICTION in measured else min(measured, default=None)
    values = {
        **measures.values_of(frames), "friction": friction, "frictions": measured, "cells": solves.cells.unique(),
        "threads": _environment(whole, "threads"), "limit": loops and _environment(loops, "timeout_seconds"),
    }  # fmt: skip
    figures = {"times": drawn("benchmark", partial(picture, frames, friction, values["threads"]))}
    settings = environment_grids(rows)
    return render("comparisons.benchmark", WHOLE, values, tables_of(frames), figures, settings, forms=FORMS)


def document_of(whole: StoredStudy, graded: StoredStudy, loops: StoredStudy | None = None) -> dict[str, Any]:
    """What was measured on the plate, for JSON."""
    records = {name: frame.to_dict("records") for name, frame in frames_of(whole, graded, loops).items()}
    return {"schema": "qvi-contact/benchmark/2", **records}


def _environment(study: StoredStudy, name: str) -> Any:
    """What the first row says of its environment."""
    return next((row.environment[name] for row in study.rows), None)


def wall_report(study: StoredStudy) -> Document:
    """The report on walls."""
    walls = measures.walls_of(study.rows)
    values = {
        **measures.wall_values(walls), "blocks": walls.blocks.unique(), "loads": walls.load.unique(),
        "element": next((row.case["element"] for row in study.rows), None),
        "threads": _environment(study, "threads"), "limit": _environment(study, "timeout_seconds"),
    }  # fmt: skip
    tables = wall_tables(walls, measures.wall_growth(walls))
    return render("comparisons.benchmark", WALL, values, tables, {}, environment_grids(study.rows), forms=WALL_FORMS,
                  template="wall.md")  # fmt: skip


def wall_document(study: StoredStudy) -> dict[str, Any]:
    """What was measured on walls, for JSON."""
    walls = measures.walls_of(study.rows)
    records = {"walls": walls.to_dict("records"), "growth": measures.wall_growth(walls).to_dict("records")}
    return {"schema": "qvi-contact/benchmark-wall/2", **records}
