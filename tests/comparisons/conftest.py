"""What only the outside world can do: pictures without the time it takes to lay them out, and packages that miss."""

import html
from contextlib import contextmanager

import numpy as np
import pytest

_DECIMALS = 9  # rounding differs from call to call


def texts_of(figure):
    """Titles, labels, notes and legends of a figure."""
    texts = [text.get_text() for text in figure.texts]
    for axes in figure.axes:
        texts += [axes.get_title(), axes.get_xlabel(), axes.get_ylabel(), *(text.get_text() for text in axes.texts)]
    legends = [*figure.legends, *filter(None, (axes.get_legend() for axes in figure.axes))]
    return [text for text in [*texts, *(text.get_text() for each in legends for text in each.get_texts())] if text]


def outline(figure, file, **_):
    """Instead of `savefig`: the texts of a figure, and the data of its lines and marks; no picture."""
    data = []
    for axes in figure.axes:
        data += [line.get_xydata() for line in axes.lines] + [each.get_offsets() for each in axes.collections]
    elements = "".join(f"<text>{html.escape(text)}</text>" for text in texts_of(figure))
    numbers = [np.round(points, _DECIMALS).tolist() for points in data]
    file.write(f"<svg>{elements}<desc>{numbers}</desc></svg>\n")


@contextmanager
def outlines():
    """Pictures as outlines; whether they are drawn well is seen where they are written."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("matplotlib.figure.Figure.savefig", outline)
        patch.setattr("matplotlib.layout_engine.ConstrainedLayoutEngine.execute", lambda *_: None)
        yield


@pytest.fixture
def outlined():
    pytest.importorskip("matplotlib")
    with outlines():
        yield
