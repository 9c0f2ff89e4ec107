"""Commands of ``python -m comparisons``."""

import json
from pathlib import Path

import click


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
def group() -> None:
    """Experiments that compare methods, solvers and published numbers."""


def _folder(context: click.Context, parameter: click.Parameter, value: str | None) -> Path | None:  # noqa: ARG001
    """A folder's name; an empty one, as from an unset shell variable, is not the current folder."""
    if value == "":
        raise click.BadParameter("give the name of a folder")
    return None if value is None else Path(value)


@group.command()
@click.option(
    "--out",
    metavar="FOLDER",
    callback=_folder,
    help="Folder for the report: tables as CSV, pictures as PNG and SVG.  [default: results/paper]",
)
@click.option("--json", "as_json", is_flag=True, help="One JSON document on standard output instead of the tables.")
def paper(out: Path | None, as_json: bool) -> None:
    """Więckowski's plate: Table 1 and Figures 2-5 beside the converged solution.

    Runs the paper's Uzawa iteration for its 30 iterations and to convergence, the fixed point with quadratic and with
    second-order cone programs, and every installed back end on the same seven problems. With --json files are
    written only if --out is given.
    """
    from comparisons.paper import report, study
    from qvi_contact.files import writable_folder
    from qvi_contact.terminal import progress

    folder = None
    if out is not None or not as_json:
        folder = writable_folder(out or Path("results") / "paper")
    with progress("paper", study.step_count() + (len(report.FILES) if folder else 0)) as advance:
        result = study.run(advance)
        written = report.write(result, folder, advance) if folder else []
    if as_json:
        click.echo(json.dumps(report.as_document(result), indent=2, allow_nan=False))
    else:
        report.show(result, written)
