"""Colours, line styles, texts and files of all pictures, also inside pages.

Colours are from the Okabe-Ito palette, and colour maps are safe for colour-blind readers. Line styles, hatching and
markers repeat what colours show.
"""

import html
import io
import os
import re
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias
from urllib.parse import quote

import numpy as np

from qvi_contact.basics.checks import FloatArray, instance_of
from qvi_contact.basics.writing import check_suffix, replacing
from qvi_contact.errors import InputError
from qvi_contact.mesh.edges import Edges, points_along
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.units import Units
from solvers.basics.types import load

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

BLUE, ORANGE, GREEN, GREY, VERMILLION = "#0072B2", "#E69F00", "#009E73", "#666666", "#D55E00"
PURPLE, SKY = "#CC79A7", "#56B4E9"

CHORDS: Final = 8  # chords by which an arc is drawn, and every other edge of a mesh that has arcs
LONGEST: Final = 0.08  # largest drawn displacement, as a share of the body's length
LEAST: Final = 1e-5  # displacements below this share of the problem's displacement scale are not magnified further

_SETTINGS: Final[Any] = {  # the last one writes × 10⁷ beside an axis, not 1e7
    "svg.hashsalt": "qvi-contact", "font.size": 9, "hatch.linewidth": 0.5, "axes.formatter.use_mathtext": True,
}  # fmt: skip
_METADATA: Final[dict[str, dict[str, None]]] = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
"""Suffix → metadata of the file. Dates are left out, so that the same picture gives the same bytes."""
_DOTS: Final = {"files": 150.0, "pages": 120.0}  # pixels per inch
_DOLLAR: Final = re.compile(r"(?<!\\)\$")  # a dollar sign that is not escaped


def require_matplotlib() -> None:
    """Raise `InputError` with the command to type if matplotlib is missing, and name a wrong MPLBACKEND."""
    if find_spec("matplotlib") is None:
        raise InputError("plot", "matplotlib", "pictures need matplotlib: python -m pip install matplotlib")
    try:
        load("matplotlib")
    except ValueError as error:
        remedy = "matplotlib has no such back end: unset this environment variable, pictures in files need none"
        raise InputError("MPLBACKEND", os.environ.get("MPLBACKEND"), remedy) from error


@contextmanager
def settings() -> Iterator[None]:
    """Matplotlib has the settings of this package inside the block only."""
    require_matplotlib()
    from matplotlib import rc_context

    with rc_context(_SETTINGS):
        yield


def new_figure(width: float, height: float) -> "Figure":
    """An empty figure of this size [inch] that needs no screen; call it inside ``settings()``."""
    from matplotlib.figure import Figure

    return Figure((width, height), dpi=_DOTS["files"], layout="constrained")  # texts are measured as they are drawn


def save_figure(path: str | Path, figure: "Figure") -> None:
    """Write a figure of matplotlib to a PNG, SVG or PDF file, by the suffix, whole or not at all.

    An earlier file of that name is replaced. `InputError` if the suffix is another one, or the file cannot be written.
    """
    suffix = check_suffix("plot", path, *_METADATA)
    require_matplotlib()
    instance_of(load("matplotlib.figure").Figure, "figure", figure, "give a figure of matplotlib")
    with settings(), replacing(path) as temporary:
        figure.savefig(temporary, format=suffix[1:], dpi=_DOTS["files"], metadata=_METADATA[suffix])


def plain_text(text: str) -> str:
    """The text with its dollar signs escaped: matplotlib reads text between two of them as a formula."""
    instance_of(str, "title", text, "give a text")
    return _DOLLAR.sub(r"\\$", text)


def plain_units(units: Units | None) -> Units:
    """The units with dollar signs in their names escaped; `Units()` for None."""
    Units.labels(units, {})  # raises if these are no units
    named = units or Units()
    return Units(plain_text(named.length), plain_text(named.stress))


def cell_outlines(mesh: TriangleMesh) -> FloatArray:
    """Outlines of the cells, (cells, 3, 2) [length]; (cells, 3 CHORDS, 2) if the mesh has arcs."""
    chords = CHORDS if mesh.curved.any() else 1
    share = np.arange(chords)[:, None] / chords
    t = np.concatenate([(1.0 - share) * np.eye(3)[k] + share * np.eye(3)[k - 2] for k in range(3)])
    return np.asarray(mesh.placed(np.arange(mesh.cell_count), t) @ mesh.corners)


def edge_lines(mesh: TriangleMesh, edges: Edges) -> FloatArray:
    """Edges as lines (n, 2, 2) [length]; (n, CHORDS + 1, 2) if some of these edges are arcs."""
    return points_along(mesh.vertices, edges, np.linspace(0.0, 1.0, (CHORDS if edges.curved else 1) + 1))


def draw_grid(axes: "Axes", mesh: TriangleMesh) -> None:
    """Draw the edges between cells in light grey; small cells have thinner lines."""
    box, (across, up) = axes.get_window_extent(), np.ptp(mesh.vertices, axis=0).tolist()
    points = 72.0 / axes.figure.dpi * min(box.width / across, box.height / up)  # printer's points per unit of length
    median = np.median(np.concatenate([mesh.interior.length, mesh.boundary.length]))
    width = float(np.clip(0.05 * median * points, 0.1, 0.6))
    axes.add_collection(lines(edge_lines(mesh, mesh.interior), "#cccccc", "solid", width))


def draw_outline(axes: "Axes", mesh: TriangleMesh, colour: str = GREY, width: float = 0.8) -> None:
    """Draw the body's boundary as a thin line."""
    axes.add_collection(lines(edge_lines(mesh, mesh.boundary), colour, "solid", width))


def show_all(axes: "Axes", points: FloatArray, units: Units) -> FloatArray:
    """Fit labelled axes with equal scales around points (n, 2); returns the corners of the box (2, 2)."""
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.02 * float((high - low).max())
    axes.set_aspect("equal")
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.locator_params(nbins=6)
    axes.set_xlabel(f"x [{units.length}]")
    axes.set_ylabel(f"y [{units.length}]")
    axes.spines[["top", "right"]].set_visible(False)
    return np.array([low - margin, high + margin])


def magnified(largest: float, length: float) -> float:
    """Factor, 1, 2 or 5 times a power of ten, that keeps the largest displacement within `LONGEST` of the length."""
    return rounded_down(LONGEST * length / largest)


def rounded_down(value: float) -> float:
    """The largest number of the form 1, 2 or 5 times a power of ten up to a positive value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= value * (1 + 1e-12)))


def lines(points: FloatArray, colour: str, style: object, width: float, label: str | None = None) -> "LineCollection":
    """Line segments or chains of points (n, k, 2) as one artist."""
    from matplotlib.collections import LineCollection

    return LineCollection(list(points), colors=colour, linestyles=[style], linewidths=width, label=label)


def legend_below(axes: "Axes", shown: "Sequence[Axes]", columns: int) -> None:
    """Add a legend of all that the axes `shown` show, each label once, below the horizontal axis of `axes`."""
    handles = dict(pair[::-1] for other in shown for pair in zip(*other.get_legend_handles_labels(), strict=True))
    place: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "borderaxespad": 4.4}
    look: dict[str, Any] = {"frameon": False, "columnspacing": 1.2, "handlelength": 1.8, "fontsize": "small"}
    axes.legend(handles=list(handles.values()), ncols=columns, **look, **place)


_WRAP: Final = 44  # characters in a line of the legend
_LONG: Final = 6  # numbers from 10⁶ on, or below 10⁻⁵, are written with a power of ten
_RAISED: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_NOISE: Final = 1e-12  # an end of a range below this share of the other end is rounding, and shown as 0


def value_range(name: str, values: FloatArray, unit: str) -> str:
    """A named quantity with the single value or the range of its values, and its unit."""
    ends = [float(values.min()), float(values.max())]
    rounding = _NOISE * max(map(abs, ends))
    numbers = dict.fromkeys(beside([0.0 if abs(end) <= rounding else end], 6)[0] for end in ends)  # equal ends once
    return f"{name} = {' … '.join(numbers)} {unit}".rstrip().replace(" ", "\xa0")  # kept on one line


def beside(values: Sequence[float], digits: int = 4) -> list[str]:
    """Numbers with the same last place, that of the largest one with so many digits; rounding noise becomes 0."""
    largest = max((abs(value) for value in values), default=0.0)
    rounded_up = float(f"{largest:.{digits - 1}e}")
    magnitude = int(np.floor(np.log10(rounded_up))) if 0.0 < rounded_up < np.inf else 0
    exponent = magnitude if abs(magnitude) >= _LONG else 0
    places = digits - 1 - magnitude + exponent
    rounded = np.round(np.divide(values, 10.0**exponent), places).tolist()
    texts = [f"{value + 0.0:.{max(places, 0)}f}".replace("-", "−") for value in rounded]
    texts = [text.rstrip("0").rstrip(".") if "." in text else text for text in texts]
    return [text + f" · 10{str(exponent).translate(_RAISED)}" * (exponent != 0 and text != "0") for text in texts]


def wrapped(text: str) -> str:
    """The text in lines short enough for a legend."""
    return plain_text(textwrap.fill(text, _WRAP, subsequent_indent="   ", break_on_hyphens=False))


_UPRIGHT: Final = 0.3  # component of a direction below which a text is centred along that axis
_OFF: Final = 4.0  # distance of a text from its point [printer's points]

Spot: TypeAlias = tuple[FloatArray, FloatArray]
"""A point (2,) [length] and the direction (2,) in which a text extends from it; a text is centred on it without one."""


class Labels:
    """Names and numbers in a picture, each with the spots that it may take; `drawn` are points (n, 2) to keep clear."""

    def __init__(self, axes: "Axes", drawn: Sequence[FloatArray] = ()) -> None:
        self.drawn = list(drawn)
        self._axes, self._texts = axes, list[tuple[Any, Sequence[Spot]]]()

    def write(self, text: str, spots: Sequence[Spot], **look: Any) -> None:
        """Write a text at the first of its spots; `fit` may move it to another one."""
        box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.7}
        given: dict[str, Any] = {"fontsize": "small", "zorder": 6, "bbox": box, "annotation_clip": False} | look
        lines = [plain_text(textwrap.fill(line, _WRAP)) for line in text.splitlines()]
        written = self._axes.annotate("\n".join(lines), (0.0, 0.0), (0.0, 0.0), textcoords="offset points", **given)
        self._texts.append((written, spots))
        _move(written, spots[0])

    def fit(self, box: FloatArray) -> FloatArray:
        """Move each text to the spot where it covers least of earlier texts, then of `drawn`.

        Returns the box (2, 2) [length], larger where it does not hold the texts with their white background.
        """
        figure = self._axes.get_figure(root=True)
        if figure is None or not self._texts:
            return box
        engine = figure.get_layout_engine()
        if engine is not None:  # the layout gives all sizes; drawing would take twice as long
            engine.execute(figure)
        self._axes.apply_aspect()
        points, boxes = self._axes.transData.transform(np.concatenate([np.empty((0, 2)), *self.drawn])), list[Any]()
        for text, spots in self._texts:

            def covered(spot: Spot, text: Any = text) -> tuple[int, int]:
                _move(text, spot)
                extent = text.get_window_extent().padded(3.0)  # with its white background
                inside = ((points > extent.min) & (points < extent.max)).all(axis=1)
                return sum(map(extent.overlaps, boxes)), int(inside.sum())

            _move(text, min(spots, key=covered))
            boxes.append(text.get_window_extent().padded(3.0))
            low, high = self._axes.transData.inverted().transform(boxes[-1].get_points())
            margin = 0.01 * (box[1] - box[0])
            box = np.where([low < box[0], high > box[1]], [low - margin, high + margin], box)
        return box


def _move(text: Any, spot: Spot) -> None:
    """Move a text to a spot, aligned so that it extends in the direction of the spot."""
    text.xy, (x, y) = spot[0].tolist(), spot[1].tolist()
    text.set_position((_OFF * x, _OFF * y))
    text.set_ha("center" if abs(x) < _UPRIGHT else "left" if x > 0.0 else "right")
    text.set_va("center" if abs(y) < _UPRIGHT else "bottom" if y > 0.0 else "top")


_WIDTH: Final = re.compile(r'\swidth="([\d.]+)pt"')
_URL: Final = " !$'()*+,/:;=?@[]^`{|}~"  # characters that a data URL may have as they are
_READABLE: Final = 0.85  # least share of the natural size: exponents, 6.3 points, are then 7 pixels high
_PIXELS_PER_POINT: Final = 4.0 / 3.0


def png_bytes(figure: "Figure") -> bytes:
    """The figure as the bytes of a PNG file."""
    picture = io.BytesIO()
    with settings():
        figure.savefig(picture, format="png", dpi=_DOTS["pages"], metadata={"Software": None})
    return picture.getvalue()


def svg_text(figure: "Figure", name: str) -> str:
    """The figure, made by `new_figure`, as an SVG element with ids from `name`; the same data give the same bytes."""
    from matplotlib import rc_context

    with settings(), rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    svg = text.getvalue()
    return "\n".join(line.rstrip() for line in svg[svg.index("<svg") :].splitlines()) + "\n"


def inline_image(svg: str, label: str) -> str:
    """An SVG picture as an HTML image with its data inside; a least width keeps its text readable."""
    width = _WIDTH.search(svg)
    least = f' style="min-width: {_READABLE * _PIXELS_PER_POINT * float(width[1]):.0f}px"' if width else ""
    return f'<img src="data:image/svg+xml,{quote(svg, safe=_URL)}" alt="{html.escape(label)}"{least}>\n'
