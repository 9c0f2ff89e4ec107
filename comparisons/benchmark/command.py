"""The commands `benchmark` and `benchmark-wall`."""

import click

from comparisons.lab.commands import COUNT, FiniteRange, Plan, experiment


@experiment(short_help="Time of a whole solve beside that of one factorisation.")
@click.option("--cells", type=COUNT, multiple=True, default=(8, 16, 32, 64), show_default=True,
              help="Cells along a side; may take several numbers.")  # fmt: skip
@click.option("--friction", type=FiniteRange(0.0), multiple=True, default=(0.1, 0.2, 0.5), show_default=True,
              help="Coefficients of friction; may take several numbers.")  # fmt: skip
@click.option("--factorisation", metavar="NAME", default="auto", show_default=True,
              help="Factorisation to measure, see: qvi-contact methods")  # fmt: skip
def benchmark(cells: tuple[int, ...], friction: tuple[float, ...], factorisation: str) -> Plan:
    """Compare a whole solve with Coulomb friction with one factorisation of the same matrix.

    The problem is the paper's compressed plate on triangles, on n × n equal cells and on graded ones; and there are
    histories and sweeps, whose problems share a factorisation. Measured are time, iterations, peak memory and accuracy,
    and how they grow with n. Each time is a median, measured in a process of its own with a fixed number of threads.
    A solve that fails is listed with its status. How other methods do is compared by `comparisons solvers`.

    \b
    Examples:
        python -m comparisons benchmark --cells 32 64 --friction 0.2
        python -m comparisons benchmark --threads 4 --store results/four.sqlite --out results/four
    """  # noqa: D301
    from comparisons.benchmark import report, study

    studies = [study.whole(cells, friction, factorisation), study.graded(factorisation),
               study.sequences(max(cells) < 32)]  # fmt: skip
    return Plan(studies, report.report)


@experiment(timeout=400.0, short_help="How the time of walls of many blocks grows.")
@click.option("--blocks", type=COUNT, multiple=True, default=(8, 16, 32), show_default=True,
              help="Blocks along a side of a wall; may take several numbers.")  # fmt: skip
@click.option("--load", type=FiniteRange(0.0), multiple=True, default=(0.02, 0.3, 0.45), show_default=True,
              help="Load of a wall from the side, over its weight; may take several numbers.")  # fmt: skip
def benchmark_wall(blocks: tuple[int, ...], load: tuple[float, ...]) -> Plan:
    """Measure the solve of walls of n × n blocks with dry joints between their courses, pushed from the side.

    Times are CPU seconds. Pushed by 0.02 of its weight a wall sticks, by 0.3 it opens and slips, by 0.45 it is close to
    its limit.

    \b
    Example:
        python -m comparisons benchmark-wall --blocks 8 16
    """  # noqa: D301
    from comparisons.benchmark import report, study

    return Plan([study.walls(blocks, load)], report.wall_report)
