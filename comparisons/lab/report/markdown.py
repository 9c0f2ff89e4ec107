"""A report as Markdown, which shows its pictures from files beside it."""

from collections.abc import Iterator, Mapping

from comparisons.lab.report.document import Exhibit, Figure, Report, Section, Table
from comparisons.lab.report.labels import (
    NO_PICTURES,
    NO_ROWS,
    NOTHING_DRAWN,
    heading_text,
    labels,
    picture_file,
    title_of,
    undrawn,
)
from comparisons.lab.report.marks import as_markdown, as_paragraph
from comparisons.lab.tables import Grid, markdown_table

Labels = Mapping[str, str]


def as_text(report: Report) -> str:
    """The report as Markdown."""
    known = labels(report)
    lines = [f"# {as_markdown(report.title)}", "", as_paragraph(report.introduction), "", "## Findings", ""]
    lines += [*_findings(report, known), ""]
    lines += [NO_PICTURES, ""] if undrawn(report) else []
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
        return [NOTHING_DRAWN, ""]
    return [f"![{as_markdown(figure.title)}]({picture_file(report, figure)})", ""]


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
