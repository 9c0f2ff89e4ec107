"""The report of the study, from its rows alone."""

from collections.abc import Sequence

from comparisons.convergence.outer.figures import figures
from comparisons.convergence.outer.measures import runs_of, tables_of, values_of
from comparisons.convergence.outer.study import INNER, LOOPS, MAX_ITERATIONS, PATIENCE, TOLERANCE
from comparisons.lab.report import Document, environment_grids, render
from comparisons.lab.study import Row
from comparisons.lab.tables import Grid


def report(rows: Sequence[Row], quick: bool = False) -> Document:
    """The report; the same rows give the same report."""
    runs = runs_of(rows)
    return render(
        "comparisons.convergence.outer", "convergence-outer-quick" if quick else "convergence-outer",
        {"quick": quick, **values_of(runs)}, tables_of(runs), figures(runs), [_settings(), *environment_grids(rows)],
    )  # fmt: skip


def _settings() -> Grid:
    """Settings of all loops."""
    loops = [
        (name, ", ".join(f"{key} = {value}" for key, value in look.options().items())) for name, look in LOOPS.items()
    ]
    both = ("all", f"{INNER}, tolerance {TOLERANCE:g}, {MAX_ITERATIONS} iterations, of them {PATIENCE} idle")
    return Grid("Loops", ("loop", "options"), [*loops, both])
