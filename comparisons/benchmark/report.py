"""The reports on the plate and on walls and their tables, from stored rows alone."""

from functools import partial
from typing import Any, Final

from pandas import DataFrame

from comparisons.benchmark import measures
from comparisons.benchmark.figures import picture
from comparisons.benchmark.reference import CONVERGED_FRICTION, MEANINGLESS, PEERS, settled_error
from comparisons.benchmark.study import WALL, WHOLE
from comparisons.lab.report import Document, drawn, environment_grids, render
from comparisons.lab.report.numbers import NOTHING, fixed, listing, memory, percent, scientific, seconds, significant
from comparisons.lab.study import StoredStudy
from comparisons.lab.tables import Form
from qvi_contact.discretization.families import CELLS


def _cells(value: float) -> str:
    return NOTHING if value != value else f"{value:.0f}²"


def _error(value: float | None) -> str:
    """An error of P/2; one below what displacement codes agree to means nothing."""
    return f"< {scientific(MEANINGLESS, 1)}" if value is not None and value < MEANINGLESS else scientific(value)


_TIMES: Final = ("assembly", "solve", "factorisation", "interior_point", "certificate", "rest", "analysis", "numeric",
                 "plain", "whole", "seconds")  # fmt: skip
_POWERS: Final = {"solve": "power", "whole": "power_with_assembly"}
_COMMON: Final[dict[str, Form]] = {
    **dict.fromkeys(_TIMES, seconds), **dict.fromkeys(("friction", "load", "grading"), fixed("g")), "peak": memory,
    **dict.fromkeys(("unknowns", "iterations", "corrections", "runs", "contact_points", "blocks"), fixed(".0f")),
    "accuracy": scientific,
    **dict.fromkeys((*_POWERS.values(), "own_factorisation", "fastest_factorisation"), fixed(".2f")),
}  # fmt: skip

FORMS: Final[dict[str, Form]] = {
    **_COMMON, **dict.fromkeys(("cells", "from", "to"), _cells), "spread": percent, "imports": memory,
    **dict.fromkeys(("ratio_own", "ratio_fastest"), fixed(".2f")), "more": fixed(".0f"), "met": listing,
    "half_force": fixed(".8f"), "force": fixed(".5f"), "error": _error, "ratio": lambda value: significant(value, 4),
    **dict.fromkeys(("half_force_error", "half_force_difference"), scientific),
}  # fmt: skip
"""Column of the tables on the plate → how its values read."""

WALL_FORMS: Final[dict[str, Form]] = {
    **_COMMON, **dict.fromkeys(("from", "to"), fixed(".0f")), "ratio": fixed(".1f"),
    "message": lambda text: text or NOTHING, "element": CELLS.__getitem__,
}  # fmt: skip
"""The same of the tables on walls."""


def tables_of(frames: dict[str, Any]) -> dict[str, DataFrame]:
    """The tables of the plate by name."""
    solves, rounded = frames["solves"], {"half_force": "force"}
    return {
        "times-table": solves, "answers": solves, **{name: frames[name] for name in ("plain", "memory", "loops")},
        "growth": frames["growth"].rename(columns=_POWERS),
        **{name: frames[name].rename(columns=rounded) for name in ("graded", "peers")},
    }  # fmt: skip


def wall_tables(walls: DataFrame, growth: DataFrame) -> dict[str, DataFrame]:
    """The tables of the walls by name."""
    return {"walls": walls, "growth": growth.rename(columns=_POWERS)}


def peers() -> DataFrame:
    """Runs of other codes, with their errors."""
    reported = DataFrame(PEERS)
    return reported.assign(
        cells=reported.cells.astype(float), error=[settled_error(each.half_force, CONVERGED_FRICTION) for each in PEERS]
    )


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
        **measures.wall_values(walls), "blocks": sorted(walls.blocks.unique()), "loads": sorted(walls.load.unique()),
        "elements": walls.element.unique(), "cells": CELLS,
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
