"""Edges on circles: what a mesh keeps of its arcs, and the checks it makes."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray, finite_number, positive_number
from qvi_contact.errors import InputError
from qvi_contact.mesh.arcs import cross
from qvi_contact.mesh.topology import Topology
from qvi_contact.mesh.triangle_checks import checked_pairs

ROUNDING: Final = 1.5e-6
"""Distance of a vertex from its circle over the radius, or from another curve over its size, that is taken as rounding
of data."""

_FLATTEST: Final = 1e-7  # angle below which an arc is its chord: it is off by less than rounding of the circle


@dataclass(frozen=True, eq=False)
class Arc:
    """Edges that lie on one circle.

    Attributes
    ----------
    centre : (float, float)
        Centre of the circle [length].
    radius : float
        Its radius [length].
    edges : (k, 2) int array
        The edges by their vertices. Each is the shorter of the two arcs between them.

    """

    centre: tuple[float, float]
    radius: float
    edges: IntArray

    def bends(self, vertices: FloatArray) -> FloatArray:
        """How the edges bend from their first vertices to the second ones, (k, 2); see `mesh.arcs`."""
        first, second = (vertices[end] - np.array(self.centre) for end in self.edges.T)
        turn = np.arctan2(cross(first, second), (first * second).sum(axis=1))
        turn = np.where(np.abs(turn) <= _FLATTEST, 0.0, turn)
        return np.column_stack([np.zeros(len(turn)), turn / 2.0])

    def middles(self, pairs: IntArray, vertices: FloatArray) -> FloatArray:
        """The points of the circle in the middle of edges (n, 2) of the arc, shape (n, 2)."""
        arms = vertices[pairs].mean(axis=1) - np.array(self.centre)
        return np.asarray(np.array(self.centre) + self.radius * arms / np.hypot(*arms.T)[:, None])

    def divided(self, pairs: IntArray, parents: IntArray) -> "Arc":
        """The same by edges (n, 2) that are halves of edges (n, 2) of the arc, or these themselves."""
        del parents
        return replace(self, edges=pairs)

    def scaled(self, factor: float) -> "Arc":
        """The same, so many times as large."""
        x, y = self.centre
        return Arc((factor * x, factor * y), factor * self.radius, self.edges)

    def stated(self) -> dict[str, object]:
        """What problem files say of it beside its edges."""
        return {"centre": list(self.centre), "radius": self.radius}

    def checked(self, name: str, vertices: FloatArray, topology: Topology) -> "Arc":
        """The same if it has edges of the mesh, and their vertices are on the circle.

        Raises
        ------
        InputError
            If not; its field begins with the name if there is one.

        """
        of = f"{name}." if name else ""
        pairs = checked_pairs(name or "edges", self.edges, topology, vertices)
        found = Arc(_point(f"{of}centre", self.centre), positive_number(f"{of}radius", self.radius), pairs)
        ends = vertices[np.unique(pairs)]
        off = np.abs(np.hypot(*(ends - np.array(found.centre)).T) - found.radius)
        worst = int(np.argmax(off))
        if off[worst] > ROUNDING * found.radius:
            x, y = ends[worst]
            remedy = f"the vertex ({x:.6g}, {y:.6g}) is {off[worst]:.3g} off this circle: correct centre or radius"
            raise InputError(f"{of}radius", found.radius, remedy)
        return found


def _point(name: str, value: object) -> tuple[float, float]:
    if not isinstance(value, Iterable) or isinstance(value, str) or len(pair := tuple(value)) != 2:
        raise InputError(name, value, "give a pair (x, y)")
    return finite_number(name, pair[0]), finite_number(name, pair[1])
