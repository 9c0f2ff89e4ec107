"""Reports made by code, piece by piece: to go, as soon as all experiments have templates."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from comparisons.lab.report.document import NO_PICTURES, NO_ROWS, Document, picture_file
from comparisons.lab.report.files import write_report as write_document
from comparisons.lab.report.marks import as_markdown, as_paragraph
from comparisons.lab.report.terminal import show as show_document
from comparisons.lab.tables import Grid, markdown_table

NO_FAILURE: Final = "nothing here can fail"


@dataclass(frozen=True)
class Table:
    """A table that can be sorted by its columns.

    Attributes
    ----------
    name : str
        Lower-case word for links, different from all others of the report.
    grid : Grid
        Title, headings with units, rows; its note is not used.
    reading : str
        How to read it.
    failure : str
        What counts as failure in it.

    """

    name: str
    grid: Grid
    reading: str
    failure: str = NO_FAILURE


@dataclass(frozen=True)
class Figure:
    """A picture.

    Attributes
    ----------
    name : str
        Lower-case word for links and files, different from all others of the report.
    title : str
        Title.
    svg : str
        The picture, see `qvi_contact.plots.inline.svg_text`; empty where matplotlib is not installed.
    reading : str
        How to read it: what the axes, curves and marks are.
    failure : str
        What counts as failure in it, and how it is drawn.

    """

    name: str
    title: str
    svg: str
    reading: str
    failure: str = NO_FAILURE


Exhibit = Table | Figure


@dataclass(frozen=True)
class Finding:
    """A sentence computed from the data, and the name of the table or figure it can be seen in."""

    text: str
    see: str = ""


@dataclass(frozen=True)
class Section:
    """Part of a report: title, paragraphs, tables and figures."""

    title: str
    paragraphs: Sequence[str]
    exhibits: Sequence[Exhibit] = ()


@dataclass(frozen=True)
class Report:
    """A report in the order in which it is read.

    Attributes
    ----------
    name : str
        Stem of its files.
    title : str
        Title.
    introduction : str
        What was compared, on what, by which command: a paragraph.
    findings : sequence of Finding
        What was found, the most important first.
    sections : sequence of Section
        What the findings rest on.
    settings : sequence of Grid
        All settings, versions, machine, threads, seeds: whatever is needed to do it again.
    limitations : sequence of str
        What the numbers do not say.

    """

    name: str
    title: str
    introduction: str
    findings: Sequence[Finding]
    sections: Sequence[Section]
    settings: Sequence[Grid]
    limitations: Sequence[str]


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
    problems = [*_names(report), *_links(report), *_tables(report)]
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


def _links(report: Report) -> Iterator[str]:
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


def labels(report: Report) -> dict[str, str]:
    """Name → "Table 1", "Figure 1" and so on, in their order."""
    counts: Counter[str] = Counter()
    found = {}
    for exhibit in exhibits(report):
        kind = "Table" if isinstance(exhibit, Table) else "Figure"
        counts[kind] += 1
        found[exhibit.name] = f"{kind} {counts[kind]}"
    return found


def figures(report: Report) -> list[Figure]:
    """All figures in their order."""
    return [exhibit for exhibit in exhibits(report) if isinstance(exhibit, Figure)]


def title_of(exhibit: Exhibit) -> str:
    """Title of a table or figure."""
    return exhibit.grid.title if isinstance(exhibit, Table) else exhibit.title


def heading_text(heading: str) -> str:
    """A heading in one line; those of the terminal may be broken inside a word."""
    return heading.replace("-\n", "").replace("\n", " ")


Labels = Mapping[str, str]


def as_text(report: Report) -> str:
    """The report as Markdown."""
    known = labels(report)
    lines = [f"# {as_markdown(report.title)}", "", as_paragraph(report.introduction), "", "## Findings", ""]
    lines += [*_findings(report, known), ""]
    for section in report.sections:
        lines += _section(section, report, known)
    lines += ["## Settings", ""]
    for grid in report.settings:
        lines += _setting(grid)
    lines += ["## Limitations", "", *(f"- {as_paragraph(text)}" for text in report.limitations)]
    return "\n".join(lines).rstrip() + "\n"


def _findings(report: Report, known: Labels) -> Iterator[str]:
    for number, finding in enumerate(report.findings, start=1):
        link = f" ([{known[finding.see]}](#{finding.see}))" if finding.see else ""
        yield f"{number}. {as_paragraph(finding.text)}{link}"


def _section(section: Section, report: Report, known: Labels) -> list[str]:
    lines = [f"## {as_markdown(section.title)}", ""]
    for paragraph in section.paragraphs:
        lines += [as_paragraph(paragraph), ""]
    for exhibit in section.exhibits:
        lines += _exhibit(exhibit, report, known)
    return lines


def _exhibit(exhibit: Exhibit, report: Report, known: Labels) -> list[str]:
    return [
        f'<a id="{exhibit.name}"></a>',
        "",
        f"### {known[exhibit.name]}: {as_markdown(title_of(exhibit))}",
        "",
        *(_grid(exhibit.grid) if isinstance(exhibit, Table) else _picture(exhibit, report)),
        f"- *How to read it*: {as_markdown(exhibit.reading)}",
        f"- *Failure*: {as_markdown(exhibit.failure)}",
        "",
    ]


def _picture(figure: Figure, report: Report) -> list[str]:
    if not figure.svg:
        return [NO_PICTURES, ""]
    return [f"![{as_markdown(figure.title)}]({picture_file(report.name, figure.name)})", ""]


def _setting(grid: Grid) -> list[str]:
    note = [as_paragraph(grid.note), ""] if grid.note else []
    return [f"### {as_markdown(grid.title)}", "", *_grid(grid), *note]


def _grid(grid: Grid) -> list[str]:
    """The lines of a table, and an empty one."""
    if not grid.rows:
        return [NO_ROWS, ""]
    headings = tuple(as_markdown(heading_text(text)) for text in grid.headings)
    rows = [tuple(map(as_markdown, row)) for row in grid.rows]
    return [*markdown_table(Grid("", headings, rows)).splitlines(), ""]


def as_document(report: Report) -> Document:
    """The report as Markdown with its pictures."""
    check_report(report)
    pictures = {picture_file(report.name, figure.name): figure.svg for figure in figures(report) if figure.svg}
    return Document(report.name, as_text(report), pictures)


def write_report(report: Report, folder: str | Path) -> list[Path]:
    """Write its page, its Markdown and its pictures."""
    return write_document(as_document(report), folder)


def show(report: Report, written: Sequence[Path] = ()) -> None:
    """Print it on the terminal."""
    show_document(as_document(report), written)
