"""The tables of both reports: what makes texts of their columns, and what stands in them besides the measures."""

from typing import Any, Final

from pandas import DataFrame

from comparisons.benchmark.reference import CONVERGED_FRICTION, MEANINGLESS, PEERS, settled_error
from comparisons.lab.report.numbers import NOTHING, fixed, listing, memory, percent, scientific, seconds, significant
from comparisons.lab.tables import Form


def _cells(value: float) -> str:
    return NOTHING if value != value else f"{value:.0f}²"


def _error(value: float | None) -> str:
    """An error of P/2; one below what displacement codes agree to means nothing."""
    return f"< {scientific(MEANINGLESS, 1)}" if value is not None and value < MEANINGLESS else scientific(value)


_TIMES: Final = ("assembly", "solve", "factorisation", "interior_point", "certificate", "rest", "analysis", "numeric",
                 "plain", "whole", "seconds")  # fmt: skip
_POWERS: Final = {"solve": "power", "whole": "power_with_assembly"}
_COMMON: Final[dict[str, Form]] = {
    **dict.fromkeys(_TIMES, seconds), **dict.fromkeys(("friction", "load", "grading"), fixed("g")), "peak": memory,
    **dict.fromkeys(("unknowns", "iterations", "corrections", "runs", "contact_points", "blocks"), fixed(".0f")),
    "accuracy": scientific,
    **dict.fromkeys((*_POWERS.values(), "own_factorisation", "fastest_factorisation"), fixed(".2f")),
}  # fmt: skip

FORMS: Final[dict[str, Form]] = {
    **_COMMON, **dict.fromkeys(("cells", "from", "to"), _cells), "spread": percent, "imports": memory,
    **dict.fromkeys(("ratio_own", "ratio_fastest"), fixed(".2f")), "more": fixed(".0f"), "met": listing,
    "half_force": fixed(".8f"), "force": fixed(".5f"), "error": _error, "ratio": lambda value: significant(value, 4),
    **dict.fromkeys(("half_force_error", "half_force_difference"), scientific),
}  # fmt: skip
"""Column of the tables on the plate → how its values read."""

WALL_FORMS: Final[dict[str, Form]] = {
    **_COMMON, **dict.fromkeys(("from", "to"), fixed(".0f")), "ratio": fixed(".1f"),
    "message": lambda text: text or NOTHING,
}  # fmt: skip
"""The same of the tables on walls."""


def tables_of(frames: dict[str, Any]) -> dict[str, DataFrame]:
    """The tables of the plate by name."""
    solves, rounded = frames["solves"], {"half_force": "force"}
    return {
        "times-table": solves, "answers": solves, **{name: frames[name] for name in ("plain", "memory", "loops")},
        "growth": frames["growth"].rename(columns=_POWERS),
        **{name: frames[name].rename(columns=rounded) for name in ("graded", "peers")},
    }  # fmt: skip


def wall_tables(walls: DataFrame, growth: DataFrame) -> dict[str, DataFrame]:
    """The tables of the walls by name."""
    return {"walls": walls, "growth": growth.rename(columns=_POWERS)}


def peers() -> DataFrame:
    """Runs of other codes, with their errors."""
    reported = DataFrame(PEERS)
    return reported.assign(
        cells=reported.cells.astype(float), error=[settled_error(each.half_force, CONVERGED_FRICTION) for each in PEERS]
    )
