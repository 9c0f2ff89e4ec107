"""The command `solvers`."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from comparisons.lab.options import ListCommand, folder_option
from comparisons.lab.study.options import RunOptions, study_options

STORE = "results/solvers/solvers.sqlite"
QUICK_STORE = "results/solvers/solvers-quick.sqlite"


@click.command(cls=ListCommand, short_help="Solvers of quadratic and conic programs compared.")
@study_options(STORE, timeout=30.0, memory=4096)
@click.option("--quick", is_flag=True, help=f"Few problems, a minute or two, kept in {QUICK_STORE}.")
@click.option("--only", "only", multiple=True, metavar="NAME…", help="Only these solvers; give another --store too.")
@click.option("--out", metavar="FOLDER", default="results/solvers", show_default=True, callback=folder_option,
              help="Folder for the report.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document instead of the tables.")
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
        python -m comparisons solvers --only qp:osqp direct:osqp --store results/osqp.sqlite --out results/osqp
    """  # noqa: D301
    from comparisons.lab.report import show, write_report
    from comparisons.lab.study import read_study, write_csv
    from comparisons.solvers.report import report_of
    from comparisons.solvers.study import declared
    from qvi_contact.basics.writing import writable_folder

    study = declared(_chosen(only), quick)
    options = _with_store(options, quick, bool(only))
    folder = writable_folder(out)
    options.run(study)
    stored = read_study(options.store)
    report = report_of(stored)
    written = [*write_report(report, folder), folder / f"{report.name}.csv.gz"]
    write_csv(written[-1], stored.rows)
    if as_json:
        click.echo(json.dumps(_document(stored, report, written), indent=1, ensure_ascii=False))
    else:
        show(report, written)


def _with_store(options: RunOptions, quick: bool, some: bool) -> RunOptions:
    """The store of a quick study is another one, and that of some solvers alone has to be named."""
    from qvi_contact.errors import InputError

    if click.get_current_context().get_parameter_source("store") is not ParameterSource.DEFAULT:
        return options
    if some:
        raise InputError("store", str(options.store), "is for all solvers: with --only give --store FILE, --out FOLDER")
    return replace(options, store=Path(QUICK_STORE)) if quick else options


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


def _document(stored: Any, report: Any, written: Sequence[Path]) -> dict[str, Any]:
    """Declaration, findings, outcomes of every solver, tables as text."""
    from comparisons.lab.report import findings_of
    from comparisons.solvers.measures import outcome_counts, runs_of
    from comparisons.solvers.tables import tables_of

    return {
        "schema": "qvi-contact/solvers/1",
        "study": stored.declaration,
        "findings": findings_of(report.text),
        "outcomes": {solver: dict(counts) for solver, counts in outcome_counts(runs_of(stored.rows)).items()},
        "tables": {
            name: [dict(zip(grid.headings, row, strict=True)) for row in grid.rows]
            for name, grid in tables_of(stored).items()
        },
        "files": [str(path) for path in written],
    }
