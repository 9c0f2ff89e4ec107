"""A report on the terminal: findings, tables, and where it was written."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from comparisons.lab.report.check import exhibits
from comparisons.lab.report.document import Report, Table
from comparisons.lab.report.labels import NO_PICTURES, NO_ROWS, labels, title_of, undrawn
from comparisons.lab.report.marks import plain
from comparisons.lab.tables import Grid, rich_table

if TYPE_CHECKING:
    from rich.console import Console

_WIDTH = 120


def show(report: Report, written: Sequence[Path] = (), console: "Console | None" = None) -> None:
    """Print findings and tables, then where the report was written.

    Parameters
    ----------
    report : Report
        What to print; its figures are in the files only.
    written : sequence of Path
        What `write_report` returned.
    console : rich.console.Console, optional
        Where to, without markup; standard output if not given, plain and 120 columns wide where that is no terminal.

    """
    console = console or _standard_output()
    console.print(plain(report.title) + "\n", style="bold", soft_wrap=True)
    for line in _findings(report):
        console.print(line, soft_wrap=True)
    known = labels(report)
    for exhibit in exhibits(report):
        if isinstance(exhibit, Table):
            _print_table(console, exhibit.grid, f"{known[exhibit.name]}: {plain(title_of(exhibit))}")
    for line in _files(report, written):
        console.print(line, soft_wrap=True)


def _standard_output() -> "Console":
    from rich.console import Console

    console = Console(highlight=False, markup=False, emoji=False)
    if console.is_terminal:
        return console
    return Console(highlight=False, markup=False, emoji=False, width=_WIDTH)


def _findings(report: Report) -> Iterator[str]:
    """The numbered sentences; a number leads to the table it can be seen in."""
    known = labels(report)
    for number, finding in enumerate(report.findings, start=1):
        place = f" [{known[finding.see]}]" if finding.see else ""
        yield f"{number}. {plain(finding.text)}{place}"
    yield ""


def _print_table(console: "Console", grid: Grid, title: str) -> None:
    """The table with its label, or the word that it is empty."""
    if not grid.rows:
        console.print(f"{title}\n{NO_ROWS}\n", soft_wrap=True)
        return
    rows = [tuple(map(plain, row)) for row in grid.rows]
    console.print(rich_table(Grid(title, grid.headings, rows)))


def _files(report: Report, written: Sequence[Path]) -> Iterator[str]:
    """Where the files are, and how to get those that are missing."""
    if written and undrawn(report):
        yield plain(NO_PICTURES)
    if written:
        yield f"Written to {written[0].parent}: {', '.join(path.name for path in written)}"
