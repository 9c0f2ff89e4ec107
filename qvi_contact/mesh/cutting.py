"""Checks of triangular meshes; triangles cut into smaller ones, with names of edges and regions; bodies joined.

Checks name the place of the first flaw. Bodies that touch are joined by putting the vertices of each side into the
other side. Both sides then have the same vertices and edges, so the common line is as exact as inside one mesh.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, positive_number, real_array
from qvi_contact.basics.schema import LARGEST, located
from qvi_contact.errors import InputError, place_of
from qvi_contact.mesh.curves import ROUNDING, Curve, MeshParts, bent_too_far
from qvi_contact.mesh.edges import Topology, angles, arc_offsets, chains, cross, part_of, reversed_bends, shares_along
from qvi_contact.mesh.selection import between, crossing, in_circles, known_edges, new_name, numbers_of
from solvers.basics.linked import linked

_EQUAL: Final = 1e-9  # sides whose lengths differ by less, relative to the longer one, are equally long
_FLAT_HEIGHT: Final = 1e-8  # smallest height of a triangle, relative to its longest side
_SAME_PLACE: Final = 1e-10  # vertices at this distance, relative to the body's length, coincide
_JOIN_DISTANCE: Final = 1e-6  # the same for two bodies to be joined, whose coordinates are rounded
_SLIT_WIDTH: Final = 30.0  # a hole between bodies is refused if narrower than this × the distance for joining
_ON_EDGE: Final = 1e-9  # a vertex at this distance from an edge, relative to the edge's length, lies on it
_MAX_ROUNDING: Final = 1e-3  # largest such distance that rounded data may explain
_PIECES: Final = 64  # of a curve that is no circle; the distance from a circle falls with the third power


def checked_triangles(vertices: ArrayLike, cells: ArrayLike) -> tuple[FloatArray, IntArray]:
    """Coordinates (n, 2) and triangles (m, 3), each with its vertices in ascending order; checked and read only."""
    points = np.array(numbers_of("TriangleMesh.vertices", vertices, float))
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3:
        raise InputError("TriangleMesh.vertices", f"shape {points.shape}", "give an array (n, 2), n ≥ 3")
    bad = ~(np.abs(points) <= LARGEST).all(axis=1)
    if bad.any():
        remedy = f"this vertex has no finite coordinates of at most {LARGEST:.0e}: correct it, or take other units"
        raise InputError("TriangleMesh.vertices", int(np.argmax(bad)), remedy)
    corners = numbers_of("TriangleMesh.cells", cells, int)
    if corners.ndim != 2 or corners.shape[1] != 3 or not len(corners):
        raise InputError("TriangleMesh.cells", f"shape {corners.shape}", "give an array (m, 3), m ≥ 1")
    unknown = (corners < 0) | (corners >= len(points))
    if unknown.any():
        remedy = f"give numbers of vertices, 0 to {len(points) - 1}"
        raise InputError("TriangleMesh.cells", int(corners[unknown][0]), remedy)
    corners = np.sort(corners, axis=1)
    points.flags.writeable = corners.flags.writeable = False
    return points, corners


def refuse_flaws(mesh: MeshParts) -> None:
    """`InputError` at the first flaw, unless the triangles are a mesh of one piece."""
    vertices, cells, topology = mesh.vertices, mesh.cells, mesh.topology
    corners = vertices.take(cells, axis=0)
    sides = corners - corners[:, [2, 0, 1]]
    is_flat = np.abs(cross(sides[:, 0], sides[:, 1])) <= _FLAT_HEIGHT * np.square(sides).sum(axis=2).max(axis=1)
    _refuse("the triangle of these vertices at {} has no area: leave it out", cells[is_flat], corners[is_flat, 0])
    unused = np.flatnonzero(np.bincount(cells.ravel(), minlength=len(vertices)) == 0)
    _refuse("this vertex at {} belongs to no triangle: leave it out", unused, vertices[unused])
    first, second = vertices.take(topology.ends, axis=0).swapaxes(0, 1)
    midpoints = (first + second) / 2.0
    is_shared = topology.count > 2
    sharing = "more than two triangles share the edge of these vertices around {}: leave out the others"
    _refuse(sharing, topology.ends[is_shared], midpoints[is_shared])
    centres = corners.sum(axis=1).take(topology.cells, axis=0) / 3.0
    side_1, side_2 = (cross(second - first, centres[:, side] - first) for side in (0, 1))
    is_folded = (topology.count == 2) & (side_1 * side_2 > 0.0)
    overlap = "the triangles at the edge of these vertices around {} lie on one side of it and overlap: correct one"
    _refuse(overlap, topology.ends[is_folded], midpoints[is_folded])
    hanging = hanging_vertices(mesh)[0]
    inside_edge = (
        "the first of these vertices, at {}, lies inside the edge of the others: divide the triangle there. Two "
        "bodies whose vertices do not match along a line are meshed as one with common nodes (BooleanFragments in "
        "Gmsh), or `join` with a name for the line does so; a Contact along it separates them"
    )
    _refuse(inside_edge, np.column_stack([hanging[:, 0], topology.ends[hanging[:, 1]]]), vertices[hanging[:, 0]])
    same_place = same_places(vertices)
    in_one_place = (
        "these vertices lie in the same place {}: merge them (Coherence Mesh in Gmsh), and name the line if two "
        "bodies touch there; a Contact along it separates them"
    )
    _refuse(in_one_place, same_place, vertices[same_place[:, 0]])
    pinched = np.flatnonzero(np.bincount(topology.ends[topology.boundary].ravel()) > 2)
    _refuse("this vertex at {} alone connects two parts of the body: fill or cut there", pinched, vertices[pinched])
    piece = _pieces(topology, len(cells))
    if piece.any():
        from scipy.spatial import cKDTree  # slow to import, and few meshes need it

        first_piece, others = (vertices[np.unique(cells[chosen])] for chosen in (piece == 1, piece != 1))
        distances, nearest = map(np.asarray, cKDTree(others).query(first_piece))
        closest = int(np.argmin(distances))
        around = place_of((first_piece[closest] + others[nearest[closest]]) / 2.0)
        remedy = (
            "the body consists of this many pieces; the nearest vertices of two are "
            f"{distances[closest]:.3g} apart around {around}: give one piece. Bodies that touch across a space are "
            "meshed without it, with common nodes along a joint whose Contact has that gap; nodes of one body are "
            "merged with a larger tolerance (Geometry.Tolerance in Gmsh)"
        )
        raise InputError("TriangleMesh", int(piece.max()) + 1, remedy)


def refuse_overlap(mesh: MeshParts) -> None:
    """`InputError` where two sides of the body cross: the body lies on itself there.

    Arcs of circles are exact, other curves are divided into shorter ones, about 1e-8 of an edge's length off. Sides
    that end in a cusp may cross by the rounding of vertices on circles, see `_are_cusps`.
    """
    numbers = mesh.topology.outer
    ends, bends = mesh.vertices[mesh.topology.ends[numbers]], mesh.bends[numbers]
    is_curve = bends[:, [0, *range(2, bends.shape[1])]].any(axis=1)
    t = np.linspace(0.0, 1.0, _PIECES + 1)
    points = ends[is_curve, :1] + arc_offsets(ends[is_curve, 1] - ends[is_curve, 0], bends[is_curve], t)
    points[:, -1] = ends[is_curve, 1]  # without rounding: neighbours have one end
    half_turns = np.append(bends[~is_curve, 1], np.diff(angles(bends[is_curve], t), axis=1) / 2.0)
    all_ends = np.concatenate([ends[~is_curve], np.stack([points[:, :-1], points[:, 1:]], axis=2).reshape(-1, 2, 2)])
    crossed, side = crossing(all_ends, half_turns), np.append(numbers[~is_curve], numbers[is_curve].repeat(_PIECES))
    crossed = crossed[~_are_cusps(mesh, side[crossed])]
    if len(crossed):
        remedy = (
            "two sides of the body cross around this point, so it overlaps itself: correct the vertices there. Sides "
            "that touch have common vertices along a joint; a Contact along it separates them"
        )
        raise InputError("TriangleMesh", place_of(all_ends[crossed[0].min()].mean(axis=0)), remedy)


def _are_cusps(mesh: MeshParts, pairs: IntArray) -> BoolArray:
    """Mask of pairs (k, 2) of edges with a common vertex where they have one tangent, up to rounding of their ends.

    If they cross beyond it, at an angle δ, they overlap by less than δ/4 times the shorter chord. That is rounding if
    it is less than what vertices may be off the smaller of the two circles. Straight edges cross nowhere else.
    """
    ends, t = mesh.topology.ends[pairs], np.linspace(0.0, 1.0, _PIECES + 1)
    chords = np.diff(mesh.vertices[ends] @ [1.0, 1.0j], axis=2)
    bend, lengths = angles(mesh.bends[pairs.ravel()], t).reshape(*pairs.shape, len(t)), np.abs(chords)[:, :, 0]
    away = chords * [1.0, -1.0] * np.exp(1j * bend[:, :, [0, -1]])  # the tangents at both ends, into the edge
    difference = np.abs(np.angle(away[:, 0, :, None] * away[:, 1, None].conj()))
    turn = lengths.min(axis=1) * (np.ptp(bend, axis=2) / lengths).max(axis=1)  # chord over radius
    is_small = difference * turn[:, None, None] / 4.0 <= ROUNDING
    return np.asarray((is_small & (ends[:, 0, :, None] == ends[:, 1, None])).any(axis=(1, 2)))


def _refuse(remedy: str, numbers: IntArray, places: FloatArray) -> None:
    """`InputError` about the first of the wrong entries (k, …), if any, at its place (k, 2)."""
    if len(numbers):
        raise InputError("TriangleMesh", numbers[0].tolist(), remedy.format(place_of(places[0])))


def _pieces(topology: Topology, count: int) -> IntArray:
    """Number of the piece of each triangle, shape (count,); triangles with a common edge are in one piece."""
    first, second = topology.cells[topology.count == 2].T
    return linked(first, second, count)


def same_places(vertices: FloatArray) -> IntArray:
    """Pairs (k, 2) of vertices that coincide up to rounding, sorted."""
    reach = _SAME_PLACE * float(np.ptp(vertices, axis=0).max())
    pairs = np.column_stack(in_circles(vertices, vertices, np.full(len(vertices), reach)))
    return pairs[pairs[:, 0] < pairs[:, 1]]


def hanging_vertices(mesh: MeshParts, reach: float = 0.0) -> tuple[IntArray, FloatArray]:
    """Pairs (k, 2) of a vertex and a boundary edge inside which it lies, and its fraction (k,) of the edge's length.

    Coordinates may be rounded by a distance `reach` [length], on arcs relative to the radius; then vertices close to an
    end count too.
    """
    vertices, topology = mesh.vertices, mesh.topology
    outer = np.flatnonzero(topology.boundary & (mesh.chords > 0.0))  # edges without length hold no vertex
    first, second = vertices.take(topology.ends.take(outer, axis=0), axis=0).swapaxes(0, 1)
    lengths = mesh.chords[outer]
    candidates = np.bincount(topology.ends[outer].ravel()).nonzero()[0]
    margin = 1e-6 if reach else -1e-6
    edge, vertex = in_circles(vertices[candidates], (first + second) / 2.0, lengths * (0.5 + margin))
    vertex = candidates[vertex]
    offset, chord, length = vertices[vertex] - first[edge], (second - first)[edge], lengths[edge]
    bend = mesh.bends[outer[edge]]
    share = shares_along(chord, bend, offset)
    distance = np.hypot(*(arc_offsets(chord, bend, share[:, None])[:, 0] - offset).T) / length
    rounding = np.maximum(_ON_EDGE, np.minimum(reach / length, _MAX_ROUNDING))
    if reach:  # of vertices on arcs relative to the radius, which is about the edge's length over its angle
        is_arc, turn = bend.any(axis=1), np.ptp(angles(bend, np.array([0.0, 1.0])), axis=1)
        rounding[is_arc] = np.minimum(ROUNDING / turn[is_arc], _MAX_ROUNDING)
    is_hanging = (distance <= rounding) & (share > 0.0) & (share < 1.0)
    return np.column_stack([vertex[is_hanging], outer[edge[is_hanging]]]), share[is_hanging]


# triangles cut into smaller ones

_MAX_HALVINGS: Final = 6  # of an arc: enough unless it crosses other edges
_ANGLE_ROUNDING: Final = 1e-9  # relative excess of an angle that is rounding


def bisected(mesh: MeshParts, marked: ArrayLike | None = None) -> MeshParts:
    """See `TriangleMesh.refined`: old vertices keep their numbers, new ones are midpoints of edges and arcs."""
    count = len(mesh.cells)
    remedy = f"give numbers of triangles, 0 to {count - 1}, or a boolean for each of the {count}"
    if marked is not None:
        _ = real_array("marked", marked, remedy)
    chosen = np.arange(count) if marked is None else np.asarray(marked)
    if chosen.dtype == bool and chosen.shape == (count,):
        chosen = np.flatnonzero(chosen)
    whole = chosen.dtype.kind in "iu" or not chosen.size
    if chosen.ndim != 1 or not whole or chosen.min(initial=0) < 0 or chosen.max(initial=0) >= count:
        raise InputError("marked", marked, remedy)
    return divided_at_arcs(_bisected(mesh, chosen.astype(np.int64)))


def divided_at_arcs(mesh: MeshParts) -> MeshParts:
    """The mesh with triangles divided whose arcs bend too far for them; some are left where arcs cross other edges."""
    for _ in range(_MAX_HALVINGS if mesh.arcs else 0):
        flat = np.flatnonzero(bent_too_far(mesh).any(axis=1))
        if not len(flat):
            break
        mesh = _bisected(mesh, flat)
    return mesh


def fanned(mesh: MeshParts, vertices: IntArray, angle: float) -> MeshParts:
    """The mesh with fans of triangles of at most this angle [rad] around vertices, see `TriangleMesh.fanned`."""
    chosen, count = numbers_of("vertices", vertices, int), len(mesh.vertices)
    if chosen.ndim != 1 or chosen.min(initial=0) < 0 or chosen.max(initial=0) >= count:
        raise InputError("vertices", vertices, f"give numbers of vertices, 0 to {count - 1}")
    angle = (1.0 + _ANGLE_ROUNDING) * positive_number("angle", angle)
    for vertex in chosen.tolist():
        is_narrow = False
        while not is_narrow:
            mesh = _cut_across(mesh, vertex)
            opposite, at_vertex = angles_at(mesh, vertex)
            mesh = _halved(mesh, np.unique(mesh.topology.number(opposite[at_vertex > angle])))
            is_narrow = angles_at(mesh, vertex)[1].max() <= angle
    return divided_at_arcs(mesh)


def layered(mesh: MeshParts, vertices: IntArray, ratio: float) -> MeshParts:
    """The triangles at vertices (k,) cut across, at a fraction `ratio` of their edges from there; no arc ends there."""
    for vertex in vertices.tolist():
        n_old, mesh = len(mesh.vertices), _cut_across(mesh, vertex)
        mesh.vertices[n_old:] += (1.0 - 2.0 * ratio) * (mesh.vertices[vertex] - mesh.vertices[n_old:])
    return divided_at_arcs(mesh)


def _cut_across(mesh: MeshParts, vertex: int) -> MeshParts:
    """The triangles at a vertex cut across, through the midpoints of their edges at the vertex."""
    return _halved(mesh, np.flatnonzero((mesh.topology.ends == vertex).any(axis=1)))


def angles_at(mesh: MeshParts, vertex: int) -> tuple[IntArray, FloatArray]:
    """For the triangles at a vertex, the opposite edges (k, 2) and the angles at the vertex (k,) [rad]."""
    cells = mesh.cells[(mesh.cells == vertex).any(axis=1)]
    opposite = cells[cells != vertex].reshape(-1, 2)
    first, second = (mesh.vertices[opposite[:, end]] - mesh.vertices[vertex] for end in (0, 1))
    return opposite, np.abs(np.arctan2(cross(first, second), (first * second).sum(axis=1)))


def _bisected(mesh: MeshParts, marked: IntArray) -> MeshParts:
    """The mesh with all edges of marked triangles (k,) halved, and the longest of each triangle with a halved one.

    Of several longest edges of equal length one halved edge is enough. If none of them is halved, or more than one,
    all three edges are halved: else the numbers of the vertices would choose one.
    """
    sides, lengths = mesh.topology.of_cells, mesh.chords[mesh.topology.of_cells]
    is_halved = np.zeros(len(mesh.topology.ends), dtype=bool)
    is_halved[sides[marked]] = True
    is_longest = lengths >= (1.0 - _EQUAL) * lengths.max(axis=1, keepdims=True)
    is_alone, count = is_longest.sum(axis=1, keepdims=True) == 1, 0
    while count < (count := int(is_halved.sum())):  # it only grows
        halved_sides = is_halved[sides]
        to_halve = np.where(is_alone, is_longest, (halved_sides & is_longest).sum(axis=1, keepdims=True) != 1)
        is_halved[sides[to_halve & halved_sides.any(axis=1, keepdims=True)]] = True
    return _halved(mesh, np.flatnonzero(is_halved))


def _halved(mesh: MeshParts, edges: IntArray) -> MeshParts:
    """The mesh with the edges of these numbers (k,) halved, and only the triangles at these edges divided.

    A triangle with one halved edge is cut in two. With two it is cut in three, from the midpoint of the longer one;
    with three in four. Names are kept. `InputError` if new vertices coincide up to rounding.
    """
    topology, n_old = mesh.topology, len(mesh.vertices)
    new_vertex = np.full(len(topology.ends), -1)
    new_vertex[edges] = new = n_old + np.arange(len(edges))
    vertices = np.concatenate([mesh.vertices, mesh.vertices[topology.ends[edges]].mean(axis=1)])
    same_place = same_places(vertices)
    if len(same_place):
        place = tuple(vertices[same_place[0, 0]].tolist())
        raise InputError("marked", place, "triangles here are too small to be halved: leave them out of `marked`")
    # nodes of a triangle: corners 0 to 2, then new vertices 3 to 5 of the sides opposite to them (−1: not halved);
    # rotated so that the first cut of a triangle with one or two halved sides leads from corner 0 to node 3
    sides = new_vertex[topology.of_cells]
    count = (sides >= 0).sum(axis=1)
    one_or_two, all_three = (count == 1) | (count == 2), count == 3
    # the longest halved side; of two equal ones the next counterclockwise after the third side
    lengths = np.where(sides >= 0, mesh.chords[topology.of_cells], -1.0)
    first, second = np.diff(mesh.vertices[mesh.cells], axis=1).swapaxes(0, 1)
    are_equal = (lengths >= (1.0 - _EQUAL) * lengths.max(axis=1, keepdims=True)).sum(axis=1) == 2
    after = (lengths.argmin(axis=1) + np.where(cross(first, second) > 0.0, 1, 2)) % 3
    rotation = np.where(one_or_two, np.where(are_equal, after, lengths.argmax(axis=1)), 0)[:, None] + np.arange(3)
    nodes = np.concatenate([np.take_along_axis(each, rotation % 3, axis=1) for each in (mesh.cells, sides)], axis=1)
    last_is_cut, next_is_cut = nodes[:, 5] >= 0, nodes[:, 4] >= 0
    children, parents = list[IntArray](), list[IntArray]()
    for chosen, corners in (
        (count == 0, [0, 1, 2]),
        *((all_three, each) for each in ([0, 4, 5], [1, 3, 5], [2, 3, 4], [3, 4, 5])),
        (one_or_two & ~last_is_cut, [0, 1, 3]),
        *((one_or_two & last_is_cut, each) for each in ([0, 3, 5], [1, 3, 5])),
        (one_or_two & ~next_is_cut, [0, 2, 3]),
        *((one_or_two & next_is_cut, each) for each in ([0, 3, 4], [2, 3, 4])),
    ):
        parents.append(np.flatnonzero(chosen))
        children.append(nodes[parents[-1][:, None], corners])
    new_cells, parent = np.sort(np.concatenate(children), axis=1), np.concatenate(parents)
    # edges that are not halved, and the two halves of the others as fractions of their lengths
    unchanged, (low, high) = np.flatnonzero(new_vertex < 0), topology.ends[edges].T
    ends = np.concatenate([topology.ends[unchanged], np.column_stack([low, new]), np.column_stack([high, new])])
    shares = np.repeat([(0.0, 1.0), (0.0, 0.5), (1.0, 0.5)], [len(unchanged), len(edges), len(edges)], axis=0)
    is_arc = mesh.bends[edges].any(axis=1)
    first, second = mesh.vertices[topology.ends[edges[is_arc]]].swapaxes(0, 1)
    vertices[new[is_arc]] = first + arc_offsets(second - first, mesh.bends[edges[is_arc]], np.array([0.5]))[:, 0]
    return rebuilt(mesh, vertices, new_cells, parent, np.concatenate([unchanged, edges, edges]), ends, shares)


def rebuilt(
    mesh: MeshParts, vertices: FloatArray, cells: IntArray, parent: IntArray,
    whole: IntArray, ends: IntArray, shares: FloatArray,
) -> MeshParts:  # fmt: skip
    """New triangles with the names and arcs of a mesh; sets that would be empty are dropped.

    The new triangles are parts of the mesh's triangles `parent` (m,). New edges `ends` (k, 2) are parts of its edges
    `whole` (k,), between the fractions `shares` (k, 2) of their lengths.
    """
    sets = {name: ends[np.isin(whole, known_edges(name, old, mesh.topology))] for name, old in mesh.edge_sets.items()}
    regions = {name: np.flatnonzero(np.isin(parent, old)) for name, old in mesh.regions.items()}
    sets, regions = ({name: new for name, new in each.items() if len(new)} for each in (sets, regions))
    arcs = np.flatnonzero(mesh.bends[whole].any(axis=1))
    arcs = arcs[np.unique(ends[arcs], axis=0, return_index=True)[1]]  # every edge once
    if not len(arcs):
        return MeshParts(vertices, cells, sets, regions)
    bends, (start, stop) = mesh.bends[whole[arcs]], np.sort(shares[arcs], axis=1).T
    new_bends = np.where((stop - start < 1.0)[:, None], part_of(bends, start, stop), bends)
    new_bends = np.where(shares[arcs, :1] > shares[arcs, 1:], reversed_bends(new_bends), new_bends)
    return MeshParts(vertices, cells, sets, regions, [Curve(ends[arcs], new_bends)])


def part(mesh: MeshParts, cells: IntArray) -> MeshParts:
    """The triangles with numbers (k,) as a mesh, see `TriangleMesh.part`."""
    whole = np.flatnonzero(np.isin(mesh.topology.cells, cells).any(axis=1))
    ends, shares = mesh.topology.ends[whole], np.tile([0.0, 1.0], (len(whole), 1))
    return rebuilt(mesh, mesh.vertices, mesh.cells[cells], cells, whole, ends, shares).without_others()


def stacked(meshes: Sequence[MeshParts]) -> MeshParts:
    """Several meshes as one of several pieces; edge sets and regions with the same name are united."""
    cells, arcs = [], list[Curve]()
    edge_sets, regions = dict[str, IntArray](), dict[str, IntArray]()
    nodes = count = 0
    for mesh in meshes:
        cells.append(mesh.cells + nodes)
        arcs += [Curve(arc.edges + nodes, arc.coefficients) for arc in mesh.arcs]
        for name, pairs in mesh.edge_sets.items():
            edge_sets[name] = np.concatenate([edge_sets.get(name, pairs[:0]), pairs + nodes])
        for name, chosen in mesh.regions.items():
            regions[name] = np.concatenate([regions.get(name, chosen[:0]), chosen + count])
        nodes, count = nodes + len(mesh.vertices), count + len(mesh.cells)
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    return MeshParts(vertices, np.concatenate(cells), edge_sets, regions, arcs)


def joined(mesh: MeshParts, name: str) -> MeshParts:
    """See `TriangleMesh.joined`; `InputError` if the name is taken, or no pieces touch along lines or declared arcs."""
    with located("join", ()):
        new_name(name, mesh.edge_sets)
    vertices, cells, topology = mesh.vertices, mesh.cells, mesh.topology
    piece = _pieces(topology, len(cells))
    own_piece = np.empty(len(vertices), dtype=np.int64)
    own_piece[cells] = piece[:, None]
    # merge vertices of different pieces that coincide up to rounding
    reach = _JOIN_DISTANCE * mesh.length
    radius = np.minimum(2.0 * reach, _MAX_ROUNDING * mesh.finest)
    one, two = in_circles(vertices, vertices, radius)
    coincide = (own_piece[one] != own_piece[two]) & (np.hypot(*(vertices[one] - vertices[two]).T) <= radius[two])
    merged = linked(one[coincide], two[coincide], len(vertices))
    _, first, new_number = np.unique(merged, return_index=True, return_inverse=True)
    # vertices of one piece inside boundary edges of another piece
    hanging, shares = hanging_vertices(mesh, reach)
    is_other_piece = own_piece[hanging[:, 0]] != piece[topology.cells[hanging[:, 1], 0]]
    is_other_piece &= (new_number[hanging[:, :1]] != new_number[topology.ends[hanging[:, 1]]]).all(axis=1)
    # for each edge in turn its first vertex, the vertices of other pieces inside it, and its last vertex
    edges = np.arange(len(topology.ends))
    edge = np.concatenate([edges, hanging[is_other_piece, 1], edges])
    share = np.concatenate([np.zeros(len(edges)), shares[is_other_piece], np.ones(len(edges))])
    vertex = new_number[np.concatenate([topology.ends[:, 0], hanging[is_other_piece, 0], topology.ends[:, 1]])]
    order = np.lexsort((share, edge))
    edge, share, vertex = edge[order], share[order], vertex[order]
    # a vertex that two pieces have in the same place counts once; the end of an edge always stays
    is_kept = np.append(True, (np.diff(edge) > 0) | (np.diff(vertex) != 0) | (share[1:] == 1.0))
    edge, share, vertex = edge[is_kept], share[is_kept], vertex[is_kept]
    # cut the triangles at these vertices; their edges are parts of the old ones, between neighbouring vertices
    new_cells, parent = _fans(new_number[cells], topology, edge, vertex)
    step = np.flatnonzero(edge[1:] == edge[:-1])[:, None] + [0, 1]
    whole, order = edge[step[:, 0]], np.argsort(vertex[step], axis=1)
    ends, fractions = (np.take_along_axis(each[step], order, axis=1) for each in (vertex, share))
    union = rebuilt(mesh, vertices[first], new_cells, parent, whole, ends, fractions)
    fine = union.topology
    # the joint: edges between triangles of two pieces
    is_joint = (fine.count == 2) & (piece[parent[fine.cells[:, 0]]] != piece[parent[fine.cells[:, 1]]])
    if not is_joint.any():
        remedy = "no pieces of this mesh touch along straight lines or declared arcs: leave it out"
        raise InputError("join", name, remedy)
    _refuse_slits(union, _SLIT_WIDTH * reach, piece[parent])
    # a named part of the boundary loses its edges in the joint, unless no other edge remains
    rest = {other: pairs[~is_joint[fine.number(pairs)]] for other, pairs in union.edge_sets.items()}
    edge_sets = {other: rest[other] if len(rest[other]) else pairs for other, pairs in union.edge_sets.items()}
    return divided_at_arcs(replace(union, edge_sets={name: fine.ends[is_joint], **edge_sets}))


def _refuse_slits(mesh: MeshParts, width: float, piece: IntArray) -> None:
    """`InputError` about the first hole between bodies narrower than `width`, 2 area / perimeter."""
    vertices, cells, topology = mesh.vertices, mesh.cells, mesh.topology
    ends = topology.ends[topology.boundary]
    third = cells[topology.cells[topology.boundary, 0]].sum(axis=1) - ends.sum(axis=1)
    start, stop, opposite = (vertices[each] - vertices[0] for each in (*ends.T, third))
    lengths, midpoints = np.hypot(*(stop - start).T), vertices[ends].mean(axis=1)
    double_areas = cross(start, stop) * np.sign(cross(stop - start, opposite - start))  # sum: 2 × enclosed area
    piece = piece[topology.cells[topology.boundary, 0]]  # bodies may have narrow holes of their own
    for line in chains(ends):
        if np.ptp(piece[line]) and abs(double_areas[line].sum()) < width * lengths[line].sum():
            distance, around = abs(double_areas[line].sum()) / lengths[line].sum(), place_of(midpoints[line[0]])
            remedy = f"the bodies touch at some of their vertices and are {distance:.1g} apart around {around}: "
            raise InputError("join", distance, f"{remedy}give their coordinates with more digits")


def _fans(corners: IntArray, topology: Topology, edge: IntArray, vertex: IntArray) -> tuple[IntArray, IntArray]:
    """Triangles (m, 3) with vertices inside their sides, cut from the opposite corners; and the parent (m,) of each.

    `vertex` (k,) are the vertices along all edges (k,), from the first end of each edge to its second end.
    """
    count = np.bincount(edge) - 1  # parts of each edge
    start = np.searchsorted(edge, np.arange(len(count)))
    sides, parent = topology.of_cells, np.arange(len(corners))  # −1 for sides made by a cut
    for s, direction in enumerate((1, -1, 1)):  # of side s in the sense corner 0, 1, 2; edges lead to higher numbers
        n_parts = np.where(sides[:, s] < 0, 1, count[sides[:, s]])
        source, part = between(0 * n_parts, n_parts)
        corners, sides, parent, n_parts = corners[source], sides[source], parent[source], n_parts[source]
        is_old = sides[:, s] >= 0
        position = start[sides[:, s]] + (part if direction > 0 else n_parts - part)
        corners[is_old, s - 2], corners[is_old, s - 1] = vertex[position[is_old]], vertex[position[is_old] + direction]
        sides[part < n_parts - 1, s - 2] = sides[part > 0, s - 1] = -1
    return np.sort(corners, axis=1), parent
