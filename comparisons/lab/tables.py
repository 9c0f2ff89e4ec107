"""Tables of text, once for the terminal and for Markdown."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from comparisons.lab.cells import NOTHING, is_numeric, text
from comparisons.lab.marks import escaped

if TYPE_CHECKING:
    from pandas import DataFrame
    from rich.console import Console
    from rich.table import Table

NO_ROWS: Final = "No rows."

Form = Callable[[Any], str]

_BAR: Final = "\\|"
_LONGEST: Final = 40  # letters of a name; what is longer is a sentence
_HEADING: Final = 10  # letters of a line of a heading above narrow numbers


class Grid(NamedTuple):
    """A table: title, headings, rows of text, and how to read it."""

    title: str
    headings: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    note: str = ""


def grid_of(
    frame: "DataFrame", headings: Sequence[str] | Mapping[str, str], forms: Mapping[str, Form] | None = None
) -> Grid:
    """Columns of a frame as a table.

    Parameters
    ----------
    frame : DataFrame
        One line a row; an empty one needs no columns.
    headings : sequence of str, or Mapping
        The columns, or column → its heading.
    forms : Mapping, optional
        Column → what makes a text of its values; `text` for all others.

    """
    named = headings if isinstance(headings, Mapping) else {name: name for name in headings}
    told = [map((forms or {}).get(name, text), frame[name]) for name in named] if len(frame) else []
    return Grid("", tuple(named.values()), list(zip(*told, strict=True)))


def crossed(
    frame: "DataFrame", row: str, column: str, cell: "Callable[[DataFrame], str]", columns: Sequence[str] = ()
) -> Grid:
    """A line for each value of the column `row`, under each value of `column` what `cell` says of the lines with both.

    They stand in the order in which they are met, or in that of `columns`; where there is no line it is `NOTHING`.
    """
    texts = {key: cell(found) for key, found in frame.groupby([row, column], sort=False)}
    names = columns or tuple(frame[column].unique())
    rows = [(each, *(texts.get((each, name), NOTHING) for name in names)) for each in frame[row].unique()]
    return Grid("", (row, *names), rows)


def print_table(console: "Console", grid: Grid) -> None:
    """Print the table; where the terminal is too narrow for its numbers, row by row with a line for each cell."""
    table = rich_table(grid)
    if sum(map(_least, grid.headings, zip(*grid.rows, strict=True), _numeric(grid))) <= console.width:
        console.print(table)
        return
    console.print(grid.title, style="bold", soft_wrap=True)
    for row in grid.rows:
        console.print(f"\n{_one_line(grid.headings[0])}: {row[0]}", soft_wrap=True)
        for heading, cell in zip(grid.headings[1:], row[1:], strict=True):
            console.print(f"  {_one_line(heading)}: {cell}", soft_wrap=True)
    console.print()


def _least(heading: str, cells: Sequence[str], numeric: bool) -> int:
    """Letters that a column needs, with the space behind it; words can be broken."""
    longest = max(map(len, cells))
    return 1 + (max(longest, *map(len, _wrapped(heading, longest))) if numeric else min(longest, _HEADING))


def _wrapped(heading: str, widest: int) -> list[str]:
    """The lines of a heading above numbers of so many letters."""
    return wrap(_one_line(heading), max(widest, _HEADING), break_long_words=False, break_on_hyphens=False)


def rich_table(grid: Grid) -> "Table":
    """The table for a terminal.

    Numbers are not broken. Where the terminal is too narrow, words are; those of the first column, which tells the rows
    apart, last, unless sentences stand in it.
    """
    from rich import box
    from rich.table import Table

    table = Table(title=grid.title, title_justify="left", box=box.SIMPLE_HEAD, title_style="bold", padding=(0, 1, 0, 0))
    whole = all(len(row[0]) <= _LONGEST for row in grid.rows if row)
    for index, (heading, numeric) in enumerate(zip(grid.headings, _numeric(grid), strict=True)):
        if numeric:
            widest = max(len(row[index]) for row in grid.rows)
            table.add_column("\n".join(_wrapped(heading, widest)), justify="right", no_wrap=True)
        else:
            table.add_column(heading, overflow="fold", no_wrap=whole and index == 0)
    for row in grid.rows:
        table.add_row(*row)
    return table


def markdown_table(grid: Grid) -> str:
    """The rows in Markdown, whose cells mean nothing but what they say."""
    if not grid.rows:
        return f"{NO_ROWS}\n"
    marks = ["---:" if numeric else "---" for numeric in _numeric(grid)]
    lines = [_line(map(_one_line, grid.headings)), f"| {' | '.join(marks)} |", *map(_line, grid.rows)]
    return "\n".join([*lines, ""])


def _one_line(heading: str) -> str:
    """A heading without the breaks that it has for the terminal."""
    return heading.replace("-\n", "").replace("\n", " ")


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(escaped(cell).replace('|', _BAR) for cell in cells)} |"


def _numeric(grid: Grid) -> list[bool]:
    """Which columns are of numbers, see `is_numeric`; without rows none."""
    columns = zip(*grid.rows, strict=True) if grid.rows else [()] * len(grid.headings)
    return [is_numeric(column) for column in columns]
