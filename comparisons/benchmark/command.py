"""The command `benchmark`."""

from pathlib import Path

import click

from comparisons.lab.options import ListCommand, folder_option, json_option


@click.command(cls=ListCommand, short_help="Time of a whole solve beside that of one factorisation.")
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

    \b
    Examples:
        python -m comparisons benchmark --cells 32 64 --friction 0.2
        python -m comparisons benchmark --threads 4 --out results/benchmark
    """  # noqa: D301
    from comparisons.benchmark import rows, study
    from comparisons.benchmark.plan import Plan
    from comparisons.benchmark.report import as_json as json_of
    from comparisons.benchmark.report import report
    from comparisons.lab.report import show, write_report
    from qvi_contact.basics.terminal import progress
    from qvi_contact.basics.writing import writable_folder, write_text

    plan = Plan(cells, friction, threads, repeat, not no_naive, factorisation, limit)
    folder = None if out is None else writable_folder(out)
    with progress("benchmark", plan.steps) as advance:
        document = rows.document(study.run(plan, advance))
    made = report(document)
    written = []
    if folder:
        write_text(folder / "benchmark.json", json_of(document) + "\n")
        written = [*write_report(made, folder), folder / "benchmark.json"]
    if as_json:
        click.echo(json_of(document))
    else:
        show(made, written)
