"""The command `benchmark`."""

from dataclasses import replace
from pathlib import Path

import click

from comparisons.lab.options import COUNT, FiniteRange, ListCommand, json_option, out_option
from comparisons.lab.run_options import RunOptions, study_options

FOLDER = "results/benchmark"


@click.command(cls=ListCommand, short_help="Time of a whole solve beside that of one factorisation.")
@study_options(FOLDER, folder=True)
@click.option("--problem", type=click.Choice(["plate", "wall"]), default="plate", help="Problem to solve.",
              show_default=True)  # fmt: skip
@click.option("--blocks", type=COUNT, multiple=True, default=(8, 16, 32), show_default=True,
              help="Blocks along a side of a wall; may take several numbers.")  # fmt: skip
@click.option("--load", type=FiniteRange(0.0), multiple=True,
              help="Load of a wall from the side, over its weight.  [default: 0.02, 0.3, 0.45]")  # fmt: skip
@click.option("--cells", type=COUNT, multiple=True, default=(8, 16, 32, 64),
              show_default=True, help="Cells along a side; may take several numbers.")  # fmt: skip
@click.option("--friction", type=FiniteRange(0.0), multiple=True, default=(0.1, 0.2, 0.5), show_default=True,
              help="Coefficients of friction; may take several numbers.")  # fmt: skip
@click.option("--repeat", type=COUNT, help="Repetitions of each run.  "
              "[default: 5 to 32² cells, 3 to 64²; 10 on graded meshes]")  # fmt: skip
@click.option("--no-naive", is_flag=True,
              help="Leave out the other methods: the plain loop, the loop of condensed QPs, and Uzawa's.")  # fmt: skip
@click.option("--factorisation", metavar="NAME", default="auto", show_default=True,
              help="Factorisation to measure, see: qvi-contact methods")  # fmt: skip
@click.option("--limit", type=FiniteRange(0.0, min_open=True), default=120.0, show_default=True,
              help="Seconds after which another method, or a wall, is stopped.")  # fmt: skip
@out_option(FOLDER)
@json_option
def benchmark(
    options: RunOptions,
    problem: str,
    blocks: tuple[int, ...],
    load: tuple[float, ...],
    cells: tuple[int, ...],
    friction: tuple[float, ...],
    repeat: int | None,
    no_naive: bool,
    factorisation: str,
    limit: float,
    out: Path,
    as_json: bool,
) -> None:
    """Compare a whole solve with Coulomb friction with one factorisation of the same matrix.

    The problem is the paper's compressed plate on triangles, on n × n equal cells and on graded ones; and there are
    histories and sweeps, whose problems share a factorisation. Measured are time, iterations,
    peak memory and accuracy, and how they grow with n. Each time is a median, measured in a process of its own with a
    fixed number of threads. A solve that fails is listed with its status.

    With --problem wall it is a wall of n × n blocks with dry joints between its courses, pushed from the side. Times
    are CPU seconds then.

    Finished cases are kept in --store, and not measured again.

    \b
    Examples:
        python -m comparisons benchmark --cells 32 64 --friction 0.2
        python -m comparisons benchmark --threads 4 --store results/four --out results/four
        python -m comparisons benchmark --problem wall --blocks 8 16
    """  # noqa: D301
    from comparisons.benchmark import study
    from comparisons.benchmark.report import document_of, report, wall_document, wall_report
    from comparisons.lab.reported import run_and_report

    limited = replace(options, timeout=limit)
    if problem == "wall":
        walls = study.walls(blocks, load)
        found = run_and_report(limited.inside("wall.sqlite"), walls, wall_report, out)
        found.tell(found.document(**wall_document(found.stored)) if as_json else None)
        return
    whole, loops = study.whole(cells, friction, repeat, factorisation), study.loops(cells, friction)
    single = replace(options, threads=1)
    beside = [
        (single.inside("graded.sqlite"), study.graded(repeat, factorisation)),
        (single.inside("sequences.sqlite"), study.sequences(max(cells) < 32)),
    ]
    beside += [(limited.inside("loops.sqlite"), loops)] if loops and not no_naive else []
    found = run_and_report(options.inside("whole.sqlite"), whole, report, out, beside)
    found.tell(found.document(**document_of(*found.studies)) if as_json else None)
