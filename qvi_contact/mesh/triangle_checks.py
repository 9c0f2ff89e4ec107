"""What a mesh of triangles must be: checks that name the place of the first fault."""

from typing import Any, Final, NoReturn

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from qvi_contact.basics.checks import FloatArray, IntArray, real_array
from qvi_contact.errors import InputError
from qvi_contact.mesh.lines import LARGEST
from qvi_contact.mesh.topology import Topology

_LARGEST: Final = 2.0**53  # whole numbers below it are exact
_FLAT: Final = 1e-8  # height over longest side below which a triangle is none
_SAME: Final = 1e-10  # distance of vertices over the body's length below which they are in one place
_ON_EDGE: Final = 1e-9  # distance from an edge over its length below which a vertex lies on it


def checked_vertices(vertices: ArrayLike) -> FloatArray:
    """Finite coordinates (n, 2) that cannot be written to."""
    found = np.array(_numbers("TriangleMesh.vertices", vertices, float))
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
    found = _numbers("TriangleMesh.cells", cells, int)
    if found.ndim != 2 or found.shape[1] != 3 or not len(found):
        raise InputError("TriangleMesh.cells", f"shape {found.shape}", "give an array (m, 3), m ≥ 1")
    if found.min() < 0 or found.max() >= len(vertices):
        wrong = found[(found < 0) | (found >= len(vertices))][0]
        raise InputError("TriangleMesh.cells", int(wrong), f"give numbers of vertices, 0 to {len(vertices) - 1}")
    ordered = np.sort(found, axis=1)
    ordered.flags.writeable = False
    return ordered


def _numbers(name: str, value: Any, kind: type) -> Any:
    """An array of numbers of the kind."""
    found = real_array(name, value, "give an array of real numbers")
    whole = kind is not int or bool((np.abs(found) < _LARGEST).all() and (found == np.rint(found)).all())
    if np.asarray(value).dtype == bool or not whole:
        raise InputError(name, type(value).__name__, "give whole numbers" if kind is int else "give numbers")
    return found.astype(np.int64) if kind is int else found


def refuse_flaws(vertices: FloatArray, cells: IntArray, topology: Topology) -> None:
    """`InputError` unless triangles are a mesh of one piece."""
    _refuse_flat(vertices, cells)
    _refuse_strays(vertices, cells)
    _refuse_overlaps(vertices, cells, topology)
    _refuse_hanging(vertices, topology)
    _refuse_pieces(vertices, cells, topology)


def same_places(vertices: FloatArray) -> IntArray:
    """Pairs (k, 2) of vertices too near each other to be told apart."""
    tree = cKDTree(vertices)
    return np.asarray(tree.query_pairs(_SAME * float(np.ptp(vertices, axis=0).max()), output_type="ndarray"))


def _refuse(value: object, what: str, at: FloatArray) -> NoReturn:
    raise InputError("TriangleMesh", value, what.format(f"({at[0]:.6g}, {at[1]:.6g})"))


def _refuse_flat(vertices: FloatArray, cells: IntArray) -> None:
    a, b, c = vertices[cells].swapaxes(0, 1)
    sides = np.stack([b - a, c - b, a - c])
    longest = np.square(sides).sum(axis=2).max(axis=0)
    doubled = np.abs(sides[0, :, 0] * sides[1, :, 1] - sides[0, :, 1] * sides[1, :, 0])
    flat = doubled <= _FLAT * longest
    if flat.any():
        cell = int(np.argmax(flat))
        _refuse(cells[cell].tolist(), "the triangle of these vertices at {} has no area: leave it out", a[cell])


def _refuse_strays(vertices: FloatArray, cells: IntArray) -> None:
    used = np.zeros(len(vertices), dtype=bool)
    used[cells] = True
    if not used.all():
        vertex = int(np.argmin(used))
        _refuse(vertex, "this vertex at {} belongs to no triangle: leave it out", vertices[vertex])
    same = same_places(vertices)
    if len(same):
        pair = same[np.lexsort(same.T[::-1])[0]]
        remedy = "these vertices lie in the same place {}: merge them (a Contact along a joint separates bodies)"
        _refuse(pair.tolist(), remedy, vertices[pair[0]])


def _refuse_overlaps(vertices: FloatArray, cells: IntArray, topology: Topology) -> None:
    if topology.count.max() > 2:
        edge = int(np.argmax(topology.count > 2))
        middle = vertices[topology.ends[edge]].mean(axis=0)
        _refuse(
            topology.ends[edge].tolist(), "more than two triangles share the edge of these vertices around {}", middle
        )
    inner = np.flatnonzero(topology.count == 2)
    first, second = vertices[topology.ends[inner]].swapaxes(0, 1)
    along = second - first
    across = []
    for side in (0, 1):
        towards = vertices[cells[topology.cells[inner, side]]].mean(axis=1) - first
        across.append(along[:, 0] * towards[:, 1] - along[:, 1] * towards[:, 0])
    folded = across[0] * across[1] > 0.0
    if folded.any():
        edge = int(inner[np.argmax(folded)])
        remedy = "the two triangles at the edge of these vertices around {} lie on the same side of it and overlap"
        _refuse(topology.ends[edge].tolist(), remedy, vertices[topology.ends[edge]].mean(axis=0))


def _refuse_hanging(vertices: FloatArray, topology: Topology) -> None:
    """Vertices of the boundary inside edges of the boundary: two triangles meet one along its side."""
    edges = topology.ends[topology.boundary]
    first, second = vertices[edges].swapaxes(0, 1)
    along, middle = second - first, (first + second) / 2.0
    lengths = np.hypot(*along.T)
    candidates = np.unique(edges)
    near = cKDTree(vertices[candidates]).query_ball_point(middle, lengths * (0.5 - 1e-6))
    counts = [len(found) for found in near]
    if not sum(counts):
        return
    edge = np.repeat(np.arange(len(edges)), counts)
    vertex = candidates[np.concatenate([np.array(found, dtype=np.int64) for found in near])]
    offset = vertices[vertex] - first[edge]
    distance = np.abs(along[edge, 0] * offset[:, 1] - along[edge, 1] * offset[:, 0]) / lengths[edge]
    hanging = distance <= _ON_EDGE * lengths[edge]
    if hanging.any():
        at = int(np.argmax(hanging))
        remedy = f"this vertex at {{}} lies inside the edge of the vertices {edges[edge[at]].tolist()}: "
        _refuse(int(vertex[at]), remedy + "divide the triangle there", vertices[vertex[at]])


def _refuse_pieces(vertices: FloatArray, cells: IntArray, topology: Topology) -> None:
    boundary = topology.ends[topology.boundary]
    pinched = np.flatnonzero(np.bincount(boundary.ravel()) > 2)
    if len(pinched):
        remedy = "this vertex at {} alone connects two parts of the body: fill or cut there"
        _refuse(int(pinched[0]), remedy, vertices[pinched[0]])
    inner = topology.cells[topology.count == 2]
    graph = sparse.coo_array((np.ones(len(inner)), inner.T), shape=(len(cells), len(cells)))
    pieces, label = csgraph.connected_components(graph, directed=False)
    if pieces > 1:
        apart = vertices[cells[label == 1]].mean(axis=(0, 1))
        _refuse(pieces, "the body consists of this many pieces, one of them around {}: give one piece", apart)


def checked_pairs(name: str, pairs: ArrayLike, topology: Topology, vertices: FloatArray) -> IntArray:
    """Vertices (k, 2) of the edges of a set, all on the boundary or all inside the body."""
    _check_name(name)
    found = _numbers(name, pairs, int)
    if found.ndim != 2 or found.shape[1] != 2 or not len(found):
        raise InputError(name, f"shape {found.shape}", "give the vertices of one or more edges as an array (k, 2)")
    number = topology.number(found, len(vertices))
    inside = (found >= 0).all() and (found < len(vertices)).all()
    if not inside or (number < 0).any():
        wrong = (
            found[np.argmax(number < 0)] if inside else found[(found < 0).any(1) | (found >= len(vertices)).any(1)][0]
        )
        raise InputError(name, wrong.tolist(), "no edge of the mesh joins these vertices")
    outer = topology.boundary[number]
    if outer.any() and not outer.all():
        x, y = vertices[found[np.argmin(outer)]].mean(axis=0)
        remedy = f"lies partly on the boundary and partly inside, as around ({x:.6g}, {y:.6g}): make two sets of it"
        raise InputError("TriangleMesh.edge_sets", name, remedy)
    chosen = topology.ends[np.unique(number)]
    chosen.flags.writeable = False
    return chosen


def checked_region(name: str, cells: ArrayLike, count: int) -> IntArray:
    """Numbers (k,) of the triangles of a region, in ascending order."""
    _check_name(name)
    found = _numbers(name, cells, int)
    if found.ndim != 1 or not len(found) or found.min() < 0 or found.max() >= count:
        raise InputError(name, cells, f"give numbers of triangles, 0 to {count - 1}")
    chosen = np.unique(found)
    chosen.flags.writeable = False
    return np.asarray(chosen)


def _check_name(name: object) -> None:
    if not isinstance(name, str) or not name:
        raise InputError("name", name, "give a non-empty string")
