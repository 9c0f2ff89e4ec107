"""The report of the estimates, from the stored rows alone."""

from collections.abc import Sequence

from pandas import DataFrame

from comparisons.estimates.measures import runs_of, values_of
from comparisons.estimates.study import NAME
from comparisons.lab.report import Document, environment_grids, render
from comparisons.lab.study import Row

_FORMS = dict.fromkeys(("target", "error", "off", "doubt"), "{:.1e}".format) | {"ratio": "{:.2f}".format}


def report(rows: Sequence[Row]) -> Document:
    """The report; the same rows give the same one."""
    runs = runs_of(rows)
    tables = {"kinds": _kinds(runs), "missed": runs[runs.judged & ~runs.held], "others": runs[~runs.judged]}
    return render(
        "comparisons.estimates", NAME, values_of(runs), tables, {}, environment_grids(rows),
        forms={**_FORMS, **dict.fromkeys(("q05", "q50", "q95"), "{:.2f}".format)},
    )  # fmt: skip


def _kinds(runs: DataFrame) -> DataFrame:
    """One line a kind of quantity and certainty: how many were judged and held, and quantiles of the ratio."""
    judged = runs[runs.judged].assign(kind=runs.quantity.str.rpartition(".")[2].str.replace("_", " "))
    groups = judged.groupby(["kind", "certainty"])
    found = groups.agg(judged=("held", "size"), held=("held", "sum"))
    quantiles = {f"q{level:02d}": groups.ratio.quantile(level / 100.0) for level in (5, 50, 95)}
    return found.assign(**quantiles).reset_index()
