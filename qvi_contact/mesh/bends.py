"""How the edges of triangles bend, by the curves a mesh has, and which bend too far."""

from collections.abc import Sequence
from typing import Final, TypeAlias

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.errors import InputError
from qvi_contact.mesh.arcs import angles, arc_offsets, cross, stretches, turned
from qvi_contact.mesh.circles import Arc
from qvi_contact.mesh.curves import Curve
from qvi_contact.mesh.topology import OPPOSITE, Topology

AnyArc: TypeAlias = Arc | Curve
"""Edges that lie on one curve."""

_LEAST_TERMS: Final = 2  # of bends: those of circles
_WIDEST: Final = np.pi / 2.0 * (1.0 + 1e-12)  # angle that one edge may turn by
_HIGHEST: Final = 1.5  # height of an arc over the distance of its chord from the triangle's barycentre, outwards
_LEAST: Final = 0.01  # share of the area between an arc's end and the barycentre that bending has to leave
_PLACES: Final = np.linspace(0.0, 1.0, 33)  # where heights, areas and angles are looked at


def bends_of(arcs: Sequence[AnyArc], vertices: FloatArray, topology: Topology) -> FloatArray:
    """How each edge bends from its vertex of lower number to the other, shape (e, terms); see `mesh.arcs`."""
    parts = [arc.bends(vertices) for arc in arcs]
    found = np.zeros((len(topology.ends), max([_LEAST_TERMS, *(part.shape[1] for part in parts)])))
    for arc, part in zip(arcs, parts, strict=True):
        found[topology.number(arc.edges, len(vertices)), : part.shape[1]] = part
    return found


def refuse_bad_arcs(
    arcs: Sequence[AnyArc], bends: FloatArray, vertices: FloatArray, cells: IntArray, topology: Topology
) -> None:
    """`InputError` where an edge is on two arcs, turns too far for one, or bends too far for its triangle."""
    numbers = np.sort(np.concatenate([topology.number(arc.edges, len(vertices)) for arc in arcs]))
    twice = np.flatnonzero(np.bincount(numbers, minlength=len(bends)) > 1)
    if len(twice):
        _refuse(vertices, topology, int(twice[0]), "lies on two arcs: give it one")
    long = numbers[np.ptp(angles(bends[numbers], _PLACES), axis=1) > _WIDEST]
    if len(long):
        _refuse(vertices, topology, int(long[0]), "turns by more than 90°: divide the triangles there")
    bent = np.argwhere(bent_too_far(bends, vertices, cells, topology))
    if len(bent):
        remedy = "bends too far for the triangle at it: divide the triangles there"
        _refuse(vertices, topology, int(topology.of_cells[tuple(bent[0])]), remedy)


def bent_too_far(bends: FloatArray, vertices: FloatArray, cells: IntArray, topology: Topology) -> BoolArray:
    """Which sides of triangles are arcs that the barycentre does not see, or that lead too far outwards; (m, 3).

    Areas between the line and the barycentre grow with (x − c)×x'. The barycentre sees all of the arc if this is
    positive; that of a circle is least at an end where it bends inwards.
    """
    sides = bends[topology.of_cells]
    bent = np.asarray(sides.any(axis=2))
    for s, (a, b) in enumerate(OPPOSITE):
        cell = np.flatnonzero(bent[:, s])
        bend, centre = sides[cell, s], vertices[cells[cell]].mean(axis=1)
        first, second = vertices[cells[cell, a]] - centre, vertices[cells[cell, b]] - centre
        chord, straight = (second - first)[:, None], cross(first, second)[:, None]
        offsets = arc_offsets(second - first, bend, _PLACES)
        slope = stretches(bend)[:, None, None] * turned(chord, angles(bend, _PLACES))
        outwards = cross(offsets, chord) / straight
        areas = cross(first[:, None] + offsets, slope) / straight
        bent[cell, s] = (outwards.max(axis=1) > _HIGHEST) | (areas.min(axis=1) < _LEAST)
    return bent


def _refuse(vertices: FloatArray, topology: Topology, edge: int, remedy: str) -> None:
    x, y = vertices[topology.ends[edge]].mean(axis=0)
    raise InputError("TriangleMesh.arcs", f"({x:.6g}, {y:.6g})", f"the edge around this point {remedy}")
