"""Pictures as text that is the same for the same data."""

import io
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def svg_text(figure: "Figure", name: str) -> str:
    """The figure as an SVG element, to be put into a page; the same bytes for the same data.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Made by `qvi_contact.plots.style.new_figure` inside ``settings()``.
    name : str
        A word that no other picture of the page has: it makes the ids of the two different.

    """
    from matplotlib import rc_context

    from qvi_contact.plots.style import settings

    with settings(), rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    whole = text.getvalue()
    return "\n".join(line.rstrip() for line in whole[whole.index("<svg") :].splitlines()) + "\n"
