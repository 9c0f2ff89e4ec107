"""The command `peers`."""

import os
from pathlib import Path

import click

from comparisons.options import ListCommand, folder_option
from comparisons.study.options import RunOptions, study_options

_FOLDER = "results/peers"


@click.command(cls=ListCommand)
@study_options(f"{_FOLDER}/peers.sqlite", timeout=300.0)
@click.option("--friction", type=float, multiple=True, default=(0.2, 1.0), help="μ.", show_default=True)
@click.option("--cells", type=int, multiple=True, default=(8, 16, 32, 64), help="Cells a side.", show_default=True)
@click.option("--repeat", type=int, default=3, help="Most repetitions, within 20 s.", show_default=True)
@click.option("--getfem", metavar="PYTHON", help="Another Python, in which GetFEM is installed.")
@click.option("--json", "as_json", is_flag=True, help="One JSON document on standard output instead of the tables.")
@click.option("--out", metavar="FOLDER", default=_FOLDER, callback=folder_option, show_default=True,
              help="Folder of the report.")  # fmt: skip
def peers(
    options: RunOptions,
    friction: tuple[float, ...],
    cells: tuple[int, ...],
    repeat: int,
    getfem: str | None,
    as_json: bool,
    out: Path,
) -> None:
    """The compressed plate by displacement codes beside the equilibrium model: accuracy for its cost.

    NGSolve (Nitsche's method, several variants) and GetFEM (its contact brick), each where it is installed, the
    condensed method of this package, its displacement companion, and what only the two together can say: guaranteed
    bounds of the force. On uniform and graded meshes: force, unknowns, time, memory. Each case has a process of its own
    and one thread. A code that is not installed is a line that says how to get it. On a cluster the environment
    variable PYTHON_WITH_GETFEM of each worker names its Python for GetFEM.

    \b
    Examples:
        python -m comparisons peers --getfem /usr/bin/python3
        python -m comparisons peers --friction 0.2 --cells 8 16 --store small.sqlite --out results/small
    """  # noqa: D301
    from comparisons.peers import measure, report
    from comparisons.peers.cases import peers_study
    from comparisons.report import show, write_report
    from comparisons.study import read_study
    from qvi_contact.basics.writing import writable_folder
    from qvi_contact.errors import InputError

    if options.threads != 1:
        raise InputError("threads", options.threads, "leave it at 1: every code runs on one thread")
    if getfem is not None:
        os.environ[measure.GETFEM] = getfem
    study = peers_study(friction, cells, repeat)
    folder = writable_folder(out)
    options.run(study)
    rows = read_study(options.store).rows
    if as_json:
        click.echo(report.as_json(rows))
    document = report.peers_report(rows, _command(study.factors["friction"], study.factors["cells"], repeat))
    written = write_report(document, folder)
    if not as_json:
        show(document, written)


def _command(friction: tuple[float, ...], cells: tuple[int, ...], repeat: int) -> str:
    """The command that measures the same, without the place of its files and of other Pythons."""
    words = ["python -m comparisons peers --friction", *(f"{mu:g}" for mu in friction), "--cells", *map(str, cells)]
    return " ".join([*words, f"--repeat {repeat}"])
