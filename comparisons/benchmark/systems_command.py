"""The command `systems`."""

from typing import TYPE_CHECKING

import click

from comparisons.lab.options import COUNT, ListCommand, json_option

if TYPE_CHECKING:
    from comparisons.benchmark.systems import Pair

_HEADER = ("problem", "unknowns", "contact", "counted", "dense", "sparse", "quotient")


@click.command(cls=ListCommand, short_help="Where dense linear systems stop to pay.")
@click.option("--only", multiple=True, metavar="WORD…", help="Only problems whose names contain one of these words.")
@click.option("--repeat", type=COUNT, default=3, show_default=True, help="Repetitions of each solve.")
@json_option
def systems(only: tuple[str, ...], repeat: int, as_json: bool) -> None:
    """Solve plates and walls by dense and by sparse linear systems, and compare the times.

    The factor at the end is the one that the cost model of the condensed method takes for sparse operations beside
    dense ones: dense systems are chosen up to that quotient of the counts. Times are CPU seconds on one thread, the
    least of the repetitions; nothing else needs to be idle, but a quiet machine gives steadier quotients.

    \b
    Examples:
        python -m comparisons systems
        python -m comparisons systems --only wall masonry --repeat 5
    """  # noqa: D301
    from dataclasses import asdict

    from comparisons.benchmark.systems import PROBLEMS, crossover, measured
    from comparisons.lab.reported import print_json
    from qvi_contact.errors import InputError
    from solvers.factorisation.threads import limited_blas

    names = [name for name in PROBLEMS if not only or any(word in name for word in only)]
    if not names:
        raise InputError("only", ", ".join(only), f"give a part of one of these names: {', '.join(PROBLEMS)}")
    pairs: list[Pair] = []
    with limited_blas(1):
        if not as_json:
            click.echo(f"{_HEADER[0]:<18}" + "".join(f"{word:>10}" for word in _HEADER[1:]))
        for pair in measured(names, repeat):
            pairs.append(pair)
            if not as_json:
                click.echo(_line(pair))
    factor = crossover(pairs)
    if as_json:
        document = {"schema": "qvi-contact/systems/1", "pairs": [asdict(pair) for pair in pairs], "factor": factor}
        print_json(document)
    else:
        click.echo(f"dense systems pay up to the quotient {factor:.2f} of the counted operations")


def _line(pair: "Pair") -> str:
    times = (pair.counted, pair.dense, pair.sparse, pair.dense / pair.sparse)
    return f"{pair.name:<18}{pair.unknowns:>10}{pair.interface:>10}" + "".join(f"{value:>10.3f}" for value in times)
