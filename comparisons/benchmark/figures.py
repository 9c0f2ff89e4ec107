"""The picture of a run: times against unknowns, and errors against times."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Final

from qvi_contact.plots import BLUE, GREEN, GREY, ORANGE, VERMILLION
from qvi_contact.plots.style import PURPLE, SKY, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Document = dict[str, Any]
Line = tuple[str, list[tuple[float, float]]]

_LOOKS: Final = ((BLUE, "o", "-"), (VERMILLION, "s", "-"), (SKY, "D", "--"), (GREEN, "v", "--"))
_LOOP_LOOKS: Final = ((ORANGE, "^", ":"), (PURPLE, "P", ":"), (GREY, "x", ":"), ("black", "+", ":"), (GREEN, "1", ":"))
_PEER_LOOKS: Final = ((GREY, "v"), (PURPLE, "^"), (GREEN, "s"))


def picture(document: Document, friction: float) -> "Figure":
    """Left: seconds against unknowns at one friction; right: error of P/2 against seconds on graded meshes."""
    from matplotlib.ticker import NullFormatter

    figure = new_figure(11.0, 4.8)
    left, right = figure.subplots(1, 2)
    _draw(left, list(_times(document, friction)), _LOOKS)
    _draw(left, list(_loops(document)), _LOOP_LOOKS)
    left.set_title(f"Compressed plate, μ = {friction:g}, {_threads(document)}: medians")
    left.set_xlabel("unknowns [-]")
    left.set_ylabel("wall time [s]")
    _draw(right, list(_graded(document)), _LOOKS)
    _peers(right, document)
    right.set_title("Accuracy for its cost, one thread")
    right.set_xlabel("wall time [s]")
    right.set_ylabel("relative error of P/2 [-]")
    for axes in (left, right):
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.grid(visible=True, which="major", color="#dddddd", linewidth=0.5)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=7)
    return figure


def _threads(document: Document) -> str:
    count = document["threads"]
    return f"{count} thread{'s' if count > 1 else ''}"


def _times(document: Document, friction: float) -> Iterator[Line]:
    """Whole solves less assembly, by path, and plain factorisations."""
    rows = [row for row in document["solves"] if row["friction"] == friction and row["status"] == "solved"]
    for path in dict.fromkeys(row["path"] for row in rows):
        chosen = [row for row in rows if row["path"] == path]
        label = f"whole solve, {chosen[0]['library'].split(',')[0]}"
        yield label, [(row["unknowns"], row["solve"]) for row in chosen if row["solve"]]
    fastest = [(row["unknowns"], row["fastest_factorisation"]) for row in rows if row["path"] == rows[0]["path"]]
    yield "one plain factorisation, fastest", [(size, seconds) for size, seconds in fastest if seconds]


def _loops(document: Document) -> Iterator[Line]:
    """Loops that ended with a certificate."""
    for name in dict.fromkeys(row["name"] for row in document["loops"]):
        rows = [row for row in document["loops"] if row["name"] == name and row["status"] == "solved"]
        yield name, [(row["unknowns"], row["solve"]) for row in rows if row["solve"]]


def _graded(document: Document) -> Iterator[Line]:
    for mu in dict.fromkeys(row["friction"] for row in document["graded"]):
        rows = [row for row in document["graded"] if row["friction"] == mu and row["whole"] and row["error"]]
        yield f"graded meshes, μ = {mu:g}", [(row["whole"], row["error"]) for row in rows]


def _peers(axes: "Axes", document: Document) -> None:
    codes = dict.fromkeys(row["code"] for row in document["peers"])
    for (colour, marker), code in zip(_PEER_LOOKS, codes, strict=True):
        rows = [row for row in document["peers"] if row["code"] == code and row["error"]]
        axes.plot([row["seconds"] for row in rows], [row["error"] for row in rows], color=colour, marker=marker,
                  markerfacecolor="white", linestyle="none", label=f"{code}, μ = 0.2 (reported)")  # fmt: skip


def _draw(axes: "Axes", lines: Sequence[Line], looks: Sequence[tuple[str, str, str]]) -> None:
    for (colour, marker, style), (label, points) in zip(looks, lines, strict=False):
        if points:
            x, y = zip(*points, strict=True)
            axes.plot(x, y, color=colour, marker=marker, linestyle=style, markersize=5, label=label)
