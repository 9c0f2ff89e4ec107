"""Pictures of the manual: of problems what is posed, and what comes out beside what is known of it; of a run its rows.

Bodies are drawn with loads, supports and contacts on coarse meshes. Results are graphs, which stand beside the rows of
their problem, see `shown`.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from comparisons.lab.drawing import grid, legend_below
from comparisons.verification.rows import Kind
from qvi_contact import ContactLine, ContactProblem, solve
from qvi_contact.basics.checks import FloatArray
from qvi_contact.companion import CompanionContact, solve_companion
from qvi_contact.plots import BLUE, GREEN, GREY, ORANGE, VERMILLION, problem_figure
from qvi_contact.plots.style import new_figure
from qvi_contact.units import Units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH, _HEIGHT, _LINE = 4.2, 2.7, 0.17  # of a picture without its legend, of a line of that [inch]
_MARKS: Final = 45  # of a curve at most
_KNOWN: Final = ("solid", "dashed", "dashdot", "dotted")
_OURS: Final = ((BLUE, "o"), (VERMILLION, "s"), (GREEN, "^"), (ORANGE, "D"))
_BROKEN: Final = "broken off"
_LOOKS: Final = {
    Kind.ANALYTIC: (BLUE, "o"), Kind.PUBLISHED: (ORANGE, "s"), Kind.EXTERNAL: (VERMILLION, "^"),
    Kind.METHODS: (GREEN, "D"), _BROKEN: (GREY, "P"),
}  # fmt: skip
_LEAST, _MOST = 1e-4, 1e2  # error over tolerance: what lies beyond is drawn on the edge


class Curve(NamedTuple):
    """Values y at places x, (n,) each, and what they are."""

    label: str
    x: FloatArray
    y: FloatArray


class Graph(NamedTuple):
    """A result beside what is known of it.

    Attributes
    ----------
    x, y : str
        Labels of the axes, with units.
    ours : sequence of Curve
        What was computed, drawn as marks.
    known : sequence of Curve
        What it should be, drawn as lines.
    logarithmic : bool
        Both axes.

    """

    x: str
    y: str
    ours: Sequence[Curve]
    known: Sequence[Curve]
    logarithmic: bool = False


_Make = Callable[[bool], Graph]


class Exhibit(NamedTuple):
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

    def body(self) -> "Figure":
        """The picture of the problem."""
        return problem_figure(self.posed(), self.units)

    def result(self, quick: bool) -> "Figure":
        """The picture of its result."""
        return figure(self.graph(quick))


EXHIBITS: Final[dict[str, Exhibit]] = {}
"""Name of a problem of the manual → what is shown of it."""


def shown(name: str, posed: Callable[[], ContactProblem], units: Units | None = None) -> Callable[[_Make], _Make]:
    """Make a graph that of the result of a problem of the manual."""

    def known(graph: _Make) -> _Make:
        EXHIBITS[name] = Exhibit(posed, units, graph)
        return graph

    return known


_Values = Callable[[ContactLine | CompanionContact], FloatArray]


def curves_of_both(
    problem: ContactProblem, contact: str, along: _Values, values: Mapping[str, _Values]
) -> tuple[list[Curve], list[Curve]]:
    """Values along a contact, by their names: of stresses, and of displacements on the same triangles."""
    ours, theirs = solve(problem, degree=4).contacts[contact], solve_companion(problem).contacts[contact]
    return (
        [Curve(f"{name}, stresses", along(ours), value(ours)) for name, value in values.items()],
        [Curve(f"{name}, displacements", along(theirs), value(theirs)) for name, value in values.items()],
    )


def figure(graph: Graph) -> "Figure":
    """The picture of a graph, narrow enough for a small screen."""
    found = new_figure(_WIDTH, _HEIGHT + _LINE * (len(graph.known) + len(graph.ours)))
    axes, scale = found.subplots(), "log" if graph.logarithmic else "linear"
    axes.set(xscale=scale, yscale=scale, xlabel=graph.x, ylabel=graph.y)
    for curve, style in zip(graph.known, _KNOWN, strict=False):
        order = np.argsort(curve.x, kind="stable")
        axes.plot(curve.x[order], curve.y[order], color=GREY, linestyle=style, linewidth=1.2, label=curve.label)
    for curve, (colour, marker) in zip(graph.ours, _OURS, strict=False):
        order = np.argsort(curve.x, kind="stable")[:: -(-len(curve.x) // _MARKS)]
        look: dict[str, Any] = {"markerfacecolor": "none", "markersize": 4, "linestyle": "none", "label": curve.label}
        axes.plot(curve.x[order], curve.y[order], color=colour, marker=marker, **look)
    grid(axes)
    axes.set_axisbelow(True)
    legend_below(found, 1, 9)
    return found


def overview(problems: Sequence[dict[str, Any]]) -> "Figure":
    """One line for each problem, one mark for each row; left of 1 is within the tolerance."""
    from pandas import DataFrame

    rows = DataFrame([{**row, "line": line} for line, each in enumerate(problems) for row in each["rows"]])
    rows["place"] = rows.ratio.astype(float).fillna(_MOST).clip(_LEAST, _MOST)
    figure = new_figure(9.0, 1.4 + _LINE * len(problems))
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


def conservation(rows: Sequence[dict[str, Any]]) -> "Figure":
    """What each model leaves of the forces and moments on a body: rounding, or its error."""
    names = list(dict.fromkeys(row["quantity"].split(", ")[0] for row in rows))
    figure = new_figure(_WIDTH, 1.3 + _LINE * len(names))
    axes = figure.subplots()
    for model, colour, marker in (("stresses", BLUE, "o"), ("displacements", VERMILLION, "s")):
        shown = [row for row in rows if f", {model}:" in row["quantity"] and row["ours"] is not None]
        x = [max(row["ours"], 1e-17) for row in shown]  # nothing at all is drawn too
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
