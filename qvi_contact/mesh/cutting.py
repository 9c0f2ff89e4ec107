"""What a mesh of triangles must be, and triangles cut into smaller ones, with the names of edges and regions.

Checks name the place of the first fault. Bodies that touch are joined by putting nodes of either into the other: both
sides have the same nodes and edges afterwards, and everything on the line is as exact as on one mesh.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, positive_number, real_array, whole_number
from qvi_contact.basics.schema import LARGEST
from qvi_contact.errors import InputError, place_of
from qvi_contact.mesh.curves import ROUNDING, Curve, MeshParts, bent_too_far
from qvi_contact.mesh.edges import Topology, angles, arc_offsets, chains, cross, part_of, reversed_bends, shares_along
from qvi_contact.mesh.selection import ASLANT, in_circles, known_edges, new_name, numbers_of
from solvers.basics.linked import linked

_EQUAL: Final = 1e-9  # of a length: what equal sides differ by
_FLAT: Final = 1e-8  # height over longest side below which a triangle is none
_SAME: Final = 1e-10  # distance of vertices over the body's length below which they are in one place
_NEAR: Final = 1e-6  # the same of bodies to be joined, whose data are rounded
_SLIT: Final = 30.0  # width of a hole over that, below which it is none
_ON_EDGE: Final = 1e-9  # distance from an edge over its length below which a vertex lies on it
_FARTHEST: Final = 1e-3  # the same of arcs at most


def checked_triangles(vertices: ArrayLike, cells: ArrayLike) -> tuple[FloatArray, IntArray]:
    """Finite coordinates (n, 2), and three vertices a triangle, in ascending order, (m, 3); both are read only."""
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
    wrong = (corners < 0) | (corners >= len(points))
    if wrong.any():
        remedy = f"give numbers of vertices, 0 to {len(points) - 1}"
        raise InputError("TriangleMesh.cells", int(corners[wrong][0]), remedy)
    corners = np.sort(corners, axis=1)
    points.flags.writeable = corners.flags.writeable = False
    return points, corners


def refuse_flaws(mesh: MeshParts) -> None:
    """`InputError` unless triangles are a mesh of one piece."""
    vertices, cells, topology = mesh.vertices, mesh.cells, mesh.topology
    corners = vertices.take(cells, axis=0)
    sides = corners - corners[:, [2, 0, 1]]
    flat = np.abs(cross(sides[:, 0], sides[:, 1])) <= _FLAT * np.square(sides).sum(axis=2).max(axis=1)
    _refuse(flat, cells, "the triangle of these vertices at {} has no area: leave it out", corners[:, 0])
    all_vertices = np.arange(len(vertices))
    unused = np.bincount(cells.ravel(), minlength=len(vertices)) == 0
    _refuse(unused, all_vertices, "this vertex at {} belongs to no triangle: leave it out", vertices)
    first, second = vertices.take(topology.ends, axis=0).swapaxes(0, 1)
    middles = (first + second) / 2.0
    shared = "more than two triangles share the edge of these vertices around {}: leave out the others"
    _refuse(topology.count > 2, topology.ends, shared, middles)
    centres = corners.sum(axis=1).take(topology.cells, axis=0) / 3.0
    one, other = (cross(second - first, centres[:, side] - first) for side in (0, 1))
    folded = (topology.count == 2) & (one * other > 0.0)
    overlap = "the triangles at the edge of these vertices around {} lie on one side of it and overlap: correct one"
    _refuse(folded, topology.ends, overlap, middles)
    hanging, same = hanging_vertices(vertices, topology)[0], same_places(vertices)
    inside_edges = (
        "the first of these vertices, at {}, lies inside the edge of the others: divide the triangle there. Two "
        "bodies whose vertices do not match along a line are meshed as one with common nodes (BooleanFragments in "
        "Gmsh), or `join` with a name for the line does so; a Contact along it separates them"
    )
    in_one_place = (
        "these vertices lie in the same place {}: merge them (Coherence Mesh in Gmsh), and name the line if two "
        "bodies touch there; a Contact along it separates them"
    )
    hanging = np.column_stack([hanging[:, 0], topology.ends[hanging[:, 1]]])
    for named, remedy in ((hanging, inside_edges), (same, in_one_place)):
        _refuse(np.ones(len(named), dtype=bool), named, remedy, vertices[named[:, 0]])
    pinched = np.bincount(topology.ends[topology.boundary].ravel(), minlength=len(vertices)) > 2
    alone = "this vertex at {} alone connects two parts of the body: fill or cut there"
    _refuse(pinched, all_vertices, alone, vertices)
    piece = pieces(topology, len(cells))
    if piece.any():
        from scipy.spatial import cKDTree  # slow to import, and few meshes need it

        apart, others = (vertices[np.unique(cells[chosen])] for chosen in (piece == 1, piece != 1))
        distances, nearest = map(np.asarray, cKDTree(others).query(apart))
        at = int(np.argmin(distances))
        around = place_of((apart[at] + others[nearest[at]]) / 2.0)
        remedy = (
            f"the body consists of this many pieces; the nearest vertices of two are {distances[at]:.3g} apart around "
            f"{around}: give one piece. Bodies that touch across a space are meshed without it, with common nodes "
            "along a joint whose Contact has that gap; nodes of one body are merged with a larger tolerance "
            "(Geometry.Tolerance in Gmsh)"
        )
        raise InputError("TriangleMesh", int(piece.max()) + 1, remedy)


def _refuse(wrong: BoolArray, given: IntArray, remedy: str, places: FloatArray) -> None:
    """`InputError` about the first of some things (k,) that is wrong, if any is, at its place, (k, 2)."""
    if np.count_nonzero(wrong):
        number = int(np.argmax(wrong))
        raise InputError("TriangleMesh", given[number].tolist(), remedy.format(place_of(places[number])))


def pieces(topology: Topology, count: int) -> IntArray:
    """The number of the piece of each of so many triangles (m,): those joined by edges are one."""
    first, second = topology.cells[topology.count == 2].T
    return linked(first, second, count)


def same_places(vertices: FloatArray) -> IntArray:
    """Pairs (k, 2) of vertices too near each other to be told apart, in order."""
    reach = _SAME * float(np.ptp(vertices, axis=0).max())
    if np.diff(np.sort((vertices - vertices[0]) @ ASLANT)).min(initial=np.inf) > 2.0 * reach:  # as nearly always
        return np.empty((0, 2), dtype=np.int64)
    pairs = np.column_stack(in_circles(vertices, vertices, np.full(len(vertices), reach)))
    return pairs[pairs[:, 0] < pairs[:, 1]]


def hanging_vertices(
    vertices: FloatArray, topology: Topology, bends: FloatArray | None = None, reach: float = 0.0
) -> tuple[IntArray, FloatArray]:
    """Pairs (k, 2) of a vertex and an edge of the boundary it lies inside: two triangles meet one along its side.

    And the shares (k,) of the edges' lengths at which they do. Edges follow their arcs where `bends` are given. Data
    may be rounded by a distance `reach`; then vertices near an end count too.
    """
    outer = topology.outer
    first, second = vertices.take(topology.ends.take(outer, axis=0), axis=0).swapaxes(0, 1)
    lengths = np.hypot(*(second - first).T)
    if not lengths.all():  # others hold nothing
        outer, first, second, lengths = (each[lengths > 0.0] for each in (outer, first, second, lengths))
    candidates = np.bincount(topology.ends[outer].ravel()).nonzero()[0]
    end = 1e-6 if reach else -1e-6
    edge, vertex = in_circles(vertices[candidates], (first + second) / 2.0, lengths * (0.5 + end))
    if not len(edge):
        return np.empty((0, 2), dtype=np.int64), np.empty(0)
    vertex = candidates[vertex]
    offset, chord, length = vertices[vertex] - first[edge], (second - first)[edge], lengths[edge]
    bend = np.zeros((len(edge), 1)) if bends is None else bends[outer[edge]]
    share = shares_along(chord, bend, offset)
    distance = np.hypot(*(arc_offsets(chord, bend, share[:, None])[:, 0] - offset).T) / length
    # data of an arc are rounded by a share of its radius, which is about the edge's length over its angle
    arc, turn = bend.any(axis=1), np.ptp(angles(bend, np.array([0.0, 1.0])), axis=1)
    rounding = np.maximum(_ON_EDGE, np.minimum(reach / length, _FARTHEST))
    rounding[arc] = np.minimum(ROUNDING / turn[arc], _FARTHEST)
    hanging = (distance <= rounding) & (share > 0.0) & (share < 1.0)
    return np.column_stack([vertex[hanging], outer[edge[hanging]]]), share[hanging]


# triangles cut

_DIVISIONS: Final = 6  # halvings of an arc until its triangle is high enough
_ROUNDING: Final = 1e-9  # of angles, as a share


def bisected(mesh: MeshParts, marked: ArrayLike | None = None) -> MeshParts:
    """See `TriangleMesh.refined`: old vertices keep their numbers, new ones are middles of old edges and arcs."""
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
    """The mesh with triangles divided whose sides bend too far for them; some are left if arcs cross other edges."""
    for _ in range(_DIVISIONS if mesh.arcs else 0):
        flat = np.flatnonzero(bent_too_far(mesh).any(axis=1))
        if not len(flat):
            break
        mesh = _bisected(mesh, flat)
    return mesh


def fanned(mesh: MeshParts, vertices: IntArray, angle: float, layers: int) -> MeshParts:
    """The mesh with fans of triangles of at most this angle [rad] around vertices, see `TriangleMesh.fanned`."""
    chosen, count = numbers_of("vertices", vertices, int), len(mesh.vertices)
    if chosen.ndim != 1 or chosen.min(initial=0) < 0 or chosen.max(initial=0) >= count:
        raise InputError("vertices", vertices, f"give numbers of vertices, 0 to {count - 1}")
    angle = (1.0 + _ROUNDING) * positive_number("angle", angle)
    layers = whole_number("layers", layers)
    for vertex in chosen.tolist():
        done = 0
        while done < layers or angles_at(mesh, vertex)[1].max() > angle:
            mesh = _cut_across(mesh, vertex)
            opposite, turn = angles_at(mesh, vertex)
            mesh = _halved(mesh, np.unique(mesh.topology.number(opposite[turn > angle])))
            done += 1
    return divided_at_arcs(mesh)


def layered(mesh: MeshParts, vertices: IntArray, ratio: float) -> MeshParts:
    """The triangles at vertices (k,) where no arc ends cut across, at a share `ratio` of their edges from there."""
    for vertex in vertices.tolist():
        old, mesh = len(mesh.vertices), _cut_across(mesh, vertex)
        mesh.vertices[old:] += (1.0 - 2.0 * ratio) * (mesh.vertices[vertex] - mesh.vertices[old:])
    return divided_at_arcs(mesh)


def _cut_across(mesh: MeshParts, vertex: int) -> MeshParts:
    """The triangles at a vertex cut across, in the middle of their edges there."""
    return _halved(mesh, np.flatnonzero((mesh.topology.ends == vertex).any(axis=1)))


def angles_at(mesh: MeshParts, vertex: int) -> tuple[IntArray, FloatArray]:
    """The opposite edges (k, 2) of the triangles at a vertex, and their angles there (k,) [rad]."""
    cells = mesh.cells[(mesh.cells == vertex).any(axis=1)]
    opposite = cells[cells != vertex].reshape(-1, 2)
    one, other = (mesh.vertices[opposite[:, end]] - mesh.vertices[vertex] for end in (0, 1))
    return opposite, np.abs(np.arctan2(cross(one, other), (one * other).sum(axis=1)))


def _bisected(mesh: MeshParts, marked: IntArray) -> MeshParts:
    """All edges of marked triangles (k,) halved, and the longest one of each triangle that has any.

    Of equal longest edges one that is halved is enough. Where none is, or more are, all three edges are halved: else
    the numbers of the vertices would choose one.
    """
    sides, lengths = mesh.topology.of_cells, _lengths(mesh)
    halved = np.zeros(len(mesh.topology.ends), dtype=bool)
    halved[sides[marked]] = True
    longest = lengths >= (1.0 - _EQUAL) * lengths.max(axis=1, keepdims=True)
    alone, count = longest.sum(axis=1, keepdims=True) == 1, 0
    while count < (count := int(halved.sum())):
        own = halved[sides]
        wanted = np.where(alone, longest, (own & longest).sum(axis=1, keepdims=True) != 1)
        halved[sides[wanted & own.any(axis=1, keepdims=True)]] = True
    return _halved(mesh, np.flatnonzero(halved))


def _lengths(mesh: MeshParts) -> FloatArray:
    """Lengths (m, 3) of the sides of triangles."""
    first, second = mesh.vertices[mesh.topology.ends].swapaxes(0, 1)
    return np.asarray(np.sqrt(np.square(first - second).sum(axis=1))[mesh.topology.of_cells])


def _halved(mesh: MeshParts, number: IntArray) -> MeshParts:
    """The mesh with these edges (k,) of its topology halved, and the triangles beside them divided; no others.

    A triangle with one such edge is cut in two, with two in three, from the middle of the longer one, with three in
    four. Names are carried over. `InputError` where triangles are too small for the coordinates to tell their vertices
    apart.
    """
    topology, old = mesh.topology, len(mesh.vertices)
    middle = np.full(len(topology.ends), -1)
    middle[number] = new = old + np.arange(len(number))
    vertices = np.concatenate([mesh.vertices, mesh.vertices[topology.ends[number]].mean(axis=1)])
    same = same_places(vertices)
    if len(same):
        place = tuple(vertices[same[0, 0]].tolist())
        raise InputError("marked", place, "triangles here are too small to be halved: leave them out of `marked`")
    sides = middle[topology.of_cells]  # opposite to the corners
    count = (sides >= 0).sum(axis=1)
    some, all_three = (count == 1) | (count == 2), count == 3
    order, lengths = np.array([1, 2, 0]), np.where(sides >= 0, _lengths(mesh), -1.0)  # the middle one of equal ones
    turn = np.where(some, order[np.argmax(lengths[:, order], axis=1)], 0)[:, None] + np.arange(3)
    nodes = np.concatenate([np.take_along_axis(each, turn % 3, axis=1) for each in (mesh.cells, sides)], axis=1)
    last, next_ = nodes[:, 5] >= 0, nodes[:, 4] >= 0
    found, parents = list[IntArray](), list[IntArray]()
    for chosen, corners in (  # 0 to 2 are corners, 3 to 5 what is opposite; some are cut from corner 0 to 3
        (count == 0, [0, 1, 2]),
        *((all_three, each) for each in ([0, 4, 5], [1, 3, 5], [2, 3, 4], [3, 4, 5])),
        (some & ~last, [0, 1, 3]),
        *((some & last, each) for each in ([0, 3, 5], [1, 3, 5])),
        (some & ~next_, [0, 2, 3]),
        *((some & next_, each) for each in ([0, 3, 4], [2, 3, 4])),
    ):
        parents.append(np.flatnonzero(chosen))
        found.append(nodes[parents[-1][:, None], corners])
    fine, parent = np.sort(np.concatenate(found), axis=1), np.concatenate(parents)
    rest, (low, high) = np.flatnonzero(middle < 0), topology.ends[number].T
    ends = np.concatenate([topology.ends[rest], np.column_stack([low, new]), np.column_stack([high, new])])
    shares = np.repeat([(0.0, 1.0), (0.0, 0.5), (1.0, 0.5)], [len(rest), len(number), len(number)], axis=0)
    own = mesh.bends[number].any(axis=1)
    first, second = mesh.vertices[topology.ends[number[own]]].swapaxes(0, 1)
    vertices[new[own]] = first + arc_offsets(second - first, mesh.bends[number[own]], np.array([0.5]))[:, 0]
    return rebuilt(mesh, vertices, fine, parent, np.concatenate([rest, number, number]), ends, shares)


def rebuilt(
    mesh: MeshParts, vertices: FloatArray, cells: IntArray, parent: IntArray,
    whole: IntArray, ends: IntArray, shares: FloatArray,
) -> MeshParts:  # fmt: skip
    """Other triangles with the names and arcs of a mesh, which have edges or triangles left.

    They are parts of its triangles `parent` (m,), and have edges `ends` (k, 2) that are parts of its edges `whole` (k,)
    from and to `shares` (k, 2) of the lengths.
    """
    sets = {name: ends[np.isin(whole, known_edges(name, old, mesh.topology))] for name, old in mesh.edge_sets.items()}
    regions = {name: np.flatnonzero(np.isin(parent, old)) for name, old in mesh.regions.items()}
    sets, regions = ({name: new for name, new in each.items() if len(new)} for each in (sets, regions))
    own = np.flatnonzero(mesh.bends[whole].any(axis=1))
    own = own[np.unique(ends[own], axis=0, return_index=True)[1]]  # each once
    if not len(own):
        return MeshParts(vertices, cells, sets, regions)
    bends, (start, stop) = mesh.bends[whole[own]], np.sort(shares[own], axis=1).T
    found = np.where((stop - start < 1.0)[:, None], part_of(bends, start, stop), bends)
    found = np.where(shares[own, :1] > shares[own, 1:], reversed_bends(found), found)
    return MeshParts(vertices, cells, sets, regions, [Curve(ends[own], found)])


def part(mesh: MeshParts, cells: IntArray) -> MeshParts:
    """Some triangles (k,) of a mesh, see `TriangleMesh.part`."""
    whole = np.flatnonzero(np.isin(mesh.topology.cells, cells).any(axis=1))
    ends, shares = mesh.topology.ends[whole], np.tile([0.0, 1.0], (len(whole), 1))
    return rebuilt(mesh, mesh.vertices, mesh.cells[cells], cells, whole, ends, shares).without_others()


def stacked(meshes: Sequence[MeshParts]) -> MeshParts:
    """Several meshes as one of several pieces; edge sets and regions of one name are one."""
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
    if name in mesh.edge_sets:
        raise InputError("join", name, "this edge set exists already: choose another name")
    new_name(name)
    vertices, cells, topology = mesh.vertices, mesh.cells, mesh.topology
    piece = pieces(topology, len(cells))
    of_vertex = np.empty(len(vertices), dtype=np.int64)
    of_vertex[cells] = piece[:, None]
    reach = _NEAR * mesh.length
    radius = np.minimum(2.0 * reach, _FARTHEST * mesh.finest)
    here, there = in_circles(vertices, vertices, radius)
    same = (of_vertex[here] != of_vertex[there]) & (np.hypot(*(vertices[here] - vertices[there]).T) <= radius[there])
    _, first, place = np.unique(linked(here[same], there[same], len(vertices)), return_index=True, return_inverse=True)
    hanging, shares = hanging_vertices(vertices, topology, mesh.bends, reach)
    apart = of_vertex[hanging[:, 0]] != piece[topology.cells[hanging[:, 1], 0]]
    apart &= (place[hanging[:, :1]] != place[topology.ends[hanging[:, 1]]]).all(axis=1)
    # edge by edge its first vertex, those of other pieces in it, and its last one
    every = np.arange(len(topology.ends))
    edge = np.concatenate([every, hanging[apart, 1], every])
    share = np.concatenate([np.zeros(len(every)), shares[apart], np.ones(len(every))])
    vertex = place[np.concatenate([topology.ends[:, 0], hanging[apart, 0], topology.ends[:, 1]])]
    order = np.lexsort((share, edge))
    edge, share, vertex = edge[order], share[order], vertex[order]
    # of two pieces that meet there one vertex; the ends stay, equal ones too
    kept = np.append(True, (np.diff(edge) > 0) | (np.diff(vertex) != 0) | (share[1:] == 1.0))
    edge, share, vertex = edge[kept], share[kept], vertex[kept]
    new_cells, parent = _fans(place[cells], topology, edge, vertex)
    step = np.flatnonzero(edge[1:] == edge[:-1])[:, None] + [0, 1]
    whole, order = edge[step[:, 0]], np.argsort(vertex[step], axis=1)
    ends, between = (np.take_along_axis(each[step], order, axis=1) for each in (vertex, share))
    found = rebuilt(mesh, vertices[first], new_cells, parent, whole, ends, between)
    fine = found.topology
    across = (fine.count == 2) & (piece[parent[fine.cells[:, 0]]] != piece[parent[fine.cells[:, 1]]])
    if not across.any():
        remedy = "no pieces of this mesh touch along straight lines or declared arcs: leave it out"
        raise InputError("join", name, remedy)
    _refuse_slits(found, _SLIT * reach, piece[parent])
    left = {other: pairs[~across[fine.number(pairs)]] for other, pairs in found.edge_sets.items()}
    edge_sets = {other: left[other] if len(left[other]) else pairs for other, pairs in found.edge_sets.items()}
    return divided_at_arcs(replace(found, edge_sets={name: fine.ends[across], **edge_sets}))


def _refuse_slits(mesh: MeshParts, width: float, piece: IntArray) -> None:
    """`InputError` about the first hole that is narrower than this: bodies met at some of their vertices only."""
    vertices, cells, topology = mesh.vertices, mesh.cells, mesh.topology
    ends = topology.ends[topology.boundary]
    third = cells[topology.cells[topology.boundary, 0]].sum(axis=1) - ends.sum(axis=1)
    one, other, inner = (vertices[each] - vertices[0] for each in (*ends.T, third))
    lengths, middles = np.hypot(*(other - one).T), vertices[ends].mean(axis=1)
    areas = cross(one, other) * np.sign(cross(other - one, inner - one))  # of closed lines twice what they enclose
    piece = piece[topology.cells[topology.boundary, 0]]  # bodies may have narrow holes of their own
    for line in chains(ends):
        if np.ptp(piece[line]) and abs(areas[line].sum()) < width * lengths[line].sum():
            apart, around = abs(areas[line].sum()) / lengths[line].sum(), place_of(middles[line[0]])
            remedy = f"the bodies touch at some of their vertices and are {apart:.1g} apart around {around}: "
            raise InputError("join", apart, f"{remedy}give their coordinates with more digits")


def _fans(corners: IntArray, topology: Topology, edge: IntArray, vertex: IntArray) -> tuple[IntArray, IntArray]:
    """Triangles (m, 3) with vertices in their sides cut from the corners opposite; and which one each is part of.

    The vertices (k,) of edges (k,) follow each other, from the first end to the last.
    """
    count = np.bincount(edge) - 1  # parts of each edge
    start = np.searchsorted(edge, np.arange(len(count)))
    sides, parent = topology.of_cells, np.arange(len(corners))  # −1 for sides made by a cut
    for s, way in enumerate((1, -1, 1)):  # around the triangle: edges lead from the lower number to the higher one
        several = np.where(sides[:, s] < 0, 1, count[sides[:, s]])
        row = np.repeat(np.arange(len(several)), several)
        part = np.arange(len(row)) - np.repeat(np.cumsum(several) - several, several)
        corners, sides, parent, several = corners[row], sides[row], parent[row], several[row]
        given = sides[:, s] >= 0
        at = start[sides[:, s]] + (part if way > 0 else several - part)
        corners[given, s - 2], corners[given, s - 1] = vertex[at[given]], vertex[at[given] + way]
        sides[part < several - 1, s - 2] = sides[part > 0, s - 1] = -1
    return np.sort(corners, axis=1), parent
