"""Bodies described by their outline: corners joined by straight lines and arcs, holes, inner lines, sizes.

An arc is first divided into chords with vertices on the circle, about as long as the sides of triangles there. The mesh
then makes these edges arcs of the circle, so that the body ends at the arc.

gmsh makes the triangles. It has one state per process. So it is started for one mesh and ended after it, under a lock,
without configuration files, threads or output. A session of the caller is left as it was, and so are signal handlers,
which the start of gmsh replaces.
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
from qvi_contact.mesh.edges import cross
from qvi_contact.mesh.grid import graded_lines
from qvi_contact.mesh.selection import crossing, in_circles, point
from solvers.basics.foreign import foreign_code, handlers_kept
from solvers.basics.types import load

Point: TypeAlias = tuple[float, float]

_SAME_RADIUS: Final = 1e-6  # relative difference of the distances of an arc's ends from its centre
_MAX_CHORD_ANGLE: Final = np.pi / 6.0  # angle of a circle that one chord spans [rad]
_MAX_LINES: Final = 4000
_MAX_TRIANGLES: Final = 200_000
# relative to the body's length:
_SAME_PLACE: Final = 1e-9  # points at this distance coincide
_MIN_DISTANCE: Final = 1e-5  # least distance of points and lines that do not meet
_MIN_SIZE: Final = 1e-7  # of triangles
_MAX_RADIUS: Final = 1e6  # relative to the chord: a flatter arc is its chord up to rounding


@dataclass(frozen=True)
class Corner(Checked):
    """A point of an outline, and the line from there to the next one."""

    at: Point
    """Coordinates [length]: `at = [2.0, 0.0]`."""
    name: Name = ""
    """Name of the line from here to the next corner; lines with the same name are one edge set: `name = "base"`."""
    centre: Point | None = None
    """Centre of the circle that the line follows [length]; a straight line by default. Both ends must be at the same
    distance from it: `centre = [1.0, 1.0]`."""
    clockwise: bool = False
    """Whether the arc runs clockwise around its centre: `clockwise = true`."""
    size: Positive | None = None
    """Size of the triangles here; it changes evenly along the line to the next corner [length]: `size = 0.02`."""

    @classmethod
    def circle(cls, centre: Point, radius: float, name: str = "", size: float | None = None) -> tuple[Corner, Corner]:
        """A whole circle as two arcs, for holes, regions and closed joints."""
        (x, y), radius = point("centre", centre), positive_number("radius", radius)
        return cls((x + radius, y), name, (x, y), size=size), cls((x - radius, y), name, (x, y), size=size)


Line: TypeAlias = Sequence[Corner | Point]
"""Corners in order; a pair of coordinates is a corner without a name."""
_Arcs: TypeAlias = dict[tuple[object, ...], FloatArray]  # points by ends, centre and sense


class Polygon(NamedTuple):
    """A line of an outline as k straight pieces; or several lines, one after the other."""

    pieces: FloatArray
    """Both ends of each piece [length], shape (k, 2, 2)."""
    names: NDArray[np.object_]
    """Name of the edges on each piece, or "", shape (k,)."""
    sizes: FloatArray
    """Sizes of triangles at the ends [length], shape (k, 2)."""
    centres: FloatArray
    """Centre of the circle of which each piece is a chord [length], shape (k, 2); NaN for straight lines."""

    def holds(self, points: FloatArray) -> BoolArray:
        """Whether points (m, 2) lie inside this closed line, up to its arcs."""
        inside = np.zeros(len(points), dtype=bool)
        for (start, stop), centre in zip(self.pieces, self.centres, strict=True):
            crosses = (start[1] > points[:, 1]) != (stop[1] > points[:, 1])
            side = cross(stop - start, points - start)
            inside ^= crosses & ((side > 0.0) == (stop[1] > start[1]))
            in_segment = side * cross(stop - start, centre - start) < 0.0  # beyond the chord, seen from the centre
            inside ^= in_segment & (np.hypot(*(points - centre).T) < np.hypot(*(start - centre)))
        return inside


class Polygons(NamedTuple):
    """An outline as polygons."""

    boundary: list[Polygon]
    """Closed lines: the outer one, and holes."""
    inner: list[Polygon]
    """Joints, open or closed, and the lines around regions."""
    regions: dict[str, list[Polygon]]
    every: Polygon
    """All lines, those of the boundary first."""
    points: FloatArray
    sizes: FloatArray
    """Sizes (k,) of triangles at the `points` (k, 2) [length]."""
    largest: float
    """Size of triangles elsewhere [length]."""
    length: float
    """The longer side of the bounding box [length]."""


def polygons(
    corners: Line, size: float, holes: Sequence[Line], joints: object, regions: object, sizes: object
) -> Polygons:
    """The lines of an outline as polygons, see `TriangleMesh.outline`; `InputError` names a line that is wrong."""
    size = positive_number("size", size)
    if size > LARGEST:
        raise InputError("size", size, f"give at most {LARGEST:.0e}: take other units")
    given_sizes = mapping("sizes", sizes, "points to sizes", optional=True)
    arcs = _Arcs()
    lines = {"corners": corners, **{f"holes[{k}]": line for k, line in enumerate(_checked_list(holes))}}
    boundary = [_polygon(name, line, size, arcs, closed=True) for name, line in lines.items()]
    inner, areas = list[Polygon](), dict[str, list[Polygon]]()
    for kind, value in (("joints", joints), ("regions", regions)):
        for path, name, line in _named_lines(kind, value):
            last = _checked_list(line)[-1:]  # a joint whose last corner begins an arc can only lead back to the first
            closed = kind == "regions" or any(isinstance(each, Corner) and each.centre is not None for each in last)
            polygon = _polygon(path, line, size, arcs, closed=closed)
            polygon.names[:] = name if kind == "joints" else ""
            inner.append(polygon)
            if kind == "regions":
                areas.setdefault(name, []).append(polygon)
    points = np.array([point("sizes", place) for place in given_sizes]).reshape(-1, 2)
    point_sizes = np.array([positive_number(f"sizes[{place}]", value) for place, value in given_sizes.items()])
    all_lines = Polygon(*map(np.concatenate, zip(*boundary, *inner, strict=True)))
    length = float(np.ptp(boundary[0].pieces, (0, 1)).max())
    outline = Polygons(boundary, inner, areas, all_lines, points, point_sizes, size, length)
    _check_sizes(outline)
    _check_lines(outline)
    _check_inside(outline)
    return outline


def _named_lines(kind: str, lines: object) -> Iterator[tuple[str, str, Line]]:
    """Place in messages, name and corners of each line of the "joints" or "regions", which may have several lines."""
    for name, line in mapping(kind, lines, "names to lines", optional=True).items():
        if not isinstance(name, str) or not name:
            raise InputError(kind, name, "give names that are not empty")
        first = line[0] if isinstance(line, Sequence) and len(line) else None
        if isinstance(first, Sequence) and all(isinstance(each, Corner | Sequence) for each in first):  # not (x, y)
            yield from ((f"{kind}.{name}[{index}]", name, each) for index, each in enumerate(line))
        else:
            yield f"{kind}.{name}", name, line


def _polygon(name: str, line: Line, size: float, arcs: _Arcs, *, closed: bool) -> Polygon:
    corners = [corner if isinstance(corner, Corner) else Corner(corner) for corner in _checked_list(line)]
    if len(corners) < 2:
        raise InputError(name, len(corners), "give two or more corners")
    least = 2 if closed and len(corners) == 2 else 1  # chords of an arc: those of two corners would lie on one line
    corners += corners[:1] if closed else []
    corner_sizes = [corner.size or size for corner in corners]
    divisions = []
    for corner, stop, *end_sizes in zip(corners, corners[1:], corner_sizes, corner_sizes[1:], strict=False):
        # an arc that two lines have in common, as a joint and a region, is divided once: else needles would result
        key = corner.at, stop.at, corner.centre, corner.clockwise
        if len(arcs.get(key, ())) < least:
            arcs[key] = _division(name, corner, stop, end_sizes, least)
            arcs[stop.at, corner.at, corner.centre, not corner.clockwise] = np.array([stop.at, *arcs[key][:0:-1]])
        divisions.append(arcs[key])
    counts = [len(points) for points in divisions]
    if closed and sum(counts) < 3:
        raise InputError(name, len(corners) - 1, "give three or more corners of a closed line, or arcs between two")
    points = np.concatenate([*divisions, [corners[-1].at]])
    steps = zip(corner_sizes, corner_sizes[1:], counts, strict=False)
    sizes = np.array([*(a * (b / a) ** (k / n) for a, b, n in steps for k in range(n)), corner_sizes[-1]])
    names = np.repeat(np.array([corner.name for corner in corners[:-1]], dtype=object), counts)
    centres = np.array([(np.nan, np.nan) if corner.centre is None else corner.centre for corner in corners[:-1]])
    ends, centres = np.arange(len(names))[:, None] + [0, 1], np.repeat(centres, counts, axis=0)
    if closed and cross(*(points[ends] - points[0]).swapaxes(0, 1)).sum() < 0.0:
        # counterclockwise, as gmsh loses surfaces that inner lines cut if a hole has the other sense than the outside
        ends, names, centres = ends[::-1, ::-1], names[::-1], centres[::-1]
    return Polygon(points[ends], names, sizes[ends], centres)


def _division(name: str, corner: Corner, next_corner: Corner, sizes: Sequence[float], least: int) -> FloatArray:
    """The corner, and the points that divide an arc into `least` or more, without its end point; shape (n, 2)."""
    start, stop = np.array(corner.at), np.array(next_corner.at)
    if np.array_equal(start, stop):
        raise InputError(name, corner.at, "two corners lie here one after the other: leave one out")
    if corner.centre is None:
        return start[None]
    centre = np.array(corner.centre)
    radius, end_radius = float(np.hypot(*(start - centre))), float(np.hypot(*(stop - centre)))
    if not abs(radius - end_radius) <= _SAME_RADIUS * radius:
        remedy = f"the ends of this arc are {radius:.9g} and {end_radius:.9g} from its centre: correct one of the three"
        raise InputError(name, corner.centre, remedy)
    start_angle, end_angle = (float(np.arctan2(*(end - centre)[::-1])) for end in (start, stop))
    turn = (start_angle - end_angle if corner.clockwise else end_angle - start_angle) % (2.0 * np.pi)
    first, last = (min(size, radius * _MAX_CHORD_ANGLE) for size in sizes)
    mean_size = first if first == last else (last - first) / np.log1p((last - first) / first)
    chords = np.ceil(turn * radius / mean_size - 1e-9)  # may be infinite
    if chords > _MAX_LINES:
        raise InputError(name, min(sizes), f"makes {chords:g} chords of this arc, at most {_MAX_LINES}: give more")
    if chords < 1.0:
        raise InputError(name, corner.centre, "is too far from this arc: leave the centre out, the line is straight")
    count = max(int(chords), least)
    shares = graded_lines(0.0, 1.0, count, (last / first) ** (1.0 / count))[:-1]  # sizes are linear in the length
    angles = start_angle + (-1.0 if corner.clockwise else 1.0) * turn * shares
    points = centre + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    points[0] = start
    return points


def _check_sizes(outline: Polygons) -> None:
    """`InputError` if the body has no length, is too far from the origin, or sizes make too many triangles."""
    pieces, sizes, (start, stop) = outline.every.pieces, outline.every.sizes, outline.boundary[0].pieces.swapaxes(0, 1)
    farthest = float(np.abs(pieces).max())
    if not outline.length > 0.0 or np.spacing(farthest) > _SAME_PLACE / 4.0 * outline.length:
        raise InputError("corners", farthest, f"the body is {outline.length:g} long: move it to the origin")
    smallest = min(outline.largest, float(sizes.min()), *outline.sizes.tolist())
    if smallest < _MIN_SIZE * outline.length:
        raise InputError("size", smallest, f"is too small for a body of length {outline.length:g}: give more")
    edges = float((np.hypot(*(pieces[:, 1] - pieces[:, 0]).T) / sizes[:, 0]).sum())
    area = abs(float(cross(start, stop).sum())) / 2.0
    triangles = 4.0 / np.sqrt(3.0) * area / outline.largest**2 + edges
    if triangles > _MAX_TRIANGLES:
        remedy = f"makes about {triangles:.0e} triangles, at most {_MAX_TRIANGLES}: give more"
        raise InputError("size", outline.largest, remedy)


def _check_lines(outline: Polygons) -> None:
    """`InputError` if lines of the boundary meet, or lines nearly meet: the narrow space would be divided too."""
    least, rounding, pieces = _MIN_DISTANCE * outline.length, _SAME_PLACE * outline.length, outline.every.pieces
    if len(pieces) > _MAX_LINES:
        raise InputError("outline", len(pieces), f"has more than {_MAX_LINES} lines and chords: give larger sizes")
    lengths = np.hypot(*(pieces[:, 1] - pieces[:, 0]).T)
    if lengths.min() < least:
        place = tuple(pieces[np.argmin(lengths), 0].tolist())
        raise InputError("outline", place, "points lie here one after the other: give fewer corners, or larger sizes")
    points, middles = np.concatenate([pieces[:, 0], pieces[:, 1], outline.points]), pieces.mean(axis=1)
    near, point = in_circles(points, middles, lengths / 2.0 + least)  # these circles hold arcs too
    distances = _distances(points[point], pieces[near], outline.every.centres[near])
    too_close = (distances > rounding) & (distances < least)
    if too_close.any():
        remedy = "this point nearly lies on another line or point: let them meet, or move them apart"
        raise InputError("outline", tuple(points[point[too_close].min()].tolist()), remedy)
    counts = [len(line.names) for line in outline.boundary]
    boundary = np.arange(sum(counts))  # its pieces, and the points at which they begin
    next_point = np.concatenate([np.roll(part, -1) for part in np.split(boundary, np.cumsum(counts)[:-1])])
    touches = (distances <= rounding) & (np.maximum(near, point) < len(boundary)) & (near != point)
    touching = near[touches][next_point[near[touches]] != point[touches]]
    wrong = np.append(touching, crossing(pieces[boundary], np.zeros(len(boundary))))
    if len(wrong):
        x, y = middles[wrong.min()].tolist()
        raise InputError("outline", (x, y), "two lines of the boundary cross or touch around this point")


def _check_inside(outline: Polygons) -> None:
    """`InputError` if a hole, or a point with a size, is not inside the body."""
    holes = outline.boundary[1:]
    places = np.concatenate([*(hole.pieces[:1, 0] for hole in holes), outline.points])
    held = np.array([line.holds(places) for line in outline.boundary])
    np.fill_diagonal(held[1:], False)  # a hole begins on its own line
    border = slice(sum(len(line.names) for line in outline.boundary))
    distances = _distances(outline.points[:, None], outline.every.pieces[border], outline.every.centres[border])
    is_outside = ~held[0] | held[1:].any(axis=0)
    is_outside[len(holes) :] &= (distances > _SAME_PLACE * outline.length).all(axis=1)
    if is_outside.any():
        first = int(np.argmax(is_outside))
        of_hole = f"holes[{first}]", "this hole is not inside the body: move it"
        field, remedy = of_hole if first < len(holes) else ("sizes", "give points of the body")
        raise InputError(field, tuple(places[first].tolist()), remedy)


def _distances(points: FloatArray, pieces: FloatArray, centres: FloatArray) -> FloatArray:
    """Distances [length] of points (k, 2) from k pieces, one each, or (m, 1, 2) from all; pieces of arcs are arcs."""
    start, stop = pieces.swapaxes(0, 1)
    piece, offset = stop - start, points - start
    t = np.clip((offset * piece).sum(axis=-1) / (piece**2).sum(axis=1), 0.0, 1.0)
    distance = np.hypot(*np.moveaxis(offset - t[..., None] * piece, -1, 0))
    first, last, arm = start - centres, stop - centres, points - centres
    radius, turn = np.hypot(*first.T), np.sign(cross(first, last))
    in_sector = (turn * cross(first, arm) >= 0.0) & (turn * cross(arm, last) >= 0.0)  # between the radii to both ends
    in_sector &= radius < _MAX_RADIUS * np.hypot(*piece.T)
    return np.asarray(np.where(in_sector, np.abs(np.hypot(*np.moveaxis(arm, -1, 0)) - radius), distance))


def _checked_list(line: object) -> Sequence[Any]:
    if not isinstance(line, Sequence) or isinstance(line, str):
        raise InputError("outline", line, "give a list of corners, and of such lists for holes")
    return line


# triangles by gmsh

_LOCK: Final = Lock()
_OPTIONS: Final = {
    "General.Terminal": 0, "General.Verbosity": 0, "General.AbortOnError": 2, "General.NumThreads": 1,
    "Geometry.Tolerance": 1e-10, "Mesh.Algorithm": 6, "Mesh.ElementOrder": 1,  # algorithm 6: frontal Delaunay
    "Mesh.MeshSizeFromPoints": 1, "Mesh.MeshSizeFromCurvature": 0, "Mesh.MeshSizeExtendFromBoundary": 1,
    "Mesh.MeshSizeMin": 0.0, "Mesh.MeshSizeFactor": 1.0, "Mesh.RandomSeed": 1,
}  # fmt: skip
_LIBRARIES: Final = "apt-get install libgl1 libglu1-mesa libxcursor1 libxfixes3 libxft2 libxinerama1 libxrender1"


def meshed(shape: Polygons) -> MeshParts:
    """The body as triangles, with edge sets by the names of its lines and regions.

    `InputError` if gmsh or a library it needs is missing, gmsh cannot divide the body, or an inner line leaves it.
    """
    try:
        gmsh = load("gmsh")
    except ImportError as error:
        remedy = "outlines are divided by gmsh: python -m pip install gmsh"
        raise InputError("outline", "gmsh", remedy) from error
    except OSError as error:  # a library of the system is missing
        reason = " ".join(str(error).split())
        remedy = f"gmsh needs libraries of the system ({reason}): on Debian and Ubuntu {_LIBRARIES}"
        raise InputError("outline", "gmsh", remedy) from error
    with _LOCK, foreign_code(), _session(gmsh):
        try:
            return _gmsh_mesh(gmsh, shape)
        except Exception as error:
            if type(error) is not Exception:  # gmsh raises bare ones with a text
                raise
            reason = " ".join(str(error).split()) or "no reason given"
            raise InputError("outline", reason, "gmsh cannot divide this body: look for lines that cross") from error


@contextmanager
def _session(gmsh: Any) -> Iterator[None]:
    """A new model of gmsh, in a new session unless the caller has one."""
    is_new = not gmsh.isInitialized()
    if is_new:
        with handlers_kept():
            gmsh.initialize(["gmsh", "-v", "0"], readConfigFiles=False, interruptible=False)
    current = None if is_new else gmsh.model.getCurrent()
    old_options = {name: gmsh.option.getNumber(name) for name in _OPTIONS}
    try:
        for name, value in _OPTIONS.items():
            gmsh.option.setNumber(name, value)
        gmsh.model.add("qvi_contact outline")
        yield
    finally:
        gmsh.model.remove()
        for name, value in old_options.items():
            gmsh.option.setNumber(name, value)
        if current is not None:
            gmsh.model.setCurrent(current)
        if is_new:
            gmsh.finalize()


def _gmsh_mesh(gmsh: Any, shape: Polygons) -> MeshParts:
    """See `meshed`; gmsh has absolute tolerances, so the body is scaled to a length of about 1 by a power of two."""
    occ, unit = gmsh.model.occ, 2.0 ** -round(np.log2(shape.length))
    # the geometry: a surface with holes, cut by the inner lines and by points with sizes
    outer = [_drawn_lines(occ, polygon, unit) for polygon in shape.boundary]
    surfaces = [(2, occ.addPlaneSurface([occ.addCurveLoop(lines) for lines in outer]))]
    cuts = [(1, line) for polygon in shape.inner for line in _drawn_lines(occ, polygon, unit)]
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

    # triangles, surface by surface, and their vertices, numbered anew from 0
    parts = [elements(2, tag) for _, tag in sorted(surfaces)]
    cells, surface = np.concatenate(parts), np.repeat(np.arange(len(parts)), list(map(len, parts)))
    used = np.flatnonzero(np.isin(tags, cells))
    vertex = np.full(int(tags.max()) + 1, -1)
    vertex[tags[used].astype(np.int64)] = np.arange(len(used))
    vertices = np.asarray(coordinates, dtype=float).reshape(-1, 3)[used, :2] / unit
    # names and circles of the edges on gmsh's curves; a curve is on the pieces on which its ends and its middle are
    pieces, names, _, centres = shape.every
    pairs_by_name, radii = {name: list[IntArray]() for name in names if name}, np.hypot(*(pieces[:, 0] - centres).T)
    circles = dict[tuple[float, float, float], list[IntArray]]()
    for _, tag in gmsh.model.getEntities(1):
        places = [gmsh.model.getValue(0, abs(end), [])[:2] for _, end in gmsh.model.getBoundary([(1, tag)])]
        places.append(gmsh.model.getValue(1, tag, np.mean(gmsh.model.getParametrizationBounds(1, tag), axis=0))[:2])
        distances = _distances(np.array(places)[:, None] / unit, pieces, centres)
        on = np.flatnonzero((distances <= _SAME_PLACE * shape.length).all(axis=0))
        pairs = vertex[elements(1, tag)]
        for name in {*names[on]} - {""}:
            pairs_by_name[name].append(pairs)
        on_arcs = on[np.isfinite(radii[on])]
        if len(on_arcs) and (pairs >= 0).all():
            key = *centres[on_arcs[0]].tolist(), float(np.round(unit * radii[on_arcs[0]], 12)) / unit
            circles.setdefault(key, []).append(pairs)
    edge_sets = {name: np.concatenate(all_pairs) for name, all_pairs in pairs_by_name.items() if all_pairs}
    for name, all_pairs in edge_sets.items():
        if (all_pairs < 0).any():
            remedy = "this inner line leaves the body: end it on the boundary or inside"
            raise InputError(f"joints.{name}", name, remedy)
    arcs = [circle((x, y), radius, np.concatenate(pairs), vertices) for (x, y, radius), pairs in circles.items()]
    cells = vertex[cells]
    # most of a surface's area decides whether it is in a region: a triangle at an arc may have its centre beyond it
    a, b, c = vertices[cells].swapaxes(0, 1)
    middles, areas = (a + b + c) / 3.0, np.abs(cross(b - a, c - a))
    regions = dict[str, IntArray]()
    for name, lines in shape.regions.items():
        area_in = [np.bincount(surface, areas * (2.0 * line.holds(middles) - 1.0)) for line in lines]
        is_inside = np.array(area_in) > 0.0  # of each line, each surface
        empty = np.flatnonzero(~is_inside.any(axis=1))
        if len(empty):
            place = f"regions.{name}" + f"[{empty[0]}]" * (len(lines) > 1)
            raise InputError(place, name, "no part of the body lies in this region: move it")
        regions[name] = np.flatnonzero(is_inside[:, surface].any(axis=0))
    return MeshParts(vertices, np.sort(cells, axis=1), edge_sets, regions, arcs)


def _drawn_lines(occ: Any, polygon: Polygon, unit: float) -> list[int]:
    """Add the pieces of a polygon to gmsh as lines and arcs; their tags."""
    pieces = [(tuple(start), tuple(stop)) for start, stop in (unit * polygon.pieces).tolist()]
    tags = {place: occ.addPoint(*place, 0.0) for place in dict.fromkeys(place for ends in pieces for place in ends)}
    lines, centres = [], []
    for (start, stop), (x, y) in zip(pieces, (unit * polygon.centres).tolist(), strict=True):
        if np.isnan(x):
            lines.append(occ.addLine(tags[start], tags[stop]))
        else:
            centres.append(occ.addPoint(x, y, 0.0))
            lines.append(occ.addCircleArc(tags[start], centres[-1], tags[stop]))
    occ.remove([(0, tag) for tag in centres])
    return lines


def _set_sizes(gmsh: Any, shape: Polygons, unit: float) -> None:
    """Set the sizes at all points of the geometry, the smallest where several are given at one place."""
    places = np.concatenate([shape.every.pieces.reshape(-1, 2), shape.points])
    sizes = np.concatenate([shape.every.sizes.ravel(), shape.sizes])
    gmsh.option.setNumber("Mesh.MeshSizeMax", unit * float(sizes.max()))
    for entity in gmsh.model.getEntities(0):
        position = np.array(gmsh.model.getValue(*entity, [])[:2]) / unit
        is_here = np.hypot(*(places - position).T) <= _SAME_PLACE * shape.length
        gmsh.model.mesh.setSize([entity], unit * float(sizes[is_here].min() if is_here.any() else shape.largest))
