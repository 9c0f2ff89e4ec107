"""Edges on any smooth curve: each keeps its own bend, so that a mesh needs no function."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import FloatArray, IntArray, real_array
from qvi_contact.errors import InputError
from qvi_contact.mesh.arcs import arc_offsets, halves, levelled, reversed_bends
from qvi_contact.mesh.topology import Topology
from qvi_contact.mesh.triangle_checks import checked_pairs

_LEVEL: Final = 1e-9  # angle between a chord and the line that angles count from that is rounding of data [rad]


@dataclass(frozen=True, eq=False)
class Curve:
    """Edges that follow a smooth curve.

    Attributes
    ----------
    edges : (k, 2) int array
        The edges by their vertices.
    coefficients : (k, n) array
        How each bends from its first vertex to the second one: coefficients of Legendre, along its length, of the angle
        from its chord to its tangent, counterclockwise [rad]. See `mesh.arcs`.

    """

    edges: IntArray
    coefficients: FloatArray

    def bends(self, vertices: FloatArray) -> FloatArray:
        """How the edges bend, (k, n)."""
        del vertices
        return self.coefficients

    def middles(self, pairs: IntArray, vertices: FloatArray) -> FloatArray:
        """The points in the middle of edges (n, 2) of the curve, shape (n, 2)."""
        first, second = (vertices[end] for end in pairs.T)
        own = self.coefficients[self._places(pairs)]
        return np.asarray(first + arc_offsets(second - first, own, np.array([0.5]))[:, 0])

    def divided(self, pairs: IntArray, parents: IntArray) -> "Curve":
        """The same by edges (n, 2) that are halves of edges (n, 2) of the curve, or these themselves.

        New vertices have higher numbers than old ones.
        """
        whole = self.coefficients[self._places(parents)]
        first, second = halves(whole)
        is_first, is_second = ((pairs[:, 0] == parents[:, k]) & (pairs[:, 1] != parents[:, 1]) for k in (0, 1))
        found = np.where(is_first[:, None], first, np.where(is_second[:, None], reversed_bends(second), whole))
        return Curve(pairs, found)

    def scaled(self, factor: float) -> "Curve":
        """The same, so many times as large: angles stay what they are."""
        del factor
        return self

    def stated(self) -> dict[str, object]:
        """What problem files say of it beside its edges."""
        return {"bends": self.coefficients.tolist()}

    def checked(self, name: str, vertices: FloatArray, topology: Topology) -> "Curve":
        """The same, with edges in the order of the topology, from the lower number to the higher one.

        Raises
        ------
        InputError
            If edges are no edges of the mesh, or given twice, or bends are not one row of angles for each; its field
            begins with the name if there is one.

        """
        pairs, given = checked_pairs(name or "edges", self.edges, topology, vertices), np.asarray(self.edges)
        bends = checked_bends(f"{name}.bends" if name else "bends", self.coefficients, len(given))
        if len(pairs) != len(bends):
            raise InputError(name or "edges", len(bends), "an edge is given twice: give each once")
        back = given[:, 0] > given[:, 1]
        bends = np.where(back[:, None], reversed_bends(bends), bends)
        return Curve(pairs, bends[np.argsort(topology.number(given, len(vertices)))])

    def _places(self, pairs: IntArray) -> IntArray:
        """Which of the edges these (n, 2) are; edges are in ascending order."""
        base = np.array([int(self.edges.max()) + 1, 1])
        return np.asarray(np.searchsorted(self.edges @ base, pairs @ base), dtype=np.int64)


def checked_bends(field: str, given: ArrayLike, count: int) -> FloatArray:
    """Coefficients (count, n) of so many edges, of angles that count from the chord."""
    found = real_array(field, given, "give an array of numbers, one row for each edge")
    if found.ndim != 2 or len(found) != count or not found.shape[1]:
        raise InputError(field, f"shape {found.shape}", f"give {count} rows of numbers, one for each edge")
    if not (np.abs(found) <= np.pi).all():
        raise InputError(field, float(np.abs(found).max()), "give angles [rad] from the chord, numbers from -π to π")
    off = float(np.abs(levelled(found) - found).max())
    if off > _LEVEL:
        raise InputError(
            field, off, "these angles count from a line that is this angle [rad] off the chord: correct it"
        )
    return found
