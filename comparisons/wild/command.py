"""The commands `wild`, `estimates` and `limits`."""

import click

from comparisons.lab.commands import COUNT, Plan, experiment


@experiment(timeout=120.0, memory=4096, short_help="Generated problems: what becomes of each.")
@click.option("--each", type=COUNT, metavar="NUMBER", default=20, show_default=True, help="Problems of each family.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True,
              help="Number of the first one; each number makes another problem, always the same.")  # fmt: skip
@click.option("--only", multiple=True, metavar="FAMILY…", help="Only these families.")
def wild(each: int, seed: int, only: tuple[str, ...]) -> Plan:
    """Solve generated problems as unusual as users may state them, and check what becomes of each.

    They have thin bodies, odd units, large friction, polygons, arcs, holes, joints, several bodies, meshes from files,
    distant gaps, every contact law, plates with moments, or no load at all. Every answer that is
    called solved is checked again from its stresses and the data alone. The exit status is 1 if such an answer is
    wrong, if an exception is not one of the package's own, or if a problem takes more than --timeout or --memory.

    \b
    Examples:
        python -m comparisons wild --each 5
        python -m comparisons wild --each 50 --seed 1000 --only gaps idle --timeout 60 --out results/gaps
    """  # noqa: D301
    from comparisons.wild import study

    return Plan([study.declared(only, each, seed)], study.report)


@experiment(timeout=300.0, short_help="How often the error that refine estimates is that of its answer.")
@click.option("--count", type=COUNT, metavar="NUMBER", default=200, show_default=True, help="Problems.")
def estimates(count: int) -> Plan:
    """Refine generated problems on triangles to a target, and compare each answer with a much finer reference.

    The report says how often the answer is as accurate as its estimated error says, and how far the two are apart.

    \b
    Example:
        python -m comparisons estimates --count 6
    """  # noqa: D301
    from comparisons.wild import estimates as study

    return Plan([study.declared(count)], study.report)


@experiment(timeout=300.0, short_help="Whether both sides of limit loads, and their proofs, are in order.")
@click.option("--count", type=COUNT, metavar="NUMBER", default=200, show_default=True, help="Problems.")
def limits(count: int) -> Plan:
    """Bound the limit loads of generated bodies that yield, with contacts, from both sides, and prove both.

    The report says whether the sides are in order, and whether the proofs hold in exact arithmetic.

    \b
    Example:
        python -m comparisons limits --count 6
    """  # noqa: D301
    from comparisons.wild import limits as study

    return Plan([study.declared(count)], study.report)
