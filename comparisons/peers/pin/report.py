"""The report of a run, computed from its rows alone: as a document, and as JSON."""

from collections.abc import Sequence
from typing import Any, Final

from pandas import DataFrame

from comparisons.lab.report import Document, environment_grids, findings_of, render
from comparisons.lab.report.numbers import count, fixed, scientific
from comparisons.lab.study import Row, frame_of
from comparisons.lab.tables import Grid
from comparisons.peers.pin.study import FINITE, MEASURED, OWN

SCHEMA: Final = "qvi-contact/peers-pin/1"

PUBLISHED: Final = (
    ("SSNP156 A, elements of 4 nodes", "0.72092", "0.71799"),
    ("SSNP156 B, elements of 8 nodes", "0.73924", "0.73617"),
)
"""u_x [mm] on the axis at the hole by Code_Aster, μ = 0.1, 820 quadrilaterals: small strain, finite strain."""

_COLUMNS: Final = ("friction", "sectors", "model", "status", "message", *MEASURED, "unknowns", "residual")
_FORMS: Final[dict[str, Any]] = {
    "friction": "{:g}".format, **dict.fromkeys(MEASURED, fixed(".7g")), "unknowns": count,
    "residual": lambda value: scientific(value, 1),
}  # fmt: skip


def report(rows: Sequence[Row]) -> Document:
    """The report of these rows; the same rows give the same report."""
    runs = _runs(rows)
    values = {"command": _command(runs), "apart": _apart(runs), "finite": _finite(runs)}
    tables = {
        "numbers": runs.assign(ended=runs.message.where(runs.message != "", runs.status)),
        "published": Grid("", ("test, mesh", "small strain [mm]", "finite strain [mm]"), PUBLISHED),
    }
    return render("comparisons.peers.pin", "peers-pin", values, tables, {}, environment_grids(rows), forms=_FORMS)


def document_of(rows: Sequence[Row], report: Document) -> dict[str, Any]:
    """Numbers and findings as one document."""
    runs = _runs(rows)[[*_COLUMNS]].astype(object)
    told = runs.where(runs.notna(), None).to_dict("records")
    return {"schema": SCHEMA, "measured": dict(MEASURED), "rows": told, "findings": findings_of(report.text)}


def _runs(rows: Sequence[Row]) -> DataFrame:
    """One line a run, with plain, the same model with small strain, and finest, whether it is on the finest mesh."""
    runs = frame_of(rows, (*MEASURED, "residual"), ("message", "unknowns"))
    runs["message"] = runs.message.where(runs.has, runs.reason)
    runs["plain"] = runs.model.str.removesuffix(FINITE)
    return runs


def _solved(runs: DataFrame, *, finite: bool) -> DataFrame:
    """The solved runs with small or with finite strain, on the finest mesh of each μ that has any."""
    found = runs[(runs.status == "solved") & ((runs.plain != runs.model) == finite)]
    return found[found.sectors == found.groupby("friction").sectors.transform("max")]


def _apart(runs: DataFrame) -> list[dict[str, Any]]:
    """By μ: u_x of this package, and the smallest and largest distance of another code from it, relative."""
    found = []
    for friction, here in _solved(runs, finite=False).groupby("friction", sort=False):
        own, others = here[here.model == OWN], here[here.model != OWN]
        if len(own) and len(others):
            moved = own.moved.iloc[0]
            apart = (others.moved / moved - 1.0).abs()
            found.append({"friction": friction, "sectors": own.sectors.iloc[0], "moved": moved, "least": apart.min(),
                          "worst": apart.max()})  # fmt: skip
    return found


def _finite(runs: DataFrame) -> list[dict[str, Any]]:
    """By μ: by what finite strain changes u_x, relative."""
    key = ["friction", "sectors", "plain"]
    both = _solved(runs, finite=True).merge(runs[runs.status == "solved"], left_on=key, right_on=[*key[:2], "model"])
    return [{"friction": each.friction, "change": each.moved_x / each.moved_y - 1.0} for each in both.itertuples()]


def _command(runs: DataFrame) -> str:
    """The command that measures the same, without the place of its files and of other Pythons."""
    words = ["python -m comparisons peers --problem pin --friction", *(f"{each:g}" for each in runs.friction.unique())]
    return " ".join([*words, "--cells", *map(str, runs.sectors.unique())])
