"""Reports of studies: a template that a person writes, filled in, as Markdown, as one page of HTML, on the terminal.

    from comparisons.lab.report import environment_grids, render, show, write_report

    report = render("comparisons.wild", "wild", values, tables, figures, environment_grids(rows))
    show(report, write_report(report, "results/wild"))

The same rows give the same bytes. Formats of numbers are in `report.numbers`.
"""

from comparisons.lab.report.document import Document, fill, render
from comparisons.lab.report.drawing import drawn
from comparisons.lab.report.environment import environment_grids
from comparisons.lab.report.page import write_report
from comparisons.lab.report.reader import findings_of
from comparisons.lab.report.terminal import show
from solvers.basics.front import front

__all__ = ["Document", "drawn", "environment_grids", "fill", "findings_of", "render", "show", "write_report"]

__getattr__ = front(
    __name__,
    {
        "document": ("NO_PICTURES",),
        "numbers": (
            "NOTHING",
            "fixed",
            "listing",
            "memory",
            "percent",
            "scientific",
            "seconds",
            "significant",
        ),
        "page": ("as_page",),
        "reader": ("parts_of",),
    },
)
