"""The runs as one frame, and the numbers and tables of the report."""

from collections import Counter
from collections.abc import Sequence
from statistics import median
from typing import TYPE_CHECKING, Any, Final

from comparisons.convergence.outer.loops import CONDENSED, LOOPS, PLAIN
from comparisons.lab.report.numbers import NOTHING, listing, scientific, seconds, significant
from comparisons.lab.study import DONE, Row
from comparisons.lab.tables import Grid, grid_of

if TYPE_CHECKING:
    from pandas import DataFrame

NAMES: Final = {
    "contacts": "8 contacts", "plate": "plate", "block": "dragged block", "ssnv128": "SSNV128", "three": "1 contact",
}  # fmt: skip
"""Problem → what it is called in texts."""

SOLUTIONS: Final = {"open": 0.0, "slip": 5.0 / 3.0, "stick": 17.0 / 9.0}
"""The three solutions of the problem that has them: state → pressure r_N; by hand, see `bodies`."""

PLACE: Final = ["problem", "cells", "friction"]

_NUMBERS: Final = (
    "iterations", "factor", "low", "high", "linearised", "exact", "sharper", "kappa", "normal", "slipping", "open",
    "points",
)  # fmt: skip
"""Entries of results that are numbers, see `task`; NaN where a run has none."""


def runs_of(rows: Sequence[Row]) -> "DataFrame":
    """One line a run, by problem, mesh, μ and loop.

    The columns are problem, cells, friction, body (problem and mesh in words), loop, start, status, solved, has
    (whether there is a result), falling (stopped while its residuals fell), seconds (median), accuracy that the
    certificate confirms, residuals, steps (iterations if solved), rate (contraction if the loop converges), ratio (time
    over that of the condensed method where both solve the problem), bound μγ and root μ√κ, and the numbers of the task.
    """
    from pandas import DataFrame, to_numeric

    runs = DataFrame([_run(row) for row in sorted(rows, key=lambda row: row.position)])
    for name in (*_NUMBERS, "start", "seconds", "accuracy"):
        runs[name] = to_numeric(runs[name])
    runs["steps"] = runs.iterations.where(runs.solved)
    runs["rate"] = runs.factor.where(runs.course == "converges")
    runs["falling"] = ~runs.solved & (runs.course == "converges")
    runs["bound"], runs["root"] = runs.friction / runs.sharper, runs.friction / runs.kappa
    direct = runs[(runs.loop == CONDENSED) & runs.solved & (runs.problem != "three")].set_index(PLACE).seconds
    known = runs[PLACE].apply(tuple, axis=1).map(direct.to_dict())
    runs["ratio"] = (runs.seconds / known).where(runs.solved)
    problems, loops = {name: place for place, name in enumerate(runs.problem.unique())}, list(LOOPS)
    runs["order"] = runs.problem.map(problems)
    runs["number"] = runs.loop.map(loops.index)
    return runs.sort_values(["order", "cells", "friction", "number"], kind="stable", ignore_index=True)


def _run(row: Row) -> dict[str, Any]:
    case, result = row.case, row.result
    problem, cells = case["problem"], case["cells"]
    name = NAMES.get(problem, problem)
    status = result["status"] if row.status == DONE else row.status
    return {
        "problem": problem, "cells": cells, "friction": float(case["friction"]), "loop": case["loop"],
        "body": f"{name}, {cells}²" if cells else name, "start": case["start"], "status": status,
        "solved": status == "solved", "has": bool(result), "course": result.get("course"),
        "seconds": median(result["seconds"]) if result else None, "residuals": result.get("residuals", []),
        "accuracy": row.certificate["accuracy"] if row.certificate else None,
        **{name: result.get(name) for name in _NUMBERS},
    }  # fmt: skip


def single(runs: "DataFrame") -> "DataFrame":
    """Those of problems that all loops start from the bonded state."""
    return runs[runs.problem != "three"]


def main_bodies(runs: "DataFrame") -> list[str]:
    """Of each problem the mesh with the most frictions, the finest of several."""
    found = []
    for _, several in single(runs).groupby("order"):
        counts = several.groupby(["cells", "body"]).friction.nunique().reset_index()
        found.append(str(counts.sort_values(["friction", "cells"]).body.iloc[-1]))
    return found


def mesh_groups(runs: "DataFrame") -> dict[tuple[str, float], "DataFrame"]:
    """(Problem, μ) → runs of the plain loop on at least two meshes, by mesh."""
    plain = single(runs)[single(runs).loop == PLAIN].sort_values("cells")
    return {place: found for place, found in plain.groupby(["problem", "friction"]) if len(found) > 1}


def values_of(runs: "DataFrame") -> dict[str, Any]:
    """The numbers of the report's sentences."""
    found = single(runs)
    direct, others = found[found.loop == CONDENSED], found[found.loop != CONDENSED]
    stopped = others[others.status == "max_iterations"].iterations
    ratios = found[(found.loop != CONDENSED) & (found.cells > 0)].ratio.dropna()
    worst = None if ratios.empty else runs.loc[ratios.idxmax()]
    return {
        "limit": None if stopped.empty else int(stopped.max()), "missing": int((~runs.has).sum()),
        "counts": {loop: (int(each.solved.sum()), len(each)) for loop, each in _by_loop(found)},
        "least": direct.steps.min(), "most": direct.steps.max(), "low": found.friction.min(),
        "high": found.friction.max(), "worst": None if worst is None else worst.ratio,
        "worst_loop": None if worst is None else worst.loop, "worst_body": None if worst is None else worst.body,
        "worst_friction": None if worst is None else worst.friction, **_of_contraction(found), **_of_bound(found),
        **_of_starts(runs[runs.problem == "three"]),
    }  # fmt: skip


def _by_loop(runs: "DataFrame") -> list[tuple[str, "DataFrame"]]:
    """Loops that were run, in their order."""
    return [(loop, found) for loop in LOOPS if len(found := runs[runs.loop == loop])]


def _of_contraction(found: "DataFrame") -> dict[str, Any]:
    """How well theory foresees the contraction, and whether a linearised one below 1 is enough, one above too much."""
    plain = found[(found.loop == PLAIN) & found.rate.notna()]
    exact = (plain.rate / plain.exact - 1.0).abs().dropna()
    meshes = plain[plain.solved & (plain.cells > 0)]
    off = (meshes.rate / meshes.linearised - 1.0).abs().dropna()
    far = None if off.empty else meshes.loc[off.idxmax()]
    above, below = found[found.linearised >= 1.0], found[found.linearised < 1.0]
    stuck = below[~below.solved & ~below.falling]
    return {
        "exact": exact.max(), "exact_runs": len(exact), "typical": off.median(), "mesh_runs": len(off),
        "off": off.max(), "off_body": None if far is None else far.body,
        "off_friction": None if far is None else far.friction, "above": len(above), "lucky": int(above.solved.sum()),
        "below": len(below), "stuck": len(stuck), "still": int(below.falling.sum()),
        "stuck_at": listing(list(dict.fromkeys(f"{run.body} at μ = {run.friction:g}" for run in stuck.itertuples()))),
    }  # fmt: skip


def _of_bound(found: "DataFrame") -> dict[str, Any]:
    """What the plain loop does below and beyond the bound of uniqueness."""
    plain = found[(found.loop == PLAIN) & found.bound.notna()]
    sure, beyond = plain[plain.bound < 1.0], plain[plain.bound >= 1.0]
    return {
        "sure": len(sure), "sure_solved": int(sure.solved.sum()), "beyond": len(beyond),
        "beyond_solved": int(beyond.solved.sum()), "farthest": plain[plain.solved].bound.max(),
    }  # fmt: skip


def _of_starts(several: "DataFrame") -> dict[str, Any]:
    """Which of the three solutions is found, and by how many loops in different ones from different starts."""
    ends = several.apply(solution_found, axis=1) if len(several) else []
    counts = Counter(ends)
    started = several.assign(end=list(ends))[several.start.notna()] if len(several) else several
    known = {loop: set(found.end) & set(SOLUTIONS) for loop, found in started.groupby("loop")}
    return {
        "starts": {name: counts[name] for name in dict.fromkeys([*SOLUTIONS, *counts])}, "started": len(known),
        "different": sum(len(found) > 1 for found in known.values()), "several": len(several),
    }  # fmt: skip


def solution_found(run: Any) -> str:
    """Which of the three solutions a run ended in; the status if in none."""
    if not run.solved or run.normal != run.normal:
        return str(run.status)
    name = min(SOLUTIONS, key=lambda state: abs(SOLUTIONS[state] + run.normal))
    return name if abs(SOLUTIONS[name] + run.normal) < 1e-6 else "none of the three"


def tables_of(runs: "DataFrame") -> dict[str, Grid]:
    """The tables by name."""
    found = single(runs)
    return {
        "loops": _loops_table(found), "limits": _limits_table(found), "contraction": _contraction_table(found),
        "spread": _spread_table(runs), "meshes": _meshes_table(runs), "runs": _runs_table(found),
        "solutions": _solutions_table(runs[runs.problem == "three"]),
    }  # fmt: skip


def _loops_table(found: "DataFrame") -> Grid:
    """Each loop beside the plain one and beside the condensed method."""
    plain = found[found.loop == PLAIN].set_index(PLACE)[["steps", "solved"]].add_suffix("_plain")
    rows = []
    for loop, runs in _by_loop(found):
        beside = runs.set_index(PLACE).join(plain)
        hard = beside[beside.solved_plain == False]  # noqa: E712 - not where there is no plain run
        times = runs[runs.cells > 0].ratio
        rows.append((
            loop, f"{int(runs.solved.sum())} of {len(runs)}", f"{int(hard.solved.sum())} of {len(hard)}",
            significant((beside.steps / beside.steps_plain).dropna().median(), 2),
            significant(times.dropna().median(), 2),
            significant(times.max(), 2),
        ))  # fmt: skip
    headings = (
        "loop", "solved", "of those that plain does not solve", "iterations over plain", "time over condensed",
        "at most",
    )  # fmt: skip
    return Grid("", headings, rows)


def _limits_table(found: "DataFrame") -> Grid:
    """Which frictions the plain loop solves on the main mesh of each problem."""
    rows = []
    for body in main_bodies(found):
        runs = found[(found.body == body) & (found.loop == PLAIN)]
        good, falling = runs[runs.solved], runs[runs.falling]
        failed = runs[~runs.solved & ~runs.falling]
        rows.append((
            body, f"{len(good)} of {len(runs)}", significant(good.friction.max()),
            listing([f"{run.friction:g} ({run.status})" for run in failed.itertuples()]),
            listing([f"{run.friction:g} ({significant(run.rate)})" for run in falling.itertuples()]),
        ))  # fmt: skip
    headings = ("problem", "μ solved", "largest", "fails at μ (how)", "stopped while converging at μ (contraction)")
    return Grid("", headings, rows)


def _contraction_table(found: "DataFrame") -> Grid:
    """Observed contraction of the plain loop beside theory."""
    plain = found[found.loop == PLAIN]
    shown = plain.assign(
        interval=[f"{significant(run.low)} to {significant(run.high)}" if run.rate == run.rate else NOTHING
                  for run in plain.itertuples()],
        states=[" / ".join(map(_count, (run.slipping, run.open, run.points))) for run in plain.itertuples()],
    )  # fmt: skip
    headings = {
        "body": "problem", "friction": "μ", "status": "status", "rate": "observed contraction",
        "interval": "95 % interval", "linearised": "linearised at the solution", "exact": "exact", "bound": "bound μγ",
        "root": "bound μ√κ", "states": "slipping / open / all points",
    }  # fmt: skip
    forms = dict.fromkeys(("rate", "linearised", "exact", "bound", "root"), significant)
    return grid_of(shown, headings, {"friction": "{:g}".format, **forms})


def _spread_table(runs: "DataFrame") -> Grid:
    """How much the contraction of the plain loop changes from mesh to mesh."""
    rows = [
        (NAMES.get(problem, problem), f"{friction:g}", f"{int(found.rate.notna().sum())} of {len(found)}",
         significant(found.rate.min(), 2), significant(found.rate.max(), 2),
         significant(found.rate.max() / found.rate.min(), 2))
        for (problem, friction), found in mesh_groups(runs).items()
    ]  # fmt: skip
    headings = ("problem", "μ", "meshes with a contraction", "smallest", "largest", "largest over smallest")
    return Grid("", headings, rows)


def _meshes_table(runs: "DataFrame") -> Grid:
    """The plain loop on several meshes."""
    from pandas import concat

    groups = list(mesh_groups(runs).values())
    shown = concat(groups) if groups else runs[:0]
    shown = shown.assign(name=shown.problem.map(NAMES))
    headings = {
        "name": "problem", "friction": "μ", "cells": "cells a side", "status": "status", "rate": "contraction",
        "linearised": "linearised", "bound": "bound μγ", "steps": "iterations",
    }  # fmt: skip
    forms = {"friction": "{:g}".format, "steps": _count}
    return grid_of(shown, headings, forms | dict.fromkeys(("rate", "linearised", "bound"), significant))


def _runs_table(found: "DataFrame") -> Grid:
    headings = {
        "body": "problem", "friction": "μ", "loop": "loop", "status": "status", "steps": "iterations",
        "rate": "contraction", "seconds": "time", "ratio": "over condensed", "accuracy": "certified accuracy",
    }  # fmt: skip
    forms = {
        "friction": "{:g}".format, "steps": _count, "rate": significant, "seconds": seconds, "ratio": significant,
        "accuracy": scientific,
    }  # fmt: skip
    return grid_of(found, headings, forms)


def _solutions_table(several: "DataFrame") -> Grid:
    """Which of three solutions each loop finds."""
    starts = sorted(several.start.dropna().unique())
    rows = []
    for loop, found in _by_loop(several):
        ends = {run.start: solution_found(run) for run in found.itertuples()}
        only = next(iter(ends.values())) if found.start.isna().all() else NOTHING
        rows.append((loop, *(ends.get(start, only) for start in starts)))
    return Grid("", ("loop", *(f"start s = {start:g}" for start in starts)), rows)


def _count(value: float) -> str:
    return NOTHING if value != value else str(int(value))
