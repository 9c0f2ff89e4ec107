"""The report of the wild problems, from the stored rows alone."""

from collections.abc import Sequence

from pandas import DataFrame, crosstab

from comparisons.lab.report import Document, environment_grids, render
from comparisons.lab.report.numbers import seconds
from comparisons.lab.study import Row
from comparisons.wild.measures import ORDER, problems_of, values_of
from comparisons.wild.study import NAME, OPEN


def report(rows: Sequence[Row]) -> Document:
    """The report; the same rows give the same one."""
    problems = problems_of(rows)
    named = problems.assign(problem=problems.family + " " + problems.number.astype(str))
    tables = {
        "outcomes": _outcomes(problems), "troubles": named[named.trouble | named.slow],
        "open": named[named.outcome == OPEN],
    }  # fmt: skip
    forms = {"seconds": lambda value: seconds(value, 2)}
    settings = environment_grids(rows)
    return render("comparisons.wild", NAME, values_of(problems), tables, {}, settings, forms=forms)


def _outcomes(problems: DataFrame) -> DataFrame:
    """One line a family: how many problems, and how many of each outcome; seconds of the slowest."""
    counts = crosstab(problems.family, problems.outcome).reindex(problems.family.unique(), columns=ORDER, fill_value=0)
    families = problems.groupby("family")
    return counts.assign(problems=families.size(), seconds=families.seconds.max()).reset_index()
