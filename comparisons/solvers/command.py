"""The command `solvers`."""

import click

from comparisons.lab.commands import Plan, experiment


@experiment(timeout=30.0, memory=4096, short_help="Solvers of quadratic and conic programs compared.")
@click.option("--quick", is_flag=True, help="Few problems, a minute or two.")
@click.option("--only", multiple=True, metavar="NAME…", help="Only these solvers.")
def solvers(quick: bool, only: tuple[str, ...]) -> Plan:
    """Compare solvers of quadratic and conic programs on frictional contact, judged by the package's certificate.

    The tasks are single inner problems, sequences of them with cold and warm starts, and whole outer loops, in all
    unknowns and condensed, at three accuracies. The meshes are well and badly conditioned. Contacts open or stick, some
    problems have redundant rows, and some have no solution.

    An interrupted study goes on where it stopped. Use one worker where times matter: several workers slow each other
    down.

    \b
    Examples:
        python -m comparisons solvers --quick --workers 2
        python -m comparisons solvers --only qp:osqp --out results/osqp
    """  # noqa: D301
    from comparisons.solvers import report, study
    from comparisons.solvers.accuracies import TABLE, installed
    from qvi_contact.errors import InputError
    from solvers.inner.registry import available, how_to_install

    present = installed()
    for name in only:
        if name not in present:
            known = f"is not installed: {how_to_install(name)}" if name in TABLE else "there is no such solver"
            raise InputError("only", name, f"{known}; choose among {', '.join(present)}")
    if not only:
        for name in (each for each in TABLE if each not in present):
            click.echo(f"not installed, left out: {name} ({how_to_install(name)})", err=True)
        for name in (each for each in available() if each not in TABLE):
            click.echo(f"left out: {name} has no row in comparisons/solvers/accuracies.py", err=True)
    return Plan([study.declared([name for name in present if not only or name in only], quick)], report.report)
