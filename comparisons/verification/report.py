"""The manual as files and on the terminal."""

import json
from pathlib import Path
from typing import Any, Final

from comparisons.lab.report import Document as Report
from comparisons.lab.report import write_report
from comparisons.lab.report.document import table_text
from comparisons.lab.report.marks import escaped
from comparisons.lab.tables import Grid, print_table
from comparisons.verification import texts
from qvi_contact.plots import has_matplotlib

Document = dict[str, Any]

NAME, PICTURE = "verification", "overview.svg"
TITLE: Final = "Verification manual"
INTRODUCTION: Final = (
    "Every row compares a number computed by this package with one that is known otherwise: by a closed form, by "
    "equilibrium or symmetry, from print, from another code, or from a method of a different kind."
)
CAPTION: Final = "Error over tolerance of every row, problem by problem. Left of the line a row passes."


def as_json(document: Document) -> str:
    """The document as text."""
    return json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False)


def write(document: Document, folder: Path) -> list[Path]:
    """Write Markdown, one HTML page, and the picture where matplotlib is installed; each whole or not at all."""
    picture = _picture(document)
    pictures = {PICTURE: picture} if picture else {}
    return write_report(Report(NAME, as_markdown(document, bool(picture)), pictures), folder)


def as_markdown(document: Document, picture: bool = False) -> str:
    """The manual as Markdown."""
    lines = [f"# {TITLE}", "", INTRODUCTION, "", f"**{texts.verdict(document)}**", ""]
    lines += [f"- {escaped(line)}" for line in texts.failed(document)]
    lines += ["", f"![{CAPTION}]({PICTURE})", ""] if picture else [""]
    lines += ["## How to read the tables", "", *(f"- *{name}*: {text}" for name, text in texts.reading()), ""]
    for chapter in document["chapters"]:
        lines += [f"## {chapter['title']}", "", f"- *Shows*: {chapter['shows']}", f"- *Reading*: {chapter['reading']}"]
        lines += [f"- *Failure*: {chapter['failure']}", ""]
        for problem in chapter["problems"]:
            lines += [f"### `{problem['name']}`", "", escaped(problem["about"]), "", table_text(texts.grid(problem))]
    lines += ["## Machine and versions", "", *(f"- {line}" for line in texts.machine_lines(document))]
    return "\n".join(lines).rstrip() + "\n"


def show(document: Document, written: list[Path]) -> None:
    """Print a summary on standard output."""
    from rich.console import Console

    console = Console(highlight=False, markup=False)
    if not console.is_terminal:
        console = Console(highlight=False, markup=False, width=120)
    print_table(console, summary(document))
    for line in texts.failed(document):
        console.print(f"{texts.FAILED} {line}", soft_wrap=True)
    console.print(texts.verdict(document))
    if written and not has_matplotlib():
        console.print("No picture: it needs matplotlib, python -m pip install 'qvi-contact[plot]'")
    if written:
        console.print(f"Written to {written[0].parent}: {', '.join(path.name for path in written)}", soft_wrap=True)


def summary(document: Document) -> Grid:
    """One line for each chapter."""
    rows = []
    for chapter in document["chapters"]:
        found = [row for problem in chapter["problems"] for row in problem["rows"]]
        failures = sum(not row["passed"] for row in found)
        ratios = [row["ratio"] for row in found]
        largest = "none" if None in ratios else f"{max(ratios):.2g}"
        rows.append((chapter["title"], str(len(chapter["problems"])), str(len(found)), str(failures), largest))
    headings = ("chapter", "problems", "rows", "failed", "largest error / tolerance")
    return Grid(TITLE, headings, rows)


def _picture(document: Document) -> str:
    if not has_matplotlib():
        return ""
    from comparisons.verification.figures import svg

    return svg(document)
