"""What a report calls its tables, figures and files."""

from collections import Counter
from typing import Final

from comparisons.lab.report.check import exhibits
from comparisons.lab.report.document import Exhibit, Figure, Report, Table
from qvi_contact.plots import has_matplotlib

NO_PICTURES: Final = "Figures are not drawn: they need matplotlib, `python -m pip install 'qvi-contact[plot]'`."
NO_ROWS: Final = "No rows."
NOTHING_DRAWN: Final = "Not drawn."


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


def undrawn(report: Report) -> bool:
    """Whether a figure is missing because matplotlib is."""
    return any(not figure.svg for figure in figures(report)) and not has_matplotlib()


def picture_file(report: Report, figure: Figure) -> str:
    """Name of the file of a figure."""
    return f"{report.name}-{figure.name}.svg"


def title_of(exhibit: Exhibit) -> str:
    """Title of a table or figure."""
    return exhibit.grid.title if isinstance(exhibit, Table) else exhibit.title


def heading_text(heading: str) -> str:
    """A heading in one line; those of the terminal may be broken inside a word."""
    return heading.replace("-\n", "").replace("\n", " ")
