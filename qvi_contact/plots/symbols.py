"""What pictures of bodies are made of: runs of edges, ground hatching, springs, arrows; words and numbers."""

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeAlias

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.mesh.edges import Edges, angles, arc_offsets, chains, frames_along
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.plots.style import CHORDS, GREEN, lines, plain_text
from qvi_contact.problem.conditions import CARTESIAN, Condition, Displacement, Traction, components

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Text

_OBLIQUE: Final = 0.05  # sine of the angle to a side below which an arrow counts as lying along it
CORNER: Final = 0.64  # cosine of the angle, 50 degrees, by which edges of one run may turn
_ZIGZAG: Final = np.array([[0.0, 0.15, 0.25, 0.42, 0.58, 0.75, 0.85, 1.0], [0.0, 0.0, 0.3, -0.3, 0.3, -0.3, 0.0, 0.0]])
_STRAIGHT: Final = 1e-12  # 1 − cosine of the angle of edges that lie on one straight line


class Places(NamedTuple):
    """Points (n, 2) along a run [length], and outward unit normals and tangents, where two edges meet halfway."""

    points: FloatArray
    normals: FloatArray
    tangents: FloatArray


def between(at: FloatArray, s: FloatArray, values: FloatArray) -> FloatArray:
    """Values (k, 2) at places s (k,) along a line, at other places (n, 2)."""
    return np.column_stack([np.interp(at, s, each) for each in values.T])


def spaced(s: FloatArray, distance: float, least: int = 1) -> FloatArray:
    """Places about `distance` apart along a line from the first of s to the last, as far from them as half of that."""
    length = float(s[-1] - s[0])
    count = max(least, round(length / distance))
    return np.asarray(s[0] + (np.arange(count) + 0.5) / max(count, 1) * length)


class Run:
    """Adjoining edges without a corner between them: a straight side, or an arc as short pieces.

    The line has the ends of the edges (n + 1, 2) in the direction of their tangents [length]; normals (n, 2) point
    outwards. Edges turn by the angles (n,) [rad], 0 where they are straight, and are drawn as arcs of circles.
    """

    def __init__(self, line: FloatArray, normals: FloatArray, turns: FloatArray) -> None:
        self.line, self.normals, self._turns = line, normals, turns
        self._steps = np.diff(line, axis=0)
        self._lengths = np.hypot(*self._steps.T)
        self._tangents = self._steps / self._lengths[:, None]
        self._along = np.concatenate([[0.0], np.cumsum(self._lengths)])
        self.length = float(self._along[-1])

    def at(self, share: float) -> Places:
        """The place at a share of the length, 0 to 1."""
        return self._places(np.array([share * self.length]))

    def points(self, distance: float, least: int = 2) -> Places:
        """Points about `distance` apart, as far from the ends as half of that, at least `least`."""
        return self._places(spaced(self._along, distance, least))

    def ends_and_points(self, distance: float) -> Places:
        """Points about `distance` apart from end to end, at least both ends and those where the run turns."""
        turns = (self._tangents[1:] * self._tangents[:-1]).sum(axis=1) < 1.0 - _STRAIGHT
        even = np.linspace(0.0, self.length, max(1, round(self.length / distance)) + 1)
        return self._places(np.sort(np.concatenate([even, self._along[1:-1][turns]])))

    def _places(self, s: FloatArray) -> Places:
        last = len(self._lengths) - 1
        before, after = (np.clip(np.searchsorted(self._along, s, side) - 1, 0, last) for side in ("left", "right"))
        shares = (s - self._along[after]) / self._lengths[after]
        bends = np.column_stack([np.zeros(len(s)), self._turns[after] / 2.0])
        points = self.line[after] + arc_offsets(self._steps[after], bends, shares[:, None])[:, 0]
        middle = (values[before] + values[after] for values in (self.normals, self._tangents))
        return Places(points, *(vectors / np.hypot(*vectors.T)[:, None] for vectors in middle))


def runs(mesh: TriangleMesh, edges: Edges) -> list[Run]:
    """Edges joined to runs, which end in corners, in branches, and where the tangent changes its sense."""
    ends = np.column_stack([edges.first, edges.second])
    return [run for chain in chains(ends) for run in _runs_of(mesh, edges.take(chain))]


def _runs_of(mesh: TriangleMesh, edges: Edges) -> Iterator[Run]:
    """Runs of one line of edges."""
    following = edges.take(np.roll(np.arange(len(edges)), -1))
    onward, back = edges.second == following.first, edges.first == following.second
    facing, turn = (
        np.where(onward, (one[:, 1] * other[:, 0]).sum(axis=1), (one[:, 0] * other[:, 1]).sum(axis=1))
        for one, other in zip(*(frames_along(each, np.array([0.0, 1.0])) for each in (edges, following)), strict=True)
    )
    joined = (onward | back) & (turn > CORNER) & (facing > CORNER)
    if len(edges) < 3 or joined.all():  # no closed line, or one without a corner
        joined[-1] = False
    shift = int(np.argmin(joined)) + 1  # a closed line begins behind a corner
    order = np.roll(np.arange(len(edges)), -shift)
    for part in np.split(order, np.flatnonzero(~joined[order])[:-1] + 1):
        piece = edges.take(part if len(part) == 1 or onward[part[0]] else part[::-1])
        if piece.curved:  # as shorter ones, whose chords are near enough to be drawn
            t = np.linspace(0.0, 1.0, CHORDS + 1)
            points = np.stack(mesh.points_along(piece, t), axis=-1)
            line = np.concatenate([points[:, :-1].reshape(-1, 2), points[-1, -1:]])
            normals = frames_along(piece, (t[1:] + t[:-1]) / 2.0)[0].reshape(-1, 2)
            yield Run(line, normals, np.diff(angles(piece.bend, t), axis=1).ravel())
        else:
            yield Run(mesh.vertices[np.append(piece.first, piece.second[-1])], piece.normal, np.zeros(len(piece)))


def ground(axes: "Axes", line: FloatArray, normal: FloatArray, size: float) -> None:
    """Draw a rigid obstacle: a line of points (n, 2) and oblique strokes of a given size on its far side (n, 2)."""
    axes.plot(*line.T, color="black", linewidth=1.0)
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    begin, outward = (between(spaced(s, size), s, values) for values in (line, normal))
    sideways = np.column_stack([outward[:, 1], -outward[:, 0]])
    strokes = np.stack([begin, begin + 0.7 * size * (outward + sideways)], axis=1)
    axes.add_collection(lines(strokes, "black", "solid", 0.6))


def springs(axes: "Axes", start: FloatArray, end: FloatArray) -> None:
    """Draw springs between points (n, 2) as zigzag lines, none wider than the springs are apart."""
    along = end - start
    side = along[:, ::-1] * [-1.0, 1.0]
    if len(start) > 1:
        apart = np.median(np.hypot(*np.diff(start, axis=0).T))
        side /= np.maximum(np.hypot(*side.T)[:, None] / apart, 1.0)
    points = [start + share * along + across * side for share, across in _ZIGZAG.T]
    axes.add_collection(lines(np.stack(points, axis=1), GREEN, "solid", 1.0), autolim=False)


def arrows(axes: "Axes", places: Places, vectors: FloatArray, away: float, look: dict[str, Any]) -> FloatArray:
    """Draw vectors (n, 2) that act at places of a side, those of no length left out; both ends of all (2 k, 2).

    An arrow into the body ends at its point, one out of the body begins there; one along the side is centred, at the
    distance `away`.
    """
    size = np.hypot(*vectors.T)
    shown = size > 0.02 * size.max(initial=0.0)
    points, vectors, normals, size = places.points[shown], vectors[shown], places.normals[shown], size[shown]
    outward = ((vectors * normals).sum(axis=1) / size)[:, None]
    tails = np.where(outward < -_OBLIQUE, points - vectors, points)
    tails = np.where(np.abs(outward) <= _OBLIQUE, points - vectors / 2.0 + away * normals, tails)
    settings = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.005, "headwidth": 4.0, "zorder": 5}
    axes.quiver(*tails.T, *vectors.T, **{**settings, **look})
    return np.concatenate([tails, tails + vectors])


Spot: TypeAlias = tuple[FloatArray, dict[str, Any]]
"""Where a text may stand [length], and how it is aligned there."""

Written: TypeAlias = "tuple[Text, Sequence[Spot]]"
"""A text at the first of the spots that it may have."""

_WRAP: Final = 44  # characters in a line of the legend
_LONG: Final = 6  # powers of ten from which on numbers are written with them
_RAISED: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_NOISE: Final = 1e-12  # of the larger end of a range, below which the other one is 0
_UPRIGHT: Final = 0.3  # component of a normal below which a side counts as facing across it


def merged(conditions: Sequence[Condition]) -> list[Condition]:
    """The conditions, the two components of one edge set's traction or displacement in one where they are apart."""
    found: dict[object, Condition] = {}
    for number, condition in enumerate(conditions):
        if isinstance(condition, Traction | Displacement):
            given: dict[str, Any] = components(condition)
            own = type(condition), condition.edges, set(given) <= set(CARTESIAN)
            found[own] = replace(found.get(own, condition), **given)
        else:
            found[number] = condition
    return list(found.values())


def alignment(normal: FloatArray) -> dict[str, Any]:
    """How a text beside a side is aligned, so that it grows away from the body."""
    x, y = normal.tolist()
    across = "center" if abs(x) < _UPRIGHT else "left" if x > 0.0 else "right"
    upward = "center" if abs(y) < _UPRIGHT else "bottom" if y > 0.0 else "top"
    return {"ha": across, "va": upward}


def value_range(name: str, values: FloatArray, unit: str) -> str:
    """The value or the range of values of a named quantity, with its unit."""
    ends = [float(values.min()), float(values.max())]
    noise = _NOISE * max(map(abs, ends))
    numbers = dict.fromkeys(beside([0.0 if abs(end) <= noise else end], 6)[0] for end in ends)  # one of two alike
    return f"{name} = {' … '.join(numbers)} {unit}".rstrip().replace(" ", "\xa0")  # kept on one line


def beside(values: Sequence[float], digits: int = 4) -> list[str]:
    """Numbers that stand beside each other, to the last place of the largest with so many digits: noise is 0."""
    largest = max((abs(value) for value in values), default=0.0)
    power = int(np.floor(np.log10(largest))) if 0.0 < largest < np.inf else 0
    tens = power if abs(power) >= _LONG else 0
    places = digits - 1 - power + tens
    rounded = np.round(np.divide(values, 10.0**tens), places).tolist()
    found = [f"{value + 0.0:.{max(places, 0)}f}".replace("-", "−") for value in rounded]
    found = [text.rstrip("0").rstrip(".") if "." in text else text for text in found]
    return [text + f" · 10{str(tens).translate(_RAISED)}" * (tens != 0 and text != "0") for text in found]


def wrapped(text: str) -> str:
    """The text in lines short enough for a legend."""
    return plain_text(textwrap.fill(text, _WRAP, subsequent_indent="   ", break_on_hyphens=False))


def write(axes: "Axes", text: str, spots: Sequence[Spot], colour: str = "black") -> Written:
    """Write a text at the first of the spots; the others are taken where texts would overlap, see `spread`."""
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.7}
    look: dict[str, Any] = {"fontsize": "small", "zorder": 6, "bbox": box, "color": colour}
    (x, y), align = spots[0]
    return axes.text(x, y, plain_text(text), **look, **align), spots


def spread(axes: "Axes", written: Sequence[Written]) -> None:
    """Move each text to the first of its spots where it covers none of those before it; without one it stays."""
    figure = axes.get_figure(root=True)
    if figure is None or not written:
        return
    engine = figure.get_layout_engine()
    if axes.get_axes_locator() is not None:  # a panel inside another one, which gets its place while that is drawn
        figure.draw_without_rendering()
    else:  # sizes are known once the layout is; drawing without a picture would take as long again
        if engine is not None:
            engine.execute(figure)
        axes.apply_aspect()
    taken: list[Any] = []
    for text, spots in written:
        for place, align in (*spots, spots[0]):
            text.set_position(place.tolist())
            text.set(**align)
            box = text.get_window_extent().padded(3.0)  # with its white ground
            if not any(box.overlaps(other) for other in taken):
                break
        taken.append(box)
