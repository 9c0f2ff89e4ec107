"""The picture of a run: error over tolerance of every row."""

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

_LOOKS: Final = {
    Kind.ANALYTIC.value: (BLUE, "o"),
    Kind.PUBLISHED.value: (ORANGE, "s"),
    Kind.EXTERNAL.value: (VERMILLION, "^"),
    Kind.METHODS.value: (GREEN, "D"),
    None: (GREY, "P"),
}
_NARROW: Final = 4.2  # width of a picture for a small screen [inch]
_ROUNDING: Final = 1e-17  # imbalances below are drawn here
_LEAST, _MOST = 1e-4, 1e2  # what lies beyond is drawn on the edge


def overview(document: Document) -> "Figure":
    """One line for each problem, one mark for each row; left of 1 is within the tolerance."""
    problems = list(problems_of(document))
    figure = new_figure(9.0, 1.4 + 0.17 * len(problems))
    axes = figure.subplots()
    for kind, (colour, marker) in _LOOKS.items():
        _marks(axes, problems, kind, colour, marker)
    _failures(axes, problems)
    axes.axvline(1.0, color="black", linewidth=1.0)
    axes.set_xscale("log")
    axes.set_xlim(_LEAST / 1.5, _MOST * 1.5)
    axes.set_yticks(range(len(problems)), [problem["name"] for problem in problems])
    axes.set_ylim(len(problems) - 0.5, -0.5)
    axes.set_xlabel("error / tolerance [-]; marks on the edges lie on or beyond them")
    grid(axes)
    axes.set_axisbelow(True)
    figure.legend(loc="outside upper center", ncols=6, frameon=False)
    return figure


def conservation(document: Document) -> "Figure":
    """For each problem in balance what stresses and displacements leave on a body, over the forces around it."""
    rows = [row for problem in problems_of(document) if problem["name"] == "conservation" for row in problem["rows"]]
    names = list(dict.fromkeys(row["quantity"].split(", ")[0] for row in rows))
    figure = new_figure(_NARROW, 1.3 + 0.17 * len(names))
    axes = figure.subplots()
    for model, colour, marker in (("stresses", BLUE, "o"), ("displacements", VERMILLION, "s")):
        shown = [row for row in rows if f", {model}:" in row["quantity"] and row["ours"] is not None]
        x = [max(row["ours"], _ROUNDING) for row in shown]
        y = [names.index(row["quantity"].split(", ")[0]) for row in shown]
        axes.plot(x, y, color=colour, marker=marker, linestyle="none", markerfacecolor="none", label=model)
    axes.set_xscale("log")
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlabel("imbalance / forces [-]")
    grid(axes)
    axes.set_axisbelow(True)
    legend_below(figure, 2, 9)
    return figure


def _marks(axes: "Axes", problems: list[Document], kind: str | None, colour: str, marker: str) -> None:
    points = [
        (_place(row), line) for line, problem in enumerate(problems) for row in problem["rows"] if row["kind"] == kind
    ]
    if points:
        x, y = zip(*points, strict=True)
        label = kind or "broken off"
        look: dict[str, Any] = {"color": colour, "marker": marker, "linestyle": "none", "markerfacecolor": "none"}
        axes.plot(x, y, markersize=5, label=label, **look)


def _failures(axes: "Axes", problems: list[Document]) -> None:
    points = [
        (_place(row), line) for line, problem in enumerate(problems) for row in problem["rows"] if not row["passed"]
    ]
    if points:
        x, y = zip(*points, strict=True)
        axes.plot(x, y, color="black", marker="x", linestyle="none", markersize=9, label="failed")


def _place(row: Document) -> float:
    ratio = _MOST if row["ratio"] is None else row["ratio"]
    return float(min(max(ratio, _LEAST), _MOST))
