"""The picture of a run: times against unknowns, and errors against times."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from pandas import DataFrame, Series

from comparisons.lab.report.drawing import grid
from qvi_contact.plots import BLUE, GREEN, GREY, ORANGE, VERMILLION
from qvi_contact.plots.style import PURPLE, SKY, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Line = tuple[Any, "Series[float]", "Series[float]"]

_LOOKS: Final = ((BLUE, "o", "-"), (VERMILLION, "s", "-"), (SKY, "D", "--"), (GREEN, "v", "--"))
_LOOP_LOOKS: Final = ((ORANGE, "^", ":"), (PURPLE, "P", ":"), (GREY, "x", ":"), ("black", "+", ":"), (GREEN, "1", ":"))
_PEER_LOOKS: Final = ((GREY, "v", "none"), (PURPLE, "^", "none"), (GREEN, "s", "none"))


def picture(frames: Mapping[str, "DataFrame"], friction: float | None, threads: int) -> "Figure | None":
    """Left: seconds against unknowns at one friction; right: error of P/2 against seconds on graded meshes."""
    if friction is None:
        return None
    solves = frames["solves"]
    figure = new_figure(11.0, 4.8)
    left, right = figure.subplots(1, 2)
    _draw(left, _times(solves[(solves.friction == friction) & (solves.status == "solved")]), _LOOKS)
    loops = frames["loops"]
    sure = loops.assign(solve=loops.solve.where(loops.status == "solved"))
    _draw(left, _by(sure, "loop", "unknowns", "solve"), _LOOP_LOOKS)
    left.set_title(f"Compressed plate, μ = {friction:g}, {threads} thread{'s' if threads > 1 else ''}: medians")
    _log_axes(left, "unknowns [-]", "wall time [s]")
    graded = _by(frames["graded"], "friction", "whole", "error")
    _draw(right, ((f"graded meshes, μ = {mu:g}", x, y) for mu, x, y in graded), _LOOKS)
    reported = (
        (f"{code}, μ = 0.2 (reported)", x, y) for code, x, y in _by(frames["peers"], "code", "seconds", "error")
    )
    _draw(right, reported, _PEER_LOOKS, markerfacecolor="white", markersize=6)
    right.set_title("Accuracy for its cost, one thread")
    _log_axes(right, "wall time [s]", "relative error of P/2 [-]")
    return figure


def _times(solved: DataFrame) -> Iterator[Line]:
    """Whole solves less assembly, by path, and plain factorisations."""
    paths = [found for _, found in solved.groupby("path", sort=False)]
    for found in paths:
        yield f"whole solve, {found.library.iloc[0].split(',')[0]}", found.unknowns, found.solve
    for found in paths[:1]:
        yield "one plain factorisation, fastest", found.unknowns, found.fastest_factorisation


def _by(frame: DataFrame, name: str, x: str, y: str) -> Iterator[Line]:
    """A line for each value of a column, of what a logarithmic axis can show."""
    for value, found in frame.groupby(name, sort=False):
        shown = found[found[y] > 0.0]
        yield value, shown[x], shown[y]


def _log_axes(axes: "Axes", x: str, y: str) -> None:
    """Both logarithmic, with a legend if there is something in it."""
    from matplotlib.ticker import NullFormatter

    axes.set(xscale="log", yscale="log", xlabel=x, ylabel=y)
    axes.xaxis.set_minor_formatter(NullFormatter())
    grid(axes)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=7)


def _draw(axes: "Axes", lines: Iterable[Line], looks: Sequence[tuple[str, str, str]], **more: Any) -> None:
    """Each line in its look, whether or not there is something to draw of those before it."""
    for (colour, marker, style), (label, x, y) in zip(looks, lines, strict=False):
        if len(y):
            axes.plot(x, y, color=colour, marker=marker, linestyle=style, label=label, **{"markersize": 5, **more})
