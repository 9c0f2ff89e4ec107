"""The files of a report."""

from pathlib import Path

from comparisons.lab.report.document import Document
from comparisons.lab.report.page import as_page
from qvi_contact.basics.writing import writable_folder, write_text


def write_report(report: Document, folder: str | Path) -> list[Path]:
    """Write a report's Markdown, its pictures, and the page made of both; each whole or not at all.

    The same report gives the same bytes. A picture of an earlier report that this one has not is left where it is.

    Parameters
    ----------
    report : Document
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

    """
    texts = {f"{report.name}.html": as_page(report), f"{report.name}.md": report.text, **report.pictures}
    place = writable_folder(folder)
    for name, text in reversed(texts.items()):  # pictures first: no text shows one that is not there
        write_text(place / name, text)
    return [place / name for name in texts]
