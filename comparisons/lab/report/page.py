"""A report as one HTML page that loads nothing: style, script and pictures are inside."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from markupsafe import Markup

from comparisons.lab.cells import is_numeric
from comparisons.lab.report.document import Exhibit, Figure, Report, Section, Table
from comparisons.lab.report.labels import NO_PICTURES, NO_ROWS, NOTHING_DRAWN, heading_text, labels, title_of, undrawn
from comparisons.lab.report.marks import as_html, plain
from comparisons.lab.report.order import sort_key
from comparisons.lab.study.outcome import FAILURES
from comparisons.lab.tables import Grid
from qvi_contact.plots.inline import inline_svg

if TYPE_CHECKING:
    from jinja2 import Environment

_FAILED: Final = frozenset({"failed", "fails", "lies"})
_FAILURES: Final = frozenset(FAILURES)
"""Cells that say so in words are also drawn so: anywhere, and in columns with the heading "status"."""

_WORDS: Final = 40  # letters of a cell that is a sentence
_LONG: Final = 30  # rows of a table that has its own scroll bar


class Cell(NamedTuple):
    """Text and attributes of a cell."""

    text: Markup
    look: Markup


def as_page(report: Report) -> str:
    """The report as HTML."""
    known = labels(report)
    return (
        page_environment("comparisons.lab.report")
        .get_template("page.html")
        .render(
            report=report,
            labels=known,
            sections=[_section(section, number, known) for number, section in enumerate(report.sections, start=1)],
            settings=[{"title": grid.title, "note": grid.note, "grid": _grid(grid, False)} for grid in report.settings],
            undrawn=undrawn(report),
            no_pictures=NO_PICTURES,
            no_rows=NO_ROWS,
            nothing_drawn=NOTHING_DRAWN,
        )
    )


def page_environment(package: str) -> "Environment":
    """Templates of a package's folder; all they are given is escaped, and nothing may be missing."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader(package, "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"marked": _marked, "unmarked": plain}
    return environment


def _marked(text: str) -> Markup:
    return Markup(as_html(text))


def _section(section: Section, number: int, known: dict[str, str]) -> dict[str, Any]:
    return {
        "id": f"Section-{number}",  # the capital keeps it different from all names of tables and figures
        "title": section.title,
        "paragraphs": section.paragraphs,
        "exhibits": [_exhibit(exhibit, known[exhibit.name]) for exhibit in section.exhibits],
    }


def _exhibit(exhibit: Exhibit, label: str) -> dict[str, Any]:
    title = title_of(exhibit)
    return {
        "name": exhibit.name,
        "label": label,
        "title": title,
        "grid": _grid(exhibit.grid, True) if isinstance(exhibit, Table) else None,
        "svg": _picture(exhibit, f"{label}: {plain(title)}") if isinstance(exhibit, Figure) else "",
        "reading": exhibit.reading,
        "failure": exhibit.failure,
    }


def _picture(figure: Figure, label: str) -> Markup:
    return Markup(inline_svg(figure.svg, figure.name, label)) if figure.svg else Markup("")


def _grid(grid: Grid, sortable: bool) -> dict[str, Any]:
    """Headings and rows as cells, column by column."""
    columns = list(zip(*grid.rows, strict=True)) or [()] * len(grid.headings)
    made = [
        _column(heading_text(heading), cells, sortable) for heading, cells in zip(grid.headings, columns, strict=True)
    ]
    rows = list(zip(*(cells for _, cells in made), strict=True))
    return {"headings": [heading for heading, _ in made], "rows": rows, "long": len(rows) > _LONG}


def _column(heading: str, cells: Sequence[str], sortable: bool) -> tuple[Cell, list[Cell]]:
    """The cells of a column; numbers stand on the right, sentences get room."""
    texts = [plain(cell) for cell in cells]
    look = ["number"] if is_numeric(texts) else ["words"] if max(map(len, texts), default=0) > _WORDS else []
    failed = _FAILED | (_FAILURES if heading == "status" else frozenset())
    looks = [
        _look([*look, "failed"] if text.lower() in failed else look, sort_key(text) if sortable else None)
        for text in texts
    ]
    return Cell(_marked(heading), _look(look)), [
        Cell(_marked(cell), each) for cell, each in zip(cells, looks, strict=True)
    ]


def _look(classes: Sequence[str], key: str | None = None) -> Markup:
    """The attributes of a cell."""
    classed = Markup(' class="{}"').format(" ".join(classes)) if classes else Markup("")
    return classed + (Markup("") if key is None else Markup(' data-key="{}"').format(key))
