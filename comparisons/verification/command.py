"""The command `verify`."""

from pathlib import Path

import click

from comparisons.lab.commands import ListCommand, folder_option


@click.command(cls=ListCommand)
@click.option("--out", metavar="FOLDER", callback=folder_option, help="Folder for Markdown, HTML page and picture.")
@click.option("--json", "as_json", is_flag=True, help="One JSON document on standard output instead of the summary.")
@click.option("--only", metavar="NAME…", multiple=True, help="Chapters or problems to run, such as ssnv128.")
@click.option("--quick", is_flag=True, help="Coarse meshes and few cases of every problem.")
@click.option("-v", "--verbose", is_flag=True, help="The table of the chapters too.")
def verify(out: Path | None, as_json: bool, only: tuple[str, ...], quick: bool, verbose: bool) -> int:
    """The verification manual: problems whose answer is known otherwise, row by row.

    Closed forms, equilibrium, printed numbers, other codes, and methods against each other. The exit status is 0 if
    every row passed, 1 if not.

    \b
    Examples:
        python -m comparisons verify --out comparisons/reports/verification
        python -m comparisons verify --only ssnv128 limits --quick
    """  # noqa: D301
    from comparisons.lab.studies import progress
    from comparisons.verification import report as manual
    from qvi_contact.basics.writing import writable_folder

    chapters = manual.choose(only)
    folder = None if out is None else writable_folder(out, "--out")
    # drawn first, so that a picture that fails costs no rows
    drawings = manual.drawings([name for problems in chapters.values() for name in problems]) if folder else {}
    with progress("verify", sum(map(len, chapters.values()))) as advance:
        document = manual.run(chapters, quick, advance, only)
    if as_json:
        click.echo(manual.as_json(document))
    if folder or not as_json:
        report = manual.report(document, drawings)
        written = report.write(folder) if folder else []
        if not as_json:
            report.show(written, tables=verbose)
    return 0 if document["passed"] else 1
