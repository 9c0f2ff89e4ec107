"""Triangles bisected where they are too large; names of edges and regions are carried over."""

from collections.abc import Sequence
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
    _refuse_tiny(vertices)
    sets = [*mesh.edge_sets.values(), *(arc.edges for arc in mesh.arcs)]
    finer = _split_edges(mesh, sets, vertices, cells)
    edge_sets = {name: pairs for name, (pairs, _) in zip(mesh.edge_sets, finer, strict=False)}
    regions = {name: np.asarray(fine.subdomains[name], dtype=np.int64) for name in mesh.regions}
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
