"""Edges and triangles of a mesh by the place where they lie."""

from collections.abc import Sequence
from typing import Final, TypeAlias

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, real_array
from qvi_contact.errors import InputError
from qvi_contact.mesh.topology import Topology

Point: TypeAlias = Sequence[float]
Range: TypeAlias = Sequence[float] | None

_NEAR: Final = 1e-6  # distance over the body's length below which a vertex lies on a line


def edges_on_segment(
    vertices: FloatArray, topology: Topology, start: Point, stop: Point, *, inside: bool = False
) -> IntArray:
    """Edges of the boundary, or inside the body, that lie on a straight line between two points.

    Parameters
    ----------
    vertices : (n, 2) array
        Coordinates [length].
    topology : Topology
        The edges of the mesh.
    start, stop : (x, y)
        The points [length], which must be vertices of these edges.
    inside : bool
        Whether edges between two triangles are meant rather than those of the boundary.

    Returns
    -------
    (k, 2) int array
        The edges by their vertices.

    Raises
    ------
    InputError
        If no edge lies there, or the line ends elsewhere than they do.

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
    if not len(pairs):
        where = "inside the body" if inside else "of the boundary"
        raise InputError("segment", [list(start), list(stop)], f"no edge {where} lies on this line: correct its ends")
    for end in ends:
        gaps = np.hypot(*(vertices[np.unique(pairs)] - end).T)
        if gaps.min() > near:
            x, y = vertices[np.unique(pairs)[np.argmin(gaps)]]
            remedy = f"must be a vertex where edges on this line end; the nearest one is ({x:.9g}, {y:.9g})"
            raise InputError("segment", end.tolist(), remedy)
    return pairs


def edges_in_box(vertices: FloatArray, topology: Topology, x: Range, y: Range) -> IntArray:
    """Edges (k, 2) of the boundary whose two ends lie in ranges of x and y [length], by their vertices."""
    pairs = _pairs(topology, _within(vertices, x, y)[0], False)
    if not len(pairs):
        raise InputError("box", {"x": x, "y": y}, "no edge of the boundary lies in this box: make it larger")
    return pairs


def triangles_in_box(vertices: FloatArray, cells: IntArray, x: Range, y: Range) -> IntArray:
    """Numbers (k,) of the triangles in ranges of x and y [length], the borders of which must be edges of the mesh."""
    given = {name: bounds for name, bounds in (("x", x), ("y", y)) if bounds is not None}
    closed, open_ = _within(vertices, x, y)
    inside = closed[cells].all(axis=1)
    cut = open_[cells].any(axis=1) & ~inside
    if cut.any():
        px, py = vertices[cells[np.argmax(cut)]].mean(axis=0)
        remedy = f"cuts the triangle around ({px:.6g}, {py:.6g}): give ranges that end on edges of the mesh"
        raise InputError("region", given, remedy)
    if not inside.any():
        raise InputError("region", given, "no triangle lies in this range: make it larger")
    return np.flatnonzero(inside)


def _pairs(topology: Topology, chosen: BoolArray, inside: bool) -> IntArray:
    """Edges whose two vertices are chosen (v,), on the boundary or inside."""
    ends = topology.ends
    return np.asarray(ends[chosen[ends].all(axis=1) & (topology.boundary != inside)])


def _within(vertices: FloatArray, x: Range, y: Range) -> tuple[BoolArray, BoolArray]:
    """Vertices (v,) in ranges, with and without their borders."""
    near = _NEAR * float(np.ptp(vertices, axis=0).max())
    closed, open_ = np.ones(len(vertices), dtype=bool), np.ones(len(vertices), dtype=bool)
    for bounds, values in ((x, vertices[:, 0]), (y, vertices[:, 1])):
        if bounds is not None:
            low, high = _ordered(bounds)
            closed &= (values >= low - near) & (values <= high + near)
            open_ &= (values > low + near) & (values < high - near)
    return closed, open_


def _ordered(bounds: Sequence[float]) -> FloatArray:
    found = real_array("range", bounds, "give a pair of numbers")
    if found.shape != (2,) or not found[0] < found[1]:
        raise InputError("range", bounds, "give two numbers, the smaller end first")
    return found
