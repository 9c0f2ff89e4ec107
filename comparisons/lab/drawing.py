"""Pictures of reports: figures with panels, legends, grids and ticks."""

from collections.abc import Callable
from typing import Any, Final

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from qvi_contact.plots.style import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILLION, new_figure, settings, svg_text

LOOKS: Final = (
    (BLUE, "o", "-"), (VERMILLION, "s", "--"), (GREEN, "^", "-."), (ORANGE, "D", ":"), (PURPLE, "v", "-"),
    (SKY, "P", "--"), (GREY, "X", "-."),
)  # fmt: skip
"""Colour, marker and line style of the curves of a figure, in their order."""


def drawn(name: str, draw: Callable[[], Figure | None]) -> str:
    """The figure that `draw` makes, as SVG with `name` in its identifiers; empty where there is nothing to draw."""
    with settings():
        figure = draw()
        return "" if figure is None else svg_text(figure, name)


def panelled(number: int, width: float, height: float, beside: float) -> tuple[Figure, list[Axes]]:
    """A figure with `number` panels in rows of two, each row `height` high, and `beside` more for the legend [inch]."""
    columns = max(min(2, number), 1)
    rows = max(1, -(-number // columns))
    figure = new_figure(width, beside + height * rows)
    panels = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
    for spare in panels[number:]:
        spare.set_visible(False)
    return figure, panels[:number]


def legend_below(figure: Figure, columns: int = 4) -> None:
    """One legend for all panels, each label once; none without labels."""
    handles: dict[str, Artist] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    if handles:
        texts = {"ncols": columns, "fontsize": 8, "frameon": False}
        figure.legend(list(handles.values()), list(handles), loc="outside lower center", **texts)


def grid(axes: Axes) -> None:
    """Thin lines at the labelled values."""
    axes.grid(visible=True, which="major", color="#dddddd", linewidth=0.5)


def plain_ticks(*axes: Any) -> None:
    """1, 2 and 5 of each decade as plain numbers: quicker to read, and to draw, than powers of ten."""
    for axis in axes:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
