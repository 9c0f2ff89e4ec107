"""Convergence of loops over the friction bound: problems × meshes × μ × loops; the study and its report."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Final

from pandas import DataFrame

from comparisons.convergence.bodies import PLACE, ending, in_words, timed
from comparisons.lab.numbers import count, fixed, scientific, seconds, significant
from comparisons.lab.reports import Form, Report, render
from comparisons.lab.studies import Row, Study, frame_of, largest_of
from solvers.certificate.uniqueness import uniqueness_bound

INNER: Final = "direct:clarabel"
"""Inner solver of all loops."""

TOLERANCE: Final = 1e-8
"""Tolerance of residual and certificate."""

MAX_ITERATIONS: Final = 200

PATIENCE: Final = 60
"""Iterations without progress after which a loop stops; many, so that slow convergence does not count as failure."""

_SHARED: Final = {"method": "fixed-point", "inner": INNER, "tolerance": TOLERANCE}
_LIMITS: Final = {"max_iterations": MAX_ITERATIONS, "patience": PATIENCE}
_DAMPED: Final = {f"damped {step:g}": ("damped", step) for step in (0.75, 0.5, 0.25)}

PLAIN: Final = "plain"
CONDENSED: Final = "condensed"

LOOPS: Final[Mapping[str, Mapping[str, Any]]] = {
    **{name: {**_SHARED, "variant": variant, "damping": step, **_LIMITS}
       for name, (variant, step) in {PLAIN: ("plain", 1.0), **_DAMPED, "Anderson": ("anderson", 0.5)}.items()},
    CONDENSED: {"method": "condensed", "tolerance": TOLERANCE},
}  # fmt: skip
"""Loops, and the condensed method, in the order of tables → keyword arguments of `solve_qvi`."""

Meshes = Mapping[tuple[str, int], tuple[float, ...]]

FULL: Final[Meshes] = {
    ("contacts", 0): (0.25, 0.5, 1.0, 1.1, 1.2, 1.3, 1.5, 2.0, 3.0, 4.0),
    ("plate", 4): (0.05, 0.1, 0.15, 0.2, 0.25),
    ("plate", 8): (0.05, 0.1, 0.15, 0.2, 0.25),
    ("plate", 16): (0.05, 0.1, 0.15, 0.2, 0.25),
    ("plate", 32): (0.1, 0.2),
    ("block", 4): (0.12, 0.15, 0.2, 0.3),
    ("block", 8): (0.105, 0.11, 0.12, 0.15, 0.2, 0.3),
    ("block", 16): (0.12, 0.2),
    ("ssnv128", 4): (0.3, 0.5, 1.0),
    ("ssnv128", 8): (0.3, 0.5, 1.0, 2.0),
    ("ssnv128", 16): (0.1, 0.3, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0),
    ("ssnv128", 24): (0.3, 0.5, 1.0),
}
"""(Problem, cells a side) → μ."""

QUICK: Final[Meshes] = {
    ("contacts", 0): (0.5, 1.0, 2.0), ("plate", 4): (0.1,), ("plate", 8): (0.1,), ("ssnv128", 8): (0.3, 1.0, 4.0),
}  # fmt: skip


def study(quick: bool) -> Study:
    """The study, or a few coarse meshes of it."""
    cases = [
        {"problem": problem, "cells": cells, "friction": friction, "loop": loop}
        for (problem, cells), frictions in (QUICK if quick else FULL).items()
        for friction in frictions
        for loop in LOOPS
    ]
    return Study("convergence-outer", 3, "comparisons.convergence.outer:run", cases)


def run(case: Mapping[str, Any]) -> dict[str, Any]:
    """Task of the study: solve a problem by a loop; entries of `bodies.ending`, and more.

    "seconds" are wall times of repeated solves, factorisation included. The plain loop has "sharper", 1/γ of
    `solvers.certificate`, None if it was not computed.
    """
    solution, seconds = timed((case["problem"], case["cells"], case["friction"]), **LOOPS[case["loop"]])
    return {
        **ending(solution), "seconds": seconds,
        **({"sharper": uniqueness_bound(solution.problem).bound} if case["loop"] == PLAIN else {}),
    }  # fmt: skip


FORMS: Final[Mapping[str, Form]] = {
    "friction": fixed("g"), "steps": count, "seconds": seconds, "accuracy": scientific,
    **dict.fromkeys(("ratio", "bound"), significant),
    **dict.fromkeys(("quicker", "typical", "slowest"), partial(significant, digits=2)),
}  # fmt: skip
"""Column of a table → how its numbers read."""


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line a run, by problem, mesh, μ and loop.

    The columns are those of `frame_of` and `in_words`, and solved, steps (iterations if solved), ratio (time over that
    of the condensed method where both solve the problem), and of the plain loop the bound μγ.
    """
    runs = in_words(frame_of(rows, ("iterations", "sharper"), ("seconds",)))
    runs["solved"] = runs.status == "solved"
    runs["steps"] = runs.iterations.where(runs.solved)
    runs["bound"] = runs.friction / runs.sharper
    direct = runs[(runs.loop == CONDENSED) & runs.solved].set_index(PLACE).seconds
    runs["ratio"] = (runs.seconds / runs[PLACE].apply(tuple, axis=1).map(direct.to_dict())).where(runs.solved)
    runs["order"] = runs.problem.map({name: place for place, name in enumerate(runs.problem.unique())})
    runs["number"] = runs.loop.map(list(LOOPS).index)
    return runs.sort_values(["order", "cells", "friction", "number"], kind="stable", ignore_index=True)


def by_loop(runs: DataFrame) -> list[tuple[str, DataFrame]]:
    """The loops with runs, in the order of `LOOPS`."""
    return [(loop, found) for loop in LOOPS if len(found := runs[runs.loop == loop])]


def values_of(runs: DataFrame) -> dict[str, Any]:
    """The numbers of the report's sentences."""
    direct, others = runs[runs.loop == CONDENSED], runs[runs.loop != CONDENSED]
    stopped, ratios = others[others.status == "max_iterations"].iterations, others[others.cells > 0].ratio.dropna()
    plain = runs[runs.loop == PLAIN]
    sure, beyond = plain[plain.bound < 1.0], plain[plain.bound >= 1.0]
    return {
        "limit": None if stopped.empty else int(stopped.max()), "missing": int((~runs.has).sum()),
        "counts": {loop: (int(each.solved.sum()), len(each)) for loop, each in by_loop(runs)},
        "least": direct.steps.min(), "most": direct.steps.max(), "low": runs.friction.min(),
        "high": runs.friction.max(), "worst": largest_of(ratios, runs),
        # the plain loop for μγ < 1 and μγ ≥ 1
        "sure": len(sure), "sure_solved": int(sure.solved.sum()), "beyond": len(beyond),
        "beyond_solved": int(beyond.solved.sum()), "farthest": plain[plain.solved].bound.max(),
        "loops": LOOPS, "inner": INNER, "tolerance": TOLERANCE, "iterations": MAX_ITERATIONS, "patience": PATIENCE,
    }  # fmt: skip


def _loops(found: DataFrame) -> DataFrame:
    """Each loop compared with the plain loop and the condensed method."""
    plain = found[found.loop == PLAIN].set_index(PLACE)[["steps", "solved"]].add_suffix("_plain")
    lines = []
    for loop, runs in by_loop(found):
        beside = runs.set_index(PLACE).join(plain)
        hard = beside[beside.solved_plain == False]  # noqa: E712 - not where there is no plain run
        times = runs[runs.cells > 0].ratio.dropna()
        lines.append({
            "loop": loop, "share": f"{runs.solved.sum()} of {len(runs)}", "hard": f"{hard.solved.sum()} of {len(hard)}",
            "quicker": (beside.steps / beside.steps_plain).dropna().median(), "typical": times.median(),
            "slowest": times.max(),
        })  # fmt: skip
    return DataFrame(lines)


def report(rows: Sequence[Row]) -> Report:
    """The report, a function of the rows only."""
    runs = runs_of(rows)
    tables = {"loops": _loops(runs), "runs": runs}
    return render("comparisons.convergence", "convergence-outer", values_of(runs), tables, {}, rows, forms=FORMS,
                  template="outer.md")  # fmt: skip
