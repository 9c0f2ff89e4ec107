"""The command `bounds`."""

import click

from comparisons.lab.commands import COUNT, Plan, experiment


@experiment(timeout=600.0, short_help="Bounds beside displacements of another code, NGSolve.")
@click.option("--count", type=COUNT, metavar="NUMBER", default=140, show_default=True,
              help="Problems of each family, and as many more with springs.")  # fmt: skip
def bounds(count: int) -> Plan:
    """Bound the errors of generated problems with friction, temperature and springs, and compare with NGSolve.

    Displacements of degree 5 on graded meshes, with a frictional contact iteration of their own, stand for the exact
    solution. The report says whether they are within the bounds of stress, displacement and forces, and how far the
    bounds are from the errors found. The exit status is 1 if one is outside. It needs `python -m pip install ngsolve`.

    \b
    Example:
        python -m comparisons bounds --count 3
    """  # noqa: D301
    from comparisons.bounds import report, study

    return Plan([study.declared(count)], report.report)
