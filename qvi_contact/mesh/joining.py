"""Bodies meshed apart that touch along straight lines: nodes of either side are put into the other.

A triangle whose side has nodes of the other body in it is cut into triangles from the corner opposite. So both sides
have the same nodes and edges afterwards, and everything on the line is as exact as on one mesh.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from qvi_contact.basics.checks import IntArray
from qvi_contact.errors import InputError
from qvi_contact.mesh.curves import Curve, MeshParts
from qvi_contact.mesh.flaws import hanging_vertices, pieces, same_places
from qvi_contact.mesh.selection import new_name
from qvi_contact.mesh.topology import Topology


def stacked(meshes: Sequence[MeshParts]) -> MeshParts:
    """Several meshes as one of several pieces; edge sets and regions of one name are one."""
    vertices, cells, arcs = [], [], list[Curve]()
    edge_sets, regions = dict[str, list[IntArray]](), dict[str, list[IntArray]]()
    nodes = count = 0
    for mesh in meshes:
        vertices.append(mesh.vertices)
        cells.append(mesh.cells + nodes)
        arcs += [Curve(arc.edges + nodes, arc.coefficients) for arc in mesh.arcs]
        for name, pairs in mesh.edge_sets.items():
            edge_sets.setdefault(name, []).append(pairs + nodes)
        for name, chosen in mesh.regions.items():
            regions.setdefault(name, []).append(chosen + count)
        nodes, count = nodes + len(mesh.vertices), count + len(mesh.cells)
    sets = {name: np.concatenate(parts) for name, parts in edge_sets.items()}
    named = {name: np.concatenate(parts) for name, parts in regions.items()}
    return MeshParts(np.concatenate(vertices), np.concatenate(cells), sets, named, arcs)


def joined(mesh: MeshParts, name: str) -> MeshParts:
    """The pieces of a mesh with common nodes where they touch, the edges there being the joint of that name.

    A named part of the boundary loses the edges that are in the joint, unless all of it is.

    Raises
    ------
    InputError
        If the name is taken, or no pieces touch along a straight line.

    """
    if name in mesh.edge_sets:
        raise InputError("join", name, "this edge set exists already: choose another name")
    new_name(name)
    vertices, cells = mesh.vertices, np.sort(mesh.cells, axis=1)
    topology = Topology.of(cells, len(vertices))
    piece = pieces(topology, len(cells))
    of_vertex = np.empty(len(vertices), dtype=np.int64)
    of_vertex[cells] = piece[:, None]
    inside: dict[tuple[int, int], list[int]] = {}  # of an edge the vertices of other pieces in it
    for vertex, edge in hanging_vertices(vertices, topology).tolist():
        if of_vertex[vertex] != piece[topology.cells[edge, 0]]:
            low, high = topology.ends[edge].tolist()
            inside.setdefault((low, high), []).append(vertex)
    for (low, high), found in inside.items():
        found.sort(key=lambda vertex: float((vertices[vertex] - vertices[low]) @ (vertices[high] - vertices[low])))
    for arc in mesh.arcs:
        if any(tuple(sorted(pair)) in inside for pair in arc.edges.tolist()):
            raise InputError("join", name, "touches an arc there: both sides need the same nodes on it")
    cut = [_cut(corners, inside) for corners in cells.tolist()]
    parent = np.repeat(np.arange(len(cells)), [len(parts) for parts in cut])
    twins = same_places(vertices)
    twins = twins[of_vertex[twins[:, 0]] != of_vertex[twins[:, 1]]]
    graph = sparse.coo_array((np.ones(len(twins)), twins.T), shape=(len(vertices), len(vertices)))
    _, first, place = np.unique(
        csgraph.connected_components(graph, directed=False)[1], return_index=True, return_inverse=True
    )
    new_cells = np.sort(place[np.concatenate([np.array(parts) for parts in cut])], axis=1)
    fine = Topology.of(new_cells, len(first))
    across = (fine.count == 2) & (piece[parent[fine.cells[:, 0]]] != piece[parent[fine.cells[:, 1]]])
    if not across.any():
        raise InputError("join", name, "no pieces of this mesh touch along a straight line: leave it out")
    edge_sets = {name: fine.ends[across]}
    for other, pairs in mesh.edge_sets.items():
        chains = [[a, *_between(a, b, inside), b] for a, b in pairs.tolist()]
        found = place[np.array([step for chain in chains for step in pairwise(chain)])]
        in_joint = across[fine.number(found)]
        edge_sets[other] = found if in_joint.all() else found[~in_joint]
    regions = {other: np.flatnonzero(np.isin(parent, chosen)) for other, chosen in mesh.regions.items()}
    arcs = [Curve(place[arc.edges], arc.coefficients) for arc in mesh.arcs]
    return MeshParts(vertices[first], new_cells, edge_sets, regions, arcs)


def _between(a: int, b: int, inside: Mapping[tuple[int, int], list[int]]) -> list[int]:
    """The vertices in the edge from a to b, in this order."""
    return inside.get((a, b), []) if a < b else inside.get((b, a), [])[::-1]


def _cut(corners: list[int], inside: Mapping[tuple[int, int], list[int]]) -> list[list[int]]:
    """The triangles of a triangle whose sides have vertices in them: side by side, from the corner opposite."""
    for s in range(3):
        tip, a, b = corners[s], corners[s - 2], corners[s - 1]
        between = _between(a, b, inside)
        if between:
            return [part for p, q in pairwise([a, *between, b]) for part in _cut([tip, p, q], inside)]
    return [corners]
