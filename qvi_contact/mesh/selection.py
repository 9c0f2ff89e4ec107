"""Which edges and triangles are meant: by number, function, segment or box."""

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, real_array
from qvi_contact.basics.schema import Listed, Number
from qvi_contact.errors import InputError, place_of
from qvi_contact.mesh.edges import TURNED, Topology

Point: TypeAlias = Sequence[float]
Range: TypeAlias = Sequence[float] | None

Where: TypeAlias = Callable[[FloatArray, FloatArray], ArrayLike] | ArrayLike
"""A function of coordinate arrays (x, y) that says which ones are meant, or the numbers themselves."""

ASLANT: Final = (np.cos(1.0), np.sin(1.0))
"""A direction that lines of a mesh seldom have."""

_NEAR: Final = 1e-6  # distance over the body's length below which a vertex lies on a line
_ALONG: Final = 0.1  # slope of an edge to a line, from which on it leaves this, however short it is
_LARGEST: Final = 2.0**53  # whole numbers below it are exact


def new_name(name: object, taken: Iterable[str] = (), what: str = "edge set") -> str:
    """A name that is not taken yet, or `InputError`."""
    if not isinstance(name, str) or not name:
        raise InputError("name", name, "give a non-empty string")
    if name in taken:
        raise InputError("name", name, f"this {what} exists already: choose another name")
    return name


def point(name: str, value: object) -> tuple[float, float]:
    """A pair of finite coordinates, or `InputError`."""
    x, y = Listed(Number(), most=2).check(name, value)
    return x, y


def numbers_of(name: str, value: Any, kind: type) -> Any:
    """An array of numbers, whole ones if the kind is int."""
    given: Any = None
    with suppress(ValueError):  # rows of several lengths, which are refused next
        given = np.asarray(value)
        if kind is int and given.dtype == np.int64:
            return given.copy()
    found = real_array(name, value, "give an array of real numbers")
    whole = kind is not int or bool((np.abs(found) < _LARGEST).all() and (found == np.rint(found)).all())
    if given.dtype == bool or not whole:
        raise InputError(name, type(value).__name__, "give whole numbers" if kind is int else "give numbers")
    return found.astype(np.int64) if kind is int else found


def checked_set(name: str, pairs: ArrayLike, topology: Topology, vertices: FloatArray | None = None) -> IntArray:
    """Numbers (k,) in `topology` of edges, ascending; with vertices all on the boundary, or all inside the body."""
    new_name(name)
    found = numbers_of(name, pairs, int)
    if found.ndim != 2 or found.shape[1] != 2 or not len(found):
        raise InputError(name, f"shape {found.shape}", "give the vertices of one or more edges as an array (k, 2)")
    number = known_edges(name, found, topology)
    outer = topology.boundary[number]
    if vertices is not None and outer.any() and not outer.all():
        around = place_of(vertices[found[np.argmin(outer)]].mean(axis=0))
        remedy = f"lies partly on the boundary and partly inside, as around {around}: make two sets of it"
        raise InputError("TriangleMesh.edge_sets", name, remedy)
    chosen = np.bincount(number).nonzero()[0]  # each once
    chosen.flags.writeable = False
    return np.asarray(chosen)


def known_edges(name: str, pairs: IntArray, topology: Topology) -> IntArray:
    """Numbers of the edges between pairs of vertices (k, 2), or `InputError`."""
    number = topology.number(pairs)
    if np.count_nonzero(number < 0):
        raise InputError(name, pairs[np.argmin(number)].tolist(), "no edge of the mesh joins these vertices")
    return number


def checked_region(name: str, cells: ArrayLike, count: int) -> IntArray:
    """Numbers (k,) of the triangles of a region, in ascending order."""
    new_name(name)
    found = numbers_of(name, cells, int)
    if found.ndim != 1 or not len(found) or found.min() < 0 or found.max() >= count:
        raise InputError(name, cells, f"give numbers of triangles, 0 to {count - 1}")
    chosen = np.unique(found)
    chosen.flags.writeable = False
    return np.asarray(chosen)


def selected(name: str, where: Callable[[FloatArray, FloatArray], ArrayLike], points: FloatArray) -> IntArray:
    """Indices of the points (k, 2) that a function of (x, y) chooses."""
    try:
        mask = np.broadcast_to(np.asarray(where(*points.T)), len(points))
    except Exception as error:
        remedy = f"the function must take two arrays (x, y) and return booleans of their shape ({error})"
        raise InputError(name, where, remedy) from error
    if mask.dtype != bool:
        raise InputError(name, mask.dtype, "the function must return booleans")
    return np.flatnonzero(mask)


def edges_on_segment(
    vertices: FloatArray, topology: Topology, start: Point, stop: Point, *, inside: bool = False
) -> IntArray:
    """Edges (k, 2) of the boundary, or inside the body, that lie between two points (x, y) [length], their vertices.

    `InputError` if no edge lies there, or the line ends elsewhere than they do.
    """
    ends = np.array([start, stop], dtype=float)
    length = float(np.hypot(*(ends[1] - ends[0])))
    near = _NEAR * float(np.ptp(vertices, axis=0).max())
    if not length > near:
        raise InputError("segment", [list(start), list(stop)], "give two different points")
    along = (ends[1] - ends[0]) / length
    offset = vertices - ends[0]
    t, distance = offset @ along, np.abs(offset @ np.array([-along[1], along[0]]))
    on = (distance <= near) & (t >= -near) & (t <= length + near)
    pairs = _pairs(topology, on, inside)
    run, middle = vertices[pairs[:, 1]] - vertices[pairs[:, 0]], t[pairs].mean(axis=1)
    follows = _ALONG * np.abs(run @ along) > np.abs(run @ [-along[1], along[0]])  # shorter ones may leave the line
    pairs = pairs[follows & (middle > 0.0) & (middle < length)]
    if not len(pairs):
        where = "inside the body" if inside else "of the boundary"
        raise InputError("segment", [list(start), list(stop)], f"no edge {where} lies on this line: correct its ends")
    for end in ends:
        gaps = np.hypot(*(vertices[np.unique(pairs)] - end).T)
        if gaps.min() > near:
            x, y = vertices[np.unique(pairs)[np.argmin(gaps)]]
            remedy = f"must be a vertex where edges on this line end; the nearest one is ({x:.9g}, {y:.9g})"
            raise InputError("segment", end.tolist(), remedy)
    return np.asarray(pairs)


def edges_in_box(vertices: FloatArray, topology: Topology, x: Range, y: Range) -> IntArray:
    """Edges (k, 2) of the boundary whose two ends lie in ranges of x and y [length], by their vertices."""
    low, high, near = _box(vertices, x, y)
    within = (vertices >= low - near) & (vertices <= high + near)
    pairs = _pairs(topology, np.asarray(within.all(axis=1)), False)
    if not len(pairs):
        raise InputError("box", {"x": x, "y": y}, "no edge of the boundary lies in this box: make it larger")
    return pairs


def triangles_in_box(vertices: FloatArray, cells: IntArray, x: Range, y: Range) -> IntArray:
    """Numbers (k,) of the triangles in ranges of x and y [length], the borders of which must be edges of the mesh."""
    given = {name: bounds for name, bounds in (("x", x), ("y", y)) if bounds is not None}
    low, high, near = _box(vertices, x, y)
    corners = vertices[cells]
    centres = corners.mean(axis=1)  # of triangles smaller than what counts as near they say on which side these lie
    inside = ((corners >= low - near) & (corners <= high + near)).all(axis=(1, 2))
    inside &= ((centres > low) & (centres < high)).all(axis=1)
    # a triangle and the box are apart if a side of one of them has them on its two sides
    apart = ((corners.max(axis=1) <= low + near) | (corners.min(axis=1) >= high - near)).any(axis=1)
    for start, stop in ((0, 1), (1, 2), (2, 0)):
        along = corners[:, stop] - corners[:, start]
        normal = along[:, ::-1] * TURNED
        outward = np.sign(((corners[:, start] - centres) * normal).sum(axis=1))[:, None] * normal
        nearest = np.where(outward > 0.0, low + near, high - near)  # corner of the box
        apart |= ((nearest - corners[:, start]) * outward).sum(axis=1) >= 0.0
    cut = ~apart & ~inside
    if cut.any():
        around = place_of(vertices[cells[np.argmax(cut)]].mean(axis=0))
        remedy = f"cuts the triangle around {around}: give ranges that end on edges of the mesh"
        raise InputError("region", given, remedy)
    if not inside.any():
        raise InputError("region", given, "no triangle lies in this range: make it larger")
    return np.flatnonzero(inside)


def between(start: IntArray, stop: IntArray) -> tuple[IntArray, IntArray]:
    """Pairs (k,) of a row and a whole number from its start (n,) on, below its stop (n,), in order."""
    count = stop - start
    row = np.arange(len(count)).repeat(count)
    return row, np.arange(len(row)) - (count.cumsum() - stop).repeat(count)


def in_circles(points: FloatArray, centres: FloatArray, radius: FloatArray) -> tuple[IntArray, IntArray]:
    """Pairs of a circle and a point in it, in order; looked for along `ASLANT`."""
    place, centre = ((at - points[0]) @ ASLANT for at in (points, centres))
    order = place.argsort()
    ordered = place[order]
    start, stop = ordered.searchsorted(centre - radius, "left"), ordered.searchsorted(centre + radius, "right")
    circle, number = between(start, stop)
    point = order[number]
    away = points.take(point, axis=0) - centres.take(circle, axis=0)
    inside = np.hypot(*away.T) <= radius[circle]
    return np.divmod(np.sort(circle[inside] * len(points) + point[inside]), len(points))


def _pairs(topology: Topology, chosen: BoolArray, inside: bool) -> IntArray:
    """Edges whose two vertices are chosen (v,), on the boundary or inside."""
    ends = topology.ends
    return np.asarray(ends[chosen[ends].all(axis=1) & (topology.boundary != inside)])


def _box(vertices: FloatArray, x: Range, y: Range) -> tuple[FloatArray, FloatArray, float]:
    """Lower left and upper right corner (2,) of ranges, and how far off them a vertex still lies on their border."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    near = _NEAR * float((high - low).max())
    for axis, bounds in enumerate((x, y)):
        if bounds is not None:
            ends = real_array("range", bounds, "give a pair of numbers")
            if ends.shape != (2,) or not ends[0] < ends[1]:
                raise InputError("range", bounds, "give two numbers, the smaller end first")
            low[axis], high[axis] = ends
    return low, high, near
