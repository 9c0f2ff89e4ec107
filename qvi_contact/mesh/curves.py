"""Edges on circles and other smooth curves: their bends, their checks, and bends computed from a curve's function.

The parameter of each vertex on the curve is found by bisection. Between two vertices the curve is evaluated at Gauss
points of the parameter. The polynomial through these points has the tangents, from which follow the arc length and the
angle θ as a function of it, see `mesh.edges`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial.legendre import legder, legint, legvander

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, finite_number, positive_number, real_array
from qvi_contact.element.edge import gauss_legendre, legendre_from_values
from qvi_contact.element.triangle import EDGES
from qvi_contact.errors import InputError, place_of
from qvi_contact.mesh.edges import Topology, angles, arc_offsets, beyond_chords, cross, levelled, reversed_bends, turned
from qvi_contact.mesh.selection import checked_set, point
from solvers.errors import known_name

ROUNDING: Final = 1.5e-6
"""Largest distance of a vertex from its circle, relative to the radius, or from another curve, relative to its size;
vertices in files are rounded."""

_STRAIGHT: Final = 5e-8  # largest angle from the chord [rad] of an edge that counts as straight
_CHORD_TOLERANCE: Final = 1e-9  # largest rounding error of the direction of the chord [rad]


@dataclass(frozen=True, eq=False)
class Curve:
    """Edges that follow a smooth curve."""

    edges: IntArray
    """The edges by their vertices, shape (k, 2)."""
    coefficients: FloatArray
    """Bend of each edge from its first vertex to its second, see `mesh.edges`, shape (k, n) [rad]."""

    def checked(self, name: str, topology: Topology) -> "Curve":
        """The curve with its edges in the order of the topology, each from the vertex of lower number.

        `InputError` if the mesh has no such edge, an edge is given twice, or `coefficients` is not one row of angles
        from the chord, at most π, per edge. The field in the error begins with `name`.
        """
        chosen, pairs = checked_set(name or "edges", self.edges, topology), np.asarray(self.edges)
        field = f"{name}.bends" if name else "bends"
        bends = real_array(field, self.coefficients, "give an array of numbers, one row for each edge")
        if bends.ndim != 2 or len(bends) != len(pairs) or not bends.shape[1]:
            raise InputError(field, f"shape {bends.shape}", f"give {len(pairs)} rows of numbers, one for each edge")
        if not (np.abs(bends) <= np.pi).all():
            remedy = "give angles [rad] from the chord, numbers from -π to π"
            raise InputError(field, float(np.abs(bends).max()), remedy)
        difference = float(np.abs(levelled(bends) - bends).max())
        if difference > _CHORD_TOLERANCE:
            remedy = "these angles count from a line that is this angle [rad] off the chord: correct it"
            raise InputError(field, difference, remedy)
        if len(chosen) != len(bends):
            raise InputError(name or "edges", len(bends), "an edge is given twice: give each once")
        is_reversed = pairs[:, 0] > pairs[:, 1]
        bends = np.where(is_reversed[:, None], reversed_bends(bends), bends)
        return Curve(topology.ends[chosen], bends[np.argsort(topology.number(pairs))])


def circle(centre: tuple[float, float], radius: float, edges: IntArray, vertices: FloatArray) -> Curve:
    """The edges (k, 2) as arcs of a circle, always the shorter arc; `InputError` if a vertex is off the circle."""
    centre_point, radius = np.array(point("centre", centre)), positive_number("radius", radius)
    pairs = np.unique(np.sort(edges, axis=1), axis=0)
    ends = vertices[np.unique(pairs)]
    off = np.abs(np.hypot(*(ends - centre_point).T) - radius)
    worst = int(np.argmax(off))
    if off[worst] > ROUNDING * radius:
        remedy = f"the vertex {place_of(ends[worst])} is {off[worst]:.3g} off this circle: correct centre or radius"
        raise InputError("radius", radius, remedy)
    first, second = (vertices[end] - centre_point for end in pairs.T)
    turn = np.arctan2(cross(first, second), (first * second).sum(axis=1))
    return Curve(pairs, np.column_stack([np.zeros(len(turn)), turn / 2.0]))


@dataclass(frozen=True, eq=False, repr=False)
class MeshParts:
    """The data of a `TriangleMesh` before they are checked."""

    vertices: FloatArray
    """Coordinates [length], shape (n, 2)."""
    cells: IntArray
    """Vertices of each triangle, shape (m, 3), in ascending order; `TriangleMesh` takes any order."""
    edge_sets: Mapping[str, IntArray] = field(default_factory=lambda: MappingProxyType({}))
    """Edges (k, 2) by name and vertices: parts of the boundary, or joints if they lie inside the body."""
    regions: Mapping[str, IntArray] = field(default_factory=lambda: MappingProxyType({}))
    """Sets of triangles (k,) by name."""
    arcs: Sequence[Curve] = ()
    """Curved edges; see `TriangleMesh.with_arc` and `TriangleMesh.with_curve`."""

    @property
    def given(self) -> tuple[Any, ...]:
        """The arguments of `TriangleMesh`."""
        return self.vertices, self.cells, self.edge_sets, self.regions, self.arcs

    def without_others(self) -> "MeshParts":
        """The data without vertices that belong to no triangle; in edges their number becomes −1."""
        is_used = np.zeros(len(self.vertices), dtype=bool)
        is_used[self.cells] = True  # much faster than `np.unique` of the cells
        new_number = np.where(is_used, np.cumsum(is_used) - 1, -1)
        sets = {name: new_number[pairs] for name, pairs in self.edge_sets.items()}
        arcs = [Curve(new_number[arc.edges], arc.coefficients) for arc in self.arcs]
        return MeshParts(self.vertices[is_used], new_number[self.cells], sets, self.regions, arcs)

    def pairs(self, name: str) -> IntArray:
        """Vertices (k, 2) of the edges called `name`, in a `TriangleMesh` in ascending order."""
        return self.edge_sets[known_name("name", name, {"edge sets and joints": self.edge_sets})]

    @cached_property
    def topology(self) -> Topology:
        """The edges of the triangles."""
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
        """Length of the shortest edge at each vertex, shape (n,) [length]; infinite at a vertex without edges."""
        shortest = np.full(len(self.vertices), np.inf)
        np.minimum.at(shortest, self.topology.ends, self.chords[:, None])
        return shortest

    @cached_property
    def bends(self) -> FloatArray:
        """Bends of the edges of `topology` from their vertex of lower number, see `mesh.edges`, shape (e, k) [rad]."""
        n_terms = [arc.coefficients.shape[1] for arc in self.arcs]
        bends = np.zeros((len(self.topology.ends), max([_LEAST_TERMS, *n_terms])))
        for arc, count in zip(self.arcs, n_terms, strict=True):
            is_straight = np.abs(arc.coefficients).max(axis=1, keepdims=True) <= _STRAIGHT
            bends[self.topology.number(arc.edges), :count] = np.where(is_straight, 0.0, arc.coefficients)
        return bends


_LEAST_TERMS: Final = 2  # coefficients of a bend: enough for circles
_MAX_TURN: Final = np.pi / 2.0 * (1.0 + 1e-12)  # of one edge [rad]
_MAX_HEIGHT: Final = 1.5  # of an arc outwards, relative to the distance from its chord to the triangle's barycentre
_MIN_AREA: Final = 0.01  # least ratio of area, see `beyond_chords`, to that of the straight triangle
_CHECK_POINTS: Final = np.linspace(1e-9, 1.0 - 1e-9, 33)  # fractions of an edge where these bounds are checked


def refuse_bad_arcs(mesh: MeshParts) -> None:
    """`InputError` where an edge is on two arcs, turns by more than 90°, or bends too far for its triangle."""
    numbers = np.sort(np.concatenate([mesh.topology.number(arc.edges) for arc in mesh.arcs]))
    twice = np.flatnonzero(np.bincount(numbers) > 1)
    turning = numbers[np.ptp(angles(mesh.bends[numbers], _CHECK_POINTS), axis=1) > _MAX_TURN]
    bending = mesh.topology.of_cells[bent_too_far(mesh)]
    for edges, remedy in (
        (twice, "lies on two arcs: give it one"),
        (turning, "turns by more than 90°: divide the triangles there"),
        (bending, "bends too far for the triangle at it: divide the triangles there"),
    ):
        if len(edges):
            place = place_of(mesh.vertices[mesh.topology.ends[edges[0]]].mean(axis=0))
            raise InputError("TriangleMesh.arcs", place, f"the edge around this point {remedy}")


def bent_too_far(mesh: MeshParts) -> BoolArray:
    """Mask (m, 3) of the sides of triangles that are arcs not visible from the barycentre, or too far outside.

    The whole arc is visible from the barycentre c if (x − c) × x' > 0 along it, which is the ratio of area up to a
    factor. On a circle that bends inwards this is least at an end.
    """
    sides = mesh.bends[mesh.topology.of_cells]
    is_bent = np.asarray(sides.any(axis=2))
    for s, (a, b) in enumerate(EDGES):
        cell, reference = np.flatnonzero(is_bent[:, s]), np.zeros((len(_CHECK_POINTS), 3))
        reference[:, a], reference[:, b] = 1.0 - _CHECK_POINTS, _CHECK_POINTS
        lam, areas = beyond_chords(mesh.vertices[mesh.cells[cell]], sides[cell], reference)
        is_bent[cell, s] = (lam[:, :, s].min(axis=1) < -_MAX_HEIGHT / 3.0) | (areas.min(axis=1) < _MIN_AREA)
    return is_bent


CurveFunction: TypeAlias = Callable[[FloatArray], object]
"""Points (n, 2) of a curve at parameters (n,)."""

_MIN_SAMPLES: Final = 512  # of a curve
_SAMPLES_PER_EDGE: Final = 16
_BISECTIONS: Final = 60  # more than the 53 bits of a double
_POINTS: Final = 32  # Gauss points of an edge, and coefficients of its bend before the smallest are dropped
_COMPARED: Final[FloatArray] = np.linspace(0.03, 0.97, 21)  # fractions of an edge where it is compared with the curve
_SPEED_POINTS: Final = 96  # Gauss points for the arc length, a root of polynomials, and integrals of it
_CLOSED: Final = 1e-9  # a curve is closed if its ends are this close, relative to its size
_EXACT: Final = 1e-12  # least tolerance: distance of an edge from its curve, relative to the chord, that is rounding
_RESOLVED: Final = 1e-2  # × tolerance × chord: smaller coefficients of a curve are rounding; derivatives enlarge it
_KEPT_COEFFICIENT: Final = 0.2  # × tolerance: trailing coefficients of a bend that are smaller are dropped
_ROUNDING: Final = 64.0 * np.finfo(float).eps  # × coordinates: rounding of the differences behind an angle


class _CurvePoints(NamedTuple):
    """The function of a curve, evaluated between its ends only; on a closed curve the parameter is periodic."""

    name: str
    function: CurveFunction
    start: float
    stop: float
    closed: bool = False

    def points(self, t: FloatArray) -> FloatArray:
        """Points (..., 2) at parameters (...)."""
        if self.closed:
            parameters = self.start + np.mod(t.ravel() - self.start, self.stop - self.start)
        else:
            parameters = np.clip(t.ravel(), min(self.start, self.stop), max(self.start, self.stop))
        try:
            points = self.function(parameters)
        except Exception as error:
            remedy = f"the function must take an array (n,) of parameters and return points (n, 2) ({error})"
            raise InputError(self.name, self.function, remedy) from error
        points = real_array(self.name, points, "the function must return real numbers")
        if points.shape != (parameters.size, 2):
            remedy = f"the function must return points ({parameters.size}, 2) for so many parameters"
            raise InputError(self.name, f"shape {points.shape}", remedy)
        if not np.isfinite(points).all():
            where = float(parameters[np.argmin(np.isfinite(points).all(axis=1))])
            raise InputError(self.name, f"parameter {where:.6g}", "the function returns NaN or infinity here")
        return points.reshape(*t.shape, 2)


def ellipse(centre: tuple[float, float], axes: tuple[float, float], angle: float = 0.0) -> CurveFunction:
    """An ellipse by its half axes [length] and the angle [rad] of the first, for parameters from 0 to 2π."""
    a, b = (positive_number("axes", axis) for axis in axes)
    centre_point, rotation = np.array(centre), finite_number("angle", angle)

    def points(t: FloatArray) -> FloatArray:
        return centre_point + turned(np.column_stack([a * np.cos(t), b * np.sin(t)]), np.full(len(t), rotation))

    return points


def fitted(
    name: str, function: CurveFunction, start: float, stop: float, edges: IntArray, vertices: FloatArray
) -> Curve:
    """The edges (k, 2), whose vertices (v, 2) lie on a curve, with their bends; the function gives points of the curve.

    The curve is closed if `start` and `stop` have the same point; then each edge follows the shorter way between its
    vertices. `InputError` about `name` if the function is not callable or fails, a vertex is off the curve, or the
    curve is not smooth along an edge.
    """
    if not callable(function):
        raise InputError(name, function, "give a function of an array (n,) that returns points (n, 2)")
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    curve = _CurvePoints(name, function, finite_number("start", start), finite_number("stop", stop))
    if curve.start == curve.stop:
        raise InputError("stop", stop, "give another parameter than the one that the curve starts at")
    t = np.linspace(curve.start, curve.stop, max(_MIN_SAMPLES, _SAMPLES_PER_EDGE * len(edges)) + 1)
    samples = curve.points(t)
    size = float(np.ptp(samples, axis=0).max())
    if not size > 0.0:
        raise InputError(name, tuple(samples[0].tolist()), "all points of the curve are this one")
    curve = curve._replace(closed=bool(np.hypot(*(samples[-1] - samples[0])) <= _CLOSED * size))
    numbers, position = np.unique(edges, return_inverse=True)
    from scipy.spatial import cKDTree  # slow to import, and few solves need it

    # bisection for (γ − x)·d = 0 at a vertex x, where d leads from the sample before the nearest one to that after it;
    # it needs no derivative, and the curve may have corners at vertices
    nearest = t[np.asarray(cKDTree(samples).query(vertices[numbers])[1])]
    ends = (-np.inf, np.inf) if curve.closed else sorted((curve.start, curve.stop))
    low, high = (np.clip(nearest + step, *ends) for step in (t[0] - t[1], t[1] - t[0]))
    direction = curve.points(high) - curve.points(low)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        is_beyond = ((curve.points(middle) - vertices[numbers]) * direction).sum(axis=1) > 0.0
        low, high = np.where(is_beyond, low, middle), np.where(is_beyond, middle, high)
    parameter = (low + high) / 2.0
    distance = np.hypot(*(curve.points(parameter) - vertices[numbers]).T)
    worst = int(np.argmax(distance))
    if distance[worst] > ROUNDING * size:
        vertex = f"the vertex {place_of(vertices[numbers[worst]])} is {distance[worst]:.3g} off this curve"
        raise InputError(name, function, f"{vertex}: correct the curve, or its ends")
    first, second = parameter[position.reshape(edges.shape)].T
    if curve.closed:
        second = second - (stop - start) * np.rint((second - first) / (stop - start))
    return Curve(edges, _bends(curve, first, second, vertices[edges]))


def _bends(curve: _CurvePoints, first: FloatArray, second: FloatArray, ends: FloatArray) -> FloatArray:
    """Bends (k, n) of the edges between parameters (k,) of the curve; `ends` (k, 2, 2) are coordinates of vertices."""
    step = (second - first)[:, None]
    corners = curve.points(first[:, None] + step * np.array([0.0, 1.0]))
    chords = corners[:, 1] - corners[:, 0]
    lengths = np.hypot(*chords.T)
    tolerance = np.maximum(_EXACT, _ROUNDING * np.abs(ends).max(axis=(1, 2)) / np.where(lengths > 0.0, lengths, 1.0))
    t, to_legendre = gauss_legendre(_POINTS)[0], legendre_from_values(_POINTS - 1, _POINTS).T
    coefficients = (curve.points(first[:, None] + step * t) - corners[:, :1]).swapaxes(1, 2) @ to_legendre
    coefficients = _without_rounding(coefficients, (_RESOLVED * tolerance * lengths)[:, None])
    slopes = np.asarray(legder(coefficients, axis=2), dtype=np.float64)
    # the speed, the fraction s of the arc length and the angle θ at points of the parameter; c_k = (2k + 1) ∫ θ P_k ds
    u, weights = gauss_legendre(_SPEED_POINTS)
    tangents = (slopes @ legvander(2.0 * u - 1.0, slopes.shape[2] - 1).T).swapaxes(1, 2)
    speed = np.hypot(*np.moveaxis(tangents, -1, 0))
    to_speed = legendre_from_values(_SPEED_POINTS - 1, _SPEED_POINTS).T
    arc_length = np.asarray(legint(speed @ to_speed, axis=1, lbnd=-1), dtype=np.float64) / 2.0
    total = arc_length.sum(axis=1, keepdims=True)  # its value at the end, where all Legendre polynomials are 1
    s, compared = (arc_length @ legvander(2.0 * x - 1.0, _SPEED_POINTS).T / total for x in (u, _COMPARED))
    turn = np.arctan2(cross(chords[:, None], tangents), (chords[:, None] * tangents).sum(axis=2))
    moments = ((turn * weights * speed / total)[:, None] @ legvander(2.0 * s - 1.0, _POINTS - 1))[:, 0]
    bends = levelled(_without_rounding(moments * (2 * np.arange(_POINTS) + 1), _KEPT_COEFFICIENT * tolerance))
    on_curve = curve.points(first[:, None] + step * _COMPARED)
    off = np.hypot(*np.moveaxis(corners[:, :1] + arc_offsets(chords, bends, compared) - on_curve, -1, 0)).max(axis=1)
    not_smooth = np.flatnonzero(off > tolerance * lengths)
    if len(not_smooth):
        remedy = "is not smooth there, turns back, or turns too far along one edge: divide the triangles there"
        raise InputError(curve.name, place_of(ends[not_smooth[0]].mean(axis=0)), f"the curve {remedy}")
    return bends[:, : 1 + int(np.flatnonzero(bends.any(axis=0)).max(initial=0))]


def _without_rounding(terms: FloatArray, rounding: FloatArray) -> FloatArray:
    """Coefficients (..., n) with zeros after the last one that is larger than `rounding` (...)."""
    large = np.abs(terms) > rounding[..., None]
    is_kept = np.cumsum(large[..., ::-1], axis=-1)[..., ::-1] > 0
    return np.where(is_kept, terms, 0.0)
