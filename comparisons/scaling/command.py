"""The command `scaling`."""

from pathlib import Path

import click

from comparisons.lab.options import COUNT, ListCommand, json_option, out_option
from comparisons.lab.study.options import RunOptions, study_options

STORE = "results/scaling/scaling.sqlite"
QUICK_STORE = "results/scaling/scaling-quick.sqlite"


@click.command(cls=ListCommand, short_help="How a long sweep gets faster with processes.")
@study_options(STORE, timeout=3600.0)
@click.option("--quick", is_flag=True, help=f"A coarse mesh and few values, kept in {QUICK_STORE}.")
@click.option(
    "--processes",
    multiple=True,
    type=COUNT,
    metavar="NUMBER…",
    help="Processes that share a sweep; give another --store too.  [default: 1 2]",
)
@out_option("results/scaling")
@json_option
def scaling(options: RunOptions, quick: bool, processes: tuple[int, ...], out: Path, as_json: bool) -> None:
    """Measure how much sooner a long sweep is done if several processes share it.

    A sweep over friction is written to a store by `qvi_contact.solve_sweep`, with each number of processes. Keep
    --workers at 1, so that nothing else runs beside it.

    \b
    Examples:
        python -m comparisons scaling
        python -m comparisons scaling --processes 1 4 16 --store results/node.sqlite --out results/node
    """  # noqa: D301
    from comparisons.lab.reported import run_and_report
    from comparisons.scaling.report import report
    from comparisons.scaling.study import declared

    part = "is for the usual numbers of processes: with --processes give --store FILE, --out FOLDER"
    options = options.apart(QUICK_STORE if quick else None, part if processes else "")
    found = run_and_report(options, declared(processes, quick), lambda stored: report(stored.rows, quick), out)
    rows = [row.flat() for row in found.stored.rows]
    found.tell({"schema": "qvi-contact/scaling/1", **found.document(rows=rows)} if as_json else None)
