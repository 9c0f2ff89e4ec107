"""The report of a run: terminal, JSON, Markdown, picture."""

import json
from pathlib import Path
from typing import Any, Final

from comparisons.benchmark.findings import findings
from comparisons.benchmark.tables import tables
from comparisons.lab.tables import markdown_table, print_table
from qvi_contact.basics.writing import write_text
from qvi_contact.plots import has_matplotlib
from qvi_contact.plots.style import save_figure, settings

Document = dict[str, Any]

TEXTS: Final = ("benchmark.json", "benchmark.md")
PICTURES: Final = ("benchmark.png", "benchmark.svg")

_WIDTH: Final = 132


def as_json(document: Document) -> str:
    """The document as text."""
    return json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False)


def show(document: Document, written: list[Path]) -> None:
    """Print the tables on standard output."""
    from rich.console import Console

    console = Console(highlight=False, markup=False)
    if not console.is_terminal:
        console = Console(highlight=False, markup=False, width=_WIDTH)
    console.print("\n".join([*heading(document), ""]))
    for grid in tables(document):
        print_table(console, grid)
        console.print(f"{grid.note}\n")
    for sentence in findings(document):
        console.print(f"• {sentence}")
    if written and not has_matplotlib():
        console.print("\nNo picture: it needs matplotlib, python -m pip install 'qvi-contact[plot]'")
    if written:
        console.print(f"\nWritten to {written[0].parent}: {', '.join(path.name for path in written)}", soft_wrap=True)


def heading(document: Document) -> list[str]:
    """Machine, versions, threads, command, date."""
    machine = document["machine"]
    memory = f"{machine['memory_bytes'] / 2**30:.0f} GiB" if machine["memory_bytes"] else "memory unknown"
    versions = ", ".join(f"{name} {version}" for name, version in document["versions"].items())
    load = "" if machine["load_average"] is None else f"; load before the run {machine['load_average']:g}"
    return [
        f"Machine: {machine['processor']}, {machine['cores']} cores, {memory}; {machine['system']}{load}",
        f"Versions: {machine['python']}, {versions}",
        f"Threads: {document['threads']}",
        f"Command: {document['command']}",
        f"Begun: {document['began']}",
    ]


def write(document: Document, folder: Path, friction: float) -> list[Path]:
    """Write all files, each whole or not at all; pictures where matplotlib is installed."""
    write_text(folder / TEXTS[0], as_json(document) + "\n")
    write_text(folder / TEXTS[1], as_markdown(document))
    written = [folder / name for name in TEXTS]
    if has_matplotlib():
        from comparisons.benchmark.figures import picture

        with settings():
            figure = picture(document, friction)
            for name in PICTURES:
                save_figure(folder / name, figure)
        written += [folder / name for name in PICTURES]
    return written


def as_markdown(document: Document) -> str:
    """The report as Markdown."""
    image = f"![Wall time against unknowns; error against wall time]({PICTURES[1]})"
    parts = [
        "# Benchmark: the compressed plate",
        "",
        *(f"- {line}" for line in heading(document)),
        "",
        "Every figure is a median of one run, every ratio one of such medians. The problem is "
        "`qvi_contact.gallery.compressed_plate(μ, cells=(n, n))`.",
        "",
        *(f"- {sentence}" for sentence in findings(document)),
        "",
        *([image, ""] if has_matplotlib() else []),
        *(markdown_table(grid) for grid in tables(document)),
    ]
    return "\n".join(parts).rstrip() + "\n"
