"""Reports of studies: findings first, then what they rest on, as one page of HTML and as Markdown.

    from comparisons.lab.report import Figure, Finding, Report, Section, Table, environment_grids, show, write_report

    settings = environment_grids(rows)
    report = Report("solvers", "Solvers compared", "What was compared.", findings, sections, settings, limitations)
    show(report, write_report(report, "results/solvers"))

A report is made of data alone, so that the same rows give the same bytes. Formats of numbers are in `report.numbers`;
``python -m comparisons.lab.report.browser FILE…`` looks at pages in a real browser.
"""

from comparisons.lab.report.document import Exhibit, Figure, Finding, Report, Section, Table
from comparisons.lab.report.environment import environment_grids
from comparisons.lab.report.files import write_report
from comparisons.lab.report.terminal import show
from qvi_contact.plots.inline import svg_text

__all__ = [
    "Exhibit",
    "Figure",
    "Finding",
    "Report",
    "Section",
    "Table",
    "environment_grids",
    "show",
    "svg_text",
    "write_report",
]
