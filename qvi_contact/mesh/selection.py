"""Selection of edges and triangles: by number, function, segment or box."""

from collections.abc import Callable, Iterable, Sequence
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
"""A function of coordinate arrays (x, y) that returns booleans, or the numbers themselves."""

ASLANT: Final = (np.cos(1.0), np.sin(1.0))
"""A direction that lines of a mesh seldom have, so that projections on it differ."""

_LINE_DISTANCE: Final = 1e-6  # a vertex at this distance from a line, relative to the body's length, lies on it
_MAX_SLOPE: Final = 0.1  # an edge with a larger slope to a line is not on it, however short the edge is
_AT_END: Final = 1e-6  # fraction of an arc, at an end that two arcs have in common, where rounding moves a crossing
_EXACT_INTEGERS: Final = 2.0**53  # doubles below it represent all integers


def new_name(name: object, taken: Iterable[str] = (), what: str = "edge set") -> str:
    """The name if it is a non-empty text and not taken, or `InputError`."""
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
    """An array of numbers, or `InputError`; integers if `kind` is int."""
    numbers = real_array(name, value, "give an array of real numbers")
    whole = kind is not int or bool((np.abs(numbers) < _EXACT_INTEGERS).all() and (numbers == np.rint(numbers)).all())
    if np.asanyarray(value).dtype == bool or not whole:
        raise InputError(name, type(value).__name__, "give whole numbers" if kind is int else "give numbers")
    return numbers.astype(np.int64) if kind is int else numbers


def checked_set(name: str, pairs: ArrayLike, topology: Topology, vertices: FloatArray | None = None) -> IntArray:
    """Numbers (k,) of edges from pairs of vertices, ascending; given `vertices`, all on the boundary or all inside."""
    new_name(name)
    array = numbers_of(name, pairs, int)
    if array.ndim != 2 or array.shape[1] != 2 or not len(array):
        raise InputError(name, f"shape {array.shape}", "give the vertices of one or more edges as an array (k, 2)")
    number = known_edges(name, array, topology)
    on_boundary = topology.boundary[number]
    if vertices is not None and on_boundary.any() and not on_boundary.all():
        around = place_of(vertices[array[np.argmin(on_boundary)]].mean(axis=0))
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
    numbers = numbers_of(name, cells, int)
    if numbers.ndim != 1 or not len(numbers) or numbers.min() < 0 or numbers.max() >= count:
        raise InputError(name, cells, f"give numbers of triangles, 0 to {count - 1}")
    chosen = np.unique(numbers)
    chosen.flags.writeable = False
    return np.asarray(chosen)


def selected(name: str, where: Callable[[FloatArray, FloatArray], ArrayLike], points: FloatArray) -> IntArray:
    """Indices of the points (k, 2) at which the function of (x, y) is true."""
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
    """Vertices (k, 2) of the edges of the boundary, or inside the body, on the segment between two points [length].

    `InputError` if no edge lies there, or an end of the segment is not an end of an edge.
    """
    ends = np.array([start, stop], dtype=float)
    length = float(np.hypot(*(ends[1] - ends[0])))
    tolerance = _LINE_DISTANCE * float(np.ptp(vertices, axis=0).max())
    if not length > tolerance:
        raise InputError("segment", [list(start), list(stop)], "give two different points")
    direction = (ends[1] - ends[0]) / length
    offset = vertices - ends[0]
    t, distance = offset @ direction, np.abs(offset @ np.array([-direction[1], direction[0]]))
    on_line = (distance <= tolerance) & (t >= -tolerance) & (t <= length + tolerance)
    pairs = _edges_between(topology, on_line, inside)
    chords, t_middle = vertices[pairs[:, 1]] - vertices[pairs[:, 0]], t[pairs].mean(axis=1)
    # vertices of tiny edges are always near the line
    is_parallel = _MAX_SLOPE * np.abs(chords @ direction) > np.abs(chords @ [-direction[1], direction[0]])
    pairs = pairs[is_parallel & (t_middle > 0.0) & (t_middle < length)]
    if not len(pairs):
        where = "inside the body" if inside else "of the boundary"
        raise InputError("segment", [list(start), list(stop)], f"no edge {where} lies on this line: correct its ends")
    for end in ends:
        distances = np.hypot(*(vertices[np.unique(pairs)] - end).T)
        if distances.min() > tolerance:
            nearest = place_of(vertices[np.unique(pairs)[np.argmin(distances)]])
            remedy = f"must be a vertex where edges on this line end; the nearest one is {nearest}"
            raise InputError("segment", end.tolist(), remedy)
    return np.asarray(pairs)


def edges_in_box(vertices: FloatArray, topology: Topology, x: Range, y: Range) -> IntArray:
    """Edges (k, 2) of the boundary whose two ends lie in ranges of x and y [length], by their vertices."""
    low, high, tolerance, ranges = _box(vertices, x, y)
    if not ranges:
        raise InputError("box", ranges, "give a range of x, of y, or both: without them it is the whole boundary")
    is_inside = (vertices >= low - tolerance) & (vertices <= high + tolerance)
    pairs = _edges_between(topology, np.asarray(is_inside.all(axis=1)), False)
    if not len(pairs):
        raise InputError("box", ranges, "no edge of the boundary lies in this box: make it larger")
    return pairs


def triangles_in_box(vertices: FloatArray, cells: IntArray, x: Range, y: Range) -> IntArray:
    """Numbers (k,) of the triangles in ranges of x and y [length], the borders of which must be edges of the mesh."""
    low, high, tolerance, ranges = _box(vertices, x, y)
    corners = vertices[cells]
    centres = corners.mean(axis=1)  # decide for triangles smaller than the tolerance
    is_inside = ((corners >= low - tolerance) & (corners <= high + tolerance)).all(axis=(1, 2))
    is_inside &= ((centres > low) & (centres < high)).all(axis=1)
    # a triangle and the box are apart if a side of one of them separates them
    is_apart = ((corners.max(axis=1) <= low + tolerance) | (corners.min(axis=1) >= high - tolerance)).any(axis=1)
    for start, stop in ((0, 1), (1, 2), (2, 0)):
        side = corners[:, stop] - corners[:, start]
        normal = side[:, ::-1] * TURNED
        outward = np.sign(((corners[:, start] - centres) * normal).sum(axis=1))[:, None] * normal
        # the box corner that is first in the direction outward
        box_corner = np.where(outward > 0.0, low + tolerance, high - tolerance)
        is_apart |= ((box_corner - corners[:, start]) * outward).sum(axis=1) >= 0.0
    is_cut = ~is_apart & ~is_inside
    if is_cut.any():
        around = place_of(vertices[cells[np.argmax(is_cut)]].mean(axis=0))
        remedy = f"cuts the triangle around {around}: give ranges that end on edges of the mesh"
        raise InputError("region", ranges, remedy)
    if not is_inside.any():
        raise InputError("region", ranges, "no triangle lies in this range: make it larger")
    return np.flatnonzero(is_inside)


def between(start: IntArray, stop: IntArray) -> tuple[IntArray, IntArray]:
    """All pairs (row (k,), number (k,)) with start[row] ≤ number < stop[row], in order."""
    count = stop - start
    row = np.arange(len(count)).repeat(count)
    return row, np.arange(len(row)) - (count.cumsum() - stop).repeat(count)


def in_circles(points: FloatArray, centres: FloatArray, radius: FloatArray) -> tuple[IntArray, IntArray]:
    """Pairs (circle (k,), point (k,)) of a circle and a point in it, in order; candidates by projection on `ASLANT`."""
    position, centre = ((each - points[0]) @ ASLANT for each in (points, centres))
    order = position.argsort()
    ordered = position[order]
    start, stop = ordered.searchsorted(centre - radius, "left"), ordered.searchsorted(centre + radius, "right")
    circle, index = between(start, stop)
    point = order[index]
    offset = points.take(point, axis=0) - centres.take(circle, axis=0)
    inside = np.hypot(*offset.T) <= radius[circle]
    return np.divmod(np.sort(circle[inside] * len(points) + point[inside]), len(points))


def crossing(ends: FloatArray, half_turns: FloatArray) -> IntArray:
    """Pairs (k, 2) of circular arcs, with ends (m, 2, 2) that turn by twice `half_turns` (m,) [rad], that cross.

    Lines turn by 0, arcs by at most 90°. An end in common is no crossing. In complex numbers an arc with first end p,
    chord d and half turn θ is p + v α/(1 − i v sin θ) with α = d exp(−iθ) and 0 ≤ v cos θ ≤ 1. Another arc meets it
    where its parameter, as a function of v, is real: v is a root of a quadratic polynomial.
    """
    start, stop = (ends @ [1.0, 1.0j]).T
    sine, cosine, lengths = np.sin(half_turns), np.cos(half_turns), np.abs(stop - start)
    alpha = (stop - start) * np.exp(-1j * half_turns)
    # arcs lie in the circles whose diameters are their chords, so the middle of one of two that cross is no farther
    # from that of the longer one than this is long
    middles = ends.mean(axis=1)
    a, b = in_circles(middles, middles, lengths)
    a, b = np.stack([a, b])[:, (lengths[a] > lengths[b]) | ((lengths[a] == lengths[b]) & (a < b))]
    offset, turn = start[b] - start[a], alpha[a].conj()
    slope = alpha[b] - 1j * sine[b] * offset
    constant = (offset * turn).imag - sine[a] * np.abs(offset) ** 2
    linear = (alpha[b] * turn).imag - 2.0 * sine[a] * (offset * slope.conj()).real
    square = sine[b] * (slope * turn).real - sine[a] * np.abs(slope) ** 2
    is_joined = (start[a] == start[b]) | (start[a] == stop[b]) | (stop[a] == start[b]) | (stop[a] == stop[b])
    margin = np.where(is_joined, _AT_END, 0.0)
    with np.errstate(all="ignore"):  # of parallel lines, and without a root
        half = -(linear + np.copysign(np.sqrt(linear**2 - 4.0 * square * constant), linear)) / 2.0
        v = np.stack([half / square, constant / half])
        point = offset + v * alpha[b] / (1.0 - 1j * sine[b] * v)
        shares = np.stack([v * cosine[b], (point / (alpha[a] + 1j * sine[a] * point)).real * cosine[a]])
    is_crossed = ((shares > margin) & (shares < 1.0 - margin)).all(axis=0).any(axis=0)
    return np.column_stack([a, b])[is_crossed]


def _edges_between(topology: Topology, chosen: BoolArray, inside: bool) -> IntArray:
    """Vertices (k, 2) of the edges on the boundary, or inside, whose vertices are both in the mask `chosen`."""
    return np.asarray(topology.ends[chosen[topology.ends].all(axis=1) & (topology.boundary != inside)])


def _box(vertices: FloatArray, x: Range, y: Range) -> tuple[FloatArray, FloatArray, float, dict[str, Point]]:
    """Lower left and upper right corner (2,) of the box of two ranges, the distance on its border, the ranges given."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    tolerance = _LINE_DISTANCE * float((high - low).max())
    ranges = {name: bounds for name, bounds in (("x", x), ("y", y)) if bounds is not None}
    for name, bounds in ranges.items():
        ends = real_array(f"range.{name}", bounds, "give a pair of numbers")
        if ends.shape != (2,) or not ends[0] < ends[1]:
            raise InputError(f"range.{name}", bounds, "give two numbers, the smaller end first")
        low["xy".index(name)], high["xy".index(name)] = ends
    return low, high, tolerance, ranges
