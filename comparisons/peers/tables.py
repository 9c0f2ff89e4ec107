"""Tables of the report."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final

from comparisons.benchmark.reference import CONVERGED_FRICTION, PEERS
from comparisons.lab.report.numbers import NOTHING, listing, memory, percent, scientific, seconds, significant
from comparisons.lab.tables import Grid, grid_of
from comparisons.peers.codes.equilibrium import ONE_SENSE
from comparisons.peers.measures import (
    OTHERS,
    Reference,
    at_most,
    beside_of,
    by_friction,
    compared_of,
    costs_of,
    intervals_of,
    least_of,
    missing,
    slug,
)
from comparisons.peers.meshes import FAMILIES
from comparisons.peers.meshes import ratio as shrinking
from comparisons.peers.models import BRACKET, CODES, NAMED

if TYPE_CHECKING:
    from pandas import DataFrame

KINDS: Final = {
    "PROBLEM": "the problem itself",
    "STICKING": "the tied problem",
    ONE_SENSE: "the problem itself, as it slips in one sense",
    "GIVEN_BOUND": "the problem with the friction bound of the computed state held fixed",
}
"""Name of a `BracketKind`, or `ONE_SENSE` → what is bracketed."""


def count(value: float) -> str:
    """A number of unknowns."""
    return NOTHING if value != value else str(int(value))


def force(value: float) -> str:
    """P/2 [N/mm], to the digits that are resolved."""
    return NOTHING if value != value else f"{value:.7f}"


def _factor(value: float) -> str:
    return significant(value, 2)


_COSTS: Final[Mapping[str, Callable[[Any], str]]] = {
    "friction": "{:g}".format, "target": lambda value: scientific(value, 1), "own": seconds, "seconds": seconds,
    "time_ratio": _factor, "own_unknowns": count, "unknowns": count, "unknowns_ratio": _factor,
}  # fmt: skip
_RUNS: Final[Mapping[str, Callable[[Any], str]]] = {
    "unknowns": count, "half_force": force, "first_setup": seconds, "seconds": seconds, "spread": percent,
    "peak": memory, "residual": lambda value: scientific(value, 1), "low": force, "high": force, "lower": force,
    "upper": force, "width": scientific, "strain_error": scientific,
}  # fmt: skip


def tables_of(runs: "DataFrame", known: Mapping[float, Reference]) -> dict[str, Grid]:
    """The tables by name."""
    costs = costs_of(runs)
    tables = {
        "costs": _compared_table(compared_of(costs)), "least": _least_table(least_of(runs)),
        "intervals": _intervals_table(runs), "failures": _failures_table(runs[~runs.solved]),
        "missing": _missing_table(missing(runs)),
        "reported": _reported_table(runs, known.get(CONVERGED_FRICTION)),
    }  # fmt: skip
    for friction, here in by_friction(runs):
        name, bracket = slug(friction), here.code == BRACKET
        tables[f"costs-{name}"] = _costs_table(costs[costs.friction == friction])
        if len(beside := beside_of(here)):
            tables[f"beside-{name}"] = _beside_table(beside)
        tables[f"brackets-{name}"] = _brackets_table(here[bracket])
        tables[f"rows-{name}"] = _rows_table(here[~bracket])
    return tables


def _compared_table(compared: "DataFrame") -> Grid:
    headings = {
        "friction": "μ", "target": "error", "own": "triangles", "seconds": "other code", "code": "which",
        "time_ratio": "times as long", "own_unknowns": "unknowns of triangles", "unknowns": "of the other code",
        "smallest_code": "which", "unknowns_ratio": "times as many",
    }  # fmt: skip
    return grid_of(compared, headings, _COSTS)


def _costs_table(costs: "DataFrame") -> Grid:
    shown = costs.assign(name=[CODES[code].name for code in costs.code])
    headings = {
        "target": "error", "name": "code", "seconds": "time", "time_ratio": "over triangles", "quickest": "by",
        "unknowns": "fewest unknowns", "unknowns_ratio": "over triangles", "smallest": "by",
    }  # fmt: skip
    return grid_of(shown, headings, _COSTS)


def _least_table(least: "DataFrame") -> Grid:
    shown = least.assign(
        name=[CODES[code].name for code in least.code],
        shown=[_error(run.lasting, run.floor) for run in least.itertuples()],
    )
    headings = {
        "friction": "μ", "name": "code", "shown": "smallest error", "unknowns": "unknowns", "seconds": "time",
        "run": "by",
    }  # fmt: skip
    return grid_of(shown, headings, {**_RUNS, "friction": "{:g}".format})


def _rows_table(here: "DataFrame") -> Grid:
    shown = here.assign(
        first_setup=[min(times, default=None) for times in here.setup],
        shown=[_error(run.error, run.floor) for run in here.itertuples()],
    )
    headings = {
        "model": "model", "label": "mesh", "unknowns": "unknowns", "status": "status", "half_force": "P/2 [N/mm]",
        "shown": "error", "first_setup": "set-up", "seconds": "time", "spread": "spread", "peak": "memory",
        "residual": "residual",
    }  # fmt: skip
    return grid_of(shown, headings, _RUNS)


def _intervals_table(runs: "DataFrame") -> Grid:
    """The narrowest guaranteed interval of each μ, and how many forces of other codes are not in it."""
    found = intervals_of(runs)
    shown = found.assign(half=0.5 * (found.high - found.low) / found.low)
    outside = {key: f"{CODES[key].name} outside" for key in OTHERS}
    headings = {
        "friction": "μ", "low": "P/2 from [N/mm]", "high": "to [N/mm]", "half": "half width", "unknowns": "unknowns",
        "seconds": "time", "run": "by", **outside,
    }  # fmt: skip
    return grid_of(shown, headings, {**_RUNS, "friction": "{:g}".format, "half": scientific})


def _beside_table(beside: "DataFrame") -> Grid:
    """Each guaranteed interval, and what the other codes say with no more unknowns."""
    names = {key: CODES[key].name for key in OTHERS}
    shown = beside.assign(half=0.5 * (beside.high - beside.low) / beside.low)
    shown = shown.assign(**{key: [_told(*each) for each in beside[key]] for key in names})
    headings = {
        "run": "interval", "unknowns": "unknowns", "seconds": "time", "low": "P/2 from [N/mm]", "high": "to [N/mm]",
        "half": "half width", **names,
    }  # fmt: skip
    return grid_of(shown, headings, {**_RUNS, "half": scientific})


def _told(value: float, inside: bool) -> str:
    """A force of another code, and that it is wrong if it is."""
    return force(value) + ("" if inside or value != value else ", outside")


def _brackets_table(here: "DataFrame") -> Grid:
    sure = here.guaranteed & here.solved
    shown = here.assign(
        sure=["yes" if each else "no" for each in sure], what=[KINDS.get(kind, NOTHING) for kind in here.kind],
        lower=here.lower.where(here.guaranteed), upper=here.upper.where(here.guaranteed),
    )  # fmt: skip
    headings = {
        "model": "bracket", "label": "mesh", "unknowns": "unknowns", "status": "status", "lower": "lower P/2 [N/mm]",
        "upper": "upper P/2 [N/mm]", "width": "half width", "strain_error": "stress error", "sure": "guaranteed",
        "seconds": "time", "spread": "spread", "peak": "memory", "what": "of",
    }  # fmt: skip
    return grid_of(shown, headings, _RUNS)


def _error(error: float, floor: float) -> str:
    """An error; one that is not resolved as what it is at most."""
    return f"{'' if error != error or error > floor else '≤ '}{scientific(at_most(error, floor))}"


def _failures_table(failed: "DataFrame") -> Grid:
    headings = {"model": "model", "friction": "μ", "label": "mesh", "status": "status", "message": "message"}
    return grid_of(failed, headings, {"friction": "{:g}".format, "message": lambda text: text or NOTHING})


def _missing_table(keys: list[str]) -> Grid:
    return Grid("", ("code", "how to get it"), [(CODES[key].name, CODES[key].remedy) for key in keys])


def _reported_table(runs: "DataFrame", known: Reference | None) -> Grid:
    """What codes that are not in this run reported on another day."""
    names = {CODES[code].name for code in runs.code}
    rows = [
        (peer.code, f"{peer.half_force:.5f}", scientific(abs(peer.half_force / known.value - 1.0)),
         seconds(peer.seconds))
        for peer in PEERS if known and peer.code.split(",")[0] not in names
    ]  # fmt: skip
    return Grid("", ("code", "P/2 [N/mm]", "error", "reported time"), rows)


def settings_of(runs: "DataFrame", known: Mapping[float, Reference]) -> list[Grid]:
    """Values that errors are relative to, models with the memory of their processes before a case, and meshes."""
    return [_references(known), _models(runs), _meshes(runs)]


def _references(known: Mapping[float, Reference]) -> Grid:
    rows = [
        (f"{friction:g}", force(each.value), scientific(each.uncertainty), scientific(each.floor), each.source)
        for friction, each in known.items()
    ]
    headings = ("μ", "P/2 [N/mm]", "±", "smallest error resolved", "from")
    return Grid("Values that errors are relative to", headings, rows)


def _models(runs: "DataFrame") -> Grid:
    rows = []
    for name, found in runs.sort_values("order", kind="stable").groupby("model", sort=False):
        model, said = NAMED[str(name)], sorted(set(found.version.dropna()) - {""})
        options = ", ".join(f"{option} = {value}" for option, value in model.options.items()) or NOTHING
        taken = memory(found.before.dropna().median())
        rows.append((model.name, CODES[model.code].name, ", ".join(said) or NOTHING, options, taken))
    headings = ("model", "code", "version, as it says", "options", "memory with its libraries")
    return Grid("Models", headings, rows)


def _meshes(runs: "DataFrame") -> Grid:
    rows = []
    for name, family in FAMILIES.items():
        numbers = sorted(set(runs[runs.mesh == name].number))
        told = [f"{each} (each cell {shrinking(each):g} of the one before it)" if name == "graded" else str(each)
                for each in numbers]  # fmt: skip
        if numbers:
            rows.append((name, family.reading, listing(told)))
    return Grid("Meshes", ("family", "what it is", "cells a side, or levels"), rows)
