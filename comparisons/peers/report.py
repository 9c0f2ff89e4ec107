"""The report of a run, computed from its rows alone: as a document, and as JSON."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from pandas import DataFrame

from comparisons.lab.report import Document, environment_grids, findings_of, render
from comparisons.lab.study import Row
from comparisons.peers.codes.equilibrium import ONE_SENSE
from comparisons.peers.figures import figures
from comparisons.peers.measures import (
    BOUNDS,
    NUMBERS,
    RESOLUTION,
    Reference,
    by_friction,
    contradictory,
    costs_of,
    known_of,
    missing,
    runs_of,
    slug,
    values_of,
)
from comparisons.peers.meshes import FAMILIES
from comparisons.peers.models import CODES
from comparisons.peers.tables import FORMS, settings_of, tables_of

SCHEMA: Final = "qvi-contact/peers/4"


def report(rows: Sequence[Row]) -> Document:
    """The report of these rows; the same rows give the same report."""
    runs = runs_of(rows)
    known, costs = known_of(runs), costs_of(runs)
    pictures = figures(runs, known)
    values = {
        **values_of(runs, costs), "command": _command(runs, rows[0].case["repetitions"]), "resolution": RESOLUTION,
        "codes": CODES, "places": [_place(friction, here, known, pictures) for friction, here in by_friction(runs)],
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
        "doubtful": contradictory(here),
        "intervals": f"intervals-{name}" in pictures, "slips": ONE_SENSE in set(here.kind),
        "indicated": bool((here.solved & here.width.notna() & here.low.isna()).any()),
    }  # fmt: skip


def document_of(rows: Sequence[Row], report: Document) -> dict[str, Any]:
    """Values, runs and findings as one document."""
    runs = runs_of(rows)
    return {
        "schema": SCHEMA,
        "units": {"half_force": "N/mm", "seconds": "s, processor time", "memory": "bytes"},
        "references": [
            {"friction": friction, **each._asdict(), "floor": each.floor} for friction, each in known_of(runs).items()
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
