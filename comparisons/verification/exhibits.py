"""Pictures of the manual: of problems what is posed, and what comes out beside what is known of it; of a run its rows.

Bodies are drawn with loads, supports and contacts on coarse meshes. Results are graphs, which stand beside the rows of
their problem, see `shown`.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from comparisons.lab.report.drawing import drawn, grid, legend_below
from comparisons.verification.row import Kind
from comparisons.verification.tables import problems_of, table_name
from qvi_contact import ContactProblem
from qvi_contact.basics.checks import FloatArray
from qvi_contact.plots import BLUE, GREEN, GREY, ORANGE, VERMILLION, problem_figure
from qvi_contact.plots.style import new_figure
from qvi_contact.units import Units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Document = dict[str, Any]

_WIDTH, _HEIGHT, _LINE = 4.2, 2.7, 0.17  # of a picture without its legend, of a line of that [inch]
_MARKS: Final = 45  # of a curve at most
_KNOWN: Final = ("solid", "dashed", "dashdot", "dotted")
_OURS: Final = ((BLUE, "o"), (VERMILLION, "s"), (GREEN, "^"), (ORANGE, "D"))
_BROKEN: Final = "broken off"
_LOOKS: Final = {
    Kind.ANALYTIC: (BLUE, "o"), Kind.PUBLISHED: (ORANGE, "s"), Kind.EXTERNAL: (VERMILLION, "^"),
    Kind.METHODS: (GREEN, "D"), _BROKEN: (GREY, "P"),
}  # fmt: skip
_ROUNDING: Final = 1e-17  # imbalances below are drawn here
_LEAST, _MOST = 1e-4, 1e2  # what lies beyond is drawn on the edge

MM, SI, M = Units(length="mm", stress="MPa"), Units(length="m", stress="Pa"), Units(length="m", stress="MPa")


class Curve(NamedTuple):
    """Values y at places x, (n,) each, and what they are."""

    label: str
    x: FloatArray
    y: FloatArray

    def ordered(self) -> "Curve":
        """The same from the smallest x to the largest."""
        order = np.argsort(self.x, kind="stable")
        return Curve(self.label, self.x[order], self.y[order])

    def until(self, end: float) -> "Curve":
        """The part with x ≤ end."""
        near = self.x <= end
        return Curve(self.label, self.x[near], self.y[near])


@dataclass(frozen=True)
class Graph:
    """A result beside what is known of it.

    Attributes
    ----------
    x, y : str
        Labels of the axes, with units.
    ours : tuple of Curve
        What was computed, drawn as marks.
    known : tuple of Curve
        What it should be, drawn as lines.
    logarithmic : bool
        Both axes.

    """

    x: str
    y: str
    ours: tuple[Curve, ...]
    known: tuple[Curve, ...]
    logarithmic: bool = False


_Make = Callable[[bool], Graph]


@dataclass(frozen=True)
class Exhibit:
    """What the manual shows of a problem.

    Attributes
    ----------
    posed : function
        The problem on few cells.
    units : Units or None
        Of its picture; None where it has none.
    graph : function
        Its result, given True from a coarse mesh. Its docstring is the caption.

    """

    posed: Callable[[], ContactProblem]
    units: Units | None
    graph: _Make

    @property
    def caption(self) -> str:
        """What to see in the picture of the result."""
        return self.graph.__doc__ or ""

    def body(self) -> "Figure":
        """The picture of the problem."""
        return problem_figure(self.posed(), self.units)


EXHIBITS: Final[dict[str, Exhibit]] = {}
"""Name of a problem of the manual → what is shown of it."""


def shown(name: str, posed: Callable[[], ContactProblem], units: Units | None = None) -> Callable[[_Make], _Make]:
    """Make a graph that of the result of a problem of the manual."""

    def known(graph: _Make) -> _Make:
        EXHIBITS[name] = Exhibit(posed, units, graph)
        return graph

    return known


def pictures(names: Iterable[str]) -> dict[str, str]:
    """Name → picture, as SVG, of those of these problems that have one; empty where matplotlib is not installed."""
    return {name: drawn(f"verification-{table_name(name)}", EXHIBITS[name].body) for name in names if name in EXHIBITS}


def results(names: Iterable[str], quick: bool) -> dict[str, str]:
    """The same of their results."""
    return {
        name: drawn(f"result-{table_name(name)}", partial(_draw, name, quick)) for name in names if name in EXHIBITS
    }


def _draw(name: str, quick: bool) -> "Figure":
    return figure(EXHIBITS[name].graph(quick))


def figure(graph: Graph) -> "Figure":
    """The picture of a graph, narrow enough for a small screen."""
    found = new_figure(_WIDTH, _HEIGHT + _LINE * (len(graph.known) + len(graph.ours)))
    axes, scale = found.subplots(), "log" if graph.logarithmic else "linear"
    axes.set(xscale=scale, yscale=scale, xlabel=graph.x, ylabel=graph.y)
    for curve, style in zip(graph.known, _KNOWN, strict=False):
        axes.plot(curve.x, curve.y, color=GREY, linestyle=style, linewidth=1.2, label=curve.label)
    for curve, (colour, marker) in zip(graph.ours, _OURS, strict=False):
        _marks(axes, curve, colour, marker)
    grid(axes)
    axes.set_axisbelow(True)
    legend_below(found, 1, 9)
    return found


def _marks(axes: "Axes", curve: Curve, colour: str, marker: str) -> None:
    order = np.argsort(curve.x, kind="stable")[:: -(-len(curve.x) // _MARKS)]
    look = {"color": colour, "marker": marker, "markerfacecolor": "none", "markersize": 4, "linestyle": "none"}
    axes.plot(curve.x[order], curve.y[order], label=curve.label, **look)  # type: ignore[arg-type]


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
    figure = new_figure(_WIDTH, 1.3 + 0.17 * len(names))
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
