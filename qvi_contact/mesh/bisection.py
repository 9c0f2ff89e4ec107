"""Triangles bisected where they are too large; names of edges and regions are carried over."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from qvi_contact.basics.checks import FloatArray, IntArray, real_array
from qvi_contact.errors import InputError
from qvi_contact.mesh.curves import bends_of, bent_too_far
from qvi_contact.mesh.parts import MeshParts
from qvi_contact.mesh.topology import Topology
from qvi_contact.mesh.triangle_checks import same_places

_DIVISIONS = 6  # halvings of an arc until its triangle is high enough


def bisected(mesh: MeshParts, marked: ArrayLike | None = None) -> MeshParts:
    """The mesh with marked triangles refined, and others as far as needed; without marks each is divided into four.

    Old vertices keep their numbers, new ones are midpoints of old edges, those on arcs of the arcs. A triangle that
    became too flat for its arc is divided further, arcs are half as long then.
    """
    return divided_at_arcs(_bisected(mesh, marked))


def divided_at_arcs(mesh: MeshParts) -> MeshParts:
    """The mesh with triangles divided whose sides bend too far for them; some are left if arcs cross other edges."""
    for _ in range(_DIVISIONS if mesh.arcs else 0):
        flat = _too_flat(mesh)
        if not len(flat):
            break
        mesh = _bisected(mesh, flat)
    return mesh


def _too_flat(mesh: MeshParts) -> IntArray:
    """The triangles with a side that bends too far for them."""
    cells = np.sort(mesh.cells, axis=1)
    topology = Topology.of(cells, len(mesh.vertices))
    bends = bends_of(mesh.arcs, mesh.vertices, topology)
    return np.flatnonzero(bent_too_far(bends, mesh.vertices, cells, topology).any(axis=1))


def _bisected(mesh: MeshParts, marked: ArrayLike | None) -> MeshParts:
    triangles: Any = import_module("skfem").MeshTri  # loaded here: reading and posing problems need none of it
    coarse = triangles(np.ascontiguousarray(mesh.vertices.T), np.ascontiguousarray(mesh.cells.T))
    if mesh.regions:
        coarse = coarse.with_subdomains(dict(mesh.regions))
    fine = coarse.refined(1 if marked is None else _numbers(marked, len(mesh.cells)))
    vertices, cells = np.ascontiguousarray(fine.p.T), np.sort(fine.t.T.astype(np.int64), axis=1)
    regions = {name: np.asarray(fine.subdomains[name], dtype=np.int64) for name in mesh.regions}
    return _carried_over(mesh, vertices, cells, regions)


def halved(mesh: MeshParts, edges: IntArray) -> MeshParts:
    """The mesh with these edges (k, 2), by their vertices, halved, and the triangles beside them divided; no others.

    A triangle with one such edge is cut in two, with two in three and with three in four.
    """
    cells, old = np.sort(mesh.cells, axis=1), len(mesh.vertices)
    topology = Topology.of(cells, old)
    number = np.unique(topology.number(np.sort(edges, axis=1), old))
    middle = np.full(len(topology.ends), -1)
    middle[number] = old + np.arange(len(number))
    vertices = np.concatenate([mesh.vertices, mesh.vertices[topology.ends[number]].mean(axis=1)])
    found, parents = list[list[int]](), list[int]()
    for cell, (corners, sides) in enumerate(zip(cells.tolist(), middle[topology.of_cells].tolist(), strict=True)):
        pieces = _pieces(corners, sides, vertices)
        found += pieces
        parents += [cell] * len(pieces)
    parent = np.array(parents, dtype=np.int64)
    regions = {name: np.flatnonzero(np.isin(parent, chosen)) for name, chosen in mesh.regions.items()}
    return _carried_over(mesh, vertices, np.sort(np.array(found, dtype=np.int64), axis=1), regions)


def _pieces(corners: list[int], sides: list[int], vertices: FloatArray) -> list[list[int]]:
    """The triangles that a triangle is cut into; sides are the middles of those opposite to the corners, or −1."""
    cut = [s for s in range(3) if sides[s] >= 0]
    if not cut:
        return [corners]
    if len(cut) == 3:
        a, b, c = sides
        return [[corners[0], b, c], [a, corners[1], c], [a, b, corners[2]], [a, b, c]]
    if len(cut) == 1:
        s = cut[0]
        return [[corners[s], corners[end], sides[s]] for end in range(3) if end != s]
    tip = 3 - sum(cut)  # both sides meet in this corner
    one, other = cut
    first, second = sides[one], sides[other]  # on the sides tip–other and tip–one
    quads = [
        (corners[other], second, [corners[one], first]),
        (corners[one], first, [corners[other], second]),
    ]
    lengths = [float(np.hypot(*(vertices[a] - vertices[b]))) for a, b, _ in quads]
    a, b, ends = quads[int(np.argmin(lengths))]
    return [[corners[tip], first, second], *([a, b, end] for end in ends)]


def _carried_over(mesh: MeshParts, vertices: FloatArray, cells: IntArray, regions: Mapping[str, IntArray]) -> MeshParts:
    """Finer triangles, whose new vertices are middles of old edges, with the names of the mesh."""
    _refuse_tiny(vertices)
    sets = [*mesh.edge_sets.values(), *(arc.edges for arc in mesh.arcs)]
    finer = _split_edges(mesh, sets, vertices, cells)
    edge_sets = {name: pairs for name, (pairs, _) in zip(mesh.edge_sets, finer, strict=False)}
    on_arcs = list(zip(mesh.arcs, finer[len(edge_sets) :], strict=True))
    for arc, (pairs, parents) in on_arcs:
        halved = pairs[:, 1] >= len(mesh.vertices)
        vertices[pairs[halved, 1]] = arc.middles(parents[halved], mesh.vertices)
    arcs = [arc.divided(*parts) for arc, parts in on_arcs]
    return MeshParts(vertices, cells, edge_sets, regions, arcs)


def _numbers(marked: ArrayLike, count: int) -> IntArray:
    """Numbers of marked triangles."""
    _ = real_array("marked", marked, f"give numbers of triangles, or a boolean for each of the {count}")
    chosen = np.asarray(marked)
    if chosen.dtype == bool and chosen.shape == (count,):
        return np.flatnonzero(chosen)
    if chosen.ndim != 1 or (chosen.size and chosen.dtype.kind not in "iu"):
        raise InputError("marked", marked, f"give numbers of triangles, or a boolean for each of the {count}")
    if chosen.size and (chosen.min() < 0 or chosen.max() >= count):
        raise InputError("marked", marked, f"give numbers of triangles, 0 to {count - 1}")
    return np.asarray(chosen, dtype=np.int64)


def _refuse_tiny(vertices: FloatArray) -> None:
    """`InputError` where halved triangles are too small for the coordinates to tell their vertices apart."""
    same = same_places(vertices)
    if len(same):
        x, y = vertices[same[0, 0]].tolist()
        raise InputError("marked", (x, y), "triangles here are too small to be halved: leave them out of `marked`")


def _split_edges(
    coarse: MeshParts, sets: Sequence[IntArray], vertices: FloatArray, cells: IntArray
) -> list[tuple[IntArray, IntArray]]:
    """Sets of edges of the coarser mesh by the edges of finer cells (m, 3) that they are made of.

    New vertices are midpoints. For each set the edges, (k, 2), and those of the coarser mesh that they are part of.
    """
    if not sets:
        return []
    old, ends = len(coarse.vertices), Topology.of(cells, len(vertices)).ends
    topology = Topology.of(np.sort(coarse.cells, axis=1), old)
    number = np.where(ends[:, 1] < old, topology.number(np.minimum(ends, old - 1), old), -1)
    if len(vertices) > old:
        midpoints = coarse.vertices[topology.ends].mean(axis=1)
        halved = np.flatnonzero((ends[:, 0] < old) & (ends[:, 1] >= old))
        origin = np.asarray(cKDTree(midpoints).query(vertices[ends[halved, 1]])[1])
        on_it = (topology.ends[origin] == ends[halved, :1]).any(axis=1)
        number[halved[on_it]] = origin[on_it]
    chosen = [np.isin(number, topology.number(pairs, old)) for pairs in sets]
    return [(ends[part], topology.ends[number[part]]) for part in chosen]
