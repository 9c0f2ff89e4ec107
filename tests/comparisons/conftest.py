"""Pictures without the time it takes to lay them out and to write them, for tests of what is drawn."""

import html

import numpy as np
import pytest

from comparisons.lab.report import drawing

_DECIMALS = 9  # rounding differs from call to call


def outline(figure, name):
    """The texts of a figure, and the data of its lines and marks; no picture."""
    texts, data = [text.get_text() for text in figure.texts], []
    for axes in figure.axes:
        texts += [axes.get_title(), axes.get_xlabel(), axes.get_ylabel(), *(text.get_text() for text in axes.texts)]
        data += [line.get_xydata() for line in axes.lines] + [each.get_offsets() for each in axes.collections]
    legends = [*figure.legends, *filter(None, (axes.get_legend() for axes in figure.axes))]
    texts += [text.get_text() for legend in legends for text in legend.get_texts()]
    elements = "".join(f"<text>{html.escape(text)}</text>" for text in texts if text)
    numbers = [np.round(points, _DECIMALS).tolist() for points in data]
    return f"<svg><title>{name}</title>{elements}<desc>{numbers}</desc></svg>\n"


@pytest.fixture
def outlined(monkeypatch):
    """Pictures as outlines, see there; whether they are drawn well is seen where they are written."""
    monkeypatch.setattr(drawing, "svg_text", outline)
