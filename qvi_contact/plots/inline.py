"""Pictures inside pages and notebooks: no id twice, a name for those who cannot see them, a size that can be read."""

import html
import io
import re
from typing import TYPE_CHECKING, Final

from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.plots.style import has_matplotlib, laid_out, settings
from qvi_contact.problem.problem import ContactProblem

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TAG: Final = re.compile(r"<[A-Za-z][^<>]*>")
_ID: Final = re.compile(r"(?<=\sid=\")([^\"]*)")
_REFERENCE: Final = re.compile(r"(?<=url\(#)([^)]*)|(?<=href=\"#)([^\"]*)")
_WIDTH: Final = re.compile(r'\swidth="([\d.]+)pt"')
_STYLE_SHEET: Final = re.compile(r"(<style[^>]*>)\s*\*\s*\{")

_READABLE: Final = 0.85  # of the natural size; exponents of numbers, 6.3 points, are then 7 pixels high
_PIXELS_PER_POINT: Final = 4.0 / 3.0
_DOTS: Final = 120.0  # of pixels, an inch


def png_bytes(figure: "Figure") -> bytes:
    """The figure as pixels."""
    picture = io.BytesIO()
    with settings(), laid_out(figure, "png", _DOTS):
        figure.savefig(picture, format="png", dpi=_DOTS, metadata={"Software": None})
    return picture.getvalue()


def notebook_png(shown: TriangleMesh | ContactProblem) -> bytes | None:
    """What a notebook shows for a mesh or a problem at the end of a cell; None without matplotlib."""
    if not has_matplotlib():
        return None
    from qvi_contact.plots.figures import mesh_figure, problem_figure

    return png_bytes(problem_figure(shown) if isinstance(shown, ContactProblem) else mesh_figure(shown))


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

    with settings(), rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        text = io.StringIO()
        with laid_out(figure, "svg", figure.dpi):
            figure.savefig(text, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    whole = text.getvalue()
    return "\n".join(line.rstrip() for line in whole[whole.index("<svg") :].splitlines()) + "\n"


def inline_svg(svg: str, name: str, label: str) -> str:
    """The picture to be put into a page, as an image with a label.

    Matplotlib numbers its ids anew in each picture: each gets `name` and "--" in front, and so does each reference to
    it. A style sheet for all elements holds for those of the picture only. The least width keeps text readable.
    """

    def prefixed(tag: re.Match[str]) -> str:
        return _REFERENCE.sub(lambda match: f"{name}--{match[0]}", _ID.sub(rf"{name}--\1", tag[0]))

    def labelled(tag: re.Match[str]) -> str:
        width = _WIDTH.search(tag[0])
        least = f' style="min-width: {_READABLE * _PIXELS_PER_POINT * float(width[1]):.0f}px"' if width else ""
        start = f'<svg id="{name}--svg" role="img" aria-label="{html.escape(label)}"{least}'
        return start + tag[0].removeprefix("<svg")

    scoped = _STYLE_SHEET.sub(rf"\1#{name}--svg *{{", _TAG.sub(prefixed, svg))
    return _TAG.sub(labelled, scoped, count=1).rstrip() + "\n"
