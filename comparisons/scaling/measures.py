"""One line for each number of processes, and the numbers of the report."""

from collections.abc import Sequence
from typing import Any

from pandas import DataFrame

from comparisons.lab.study import Row, frame_of

_TAKEN = ("first", "whole", "used", "values", "solved", "cores")


def scaling_of(rows: Sequence[Row]) -> DataFrame:
    """One line for each number of processes, means of its repeats.

    Columns are processes, first, whole and used [s], see `task.run`, values, solved (in the worst repeat), cores, load
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
