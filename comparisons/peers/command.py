"""The command `peers`."""

import os
from pathlib import Path

import click

from comparisons.lab.options import ListCommand, folder_option
from comparisons.lab.study.options import RunOptions, study_options
from comparisons.peers import LEVELS

_FOLDER = "results/peers"


@click.command(cls=ListCommand)
@study_options(f"{_FOLDER}/peers.sqlite", timeout=300.0)
@click.option("--friction", type=float, multiple=True, default=(0.2, 0.05, 1.0), help="μ.", show_default=True)
@click.option("--cells", type=int, multiple=True, default=(8, 16, 32), show_default=True,
              help="Cells a side of meshes that are counted so.")  # fmt: skip
@click.option("--levels", type=int, default=LEVELS, show_default=True,
              help="How many meshes graded to corner and transition.")  # fmt: skip
@click.option("--repeat", type=int, default=5, help="Most repetitions, within 5 s.", show_default=True)
@click.option("--getfem", metavar="PYTHON", help="Another Python, in which GetFEM is installed.")
@click.option("--json", "as_json", is_flag=True, help="One JSON document on standard output instead of the tables.")
@click.option("--out", metavar="FOLDER", default=_FOLDER, callback=folder_option, show_default=True,
              help="Folder of the report.")  # fmt: skip
def peers(
    options: RunOptions,
    friction: tuple[float, ...],
    cells: tuple[int, ...],
    levels: int,
    repeat: int,
    getfem: str | None,
    as_json: bool,
    out: Path,
) -> None:
    """The compressed plate by displacement codes beside this package: accuracy for its cost.

    NGSolve (Nitsche's method, degrees 2 to 6) and GetFEM (its contact brick, degrees 2 to 4), each where it is
    installed, this package on rectangles and on triangles of degree 3 to 6, its displacement companion, and what stress
    and displacement together say: guaranteed bounds of the force. On equal cells, graded to the free corner, and graded
    to the corner and to the place where stick ends and slip begins: force, unknowns, time, memory. Each case has a
    process of its own and one thread. A code that is not installed is a line that says how to get it. On a cluster the
    environment variable PYTHON_WITH_GETFEM of each worker names its Python for GetFEM.

    \b
    Examples:
        python -m comparisons peers --getfem /usr/bin/python3
        python -m comparisons peers --friction 0.2 --cells 8 16 --levels 3 --store small.sqlite --out results/small
    """  # noqa: D301
    from comparisons.lab.report import show, write_report
    from comparisons.lab.study import read_study, write_csv
    from comparisons.peers import measure
    from comparisons.peers.cases import peers_study
    from comparisons.peers.report import as_json as json_of
    from comparisons.peers.report import report
    from qvi_contact.basics.writing import writable_folder
    from qvi_contact.errors import InputError

    if options.threads != 1:
        raise InputError("threads", options.threads, "leave it at 1: every code runs on one thread")
    if getfem is not None:
        os.environ[measure.GETFEM] = getfem
    study = peers_study(friction, cells, repeat, levels)
    folder = writable_folder(out)
    options.run(study)
    rows = read_study(options.store).rows
    made = report(rows)
    written = [*write_report(made, folder), folder / f"{made.name}.csv.gz"]
    write_csv(written[-1], rows)
    if as_json:
        click.echo(json_of(rows, made))
    else:
        show(made, written)
