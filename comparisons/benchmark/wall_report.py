"""The report on walls, from its document alone."""

from collections.abc import Mapping
from typing import Any, Final

from comparisons.benchmark.report import settings
from comparisons.benchmark.tables import COUNT, Form, grid, known
from comparisons.lab.report import Document as Report
from comparisons.lab.report import render
from comparisons.lab.report.numbers import seconds

_LARGEST_RATIO: Final = {0.02: 20.0, 0.3: 45.0}
"""By load: what a whole solve should take at most, in factorisations of K."""

_LARGEST_EXPONENT: Final = 1.3


def report(document: dict[str, Any]) -> Report:
    """The report; the same document gives the same one."""
    tables = {"walls": grid(document["walls"], _WALLS, _FORMS), "growth": grid(document["growth"], _GROWTH, _FORMS)}
    values = {**document, "targets": [_target(document, load) for load in _LARGEST_RATIO], "most": _LARGEST_EXPONENT}
    return render(
        "comparisons.benchmark", "benchmark-wall", values, tables, {}, [settings(document)], template="wall.md"
    )


def _target(document: dict[str, Any], load: float) -> dict[str, Any]:
    """The largest ratio and exponent of one load beside what they should be."""
    ratios = [row["ratio"] for row in document["walls"] if row["load"] == load and row["ratio"] is not None]
    powers = [row["exponent"] for row in document["growth"] if row["load"] == load and row["exponent"] is not None]
    worst, steepest = max(ratios, default=None), max(powers, default=None)
    return {
        "load": load, "ratio": worst, "most": _LARGEST_RATIO[load], "exponent": steepest,
        "met": worst is not None and worst <= _LARGEST_RATIO[load],
    }  # fmt: skip


_WALLS: Final = {
    "blocks": "blocks a side", "load": "load", "contact_points": "points", "unknowns": "unknowns", "status": "status",
    "form": "unknowns kept", "iterations": "iterations", "accuracy": "residual", "assembly": "assembly",
    "solve": "solve", "factorisation": "factorisation of K", "ratio": "solve over factorisation", "peak": "memory",
    "message": "remark",
}  # fmt: skip
_GROWTH: Final = {"load": "load", "from": "from", "to": "to", "exponent": "exponent"}
_FORMS: Final[Mapping[str, Form]] = {
    **dict.fromkeys(("blocks", "contact_points", "from", "to"), COUNT), "load": known("g"), "solve": seconds,
    "ratio": known(".1f"), "exponent": known(".2f"),
}  # fmt: skip
