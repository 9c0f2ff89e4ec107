"""What a mesh of triangles must be: checks that name the place of the first fault."""

from typing import Final, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.errors import InputError
from qvi_contact.mesh.curves import ROUNDING
from qvi_contact.mesh.edges import Topology, angles, arc_offsets, cross, linked
from qvi_contact.mesh.selection import numbers_of

LARGEST: Final = 1e100  # of a coordinate: squares and areas of larger ones are beyond floating-point numbers
_FLAT: Final = 1e-8  # height over longest side below which a triangle is none
_SAME: Final = 1e-10  # distance of vertices over the body's length below which they are in one place
_ASLANT: Final = (np.cos(1.0), np.sin(1.0))
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
    a, b, c = vertices[cells].swapaxes(0, 1)
    sides = np.stack([b - a, c - b, a - c])
    flat = np.abs(cross(sides[0], sides[1])) <= _FLAT * np.square(sides).sum(axis=2).max(axis=0)
    _refuse(flat, cells, "the triangle of these vertices at {} has no area: leave it out", a)
    all_vertices = np.arange(len(vertices))
    unused = np.bincount(cells.ravel(), minlength=len(vertices)) == 0
    _refuse(unused, all_vertices, "this vertex at {} belongs to no triangle: leave it out", vertices)
    first, second = vertices[topology.ends].swapaxes(0, 1)
    middles = (first + second) / 2.0
    shared = "more than two triangles share the edge of these vertices around {}: leave out the others"
    _refuse(topology.count > 2, topology.ends, shared, middles)
    centres = (a + b + c)[topology.cells] / 3.0
    one, other = (cross(second - first, centres[:, side] - first) for side in (0, 1))
    folded = (topology.count == 2) & (one * other > 0.0)
    overlap = "the triangles at the edge of these vertices around {} lie on one side of it and overlap: correct one"
    _refuse(folded, topology.ends, overlap, middles)
    hanging = hanging_vertices(vertices, topology)[0]
    inside = (
        "the first of these vertices, at {}, lies inside the edge of the others: divide the triangle there. Two bodies "
        "whose vertices do not match along a line are meshed as one with common nodes (BooleanFragments in Gmsh), or "
        "`join` with a name for the line does so; a Contact along it separates them"
    )
    named = np.column_stack([hanging[:, 0], topology.ends[hanging[:, 1]]])
    _refuse(np.ones(len(named), dtype=bool), named, inside, vertices[named[:, 0]])
    same = same_places(vertices)
    twins = (
        "these vertices lie in the same place {}: merge them (Coherence Mesh in Gmsh), and name the line if two bodies "
        "touch there; a Contact along it separates them"
    )
    _refuse(np.ones(len(same), dtype=bool), same, twins, vertices[same[:, 0]])
    pinched = np.bincount(topology.ends[topology.boundary].ravel(), minlength=len(vertices)) > 2
    alone = "this vertex at {} alone connects two parts of the body: fill or cut there"
    _refuse(pinched, all_vertices, alone, vertices)
    piece = pieces(topology, len(cells))
    if piece.any():
        _refuse_pieces(vertices, cells, piece)


def _refuse(wrong: BoolArray, given: IntArray, remedy: str, places: FloatArray) -> None:
    """`InputError` about the first of some things (k,) that is wrong, if any is, at its place, (k, 2)."""
    if wrong.any():
        number = int(np.argmax(wrong))
        x, y = places[number]
        raise InputError("TriangleMesh", given[number].tolist(), remedy.format(f"({x:.6g}, {y:.6g})"))


def _refuse_pieces(vertices: FloatArray, cells: IntArray, piece: IntArray) -> NoReturn:
    from scipy.spatial import cKDTree  # slow to import, and few meshes need it

    apart, others = (vertices[np.unique(cells[chosen])] for chosen in (piece == 1, piece != 1))
    distances, nearest = map(np.asarray, cKDTree(others).query(apart))
    at = int(np.argmin(distances))
    x, y = (apart[at] + others[nearest[at]]) / 2.0
    remedy = (
        f"the body consists of this many pieces; the nearest vertices of two are {distances[at]:.3g} apart around "
        f"({x:.6g}, {y:.6g}): give one piece. Bodies that touch across a space are meshed without it, with common "
        "nodes along a joint whose Contact has that gap; nodes of one body are merged with a larger tolerance "
        "(Geometry.Tolerance in Gmsh)"
    )
    raise InputError("TriangleMesh", int(piece.max()) + 1, remedy)


def pieces(topology: Topology, count: int) -> IntArray:
    """The number of the piece of each of so many triangles (m,): those joined by edges are one."""
    first, second = topology.cells[topology.count == 2].T
    return linked(first, second, count)


def same_places(vertices: FloatArray) -> IntArray:
    """Pairs (k, 2) of vertices too near each other to be told apart, in order."""
    reach = np.full(len(vertices), _SAME * float(np.ptp(vertices, axis=0).max()))
    pairs = np.column_stack(_near(vertices, vertices, reach))
    return pairs[pairs[:, 0] < pairs[:, 1]]


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
