"""The command `wild`."""

import json
from dataclasses import replace
from pathlib import Path

import click
from click.core import ParameterSource

from comparisons.lab.options import ListCommand, folder_option
from comparisons.lab.study.options import RunOptions, study_options

STORE = "results/wild/wild.sqlite"
QUICK_STORE = "results/wild/wild-quick.sqlite"


@click.command(cls=ListCommand, short_help="Generated problems: what becomes of each.")
@study_options(STORE, timeout=120.0, memory=4096)
@click.option("--quick", is_flag=True, help=f"Five problems of each family, kept in {QUICK_STORE}.")
@click.option("--each", type=click.IntRange(1), metavar="NUMBER", help="Problems of each family.  [default: 250]")
@click.option("--only", multiple=True, metavar="FAMILY…", help="Only these families; give another --store too.")
@click.option("--out", metavar="FOLDER", default="results/wild", show_default=True, callback=folder_option,
              help="Folder for the report.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document instead of the tables.")
def wild(options: RunOptions, quick: bool, each: int | None, only: tuple[str, ...], out: Path, as_json: bool) -> int:
    """Solve generated problems as unusual as users may state them, and check what becomes of each.

    They have thin bodies, odd units, large friction, bodies with cells left out, joints, distant gaps, every contact
    law, plates with moments, no load at all, or contradictory data. Every answer that is called solved is checked again
    from its stresses and the data alone. The exit status is 1 if such an answer is wrong, if an exception is not one of
    the package's own, or if contradictory data are accepted.

    \b
    Examples:
        python -m comparisons wild --quick
        python -m comparisons wild --each 50 --only gaps idle --store results/gaps.sqlite --out results/gaps
    """  # noqa: D301
    from comparisons.lab.report import findings_of, show, write_report
    from comparisons.lab.study import read_study, write_csv
    from comparisons.wild.measures import counts_of, problems_of
    from comparisons.wild.report import report
    from comparisons.wild.study import EACH, QUICK, declared
    from qvi_contact.basics.writing import writable_folder

    study = declared(only, each or (QUICK if quick else EACH))
    folder = writable_folder(out)
    options = _with_store(options, quick, bool(only) or each is not None)
    options.run(study)
    stored = read_study(options.store)
    made = report(stored.rows)
    written = [*write_report(made, folder), folder / f"{made.name}.csv.gz"]
    write_csv(written[-1], stored.rows)
    problems = problems_of(stored.rows)
    if as_json:
        document = {
            "schema": "qvi-contact/wild/1",
            "study": stored.declaration,
            "outcomes": counts_of(problems),
            "findings": findings_of(made.text),
            "files": [str(path) for path in written],
        }
        click.echo(json.dumps(document, indent=1, ensure_ascii=False))
    else:
        show(made, written)
    return 1 if problems.trouble.any() else 0


def _with_store(options: RunOptions, quick: bool, some: bool) -> RunOptions:
    """The store of a quick study is another one, and that of another choice of problems has to be named."""
    from qvi_contact.errors import InputError

    if click.get_current_context().get_parameter_source("store") is not ParameterSource.DEFAULT:
        return options
    if some:
        remedy = "is for all problems: with --only or --each give --store FILE, --out FOLDER"
        raise InputError("store", str(options.store), remedy)
    return replace(options, store=Path(QUICK_STORE)) if quick else options
