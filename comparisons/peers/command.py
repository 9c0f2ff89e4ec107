"""The command `peers`."""

from pathlib import Path

import click

from comparisons.options import ListCommand, folder_option


@click.command(cls=ListCommand)
@click.option("--friction", type=float, multiple=True, default=(0.2, 1.0), help="μ.", show_default=True)
@click.option("--cells", type=int, multiple=True, default=(8, 16, 32, 64), help="Cells a side.", show_default=True)
@click.option("--repeat", type=int, default=3, help="Most repetitions, within 20 s.", show_default=True)
@click.option("--limit", type=float, default=300.0, help="Seconds after which a process is ended.", show_default=True)
@click.option("--getfem", metavar="PYTHON", help="Another Python, in which GetFEM is installed.")
@click.option("--json", "as_json", is_flag=True, help="One JSON document on standard output instead of the tables.")
@click.option("--out", metavar="FOLDER", callback=folder_option, help="Folder for JSON, Markdown and picture.")
def peers(
    friction: tuple[float, ...],
    cells: tuple[int, ...],
    repeat: int,
    limit: float,
    getfem: str | None,
    as_json: bool,
    out: Path | None,
) -> None:
    """The compressed plate by displacement codes beside the equilibrium model: accuracy for its cost.

    NGSolve (Nitsche's method, several variants) and GetFEM (its contact brick), each where it is installed, and the
    condensed method of this package, on uniform and graded meshes: force, unknowns, time, memory. Each run has a
    process of its own and one thread. A code that is not installed is a line that says how to get it.

    \b
    Examples:
        python -m comparisons peers --friction 0.2 --cells 8 16
        python -m comparisons peers --getfem /usr/bin/python3 --out results/peers
    """  # noqa: D301
    from comparisons.peers import report, study
    from comparisons.peers.cases import Plan
    from qvi_contact.files import writable_folder
    from qvi_contact.terminal import progress

    plan = Plan(friction, cells, repeat, limit, getfem)
    folder = None if out is None else writable_folder(out)
    with progress("peers", plan.steps) as advance:
        document = study.run(plan, advance)
    written = report.write(document, folder) if folder else []
    if as_json:
        click.echo(report.as_json(document))
    else:
        report.show(document, written)
