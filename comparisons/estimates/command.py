"""The command `estimates`."""

from pathlib import Path

import click

from comparisons.lab.options import COUNT, ListCommand, json_option, out_option
from comparisons.lab.study.options import RunOptions, study_options

STORE = "results/estimates/estimates.sqlite"
QUICK_STORE = "results/estimates/estimates-quick.sqlite"


@click.command(cls=ListCommand, short_help="How often the error that refine estimates is that of its answer.")
@study_options(STORE, timeout=300.0)
@click.option("--quick", is_flag=True, help=f"Six problems, kept in {QUICK_STORE}.")
@click.option("--count", type=COUNT, metavar="NUMBER", help="Problems; give another --store too.  [default: 200]")
@out_option("results/estimates")
@json_option
def estimates(options: RunOptions, quick: bool, count: int | None, out: Path, as_json: bool) -> None:
    """Refine generated problems on triangles to a target, and compare each answer with a much finer reference.

    The report says how often the answer is as accurate as its estimated error says, and how far the two are apart.

    \b
    Examples:
        python -m comparisons estimates --quick
        python -m comparisons estimates --count 1000 --store results/many.sqlite --out results/many
    """  # noqa: D301
    from comparisons.estimates.measures import runs_of, values_of
    from comparisons.estimates.report import report
    from comparisons.estimates.study import EACH, QUICK, declared
    from comparisons.lab.reported import run_and_report

    part = "is for the usual number of problems: with --count give --store FILE, --out FOLDER"
    options = options.apart(QUICK_STORE if quick else None, part if count is not None else "")
    study = declared(count or (QUICK if quick else EACH))
    found = run_and_report(options, study, lambda stored: report(stored.rows), out)
    values = values_of(runs_of(found.stored.rows))
    found.tell({"schema": "qvi-contact/estimates/1", **found.document(values=values)} if as_json else None)
