"""The commands `peers` and `peers-pin`."""

import os

import click

from comparisons.lab.commands import COUNT, FiniteRange, Plan, experiment
from comparisons.peers import LEVELS


@experiment(timeout=300.0, short_help="Accuracy and cost beside displacement codes.")
@click.option("--friction", type=FiniteRange(0.0), multiple=True, default=(0.2, 0.1, 0.05, 1.0), show_default=True,
              help="Coefficients of friction; may take several numbers.")  # fmt: skip
@click.option("--cells", type=COUNT, multiple=True, default=(8, 16, 32), show_default=True,
              help="Cells along a side of equal and of corner-graded meshes; may take several numbers.")  # fmt: skip
@click.option("--levels", type=click.IntRange(1, LEVELS), default=LEVELS, show_default=True,
              help="Number of meshes graded to the corner and to the end of the stick zone.")  # fmt: skip
@click.option("--repeat", type=COUNT, default=5, show_default=True,
              help="Largest number of repetitions within 5 s.")  # fmt: skip
@click.option("--getfem", metavar="PYTHON", help="Python interpreter that has GetFEM, if this one has not.")
def peers(friction: tuple[float, ...], cells: tuple[int, ...], levels: int, repeat: int, getfem: str | None) -> Plan:
    """Compare the force of the compressed plate with that of displacement codes, for its cost.

    The codes are NGSolve (Nitsche's method, degrees 2 to 6), GetFEM (its contact brick, degrees 2 to 4), and this
    package on triangles of degree 3 to 6. Its stresses and displacements together also bound the force, under slip too.

    The meshes have equal cells, cells graded to the free corner, and cells graded to the corner and to the end of the
    stick zone. Measured are force, unknowns, time and memory. Each case runs in a process of its own, on one thread.
    For a code that is not installed the report says how to get it. On a cluster the environment variable
    PYTHON_WITH_GETFEM of each worker names its Python for GetFEM.

    \b
    Examples:
        python -m comparisons peers --getfem /usr/bin/python3
        python -m comparisons peers --friction 0.2 --cells 8 16 --levels 3 --store small.sqlite --out results/small
    """  # noqa: D301
    from comparisons.peers import report, study

    if getfem is not None:
        os.environ[study.GETFEM] = getfem
    return Plan([study.peers_study(friction, cells, repeat, levels)], report.report)


@experiment(timeout=300.0, short_help="A loaded pin by displacement codes, on the same triangles.")
@click.option("--friction", type=FiniteRange(0.0), multiple=True, default=(0.0, 0.1), show_default=True,
              help="Coefficients of friction; may take several numbers.")  # fmt: skip
@click.option("--cells", type=COUNT, multiple=True, default=(6, 12), show_default=True,
              help="Edges of the pin in a quarter; may take several numbers.")  # fmt: skip
def peers_pin(friction: tuple[float, ...], cells: tuple[int, ...]) -> Plan:
    """Compare the loaded pin of NAFEMS R0094-4 with displacement codes.

    Displacements and forces on the same triangles by NGSolve and by this package side by side, with small strain
    and with finite strain.

    \b
    Example:
        python -m comparisons peers-pin
    """  # noqa: D301
    from comparisons.peers import pin, study

    return Plan([pin.pin_study(friction, cells, study.missing_codes())], pin.pin_report)
