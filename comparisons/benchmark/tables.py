"""The tables of both reports, declared by their columns."""

from typing import Any, Final

from pandas import DataFrame

from comparisons.benchmark.measures import wall_growth
from comparisons.benchmark.reference import CONVERGED_FRICTION, MEANINGLESS, PEERS, settled_error
from comparisons.lab.report.numbers import NOTHING, fixed, listing, memory, percent, scientific, seconds, significant
from comparisons.lab.tables import Columns, Form, Grid, grid_of

_COUNT: Final = fixed(".0f")


def _cells(value: float) -> str:
    return NOTHING if value != value else f"{value:.0f}²"


def _error(value: float | None) -> str:
    """An error of P/2; one below what displacement codes agree to means nothing."""
    return f"< {scientific(MEANINGLESS, 1)}" if value is not None and value < MEANINGLESS else scientific(value)


def _same(form: Form, *names: str) -> Columns:
    """Columns of one form, each headed by its name."""
    return {name: (name.replace("_", " "), form) for name in names}


_CELLS: Final[Columns] = _same(_cells, "cells")
_FRICTION: Final[Columns] = {"friction": ("μ", fixed("g"))}
_ENDS: Final[Columns] = _same(_cells, "from", "to")
_TIMES: Final[Columns] = {
    **_CELLS, "path": "path", **_FRICTION, **_same(seconds, "assembly", "solve"), "spread": ("spread", percent),
    **_same(seconds, "factorisation", "interior_point", "certificate", "rest"),
    "ratio_own": ("solve over own", fixed(".2f")), "ratio_fastest": ("over fastest", fixed(".2f")),
    "fastest": "fastest", "runs": ("runs", _COUNT),
}  # fmt: skip
_ANSWERS: Final[Columns] = {
    **_CELLS, "path": "path", **_FRICTION, **_same(_COUNT, "unknowns"), "status": "status",
    **_same(_COUNT, "iterations", "corrections"), "half_force": ("P/2 [N/mm]", fixed(".8f")),
    "half_force_error": ("error of P/2", scientific), "accuracy": ("residual", scientific),
}  # fmt: skip
_PLAIN: Final[Columns] = {
    **_CELLS, "path": "beside", "backend": "library", "version": "version", **_same(seconds, "analysis", "numeric"),
    "plain": ("together", seconds), "runs": "runs", "message": "remark",
}  # fmt: skip
_MEMORY: Final[Columns] = {
    **_CELLS, "path": "path", "peak": ("peak", memory), "imports": ("before", memory),
    "more": ("more, by unknown [bytes]", _COUNT),
}  # fmt: skip
_POWER: Final = fixed(".2f")
_GROWTH: Final[Columns] = {
    "path": "path", **_FRICTION, **_ENDS, "solve": ("solve", _POWER), "whole": ("with assembly", _POWER),
    **_same(_POWER, "own_factorisation", "fastest_factorisation"),
}  # fmt: skip
_LOOPS: Final[Columns] = {
    **_CELLS, "loop": "method", **_FRICTION, "status": "status", **_same(_COUNT, "iterations"),
    "solve": ("solve", seconds), "ratio": ("over condensed", lambda value: significant(value, 4)),
    "half_force_difference": ("difference in P", scientific), "message": "remark",
}  # fmt: skip
_GRADED: Final[Columns] = {
    **_CELLS, "grading": ("grading", fixed("g")), **_FRICTION, **_same(_COUNT, "unknowns"), "status": "status",
    "half_force": ("P/2 [N/mm]", fixed(".5f")), "error": ("error", _error), "whole": ("time", seconds),
    "runs": "runs", "met": ("meets", listing),
}  # fmt: skip
_PEERS: Final[Columns] = {
    "code": "code", **_CELLS, "half_force": ("P/2 [N/mm]", fixed(".5f")), "error": ("error", _error),
    "seconds": ("reported time", seconds),
}  # fmt: skip
_WALLS: Final[Columns] = {
    "blocks": ("blocks a side", _COUNT), "load": ("load", fixed("g")), "contact_points": ("points", _COUNT),
    **_same(_COUNT, "unknowns"), "status": "status", "form": "unknowns kept", **_same(_COUNT, "iterations"),
    "accuracy": ("residual", scientific), **_same(seconds, "assembly", "solve"),
    "factorisation": ("factorisation of K", seconds), "ratio": ("solve over factorisation", fixed(".1f")),
    "peak": ("memory", memory), "message": ("remark", lambda text: text or NOTHING),
}  # fmt: skip
_WALL_GROWTH: Final[Columns] = {
    "load": ("load", fixed("g")), **_same(_COUNT, "from", "to"), "solve": ("exponent", _POWER),
}  # fmt: skip


def tables_of(frames: dict[str, Any]) -> dict[str, Grid]:
    """The tables of the plate by name."""
    return {
        "times-table": grid_of(frames["solves"], _TIMES), "answers": grid_of(frames["solves"], _ANSWERS),
        "plain": grid_of(frames["plain"], _PLAIN), "memory": grid_of(frames["memory"], _MEMORY),
        "growth": grid_of(frames["growth"], _GROWTH), "loops": grid_of(frames["loops"], _LOOPS),
        "graded": grid_of(frames["graded"], _GRADED), "peers": grid_of(frames["peers"], _PEERS),
    }  # fmt: skip


def peers() -> DataFrame:
    """Runs of other codes, with their errors."""
    reported = DataFrame(PEERS)
    return reported.assign(
        cells=reported.cells.astype(float), error=[settled_error(each.half_force, CONVERGED_FRICTION) for each in PEERS]
    )


def wall_tables(walls: DataFrame) -> dict[str, Grid]:
    """The tables of the walls by name."""
    return {"walls": grid_of(walls, _WALLS), "growth": grid_of(wall_growth(walls), _WALL_GROWTH)}
