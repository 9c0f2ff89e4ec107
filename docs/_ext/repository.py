"""What the site takes from other folders, the committed reports, and how it shows pictures.

A line ``% reports`` in a page becomes a list of the reports in `comparisons/reports`, which are copied into the site.
"""

import html
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import imagesize
from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx

from comparisons.lab.reports import Report

REPORTS = Path(__file__).parents[2] / "comparisons" / "reports"
MARK = "% reports"
_LIST = ("studies", "committed-reports")  # page and anchor of that list

_LARGE = 1000  # pixels, from which on a picture fills the column
_PHONE = 350  # pixels, above which a picture leads to itself in full size
_MANY = 4  # columns of a table that is too wide for a phone


def reports() -> Iterator[tuple[str, Path]]:
    """Title and Markdown of each report, several in a folder or one."""
    for path in sorted(REPORTS.glob("*/*.md")):
        yield Report.read(path).title, path


def _replace(_app: Sphinx, docname: str, source: list[str]) -> None:
    """Put the list in the place of the mark."""
    if MARK not in source[0]:
        return
    up = "../" * docname.count("/")
    places = [(title, path.relative_to(REPORTS).with_suffix(".html").as_posix()) for title, path in reports()]
    items = [f'<li><a href="{up}reports/{place}">{html.escape(title)}</a></li>' for title, place in places]
    source[0] = source[0].replace(MARK, "\n".join(["```{raw} html", "<ul>", *items, "</ul>", "```"]))


def _link(app: Sphinx, document: nodes.document) -> None:
    """Links to a folder of reports, which the site has not, lead to the list of all."""
    for link in document.findall(pending_xref):
        if link["reftype"] != "myst" or link["refdomain"] == "doc":
            continue
        folder = (Path(app.srcdir) / link["refdoc"]).parent / link["reftarget"]
        if folder.is_dir() and folder.resolve().is_relative_to(REPORTS):
            link["refdomain"], link["reftarget"], link["reftargetid"] = "doc", *_LIST


def _enlarge(app: Sphinx, document: nodes.document) -> None:
    """Large pictures fill the column; all that a phone shows smaller lead to themselves in full size.

    Sphinx makes such a link of every picture that has a width.
    """
    for picture in document.findall(nodes.image):
        pixels = imagesize.get(Path(app.srcdir) / picture["uri"])[0]
        if pixels > _PHONE:
            picture["width"] = "100%" if pixels > _LARGE else f"{pixels}px"


def _fit(_app: Sphinx, document: nodes.document) -> None:
    """Tables of few columns fit a phone, where long names may break behind an underscore; others scroll."""
    for table in document.findall(nodes.table):
        if len(list(table.findall(nodes.colspec))) >= _MANY:
            table["classes"].append("wide")
        for name in list(table.findall(nodes.literal)):
            first, *others = name.astext().split("_")
            name.clear()
            name += nodes.Text(first)
            for part in others:
                name += [nodes.Text("_"), nodes.raw("", "<wbr>", format="html"), nodes.Text(part)]


def _copy(app: Sphinx, exception: Exception | None) -> None:
    """Put the reports beside the pages, and the page that is made of each."""
    if exception is not None or app.builder.format != "html":
        return
    target = Path(app.outdir) / "reports"
    shutil.copytree(REPORTS, target, dirs_exist_ok=True)
    for _, path in reports():
        page = (target / path.relative_to(REPORTS)).with_suffix(".html")
        page.write_text(Report.read(path).html(), encoding="utf-8")


def setup(app: Sphinx) -> dict[str, Any]:
    """Sphinx's entry."""
    app.connect("source-read", _replace)
    app.connect("doctree-read", _link)
    app.connect("doctree-read", _enlarge)
    app.connect("doctree-read", _fit)
    app.connect("build-finished", _copy)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
