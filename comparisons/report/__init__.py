"""Reports of studies: findings first, then what they rest on, as one page of HTML and as Markdown.

    from comparisons.report import Figure, Finding, Report, Section, Table, write_report

    report = Report("solvers", "Solvers compared", "What was compared.", findings, sections, settings, limitations)
    write_report(report, "results/solvers")

A report is made of data alone, so that the same rows give the same bytes.
"""

from comparisons.report.document import Exhibit, Figure, Finding, Report, Section, Table
from comparisons.report.files import write_report
from comparisons.report.pictures import svg_text

__all__ = ["Exhibit", "Figure", "Finding", "Report", "Section", "Table", "svg_text", "write_report"]
