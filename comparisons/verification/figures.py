"""Pictures of a run, from its rows: error over tolerance of all of them, and what bodies are out of balance by."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

from comparisons.lab.report.drawing import grid, legend_below
from comparisons.verification.row import Kind
from comparisons.verification.tables import problems_of
from qvi_contact.plots import BLUE, GREEN, GREY, ORANGE, VERMILLION
from qvi_contact.plots.style import new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Document = dict[str, Any]

_BROKEN: Final = "broken off"
_LOOKS: Final = {
    Kind.ANALYTIC: (BLUE, "o"), Kind.PUBLISHED: (ORANGE, "s"), Kind.EXTERNAL: (VERMILLION, "^"),
    Kind.METHODS: (GREEN, "D"), _BROKEN: (GREY, "P"),
}  # fmt: skip
_NARROW: Final = 4.2  # width of a picture for a small screen [inch]
_ROUNDING: Final = 1e-17  # imbalances below are drawn here
_LEAST, _MOST = 1e-4, 1e2  # what lies beyond is drawn on the edge


def overview(document: Document) -> "Figure":
    """One line for each problem, one mark for each row; left of 1 is within the tolerance."""
    from pandas import DataFrame

    problems = list(problems_of(document))
    rows = DataFrame([{**row, "line": line} for line, each in enumerate(problems) for row in each["rows"]])
    rows["place"] = rows.ratio.astype(float).fillna(_MOST).clip(_LEAST, _MOST)
    figure = new_figure(9.0, 1.4 + 0.17 * len(problems))
    axes = figure.subplots()
    kinds = rows.kind.fillna(_BROKEN)
    for kind, (colour, marker) in _LOOKS.items():
        if (chosen := rows[kinds == kind]).size:
            look: dict[str, Any] = {"marker": marker, "markerfacecolor": "none", "markersize": 5}
            axes.plot(chosen.place, chosen.line, color=colour, linestyle="none", label=str(kind), **look)
    if (failed := rows[~rows.passed]).size:
        axes.plot(failed.place, failed.line, "kx", markersize=9, label="failed")
    axes.axvline(1.0, color="black", linewidth=1.0)
    _line_by_line(axes, [each["name"] for each in problems])
    axes.set_xlim(_LEAST / 1.5, _MOST * 1.5)
    axes.set_xlabel("error / tolerance [-]; marks on the edges lie on or beyond them")
    figure.legend(loc="outside upper center", ncols=6, frameon=False)
    return figure


def conservation(document: Document) -> "Figure":
    """What each model leaves of the forces and moments on a body: rounding, or its error."""
    rows = [row for problem in problems_of(document) if problem["name"] == "conservation" for row in problem["rows"]]
    names = list(dict.fromkeys(row["quantity"].split(", ")[0] for row in rows))
    figure = new_figure(_NARROW, 1.3 + 0.17 * len(names))
    axes = figure.subplots()
    for model, colour, marker in (("stresses", BLUE, "o"), ("displacements", VERMILLION, "s")):
        shown = [row for row in rows if f", {model}:" in row["quantity"] and row["ours"] is not None]
        x = [max(row["ours"], _ROUNDING) for row in shown]
        y = [names.index(row["quantity"].split(", ")[0]) for row in shown]
        axes.plot(x, y, color=colour, marker=marker, linestyle="none", markerfacecolor="none", label=model)
    _line_by_line(axes, names)
    axes.set_xlabel("imbalance / forces [-]")
    legend_below(figure, 2, 9)
    return figure


def _line_by_line(axes: "Axes", names: Sequence[str]) -> None:
    """Logarithmic to the right, and downwards a line for each name."""
    axes.set_xscale("log")
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    grid(axes)
    axes.set_axisbelow(True)
