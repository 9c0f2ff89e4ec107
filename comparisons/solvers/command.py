"""The command `solvers`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from comparisons.lab.options import ListCommand, json_option, out_option
from comparisons.lab.run_options import RunOptions, study_options

if TYPE_CHECKING:
    from comparisons.lab.reported import Reported

STORE = "results/solvers/solvers.sqlite"
QUICK_STORE = "results/solvers/solvers-quick.sqlite"


@click.command(cls=ListCommand, short_help="Solvers of quadratic and conic programs compared.")
@study_options(STORE, timeout=30.0, memory=4096)
@click.option("--quick", is_flag=True, help=f"Few problems, a minute or two, kept in {QUICK_STORE}.")
@click.option("--only", "only", multiple=True, metavar="NAME…", help="Only these solvers; give another --store too.")
@out_option("results/solvers")
@json_option
def solvers(options: RunOptions, quick: bool, only: tuple[str, ...], out: Path, as_json: bool) -> None:
    """Compare solvers of quadratic and conic programs on frictional contact, judged by the package's certificate.

    The tasks are single inner problems, sequences of them with cold and warm starts, and whole outer loops, in all
    unknowns and condensed, at three accuracies. The meshes are well and badly conditioned. Contacts open or stick, some
    problems have redundant rows, and some have no solution.

    An interrupted study goes on where it stopped. The report is made from the stored rows. Use one worker where times
    matter: several workers slow each other down.

    \b
    Examples:
        python -m comparisons solvers --quick --workers 2
        python -m comparisons solvers --only qp:osqp --store results/osqp.sqlite --out results/osqp
    """  # noqa: D301
    from comparisons.lab.reported import run_and_report
    from comparisons.solvers.report import report_of
    from comparisons.solvers.study import declared

    study = declared(_chosen(only), quick)
    part = "is for all solvers: with --only give --store FILE, --out FOLDER"
    options = options.apart(QUICK_STORE if quick else None, part if only else "")
    found = run_and_report(options, study, report_of, out)
    found.tell({"schema": "qvi-contact/solvers/1", **found.document(**_counted(found))} if as_json else None)


def _chosen(only: Sequence[str]) -> tuple[str, ...]:
    """The solvers to compare; an unknown one, or one that is not installed, is said."""
    from comparisons.solvers.accuracies import TABLE, installed, missing, without_row
    from qvi_contact.errors import InputError
    from solvers.inner.registry import how_to_install

    present = installed()
    for name in only:
        if name not in present:
            known = f"is not installed: {how_to_install(name)}" if name in TABLE else "there is no such solver"
            raise InputError("only", name, f"{known}; choose among {', '.join(present)}")
    for name in () if only else missing():
        click.echo(f"not installed, left out: {name} ({how_to_install(name)})", err=True)
    for name in () if only else without_row():
        click.echo(f"left out: {name} has no row in comparisons/solvers/accuracies.py", err=True)
    return tuple(name for name in present if not only or name in only)


def _counted(found: "Reported") -> dict[str, Any]:
    """Outcomes of every solver, and the tables as text."""
    from comparisons.solvers.measures import OUTCOMES, runs_of, told_by

    return {
        "outcomes": told_by(runs_of(found.stored.rows))[[*OUTCOMES]].to_dict("index"),
        "tables": {
            name: [dict(zip(grid.headings, row, strict=True)) for row in grid.rows]
            for name, grid in found.report.tables.items()
        },
    }
