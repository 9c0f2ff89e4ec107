"""Pictures of reports, drawn where matplotlib is installed."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from qvi_contact.plots import has_matplotlib
from qvi_contact.plots.inline import svg_text
from qvi_contact.plots.style import settings

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def drawn(name: str, draw: "Callable[[], Figure | None]") -> str:
    """The figure that `draw` makes, as SVG with `name` in its identifiers.

    Empty where matplotlib is not installed, or there is nothing to draw.
    """
    if not has_matplotlib():
        return ""
    with settings():
        figure = draw()
        return "" if figure is None else svg_text(figure, name)
