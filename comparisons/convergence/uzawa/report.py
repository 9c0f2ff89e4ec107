"""The report of the study, from its rows alone."""

from collections.abc import Sequence

from comparisons.convergence.uzawa.figures import figures
from comparisons.convergence.uzawa.measures import FORMS, runs_of, tables_of, values_of
from comparisons.lab.report import Document, environment_grids, render
from comparisons.lab.study import Row


def report(rows: Sequence[Row], quick: bool = False) -> Document:
    """The report; the same rows give the same report."""
    runs = runs_of(rows)
    return render(
        "comparisons.convergence.uzawa", "convergence-uzawa-quick" if quick else "convergence-uzawa",
        {"quick": quick, **values_of(runs)}, tables_of(runs), figures(runs), environment_grids(rows), forms=FORMS,
    )  # fmt: skip
