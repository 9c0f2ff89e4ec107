"""The edges of triangles, who shares them, and which edges and triangles lie in a place."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, real_array
from qvi_contact.errors import InputError

Point: TypeAlias = Sequence[float]
Range: TypeAlias = Sequence[float] | None

_NEAR: Final = 1e-6  # distance over the body's length below which a vertex lies on a line

OPPOSITE = ((1, 2), (0, 2), (0, 1))
"""Corners of the edges of a triangle, edge s opposite to corner s."""


@dataclass(frozen=True, eq=False)
class Topology:
    """Edges of triangles.

    Attributes
    ----------
    ends : (e, 2) int array
        Vertices of each edge, the lower number first; edges in the order of these pairs.
    of_cells : (m, 3) int array
        Edges of each triangle, edge s opposite to its corner s.
    cells : (e, 2) int array
        The triangles at each edge, in ascending order; −1 for the second on the boundary.
    count : (e,) int array
        How many triangles share the edge: 1 on the boundary, 2 inside, more in what is no mesh.

    """

    ends: IntArray
    of_cells: IntArray
    cells: IntArray
    count: IntArray

    @classmethod
    def of(cls, cells: IntArray, vertices: int) -> "Topology":
        """Edges of triangles (m, 3), whose corners are in ascending order, among so many vertices."""
        pairs = np.stack([cells[:, list(pair)] for pair in OPPOSITE], axis=1).reshape(-1, 2)
        keys, index, count = np.unique(pairs @ np.array([vertices, 1]), return_inverse=True, return_counts=True)
        order = np.argsort(index, kind="stable")
        start = np.concatenate([[0], np.cumsum(count)[:-1]])
        beside = np.full((len(keys), 2), -1)
        beside[:, 0] = order[start] // 3
        shared = count > 1
        beside[shared, 1] = order[start[shared] + 1] // 3
        return cls(np.column_stack(np.divmod(keys, vertices)), index.reshape(-1, 3), beside, count)

    @property
    def boundary(self) -> BoolArray:
        """Which edges belong to one triangle only, shape (e,)."""
        return np.asarray(self.count == 1)

    def number(self, pairs: IntArray, vertices: int) -> IntArray:
        """The edges between pairs of vertices (k, 2), −1 where there is none."""
        wanted = np.sort(pairs, axis=1) @ np.array([vertices, 1])
        keys = self.ends @ np.array([vertices, 1])
        at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        return np.where(keys[at] == wanted, at, -1)


def outward_normals(vertices: FloatArray, cells: IntArray, topology: Topology, edges: IntArray) -> FloatArray:
    """Unit normals of edges that point out of the first triangle at each, shape (k, 2)."""
    first, second = vertices[topology.ends[edges]].swapaxes(0, 1)
    along = second - first
    normal = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]
    inner = vertices[cells[topology.cells[edges, 0]]].mean(axis=1)
    inward = ((inner - first) * normal).sum(axis=1) > 0.0
    return np.asarray(np.where(inward[:, None], -normal, normal))


def chains(ends: IntArray) -> list[IntArray]:
    """Edges ordered along the lines they make up, each line as indices into `ends`.

    Parameters
    ----------
    ends : (k, 2) int array
        The two vertices of each edge.

    Returns
    -------
    list of int arrays
        A line starts at a vertex of one edge only if it has such a vertex, that of lowest number, else at the lowest
        of all; where more than two edges meet lines end.

    """
    at: dict[int, list[int]] = {}
    for edge, pair in enumerate(ends.tolist()):
        for vertex in pair:
            at.setdefault(vertex, []).append(edge)
    used = np.zeros(len(ends), dtype=bool)
    found: list[IntArray] = []
    starts = sorted(vertex for vertex, edges in at.items() if len(edges) != 2) + sorted(at)
    for start in starts:
        for first in at[start]:
            line: list[int] = []
            vertex, edge = start, first
            while not used[edge]:
                used[edge] = True
                line.append(edge)
                low, high = ends[edge].tolist()
                vertex = high if vertex == low else low
                if len(at[vertex]) != 2:
                    break
                edge = next((e for e in at[vertex] if e != edge), edge)
            if line:
                found.append(np.array(line))
    return found


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
    run = vertices[pairs[:, 1]] - vertices[pairs[:, 0]]
    pairs = pairs[np.abs(run @ along) > np.abs(run @ [-along[1], along[0]])]  # shorter ones may leave the line
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
    pairs = _pairs(topology, _within(vertices, x, y)[0], False)
    if not len(pairs):
        raise InputError("box", {"x": x, "y": y}, "no edge of the boundary lies in this box: make it larger")
    return pairs


def triangles_in_box(vertices: FloatArray, cells: IntArray, x: Range, y: Range) -> IntArray:
    """Numbers (k,) of the triangles in ranges of x and y [length], the borders of which must be edges of the mesh."""
    given = {name: bounds for name, bounds in (("x", x), ("y", y)) if bounds is not None}
    closed, open_ = _within(vertices, x, y)
    inside = closed[cells].all(axis=1)
    for axis, bounds in ((0, x), (1, y)):
        if bounds is not None:  # of triangles that are smaller than what counts as near, on which side they lie
            centres = vertices[cells][..., axis].mean(axis=1)
            inside &= (centres > bounds[0]) & (centres < bounds[1])
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
