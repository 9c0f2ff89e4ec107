"""What a mesh of triangles must be: checks that name the place of the first fault."""

from typing import Final, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.errors import InputError
from qvi_contact.mesh.curves import ROUNDING
from qvi_contact.mesh.edges import Topology, angles, arc_offsets, cross, linked
from qvi_contact.mesh.selection import numbers_of

LARGEST: Final = 1e100  # of a coordinate: squares and areas of larger ones are beyond floating-point numbers
_FLAT: Final = 1e-8  # height over longest side below which a triangle is none
_SAME: Final = 1e-10  # distance of vertices over the body's length below which they are in one place
_ASLANT: Final = (np.cos(1.0), np.sin(1.0))
_SPACE: Final = 0.1  # distance of pieces over the body's length up to which they may be meant to touch
_ON_EDGE: Final = 1e-9  # distance from an edge over its length below which a vertex lies on it
_FARTHEST: Final = 1e-3  # the same of arcs at most
_HALVINGS: Final = 60


def checked_vertices(vertices: ArrayLike) -> FloatArray:
    """Finite coordinates (n, 2) that cannot be written to."""
    found = np.array(numbers_of("TriangleMesh.vertices", vertices, float))
    if found.ndim != 2 or found.shape[1] != 2 or len(found) < 3:
        raise InputError("TriangleMesh.vertices", f"shape {found.shape}", "give an array (n, 2), n ≥ 3")
    bad = ~np.isfinite(found).all(axis=1)
    if bad.any():
        raise InputError("TriangleMesh.vertices", int(np.argmax(bad)), "this vertex has no finite coordinates")
    if np.abs(found).max() > LARGEST:
        remedy = f"give coordinates of at most {LARGEST:.0e}: take other units"
        raise InputError("TriangleMesh.vertices", float(np.abs(found).max()), remedy)
    found.flags.writeable = False
    return found


def checked_cells(cells: ArrayLike, vertices: FloatArray) -> IntArray:
    """Three different vertices a triangle, in ascending order, (m, 3)."""
    found = numbers_of("TriangleMesh.cells", cells, int)
    if found.ndim != 2 or found.shape[1] != 3 or not len(found):
        raise InputError("TriangleMesh.cells", f"shape {found.shape}", "give an array (m, 3), m ≥ 1")
    if found.min() < 0 or found.max() >= len(vertices):
        wrong = found[(found < 0) | (found >= len(vertices))][0]
        raise InputError("TriangleMesh.cells", int(wrong), f"give numbers of vertices, 0 to {len(vertices) - 1}")
    ordered = np.sort(found, axis=1)
    ordered.flags.writeable = False
    return ordered


def refuse_flaws(vertices: FloatArray, cells: IntArray, topology: Topology) -> None:
    """`InputError` unless triangles are a mesh of one piece."""
    _refuse_triangles(vertices, cells, topology)
    piece, same, hanging = pieces(topology, len(cells)), same_places(vertices), hanging_vertices(vertices, topology)[0]
    _refuse_meeting(vertices, cells, topology, piece, same, hanging)
    if len(same):
        pair = same[np.lexsort(same.T[::-1])[0]]
        remedy = "these vertices lie in the same place {}: merge them (a Contact along a joint separates bodies)"
        _refuse(pair.tolist(), remedy, vertices[pair[0]])
    if len(hanging):
        vertex, edge = hanging[0]
        remedy = f"this vertex at {{}} lies inside the edge of the vertices {topology.ends[edge].tolist()}: "
        _refuse(int(vertex), remedy + "divide the triangle there", vertices[vertex])
    _refuse_pieces(vertices, cells, topology, piece)


def pieces(topology: Topology, count: int) -> IntArray:
    """The number of the piece of each of so many triangles (m,): those joined by edges are one."""
    first, second = topology.cells[topology.count == 2].T
    return linked(first, second, count)


def same_places(vertices: FloatArray) -> IntArray:
    """Pairs (k, 2) of vertices too near each other to be told apart."""
    reach = np.full(len(vertices), _SAME * float(np.ptp(vertices, axis=0).max()))
    pairs = np.column_stack(_near(vertices, vertices, reach))
    return pairs[pairs[:, 0] < pairs[:, 1]]


def _refuse(value: object, what: str, at: FloatArray) -> NoReturn:
    raise InputError("TriangleMesh", value, what.format(f"({at[0]:.6g}, {at[1]:.6g})"))


def _refuse_triangles(vertices: FloatArray, cells: IntArray, topology: Topology) -> None:
    """`InputError` if triangles have no area or overlap at an edge, or vertices belong to none."""
    a, b, c = vertices[cells].swapaxes(0, 1)
    sides = np.stack([b - a, c - b, a - c])
    flat = np.abs(cross(sides[0], sides[1])) <= _FLAT * np.square(sides).sum(axis=2).max(axis=0)
    if flat.any():
        cell = int(np.argmax(flat))
        _refuse(cells[cell].tolist(), "the triangle of these vertices at {} has no area: leave it out", a[cell])
    used = np.zeros(len(vertices), dtype=bool)
    used[cells] = True
    if not used.all():
        vertex = int(np.argmin(used))
        _refuse(vertex, "this vertex at {} belongs to no triangle: leave it out", vertices[vertex])
    first, second = vertices[topology.ends].swapaxes(0, 1)
    if topology.count.max() > 2:
        edge = int(np.argmax(topology.count > 2))
        remedy = "more than two triangles share the edge of these vertices around {}"
        _refuse(topology.ends[edge].tolist(), remedy, (first[edge] + second[edge]) / 2.0)
    centres = (a + b + c)[topology.cells] / 3.0
    one, other = (cross(second - first, centres[:, side] - first) for side in (0, 1))
    folded = (topology.count == 2) & (one * other > 0.0)
    if folded.any():
        edge = int(np.argmax(folded))
        remedy = "the two triangles at the edge of these vertices around {} lie on the same side of it and overlap"
        _refuse(topology.ends[edge].tolist(), remedy, (first[edge] + second[edge]) / 2.0)


def hanging_vertices(
    vertices: FloatArray, topology: Topology, bends: FloatArray | None = None
) -> tuple[IntArray, FloatArray]:
    """Pairs (k, 2) of a vertex and an edge of the boundary it lies inside: two triangles meet one along its side.

    And the shares (k,) of the edges' lengths at which they do. Edges follow their arcs where `bends` are given.
    """
    outer = np.flatnonzero(topology.boundary)
    first, second = vertices[topology.ends[outer]].swapaxes(0, 1)
    along = second - first
    lengths = np.hypot(*along.T)
    candidates = np.unique(topology.ends[outer])
    edge, vertex = _near(vertices[candidates], (first + second) / 2.0, lengths * (0.5 - 1e-6))
    vertex = candidates[vertex]
    offset, chord = vertices[vertex] - first[edge], along[edge]
    straight = (offset * chord).sum(axis=1) / lengths[edge] ** 2
    bend = np.zeros((len(edge), 2)) if bends is None else bends[outer[edge]]
    low, high = np.zeros(len(edge)), np.ones(len(edge))
    for _ in range(_HALVINGS if bend.any() else 0):  # an arc of less than 180° goes on along its chord
        middle = (low + high) / 2.0
        ahead = (arc_offsets(chord, bend, middle[:, None])[:, 0] * chord).sum(axis=1) > straight * lengths[edge] ** 2
        low, high = np.where(ahead, low, middle), np.where(ahead, middle, high)
    arc = bend.any(axis=1)
    share = np.where(arc, (low + high) / 2.0, straight)
    distance = np.hypot(*(arc_offsets(chord, bend, share[:, None])[:, 0] - offset).T) / lengths[edge]
    # data of an arc are rounded by a share of its radius, which is about the edge's length over the angle it turns by
    turn = np.ptp(angles(bend, np.array([0.0, 1.0])), axis=1)
    rounding = np.where(arc, np.minimum(ROUNDING / np.where(arc, turn, 1.0), _FARTHEST), _ON_EDGE)
    hanging = distance <= rounding
    return np.column_stack([vertex[hanging], outer[edge[hanging]]]), share[hanging]


def _near(points: FloatArray, centres: FloatArray, radius: FloatArray) -> tuple[IntArray, IntArray]:
    """Pairs of a circle and a point in it, in order; looked for along a direction that lines of a mesh seldom have."""
    place, centre = ((at - points[0]) @ _ASLANT for at in (points, centres))
    order = np.argsort(place)
    start = np.searchsorted(place[order], centre - radius, "left")
    stop = np.searchsorted(place[order], centre + radius, "right")
    count = stop - start
    circle = np.repeat(np.arange(len(centres)), count)
    point = order[np.arange(len(circle)) - np.repeat(np.cumsum(count) - stop, count)]
    inside = np.hypot(*(points[point] - centres[circle]).T) <= radius[circle]
    return np.divmod(np.sort(circle[inside] * len(points) + point[inside]), len(points))


def _refuse_meeting(
    vertices: FloatArray, cells: IntArray, topology: Topology, piece: IntArray, same: IntArray, hanging: IntArray
) -> None:
    """`InputError` if two pieces meet along a line, each with vertices of its own.

    Where an edge of one has the two places of an edge of the other, they match.
    """
    of_vertex = np.empty(len(vertices), dtype=np.int64)
    of_vertex[cells] = piece[:, None]
    twins = same[of_vertex[same[:, 0]] != of_vertex[same[:, 1]]]
    owner = piece[topology.cells[hanging[:, 1], 0]]
    apart = hanging[:, 0][of_vertex[hanging[:, 0]] != owner]
    met = np.concatenate([twins.ravel(), apart])
    line = vertices[met][np.lexsort(vertices[met].T[::-1])]
    if len(met) < 2 or np.ptp(line, axis=0).max() <= _SAME * np.ptp(vertices, axis=0).max():
        return
    other = np.full(len(vertices), -1)
    other[twins], other[twins[:, ::-1]] = twins[:, ::-1], twins
    edges = other[topology.ends[topology.boundary]]
    matching = (topology.number(edges[(edges >= 0).all(axis=1)]) >= 0).any()
    place = f"from ({line[0, 0]:.6g}, {line[0, 1]:.6g}) to ({line[-1, 0]:.6g}, {line[-1, 1]:.6g})"
    if matching and not len(apart):
        remedy = (
            f"two parts of the mesh meet {place}, each with its own vertices in the same places, as {{}}: merge these "
            "nodes (Coherence Mesh in Gmsh), and name the line; a Contact along it separates bodies"
        )
        _refuse(twins[0].tolist(), remedy, vertices[twins[0, 0]])
    vertex = apart[0] if len(apart) else twins[0, 0]
    remedy = (
        f"two parts of the mesh meet {place}, and their vertices do not match there, as {{}}: mesh both as one body "
        "with common nodes on that line (BooleanFragments in Gmsh), and name it; a Contact along it separates bodies. "
        "`join` with a name for it does so, along straight lines and declared arcs"
    )
    _refuse(int(vertex), remedy, vertices[vertex])


def _refuse_pieces(vertices: FloatArray, cells: IntArray, topology: Topology, piece: IntArray) -> None:
    boundary = topology.ends[topology.boundary]
    pinched = np.flatnonzero(np.bincount(boundary.ravel()) > 2)
    if len(pinched):
        remedy = "this vertex at {} alone connects two parts of the body: fill or cut there"
        _refuse(int(pinched[0]), remedy, vertices[pinched[0]])
    count = int(piece.max()) + 1
    if count == 1:
        return
    second = piece[topology.cells[topology.boundary, 0]] == 1
    lines = boundary[second], boundary[~second]
    distance, at = min((_nearest(vertices, *each) for each in (lines, lines[::-1])), key=lambda found: found[0])
    if distance <= _SPACE * float(np.ptp(vertices, axis=0).max()):
        remedy = (
            f"the body consists of this many pieces, and two are {distance:.3g} apart at {{}}: if bodies touch across "
            f"this space, mesh them without it, with common nodes along a joint, and give its Contact "
            f"gap = {distance:.3g}; if they are one body, merge the nodes with a larger tolerance (Geometry.Tolerance "
            "in Gmsh)"
        )
        _refuse(count, remedy, at)
    apart = vertices[cells[piece == 1]].mean(axis=(0, 1))
    _refuse(count, "the body consists of this many pieces, one of them around {}: give one piece", apart)


def _nearest(vertices: FloatArray, one: IntArray, other: IntArray) -> tuple[float, FloatArray]:
    """Least distance from the vertices of some edges to other edges, and where the middle of that space is."""
    points = vertices[np.unique(one)]
    first, second = vertices[other].swapaxes(0, 1)
    along = second - first
    reach = np.hypot(*(points - first[0]).T).min()  # the least distance is no larger
    edge, vertex = _near(points, (first + second) / 2.0, np.hypot(*along.T) / 2.0 + reach)
    offset = points[vertex] - first[edge]
    share = np.clip((offset * along[edge]).sum(axis=1) / np.square(along[edge]).sum(axis=1), 0.0, 1.0)
    across = offset - share[:, None] * along[edge]
    at = int(np.argmin(np.hypot(*across.T)))
    return float(np.hypot(*across[at])), points[vertex[at]] - across[at] / 2.0
