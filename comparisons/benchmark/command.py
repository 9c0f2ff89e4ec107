"""The command `benchmark`."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import click

from comparisons.lab.options import ListCommand, folder_option, json_option


@click.command(cls=ListCommand, short_help="Time of a whole solve beside that of one factorisation.")
@click.option(
    "--problem", type=click.Choice(["plate", "wall"]), default="plate", help="Problem to solve.", show_default=True
)
@click.option(
    "--blocks",
    type=int,
    multiple=True,
    default=(8, 16, 32),
    help="Blocks along a side of a wall; may take several numbers.",
    show_default=True,
)
@click.option(
    "--load",
    type=float,
    multiple=True,
    help="Load of a wall from the side, over its weight.  [default: 0.02, 0.3, 0.45]",
)
@click.option("--element", default="bfs", help="Element of a wall, bfs or hct.", show_default=True)
@click.option(
    "--cells",
    type=int,
    multiple=True,
    default=(64, 128, 256, 512),
    help="Cells along a side; may take several numbers.",
    show_default=True,
)
@click.option(
    "--friction",
    type=float,
    multiple=True,
    default=(0.1, 0.2, 0.5),
    help="Coefficients of friction; may take several numbers.",
    show_default=True,
)
@click.option("--threads", type=int, default=1, help="Threads of the libraries.", show_default=True)
@click.option(
    "--repeat", type=int, help="Repetitions of each run.  [default: 5 to 128² cells, 3 to 512²; 20 on graded meshes]"
)
@json_option
@click.option(
    "--out",
    metavar="FOLDER",
    callback=folder_option,
    help="Folder for the report and its JSON document.  [default: none is written]",
)
@click.option(
    "--no-naive",
    is_flag=True,
    help="Leave out the other methods: the plain loop, the loop of condensed QPs, and Uzawa's.",
)
@click.option(
    "--factorisation",
    metavar="NAME",
    default="auto",
    help="Factorisation to measure, see: qvi-contact methods",
    show_default=True,
)
@click.option(
    "--limit", type=float, default=120.0, help="Seconds after which another method is stopped.", show_default=True
)
def benchmark(
    problem: str,
    blocks: tuple[int, ...],
    load: tuple[float, ...],
    element: str,
    cells: tuple[int, ...],
    friction: tuple[float, ...],
    threads: int,
    repeat: int | None,
    as_json: bool,
    out: Path | None,
    no_naive: bool,
    factorisation: str,
    limit: float,
) -> None:
    """Compare a whole solve with Coulomb friction with one factorisation of the same matrix.

    The problem is the paper's compressed plate, on n × n equal cells and on graded ones. Measured are time, iterations,
    peak memory and accuracy, and how they grow with n. Each time is a median, measured in a process of its own with a
    fixed number of threads. A solve that fails is listed with its status.

    With --problem wall it is a wall of n × n blocks with dry joints between its courses, pushed from the side. Times
    are CPU seconds then.

    \b
    Examples:
        python -m comparisons benchmark --cells 32 64 --friction 0.2
        python -m comparisons benchmark --threads 4 --out results/benchmark
        python -m comparisons benchmark --problem wall --blocks 8 16
    """  # noqa: D301
    from comparisons.benchmark import rows, study, wall_report
    from comparisons.benchmark import wall as walls
    from comparisons.benchmark.plan import Plan
    from comparisons.benchmark.report import as_json as json_of
    from comparisons.benchmark.report import report
    from comparisons.lab.report import show, write_report
    from qvi_contact.basics.terminal import Advance, progress
    from qvi_contact.basics.writing import writable_folder, write_text

    measured: Callable[[Advance], dict[str, Any]]
    if problem == "wall":
        blocked = walls.WallPlan(blocks, load or tuple(walls.STATES), element, threads, limit)
        name, steps = "benchmark-wall", blocked.steps
        measured, report_of = partial(walls.run, blocked), wall_report.report
    else:
        plan = Plan(cells, friction, threads, repeat, not no_naive, factorisation, limit)
        name, steps = "benchmark", plan.steps
        measured, report_of = lambda advance: rows.document(study.run(plan, advance)), report
    folder = None if out is None else writable_folder(out)
    with progress("benchmark", steps) as advance:
        document = measured(advance)
    if folder:  # before the report, so that a picture that fails costs no numbers
        write_text(folder / f"{name}.json", json_of(document) + "\n")
    made = report_of(document)
    written = [*write_report(made, folder), folder / f"{name}.json"] if folder else []
    if as_json:
        click.echo(json_of(document))
    else:
        show(made, written)
