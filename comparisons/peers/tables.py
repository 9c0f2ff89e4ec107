"""Tables of a run, once for the terminal and for Markdown."""

from typing import Any, Final

from comparisons.benchmark.reference import SETTLED, SETTLED_UNCERTAINTY
from comparisons.tables import Grid

Document = dict[str, Any]

_NOTHING: Final = "-"
_MIB: Final = 2.0**20


def tables(document: Document) -> list[Grid]:
    """One for each friction, then codes that are not installed, then what was reported elsewhere."""
    grids = [_rows(document, settled) for settled in document["settled"]]
    return [grid for grid in (*grids, _missing(document), _reported(document)) if grid.rows]


def _rows(document: Document, settled: dict[str, Any]) -> Grid:
    headings = ("model", "cells", "grading", "unknowns", "status", "iter-\nations", "P/2", "error", "set-up [s]",
                "solve [s]", "spread", "runs", "memory [MiB]", "before [MiB]", "residual")  # fmt: skip
    rows = [
        (
            row["model"], f"{row['cells']}²", f"{row['grading']:g}", _number(row["unknowns"], "d"), row["status"],
            _number(row["iterations"], "d"), _number(row["half_force"], ".5f"),
            _error(row["error"], settled["meaningless"]), _number(row["setup"], ".3f"), _number(row["solve"], ".3f"),
            _number(row["spread"], ".0%"), str(row["repetitions"]), _mebibytes(row["peak"]), _mebibytes(row["before"]),
            _number(row["residual"], ".0e"),
        )
        for row in document["rows"]
        if row["friction"] == settled["friction"]
    ]  # fmt: skip
    return Grid(f"The plate at μ = {settled['friction']:g}", headings, rows, _note(settled))


def _note(settled: dict[str, Any]) -> str:
    """How to read the table."""
    value = settled["half_force"]
    error = (
        "No settled value is known, so that there are no errors."
        if value is None
        else f"Errors are relative to {value} ± {SETTLED_UNCERTAINTY:.0e}, what displacement codes settle on: below "
        f"{settled['meaningless']:.0e} they mean nothing."
    )
    return (
        f"P/2 in MPa × length. {error} Failures are rows with their status and have no error; the findings have the "
        "reasons. Times are medians over the runs of one process, on one thread, after a tiny case that loads all "
        "libraries; displacement codes assemble in every Newton step, so that compare set-up and solve together "
        "(spread: largest less smallest sum over its median). Memory: peak of the process after the first solve, and "
        "before it. Residuals are those of each code's own check and cannot be compared between codes."
    )


def _missing(document: Document) -> Grid:
    rows = [(code["code"], code["remedy"]) for code in document["missing"]]
    return Grid("Not installed, not run", ("code", "how to get it"), rows)


def _reported(document: Document) -> Grid:
    rows = [
        (row["code"], f"{row['half_force']:.5f}", _number(row["error"], ".1e"), f"{row['seconds']:g}")
        for row in document["reported"]
    ]
    note = (
        "At μ = 0.2. Measured once on another day, the solve alone; not part of this run, and times not to be compared "
        f"with those above. Errors are relative to {SETTLED[0.2]}."
    )
    return Grid("Reported, not run here", ("code", "P/2", "error", "reported time [s]"), rows, note)


def _error(value: float | None, floor: float | None) -> str:
    if value is None or floor is None:
        return _NOTHING
    return f"< {floor:.0e}" if value < floor else f"{value:.1e}"


def _number(value: float | None, form: str) -> str:
    return _NOTHING if value is None else format(value, form)


def _mebibytes(value: float | None) -> str:
    return _number(None if value is None else value / _MIB, ".0f")
