"""The report of the study, from its rows alone."""

from collections.abc import Sequence
from typing import Final

from comparisons.convergence.outer import tables
from comparisons.convergence.outer.entries import Entries
from comparisons.convergence.outer.figures import figures
from comparisons.convergence.outer.findings import findings
from comparisons.convergence.outer.loops import INNER, LOOPS, MAX_ITERATIONS, PATIENCE, TOLERANCE
from comparisons.lab.report.environment import environment_grids
from comparisons.lab.report.old import Report, Section
from comparisons.lab.study import Row
from comparisons.lab.tables import Grid

_INTRODUCTION: Final = (
    "The fixed point on the friction bound, s ← |σ_N(s)|, each step a convex problem: plain, with damping "
    "s + θ (|σ_N(s)| − s), and with Anderson acceleration, beside the condensed method, which solves the inequality "
    "directly. On 8 contacts with a contraction known by hand, the paper's plate, a dragged block and SSNV128, for "
    "friction up to where loops fail, by `python -m comparisons convergence outer`."
)

_LIMITATIONS: Final = (
    "All loops use one inner solver, Clarabel, at its own accuracy; another one changes the times, hardly the "
    "iterations.",
    "A loop starts from the bonded state; whether it converges, and to which solution, may depend on the start.",
    "The contraction of Anderson's loop is that of its residuals, not of a map; its interval is wide where few "
    "iterations are needed.",
    "The linearisation needs a solution, which the condensed method provides; where contact rows depend on each other "
    "the slipping points are those of its multipliers, of which there are many.",
    "The law is tested at points here, and the bounds μγ and μ√κ are proved for independent rows only; on meshes they "
    "are indicators.",
    "Times depend on the machine and on what else it does; they are compared as ratios of medians.",
)


def report(rows: Sequence[Row]) -> Report:
    """The report; the same rows give the same report."""
    entries = Entries.of(rows)
    drawn = figures(entries)
    several = (tables.solutions_table(entries),) if entries.several else ()
    sections = [
        Section(
            "Contraction",
            ("How fast the residual falls, beside what theory foresees.",),
            (drawn["rates"], tables.contraction_table(entries), drawn["mesh"], tables.mesh_table(entries)),
        ),
        Section(
            "Iterations and time",
            ("Work to the same certified accuracy.",),
            (drawn["iterations"], drawn["times"], drawn["histories"], tables.runs_table(entries)),
        ),
        *(
            [Section("Several solutions", ("For large friction the answer is one of several.",), several)]
            if several
            else []
        ),
    ]
    return Report(
        "convergence-outer", "Convergence of the outer loop", _INTRODUCTION, findings(entries), sections,
        [_settings(), *environment_grids(rows)], _LIMITATIONS,
    )  # fmt: skip


def _settings() -> Grid:
    """Settings of all loops."""
    loops = [
        (name, ", ".join(f"{key} = {value}" for key, value in look.options().items())) for name, look in LOOPS.items()
    ]
    return Grid(
        "Loops", ("loop", "options"),
        [*loops, ("all", f"{INNER}, tolerance {TOLERANCE:g}, {MAX_ITERATIONS} iterations, of them {PATIENCE} idle")],
    )  # fmt: skip
