"""The report of the study, from its rows alone."""

from collections.abc import Sequence

from comparisons.convergence.uzawa.figures import figures
from comparisons.convergence.uzawa.measures import runs_of, tables_of, values_of
from comparisons.convergence.uzawa.study import HALF, METHODS, MOST
from comparisons.convergence.uzawa.task import ITERATIONS, LONG, NEAR, SEARCHED, STILL
from comparisons.lab.report import Document, environment_grids, render
from comparisons.lab.study import Row
from comparisons.lab.tables import Grid


def report(rows: Sequence[Row], quick: bool = False) -> Document:
    """The report; the same rows give the same report."""
    runs = runs_of(rows)
    values = {**values_of(runs), "quick": quick, "steps": ITERATIONS, "long": LONG, "searched": SEARCHED}
    return render(
        "comparisons.convergence.uzawa", "convergence-uzawa-quick" if quick else "convergence-uzawa", values,
        tables_of(runs), figures(runs), [_settings(), *environment_grids(rows)],
    )  # fmt: skip


def _settings() -> Grid:
    """Settings of all runs, and the options of the methods."""
    rows = [
        ("iterations of a run of the map, and of the search for limits", f"{ITERATIONS}"),
        ("iterations on finer meshes", f"{LONG}"), ("iterations at equal accuracy, at most", f"{MOST}"),
        ("a run settles if", f"error of the force ≤ {NEAR:g} and change of multipliers ≤ {STILL:g}, last quarter"),
        ("steps where steps are not varied", f"{HALF:g} of their limits"),
        *((name, ", ".join(f"{key} = {value}" for key, value in one.options.items())) for name, one in METHODS.items()),
    ]  # fmt: skip
    return Grid("Runs and methods", ("setting", "value"), rows)
