"""The report of a run: terminal, JSON, Markdown, picture."""

import json
from pathlib import Path
from typing import Any, Final

from comparisons.benchmark.report import heading
from comparisons.peers.figures import drawable, picture
from comparisons.peers.tables import tables
from comparisons.tables import markdown_table, rich_table
from qvi_contact.files import write_text
from qvi_contact.plots import has_matplotlib
from qvi_contact.plots.style import save_figure, settings

Document = dict[str, Any]

TEXTS: Final = ("peers.json", "peers.md")
PICTURES: Final = ("peers.png", "peers.svg")

_WIDTH: Final = 190


def as_json(document: Document) -> str:
    """The document as text."""
    return json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False)


def show(document: Document, written: list[Path]) -> None:
    """Print heading, tables and findings on standard output."""
    from rich.console import Console

    console = Console(highlight=False, markup=False)
    if not console.is_terminal:
        console = Console(highlight=False, markup=False, width=_WIDTH)
    console.print("\n".join([*heading(document), ""]))
    for grid in tables(document):
        console.print(rich_table(grid))
        console.print(f"{grid.note}\n")
    for sentence in document["findings"]:
        console.print(f"• {sentence}")
    if written and not has_matplotlib():
        console.print("\nNo picture: it needs matplotlib, python -m pip install 'qvi-contact[plot]'")
    if written:
        console.print(f"\nWritten to {written[0].parent}: {', '.join(path.name for path in written)}", soft_wrap=True)


def write(document: Document, folder: Path) -> list[Path]:
    """Write all files, each whole or not at all; pictures where matplotlib is installed and errors are known."""
    write_text(folder / TEXTS[0], as_json(document) + "\n")
    write_text(folder / TEXTS[1], as_markdown(document))
    written = [folder / name for name in TEXTS]
    if _drawn(document):
        with settings():
            figure = picture(document)
            for name in PICTURES:
                save_figure(folder / name, figure)
        written += [folder / name for name in PICTURES]
    return written


def as_markdown(document: Document) -> str:
    """The report as Markdown."""
    image = f"![Relative error of P/2 against unknowns and against wall time]({PICTURES[0]})"
    parts = [
        "# Displacement codes on the compressed plate",
        "",
        *(f"- {sentence}" for sentence in document["findings"]),
        "",
        *([image, ""] if _drawn(document) else []),
        *(markdown_table(grid) for grid in tables(document)),
        "## How it was measured",
        "",
        *(f"- {line}" for line in heading(document)),
        "",
        "Every code solves `qvi_contact.gallery.compressed_plate(μ, cells=(n, n), grading=q)` on the same grid lines. "
        "NGSolve: degree p on quadrilaterals, Nitsche's method in the variant named. GetFEM: its integral contact "
        "brick, r = E, tolerance 1e-8, bilinear contact stresses.",
    ]
    return "\n".join(parts).rstrip() + "\n"


def _drawn(document: Document) -> bool:
    return has_matplotlib() and bool(drawable(document))
