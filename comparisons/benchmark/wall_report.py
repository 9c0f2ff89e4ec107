"""The report on walls, from its document alone."""

from importlib.resources import files
from typing import Any, Final

from comparisons.benchmark.report import settings
from comparisons.lab.report import Document as Report
from comparisons.lab.report import fill
from comparisons.lab.report.numbers import NOTHING, memory, scientific, seconds
from comparisons.lab.tables import grid_of

_LARGEST_RATIO: Final = {0.02: 20.0, 0.3: 45.0}
"""By load: what a whole solve should take at most, in factorisations of K."""

_LARGEST_EXPONENT: Final = 1.3


def report(document: dict[str, Any]) -> Report:
    """The report; the same document gives the same one."""
    from pandas import DataFrame

    template = files("comparisons.benchmark").joinpath("wall.md").read_text(encoding="utf-8")
    headings = {"walls": _WALLS, "growth": _GROWTH}
    frames = {name: DataFrame(document[name], columns=list(named)) for name, named in headings.items()}
    tables = {name: grid_of(frames[name], named, _FORMS) for name, named in headings.items()}
    values = {**document, "targets": [_target(document, load) for load in _LARGEST_RATIO], "most": _LARGEST_EXPONENT}
    return fill(template, "benchmark-wall", values, tables, {}, [settings(document)])


def _target(document: dict[str, Any], load: float) -> dict[str, Any]:
    """The largest ratio and exponent of one load beside what they should be."""
    ratios = [row["ratio"] for row in document["walls"] if row["load"] == load and row["ratio"] is not None]
    powers = [row["exponent"] for row in document["growth"] if row["load"] == load and row["exponent"] is not None]
    worst, steepest = max(ratios, default=None), max(powers, default=None)
    return {
        "load": load, "ratio": worst, "most": _LARGEST_RATIO[load], "exponent": steepest,
        "met": worst is not None and worst <= _LARGEST_RATIO[load],
    }  # fmt: skip


def _number(form: str) -> Any:
    return lambda value: NOTHING if value is None or value != value else format(value, form)


def _text(value: object) -> str:
    """A text; beside other rows one that is missing is NaN."""
    return value if isinstance(value, str) and value else NOTHING


_WALLS: Final = {
    "blocks": "blocks a side", "load": "load", "contact_points": "points", "unknowns": "unknowns", "status": "status",
    "form": "unknowns kept", "iterations": "iterations", "accuracy": "residual", "assembly": "assembly",
    "solve": "solve", "factorisation": "factorisation of K", "ratio": "solve over factorisation", "peak": "memory",
    "message": "remark",
}  # fmt: skip
_GROWTH: Final = {"load": "load", "from": "from", "to": "to", "exponent": "exponent"}
_FORMS: Final = {
    **dict.fromkeys(("blocks", "contact_points", "unknowns", "iterations", "from", "to"), _number(".0f")),
    "load": _number("g"), "accuracy": scientific, "peak": memory, "ratio": _number(".1f"), "exponent": _number(".2f"),
    **dict.fromkeys(("assembly", "solve", "factorisation"), seconds),
    **dict.fromkeys(("status", "form", "message"), _text),
}  # fmt: skip
