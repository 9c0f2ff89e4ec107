"""Edges of a mesh, where contact, loads and supports live."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final, Self

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.mesh.arcs import angles, arc_offsets, reversed_bends, stretches, turned
from qvi_contact.mesh.topology import Topology

_UPRIGHT: Final = 1e-9  # x over the length of a vector that is vertical but for rounding


@dataclass(frozen=True, eq=False)
class Edges:
    """Edges of cells, straight ones and curved ones, as arrays with one entry an edge.

    The first cell of an edge is the body's side: on the boundary the only one, inside the body the one that the normal
    points away from, which is the lower or left one of a pair. σ_N = n·σn and σ_T = t·σn are taken with n and t of the
    edge.

    A curved edge, an arc, is known by the angle from its chord to its tangent along it; n and t are those of the chord,
    and turn with it (see `frames_along`). Reference coordinates, 0 to 1, are shares of its length.

    Attributes
    ----------
    first, second : (n,) int arrays
        Vertices at the two ends, in the direction of the tangent.
    cells : (n, 2) int array
        The cell that the normal points out of, and the one beyond; −1 where there is none.
    normal : (n, 2) array
        Unit normal n, outward on the boundary, inside the body from the first cell to the other.
    tangent : (n, 2) array
        Unit tangent t: t_x > 0, or t_y > 0 where t_x = 0, whichever way the edge faces.
    length : (n,) array
        Lengths, of arcs along them [length].
    bend : (n, k) array
        Coefficients of Legendre of that angle, counterclockwise [rad]; 0 on straight edges. See `mesh.arcs`.

    """

    first: IntArray
    second: IntArray
    cells: IntArray
    normal: FloatArray
    tangent: FloatArray
    length: FloatArray
    bend: FloatArray

    def __len__(self) -> int:
        return len(self.first)

    def take(self, index: IntArray | BoolArray) -> Self:
        """The edges selected by an index or mask array."""
        return type(self)(*(getattr(self, name)[index] for name in self.__match_args__))

    @cached_property
    def curved(self) -> bool:
        """Whether any of them is an arc."""
        return bool(self.bend.any())

    @property
    def bent(self) -> BoolArray:
        """Which of them are arcs, shape (n,)."""
        return np.asarray(self.bend.any(axis=1))

    @cached_property
    def stretch(self) -> FloatArray:
        """Lengths over those of the chords (n,): 1 on straight edges."""
        return stretches(self.bend)


def outward_normals(vertices: FloatArray, cells: IntArray, topology: Topology, edges: IntArray) -> FloatArray:
    """Unit normals of edges that point out of the first triangle at each, shape (k, 2)."""
    first, second = vertices[topology.ends[edges]].swapaxes(0, 1)
    along = second - first
    normal = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]
    inner = vertices[cells[topology.cells[edges, 0]]].mean(axis=1)
    inward = ((inner - first) * normal).sum(axis=1) > 0.0
    return np.asarray(np.where(inward[:, None], -normal, normal))


def edges_of(vertices: FloatArray, cells: IntArray, topology: Topology, bends: FloatArray, numbers: IntArray) -> Edges:
    """Edges of a topology by number (k,), which bend so (e, n), with the normals, tangents and cells of `Edges`."""
    first, second = topology.ends[numbers].T
    along = vertices[second] - vertices[first]
    length = np.hypot(*along.T)
    tangent = along / length[:, None]
    back = _points_back(tangent)
    tangent = np.where(back[:, None], -tangent, tangent)
    normal = outward_normals(vertices, cells, topology, numbers)
    beside = topology.cells[numbers]
    swapped = (beside[:, 1] >= 0) & _points_back(normal[:, ::-1])
    normal = np.where(swapped[:, None], -normal, normal)
    beside = np.where(swapped[:, None], beside[:, ::-1], beside)
    bend = np.where(back[:, None], reversed_bends(bends[numbers]), bends[numbers])
    length = length * stretches(bend)
    return Edges(np.where(back, second, first), np.where(back, first, second), beside, normal, tangent, length, bend)


def _points_back(vectors: FloatArray) -> BoolArray:
    """Whether vectors (n, 2) point to the left, or straight down."""
    upright = np.abs(vectors[:, 0]) <= _UPRIGHT
    return np.asarray(np.where(upright, vectors[:, 1], vectors[:, 0]) < 0.0)


def points_along(vertices: FloatArray, edges: Edges, t: FloatArray) -> FloatArray:
    """Points at the reference coordinates t, 0 to 1 along the tangent, (q,) or (n, q), of n edges; shape (n, q, 2)."""
    first, second = vertices[edges.first], vertices[edges.second]
    if not edges.curved:
        return np.asarray(first[:, None, :] + (second - first)[:, None, :] * np.asarray(t)[..., None])
    return np.asarray(first[:, None, :] + arc_offsets(second - first, edges.bend, t))


def frames_along(edges: Edges, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Normals and tangents at the reference coordinates t, (q,) or (n, q), of n edges; shape (n, q, 2) each."""
    return vectors_along(edges, edges.normal, t), vectors_along(edges, edges.tangent, t)


def vectors_along(edges: Edges, vectors: FloatArray, t: FloatArray, *, turns: bool = True) -> FloatArray:
    """Vectors (n, 2), given for the chord of each edge, that turn with it or do not; at t as above, shape (n, q, 2)."""
    t = np.broadcast_to(t, (len(edges), np.shape(t)[-1]))
    given = np.broadcast_to(vectors[:, None], (*t.shape, 2))
    return turned(given, angles(edges.bend, t)) if turns and edges.curved else given


def rounding_along(vertices: FloatArray, edges: Edges) -> FloatArray:
    """What rounding of the coordinates does to a reference coordinate t, shape (n,): large far from the origin."""
    largest = np.abs(vertices[np.stack([edges.first, edges.second])]).max(axis=(0, 2), initial=0.0)
    return np.asarray(np.finfo(float).eps * largest / edges.length)


def edge_ends(edges: Edges) -> IntArray:
    """The vertices of edges, each once."""
    return np.unique(np.concatenate([edges.first, edges.second]))
