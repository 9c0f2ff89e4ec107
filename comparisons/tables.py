"""Tables of text, once for the terminal and for Markdown."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from rich.table import Table


class Grid(NamedTuple):
    """A table: title, headings, rows of text, and how to read it."""

    title: str
    headings: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    note: str = ""


def rich_table(grid: Grid) -> "Table":
    """The table for a terminal."""
    from rich import box
    from rich.table import Table

    table = Table(title=grid.title, title_justify="left", box=box.SIMPLE_HEAD, title_style="bold", padding=(0, 1, 0, 0))
    for heading, numeric in zip(grid.headings, _numeric(grid), strict=True):
        table.add_column(heading, justify="right" if numeric else "left")
    for row in grid.rows:
        table.add_row(*row)
    return table


def markdown_table(grid: Grid) -> str:
    """The table in Markdown, with its title, if it has one, as a heading above and how to read it below."""
    headings = [heading.replace("-\n", "").replace("\n", " ") for heading in grid.headings]
    marks = ["---:" if numeric else "---" for numeric in _numeric(grid)]
    lines = [_line(headings), _line(marks), *(_line([cell.replace("|", "\\|") for cell in row]) for row in grid.rows)]
    heading = [f"## {grid.title}", ""] if grid.title else []
    return "\n".join([*heading, *lines, "", *([grid.note, ""] if grid.note else [])])


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _numeric(grid: Grid) -> list[bool]:
    """Which columns begin with digits wherever they say anything."""
    columns = zip(*grid.rows, strict=True)
    return [all(cell[:1].isdigit() or cell[:1] in ("-", "<", "") for cell in column) for column in columns]
