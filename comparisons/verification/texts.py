"""Rows as text, the same in Markdown and HTML."""

import math
from typing import Any, Final

from comparisons.lab.tables import Grid
from comparisons.verification.row import EQUAL, EXCESS, RELATIVE, SHORTFALL, Kind, meaning

Document = dict[str, Any]

HEADINGS: Final = (
    "quantity", "element", "reference", "kind", "source", "ours", "error", "tolerance", "certificate", "result",
)  # fmt: skip
PASSED, FAILED = "passed", "FAILED"

_DIGITS: Final = 10
_NOTHING: Final = "-"
_SENSES: Final = {EXCESS: "≤ ", SHORTFALL: "≥ "}
_DIGITS_OF_BOUNDS: Final = 1e-7  # what holds with room to spare needs no more digits
_ROUNDING: Final = 1e-10  # errors below this are one and the same on all machines


def grid(problem: Document) -> Grid:
    """The table of one problem."""
    return Grid("", HEADINGS, [cells(row) for row in problem["rows"]])


def cells(row: Document) -> tuple[str, ...]:
    """A row's texts, in the order of `HEADINGS`."""
    reference, ours = _reference(row), number(row["ours"], _resolution(row))
    tolerance, kind = _tolerance(row), row["kind"] or _NOTHING
    result = PASSED if row["passed"] else FAILED
    source = row["source"] or _NOTHING
    quantity, element = row["quantity"], row["element"] or _NOTHING
    return quantity, element, reference, kind, source, ours, _error(row), tolerance, row["proof"], result


def number(value: float | str | None, resolution: float = 0.0) -> str:
    """A number without the digits below a resolution; words as they are."""
    if value is None:
        return "none"
    if isinstance(value, str):
        return value
    if abs(value) <= resolution or value == 0.0:
        return "0"
    digits = _DIGITS
    if resolution > 0.0:
        digits = min(digits, max(2, 1 + math.floor(math.log10(abs(value))) - math.floor(math.log10(resolution))))
    return f"{value:.{digits}g}"


def verdict(document: Document) -> str:
    """How many rows passed, in a sentence."""
    counts = document["counts"]
    if document["passed"]:
        return f"All {counts['rows']} rows passed."
    return f"{counts['failed']} of {counts['rows']} rows FAILED."


def failed(document: Document) -> list[str]:
    """Every failed row in a sentence."""
    return [
        f"{problem['name']}: {_subject(row)}: {number(row['ours'])}, reference {_reference(row)}, "
        f"error {_error(row)}, tolerance {_tolerance(row)}, certificate: {row['proof']}"
        for chapter in document["chapters"]
        for problem in chapter["problems"]
        for row in problem["rows"]
        if not row["passed"]
    ]


def reading() -> list[tuple[str, str]]:
    """What the columns mean."""
    kinds = "; ".join(f"{kind.value}: {meaning(kind)}" for kind in Kind)
    return [
        ("quantity", "what is compared, with its unit"),
        (
            "element",
            "what the stress function is made of: Bogner-Fox-Schmit on rectangles, or Hsieh-Clough-Tocher on "
            "triangles, into which the same rectangles are cut; - where the row is about one of them, or about none",
        ),
        ("reference", "what it should be, known without this computation"),
        ("kind", kinds),
        ("source", "equation, test case or code the reference comes from, with its uncertainty where it has one"),
        ("ours", "what this package computes, without digits below a hundredth of the tolerance"),
        (
            "error",
            "relative to the reference, absolute in the unit of the quantity, or the excess over a reference ≤ and the "
            "shortfall from a reference ≥; words are equal or not",
        ),
        ("tolerance", "the largest error that passes; it was set before the run"),
        ("certificate", "what certifies the result behind the number; without it the row fails, whatever its error"),
    ]


def machine_lines(document: Document) -> list[str]:
    """Machine and versions."""
    machine = document["machine"]
    memory = f"{machine['memory_bytes'] / 2**30:.0f} GiB" if machine["memory_bytes"] else "memory unknown"
    packages = ", ".join(f"{name} {version}" for name, version in document["versions"].items())
    options = [
        *(["--only", *document["only"]] if document["only"] else []),
        *(["--quick"] if document["quick"] else []),
    ]
    return [
        f"Machine: {machine['processor']}, {machine['cores']} cores, {memory}; {machine['system']}",
        f"Versions: {machine['python']}, {packages}",
        f"Command: {' '.join(['python -m comparisons verify', *options])}",
    ]


def _subject(row: Document) -> str:
    """The quantity, with the element it was computed on."""
    return f"{row['quantity']}, {row['element']}" if row["element"] else str(row["quantity"])


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
        return "none"
    least = max(_ROUNDING, 1e-3 * row["tolerance"])
    text = "0" if error == 0.0 else f"< {least:.0e}" if error < least else f"{error:.1e}"
    return f"{text} ({measure})"


def _tolerance(row: Document) -> str:
    return _NOTHING if row["measure"] == EQUAL else f"{row['tolerance']:.0e}"
