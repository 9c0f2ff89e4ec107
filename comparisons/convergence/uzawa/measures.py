"""The runs as one frame, and the numbers and tables of the report."""

from collections.abc import Mapping, Sequence
from statistics import median
from typing import TYPE_CHECKING, Any, Final

from comparisons.convergence.rates import growth_order
from comparisons.convergence.uzawa.methods import METHODS
from comparisons.convergence.uzawa.study import HALF
from comparisons.convergence.uzawa.task import TARGETS
from comparisons.lab.report.numbers import NOTHING, listing, percent, scientific, seconds, significant, span
from comparisons.lab.study import DONE, Row
from comparisons.lab.tables import Grid, grid_of
from comparisons.paper.reference import load

if TYPE_CHECKING:
    from pandas import DataFrame, Series

SOON: Final = "to 1e-04"
"""Iterations until the normal force is within 1e-4 for good."""

PLACE: Final = ["problem", "cells", "friction"]

_NUMBERS: Final = (
    "omega_T", "omega_N", "limit_T", "limit_N", "slipping_T", "open_N", "linearised", "condition", "open", "points",
    "force", "iterations", "settles", "last_error", "last_change", "largest", "smallest", "foreseen", "printed",
    "after", "after_printed_rule", "before", "tractions",
)  # fmt: skip
"""Entries of results that are numbers, see `task`; NaN where a run has none."""

_NAMES: Final = {"half open": "8 contacts, half open", "sliding": "8 contacts, sliding", "ssnv128": "SSNV128"}
_LAST_DIGIT: Final = 0.00501  # of P/2: half of the last digit printed, and rounding


def runs_of(rows: Sequence[Row]) -> "DataFrame":
    """One line a run, by problem, mesh and μ.

    The columns are run, problem, cells (0 without a mesh), friction, where (the three in words), tangential, normal,
    target, status, has (whether there is a result), accuracy that the certificate confirms, seconds (median), errors of
    P/2 one by one, "to 1e-02" and so on (iterations to that error for good), and the numbers of the task.
    """
    from pandas import DataFrame, to_numeric

    runs = DataFrame([_run(row) for row in sorted(rows, key=lambda row: row.position)])
    for name in (*_NUMBERS, "tangential", "normal", "target", "accuracy", "seconds", *_targets()):
        runs[name] = to_numeric(runs[name])
    return runs.sort_values(PLACE, kind="stable", ignore_index=True)


def _targets() -> list[str]:
    return [f"to {target:.0e}" for target in TARGETS]


def _run(row: Row) -> dict[str, Any]:
    case, result, certificate = row.case, row.result, row.certificate
    problem, cells, friction = case["place"]
    mesh = f", {cells}²" if cells else ""
    needed, times = result.get("needed", {}), result.get("seconds")
    return {
        "run": case["run"], "problem": problem, "cells": int(cells), "friction": float(friction),
        "where": f"{_NAMES.get(problem, problem)}{mesh}, μ = {friction:g}",
        "tangential": case["tangential"], "normal": case["normal"], "target": case["target"],
        "status": result["status"] if row.status == DONE else row.status, "has": bool(result),
        "accuracy": None if certificate is None else certificate["accuracy"],
        "seconds": median(times) if times else None, "errors": result.get("errors"),
        **{f"to {target:.0e}": needed.get(f"{target:.0e}") for target in TARGETS},
        **{name: result.get(name) for name in _NUMBERS},
    }  # fmt: skip


def of(runs: "DataFrame", *names: str) -> "DataFrame":
    """The runs of these names that have a result."""
    return runs[runs.run.isin(names) & runs.has]


def quickest(found: "DataFrame") -> "Series | None":
    """The run of a map that settles and is within 1e-4 first; None if none is."""
    good = found[(found.settles == 1) & found[SOON].notna()]
    return None if good.empty else good.loc[good[SOON].idxmin()]


def paper_runs(runs: "DataFrame") -> "DataFrame":
    """The paper's runs, with the quickest one of the map of the same problem beside them."""
    found = of(runs, "paper").copy()
    found["error"] = (found.after / found.force - 1.0).abs()
    found["share"] = found.omega_T / found.limit_T
    found["quickest"] = [_quickest_at(runs, place) for place in found[PLACE].itertuples(index=False)]
    found["factor"] = found[SOON] / found["quickest"]
    return found


def _quickest_at(runs: "DataFrame", place: tuple[Any, ...]) -> float | None:
    maps = of(runs, "map")
    best = quickest(maps[(maps[PLACE] == list(place)).all(axis=1)])
    return None if best is None else float(best[SOON])


def searches_of(runs: "DataFrame") -> "DataFrame":
    """Searches for the largest step, with shares of 2 / λ_max over all points."""
    found = of(runs, "tangential limit", "normal limit").copy()
    tangential = found.run == "tangential limit"
    found["step"] = tangential.map({True: "ω_T", False: "ω_N"})
    found["limit"] = found.limit_T.where(tangential, found.limit_N)
    found["part"] = found.slipping_T.where(tangential, found.open_N) / found.limit
    found["observed"] = found.omega_T.where(tangential, found.omega_N)
    return found


def values_of(runs: "DataFrame") -> dict[str, Any]:
    """The numbers of the report's sentences."""
    paper = load()
    return {
        "iterations": paper.iterations, "omega": paper.omega_T, "half": HALF, "failed": int((~runs.has).sum()),
        **_of_paper(paper_runs(runs)), **_of_limits(searches_of(runs)), **_of_accuracy(runs),
        "slow": int(of(runs, "mesh")["to 1e-06"].isna().sum()), "meshes": len(of(runs, "mesh")),
        "orders": span([line["order"] for line in growth(runs)], lambda order: f"{-order:.2f}".replace("-", "−")),
    }  # fmt: skip


def _of_paper(found: "DataFrame") -> dict[str, Any]:
    """After the paper's iterations: errors, what the step costs, how many printed values are met."""
    rough = found[found.friction > 0.0]
    worst = None if rough.empty else rough.loc[rough.error.idxmax()]
    sliding = rough[rough.linearised > 0.0]
    smooth = found[found.friction == 0.0]
    digits = {
        name: int(((found[name] - found.printed).abs() < _LAST_DIGIT).sum()) for name in ("after", "after_printed_rule")
    }
    return {
        "error": None if worst is None else worst.error, "error_at": None if worst is None else worst.friction,
        "tractions": rough.tractions.max(), "needed": span(rough[SOON][rough[SOON] > load().iterations]),
        "needed_at": int((rough[SOON] > load().iterations).sum()), "frictions": len(rough),
        "sliding": len(sliding), "shares": span(sliding.share, percent), "rates": span(sliding.linearised),
        "powers": span(sliding.linearised ** load().iterations, lambda value: significant(value, 2)),
        "quickest": span(sliding["quickest"]), "factors": span(sliding.factor, lambda value: significant(value, 2)),
        "printed": len(found), "accumulating": digits["after"], "as_printed": digits["after_printed_rule"],
        "smooth_error": None if smooth.empty else smooth.last_error.iloc[0],
        "smooth_change": None if smooth.empty else smooth.last_change.iloc[0],
    }  # fmt: skip


def _of_limits(found: "DataFrame") -> dict[str, Any]:
    """Observed limits of ω_T on the plate beside the two of theory, and the one known by hand."""
    plate = found[(found.step == "ω_T") & (found.problem == "plate")]
    both = plate[plate.largest.notna() & plate.smallest.notna()]
    local = both.largest / both.foreseen
    exact = found[found.problem == "sliding"]
    return {
        "searches": len(plate), "safe": int((plate.largest >= 1.0).sum()), "largest": span(both.largest),
        "foreseen": int(local.notna().sum()), "early": int((both.smallest < both.foreseen).sum()),
        "local": span(local.dropna()), "beyond": int((local > 1.0).sum()),
        "exact_low": None if exact.empty else exact.largest.iloc[0],
        "exact_high": None if exact.empty else exact.smallest.iloc[0],
    }  # fmt: skip


def _of_accuracy(runs: "DataFrame") -> dict[str, Any]:
    """How many targets each method meets, and how much the best steps save."""
    equal, maps = of(runs, *METHODS), of(runs, "map")
    saved = []
    for _, found in maps.groupby(PLACE):
        best, half = quickest(found), found[(found.tangential == HALF) & (found.normal == HALF)][SOON]
        asked = (equal[PLACE] == found[PLACE].iloc[0].tolist()).all(axis=1).any()
        if asked and best is not None and half.notna().any():
            saved.append(half.iloc[0] / best[SOON])
    counts = {name: equal[equal.run == name] for name in METHODS}
    return {
        "targets": {name: (int((found.status == "solved").sum()), len(found)) for name, found in counts.items()},
        "saved": span(saved),
    }  # fmt: skip


def growth(runs: "DataFrame") -> list[dict[str, Any]]:
    """For each μ: how iterations to 1e-4 and the condition grow with the cells a side, and where ω_T is too long."""
    searches = searches_of(runs)
    lines = []
    for friction, found in of(runs, "mesh").sort_values("cells").groupby("friction"):
        there = found[found[SOON].notna()]
        known = found[found.condition.notna()]
        bounded = searches[(searches.step == "ω_T") & (searches.problem == "plate") & (searches.friction == friction)]
        short = bounded[bounded.smallest.notna() & (bounded.observed < load().omega_T)]
        lines.append({
            "friction": friction, "order": growth_order(there.cells.tolist(), there[SOON].tolist()),
            "condition": growth_order(known.cells.tolist(), known.condition.tolist()),
            "most": None if there.empty else int(there[SOON].max()),
            "beyond": listing([f"{cells}²" for cells in short.cells]),
        })  # fmt: skip
    return lines


def tables_of(runs: "DataFrame") -> dict[str, Grid]:
    """The tables by name."""
    return {
        "paper": _paper_table(paper_runs(runs)), "limit-table": _limits_table(searches_of(runs)),
        "growth": _growth_table(runs), "meshes": _meshes_table(of(runs, "mesh")), "maps": _maps_table(of(runs, "map")),
        "reach": _reach_table(of(runs, *METHODS)), "accuracy": _accuracy_table(of(runs, *METHODS)),
    }  # fmt: skip


def _paper_table(found: "DataFrame") -> Grid:
    force, share = (lambda value: f"{value:.2f}" if value == value else NOTHING), (lambda value: percent(value, 2))
    headings = {
        "friction": "μ", "printed": "P/2 printed [N/mm]", "after": "after 30, accumulating rule",
        "after_printed_rule": "after 30, printed rule", "force": "solution", "before": "error of P/2 at the start",
        "error": "after 30", "tractions": "of tractions after 30", SOON: "iterations to 1e-4", "to 1e-06": "to 1e-6",
        "quickest": "to 1e-4 by the quickest step", "factor": "times fewer", "condition": "condition",
        "linearised": "contraction, linearised", "share": "ω_T over its limit",
    }  # fmt: skip
    forms = {
        "friction": "{:g}".format, **dict.fromkeys(("printed", "after", "after_printed_rule", "force"), force),
        **dict.fromkeys(("before", "error", "tractions"), share), SOON: count, "to 1e-06": count, "quickest": count,
        "factor": lambda value: significant(value, 2), "condition": significant, "linearised": significant,
        "share": lambda value: significant(value, 2),
    }  # fmt: skip
    return grid_of(found, headings, forms)


def _limits_table(found: "DataFrame") -> Grid:
    shown = found.assign(settles=[
        NOTHING if one.largest != one.largest else f"{'> ' if one.smallest != one.smallest else ''}"
        f"{significant(one.largest)}" for one in found.itertuples()
    ])  # fmt: skip
    headings = {
        "where": "problem", "step": "step", "settles": "largest that settles (share)", "smallest": "fails at (share)",
        "foreseen": "linearised (share)", "part": "slipping or open (share)", "open": "points open",
        "limit": "2 / λ_max, all points", "observed": "observed",
    }  # fmt: skip
    long = {name: lambda value: scientific(value, 3) for name in ("limit", "observed")}
    forms = {**dict.fromkeys(("smallest", "foreseen", "part"), significant), "open": count, **long}
    return grid_of(shown, headings, forms)


def _growth_table(runs: "DataFrame") -> Grid:
    rows = [
        (f"{line['friction']:g}", _power(line["order"]), count(line["most"]), _power(line["condition"]), line["beyond"])
        for line in growth(runs)
    ]
    headings = ("μ", "iterations to 1e-4 grow like", "most", "the condition like", "printed ω_T too long on")
    return Grid("", headings, rows)


def _meshes_table(found: "DataFrame") -> Grid:
    headings = {
        "friction": "μ", "cells": "cells a side", "omega_T": "ω_T", "condition": "condition",
        "linearised": "contraction, linearised", "to 1e-02": "iterations to 1e-2", "to 1e-03": "to 1e-3",
        "to 1e-04": "to 1e-4", "to 1e-06": "to 1e-6", "accuracy": "certified accuracy at the end",
    }  # fmt: skip
    forms = {
        "friction": "{:g}".format, "omega_T": lambda value: scientific(value, 3), "condition": significant,
        "linearised": lambda value: significant(value, 4), **dict.fromkeys(_targets(), count), "accuracy": scientific,
    }  # fmt: skip
    return grid_of(found.sort_values(["friction", "cells"]), headings, forms)


def _maps_table(found: "DataFrame") -> Grid:
    rows = []
    for where, runs in found.groupby("where", sort=False):
        best = quickest(runs)
        one = runs.groupby("tangential", dropna=False)[["settles", SOON]].nunique(dropna=False)
        soon, step = (NOTHING, NOTHING) if best is None else (count(best[SOON]), significant(best.tangential))
        failing, matters = int((runs.settles != 1).sum()), "yes" if (one > 1).any(axis=None) else "no"
        rows.append((str(where), str(len(runs)), str(failing), soon, step, matters))
    headings = (
        "problem", "pairs of steps", "do not settle", "iterations to 1e-4 of the quickest", "its ω_T (share)",
        "ω_N matters",
    )  # fmt: skip
    return Grid("", headings, rows)


def _reach_table(found: "DataFrame") -> Grid:
    rows = []
    for where, runs in found.groupby("where", sort=False):
        met = runs[runs.status == "solved"].groupby("run").target.min()
        rows.append((str(where), *(scientific(met.get(name), 1) for name in METHODS)))
    return Grid("", ("problem", *METHODS), rows)


def _accuracy_table(found: "DataFrame") -> Grid:
    headings = {
        "where": "problem", "run": "method", "target": "target", "status": "status", "iterations": "iterations",
        "seconds": "time", "accuracy": "certified accuracy",
    }  # fmt: skip
    forms = {
        "target": lambda value: scientific(value, 1), "iterations": count, "seconds": seconds, "accuracy": scientific,
    }  # fmt: skip
    return grid_of(found, headings, forms)


def count(value: float | None) -> str:
    """A number of iterations or points."""
    return NOTHING if value is None or value != value else str(int(value))


def _power(order: float | None) -> str:
    """Of a quantity that grows like (cells a side)^order: "h^−1.50"."""
    return NOTHING if order is None else f"h^{'−' if order >= 0.0 else ''}{abs(order):.2f}"


def settings_of(settings: Mapping[str, str]) -> Grid:
    """Settings of all runs, beside the options of the methods."""
    methods = {
        name: ", ".join(f"{key} = {value}" for key, value in one.options.items()) for name, one in METHODS.items()
    }
    return Grid("Runs and methods", ("setting", "value"), list({**settings, **methods}.items()))
