"""A report on the terminal: findings, tables that are not folded, and where it was written."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from comparisons.lab.report.document import NO_PICTURES, Document
from comparisons.lab.report.reader import parts_of, title_of
from comparisons.lab.tables import print_table

if TYPE_CHECKING:
    from rich.console import Console

_WIDTH = 120


def show(
    report: Document, written: Sequence[Path] = (), console: "Console | None" = None, *, tables: bool = True
) -> None:
    """Print findings and tables, then where the report was written.

    Parameters
    ----------
    report : Document
        What to print; its pictures and what is folded are in the files only.
    written : sequence of Path
        What `write_report` returned.
    console : rich.console.Console, optional
        Where to, without markup; see `standard_output` if not given.
    tables : bool
        False prints the findings alone.

    """
    console = console or standard_output()
    console.print(title_of(report.text) + "\n", style="bold", soft_wrap=True)
    for part in parts_of(report.text):
        if isinstance(part, list):
            for number, sentence in enumerate(part, start=1):
                console.print(f"{number}. {sentence}", soft_wrap=True)
            console.print()
        elif tables:
            print_table(console, part)
    if written and NO_PICTURES in report.text:
        console.print(NO_PICTURES.replace("`", ""), soft_wrap=True)
    if written:
        names = ", ".join(path.name for path in written)
        console.print(f"Written to {written[0].parent}: {names}", soft_wrap=True)


def standard_output() -> "Console":
    """Standard output without markup, plain and 120 columns wide where it is no terminal."""
    from rich.console import Console

    console = Console(highlight=False, markup=False, emoji=False)
    if console.is_terminal:
        return console
    return Console(highlight=False, markup=False, emoji=False, width=_WIDTH)
