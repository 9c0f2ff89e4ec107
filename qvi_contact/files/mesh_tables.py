"""The tables of a problem file that define the mesh: as a grid, an outline, triangles in the file or in a mesh file.

The fields of a class are the keys of its table; its methods make that part of the mesh. Errors name the key by path.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from typing import Annotated, Any, Final, Literal

import numpy as np

from qvi_contact.basics import schema
from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, positive_number, real_array
from qvi_contact.errors import InputError
from qvi_contact.mesh.curves import Curve, MeshParts, circle, ellipse, fitted
from qvi_contact.mesh.grid import checked_lines, graded_lines, on_line
from qvi_contact.mesh.outline import Corner, Line, Point
from qvi_contact.mesh.selection import checked_set, edges_in_box, edges_on_segment
from qvi_contact.mesh.triangles import TriangleMesh

_MOST_IN_A_ROW: Final = 10_000  # cells in one piece of grid lines
_MOST_CELLS: Final = 1_000_000  # cells in a grid
_FINEST: Final = 1e-9  # smallest cell size that `refine` accepts, relative to the larger side of the grid
_SAMPLES: Final = 2000  # points on each half of an interval at which 1 / size is integrated

Lines = tuple[FloatArray, FloatArray]
"""Grid lines across x and across y."""


def _check_choice(table: object, alternatives: Mapping[tuple[str, ...], tuple[str, ...]]) -> None:
    """`InputError` unless a table uses one of the alternatives, each given as {all keys it needs: keys it may have}."""
    used = [keys for keys in alternatives if any(getattr(table, name) is not None for name in keys)]
    if len(used) != 1:
        remedy = f"give {', or '.join(map(' and '.join, alternatives))}: one of these"
        raise InputError((used or list(alternatives)[:1])[-1][0], [" and ".join(keys) for keys in used] or None, remedy)
    for name in used[0]:
        if getattr(table, name) is None:
            raise InputError(name, None, schema.ADD)
    for keys, extra_keys in alternatives.items():
        for name in extra_keys if keys not in used else ():
            value = getattr(table, name)
            if value != schema.defaults_of(type(table))[name]:
                raise InputError(name, value, f"this belongs to {' and '.join(keys)}: leave it out")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Segment:
    """A piece of grid lines, from `start` to `stop`, see `qvi_contact.graded_lines`."""

    start: float | None = None
    """First grid line; left out after another piece: `start = 0.0`."""
    stop: float
    """Last grid line: `stop = 2.0`."""
    cells: Annotated[int, schema.Whole(1, _MOST_IN_A_ROW)]
    """Number of cells: `cells = 8`."""
    grading: float = 1.0
    """Size of each cell over the size of the cell before it: `grading = 0.9`."""
    both_ends: bool = False
    """Whether cells shrink towards both ends: `both_ends = true`."""


class Axis(schema.Kind):
    """Grid lines: a list of them, a piece, or a list of pieces."""

    values = "list of numbers, piece or list of pieces"
    of = Segment

    def read(self, value: Any, reader: schema.Reader) -> FloatArray:
        """All grid lines; a list of numbers is taken as it stands."""
        single = isinstance(value, dict)
        if not single and not isinstance(value, list):
            remedy = "give a list of grid lines, a piece { start = 0.0, stop = 1.0, cells = 8 }, or a list of pieces"
            raise InputError("", value, remedy)
        if not single and not (value and isinstance(value[0], dict)):
            return checked_lines("", schema.Listed(schema.FINITE).read(value, reader))
        lines: FloatArray = np.empty(0)
        segments = [schema.read_table(Segment, value, reader)] if single else schema.Tables(Segment).read(value, reader)
        for index, segment in enumerate(segments):
            with schema.located("" if single else f"[{index}]"):
                start = float(lines[-1]) if segment.start is None and len(lines) else segment.start
                if start is None:
                    raise InputError("start", schema.Missing(), schema.ADD)
                if len(lines) and start != lines[-1]:
                    raise InputError("start", start, f"start where the piece before stops, at {lines[-1]:.12g}")
                with schema.located("", schema.keys_of(Segment)):
                    piece_lines = graded_lines(start, segment.stop, segment.cells, segment.grading, segment.both_ends)
                lines = np.concatenate([lines[:-1], piece_lines])
        return lines


@dataclass(frozen=True, eq=False, repr=False)
class Rectangle:
    """Cells of a grid within ranges of x and y; a range left out is the whole grid."""

    x: Point | None = None
    """Range along x: `x = [0.0, 1.0]`."""
    y: Point | None = None
    """Range along y: `y = [0.5, 2.0]`."""

    def cells(self, lines: Lines) -> tuple[slice, slice]:
        """Slices of rows and columns of the grid's cells, which lie in the rectangle."""
        slices = []
        for name, grid_lines in (("y", lines[1]), ("x", lines[0])):
            bounds = getattr(self, name) or (grid_lines[0], grid_lines[-1])
            first, last = (int(np.searchsorted(grid_lines, on_line(name, bound, grid_lines))) for bound in bounds)
            if first >= last:
                raise InputError(name, bounds, "give the smaller end first")
            slices.append(slice(first, last))
        return slices[0], slices[1]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RefineTable:
    """Grid lines added so that cells shrink geometrically towards re-entrant corners and ends, in x and in y."""

    largest: float
    """Largest cell: `largest = 0.25`."""
    smallest: float | None = None
    """Size of cells at re-entrant corners and at the ends in `towards`. The first cell there is up to
    (1/ratio − 1)/ln(1/ratio) times as large: 1.2 times at a ratio of 0.7, 1.4 at 0.5, 1.9 at 0.3: `smallest = 0.01`."""
    ratio: Annotated[float, schema.Number(0.01, 0.99)] = 0.5
    """Size of a cell over that of its larger neighbour: `ratio = 0.7`."""
    towards: tuple[str, ...] = ()
    """Edge sets at whose ends the cells shrink to `smallest` too: `towards = ["base"]`."""

    def lines(self, mesh: TriangleMesh, body: BoolArray, lines: Lines) -> Lines:
        """The given grid lines and further ones between them; `body` (ny, nx) marks the cells of the body.

        Cells are about `largest` wide. They shrink geometrically to `smallest` towards the critical points: re-entrant
        corners of the body, and both ends of every edge set or joint in `towards`. In x and in y separately, the size
        at a distance d from the nearest coordinate of a critical point is min(largest, smallest + ln(1/ratio) d).
        """
        body_count = np.pad(body, 1).astype(np.int64)
        body_count = body_count[1:, 1:] + body_count[1:, :-1] + body_count[:-1, 1:] + body_count[:-1, :-1]
        row, column = np.nonzero(body_count == 3)  # re-entrant: three of the four cells around it belong to the body
        critical_points = [np.column_stack([lines[0][column], lines[1][row]])]
        for index, name in enumerate(self.towards):
            with schema.located(f"towards[{index}]", ()):
                edges = mesh.edges(name)
            vertex, count = np.unique(np.concatenate([edges.first, edges.second]), return_counts=True)
            critical_points.append(mesh.vertices[vertex[count == 1]])
        largest = positive_number("largest", self.largest)
        smallest = largest if self.smallest is None else positive_number("smallest", self.smallest)
        if smallest > largest:
            raise InputError("smallest", smallest, f"give at most largest = {largest:g}")
        least = _FINEST * max(float(np.ptp(across)) for across in lines)
        for name, size in (("largest", largest), ("smallest", smallest)):
            if size < least:
                raise InputError(name, size, f"give at least {_FINEST:g} of the body, {least:g}")
        points, growth = np.concatenate(critical_points), -float(np.log(self.ratio))
        x, y = (_subdivided(lines[k], np.unique(points[:, k]), largest, smallest, growth) for k in range(2))
        return x, y


def _subdivided(lines: FloatArray, corners: FloatArray, largest: float, smallest: float, growth: float) -> FloatArray:
    """Lines added so that cells are about h(x) wide, h = min(largest, smallest + growth · distance to `corners`)."""
    pieces, total = [lines[:1]], 0
    for start, stop in pairwise(lines.tolist()):
        t = np.linspace(0.0, 1.0, _SAMPLES)
        x = start + (stop - start) * np.concatenate([t**3 / 2, 1.0 - t[-2::-1] ** 3 / 2])  # dense at both ends
        distance = np.abs(x[:, None] - corners).min(axis=1, initial=np.inf)
        size = np.minimum(largest, smallest + growth * distance)
        cells = np.concatenate([[0.0], np.cumsum(np.diff(x) * (1.0 / size[1:] + 1.0 / size[:-1]) / 2.0)])  # ∫ dx / h
        count = max(1, int(np.ceil(cells[-1] - 1e-3)))
        total += count
        if total > _MOST_CELLS:
            raise InputError("largest", largest, "give more: this makes too many cells in all")
        pieces.append(np.append(np.interp(np.arange(1, count) * cells[-1] / count, cells, x), stop))
    return np.concatenate(pieces)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class LineTable:
    """A line of an outline by its corners, or a circle: a hole, a joint, or the border of a region."""

    name: schema.Name = ""
    """Name of the joint or region, which needs one, or of the edges of a round hole; joints or regions with the same
    name are one: `name = "bore"`."""
    corners: Annotated[tuple[Corner, ...], schema.Tables(Corner, None)] | None = None
    """Corners in order; a joint is closed if the first one is repeated at its end, or an arc begins at the last one:
    `corners = [{ at = [0.0, 0.0] }, { at = [1.0, 0.0] }, { at = [0.0, 1.0] }]`."""
    centre: Point | None = None
    """Centre of a circle: `centre = [1.0, 1.0]`."""
    radius: float | None = None
    """Radius of a circle: `radius = 0.4`."""
    size: float | None = None
    """Size of the triangles along a circle: `size = 0.1`."""

    def __post_init__(self) -> None:
        _check_choice(self, {("centre", "radius"): ("size",), ("corners",): ()})

    def line(self, kind: str) -> Sequence[Corner]:
        """The corners of the line, which belongs to a `kind`: "holes", "joints" or "regions"."""
        is_hole = kind == "holes"
        if not is_hole and not self.name:
            raise InputError("name", schema.Missing(), schema.ADD)
        if is_hole and self.corners is not None and self.name:
            raise InputError("name", self.name, "give the names to the corners where the lines begin")
        if self.corners is not None:
            return self.corners
        assert self.centre is not None  # checked above
        assert self.radius is not None
        return Corner.circle(self.centre, self.radius, self.name if is_hole else "", self.size)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SizeTable:
    """Size of the triangles at a point."""

    at: Point
    """The point: `at = [1.0, 0.5]`."""
    size: float
    """Size of the triangles there: `size = 0.05`."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class OutlineTable:
    """An outline that gmsh divides into triangles, see `qvi_contact.TriangleMesh.outline`."""

    size: float
    """Size of the triangles where no other size is given: `size = 0.2`."""
    corners: Annotated[tuple[Corner, ...], schema.Tables(Corner, None)]
    """Corners of the body, see `[[mesh.outline.corners]]`: `corners = [{ at = [0.0, 0.0] }, { at = [1.0, 0.0] }, {
    at = [0.0, 1.0] }]`."""
    holes: tuple[LineTable, ...] = ()
    """Holes, by corners or as circles: `holes = [{ centre = [1.0, 1.0], radius = 0.4 }]`."""
    joints: tuple[LineTable, ...] = ()
    """Lines inside the body, open or closed, which come apart only where a contact names them: `joints = [{ name =
    "joint", corners = [{ at = [0.0, 0.5] }, { at = [1.0, 0.5] }] }]`."""
    regions: tuple[LineTable, ...] = ()
    """Regions of another material: `regions = [{ name = "inclusion", centre = [1.0, 1.0], radius = 0.2 }]`."""
    sizes: tuple[SizeTable, ...] = ()
    """Points at which the triangles have another size: `sizes = [{ at = [1.0, 0.5], size = 0.05 }]`."""

    def mesh(self) -> TriangleMesh:
        """The triangles that gmsh makes of the outline."""
        holes, places = list[Line](), dict[str, str]()  # places in the file by fields of `TriangleMesh.outline`
        named: dict[str, dict[str, list[Line]]] = {"joints": {}, "regions": {}}
        for kind in ("holes", *named):
            for index, table in enumerate(getattr(self, kind)):
                with schema.located(f"{kind}[{index}]", schema.keys_of(LineTable)):
                    line = table.line(kind)
                lines = holes if kind == "holes" else named[kind].setdefault(table.name, [])
                places.setdefault(f"{kind}.{table.name}", f"{kind}[{index}]")
                places[f"{kind}.{table.name}[{len(lines)}]"] = f"{kind}[{index}]"
                lines.append(line)
        sizes = {entry.at: entry.size for entry in self.sizes}
        try:
            return TriangleMesh.outline(self.corners, self.size, holes=holes, sizes=sizes, **named)
        except InputError as error:
            place = error.field if error.field.split("[")[0] in schema.keys_of(OutlineTable) else ""
            place = places.get(error.field, place)
            raise type(error)(place, error.value, error.remedy) from error


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ArcTable:
    """Edges of triangles that follow a circle or an ellipse, see `qvi_contact.TriangleMesh.with_arc`; or any curve."""

    centre: Point | None = None
    """Centre of the circle or the ellipse: `centre = [0.0, 0.0]`."""
    radius: float | None = None
    """Radius of the circle, on which the vertices lie: `radius = 1.0`."""
    axes: Point | None = None
    """Half axes of the ellipse, on which the vertices lie: `axes = [2.0, 1.0]`."""
    angle: float | None = None
    """Angle [rad] from the x-axis to the first axis of the ellipse, counterclockwise: `angle = 0.5`."""
    bends: tuple[tuple[float, ...], ...] | None = None
    """Other curves as the program writes them, a row for each edge: Legendre coefficients, along the edge, of the angle
    [rad] from the chord to the tangent, counterclockwise: `bends = [[0.0, 0.25], [0.0, 0.25]]`."""
    name: schema.Name | None = None
    """Name of the edges in the mesh, in `[[edges]]` or in `[[joints]]`: `name = "bore"`."""
    edges: tuple[tuple[int, int], ...] | None = None
    """Instead of a name, the edges, two vertices each: `edges = [[0, 1], [1, 2]]`."""

    def __post_init__(self) -> None:
        _check_choice(self, {("name",): (), ("edges",): ("bends",)})
        _check_choice(self, {("radius",): (), ("axes",): ("angle",), ("bends",): ()})
        if (self.centre is None) != (self.bends is not None):
            remedy = schema.ADD if self.centre is None else "bends need no centre: leave it out"
            raise InputError("centre", self.centre, remedy)

    def on(self, mesh: MeshParts) -> Curve:
        """The curve that the edges of this table follow in the mesh."""
        if self.bends is not None:
            bends = real_array("bends", self.bends, "give rows of as many numbers")
            return Curve(np.array(self.edges, dtype=np.int64).reshape(-1, 2), bends).checked("", mesh.topology)
        assert self.centre is not None  # checked above
        if self.name is not None:
            pairs = mesh.pairs(self.name)
        else:
            pairs = mesh.topology.ends[checked_set("edges", self.edges or [], mesh.topology)]
        if self.axes is not None:
            parametrisation = ellipse(self.centre, self.axes, self.angle or 0.0)
            return fitted("axes", parametrisation, 0.0, 2.0 * np.pi, pairs, mesh.vertices)
        return circle(self.centre, self.radius or 0.0, pairs, mesh.vertices)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class MeshTable:
    """A grid whose cells are cut into triangles; or triangles: in this file, in a mesh file, or of an outline."""

    x: Annotated[FloatArray, Axis()] | None = None
    """Coordinates x of grid lines: a list, a piece, or pieces: `x = { start = 0.0, stop = 2.0, cells = 8 }`."""
    y: Annotated[FloatArray, Axis()] | None = None
    """Coordinates y of grid lines: `y = [0.0, 0.5, 1.0]`."""
    remove: Annotated[tuple[Rectangle, ...], schema.Tables(Rectangle, None)] = ()
    """Rectangles of the grid that are no part of the body: `remove = [{ x = [1.0, 2.0], y = [1.0, 2.0] }]`."""
    refine: RefineTable | None = None
    """Smaller cells towards re-entrant corners, see `[mesh.refine]`: `refine = { largest = 0.25, smallest = 0.01 }`."""
    file: schema.Name | None = None
    """Mesh file (.msh, .inp, .med, .vtk or .vtu), by its path from the problem file: `file = "meshes/dam.msh"`."""
    join: schema.Name | None = None
    """Name of the joint made where bodies of the mesh file touch, along straight lines or `arcs` that name edges of
    both bodies. The nodes of the bodies need not match: `join = "seam"`."""
    outline: OutlineTable | None = None
    """Outline that gmsh divides into triangles, see `[mesh.outline]`: `outline = { size = 0.2, corners = [{ at =
    [0.0, 0.0] }, { at = [1.0, 0.0] }, { at = [0.0, 1.0] }] }`."""
    vertices: tuple[Point, ...] | None = None
    """Vertices of triangles: `vertices = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]`."""
    triangles: tuple[tuple[int, int, int], ...] | None = None
    """Three vertices for each triangle, counted from 0: `triangles = [[0, 1, 2]]`."""
    edges: dict[str, tuple[tuple[int, int], ...]] = field(default_factory=dict)
    """Named edges of triangles, two vertices each: `edges = { base = [[0, 1]] }`."""
    regions: dict[str, tuple[int, ...]] = field(default_factory=dict)
    """Named triangles: `regions = { core = [0] }`."""
    arcs: tuple[ArcTable, ...] = ()
    """Edges of triangles that are arcs, not chords: `arcs = [{ name = "bore", centre = [0.0, 0.0], radius = 0.5 }]`."""

    def __post_init__(self) -> None:
        grid, inline, named = ("remove", "refine"), ("vertices", "triangles"), ("edges", "regions")
        _check_choice(self, {("x", "y"): grid, ("file",): ("join",), ("outline",): (), inline: named})

    def inline(self) -> TriangleMesh:
        """The triangles written in the problem file itself."""
        edges = {name: np.array(pairs).reshape(-1, 2) for name, pairs in self.edges.items()}
        regions = {name: np.array(chosen, dtype=np.int64) for name, chosen in self.regions.items()}
        try:
            return TriangleMesh(np.array(self.vertices), np.array(self.triangles), edges, regions)
        except InputError as error:
            places = {"TriangleMesh.vertices": "vertices", "TriangleMesh.cells": "triangles"}
            for kind, names in (("edges", self.edges), ("regions", self.regions)):
                places |= {name: f"{kind}.{schema.quoted(name)}" for name in names}
            place = places.get(error.field, places.get(str(error.value), ""))
            raise type(error)(place, error.value, error.remedy) from error

    def body(self, lines: Lines) -> BoolArray:
        """Which cells (ny, nx) belong to the body: those that are not removed."""
        body = np.ones((len(lines[1]) - 1, len(lines[0]) - 1), dtype=bool)
        for index, rectangle in enumerate(self.remove):
            with schema.located(f"remove[{index}]"):
                body[rectangle.cells(lines)] = False
        return body

    def grid(self, lines: Lines) -> TriangleMesh:
        """The triangles of the grid without the removed cells; errors show the rectangles of the file."""
        x, y = lines
        if (len(x) - 1) * (len(y) - 1) > _MOST_CELLS:
            raise InputError("", (len(x) - 1, len(y) - 1), f"give at most {_MOST_CELLS} cells in all")
        if not self.remove:
            with schema.located("", schema.keys_of(MeshTable)):
                return TriangleMesh.grid(x, y)
        body = self.body(lines)
        try:
            return TriangleMesh.grid(x, y, body)
        except InputError as error:
            rectangles = [{name: value for name, value in asdict(each).items() if value} for each in self.remove]
            raise type(error)("remove", rectangles, error.remedy) from error


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class _Place:
    """Named edges: on a side or line of a grid, or on a segment of any mesh."""

    name: schema.Name
    """Name by which conditions refer to these edges; tables with the same name are one set: `name = "base"`."""
    start: float | None = None
    """Coordinate where the edges begin along their grid line: `start = 0.5`."""
    stop: float | None = None
    """Coordinate where the edges end along their grid line: `stop = 1.5`."""
    at: float | None = None
    """Position of the grid line, x or y; a side needs it only if it lies on several lines: `at = 0.0`."""
    segment: tuple[Point, Point] | None = None
    """Two points; all edges between them on a straight line: `segment = [[0.0, 0.0], [2.0, 0.0]]`."""

    def pairs(self, mesh: TriangleMesh, lines: Lines | None) -> IntArray:
        """The edges as pairs of vertices (k, 2); `lines` are the grid lines, None on other meshes."""
        is_joint, box = isinstance(self, JointTable), getattr(self, "box", None)
        facing = getattr(self, "direction" if is_joint else "side")
        if self.segment is not None:
            return edges_on_segment(mesh.vertices, mesh.topology, *self.segment, inside=is_joint)
        if box is not None:
            with schema.located("box", schema.keys_of(Rectangle)):
                return edges_in_box(mesh.vertices, mesh.topology, box.x, box.y)
        if lines is None:
            ways = "a segment between two points" if is_joint else "a segment between two points, or a box"
            remedy = f"sides and directions are for grids: on triangles give {ways}"
            raise InputError("segment", None, remedy)
        axis = 0 if facing in ("bottom", "top", "horizontal") else 1
        pairs = mesh.topology.ends[~mesh.topology.boundary] if is_joint else mesh.pairs(facing)
        kept = np.ptp(mesh.vertices[pairs][:, :, 1 - axis], axis=1) == 0.0
        middle = mesh.vertices[pairs].mean(axis=1)
        if self.start is not None:
            kept &= middle[:, axis] > on_line("start", self.start, lines[axis])
        if self.stop is not None:
            kept &= middle[:, axis] < on_line("stop", self.stop, lines[axis])
        if self.at is not None:
            kept &= middle[:, 1 - axis] == on_line("at", self.at, lines[1 - axis])
        if not kept.any():
            where, key = ("interior", "direction") if is_joint else ("boundary", "side")
            given = {each: v for each in (key, "start", "stop", "at") if (v := getattr(self, each)) is not None}
            raise InputError("", given, f"no {where} edge lies there: check {key} and range")
        return np.asarray(pairs[kept])


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class EdgesTable(_Place):
    """A named part of the boundary: by side and range on a grid, by segment or box on any mesh."""

    side: Literal["bottom", "right", "top", "left"] | None = None
    """Side of a grid: bottom, right, top or left: `side = "bottom"`."""
    box: Rectangle | None = None
    """A rectangle; all boundary edges inside it: `box = { y = [0.9, 1.1] }`."""

    def __post_init__(self) -> None:
        _check_choice(self, {("side",): ("start", "stop", "at"), ("segment",): (), ("box",): ()})


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class JointTable(_Place):
    """A named line inside the body: by direction and range on a grid, by segment on any mesh."""

    direction: Literal["horizontal", "vertical"] | None = None
    """Direction on a grid: horizontal or vertical: `direction = "horizontal"`."""

    def __post_init__(self) -> None:
        _check_choice(self, {("direction", "at"): ("start", "stop"), ("segment",): ()})
