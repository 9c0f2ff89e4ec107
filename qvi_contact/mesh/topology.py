"""The edges of triangles, who shares them, and the lines they make up."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from qvi_contact.basics.checks import BoolArray, IntArray

OPPOSITE = ((1, 2), (0, 2), (0, 1))
"""Corners of the edges of a triangle, edge s opposite to corner s."""


@dataclass(frozen=True, eq=False)
class Topology:
    """Edges of triangles.

    Attributes
    ----------
    ends : (e, 2) int array
        Vertices of each edge, the lower number first; edges in the order of these pairs.
    of_cells : (m, 3) int array
        Edges of each triangle, edge s opposite to its corner s.
    cells : (e, 2) int array
        The triangles at each edge, in ascending order; −1 for the second on the boundary.
    count : (e,) int array
        How many triangles share the edge: 1 on the boundary, 2 inside, more in what is no mesh.
    keys : (e,) int array
        ends[0] · base + ends[1], in ascending order, with the number of vertices as base.
    base : int
        See there.

    """

    ends: IntArray
    of_cells: IntArray
    cells: IntArray
    count: IntArray
    keys: IntArray
    base: int

    @classmethod
    def of(cls, cells: IntArray, vertices: int) -> "Topology":
        """Edges of triangles (m, 3), whose corners are in ascending order, among so many vertices."""
        pairs = cells[:, OPPOSITE].reshape(-1, 2)
        keys, index, count = np.unique(pairs[:, 0] * vertices + pairs[:, 1], return_inverse=True, return_counts=True)
        order = np.argsort(index, kind="stable")
        start = np.concatenate([[0], np.cumsum(count)[:-1]])
        beside = np.full((len(keys), 2), -1)
        beside[:, 0] = order[start] // 3
        shared = count > 1
        beside[shared, 1] = order[start[shared] + 1] // 3
        return cls(np.column_stack(np.divmod(keys, vertices)), index.reshape(-1, 3), beside, count, keys, vertices)

    @cached_property
    def boundary(self) -> BoolArray:
        """Which edges belong to one triangle only, shape (e,)."""
        return np.asarray(self.count == 1)

    def number(self, pairs: IntArray) -> IntArray:
        """The edges between pairs of vertices (k, 2), in any order; −1 where there is none."""
        one, other = pairs[:, 0], pairs[:, 1]
        wanted = np.minimum(one, other) * self.base + np.maximum(one, other)
        at = np.minimum(np.searchsorted(self.keys, wanted), len(self.keys) - 1)
        return np.where(self.keys[at] == wanted, at, -1)


def chains(ends: IntArray) -> list[IntArray]:
    """Edges ordered along the lines they make up, each line as indices into `ends` (k, 2), their vertices.

    A line starts at a vertex of one edge only if it has such a vertex, that of lowest number, else at the lowest of
    all; where more than two edges meet lines end.
    """
    at: dict[int, list[int]] = {}
    for edge, pair in enumerate(ends.tolist()):
        for vertex in pair:
            at.setdefault(vertex, []).append(edge)
    used = np.zeros(len(ends), dtype=bool)
    found: list[IntArray] = []
    starts = sorted(vertex for vertex, edges in at.items() if len(edges) != 2) + sorted(at)
    for start in starts:
        for first in at[start]:
            line: list[int] = []
            vertex, edge = start, first
            while not used[edge]:
                used[edge] = True
                line.append(edge)
                low, high = ends[edge].tolist()
                vertex = high if vertex == low else low
                if len(at[vertex]) != 2:
                    break
                edge = next((e for e in at[vertex] if e != edge), edge)
            if line:
                found.append(np.array(line))
    return found
