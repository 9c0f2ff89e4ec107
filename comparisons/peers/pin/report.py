"""The report of a run, computed from its rows alone: as a document, and as JSON."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from comparisons.lab.report import Document, environment_grids, findings_of, render
from comparisons.lab.report.numbers import NOTHING, scientific
from comparisons.lab.study import Row
from comparisons.lab.tables import Grid
from comparisons.peers.pin.study import MEASURED, MODELS

SCHEMA: Final = "qvi-contact/peers-pin/1"

PUBLISHED: Final = (
    ("SSNP156 A, elements of 4 nodes", 0.72092, 0.71799),
    ("SSNP156 B, elements of 8 nodes", 0.73924, 0.73617),
)
"""u_x [mm] on the axis at the hole by Code_Aster, μ = 0.1, 820 quadrilaterals: small strain, finite strain."""

_OWN: Final = "triangles"


def report(rows: Sequence[Row]) -> Document:
    """The report of these rows; the same rows give the same report."""
    runs = _runs(rows)
    values = {"command": _command(runs), "apart": _apart(runs), "finite": _finite(runs)}
    tables = {
        "numbers": _numbers(runs),
        "published": Grid("", ("test, mesh", "small strain [mm]", "finite strain [mm]"),
                          [(name, f"{small:.5f}", f"{finite:.5f}") for name, small, finite in PUBLISHED]),
    }  # fmt: skip
    return render("comparisons.peers.pin", "peers-pin", values, tables, {}, environment_grids(rows))


def document_of(rows: Sequence[Row], report: Document) -> dict[str, Any]:
    """Numbers and findings as one document."""
    runs = _runs(rows)
    return {"schema": SCHEMA, "measured": dict(MEASURED), "rows": runs, "findings": findings_of(report.text)}


def _runs(rows: Sequence[Row]) -> list[dict[str, Any]]:
    return [_run(row) for row in sorted(rows, key=lambda row: row.position)]


def _run(row: Row) -> dict[str, Any]:
    result = row.result if row.status == "done" else {"status": row.status, "message": row.reason}
    names = ("status", "message", *MEASURED, "unknowns", "residual")
    return {**{name: row.case[name] for name in ("friction", "sectors", "model")},
            **{name: result.get(name) for name in names}}  # fmt: skip


def _small(run: Mapping[str, Any]) -> bool:
    """Whether it is solved, with small strains."""
    return run["status"] == "solved" and not MODELS[run["model"]][2].get("finite", False)


def _apart(runs: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """By μ, on the finest mesh: u_x of this package, and the largest distance of another code from it, relative."""
    found = []
    for friction in dict.fromkeys(run["friction"] for run in runs):
        here = [run for run in runs if run["friction"] == friction and _small(run)]
        finest = max((run["sectors"] for run in here), default=0)
        here = [run for run in here if run["sectors"] == finest]
        own = [run["moved"] for run in here if MODELS[run["model"]][0] == _OWN]
        others = [run["moved"] for run in here if MODELS[run["model"]][0] != _OWN]
        if own and others:
            apart = [abs(other / own[0] - 1.0) for other in others]
            found.append(
                {"friction": friction, "sectors": finest, "moved": own[0], "least": min(apart), "worst": max(apart)}
            )
    return found


def _finite(runs: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """By μ, on the finest mesh: by what finite strain changes u_x, relative."""
    found = []
    for run in runs:
        code, module, options = MODELS[run["model"]]
        if run["status"] != "solved" or not options.get("finite", False):
            continue
        plain = (code, module, {name: value for name, value in options.items() if name != "finite"})
        for other in runs:
            same = all(other[name] == run[name] for name in ("friction", "sectors"))
            if same and _small(other) and MODELS[other["model"]] == plain:
                found.append({"friction": run["friction"], "sectors": run["sectors"],
                              "change": run["moved"] / other["moved"] - 1.0})  # fmt: skip
    finest = max((each["sectors"] for each in found), default=0)
    return [each for each in found if each["sectors"] == finest]


def _numbers(runs: Sequence[Mapping[str, Any]]) -> Grid:
    headings = ("μ", "edges in a quarter", "model", "status", *MEASURED.values(), "unknowns", "residual")
    rows = [
        (f"{run['friction']:g}", str(run["sectors"]), run["model"], run["message"] or run["status"],
         *(NOTHING if run[name] is None else f"{run[name]:.7g}" for name in MEASURED),
         NOTHING if run["unknowns"] is None else str(run["unknowns"]),
         NOTHING if run["residual"] is None else scientific(run["residual"], 1))
        for run in runs
    ]  # fmt: skip
    return Grid("", headings, rows)


def _command(runs: Sequence[Mapping[str, Any]]) -> str:
    """The command that measures the same, without the place of its files and of other Pythons."""
    frictions, sectors = (dict.fromkeys(run[name] for run in runs) for name in ("friction", "sectors"))
    words = ["python -m comparisons peers --problem pin --friction", *(f"{each:g}" for each in frictions)]
    return " ".join([*words, "--cells", *map(str, sectors)])
