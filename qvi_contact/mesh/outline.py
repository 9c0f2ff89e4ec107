"""Bodies described by their outline: corners joined by straight lines and arcs, holes, inner lines, sizes.

An arc is divided first as a polygon whose vertices lie on the circle; its chords are about as long as the triangles
there are to be. The edges of the triangles know the circle, so that the body ends at the arc.

gmsh makes the triangles. It keeps one state for the whole process, so it is started for one mesh and ended behind it,
under a lock, without configuration files, threads of its own, or output; a session of the caller's is left as it was,
and so are handlers of signals, which its start takes away.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Lock
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, mapping, positive_number
from qvi_contact.basics.schema import LARGEST, Checked, Name, Positive
from qvi_contact.errors import InputError
from qvi_contact.mesh.curves import MeshParts, circle
from qvi_contact.mesh.edges import Topology, cross
from qvi_contact.mesh.selection import point
from solvers.basics.foreign import foreign_code, handlers_kept
from solvers.basics.types import load

Point: TypeAlias = tuple[float, float]

_SAME_RADIUS: Final = 1e-6  # relative difference of the distances of an arc's ends from its centre
_WIDEST: Final = np.pi / 6.0  # angle of a chord at most
_MOST_LINES: Final = 4000
_MOST_TRIANGLES: Final = 200_000
_NEAR: Final = 1e-9  # distance of points over the body's length below which they are one
_APART: Final = 1e-5  # distance of points and lines over the body's length that do not meet
_FARTHEST: Final = 1e5  # coordinates over the body's length
_FLATTEST: Final = 1e6  # radius of an arc over its chord, which it is but for rounding
_CHUNK: Final = 256  # points whose distances are looked at at a time
_SMALLEST: Final = 1e-7  # of sizes, as a share of the outline's length


@dataclass(frozen=True)
class Corner(Checked):
    """A point of an outline, and the line from there to the next one."""

    at: Point
    """Coordinates [length]: `at = [2.0, 0.0]`."""
    name: Name = ""
    """What the line from here to the next corner is called: edges of one name are one edge set: `name = "base"`."""
    centre: Point | None = None
    """Centre of the circle that the line follows [length]; a straight line by default. Both ends must be at one
    distance from it: `centre = [1.0, 1.0]`."""
    clockwise: bool = False
    """Which way an arc goes around its centre: `clockwise = true`."""
    size: Positive | None = None
    """Size of the triangles at this corner, and along an arc that begins here [length]: `size = 0.02`."""

    @classmethod
    def circle(cls, centre: Point, radius: float, name: str = "", size: float | None = None) -> tuple[Corner, Corner]:
        """A whole circle as two arcs, for holes, regions and closed joints."""
        (x, y), radius = point("centre", centre), positive_number("radius", radius)
        return cls((x + radius, y), name, (x, y), size=size), cls((x - radius, y), name, (x, y), size=size)


Line: TypeAlias = Sequence[Corner | Point]
"""Corners one after the other; a pair of coordinates is a corner without a name."""


class Polygon(NamedTuple):
    """A line of an outline as straight pieces; or several lines, one after the other."""

    pieces: FloatArray
    """Both ends of each piece [length], shape (k, 2, 2)."""
    names: NDArray[np.object_]
    """What edges on each piece are called, or "", shape (k,)."""
    sizes: FloatArray
    """Sizes of triangles at the ends [length], shape (k, 2)."""
    centres: FloatArray
    """Centre of the circle that each piece is a chord of [length]; not a number where it is straight, shape (k, 2)."""

    def holds(self, points: FloatArray) -> BoolArray:
        """Whether points (m, 2) lie inside this closed line, up to its arcs."""
        inside = np.zeros(len(points), dtype=bool)
        for (start, stop), centre in zip(self.pieces, self.centres, strict=True):
            crossed = (start[1] > points[:, 1]) != (stop[1] > points[:, 1])
            side = cross(stop - start, points - start)
            inside ^= crossed & ((side > 0.0) == (stop[1] > start[1]))
            beyond = side * cross(stop - start, centre - start) < 0.0  # the chord of an arc
            inside ^= beyond & (np.hypot(*(points - centre).T) < np.hypot(*(start - centre)))
        return inside


class Polygons(NamedTuple):
    """An outline as polygons."""

    boundary: list[Polygon]
    """Closed lines: the outer one, and holes."""
    inner: list[Polygon]
    """Joints, open or closed, and the lines around regions."""
    regions: dict[str, Polygon]
    every: Polygon
    """All lines, those of the boundary first."""
    points: FloatArray
    sizes: FloatArray
    """Sizes of their own (k,) that triangles have at the `points` (k, 2) [length]."""
    largest: float
    """Size of triangles where nothing else is said [length]."""
    length: float
    """The longer side of the bounding box [length]."""


def polygons(
    corners: Line,
    size: float,
    holes: Sequence[Line] = (),
    joints: object = None,
    regions: object = None,
    sizes: object = None,
) -> Polygons:
    """The lines of an outline as polygons, see `TriangleMesh.outline`; `InputError` says which is wrong, and where."""
    size = positive_number("size", size)
    if size > LARGEST:
        raise InputError("size", size, f"give at most {LARGEST:.0e}: take other units")
    places = mapping("sizes", sizes, "points to sizes", optional=True)
    boundary = [_polygon("corners", corners, size, closed=True)]
    boundary += [_polygon(f"holes[{k}]", line, size, closed=True) for k, line in enumerate(_listed(holes))]
    inner, areas = list[Polygon](), dict[str, Polygon]()
    for kind, given in (("joints", joints), ("regions", regions)):
        for name, line in mapping(kind, given, "names to lines", optional=True).items():
            if not isinstance(name, str) or not name:
                raise InputError(kind, name, "give names that are not empty")
            last = _listed(line)[-1:]  # a joint whose last corner begins an arc can only lead back to the first
            closed = kind == "regions" or any(isinstance(each, Corner) and each.centre is not None for each in last)
            polygon = _polygon(f"{kind}.{name}", line, size, closed=closed)
            polygon.names[:] = name if kind == "joints" else ""
            inner.append(polygon)
            if kind == "regions":
                areas[name] = polygon
    at = np.array([point("sizes", place) for place in places]).reshape(-1, 2)
    own = np.array([positive_number(f"sizes[{place}]", given) for place, given in places.items()])
    every = Polygon(*map(np.concatenate, zip(*boundary, *inner, strict=True)))
    outline = Polygons(boundary, inner, areas, every, at, own, size, float(np.ptp(boundary[0].pieces, (0, 1)).max()))
    _check_sizes(outline)
    _check_lines(outline)
    _check_inside(outline)
    return outline


def _polygon(name: str, line: Line, size: float, *, closed: bool) -> Polygon:
    corners = [corner if isinstance(corner, Corner) else Corner(corner) for corner in _listed(line)]
    if len(corners) < 2:
        raise InputError(name, len(corners), "give two or more corners")
    corners += corners[:1] if closed else []
    own = [corner.size or size for corner in corners]
    steps = [_steps(name, *each) for each in zip(corners, corners[1:], own, strict=False)]
    counts = [len(points) for points in steps]
    if closed and sum(counts) < 3:
        raise InputError(name, len(corners) - 1, "give three or more corners of a closed line, or arcs between two")
    points, sizes = np.concatenate([*steps, [corners[-1].at]]), np.repeat(own, [*counts, 1])
    names = np.repeat(np.array([corner.name for corner in corners[:-1]], dtype=object), counts)
    centres = [(np.nan, np.nan) if corner.centre is None else corner.centre for corner in corners[:-1]]
    ends = np.arange(len(names))[:, None] + [0, 1]
    return Polygon(points[ends], names, sizes[ends], np.repeat(centres, counts, axis=0))


def _steps(name: str, corner: Corner, following: Corner, size: float) -> FloatArray:
    """The corner, and the points of an arc that starts there, without its end."""
    start, stop = np.array(corner.at), np.array(following.at)
    if np.array_equal(start, stop):
        raise InputError(name, corner.at, "two corners lie here one after the other: leave one out")
    if corner.centre is None:
        return start[None]
    centre = np.array(corner.centre)
    radius, other = float(np.hypot(*(start - centre))), float(np.hypot(*(stop - centre)))
    if not abs(radius - other) <= _SAME_RADIUS * radius:
        remedy = f"the ends of this arc are {radius:.9g} and {other:.9g} from its centre: correct one of the three"
        raise InputError(name, corner.centre, remedy)
    first, last = (float(np.arctan2(*(end - centre)[::-1])) for end in (start, stop))
    turn = (first - last if corner.clockwise else last - first) % (2.0 * np.pi)
    chords = np.ceil(max(turn * radius / size, turn / _WIDEST) - 1e-9)  # infinite for the smallest sizes
    if chords > _MOST_LINES:
        raise InputError(name, size, f"would divide this arc into {chords:g} chords, at most {_MOST_LINES}: give more")
    if chords < 1.0:
        raise InputError(name, corner.centre, "is too far from this arc: leave the centre out, the line is straight")
    count = int(chords)
    angles = first + (-1.0 if corner.clockwise else 1.0) * turn * np.arange(count) / count
    points = centre + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    points[0] = start
    return points


def _check_sizes(found: Polygons) -> None:
    """The body has a length, near the origin compared with it, and sizes do not make too many triangles."""
    pieces, sizes, (start, stop) = found.every.pieces, found.every.sizes, found.boundary[0].pieces.swapaxes(0, 1)
    farthest = float(np.abs(pieces).max())
    if not found.length > 0.0 or farthest > _FARTHEST * found.length:
        raise InputError("corners", farthest, f"the body is {found.length:g} long: move it to the origin")
    smallest = min(found.largest, float(sizes.min()), *found.sizes.tolist())
    if smallest < _SMALLEST * found.length:
        raise InputError("size", smallest, f"is too small for a body of length {found.length:g}: give more")
    edges = float((np.hypot(*(pieces[:, 1] - pieces[:, 0]).T) / sizes[:, 0]).sum())
    area = abs(float(cross(start, stop).sum())) / 2.0
    triangles = 4.0 / np.sqrt(3.0) * area / found.largest**2 + edges
    if triangles > _MOST_TRIANGLES:
        remedy = f"makes about {triangles:.0e} triangles, at most {_MOST_TRIANGLES}: give more"
        raise InputError("size", found.largest, remedy)


def _check_lines(found: Polygons) -> None:
    """Lines meet, or keep a distance, as what lies between them is divided too; those of the boundary do not meet."""
    least, rounding, pieces = _APART * found.length, _NEAR * found.length, found.every.pieces
    if len(pieces) > _MOST_LINES:
        raise InputError("outline", len(pieces), f"has more than {_MOST_LINES} lines and chords: give larger sizes")
    lengths = np.hypot(*(pieces[:, 1] - pieces[:, 0]).T)
    if lengths.min() < least:
        place = tuple(pieces[np.argmin(lengths), 0].tolist())
        raise InputError("outline", place, "two corners lie here one after the other: leave one out")
    points = np.concatenate([pieces[:, 0], pieces[:, 1], found.points])
    touching, sides = list[BoolArray](), list[IntArray]()
    for chosen in np.array_split(points, 1 + len(points) // _CHUNK):
        distances = _distances(chosen, found.every)
        close = (distances > rounding) & (distances < least)
        if close.any():
            place = tuple(chosen[np.argwhere(close)[0, 0]].tolist())
            remedy = "this point nearly lies on another line or point: let them meet, or move them apart"
            raise InputError("outline", place, remedy)
        touching.append(distances <= rounding)
        offset = cross(pieces[:, 1] - pieces[:, 0], chosen[:, None] - pieces[:, 0]) / lengths  # left of the piece
        sides.append(np.where(np.abs(offset) > rounding, np.sign(offset), 0.0).astype(np.int8))
    counts = [len(line.names) for line in found.boundary]
    own = np.arange(sum(counts))  # pieces of the boundary, and the points that they begin at
    following = np.concatenate([np.roll(part, -1) for part in np.split(own, np.cumsum(counts)[:-1])])
    touch, side = (np.concatenate(each)[np.ix_(own, own)] for each in (touching, sides))
    touch[own, own] = touch[following, own] = False
    apart = side * side[following] < 0  # whether a piece has its ends on both sides of another
    wrong = (touch | (apart & apart.T)).any(axis=0)
    if wrong.any():
        x, y = pieces[np.argmax(wrong)].mean(axis=0).tolist()
        raise InputError("outline", (x, y), "two lines of the boundary cross or touch around this point")


def _check_inside(found: Polygons) -> None:
    """Holes, and places with sizes of their own, lie in the body."""
    outer, *holes = found.boundary
    for k, hole in enumerate(holes):
        start, others = hole.pieces[:1, 0], (other for other in holes if other is not hole)
        if not outer.holds(start)[0] or any(other.holds(start)[0] for other in others):
            raise InputError(f"holes[{k}]", tuple(start[0].tolist()), "this hole is not inside the body: move it")
    inside = np.sum([line.holds(found.points) for line in found.boundary], axis=0) == 1  # in the outer line alone
    border = Polygon(*map(np.concatenate, zip(*found.boundary, strict=True)))
    inside |= (_distances(found.points, border) <= _NEAR * found.length).any(axis=1)
    if not inside.all():
        raise InputError("sizes", tuple(found.points[np.argmin(inside)].tolist()), "give points of the body")


def _distances(points: FloatArray, line: Polygon) -> FloatArray:
    """Distances of points (m, 2) from each of the pieces (k,) of a line, arcs being arcs, shape (m, k) [length]."""
    start, stop = line.pieces[:, 0], line.pieces[:, 1]
    along, offset = stop - start, points[:, None] - start
    t = np.clip((offset * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    found = np.hypot(*np.moveaxis(offset - t[:, :, None] * along, 2, 0))
    first, last, away = start - line.centres, stop - line.centres, points[:, None] - line.centres
    radius, turn = np.hypot(*first.T), np.sign(cross(first, last))
    beside = (turn * cross(first, away) >= 0.0) & (turn * cross(away, last) >= 0.0)  # between the radii to its ends
    beside &= radius < _FLATTEST * np.hypot(*along.T)
    return np.asarray(np.where(beside, np.abs(np.hypot(*np.moveaxis(away, 2, 0)) - radius), found))


def _listed(line: object) -> Sequence[Any]:
    if not isinstance(line, Sequence) or isinstance(line, str):
        raise InputError("outline", line, "give a list of corners, and of such lists for holes")
    return line


# triangles by gmsh

_LOCK: Final = Lock()
_SHARPEST: Final = 0.2  # sine of the angle below which no triangle is made
_OPTIONS: Final = {
    "General.Terminal": 0,
    "General.Verbosity": 0,
    "General.AbortOnError": 2,
    "General.NumThreads": 1,
    "Geometry.Tolerance": 1e-10,
    "Mesh.Algorithm": 6,  # frontal Delaunay
    "Mesh.ElementOrder": 1,
    "Mesh.MeshSizeFromPoints": 1,
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.MeshSizeExtendFromBoundary": 1,
    "Mesh.MeshSizeMin": 0.0,
    "Mesh.MeshSizeFactor": 1.0,
    "Mesh.RandomSeed": 1,
}
_LIBRARIES: Final = "apt-get install libgl1 libglu1-mesa libxcursor1 libxfixes3 libxft2 libxinerama1 libxrender1"


def meshed(shape: Polygons) -> MeshParts:
    """The body as triangles, with edge sets by the names of its lines and regions.

    `InputError` if gmsh or a system library it needs is missing, gmsh cannot divide the body, or an inner line leaves
    it.
    """
    try:
        gmsh = load("gmsh")
    except ImportError as error:
        remedy = "outlines are divided by gmsh: python -m pip install gmsh"
        raise InputError("outline", "gmsh", remedy) from error
    except OSError as error:  # a library of the system is missing
        told = " ".join(str(error).split())
        remedy = f"gmsh needs libraries of the system ({told}): on Debian and Ubuntu {_LIBRARIES}"
        raise InputError("outline", "gmsh", remedy) from error
    with _LOCK, foreign_code(), _session(gmsh):
        try:
            return _divided(gmsh, shape)
        except Exception as error:
            if type(error) is not Exception:  # gmsh raises bare ones with a text
                raise
            told = " ".join(str(error).split()) or "no reason given"
            raise InputError("outline", told, "gmsh cannot divide this body: look for lines that cross") from error


@contextmanager
def _session(gmsh: Any) -> Iterator[None]:
    """A model of its own, in a session of its own if there is none."""
    fresh = not gmsh.isInitialized()
    if fresh:
        with handlers_kept():
            gmsh.initialize(["gmsh", "-v", "0"], readConfigFiles=False, interruptible=False)
    before = None if fresh else gmsh.model.getCurrent()
    kept = {name: gmsh.option.getNumber(name) for name in _OPTIONS}
    try:
        for name, value in _OPTIONS.items():
            gmsh.option.setNumber(name, value)
        gmsh.model.add("qvi_contact outline")
        yield
    finally:
        gmsh.model.remove()
        for name, value in kept.items():
            gmsh.option.setNumber(name, value)
        if before is not None:
            gmsh.model.setCurrent(before)
        if fresh:
            gmsh.finalize()


def _divided(gmsh: Any, shape: Polygons) -> MeshParts:
    """See `meshed`; tolerances of gmsh are absolute: the body is about one unit long there, by a power of two."""
    occ, unit = gmsh.model.occ, 2.0 ** -round(np.log2(shape.length))
    outer = [_drawn(occ, polygon, unit) for polygon in shape.boundary]
    surfaces = [(2, occ.addPlaneSurface([occ.addCurveLoop(lines) for lines in outer]))]
    cuts = [(1, line) for polygon in shape.inner for line in _drawn(occ, polygon, unit)]
    cuts += [(0, occ.addPoint(*place, 0.0)) for place in (unit * shape.points).tolist()]
    if cuts:
        surfaces = [part for part in occ.fragment(surfaces, cuts)[1][0] if part[0] == 2]
    occ.synchronize()
    _set_sizes(gmsh, shape, unit)
    gmsh.model.mesh.generate(2)
    tags, coordinates, _ = gmsh.model.mesh.getNodes()

    def elements(dimension: int, tag: int) -> IntArray:
        """Nodes (k, 2) or (k, 3) of the lines or triangles of a curve or surface, kinds 1 and 2 of gmsh."""
        nodes = gmsh.model.mesh.getElementsByType(dimension, tag)[1]
        return np.asarray(nodes, dtype=np.int64).reshape(-1, dimension + 1)

    parts = [elements(2, tag) for _, tag in sorted(surfaces)]
    cells, surface = np.concatenate(parts), np.repeat(np.arange(len(parts)), list(map(len, parts)))
    used = np.flatnonzero(np.isin(tags, cells))
    vertex = np.full(int(tags.max()) + 1, -1)
    vertex[tags[used].astype(np.int64)] = np.arange(len(used))
    vertices = np.asarray(coordinates, dtype=float).reshape(-1, 3)[used, :2] / unit
    pieces, names, _, centres = shape.every
    named, radii = {name: list[IntArray]() for name in names if name}, np.hypot(*(pieces[:, 0] - centres).T)
    circles, fixed = dict[tuple[float, float, float], list[IntArray]](), list[IntArray]()
    for _, tag in gmsh.model.getEntities(1):  # each is on those pieces that its ends and its middle are on
        places = [gmsh.model.getValue(0, abs(end), [])[:2] for _, end in gmsh.model.getBoundary([(1, tag)])]
        places.append(gmsh.model.getValue(1, tag, np.mean(gmsh.model.getParametrizationBounds(1, tag), axis=0))[:2])
        on = np.flatnonzero((_distances(np.array(places) / unit, shape.every) <= _NEAR * shape.length).all(axis=0))
        pairs = vertex[elements(1, tag)]
        fixed.append(pairs)
        for name in {*names[on]} - {""}:
            named[name].append(pairs)
        bent = on[np.isfinite(radii[on])]
        if len(bent) and (pairs >= 0).all():
            around = *centres[bent[0]].tolist(), float(np.round(unit * radii[bent[0]], 12)) / unit
            circles.setdefault(around, []).append(pairs)
    edge_sets = {name: np.concatenate(found) for name, found in named.items() if found}
    for name, found in edge_sets.items():
        if (found < 0).any():
            remedy = "this inner line leaves the body: end it on the boundary or inside"
            raise InputError(f"joints.{name}", name, remedy)
    arcs = [
        circle((x, y), radius, np.concatenate(found), vertices, "TriangleMesh.arcs.")
        for (x, y, radius), found in circles.items()
    ]
    cells = divided_corners(vertices, vertex[cells], np.concatenate(fixed))
    # a surface of gmsh lies in a region or outside; a triangle on the chord of an arc may have its middle beyond that
    a, b, c = vertices[cells].swapaxes(0, 1)
    middles, areas = (a + b + c) / 3.0, np.abs(cross(b - a, c - a))
    held = {
        name: np.bincount(surface, areas * (2.0 * line.holds(middles) - 1.0)) for name, line in shape.regions.items()
    }
    regions = {name: np.flatnonzero((share > 0.0)[surface]) for name, share in held.items()}
    for name, chosen in regions.items():
        if not len(chosen):
            raise InputError(f"regions.{name}", name, "no part of the body lies in this region: move it")
    return MeshParts(vertices, cells, edge_sets, regions, arcs)


def _drawn(occ: Any, polygon: Polygon, unit: float) -> list[int]:
    """The polygon's pieces as lines and arcs of gmsh."""
    pieces = [(tuple(start), tuple(stop)) for start, stop in (unit * polygon.pieces).tolist()]
    tags = {place: occ.addPoint(*place, 0.0) for place in dict.fromkeys(place for ends in pieces for place in ends)}
    drawn, middles = [], []
    for (start, stop), (x, y) in zip(pieces, (unit * polygon.centres).tolist(), strict=True):
        if np.isnan(x):
            drawn.append(occ.addLine(tags[start], tags[stop]))
        else:
            middles.append(occ.addPoint(x, y, 0.0))
            drawn.append(occ.addCircleArc(tags[start], middles[-1], tags[stop]))
    occ.remove([(0, tag) for tag in middles])
    return drawn


def _set_sizes(gmsh: Any, shape: Polygons, unit: float) -> None:
    """Sizes at all points, the smallest where several are given at one place."""
    places = np.concatenate([shape.every.pieces.reshape(-1, 2), shape.points])
    sizes = np.concatenate([shape.every.sizes.ravel(), shape.sizes])
    gmsh.option.setNumber("Mesh.MeshSizeMax", unit * float(sizes.max()))
    for entity in gmsh.model.getEntities(0):
        at = np.array(gmsh.model.getValue(*entity, [])[:2]) / unit
        here = np.hypot(*(places - at).T) <= _NEAR * shape.length
        gmsh.model.mesh.setSize([entity], unit * float(sizes[here].min() if here.any() else shape.largest))


def divided_corners(vertices: FloatArray, cells: IntArray, fixed: IntArray) -> IntArray:
    """The triangles (m, 3), corners of the body not filled by a single one, for the reason in `TriangleMesh.grid`.

    The edge opposite the corner is turned, unless it is one of the `fixed` ones (k, 2) or that would make a needle.
    """
    cells = np.sort(cells, axis=1)
    topology = Topology.of(cells, len(vertices))
    kept = np.isin(np.arange(len(topology.ends)), topology.number(fixed))
    inner = ~topology.boundary[topology.of_cells]
    changed, touched = cells.copy(), np.zeros(len(cells), dtype=bool)
    for cell in np.flatnonzero(inner.sum(axis=1) == 1).tolist():
        opposite = int(topology.of_cells[cell, np.argmax(inner[cell])])
        pair = [cell, int(topology.cells[opposite].sum()) - cell]
        if kept[opposite] or touched[pair].any():
            continue
        b, c = topology.ends[opposite].tolist()
        a, d = (cells[pair].sum(axis=1) - (b + c)).tolist()
        turned = np.array([[a, b, d], [a, d, c]])
        sides = np.roll(vertices[turned], -1, axis=1) - vertices[turned]
        before = -np.roll(sides, 1, axis=1)
        lengths = np.hypot(*np.moveaxis(sides, 2, 0)) * np.hypot(*np.moveaxis(before, 2, 0))
        sines = cross(sides, before) / lengths  # of another sign in a triangle that is turned over
        if (sines * np.sign(sines[0, 0])).min() > _SHARPEST:
            changed[pair] = turned
            touched[pair] = True
    return np.sort(changed, axis=1)
