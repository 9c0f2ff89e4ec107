"""The manual as files and on the terminal."""

import json
from pathlib import Path
from typing import Any, Final

from comparisons.lab.tables import Grid, markdown_table, rich_table
from comparisons.verification import texts
from qvi_contact.basics.writing import write_text
from qvi_contact.plots import has_matplotlib

Document = dict[str, Any]

MARKDOWN, PAGE, PICTURE = "verification.md", "verification.html", "overview.svg"
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
    write_text(folder / MARKDOWN, as_markdown(document, bool(picture)))
    write_text(folder / PAGE, as_html(document, picture))
    if picture:
        write_text(folder / PICTURE, picture)
    return [folder / name for name in (MARKDOWN, PAGE, *([PICTURE] if picture else []))]


def as_markdown(document: Document, picture: bool = False) -> str:
    """The manual as Markdown."""
    lines = [f"# {TITLE}", "", INTRODUCTION, "", f"**{texts.verdict(document)}**", ""]
    lines += [f"- {line}" for line in texts.failed(document)]
    lines += ["", f"![{CAPTION}]({PICTURE})", ""] if picture else [""]
    lines += ["## How to read the tables", "", *(f"- *{name}*: {text}" for name, text in texts.reading()), ""]
    for chapter in document["chapters"]:
        lines += [f"## {chapter['title']}", "", f"- *Shows*: {chapter['shows']}", f"- *Reading*: {chapter['reading']}"]
        lines += [f"- *Failure*: {chapter['failure']}", ""]
        for problem in chapter["problems"]:
            lines += [f"### `{problem['name']}`", "", problem["about"], "", markdown_table(texts.grid(problem))]
    lines += ["## Machine and versions", "", *(f"- {line}" for line in texts.machine_lines(document))]
    return "\n".join(lines).rstrip() + "\n"


def as_html(document: Document, picture: str = "") -> str:
    """The manual as one HTML page that loads nothing."""
    from comparisons.lab.report.page import page_environment

    template = page_environment("comparisons.verification").get_template("manual.html")
    chapters = [
        chapter | {"problems": [problem | {"grid": texts.grid(problem)} for problem in chapter["problems"]]}
        for chapter in document["chapters"]
    ]
    return template.render(
        title=TITLE,
        introduction=INTRODUCTION,
        caption=CAPTION,
        passed=document["passed"],
        verdict=texts.verdict(document),
        failures=texts.failed(document),
        reading=texts.reading(),
        picture=picture,
        chapters=chapters,
        failed_word=texts.FAILED,
        machine=texts.machine_lines(document),
    )


def show(document: Document, written: list[Path]) -> None:
    """Print a summary on standard output."""
    from rich.console import Console

    console = Console(highlight=False, markup=False)
    if not console.is_terminal:
        console = Console(highlight=False, markup=False, width=120)
    console.print(rich_table(summary(document)))
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
