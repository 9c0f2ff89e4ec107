"""The report of the study, from its rows alone."""

from collections.abc import Sequence
from typing import Final

from comparisons.lab.report import Document, environment_grids, render
from comparisons.lab.report.numbers import percent, seconds, significant
from comparisons.lab.study import Row
from comparisons.lab.tables import Columns, grid_of
from comparisons.scaling.measures import scaling_of, values_of

_HEADINGS: Final[Columns] = {
    "processes": "processes", "whole": ("time", seconds), "first": ("until the first row", seconds),
    "used": ("processor time", seconds), "rate": ("values per second", significant),
    "load": ("load before", significant), "speed": ("speed", significant), "efficiency": ("efficiency", percent),
    "solved": ("solved", "{:.0f}".format),
}  # fmt: skip


def report(rows: Sequence[Row], quick: bool = False) -> Document:
    """The report; the same rows give the same report."""
    found = scaling_of(rows)
    return render(
        "comparisons.scaling", "scaling-quick" if quick else "scaling", {"quick": quick, **values_of(found)},
        {"runs": grid_of(found, _HEADINGS)}, {}, environment_grids(rows),
    )  # fmt: skip
