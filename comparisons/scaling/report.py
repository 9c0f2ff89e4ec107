"""The report of the study, from its rows alone: one line for each number of processes, and the numbers of sentences."""

from collections.abc import Sequence
from typing import Any, Final

from pandas import DataFrame

from comparisons.lab.report import Document, environment_grids, render
from comparisons.lab.report.numbers import percent, seconds, significant
from comparisons.lab.study import Row, frame_of
from comparisons.lab.tables import Form

_TAKEN = ("first", "whole", "used", "values", "solved", "cores")
_FORMS: Final[dict[str, Form]] = {
    **dict.fromkeys(("whole", "first", "used"), seconds), **dict.fromkeys(("rate", "load", "speed"), significant),
    "efficiency": percent, "solved": "{:.0f}".format,
}  # fmt: skip


def report(rows: Sequence[Row], quick: bool = False) -> Document:
    """The report; the same rows give the same report."""
    found = scaling_of(rows)
    return render(
        "comparisons.scaling", "scaling-quick" if quick else "scaling", {"quick": quick, **values_of(found)},
        {"runs": found}, {}, environment_grids(rows), forms=_FORMS,
    )  # fmt: skip


def scaling_of(rows: Sequence[Row]) -> DataFrame:
    """One line for each number of processes, means of its repeats.

    Columns are processes, first, whole and used [s], see `study.run`, values, solved (in the worst repeat), cores, load
    (programs that wanted to run when it began, in the mean of the minute before), rate [1/s], speed and work, over
    those of the fewest processes, and efficiency, the speed over the processes that it takes.
    """
    loads = [row.load_average for row in sorted(rows, key=lambda row: row.position)]
    runs = frame_of(rows, numbers=_TAKEN).assign(load=loads).groupby("processes")
    found = runs[[*_TAKEN, "load"]].mean().assign(solved=runs.solved.min()).reset_index()
    least = found.iloc[0]
    rate, speed = found["values"] / found.whole, least.whole / found.whole
    efficiency = speed * least.processes / found.processes
    return found.assign(rate=rate, speed=speed, work=found.used / least.used, efficiency=efficiency)


def values_of(found: DataFrame) -> dict[str, Any]:
    """The numbers in sentences."""
    few, many = found.iloc[0], found.iloc[-1]
    return {
        "few": int(few.processes), "many": int(many.processes), "cores": int(many.cores),
        "values": int(many["values"]), "solved": int(found.solved.min()),
        "speed": float(many.speed), "efficiency": float(many.efficiency), "work": float(many.work),
        "rate": float(many.rate), "each": float(few.used / few["values"]), "first": float(many["first"]),
        "load": float(found.load.max()),
    }  # fmt: skip
