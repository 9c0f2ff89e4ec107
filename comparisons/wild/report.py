"""The report of the wild problems, from the stored rows alone."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from comparisons.lab.report import Document, environment_grids, render
from comparisons.lab.report.numbers import seconds
from comparisons.lab.study import Row
from comparisons.lab.tables import Grid, grid_of
from comparisons.wild.generator import FAMILIES
from comparisons.wild.measures import ORDER, counts_of, problems_of, values_of
from comparisons.wild.study import NAME, OPEN

if TYPE_CHECKING:
    from pandas import DataFrame


def report(rows: Sequence[Row]) -> Document:
    """The report; the same rows give the same one."""
    problems = problems_of(rows)
    named = problems.assign(problem=problems.family + " " + problems.number.astype(str), time=problems.seconds)
    bad, unanswered = named[named.trouble | named.slow], named[named.outcome == OPEN]
    time = {"time": lambda value: seconds(value, 2)}
    tables = {
        "outcomes": _outcomes(problems),
        "troubles": grid_of(bad, ("problem", "status", "outcome", "time", "reason"), time),
        "open": grid_of(unanswered, ("problem", "status", "time", "reason"), time),
    }
    return render("comparisons.wild", NAME, values_of(problems), tables, {}, environment_grids(rows))


def _outcomes(problems: "DataFrame") -> Grid:
    rows = [
        (family, str(len(chosen)), *map(str, counts_of(chosen).values()), seconds(chosen.seconds.max(), 2))
        for family in FAMILIES
        if len(chosen := problems[problems.family == family])
    ]
    return Grid("", ("family", "problems", *ORDER, "slowest"), rows)
