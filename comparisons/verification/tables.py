"""Rows as tables of text."""

import math
from collections.abc import Iterable, Iterator
from typing import Any, Final

from comparisons.lab.report.numbers import NOTHING
from comparisons.lab.tables import Grid
from comparisons.verification.row import EQUAL, EXCESS, RELATIVE, SHORTFALL

Document = dict[str, Any]

HEADINGS: Final = (
    "quantity", "element", "reference", "kind", "source", "ours", "error", "tolerance", "certificate", "result",
)  # fmt: skip
PASSED, FAILED = "passed", "FAILED"

_DIGITS: Final = 10
_EMPTY: Final = "-"
_SENSES: Final = {EXCESS: "≤ ", SHORTFALL: "≥ "}
_DIGITS_OF_BOUNDS: Final = 1e-7  # what holds with room to spare needs no more digits
_ROUNDING: Final = 1e-10  # errors below this are one and the same on all machines


def tables_of(document: Document) -> dict[str, Grid]:
    """The table of all chapters, and one for each problem."""
    problems = {table_name(problem["name"]): grid(problem["rows"]) for problem in problems_of(document)}
    return {"chapters": _chapters(document), **problems}


def problems_of(document: Document) -> Iterator[Document]:
    """The problems of all chapters."""
    for chapter in document["chapters"]:
        yield from chapter["problems"]


def table_name(problem: str) -> str:
    """Name of a problem's table."""
    return problem.replace("/", "-")


def grid(rows: Iterable[Document]) -> Grid:
    """A line for each row."""
    return Grid("", HEADINGS, [cells(row) for row in rows])


def _chapters(document: Document) -> Grid:
    """A line for each chapter."""
    lines = []
    for chapter in document["chapters"]:
        rows = [row for problem in chapter["problems"] for row in problem["rows"]]
        ratios = [row["ratio"] for row in rows]
        largest = NOTHING if None in ratios else f"{max(ratios):.2g}"
        failures = sum(not row["passed"] for row in rows)
        lines.append((chapter["name"], str(len(chapter["problems"])), str(len(rows)), str(failures), largest))
    return Grid("", ("chapter", "problems", "rows", "failed", "largest error / tolerance"), lines)


def cells(row: Document) -> tuple[str, ...]:
    """A row's texts, in the order of `HEADINGS`."""
    reference, ours = _reference(row), number(row["ours"], _resolution(row))
    tolerance = _EMPTY if row["measure"] == EQUAL else f"{row['tolerance']:.0e}"
    kind, source, element = (row[name] or _EMPTY for name in ("kind", "source", "element"))
    result = PASSED if row["passed"] else FAILED
    return row["quantity"], element, reference, kind, source, ours, _error(row), tolerance, row["proof"], result


def number(value: float | str | None, resolution: float = 0.0) -> str:
    """A number without the digits below a resolution; words as they are."""
    if value is None:
        return NOTHING
    if isinstance(value, str):
        return value
    if abs(value) <= resolution or value == 0.0:
        return "0"
    digits = _DIGITS
    if resolution > 0.0:
        digits = min(digits, max(2, 1 + math.floor(math.log10(abs(value))) - math.floor(math.log10(resolution))))
    return f"{value:.{digits}g}"


def _reference(row: Document) -> str:
    """The reference, with the sense of an inequality."""
    return _SENSES.get(row["measure"], "") + number(row["reference"])


def _resolution(row: Document) -> float:
    """A hundredth of the tolerance, in the unit of the quantity."""
    if isinstance(row["ours"], str) or row["ours"] is None:
        return 0.0
    scale = abs(row["reference"]) if row["measure"] == RELATIVE else 1.0
    least = _DIGITS_OF_BOUNDS * abs(row["ours"]) if row["measure"] in _SENSES else 0.0
    return float(max(row["tolerance"] * scale / 100.0, least))


def _error(row: Document) -> str:
    error, measure = row["error"], row["measure"]
    if measure == EQUAL:
        return "equal" if error == 0.0 else "not equal"
    if error is None:
        return NOTHING
    least = max(_ROUNDING, 1e-3 * row["tolerance"])
    text = "0" if error == 0.0 else f"< {least:.0e}" if error < least else f"{error:.1e}"
    return f"{text} ({measure})"
