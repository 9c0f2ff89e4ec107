"""Edges and triangles of a mesh by the place where they lie."""

from collections.abc import Sequence
from typing import Final, TypeAlias

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.errors import InputError
from qvi_contact.mesh.triangles import TriangleMesh

Point: TypeAlias = Sequence[float]
Range: TypeAlias = Sequence[float] | None

_NEAR: Final = 1e-6  # distance over the body's length below which a vertex lies on a line


def edges_on_segment(mesh: TriangleMesh, start: Point, stop: Point, *, inside: bool = False) -> IntArray:
    """Edges of the boundary, or inside the body, that lie on a straight line between two points.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh.
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
    near = _NEAR * mesh.length
    if not length > near:
        raise InputError("segment", [list(start), list(stop)], "give two different points")
    along = (ends[1] - ends[0]) / length
    offset = mesh.vertices - ends[0]
    t, distance = offset @ along, np.abs(offset @ np.array([-along[1], along[0]]))
    on = (distance <= near) & (t >= -near) & (t <= length + near)
    pairs = _pairs(mesh, on, inside)
    if not len(pairs):
        where = "inside the body" if inside else "of the boundary"
        raise InputError("segment", [list(start), list(stop)], f"no edge {where} lies on this line: correct its ends")
    for end in ends:
        gaps = np.hypot(*(mesh.vertices[np.unique(pairs)] - end).T)
        if gaps.min() > near:
            x, y = mesh.vertices[np.unique(pairs)[np.argmin(gaps)]]
            remedy = f"must be a vertex where edges on this line end; the nearest one is ({x:.9g}, {y:.9g})"
            raise InputError("segment", end.tolist(), remedy)
    return pairs


def edges_in_box(mesh: TriangleMesh, x: Range, y: Range) -> IntArray:
    """Edges (k, 2) of the boundary whose two ends lie in ranges of x and y [length], by their vertices."""
    pairs = _pairs(mesh, _within(mesh, x, y)[0], False)
    if not len(pairs):
        raise InputError("box", {"x": x, "y": y}, "no edge of the boundary lies in this box: make it larger")
    return pairs


def triangles_in_box(mesh: TriangleMesh, x: Range, y: Range) -> IntArray:
    """Numbers (k,) of the triangles in ranges of x and y [length], the borders of which must be edges of the mesh."""
    closed, open_ = _within(mesh, x, y)
    inside = closed[mesh.cells].all(axis=1)
    cut = open_[mesh.cells].any(axis=1) & ~inside
    if cut.any():
        px, py = mesh.corners[np.argmax(cut)].mean(axis=0)
        remedy = f"cuts the triangle around ({px:.6g}, {py:.6g}): give ranges that end on edges of the mesh"
        raise InputError("region", {"x": x, "y": y}, remedy)
    if not inside.any():
        raise InputError("region", {"x": x, "y": y}, "no triangle lies in this range: make it larger")
    return np.flatnonzero(inside)


def _pairs(mesh: TriangleMesh, chosen: BoolArray, inside: bool) -> IntArray:
    """Edges whose two vertices are chosen (v,), on the boundary or inside."""
    ends = mesh.topology.ends
    return np.asarray(ends[chosen[ends].all(axis=1) & (mesh.topology.boundary != inside)])


def _within(mesh: TriangleMesh, x: Range, y: Range) -> tuple[BoolArray, BoolArray]:
    """Vertices (v,) in ranges, with and without their borders."""
    near = _NEAR * mesh.length
    closed, open_ = np.ones(len(mesh.vertices), dtype=bool), np.ones(len(mesh.vertices), dtype=bool)
    for bounds, values in ((x, mesh.vertices[:, 0]), (y, mesh.vertices[:, 1])):
        if bounds is not None:
            low, high = _ordered(bounds)
            closed &= (values >= low - near) & (values <= high + near)
            open_ &= (values > low + near) & (values < high - near)
    return closed, open_


def _ordered(bounds: Sequence[float]) -> FloatArray:
    if not bounds[0] < bounds[1]:
        raise InputError("range", list(bounds), "give the smaller end first")
    return np.array(bounds, dtype=float)
