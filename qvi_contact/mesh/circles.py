"""Circles that edges of triangles follow: what a mesh keeps of its arcs, and the checks it makes."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, finite_number, positive_number
from qvi_contact.errors import InputError
from qvi_contact.mesh.arcs import cross, turned
from qvi_contact.mesh.topology import OPPOSITE, Topology

_ON_CIRCLE: Final = 1.5e-6  # distance of a vertex from its circle over the radius that is taken as rounding of data
_WIDEST: Final = np.pi / 2.0 * (1.0 + 1e-12)  # angle that one edge may turn by
_FLATTEST: Final = 1e-7  # angle below which an arc is its chord: it is off by less than rounding of the circle
_HIGHEST: Final = 1.5  # height of an arc over the distance of its chord from the triangle's barycentre, outwards
_LEAST: Final = 0.01  # share of the area between an arc's end and the barycentre that bending has to leave


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

    def projected(self, points: FloatArray) -> FloatArray:
        """The points of the circle next to points (n, 2)."""
        arms = points - np.array(self.centre)
        return np.asarray(np.array(self.centre) + self.radius * arms / np.hypot(*arms.T)[:, None])

    def scaled(self, factor: float) -> "Arc":
        """The same, so many times as large."""
        x, y = self.centre
        return Arc((factor * x, factor * y), factor * self.radius, self.edges)


def checked_arc(name: str, centre: object, radius: object, edges: IntArray, vertices: FloatArray) -> Arc:
    """An arc whose vertices are on the circle; else `InputError`, whose fields begin with the name if there is one."""
    of = f"{name}." if name else ""
    found = Arc(_point(f"{of}centre", centre), positive_number(f"{of}radius", radius), edges)
    ends = vertices[np.unique(edges)]
    off = np.abs(np.hypot(*(ends - np.array(found.centre)).T) - found.radius)
    worst = int(np.argmax(off))
    if off[worst] > _ON_CIRCLE * found.radius:
        x, y = ends[worst]
        remedy = f"the vertex ({x:.6g}, {y:.6g}) is {off[worst]:.3g} off this circle: correct centre or radius"
        raise InputError(f"{of}radius", found.radius, remedy)
    return found


def turns_of(arcs: Sequence[Arc], vertices: FloatArray, topology: Topology) -> FloatArray:
    """By which angle each edge turns from its vertex of lower number to the other, counterclockwise; shape (e,)."""
    found = np.zeros(len(topology.ends))
    for arc in arcs:
        number = topology.number(arc.edges, len(vertices))
        first, second = (vertices[end] - np.array(arc.centre) for end in topology.ends[number].T)
        turn = np.arctan2(cross(first, second), (first * second).sum(axis=1))
        found[number] = np.where(np.abs(turn) <= _FLATTEST, 0.0, turn)
    return found


def refuse_bad_arcs(
    arcs: Sequence[Arc], turns: FloatArray, vertices: FloatArray, cells: IntArray, topology: Topology
) -> None:
    """`InputError` where an edge is on two arcs, is too long for its circle, or bends too far for its triangle."""
    numbers = np.concatenate([topology.number(arc.edges, len(vertices)) for arc in arcs])
    twice = np.flatnonzero(np.bincount(numbers, minlength=len(turns)) > 1)
    if len(twice):
        _refuse(vertices, topology, int(twice[0]), "lies on two arcs: give it one")
    long = np.flatnonzero(np.abs(turns) > _WIDEST)
    if len(long):
        _refuse(vertices, topology, int(long[0]), "turns by more than 90°: divide the triangles there")
    bent = np.argwhere(bent_too_far(turns, vertices, cells, topology))
    if len(bent):
        remedy = "bends too far for the triangle at it: divide the triangles there"
        _refuse(vertices, topology, int(topology.of_cells[tuple(bent[0])]), remedy)


def bent_too_far(turns: FloatArray, vertices: FloatArray, cells: IntArray, topology: Topology) -> BoolArray:
    """Which sides of triangles are arcs that the barycentre does not see, or that lead too far outwards; (m, 3)."""
    bent = turns[topology.of_cells] != 0.0
    for s, (a, b) in enumerate(OPPOSITE):
        cell = np.flatnonzero(bent[:, s])
        turn, centre = turns[topology.of_cells[cell, s]], vertices[cells[cell]].mean(axis=1)
        first, second = vertices[cells[cell, a]] - centre, vertices[cells[cell, b]] - centre
        straight, square = cross(first, second), np.square(second - first).sum(axis=1)
        outwards = square * np.tan(turn / 4.0) / (2.0 * straight)  # height over that of the chord
        bent[cell, s] = (outwards > _HIGHEST) | (_area_left(first, second, turn) < _LEAST)
    return np.asarray(bent)


def _area_left(first: FloatArray, second: FloatArray, turn: FloatArray) -> FloatArray:
    """How many times as large areas are at the ends of arcs as at their chords, the lesser of both ends.

    Areas are those between the line and the barycentre, from which ends are counted. They grow with (x − c)×x', least
    at an end where the arc bends inwards: the barycentre sees all of the arc if this is positive there.
    """
    chord, straight = second - first, cross(first, second)
    at_first = cross(first, turned(chord, -turn / 2.0)) / straight
    at_second = cross(second, turned(chord, turn / 2.0)) / straight
    return np.minimum(at_first, at_second)


def _refuse(vertices: FloatArray, topology: Topology, edge: int, remedy: str) -> None:
    x, y = vertices[topology.ends[edge]].mean(axis=0)
    raise InputError("TriangleMesh.arcs", f"({x:.6g}, {y:.6g})", f"the edge around this point {remedy}")


def _point(name: str, value: object) -> tuple[float, float]:
    if not isinstance(value, Iterable) or isinstance(value, str) or len(pair := tuple(value)) != 2:
        raise InputError(name, value, "give a pair (x, y)")
    return finite_number(name, pair[0]), finite_number(name, pair[1])
