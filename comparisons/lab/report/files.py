"""The files of a report."""

from pathlib import Path

from comparisons.lab.report.check import check_report
from comparisons.lab.report.document import Report
from comparisons.lab.report.labels import figures, picture_file
from comparisons.lab.report.markdown import as_text
from comparisons.lab.report.page import as_page
from qvi_contact.basics.writing import writable_folder, write_text


def write_report(report: Report, folder: str | Path) -> list[Path]:
    """Write a report's page, its Markdown twin, and the pictures the twin shows; each whole or not at all.

    The same report gives the same bytes. A picture of an earlier report that this one has not is left where it is.

    Parameters
    ----------
    report : Report
        What to write.
    folder : str or Path
        Where to; made if it is missing.

    Returns
    -------
    list of Path
        ``<name>.html``, ``<name>.md``, then ``<name>-<figure>.svg`` for each figure that could be drawn.

    Raises
    ------
    InputError
        If the folder or a file cannot be written.
    ValueError
        If the report is not one, see `check_report`.

    """
    check_report(report)
    texts = {f"{report.name}.html": as_page(report), f"{report.name}.md": as_text(report)}
    texts |= {picture_file(report, figure): figure.svg for figure in figures(report) if figure.svg}
    place = writable_folder(folder)
    for name, text in reversed(texts.items()):  # pictures first: no text shows one that is not there
        write_text(place / name, text)
    return [place / name for name in texts]
