"""What can be wrong with a report before it is written; whoever makes one finds out at once."""

import re
from collections import Counter
from collections.abc import Iterator
from typing import Final

from comparisons.lab.report.document import Exhibit, Report, Table
from comparisons.lab.tables import Grid

_NAME: Final = re.compile(r"[a-z0-9]+(?:[-_][a-z0-9]+)*")


def exhibits(report: Report) -> list[Exhibit]:
    """All tables and figures in their order."""
    return [exhibit for section in report.sections for exhibit in section.exhibits]


def check_report(report: Report) -> None:
    """Raise ValueError for a report that cannot be written: a mistake of the program that made it, not of its user.

    Names are of lower-case letters, digits, and single hyphens or underscores between them; those of tables and figures
    are different from each other; every finding can be seen in one of them or says nothing of it; every row of a table
    has a cell for each heading.
    """
    problems = [*_names(report), *_findings(report), *_tables(report)]
    if problems:
        raise ValueError(f"report {report.name!r}: {'; '.join(problems)}")


def _names(report: Report) -> Iterator[str]:
    counts = Counter(exhibit.name for exhibit in exhibits(report))
    for name in (report.name, *counts):
        if not _NAME.fullmatch(name):
            yield f"{name!r} is no name of lower-case letters, digits, hyphens and underscores"
    for name, number in counts.items():
        if number > 1:
            yield f"{number} tables or figures are named {name!r}"


def _findings(report: Report) -> Iterator[str]:
    known = {exhibit.name for exhibit in exhibits(report)}
    for finding in report.findings:
        if finding.see and finding.see not in known:
            yield f"no table or figure is named {finding.see!r}: {finding.text!r}"


def _tables(report: Report) -> Iterator[str]:
    grids = [exhibit.grid for exhibit in exhibits(report) if isinstance(exhibit, Table)]
    for grid in (*grids, *report.settings):
        yield from _rows(grid)


def _rows(grid: Grid) -> Iterator[str]:
    for number, row in enumerate(grid.rows, start=1):
        if len(row) != len(grid.headings):
            yield f"row {number} of {grid.title!r} has {len(row)} cells for {len(grid.headings)} headings"
        if not all(isinstance(cell, str) for cell in row):
            yield f"row {number} of {grid.title!r} has a cell that is not a text"
