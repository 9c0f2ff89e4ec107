"""The report of a run, computed from its rows alone: its tables, as a document, and as JSON."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from pandas import DataFrame

from comparisons.lab.report import Document, environment_grids, findings_of, render
from comparisons.lab.report.numbers import NOTHING, count, fixed, listing, memory, percent, scientific, seconds
from comparisons.lab.study import Row
from comparisons.lab.tables import Grid
from comparisons.peers import measures
from comparisons.peers.codes.equilibrium import COULOMB
from comparisons.peers.figures import figures
from comparisons.peers.measures import (
    BOUNDS,
    NUMBERS,
    OTHERS,
    RESOLUTION,
    Reference,
    by_friction,
    factor,
    missing,
    slug,
)
from comparisons.peers.meshes import FAMILIES
from comparisons.peers.meshes import ratio as shrinking
from comparisons.peers.models import BRACKET, CODES, NAMED

SCHEMA: Final = "qvi-contact/peers/4"


KINDS: Final = {
    "PROBLEM": "the problem itself",
    COULOMB: "the problem itself, under Coulomb's law",
    "ONE_SENSE": "the problem itself, if it slips in one sense",
    "STICKING": "the tied problem",
    "GIVEN_BOUND": "the problem with the friction bound of the computed state held fixed",
}
"""Name of a `BracketKind`, or `COULOMB` → what is bracketed; two are of rows that earlier versions made."""


def force(value: float) -> str:
    """P/2 [N/mm], to the digits that are resolved."""
    return fixed(".7f")(value)


def _code(key: str) -> str:
    return CODES[key].name


def _first(value: float) -> str:
    return scientific(value, 1)


FORMS: Final[Mapping[str, Callable[[Any], str]]] = {
    "friction": "{:g}".format, "target": _first, "code": _code, "smallest_code": _code, "seconds_own": seconds,
    "seconds": seconds, "setup": lambda times: seconds(min(times, default=None)), "time_ratio": factor,
    "unknowns_own": count, "unknowns": count, "unknowns_ratio": factor, "half_force": force, "spread": percent,
    "peak": memory, "residual": _first, "low": force, "high": force, "lower": force, "upper": force, "half": scientific,
    "width": scientific, "strain_error": scientific, "sure": lambda sure: "yes" if sure else "no",
    "kind": lambda kind: KINDS.get(kind, NOTHING), "message": lambda text: text or NOTHING,
}  # fmt: skip
"""Column of a table → how its values read."""


def tables_of(runs: DataFrame, costs: DataFrame, known: Mapping[float, Reference]) -> dict[str, DataFrame | Grid]:
    """The tables by name; `costs` is that of `costs_of`."""
    shown = runs.assign(
        shown=list(map(_error, runs.error, runs.floor)), half=0.5 * (runs.high - runs.low) / runs.low,
        sure=runs.guaranteed & runs.solved, lower=runs.lower.where(runs.guaranteed),
        upper=runs.upper.where(runs.guaranteed),
    )  # fmt: skip
    least = measures.least_of(shown)
    tables: dict[str, DataFrame | Grid] = {
        "costs": measures.compared_of(costs),
        "least": least.assign(shown=list(map(_error, least.lasting, least.floor))),
        "intervals": measures.intervals_of(shown), "failures": shown[~shown.solved],
        "missing": Grid("", ("code", "how to get it"), [(_code(key), CODES[key].remedy) for key in missing(runs)]),
    }  # fmt: skip
    for friction, here in by_friction(shown):
        name, bracket = slug(friction), here.code == BRACKET
        tables[f"costs-{name}"] = costs[costs.friction == friction]
        if here.bounded.any():
            tables[f"beside-{name}"] = _told(measures.beside_of(here))
        tables[f"brackets-{name}"] = here[bracket]
        tables[f"rows-{name}"] = here[~bracket]
    return tables


def _error(error: float, floor: float) -> str:
    """An error; one that is not resolved as what it is at most."""
    return f"{'' if error != error or error > floor else '≤ '}{scientific(measures.at_most(error, floor))}"


def _told(beside: DataFrame) -> DataFrame:
    """Forces of other codes in words, and that they are outside the interval if they are."""
    wrong = {key: (beside[key] < beside.low) | (beside[key] > beside.high) for key in OTHERS}
    return beside.assign(**{key: beside[key].map(force) + wrong[key].map({True: ", outside", False: ""})
                            for key in OTHERS})  # fmt: skip


def settings_of(runs: DataFrame, known: Mapping[float, Reference]) -> list[Grid]:
    """Values that errors are relative to, models with the memory of their processes before a case, and meshes."""
    return [_references(known), _models(runs), _meshes(runs)]


def _references(known: Mapping[float, Reference]) -> Grid:
    rows = [
        (f"{friction:g}", force(each.value), scientific(each.uncertainty), scientific(each.floor), each.source)
        for friction, each in known.items()
    ]
    headings = ("μ", "P/2 [N/mm]", "±", "smallest error resolved", "from")
    return Grid("Values that errors are relative to", headings, rows)


def _models(runs: DataFrame) -> Grid:
    rows = []
    for name, found in runs.sort_values("order", kind="stable").groupby("model", sort=False):
        model, said = NAMED[str(name)], sorted(set(found.version.dropna()) - {""})
        options = ", ".join(f"{option} = {value}" for option, value in model.options.items()) or NOTHING
        taken = memory(found.before.dropna().median())
        rows.append((model.name, CODES[model.code].name, ", ".join(said) or NOTHING, options, taken))
    headings = ("model", "code", "version, as it says", "options", "memory with its libraries")
    return Grid("Models", headings, rows)


def _meshes(runs: DataFrame) -> Grid:
    rows = []
    for name, family in FAMILIES.items():
        numbers = sorted(set(runs[runs.mesh == name].number))
        told = [f"{each} (each cell {shrinking(each):g} of the one before it)" if name == "graded" else str(each)
                for each in numbers]  # fmt: skip
        if numbers:
            rows.append((name, family.reading, listing(told)))
    return Grid("Meshes", ("family", "what it is", "cells a side, or levels"), rows)


def report(rows: Sequence[Row]) -> Document:
    """The report of these rows; the same rows give the same report."""
    runs = measures.runs_of(rows)
    known, costs = measures.known_of(runs), measures.costs_of(runs)
    pictures = figures(runs, known)
    values = {
        **measures.values_of(runs, costs), "resolution": RESOLUTION, "codes": CODES,
        "command": _command(runs, rows[0].case["repetitions"]),
        "places": [_place(friction, here, known, pictures) for friction, here in by_friction(runs)],
    }  # fmt: skip
    tables, settings = tables_of(runs, costs, known), [*settings_of(runs, known), *environment_grids(rows)]
    return render("comparisons.peers", "peers", values, tables, pictures, settings, forms=FORMS)


def _command(runs: DataFrame, repetitions: int) -> str:
    """The command that measures the same, without the place of its files and of other Pythons."""
    counted = runs.mesh.isin([name for name, family in FAMILIES.items() if family.counted])
    words = ["python -m comparisons peers --friction", *(f"{friction:g}" for friction in runs.friction.unique())]
    words += ["--cells", *map(str, sorted(set(runs.number[counted])))] if counted.any() else []
    words += [f"--levels {max(runs.number[~counted]) + 1}"] if not counted.all() else []
    return " ".join([*words, f"--repeat {repetitions}"])


def _place(
    friction: float, here: DataFrame, known: Mapping[float, Reference], pictures: Mapping[str, str]
) -> dict[str, Any]:
    """What there is to be said of one μ."""
    name = slug(friction)
    return {
        "friction": friction, "name": name, "known": known.get(friction), "bounded": bool(here.bounded.any()),
        "errors": f"best-time-{name}" in pictures, "brackets": f"bounds-{name}" in pictures,
        "doubtful": measures.contradictory(here),
        "intervals": f"intervals-{name}" in pictures, "slips": not {COULOMB, "ONE_SENSE"}.isdisjoint(here.kind),
        "indicated": bool((here.solved & here.width.notna() & here.low.isna()).any()),
    }  # fmt: skip


def document_of(rows: Sequence[Row], report: Document) -> dict[str, Any]:
    """Values, runs and findings as one document."""
    runs = measures.runs_of(rows)
    return {
        "schema": SCHEMA,
        "units": {"half_force": "N/mm", "seconds": "s, processor time", "memory": "bytes"},
        "references": [
            {"friction": friction, **each._asdict(), "floor": each.floor}
            for friction, each in measures.known_of(runs).items()
        ],
        "missing": missing(runs),
        "rows": [_run(run) for run in runs.astype(object).where(runs.notna(), None).to_dict("records")],
        "findings": findings_of(report.text),
    }


def _run(run: Mapping[Any, Any]) -> dict[str, Any]:
    """A run in plain values."""
    names = ("model", "code", "mesh", "friction", "number", "status", "message", *NUMBERS, "setup", "solve", "seconds",
             "spread", "version", "error")  # fmt: skip
    bounds = {name: run[name] for name in (*BOUNDS, "guaranteed", "kind")} if run["kind"] else None
    return {**{name: run[name] for name in names}, "bounds": bounds}
