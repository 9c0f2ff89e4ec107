"""Commands of ``python -m comparisons``."""

import json
from pathlib import Path

import click

from comparisons.exchange.commands import export, import_file
from comparisons.options import ListCommand


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
def group() -> None:
    """Experiments that compare methods, solvers and published numbers."""


def _folder(context: click.Context, parameter: click.Parameter, value: str | None) -> Path | None:  # noqa: ARG001
    """A folder's name; an empty one, as from an unset shell variable, is not the current folder."""
    if value == "":
        raise click.BadParameter("give the name of a folder")
    return None if value is None else Path(value)


@group.command()
@click.option(
    "--out",
    metavar="FOLDER",
    callback=_folder,
    help="Folder for the report: tables as CSV, pictures as PNG and SVG.  [default: results/paper]",
)
@click.option("--json", "as_json", is_flag=True, help="One JSON document on standard output instead of the tables.")
def paper(out: Path | None, as_json: bool) -> None:
    """Więckowski's plate: Table 1 and Figures 2-5 beside the converged solution.

    Runs the paper's Uzawa iteration for its 30 iterations and to convergence, the fixed point with quadratic and with
    second-order cone programs, and every installed back end on the same seven problems. With --json files are
    written only if --out is given.
    """
    from comparisons.paper import report, study
    from qvi_contact.files import writable_folder
    from qvi_contact.terminal import progress

    folder = None
    if out is not None or not as_json:
        folder = writable_folder(out or Path("results") / "paper")
    with progress("paper", study.step_count() + (len(report.FILES) if folder else 0)) as advance:
        result = study.run(advance)
        written = report.write(result, folder, advance) if folder else []
    if as_json:
        click.echo(json.dumps(report.as_document(result), indent=2, allow_nan=False))
    else:
        report.show(result, written)


@group.command(cls=ListCommand)
@click.option("--cells", type=int, multiple=True, default=(64, 128, 256, 512), help="Cells a side.", show_default=True)
@click.option("--friction", type=float, multiple=True, default=(0.1, 0.2, 0.5), help="μ.", show_default=True)
@click.option("--threads", type=int, default=1, help="Threads of the libraries.", show_default=True)
@click.option("--repeat", type=int, help="Repetitions.  [default: 5 to 128² cells, 3 to 512²; 20 on graded meshes]")
@click.option("--json", "as_json", is_flag=True, help="One JSON document on standard output instead of the tables.")
@click.option("--out", metavar="FOLDER", callback=_folder, help="Folder for JSON, Markdown and picture.")
@click.option("--no-naive", is_flag=True, help="Without the loops: naive ones, on condensed QPs, Uzawa.")
@click.option("--factorisation", metavar="NAME", default="auto", help="The only one to measure.", show_default=True)
@click.option("--limit", type=float, default=120.0, help="Seconds after which a loop is given up.", show_default=True)
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
    """Whole Coulomb solves beside one factorisation of the same matrix, and beside naive loops.

    Measures the compressed plate on n × n equal cells and on graded ones: times, iterations, peak memory, growth,
    accuracy. Each figure is a median of this run, taken in a process of its own with its threads limited; solves that
    fail are rows with their status.

    \b
    Examples:
        python -m comparisons benchmark --cells 32 64 --friction 0.2
        python -m comparisons benchmark --threads 4 --out results/benchmark
    """  # noqa: D301
    from comparisons.benchmark import report, rows, study
    from comparisons.benchmark.plan import Plan
    from qvi_contact.files import writable_folder
    from qvi_contact.terminal import progress

    plan = Plan(cells, friction, threads, repeat, not no_naive, factorisation, limit)
    folder = None if out is None else writable_folder(out)
    with progress("benchmark", plan.steps) as advance:
        document = rows.document(study.run(plan, advance))
    written = report.write(document, folder, plan.loop_friction) if folder else []
    if as_json:
        click.echo(report.as_json(document))
    else:
        report.show(document, written)


@group.command(cls=ListCommand)
@click.option("--out", metavar="FOLDER", callback=_folder, help="Folder for Markdown, HTML page and picture.")
@click.option("--json", "as_json", is_flag=True, help="One JSON document on standard output instead of the summary.")
@click.option("--only", metavar="NAME…", multiple=True, help="Chapters or problems to run, such as ssnv128.")
@click.option("--quick", is_flag=True, help="Coarse meshes and few cases of every problem.")
def verify(out: Path | None, as_json: bool, only: tuple[str, ...], quick: bool) -> int:
    """The verification manual: problems whose answer is known otherwise, row by row.

    Closed forms, equilibrium, printed numbers, other codes, and methods against each other. The exit status is 0 if
    every row passed, 1 if not.

    \b
    Examples:
        python -m comparisons verify --out comparisons/reports/verification
        python -m comparisons verify --only ssnv128 limits --quick
    """  # noqa: D301
    from comparisons.verify import registry, report, study
    from qvi_contact.files import writable_folder
    from qvi_contact.terminal import progress

    chapters = registry.choose(only)
    folder = None if out is None else writable_folder(out)
    with progress("verify", study.step_count(chapters)) as advance:
        document = study.run(chapters, quick, advance, only)
    written = report.write(document, folder) if folder else []
    if as_json:
        click.echo(report.as_json(document))
    else:
        report.show(document, written)
    return 0 if document["passed"] else 1


@group.command(cls=ListCommand)
@click.option("--friction", type=float, multiple=True, default=(0.2, 1.0), help="μ.", show_default=True)
@click.option("--cells", type=int, multiple=True, default=(8, 16, 32, 64), help="Cells a side.", show_default=True)
@click.option("--repeat", type=int, default=3, help="Most repetitions, within 20 s.", show_default=True)
@click.option("--limit", type=float, default=300.0, help="Seconds after which a process is ended.", show_default=True)
@click.option("--getfem", metavar="PYTHON", help="Another Python, in which GetFEM is installed.")
@click.option("--json", "as_json", is_flag=True, help="One JSON document on standard output instead of the tables.")
@click.option("--out", metavar="FOLDER", callback=_folder, help="Folder for JSON, Markdown and picture.")
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


group.add_command(export)
group.add_command(import_file)
