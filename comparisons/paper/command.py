"""The command `paper`."""

from pathlib import Path

import click

from comparisons.lab.commands import folder_option
from qvi_contact.basics.terminal import Command


@click.command(cls=Command, short_help="The paper's Table 1 and Figures 2-5, and the solution.")
@click.option("--out", metavar="FOLDER", default="results/paper", callback=folder_option, show_default=True,
              help="Folder for the report, its pictures, and tables as CSV.")  # fmt: skip
def paper(out: Path) -> None:
    """Recompute Table 1 and Figures 2-5 of Więckowski (1992), and compare them with the converged solution.

    The seven problems are solved by the paper's Uzawa iteration, for its 30 iterations and to convergence, by the fixed
    point with quadratic and with second-order cone programs, and by every installed solver.
    """
    from comparisons.lab.studies import progress
    from comparisons.paper import study
    from qvi_contact.basics.writing import writable_folder

    folder = writable_folder(out, "--out")
    with progress("paper", study.step_count()) as advance:
        result = study.run(advance)
    made, written = study.write(result, folder)
    made.show(written)
