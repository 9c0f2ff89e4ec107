"""The report of the study, from its rows alone."""

from collections.abc import Sequence
from typing import Final

from comparisons.convergence.uzawa import tables, task
from comparisons.convergence.uzawa.entries import Entries
from comparisons.convergence.uzawa.figures import figures
from comparisons.convergence.uzawa.findings import condition_growth, findings
from comparisons.convergence.uzawa.methods import METHODS, MOST
from comparisons.convergence.uzawa.study import HALF
from comparisons.lab.report.environment import environment_grids
from comparisons.lab.report.old import Report, Section
from comparisons.lab.study import Row
from comparisons.lab.tables import Grid
from comparisons.paper.reference import load

_INTRODUCTION: Final = (
    "The iteration (4.1)-(4.4) of Więckowski (1992) with the accumulating rule, by which Table 1 can be reproduced: "
    "the paper's own run, the steps ω_T and ω_N that it bears, its iterations on finer meshes, and the same accuracy "
    "by the convex reformulation (a fixed point over quadratic or cone programs) and by the condensed method, by "
    "`python -m comparisons convergence uzawa`."
)

_LIMITATIONS: Final = (
    "Steps are constant over all points and iterations, as in the paper, but for the runs with a shrinking step; "
    "steps of their own for each point would converge faster.",
    "Whether a run settles is judged after a given number of iterations: a run that would diverge later, or come to "
    "rest later, is taken for what it looks like then. Observed limits are known to the width of the last bisection.",
    "Limits of theory need the solution: bounds and slipping points are those of the condensed method there. Where "
    "contact rows depend on each other, multipliers, and with them the slipping points, are not unique.",
    "Iterations count until the resultant force is near for good; tractions take longer.",
    "Times are those of this implementation, which factorises K once and keeps the compliance of the contact dense; "
    "they depend on the machine.",
)


def report(rows: Sequence[Row]) -> Report:
    """The report; the same rows give the same report."""
    entries = Entries.of(rows)
    drawn, growth = figures(entries), condition_growth(entries)
    sections = [
        Section(
            "The paper's run",
            (f"{load().iterations} iterations on {load().cells}² cells with ω_T = {load().omega_T:g}, and beyond.",),
            (drawn["history"], tables.paper_table(entries)),
        ),
        Section(
            "Which steps are stable",
            (
                "On slipping points (4.3) and (4.4) are gradient steps of length ω_T/θ, θ the friction bound, for the "
                "dual operator; (4.2) is one of length ω_N on open points. Gradient steps converge below 2 / λ_max.",
            ),
            (drawn["map-plate"], drawn["map-open"], drawn["limits"], tables.limits_table(entries)),
        ),
        Section("Finer meshes", (growth,) if growth else (), (drawn["mesh"], tables.mesh_table(entries))),
        Section("Equal accuracy",
                (f"What other methods take to the accuracy that the certificate confirms. Uzawa has {HALF:g} of its "
                 "limits as steps, which need no search; the maps show what the best step saves.",),
                (drawn["work"], tables.accuracy_table(entries))),
    ]  # fmt: skip
    return Report(
        "convergence-uzawa", "The iteration of Uzawa", _INTRODUCTION, findings(entries), sections,
        [_settings(), *environment_grids(rows)], _LIMITATIONS,
    )  # fmt: skip


def _settings() -> Grid:
    """Settings of all runs."""
    methods = [
        (name, ", ".join(f"{key} = {value}" for key, value in look.options.items())) for name, look in METHODS.items()
    ]
    lines = [
        ("iterations of a run of the map, and of the search for limits", f"{task.ITERATIONS}"),
        ("iterations on finer meshes", f"{task.LONG}"),
        ("iterations at equal accuracy, at most", f"{MOST}"),
        (
            "a run settles if",
            f"error of the force ≤ {task.NEAR:g} and change of multipliers ≤ {task.STILL:g}, last quarter",
        ),
        ("steps where steps are not varied", f"{HALF:g} of their limits"),
        *methods,
    ]
    return Grid("Runs and methods", ("setting", "value"), lines)
