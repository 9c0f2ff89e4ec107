"""The report of the study, from its rows alone."""

from collections.abc import Sequence

from comparisons.convergence.sequences.measures import runs_of, table_of, values_of
from comparisons.lab.report import Document, environment_grids, render
from comparisons.lab.study import Row


def report(rows: Sequence[Row], quick: bool = False) -> Document:
    """The report; the same rows give the same report."""
    runs = runs_of(rows)
    return render(
        "comparisons.convergence.sequences", "convergence-sequences-quick" if quick else "convergence-sequences",
        {"quick": quick, **values_of(runs)}, {"runs": table_of(runs)}, {}, environment_grids(rows),
    )  # fmt: skip
