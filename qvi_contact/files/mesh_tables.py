"""The tables of a problem file that say what its mesh is: a grid, triangles of the file or of a mesh file, an outline.

Each table is declared by its keys, and makes its part of the mesh. Errors have the path of the value in the file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from typing import Annotated, Any, Final, Literal

import numpy as np

from qvi_contact.basics import schema
from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, positive_number
from qvi_contact.errors import InputError
from qvi_contact.mesh.curves import Curve, checked_bends, circle, ellipse, fitted
from qvi_contact.mesh.grid import checked_lines, graded_lines, on_line
from qvi_contact.mesh.outline import Corner, Point
from qvi_contact.mesh.selection import checked_set, edges_in_box, edges_on_segment, new_name
from qvi_contact.mesh.triangles import TriangleMesh

_MOST_IN_A_ROW: Final = 10_000  # cells of a piece of grid lines
_MOST_CELLS: Final = 1_000_000  # of a grid
_FINEST: Final = 1e-9  # smallest cell that refinement makes, relative to the body
_SAMPLES: Final = 2000  # points per half interval where sizes are summed

Lines = tuple[FloatArray, FloatArray]
"""Grid lines across x and across y."""


def _one_way(table: object, ways: Mapping[tuple[str, ...], tuple[str, ...]]) -> None:
    """`InputError` unless a table says a thing in one of some ways, by all keys of that and further ones of its own."""
    given = [way for way in ways if any(getattr(table, name) is not None for name in way)]
    if len(given) != 1:
        remedy = f"give {', or '.join(map(' and '.join, ways))}: one of these"
        raise InputError((given or list(ways)[:1])[-1][0], [" and ".join(way) for way in given] or None, remedy)
    for name in given[0]:
        if getattr(table, name) is None:
            raise InputError(name, None, schema.ADD)
    for way, further in ways.items():
        for name in further if way not in given else ():
            value = getattr(table, name)
            if value != schema.defaults_of(type(table))[name]:
                raise InputError(name, value, f"this belongs to {' and '.join(way)}: leave it out")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Segment:
    """Grid lines from `start` to `stop`, see `qvi_contact.graded_lines`; `start` may be left out after another one."""

    start: float | None = None
    """First grid line; left out after another piece: `start = 0.0`."""
    stop: float
    """Last grid line: `stop = 2.0`."""
    cells: Annotated[int, schema.Whole(1, _MOST_IN_A_ROW)]
    """Number of cells: `cells = 8`."""
    grading: float = 1.0
    """Size of each cell over that of the one before it: `grading = 0.9`."""
    both_ends: bool = False
    """Whether cells shrink towards both ends: `both_ends = true`."""


class Axis(schema.Kind):
    """Grid lines: a list of them, a piece, or a list of pieces."""

    of = Segment

    def read(self, value: Any, reader: schema.Reader) -> FloatArray:
        """All lines, those that are given as they are."""
        piece = isinstance(value, dict)
        if not piece and not isinstance(value, list):
            remedy = "give a list of grid lines, or { start = 0.0, stop = 1.0, cells = 8 }, or a list of such"
            raise InputError("", value, remedy)
        if not piece and not (value and isinstance(value[0], dict)):
            return checked_lines("", schema.Listed(schema.FINITE).read(value, reader))
        lines: FloatArray = np.empty(0)
        segments = [schema.read_table(Segment, value, reader)] if piece else schema.Tables(Segment).read(value, reader)
        for index, segment in enumerate(segments):
            with schema.located("" if piece else f"[{index}]"):
                start = float(lines[-1]) if segment.start is None and len(lines) else segment.start
                if start is None:
                    raise InputError("start", schema.Missing(), schema.ADD)
                if len(lines) and start != lines[-1]:
                    raise InputError("start", start, f"start where the one before stops, at {lines[-1]:g}")
                with schema.located("", schema.keys_of(Segment)):
                    more = graded_lines(start, segment.stop, segment.cells, segment.grading, segment.both_ends)
                lines = np.concatenate([lines[:-1], more])
        return lines


@dataclass(frozen=True, eq=False, repr=False)
class Rectangle:
    """Cells between grid lines; a range left out reaches across the whole mesh."""

    x: Point | None = None
    """Range along x: `x = [0.0, 1.0]`."""
    y: Point | None = None
    """Range along y: `y = [0.5, 2.0]`."""

    def cells(self, lines: Lines) -> tuple[slice, slice]:
        """Rows and columns of its cells."""
        found = []
        for name, across in (("y", lines[1]), ("x", lines[0])):
            bounds = getattr(self, name) or (across[0], across[-1])
            first, last = (int(np.searchsorted(across, on_line(name, bound, across))) for bound in bounds)
            if first >= last:
                raise InputError(name, bounds, "give the smaller end first")
            found.append(slice(first, last))
        return found[0], found[1]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RefineTable:
    """Grid lines added so that cells shrink geometrically towards re-entrant corners and ends, in x and in y."""

    largest: float
    """Largest cell: `largest = 0.25`."""
    smallest: float | None = None
    """Size at re-entrant corners and the ends named. The first cell there is up to (1/ratio − 1)/ln(1/ratio) times as
    large, 1.2 at a ratio of 0.7, 1.4 at 0.5, 1.9 at 0.3: `smallest = 0.01`."""
    ratio: Annotated[float, schema.Number(0.01, 0.99)] = 0.5
    """Size of a cell over that of its larger neighbour: `ratio = 0.7`."""
    towards: tuple[str, ...] = ()
    """Edge sets at whose ends cells are small too: `towards = ["base"]`."""

    def lines(self, mesh: TriangleMesh, body: BoolArray, lines: Lines) -> Lines:
        """The grid lines of a mesh, with those cells as its body, and more of them.

        Cells are about `largest` wide, and shrink geometrically to `smallest` towards every re-entrant corner of the
        body and both ends of every edge set or joint in `towards`: at a distance d from the nearest such coordinate the
        size is min(largest, smallest + ln(1/ratio) d), in x and y separately.
        """
        around = np.pad(body, 1).astype(np.int64)
        around = around[1:, 1:] + around[1:, :-1] + around[:-1, 1:] + around[:-1, :-1]
        row, column = np.nonzero(around == 3)
        critical = [np.column_stack([lines[0][column], lines[1][row]])]
        for index, name in enumerate(self.towards):
            with schema.located(f"towards[{index}]", ()):
                edges = mesh.edges(name)
            vertex, count = np.unique(np.concatenate([edges.first, edges.second]), return_counts=True)
            critical.append(mesh.vertices[vertex[count == 1]])
        largest = positive_number("largest", self.largest)
        smallest = largest if self.smallest is None else positive_number("smallest", self.smallest)
        if smallest > largest:
            raise InputError("smallest", smallest, f"give at most largest = {largest:g}")
        least = _FINEST * max(float(np.ptp(across)) for across in lines)
        for name, size in (("largest", largest), ("smallest", smallest)):
            if size < least:
                raise InputError(name, size, f"give at least {_FINEST:g} of the body, {least:g}")
        places, growth = np.concatenate(critical), -float(np.log(self.ratio))
        x, y = (
            _subdivided(across, np.unique(places[:, axis]), largest, smallest, growth)
            for axis, across in enumerate(lines)
        )
        return x, y


def _subdivided(lines: FloatArray, critical: FloatArray, largest: float, smallest: float, growth: float) -> FloatArray:
    """Lines added so that cells are about h(x) = min(largest, smallest + growth · distance to `critical`)."""
    pieces, total = [lines[:1]], 0
    for start, stop in pairwise(lines.tolist()):
        t = np.linspace(0.0, 1.0, _SAMPLES)
        x = start + (stop - start) * np.concatenate([t**3 / 2, 1.0 - t[-2::-1] ** 3 / 2])  # dense at both ends
        distance = np.abs(x[:, None] - critical).min(axis=1, initial=np.inf)
        size = np.minimum(largest, smallest + growth * distance)
        cells = np.concatenate([[0.0], np.cumsum(np.diff(x) * (1.0 / size[1:] + 1.0 / size[:-1]) / 2.0)])
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
    """What joints and regions are called, which need it, and the edges of a round hole: `name = "bore"`."""
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
        _one_way(self, {("centre", "radius"): ("size",), ("corners",): ()})

    def line(self, kind: str, taken: Iterable[str]) -> Sequence[Corner]:
        """The corners of a hole, joint or region."""
        hole = kind == "holes"
        if not hole and not self.name:
            raise InputError("name", schema.Missing(), schema.ADD)
        if not hole:
            new_name(self.name, taken, kind.removesuffix("s"))
        elif self.corners is not None and self.name:
            raise InputError("name", self.name, "give the names to the corners where the lines begin")
        if self.corners is not None:
            return self.corners
        assert self.centre is not None  # checked above
        assert self.radius is not None
        return Corner.circle(self.centre, self.radius, self.name if hole else "", self.size)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SizeTable:
    """Size of the triangles at a point."""

    at: Point
    """The point: `at = [1.0, 0.5]`."""
    size: float
    """Size of the triangles there: `size = 0.05`."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class OutlineTable:
    """See `qvi_contact.TriangleMesh.outline`."""

    size: float
    """Size of the triangles where nothing else is said: `size = 0.2`."""
    corners: Annotated[tuple[Corner, ...], schema.Tables(Corner, None)]
    """Corners of the body, see `[[mesh.outline.corners]]`: `corners = [{ at = [0.0, 0.0] }, { at = [1.0, 0.0] }, {
    at = [0.0, 1.0] }]`."""
    holes: tuple[LineTable, ...] = ()
    """Holes, by corners or as circles: `holes = [{ centre = [1.0, 1.0], radius = 0.4 }]`."""
    joints: tuple[LineTable, ...] = ()
    """Lines inside, open or closed; those without a contact hold together: `joints = [{ name = "joint", corners = [
    { at = [0.0, 0.5] }, { at = [1.0, 0.5] }] }]`."""
    regions: tuple[LineTable, ...] = ()
    """Regions of another material: `regions = [{ name = "inclusion", centre = [1.0, 1.0], radius = 0.2 }]`."""
    sizes: tuple[SizeTable, ...] = ()
    """Places where triangles have another size: `sizes = [{ at = [1.0, 0.5], size = 0.05 }]`."""

    def mesh(self) -> TriangleMesh:
        """The body divided into triangles."""
        lines: dict[str, dict[Any, Sequence[Corner]]] = {"holes": {}, "joints": {}, "regions": {}}
        for kind, found in lines.items():
            for index, table in enumerate(getattr(self, kind)):
                with schema.located(f"{kind}[{index}]", schema.keys_of(LineTable)):
                    line = table.line(kind, found)
                found[index if kind == "holes" else table.name] = line
        holes, sizes = list(lines.pop("holes").values()), {entry.at: entry.size for entry in self.sizes}
        try:
            return TriangleMesh.outline(self.corners, self.size, holes=holes, sizes=sizes, **lines)
        except InputError as error:
            kind, _, name = error.field.partition(".")
            place = error.field if error.field.split("[")[0] in schema.keys_of(OutlineTable) else ""
            if name in lines.get(kind, ()):
                place = f"{kind}[{list(lines[kind]).index(name)}]"
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
    """Other curves as the program writes them, one row for each of the edges: coefficients of Legendre, along the
    edge, of the angle [rad] from its chord to its tangent, counterclockwise: `bends = [[0.0, 0.25], [0.0,
    0.25]]`."""
    name: schema.Name | None = None
    """Which edges, by the name they have in the mesh, in `[[edges]]` or in `[[joints]]`: `name = "bore"`."""
    edges: tuple[tuple[int, int], ...] | None = None
    """The edges themselves instead, two vertices each: `edges = [[0, 1], [1, 2]]`."""

    def __post_init__(self) -> None:
        _one_way(self, {("name",): (), ("edges",): ("bends",)})
        _one_way(self, {("radius",): (), ("axes",): ("angle",), ("bends",): ()})
        if (self.centre is None) != (self.bends is not None):
            remedy = schema.ADD if self.centre is None else "bends need no centre: leave it out"
            raise InputError("centre", self.centre, remedy)

    def on(self, mesh: TriangleMesh) -> Curve:
        """These edges of the mesh on their circle, ellipse or other curve."""
        if self.bends is not None:
            edges = np.array(self.edges, dtype=np.int64).reshape(-1, 2)
            curve = Curve(edges, checked_bends("bends", self.bends, len(edges)))
            return curve.checked("", mesh.topology)
        if self.name is not None:
            return self.curve(mesh.pairs(self.name), mesh.vertices)
        chosen = checked_set("edges", self.edges or [], mesh.topology)
        return self.curve(mesh.topology.ends[chosen], mesh.vertices)

    def curve(self, pairs: IntArray, vertices: FloatArray) -> Curve:
        """The edges (k, 2) on this circle or ellipse."""
        assert self.centre is not None  # checked above
        if self.axes is not None:
            circled = ellipse(self.centre, self.axes, self.angle or 0.0)
            return fitted("axes", circled, 0.0, 2.0 * np.pi, pairs, vertices)
        return circle(self.centre, self.radius or 0.0, pairs, vertices)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class MeshTable:
    """A grid whose cells are cut into triangles; or triangles: in this file, in a mesh file, or of an outline."""

    x: Annotated[FloatArray, Axis()] | None = None
    """Grid lines across x: all of them, a piece, or a list of pieces: `x = { start = 0.0, stop = 2.0, cells = 8 }`."""
    y: Annotated[FloatArray, Axis()] | None = None
    """Grid lines across y: `y = [0.0, 0.5, 1.0]`."""
    remove: Annotated[tuple[Rectangle, ...], schema.Tables(Rectangle, None)] = ()
    """Rectangles of the grid that are no part of the body: `remove = [{ x = [1.0, 2.0], y = [1.0, 2.0] }]`."""
    refine: RefineTable | None = None
    """Finer towards re-entrant corners, see `[mesh.refine]`: `refine = { largest = 0.25, smallest = 0.01 }`."""
    file: schema.Name | None = None
    """Mesh file, .msh, .inp, .med, .vtk or .vtu, by its place beside the problem file: `file = "meshes/dam.msh"`."""
    join: schema.Name | None = None
    """Name for the joint of bodies in the mesh file that touch along straight lines, or along `arcs` that name edges of
    both; their nodes need not match: `join = "seam"`."""
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
        grid, triangles = ("remove", "refine"), ("edges", "regions")
        _one_way(self, {("x", "y"): grid, ("file",): ("join",), ("outline",): (), ("vertices", "triangles"): triangles})

    def inline(self) -> TriangleMesh:
        """Triangles of the file itself."""
        edges = {name: np.array(pairs).reshape(-1, 2) for name, pairs in self.edges.items()}
        regions = {name: np.array(chosen, dtype=np.int64) for name, chosen in self.regions.items()}
        try:
            return TriangleMesh(np.array(self.vertices), np.array(self.triangles), edges, regions)
        except InputError as error:
            place = {"vertices": "vertices", "cells": "triangles"}.get(error.field.split(".")[-1], "")
            for kind, names in (("edges", self.edges), ("regions", self.regions)):
                for name in names:
                    if name in (error.field, error.value if isinstance(error.value, str) else None):
                        place = f"{kind}.{schema.quoted(name)}"
            raise type(error)(place, error.value, error.remedy) from error

    def body(self, lines: Lines) -> BoolArray:
        """Cells (ny, nx) that are not removed."""
        body = np.ones((len(lines[1]) - 1, len(lines[0]) - 1), dtype=bool)
        for index, rectangle in enumerate(self.remove):
            with schema.located(f"remove[{index}]"):
                body[rectangle.cells(lines)] = False
        return body

    def grid(self, lines: Lines) -> TriangleMesh:
        """The grid without the cells removed; an error shows the rectangles of the file, not the array made of them."""
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
            shown = [{name: value for name, value in asdict(each).items() if value} for each in self.remove]
            raise type(error)("remove", shown, error.remedy) from error


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class _Place:
    """Edges that are given in one way: by a line of a grid, or by a segment or box of any mesh."""

    name: schema.Name
    """What conditions call it: `name = "base"`."""
    start: float | None = None
    """Where it begins along its line of a grid: `start = 0.5`."""
    stop: float | None = None
    """Where it ends: `stop = 1.5`."""
    at: float | None = None
    """Coordinate across that line; a side needs it only if it has several: `at = 0.0`."""
    segment: tuple[Point, Point] | None = None
    """What lies between two points: `segment = [[0.0, 0.0], [2.0, 0.0]]`."""

    def pairs(self, mesh: TriangleMesh, lines: Lines | None) -> IntArray:
        """The edges (k, 2) by their vertices; `lines` are those of a grid."""
        inside, box = isinstance(self, JointTable), getattr(self, "box", None)
        facing = getattr(self, "direction" if inside else "side")
        if self.segment is not None:
            return edges_on_segment(mesh.vertices, mesh.topology, *self.segment, inside=inside)
        if box is not None:
            return edges_in_box(mesh.vertices, mesh.topology, box.x, box.y)
        if lines is None:
            ways = "a segment between two points" if inside else "a segment between two points, or a box"
            remedy = f"sides and directions are for grids: on triangles give {ways}"
            raise InputError("segment", None, remedy)
        axis = 0 if facing in ("bottom", "top", "horizontal") else 1
        pairs = mesh.topology.ends[~mesh.topology.boundary] if inside else mesh.pairs(facing)
        keep = np.ptp(mesh.vertices[pairs][:, :, 1 - axis], axis=1) == 0.0
        middle = mesh.vertices[pairs].mean(axis=1)
        if self.start is not None:
            keep &= middle[:, axis] > on_line("start", self.start, lines[axis])
        if self.stop is not None:
            keep &= middle[:, axis] < on_line("stop", self.stop, lines[axis])
        if self.at is not None:
            keep &= middle[:, 1 - axis] == on_line("at", self.at, lines[1 - axis])
        if not keep.any():
            where, given = "interior" if inside else "boundary", (facing, self.start, self.stop, self.at)
            raise InputError(self.name, given, f"no {where} edge lies there: check side and range")
        return np.asarray(pairs[keep])


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class EdgesTable(_Place):
    """A named part of the boundary: by side and range on a grid, by segment or box on any mesh."""

    side: Literal["bottom", "right", "top", "left"] | None = None
    """Side of a grid: bottom, right, top or left: `side = "bottom"`."""
    box: Rectangle | None = None
    """What lies inside a box: `box = { y = [0.9, 1.1] }`."""

    def __post_init__(self) -> None:
        _one_way(self, {("side",): ("start", "stop", "at"), ("segment",): (), ("box",): ()})


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class JointTable(_Place):
    """A named line inside the body: by direction and range on a grid, by segment on any mesh."""

    direction: Literal["horizontal", "vertical"] | None = None
    """Direction on a grid: horizontal or vertical: `direction = "horizontal"`."""

    def __post_init__(self) -> None:
        _one_way(self, {("direction", "at"): ("start", "stop"), ("segment",): ()})
