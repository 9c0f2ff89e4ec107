"""The picture of a run: errors against unknowns, and against time."""

from typing import TYPE_CHECKING, Any

from comparisons.peers.models import MODELS
from qvi_contact.plots import GREY
from qvi_contact.plots.style import new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Document = dict[str, Any]


def drawable(document: Document) -> list[dict[str, Any]]:
    """The frictions with a settled value."""
    return [settled for settled in document["settled"] if settled["half_force"] is not None]


def picture(document: Document) -> "Figure":
    """For each friction with a settled value a line of two: errors against unknowns, and against set-up and solve."""
    lines = drawable(document)
    figure = new_figure(11.0, 0.9 + 3.9 * len(lines))
    panels = figure.subplots(len(lines), 2, squeeze=False)
    for (left, right), settled in zip(panels, lines, strict=True):
        for axes, key, label in ((left, "unknowns", "unknowns [-]"), (right, "whole", "set-up and solve [s]")):
            _curves(axes, document, settled, key)
            axes.set_xlabel(label)
            axes.set_ylabel("relative error of P/2 [-]")
            axes.set_title(f"μ = {settled['friction']:g}, one thread", fontsize=9)
    handles: dict[str, Any] = {}
    for axes in panels.flat:
        handles |= dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    return figure


def _curves(axes: "Axes", document: Document, settled: dict[str, Any], key: str) -> None:
    """A curve for each model that has an error, and the band in which errors mean nothing."""
    from matplotlib.ticker import NullFormatter

    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.xaxis.set_minor_formatter(NullFormatter())
    floor, lowest = settled["meaningless"], settled["meaningless"]
    for model in MODELS:
        rows = [r for r in document["rows"] if r["model"] == model.name and r["friction"] == settled["friction"]]
        points = [(row[key], row["error"]) for row in rows if row["error"]]
        if not points:
            continue
        x, y = zip(*points, strict=True)
        lowest = min(lowest, *y)
        filling = model.colour if model.mesh == "uniform" else "white"
        axes.plot(x, y, color=model.colour, marker=model.marker, linestyle=model.line, markerfacecolor=filling,
                  markersize=6, linewidth=1.2, label=model.name)  # fmt: skip
    bottom = lowest / 3.0
    axes.axhspan(bottom, floor, color=GREY, alpha=0.2, linewidth=0, label="uncertainty of the settled value")
    axes.set_ylim(bottom=bottom)
    axes.grid(visible=True, which="major", color="#dddddd", linewidth=0.5)
