"""The report of the study, from its rows alone."""

from collections.abc import Sequence

from comparisons.convergence.uzawa.figures import figures
from comparisons.convergence.uzawa.measures import runs_of, settings_of, tables_of, values_of
from comparisons.convergence.uzawa.study import HALF, MOST
from comparisons.convergence.uzawa.task import ITERATIONS, LONG, NEAR, SEARCHED, STILL
from comparisons.lab.report import Document, environment_grids, render
from comparisons.lab.study import Row


def report(rows: Sequence[Row], quick: bool = False) -> Document:
    """The report; the same rows give the same report."""
    runs = runs_of(rows)
    name = "convergence-uzawa-quick" if quick else "convergence-uzawa"
    limits = {"quick": quick, "steps": ITERATIONS, "long": LONG, "searched": SEARCHED}
    settings = settings_of({
        "iterations of a run of the map, and of the search for limits": f"{ITERATIONS}",
        "iterations on finer meshes": f"{LONG}", "iterations at equal accuracy, at most": f"{MOST}",
        "a run settles if": f"error of the force ≤ {NEAR:g} and change of multipliers ≤ {STILL:g}, last quarter",
        "steps where steps are not varied": f"{HALF:g} of their limits",
    })  # fmt: skip
    return render(
        "comparisons.convergence.uzawa", name, {**values_of(runs), **limits}, tables_of(runs), figures(runs),
        [settings, *environment_grids(rows)],
    )  # fmt: skip
