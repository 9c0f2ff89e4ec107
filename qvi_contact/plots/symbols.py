"""What mechanical symbols are made of: straight runs of edges, ground hatching."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.mesh.rectilinear import HORIZONTAL, GridEdges, RectilinearMesh
from qvi_contact.plots.style import lines

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_OBLIQUE: Final = 0.05  # sine of the angle to a side below which an arrow counts as lying along it


@dataclass(frozen=True, eq=False)
class Run:
    """A straight row of adjoining edges that face the same way.

    Attributes
    ----------
    start, stop : (2,) arrays
        Its ends, in the direction of growing x or y [length].
    normal : (2,) array
        Outward unit normal.

    """

    start: FloatArray
    stop: FloatArray
    normal: FloatArray

    @property
    def length(self) -> float:
        """Its length [length]."""
        return float(np.hypot(*(self.stop - self.start)))

    @property
    def middle(self) -> FloatArray:
        """Its midpoint [length]."""
        return (self.start + self.stop) / 2.0

    def points(self, distance: float, least: int = 2) -> FloatArray:
        """Points about `distance` apart, as far from the ends as half of that, at least `least`; shape (n, 2)."""
        count = max(least, round(self.length / distance))
        t = (np.arange(count)[:, None] + 0.5) / count
        return self.start + t * (self.stop - self.start)

    def ends_and_points(self, distance: float) -> FloatArray:
        """Points about `distance` apart from end to end, at least both ends; shape (n, 2)."""
        count = max(1, round(self.length / distance))
        t = np.arange(count + 1)[:, None] / count
        return self.start + t * (self.stop - self.start)


def runs(mesh: RectilinearMesh, edges: GridEdges) -> list[Run]:
    """GridEdges joined to straight runs, those of one line and facing one way behind each other."""
    first, second = mesh.coordinates[edges.first], mesh.coordinates[edges.second]
    horizontal = edges.axis == HORIZONTAL
    line, along = np.where(horizontal, first[:, 1], first[:, 0]), np.where(horizontal, first[:, 0], first[:, 1])
    order = np.lexsort((along, line, edges.sign, edges.axis))
    edges, first, second = edges.take(order), first[order], second[order]
    breaks = (edges.first[1:] != edges.second[:-1]) | (np.diff(edges.axis) != 0) | (np.diff(edges.sign) != 0)
    begins = np.concatenate([[0], np.flatnonzero(breaks) + 1])
    found = []
    for begin, end in zip(begins, [*begins[1:], len(edges)], strict=True):
        across = np.array([0.0, 1.0]) if edges.axis[begin] == HORIZONTAL else np.array([1.0, 0.0])
        found.append(Run(first[begin], second[end - 1], edges.sign[begin] * across))
    return found


def ground(axes: "Axes", line: FloatArray, normal: FloatArray, size: float, colour: str = "black") -> None:
    """Draw a rigid obstacle: a line of points (n, 2) and oblique strokes of a given size on its far side (n, 2)."""
    axes.plot(*line.T, color=colour, linewidth=1.0)
    steps = np.hypot(*np.diff(line, axis=0).T)
    s = np.concatenate([[0.0], np.cumsum(steps)])
    if s[-1] <= 0.0:
        return
    places = (np.arange(max(1, round(s[-1] / size))) + 0.5) * s[-1] / max(1, round(s[-1] / size))
    begin = np.column_stack([np.interp(places, s, line[:, k]) for k in (0, 1)])
    outward = np.column_stack([np.interp(places, s, normal[:, k]) for k in (0, 1)])
    sideways = np.column_stack([outward[:, 1], -outward[:, 0]])
    strokes = np.stack([begin, begin + 0.7 * size * (outward + sideways)], axis=1)
    axes.add_collection(lines(strokes, colour, "solid", 0.6))


def arrows(
    axes: "Axes", points: FloatArray, vectors: FloatArray, normal: FloatArray, away: float, look: dict[str, Any]
) -> None:
    """Draw vectors that act at points of a side with this outward normal; those of no length are left out.

    An arrow into the body ends at its point, one out of the body begins there; one along the side is centred, at the
    distance `away`.
    """
    size = np.hypot(*vectors.T)
    shown = size > 0.02 * size.max(initial=0.0)
    points, vectors, size = points[shown], vectors[shown], size[shown]
    outward = vectors @ normal / size
    tails = np.where((outward < -_OBLIQUE)[:, None], points - vectors, points)
    along = points - vectors / 2.0 + away * normal
    tails = np.where((np.abs(outward) <= _OBLIQUE)[:, None], along, tails)
    settings = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.005, "headwidth": 4.0, "zorder": 5}
    axes.quiver(*tails.T, *vectors.T, **{**settings, **look})
