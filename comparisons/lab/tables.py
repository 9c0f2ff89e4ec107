"""Tables of text, once for the terminal and for Markdown."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

from comparisons.lab.cells import is_numeric

if TYPE_CHECKING:
    from rich.table import Table

_LONGEST = 40  # letters of a name; what is longer is a sentence


class Grid(NamedTuple):
    """A table: title, headings, rows of text, and how to read it."""

    title: str
    headings: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    note: str = ""


def rich_table(grid: Grid) -> "Table":
    """The table for a terminal.

    Where that is too narrow, cells are broken and nothing is cut; the first column, which tells the rows apart, is
    broken last, unless sentences stand in it.
    """
    from rich import box
    from rich.table import Table

    table = Table(title=grid.title, title_justify="left", box=box.SIMPLE_HEAD, title_style="bold", padding=(0, 1, 0, 0))
    whole = all(len(row[0]) <= _LONGEST for row in grid.rows if row)
    for index, (heading, numeric) in enumerate(zip(grid.headings, _numeric(grid), strict=True)):
        justify: Literal["left", "right"] = "right" if numeric else "left"
        table.add_column(heading, justify=justify, overflow="fold", no_wrap=whole and index == 0)
    for row in grid.rows:
        table.add_row(*row)
    return table


def markdown_table(grid: Grid) -> str:
    """The table in Markdown, with its title, if it has one, as a heading above and how to read it below."""
    headings = [heading.replace("-\n", "").replace("\n", " ") for heading in grid.headings]
    marks = ["---:" if numeric else "---" for numeric in _numeric(grid)]
    lines = [_line(headings), f"| {' | '.join(marks)} |", *map(_line, grid.rows)]
    heading = [f"## {grid.title}", ""] if grid.title else []
    return "\n".join([*heading, *lines, "", *([grid.note, ""] if grid.note else [])])


def _line(cells: Sequence[str]) -> str:
    escaped = [cell.replace("|", "\\|") for cell in cells]
    return f"| {' | '.join(escaped)} |"


def _numeric(grid: Grid) -> list[bool]:
    """Which columns are of numbers, see `is_numeric`; without rows none."""
    columns = zip(*grid.rows, strict=True) if grid.rows else [()] * len(grid.headings)
    return [is_numeric(column) for column in columns]
