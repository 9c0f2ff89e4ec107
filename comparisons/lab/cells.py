"""What the cells of a table say: a number, whatever stands around it, words, or nothing; and how they are sorted.

Rows come in the order of their numbers, then of their words, and those that say nothing come last.
"""

import math
import re
from collections.abc import Sequence
from typing import Any, Final

NOTHING: Final = "none"
"""Text of a number there is not."""

MISSING: Final = frozenset({"", "-", "−", "–", "—", "n/a", "nan", NOTHING})
"""Cells that say nothing, in lower case."""

_CELL: Final = re.compile(
    r"(?P<sense>[<>≤≥~≈±=]?)\s*"
    r"(?P<number>[-−+]?(?:(?:[0-9]{1,3}(?:,[0-9]{3})+(?:\.[0-9]*)?|[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-−+]?[0-9]+)?"
    r"|Infinity|inf(?![A-Za-z])|∞))[²³]?"
    r"\s*(?P<unit>%|[µμ]s|[A-Za-z]+)?"
    r"(?![\w.:-]*\w)"  # a version, a date, a time of day, a word that begins with digits
)
_UNITS: Final = {
    "%": 1e-2,
    "µs": 1e-6, "μs": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0,
    "bytes": 1.0, "B": 1.0, "KiB": 2.0**10, "MiB": 2.0**20, "GiB": 2.0**30, "TiB": 2.0**40,
}  # fmt: skip
"""Factors of units that may stand in the same column; all other units are taken to be the same in all rows."""

_BESIDE: Final = 1e-9  # how far beside its bound a cell such as "< 1e-9" is put, as a share of the bound
_LONGEST: Final = 24  # letters of a cell that is a number and no sentence


def text(value: Any) -> str:
    """Whatever stands in a table."""
    return NOTHING if value is None or value != value else str(value)


def number_in(cell: str) -> float | None:
    """The number that a cell begins with, in the base unit; None where it begins with none.

    "< 1e-9" is just below 1e-9 and "> 99 %" just above 0.99; "12 ms" is 0.012; "8²" and "8 × 8" are 8; "1.2.3" is no
    number.
    """
    match = _CELL.match(cell.strip())
    if match is None:
        return None
    text = match["number"].replace("−", "-").replace(",", "").replace("∞", "inf")
    value = float(text) * _UNITS.get(match["unit"] or "", 1.0)
    shift = {"<": -_BESIDE, ">": _BESIDE}.get(match["sense"], 0.0) * abs(value)
    return value + shift if math.isfinite(shift) else value


def is_missing(cell: str) -> bool:
    """Whether a cell says nothing."""
    return cell.strip().lower() in MISSING


def is_numeric(cells: Sequence[str]) -> bool:
    """Whether a column is one of numbers: there is one, and there are neither words nor sentences."""
    said = [cell for cell in cells if not is_missing(cell)]
    return bool(said) and all(number_in(cell) is not None and len(cell) <= _LONGEST for cell in said)


def sort_key(cell: str) -> str | None:
    """What the script of a page sorts by: a plain number, "" if the cell says nothing, None for words."""
    if is_missing(cell):
        return ""
    value = number_in(cell)
    return None if value is None else f"{value:.12g}".replace("inf", "Infinity")


def position(cell: str) -> tuple[int, float]:
    """Place of a cell in its column: numbers by their size, then words, all alike here, then cells that say nothing."""
    key = sort_key(cell)
    return (2, 0.0) if key == "" else (1, 0.0) if key is None else (0, float(key))
