"""Edges on circles and other smooth curves: what a mesh keeps of them, how they bend, and how a function is followed.

Vertices are looked for along a curve by halving. Between two of them the curve is taken at points of Gauss of its
parameter; derivatives are those of the polynomial through these points, and its angle is known along its length then.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial.legendre import legder, legint
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, finite_number, positive_number, real_array
from qvi_contact.element.edge import gauss_legendre, legendre_from_values
from qvi_contact.element.triangle import EDGES
from qvi_contact.errors import InputError, place_of
from qvi_contact.mesh.edges import (
    Topology,
    angles,
    arc_offsets,
    beyond_chords,
    cross,
    levelled,
    polynomials,
    reversed_bends,
    turned,
)
from qvi_contact.mesh.selection import checked_set, point

ROUNDING: Final = 1.5e-6
"""Distance of a vertex from its circle over the radius, or from another curve over its size, that is taken as rounding
of data."""

_FLATTEST: Final = 5e-8  # angle from the chord below which an edge is its chord: off by rounding of data
_LEVEL: Final = 1e-9  # angle between a chord and the line that angles count from that is rounding of data [rad]


@dataclass(frozen=True, eq=False)
class Curve:
    """Edges that follow a smooth curve."""

    edges: IntArray
    """The edges by their vertices, shape (k, 2)."""
    coefficients: FloatArray
    """How each bends from its first vertex to the second one, see `mesh.edges`. Shape (k, n) [rad]."""

    def checked(self, name: str, topology: Topology) -> "Curve":
        """The same, with edges in the order of the topology, from the lower number to the higher one.

        `InputError` if edges are no edges of the mesh, or given twice, or bends are not one row of angles for each; its
        field begins with the name if there is one.
        """
        chosen, given = checked_set(name or "edges", self.edges, topology), np.asarray(self.edges)
        bends = checked_bends(f"{name}.bends" if name else "bends", self.coefficients, len(given))
        if len(chosen) != len(bends):
            raise InputError(name or "edges", len(bends), "an edge is given twice: give each once")
        back = given[:, 0] > given[:, 1]
        bends = np.where(back[:, None], reversed_bends(bends), bends)
        return Curve(topology.ends[chosen], bends[np.argsort(topology.number(given))])


def checked_bends(field: str, given: ArrayLike, count: int) -> FloatArray:
    """Coefficients (count, n) of so many edges, of angles that count from the chord."""
    found = real_array(field, given, "give an array of numbers, one row for each edge")
    if found.ndim != 2 or len(found) != count or not found.shape[1]:
        raise InputError(field, f"shape {found.shape}", f"give {count} rows of numbers, one for each edge")
    if not (np.abs(found) <= np.pi).all():
        raise InputError(field, float(np.abs(found).max()), "give angles [rad] from the chord, numbers from -π to π")
    off = float(np.abs(levelled(found) - found).max())
    if off > _LEVEL:
        remedy = "these angles count from a line that is this angle [rad] off the chord: correct it"
        raise InputError(field, off, remedy)
    return found


def circle(centre: tuple[float, float], radius: float, edges: IntArray, vertices: FloatArray, field: str = "") -> Curve:
    """The edges (k, 2) as arcs of a circle, of each the shorter one; `InputError` if a vertex is off the circle."""
    middle, radius = np.array(point(f"{field}centre", centre)), positive_number(f"{field}radius", radius)
    pairs = np.unique(np.sort(edges, axis=1), axis=0)
    ends = vertices[np.unique(pairs)]
    off = np.abs(np.hypot(*(ends - middle).T) - radius)
    worst = int(np.argmax(off))
    if off[worst] > ROUNDING * radius:
        remedy = f"the vertex {place_of(ends[worst])} is {off[worst]:.3g} off this circle: correct centre or radius"
        raise InputError(f"{field}radius", radius, remedy)
    first, second = (vertices[end] - middle for end in pairs.T)
    turn = np.arctan2(cross(first, second), (first * second).sum(axis=1))
    return Curve(pairs, np.column_stack([np.zeros(len(turn)), turn / 2.0]))


@dataclass(frozen=True, eq=False, repr=False)
class MeshParts:
    """A body divided into triangles, which nobody has checked."""

    vertices: FloatArray
    """Coordinates [length], shape (n, 2)."""
    cells: IntArray
    """Vertices of each triangle, shape (m, 3), in ascending order; `TriangleMesh` takes any order."""
    edge_sets: Mapping[str, IntArray] = field(default_factory=lambda: MappingProxyType({}))
    """Edges (k, 2) by name and vertices: parts of the boundary, or joints if they lie inside the body."""
    regions: Mapping[str, IntArray] = field(default_factory=lambda: MappingProxyType({}))
    """Sets of triangles (k,) by name."""
    arcs: Sequence[Curve] = ()
    """Edges that are arcs rather than their chords; see `TriangleMesh.with_arc` and `TriangleMesh.with_curve`."""

    @property
    def given(self) -> tuple[Any, ...]:
        """The arguments of `TriangleMesh`."""
        return self.vertices, self.cells, self.edge_sets, self.regions, self.arcs

    def without_others(self) -> "MeshParts":
        """The same without vertices that no triangle has; those of edges elsewhere have the number −1."""
        used = np.unique(self.cells)
        place = np.full(len(self.vertices), -1)
        place[used] = np.arange(len(used))
        sets = {name: place[pairs] for name, pairs in self.edge_sets.items()}
        arcs = [Curve(place[arc.edges], arc.coefficients) for arc in self.arcs]
        return MeshParts(self.vertices[used], place[self.cells], sets, self.regions, arcs)

    @cached_property
    def topology(self) -> Topology:
        """Its edges."""
        return Topology.of(self.cells, len(self.vertices))

    @cached_property
    def length(self) -> float:
        """Characteristic length: the longer side of the bounding box [length]."""
        return float(np.ptp(self.vertices, axis=0).max())

    @cached_property
    def chords(self) -> FloatArray:
        """Distances between the ends of the edges of `topology`, shape (e,) [length]."""
        first, second = self.vertices.take(self.topology.ends, axis=0).swapaxes(0, 1)
        return np.asarray(np.hypot(*(second - first).T))

    @cached_property
    def finest(self) -> FloatArray:
        """Length of the shortest edge at each vertex, infinite where there is none, shape (n,) [length]."""
        found = np.full(len(self.vertices), np.inf)
        np.minimum.at(found, self.topology.ends, self.chords[:, None])
        return found

    @cached_property
    def bends(self) -> FloatArray:
        """How the edges of `topology` bend, see `Edges.bend`; from the vertex of lower number, (e, k)."""
        terms = [arc.coefficients.shape[1] for arc in self.arcs]
        found = np.zeros((len(self.topology.ends), max([_LEAST_TERMS, *terms])))
        for arc, count in zip(self.arcs, terms, strict=True):
            flat = np.abs(arc.coefficients).max(axis=1, keepdims=True) <= _FLATTEST
            found[self.topology.number(arc.edges), :count] = np.where(flat, 0.0, arc.coefficients)
        return found


_LEAST_TERMS: Final = 2  # of bends: those of circles
_WIDEST: Final = np.pi / 2.0 * (1.0 + 1e-12)  # angle that one edge may turn by
_HIGHEST: Final = 1.5  # height of an arc over the distance of its chord from the triangle's barycentre, outwards
_LEAST: Final = 0.01  # share of the area between an arc's end and the barycentre that bending has to leave
_PLACES: Final = np.linspace(1e-9, 1.0 - 1e-9, 33)  # where heights, areas and angles are looked at


def refuse_bad_arcs(mesh: MeshParts) -> None:
    """`InputError` where an edge is on two arcs, turns too far for one, or bends too far for its triangle."""
    numbers = np.sort(np.concatenate([mesh.topology.number(arc.edges) for arc in mesh.arcs]))
    twice = np.flatnonzero(np.bincount(numbers) > 1)
    long = numbers[np.ptp(angles(mesh.bends[numbers], _PLACES), axis=1) > _WIDEST]
    bent = mesh.topology.of_cells[bent_too_far(mesh)]
    for wrong, remedy in (
        (twice, "lies on two arcs: give it one"),
        (long, "turns by more than 90°: divide the triangles there"),
        (bent, "bends too far for the triangle at it: divide the triangles there"),
    ):
        if len(wrong):
            place = place_of(mesh.vertices[mesh.topology.ends[wrong[0]]].mean(axis=0))
            raise InputError("TriangleMesh.arcs", place, f"the edge around this point {remedy}")


def bent_too_far(mesh: MeshParts) -> BoolArray:
    """Which sides of triangles are arcs that the barycentre does not see, or that lead too far outwards; (m, 3).

    Areas between the line and the barycentre grow with (x − c)×x'. The barycentre sees all of the arc if this is
    positive; that of a circle is least at an end where it bends inwards.
    """
    sides = mesh.bends[mesh.topology.of_cells]
    bent = np.asarray(sides.any(axis=2))
    for s, (a, b) in enumerate(EDGES):
        cell, along = np.flatnonzero(bent[:, s]), np.zeros((len(_PLACES), 3))
        along[:, a], along[:, b] = 1.0 - _PLACES, _PLACES
        places, areas = beyond_chords(mesh.vertices[mesh.cells[cell]], sides[cell], along)
        bent[cell, s] = (places[:, :, s].min(axis=1) < -_HIGHEST / 3.0) | (areas.min(axis=1) < _LEAST)
    return bent


CurveFunction: TypeAlias = Callable[[FloatArray], object]
"""Points (n, 2) of a curve at parameters (n,)."""

_SAMPLES: Final = 512  # of the curve at least, and so many for each edge:
_FOR_EACH: Final = 16
_HALVINGS: Final = 60
_POINTS: Final = 32  # of an edge, and coefficients of its bend before the smallest are left out
_CHECKED: Final[FloatArray] = np.linspace(0.03, 0.97, 21)  # shares of an edge where its bend is compared with the curve
_STEPS: Final = 8  # of Newton's method for the parameter from the length
_CLOSED: Final = 1e-9  # distance of both ends over the curve's size where it is closed
_EXACT: Final = 1e-12  # distance of an edge from its curve over the chord that is rounding
_RESOLVED: Final = 1e-2  # share of that below which coefficients of a curve are rounding, which slopes would enlarge
_KEPT: Final = 0.2  # share of that below which the highest coefficients are none
_LOST: Final = 64.0 * np.finfo(float).eps  # of coordinates by the differences that angles are made of


class _Given(NamedTuple):
    """A curve as a function, asked for points between its ends; a closed one goes round and round."""

    name: str
    function: CurveFunction
    start: float
    stop: float
    closed: bool = False

    def points(self, t: FloatArray) -> FloatArray:
        """Points (..., 2) at parameters (...)."""
        if self.closed:
            inside = self.start + np.mod(t.ravel() - self.start, self.stop - self.start)
        else:
            inside = np.clip(t.ravel(), min(self.start, self.stop), max(self.start, self.stop))
        try:
            found = self.function(inside)
        except Exception as error:
            remedy = f"the function must take an array (n,) of parameters and return points (n, 2) ({error})"
            raise InputError(self.name, self.function, remedy) from error
        found = real_array(self.name, found, "the function must return real numbers")
        if found.shape != (inside.size, 2):
            remedy = f"the function must return points ({inside.size}, 2) for so many parameters"
            raise InputError(self.name, f"shape {found.shape}", remedy)
        if not np.isfinite(found).all():
            where = float(inside[np.argmin(np.isfinite(found).all(axis=1))])
            raise InputError(self.name, f"parameter {where:.6g}", "the function returns NaN or infinity here")
        return found.reshape(*t.shape, 2)


def ellipse(centre: tuple[float, float], axes: tuple[float, float], angle: float = 0.0) -> CurveFunction:
    """An ellipse by its half axes [length] and the angle [rad] of the first, for parameters from 0 to 2π."""
    a, b = (positive_number("axes", axis) for axis in axes)
    middle, first = np.array(centre), finite_number("angle", angle)

    def points(t: FloatArray) -> FloatArray:
        return middle + turned(np.column_stack([a * np.cos(t), b * np.sin(t)]), np.full(len(t), first))

    return points


def fitted(
    name: str, function: CurveFunction, start: float, stop: float, edges: IntArray, vertices: FloatArray
) -> Curve:
    """The bends of edges (k, 2) whose vertices (v, 2) are on a curve, from its points (n, 2) at parameters (n,).

    The curve is closed if first and last parameter have the same point; then each edge follows the shorter way between
    its vertices. `InputError` about the name of the curve if the function is none, or fails, a vertex is off the curve,
    or the curve is not smooth along an edge.
    """
    if not callable(function):
        raise InputError(name, function, "give a function of an array (n,) that returns points (n, 2)")
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    given = _Given(name, function, finite_number("start", start), finite_number("stop", stop))
    if given.start == given.stop:
        raise InputError("stop", stop, "give another parameter than the one that the curve starts at")
    t = np.linspace(given.start, given.stop, max(_SAMPLES, _FOR_EACH * len(edges)) + 1)
    samples = given.points(t)
    size = float(np.ptp(samples, axis=0).max())
    if not size > 0.0:
        raise InputError(name, tuple(samples[0].tolist()), "all points of the curve are this one")
    given = given._replace(closed=bool(np.hypot(*(samples[-1] - samples[0])) <= _CLOSED * size))
    numbers, places = np.unique(edges, return_inverse=True)
    from scipy.spatial import cKDTree  # slow to import, and few solves need it

    # (γ − x)·d vanishes at a vertex x, d being from the sample before the nearest to that after: by halving, which
    # needs no derivative, and no smoothness but between vertices
    nearest = np.asarray(cKDTree(samples).query(vertices[numbers])[1])
    if given.closed:  # where both ends are nearest the sample beside them tells which one a vertex is at
        beside = np.asarray(cKDTree(samples[[1, -2]]).query(vertices[numbers])[1])
        nearest = np.where(nearest % (len(t) - 1) == 0, beside * (len(t) - 1), nearest)
    before, after = np.maximum(nearest - 1, 0), np.minimum(nearest + 1, len(t) - 1)
    low, high, along = t[before], t[after], samples[after] - samples[before]
    for _ in range(_HALVINGS):
        middle = (low + high) / 2.0
        ahead = ((given.points(middle) - vertices[numbers]) * along).sum(axis=1) > 0.0
        low, high = np.where(ahead, low, middle), np.where(ahead, middle, high)
    found = (low + high) / 2.0
    off = np.hypot(*(given.points(found) - vertices[numbers]).T)
    worst = int(np.argmax(off))
    if off[worst] > ROUNDING * size:
        vertex = f"the vertex {place_of(vertices[numbers[worst]])} is {off[worst]:.3g} off this curve"
        raise InputError(name, function, f"{vertex}: correct the curve, or its ends")
    first, second = found[places.reshape(edges.shape)].T
    if given.closed:
        second = second - (stop - start) * np.rint((second - first) / (stop - start))
    return Curve(edges, _bends(given, first, second, vertices[edges]))


def _bends(given: _Given, first: FloatArray, second: FloatArray, ends: FloatArray) -> FloatArray:
    """Bends (k, n) of the edges between parameters (k,) of the curve; their own ends (k, 2, 2) say how they round."""
    step = (second - first)[:, None]
    corners = given.points(first[:, None] + step * np.array([0.0, 1.0]))
    chords = corners[:, 1] - corners[:, 0]
    lengths = np.hypot(*chords.T)
    exact = np.maximum(_EXACT, _LOST * np.abs(ends).max(axis=(1, 2)) / np.where(lengths > 0.0, lengths, 1.0))
    t, project = gauss_legendre(_POINTS)[0], legendre_from_values(_POINTS - 1, _POINTS).T
    points = (given.points(first[:, None] + step * t) - corners[:, :1]).swapaxes(1, 2) @ project
    points = _without_rounding(points, (_RESOLVED * exact * lengths)[:, None])
    slopes = np.asarray(legder(points, axis=2), dtype=np.float64)
    # parameters −1 to 1 at shares of the lengths: where angles are taken, and where edges are compared with the curve
    shares = np.concatenate([t, _CHECKED])
    speed = np.hypot(*np.moveaxis(_at(slopes, np.tile(2.0 * t - 1.0, (len(slopes), 1))), -1, 0)) @ project
    covered = np.asarray(legint(speed, axis=1, lbnd=-1), dtype=np.float64)
    wanted, found = (
        shares * polynomials(covered, np.ones((len(slopes), 1))),
        np.tile(2.0 * shares - 1.0, (len(slopes), 1)),
    )
    for _ in range(_STEPS):
        rate = polynomials(speed, found)
        missed = (polynomials(covered, found) - wanted) / np.where(rate != 0.0, rate, 1.0)
        found = np.clip(found - missed, -1.0, 1.0)
    tangents = _at(slopes, found[:, : len(t)])
    turn = np.arctan2(cross(chords[:, None], tangents), (chords[:, None] * tangents).sum(axis=2))
    bends = levelled(_without_rounding(turn @ project, _KEPT * exact))
    there = given.points(first[:, None] + step * (1.0 + found[:, len(t) :]) / 2.0)
    off = np.hypot(*np.moveaxis(corners[:, :1] + arc_offsets(chords, bends, _CHECKED) - there, -1, 0)).max(axis=1)
    rough = np.flatnonzero(off > exact * lengths)
    if len(rough):
        remedy = "is not smooth there, turns back, or turns too far along one edge: divide the triangles there"
        raise InputError(given.name, place_of(ends[rough[0]].mean(axis=0)), f"the curve {remedy}")
    return bends[:, : 1 + int(np.flatnonzero(bends.any(axis=0)).max(initial=0))]


def _at(curves: FloatArray, x: FloatArray) -> FloatArray:
    """Curves by coefficients of Legendre (k, 2, n) at x (k, q), −1 to 1; shape (k, q, 2)."""
    return np.stack([polynomials(curves[:, axis], x) for axis in (0, 1)], axis=-1)


def _without_rounding(terms: FloatArray, rounding: FloatArray) -> FloatArray:
    """Coefficients (..., n) up to the last one that is larger than rounding (...), 0 behind it."""
    large = np.abs(terms) > rounding[..., None]
    kept = np.cumsum(large[..., ::-1], axis=-1)[..., ::-1] > 0
    return np.where(kept, terms, 0.0)
