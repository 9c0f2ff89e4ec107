"""The order of a contact's edges and points along the lines they make up, and places on these lines.

Meshes number edges as they like, and the tangent of an edge has t_x > 0, so that neither tells where a curved contact
leads. A path does: each line begins at the end of smallest x (and y), a closed one at the point of smallest x.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.mesh.edges import Edges, chains, cross

_ROUNDING: Final = 1e-12  # relative difference of two lengths that does not make an arc


@dataclass(frozen=True, eq=False)
class ContactPath:
    """Edges in order along their lines; where more than two of them meet, or none follows, a line ends.

    Attributes
    ----------
    edges : (n,) int array
        Numbers of the edges, one behind the other.
    forward : (n,) bool array
        Whether the tangent of the edge leads along the path.
    line : (n,) int array
        Number of the line that each of these edges belongs to, ascending.
    lengths : (n,) array
        Their lengths [length].

    """

    edges: IntArray
    forward: BoolArray
    line: IntArray
    lengths: FloatArray

    @classmethod
    def of(cls, ends: FloatArray, lengths: FloatArray | None = None) -> "ContactPath":
        """The path through edges between two points each, (n, 2, 2) [length], in any order.

        Arcs are longer than the way from end to end: their `lengths` (n,) count, those of straight edges are not used.
        """
        vertices = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)[1].reshape(-1, 2)
        found = chains(vertices)
        order = np.concatenate([np.empty(0, dtype=np.int64), *found])
        forward = np.concatenate([np.empty(0, dtype=bool), *(_forward(vertices[line]) for line in found)])
        number = np.repeat(np.arange(len(found)), [len(line) for line in found])
        along = np.hypot(*(ends[order, 1] - ends[order, 0]).T)
        if lengths is not None:
            along = np.where(lengths[order] > (1.0 + _ROUNDING) * along, lengths[order], along)
        return cls(order, forward, number, along)

    @cached_property
    def starts(self) -> FloatArray:
        """Length along the path where each of its edges begins, lines behind each other, shape (n,) [length]."""
        return np.asarray(np.cumsum(self.lengths) - self.lengths)

    def points(self, count: int) -> IntArray:
        """Numbers of the points (n, count) in order, of so many points an edge, counted along its tangent."""
        along = np.arange(count)
        return np.asarray(count * self.edges[:, None] + np.where(self.forward[:, None], along, along[::-1]))

    def places(self, t: FloatArray) -> FloatArray:
        """Length along the path (n, q) of points at t (q,), 0 to 1 along the path, of its edges [length]."""
        return np.asarray(self.starts[:, None] + self.lengths[:, None] * t)


def _forward(pairs: IntArray) -> BoolArray:
    """Whether each edge of a line, given by its two vertices (k, 2), leads on to the next one."""
    vertex = pairs[0].min() if len(pairs) == 1 else next(end for end in pairs[0] if end not in pairs[1])
    found = np.zeros(len(pairs), dtype=bool)
    for edge, (first, second) in enumerate(pairs.tolist()):
        found[edge] = first == vertex
        vertex = second if found[edge] else first
    return found


def turning_senses(vertices: FloatArray, edges: Edges) -> FloatArray:
    """In which sense the shear on each edge counts for the tangential force of a contact, ±1, (n,).

    Tangents point to the right, so that on a line which turns back, such as a round bore, they lead against each other.
    There those count that lead around the middle of the line counterclockwise, and the others against them. On all
    other lines every edge counts as its tangent leads; so it does on joints, whose sides change where the tangent turns
    back.
    """
    found = np.ones(len(edges))
    if (edges.cells[:, 1] >= 0).any():
        return found
    ends = np.stack([vertices[edges.first], vertices[edges.second]], axis=1)
    path = ContactPath.of(ends, edges.length)
    for line in range(path.line.max(initial=-1) + 1):
        own = path.line == line
        forward, chosen = path.forward[own], path.edges[own]
        if forward.all() or not forward.any():
            continue
        walk = np.where(forward, 1.0, -1.0)
        middles = ends[chosen].mean(axis=1)
        arms = middles - np.average(middles, axis=0, weights=path.lengths[own])
        turning = float(walk @ cross(arms, ends[chosen, 1] - ends[chosen, 0]))
        found[chosen] = walk if turning >= 0.0 else -walk
    return found


def leads_one_way(vertices: FloatArray, edges: Edges) -> bool:
    """Whether the shear of all edges counts along their tangents, see `turning_senses`."""
    return bool((turning_senses(vertices, edges) > 0.0).all())
