"""By what the rows of a table are sorted: the number a cell begins with, whatever stands around it.

Rows come in the order of their numbers, then of their words, and those that say nothing come last. The page's script
reads plain numbers and words itself; for all other cells the page has the key of `sort_key`.
"""

import re
from typing import Final

from comparisons.lab.cells import is_missing, number_in

_PLAIN: Final = re.compile(r"[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|Infinity)", re.ASCII)
"""A number as JavaScript reads it; the same expression is in sort.js."""


def sort_key(cell: str) -> str | None:
    """What the page's script is to read instead of the cell: a plain number, or "" if the cell says nothing.

    None where the script reads the cell as it is meant: a plain number, or words.
    """
    if is_missing(cell):
        return ""
    value = number_in(cell)
    if value is None or _PLAIN.fullmatch(cell.strip()):
        return None
    return f"{value:.12g}".replace("inf", "Infinity")


def position(cell: str) -> tuple[int, float]:
    """Place of a cell in its column: numbers by their size, then words, all alike here, then cells that say nothing."""
    if is_missing(cell):
        return 2, 0.0
    value = number_in(cell)
    return (1, 0.0) if value is None else (0, value)
