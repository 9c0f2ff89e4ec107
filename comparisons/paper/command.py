"""The command `paper`."""

import json
from pathlib import Path

import click

from comparisons.lab.options import folder_option, json_option
from qvi_contact.basics.terminal import Command


@click.command(cls=Command, short_help="The paper's Table 1 and Figures 2-5, and the solution.")
@click.option(
    "--out",
    metavar="FOLDER",
    callback=folder_option,
    help="Folder for the report, its pictures, and tables as CSV.  [default: results/paper]",
)
@json_option
def paper(out: Path | None, as_json: bool) -> None:
    """Recompute Table 1 and Figures 2-5 of Więckowski (1992), and compare them with the converged solution.

    The seven problems are solved by the paper's Uzawa iteration, for its 30 iterations and to convergence, by the fixed
    point with quadratic and with second-order cone programs, and by every installed solver. With --json files are
    written only if --out is given.
    """
    from comparisons.lab.progress import progress
    from comparisons.lab.report import show
    from comparisons.paper import report, study
    from qvi_contact.basics.writing import writable_folder

    folder = None
    if out is not None or not as_json:
        folder = writable_folder(out or Path("results") / "paper")
    with progress("paper", study.step_count()) as advance:
        result = study.run(advance)
    made, written = report.write(result, folder) if folder else (None, [])
    if as_json:
        click.echo(json.dumps(report.as_document(result), indent=2, allow_nan=False))
    if made and not as_json:
        show(made, written)
