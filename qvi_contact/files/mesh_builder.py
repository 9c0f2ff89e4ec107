"""From the document of a problem file to its mesh: a grid, triangles of the file or of a mesh file, or an outline."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, positive_number
from qvi_contact.errors import InputError
from qvi_contact.files.located import located
from qvi_contact.files.problem_document import (
    ArcTable,
    Axis,
    CornerTable,
    Document,
    EdgesTable,
    JointTable,
    MeshTable,
    Missing,
    OutlineTable,
    Rectangle,
    RefineTable,
    RingTable,
    Segment,
    quoted,
)
from qvi_contact.mesh.curves import AnyArc, Arc, Curve, checked_bends, ellipse, fitted
from qvi_contact.mesh.grid import graded_lines, on_line
from qvi_contact.mesh.outline import Corner
from qvi_contact.mesh.selection import checked_pairs, edges_in_box, edges_on_segment, triangles_in_box
from qvi_contact.mesh.triangles import TriangleMesh

_OUTLINE: Final = "mesh.outline"
_MOST_CELLS: Final = 1_000_000  # of a grid
_MOST_LINES: Final = 100_000  # that refinement makes
_FINEST: Final = 1e-9  # smallest cell that refinement makes, relative to the body
_SAMPLES: Final = 2000  # points per half interval where sizes are summed

Lines = tuple[FloatArray, FloatArray]
"""Grid lines across x and across y."""


def built_mesh(document: Document, folder: Path | None) -> TriangleMesh:
    """The mesh with its named edges, joints, regions and arcs; a mesh file is looked for in the folder."""
    table = document.mesh
    if table.outline is not None:
        return _named(document, _outlined(table.outline), None)
    if table.file is not None:
        return _named(document, _loaded(table.file, folder), None)
    if not table.is_grid:
        return _named(document, _inline(table), None)
    lines = _lines("mesh.x", table.x), _lines("mesh.y", table.y)
    mesh = _named(document, _grid(table, lines), lines)
    if table.refine is None:
        return mesh
    lines = _denser(document, mesh, table.refine, lines)
    return _named(document, _grid(table, lines), lines)


def _named(document: Document, mesh: TriangleMesh, lines: Lines | None) -> TriangleMesh:
    """The mesh with what [[edges]], [[joints]], [[regions]] and [[mesh.arcs]] name; `lines` are those of a grid."""
    sets, regions = dict(mesh.edge_sets), dict(mesh.regions)
    parts: list[tuple[str, EdgesTable | JointTable]] = [
        *((f"edges[{index}]", table) for index, table in enumerate(document.edges)),
        *((f"joints[{index}]", table) for index, table in enumerate(document.joints)),
    ]
    for path, part in parts:
        with located(path, part):
            if part.name in sets:
                raise InputError("name", part.name, "this edge set exists already: choose another name")
            sets[part.name] = _edges(mesh, part, lines)
    for index, region in enumerate(document.regions):
        if region.name is not None and (region.x is not None or region.y is not None):
            with located(f"regions[{index}]", region):
                if region.name in regions:
                    remedy = "this region exists already: choose another name, or no ranges"
                    raise InputError("name", region.name, remedy)
                regions[region.name] = triangles_in_box(mesh.vertices, mesh.cells, region.x, region.y)
    mesh = replace(mesh, edge_sets=sets, regions=regions)
    for index, table in enumerate(document.mesh.arcs):
        with located(f"mesh.arcs[{index}]", table):
            mesh = replace(mesh, arcs=(*mesh.arcs, _arc(mesh, table)))
    return mesh


def _edges(mesh: TriangleMesh, table: EdgesTable | JointTable, lines: Lines | None) -> IntArray:
    """Edges (k, 2) by their vertices."""
    inside = isinstance(table, JointTable)
    if table.segment is not None:
        return edges_on_segment(mesh.vertices, mesh.topology, *table.segment, inside=inside)
    if isinstance(table, EdgesTable) and table.box is not None:
        return edges_in_box(mesh.vertices, mesh.topology, table.box.x, table.box.y)
    if lines is None:
        remedy = "sides and directions are for grids: on triangles give a segment between two points"
        raise InputError("segment", None, remedy + ("" if inside else ", or a box"))
    facing: str | None
    if isinstance(table, JointTable):
        facing, axis = table.direction, 0 if table.direction == "horizontal" else 1
        pairs = mesh.topology.ends[~mesh.topology.boundary]
        pairs = pairs[np.ptp(mesh.vertices[pairs][:, :, 1 - axis], axis=1) == 0.0]
    else:
        facing, axis = table.side, 0 if table.side in ("bottom", "top") else 1
        pairs = mesh.pairs(table.side or "")
    middle = mesh.vertices[pairs].mean(axis=1)
    keep = np.ones(len(pairs), dtype=bool)
    if table.start is not None:
        keep &= middle[:, axis] > on_line("start", table.start, lines[axis])
    if table.stop is not None:
        keep &= middle[:, axis] < on_line("stop", table.stop, lines[axis])
    if table.at is not None:
        keep &= middle[:, 1 - axis] == on_line("at", table.at, lines[1 - axis])
    if not keep.any():
        where = "interior" if inside else "boundary"
        given = (facing, table.start, table.stop, table.at)
        raise InputError(table.name, given, f"no {where} edge lies there: check side and range")
    return np.asarray(pairs[keep])


def _arc(mesh: TriangleMesh, table: ArcTable) -> AnyArc:
    """The edges of the table on their circle, ellipse or other curve."""
    if table.bends is not None:
        edges = np.array(table.edges, dtype=np.int64).reshape(-1, 2)
        return Curve(edges, checked_bends("bends", table.bends, len(edges))).checked("", mesh.vertices, mesh.topology)
    if table.name is not None:
        pairs = mesh.pairs(table.name)
    else:
        pairs = checked_pairs("edges", table.edges or [], mesh.topology, mesh.vertices)
    assert table.centre is not None
    centre = (table.centre[0], table.centre[1])
    if table.axes is not None:
        curve = ellipse(centre, (table.axes[0], table.axes[1]), table.angle or 0.0)
        return fitted("axes", curve, 0.0, 2.0 * np.pi, pairs, mesh.vertices)
    return Arc(centre, table.radius or 0.0, pairs).checked("", mesh.vertices, mesh.topology)


def _loaded(name: str, folder: Path | None) -> TriangleMesh:
    with located("mesh.file"):
        if folder is None:
            remedy = "the mesh file of a text without a place is not known: read the problem file by load_problem"
            raise InputError("file", name, remedy)
        return TriangleMesh.load(folder / name)


def _inline(table: MeshTable) -> TriangleMesh:
    vertices, cells = (np.array(values) for values in (table.vertices, table.triangles))
    edges = {name: np.array(pairs).reshape(-1, 2) for name, pairs in table.edges.items()}
    regions = {name: np.array(chosen, dtype=np.int64) for name, chosen in table.regions.items()}
    try:
        return TriangleMesh(vertices, cells, edges, regions)
    except InputError as error:
        place = {"vertices": "mesh.vertices", "cells": "mesh.triangles"}.get(error.field.split(".")[-1], "mesh")
        for key, names in (("edges", table.edges), ("regions", table.regions)):
            for name in names:
                if name in (error.field, error.value if isinstance(error.value, str) else None):
                    place = f"mesh.{key}.{quoted(name)}"
        raise type(error)(place, error.value, error.remedy) from error


def _grid(table: MeshTable, lines: Lines) -> TriangleMesh:
    """The grid without the cells removed; an error shows the rectangles of the file, not the array made of them."""
    x, y = lines
    if (len(x) - 1) * (len(y) - 1) > _MOST_CELLS:
        raise InputError("mesh", (len(x) - 1, len(y) - 1), f"give at most {_MOST_CELLS} cells in all")
    if not table.remove:
        with located("mesh", table):
            return TriangleMesh.grid(x, y)
    body = _body(table, lines)
    with located("mesh.remove"):
        try:
            return TriangleMesh.grid(x, y, body)
        except InputError as error:
            value = [rectangle.model_dump(exclude_none=True) for rectangle in table.remove]
            raise type(error)(error.field, value, error.remedy) from error


def _body(table: MeshTable, lines: Lines) -> BoolArray:
    """Cells (ny, nx) that are not removed."""
    x, y = lines
    body = np.ones((len(y) - 1, len(x) - 1), dtype=bool)
    for index, rectangle in enumerate(table.remove):
        body[_cells(f"mesh.remove[{index}]", lines, rectangle)] = False
    return body


def _cells(path: str, lines: Lines, rectangle: Rectangle) -> tuple[slice, slice]:
    """Rows and columns of the cells of a rectangle."""
    found = []
    for key, across in (("y", lines[1]), ("x", lines[0])):
        bounds = getattr(rectangle, key)
        if bounds is None:
            found.append(slice(None))
            continue
        with located(f"{path}.{key}"):
            first, last = (int(np.searchsorted(across, on_line("", bound, across))) for bound in bounds)
        if first >= last:
            raise InputError(f"{path}.{key}", bounds, "give the smaller end first")
        found.append(slice(first, last))
    return found[0], found[1]


def _lines(path: str, axis: Axis | None) -> FloatArray:
    """Grid lines as the file describes them."""
    assert axis is not None
    segments = [axis] if isinstance(axis, Segment) else [part for part in axis if isinstance(part, Segment)]
    if not segments:
        return np.array(axis, dtype=float)
    lines: FloatArray = np.empty(0)
    for index, segment in enumerate(segments):
        place = path if isinstance(axis, Segment) else f"{path}[{index}]"
        start = segment.start
        if start is None:
            if not len(lines):
                raise InputError(f"{place}.start", Missing(), "add this key, it is needed")
            start = float(lines[-1])
        elif len(lines) and start != lines[-1]:
            raise InputError(f"{place}.start", start, f"start where the one before stops, at {lines[-1]:g}")
        with located(place, segment), np.errstate(all="ignore"):
            more = graded_lines(start, segment.stop, segment.cells, segment.grading, segment.both_ends)
            if not np.isfinite(more).all():
                raise InputError("grading", segment.grading, "give a number nearer to 1, or fewer cells")
        lines = np.concatenate([lines[:-1], more])
    return lines


def _denser(document: Document, mesh: TriangleMesh, table: RefineTable, lines: Lines) -> Lines:
    """The grid lines and more of them, as [mesh.refine] says.

    Cells are about `largest` wide, and shrink geometrically to `smallest` towards every re-entrant corner of the body
    and both ends of every edge set or joint in `towards`: at a distance d from the nearest such coordinate the size is
    min(largest, smallest + ln(1/ratio) d), in x and in y separately.
    """
    around = np.pad(_body(document.mesh, lines), 1).astype(np.int64)
    around = around[1:, 1:] + around[1:, :-1] + around[:-1, 1:] + around[:-1, :-1]
    row, column = np.nonzero(around == 3)
    critical = [np.column_stack([lines[0][column], lines[1][row]])]
    for index, name in enumerate(table.towards):
        with located(f"mesh.refine.towards[{index}]"):
            edges = mesh.edges(name)
        vertex, count = np.unique(np.concatenate([edges.first, edges.second]), return_counts=True)
        critical.append(mesh.vertices[vertex[count == 1]])
    with located("mesh.refine", table):
        largest = positive_number("largest", table.largest)
        smallest = largest if table.smallest is None else positive_number("smallest", table.smallest)
        length = max(float(across[-1] - across[0]) for across in lines)
        if smallest > largest:
            raise InputError("smallest", smallest, f"give at most largest = {largest:g}")
        growth, wanted = -float(np.log(table.ratio)), 1.0
        for across in lines:  # about how many cells there will be: 2 log(1 + growth largest/smallest)/growth at a line
            extent = float(across[-1] - across[0])
            graded = extent / largest + len(across) * (1.0 + 2.0 * np.log1p(growth * largest / smallest) / growth)
            wanted *= min(graded, len(across) + extent / smallest)
        if wanted > _MOST_CELLS:
            raise InputError("largest", table.largest, f"give more: this makes some {wanted:.0e} cells in all")
        if smallest < _FINEST * length:
            raise InputError("smallest", smallest, f"give at least {_FINEST:g} of the body, {_FINEST * length:g}")
        if length / largest > _MOST_LINES:
            raise InputError("largest", largest, f"asks for more than {_MOST_LINES} lines: give a larger size")
        places = np.concatenate(critical)
        x, y = (
            _subdivided(across, np.unique(places[:, axis]), largest, smallest, growth)
            for axis, across in enumerate(lines)
        )
        return x, y


def _subdivided(lines: FloatArray, critical: FloatArray, largest: float, smallest: float, growth: float) -> FloatArray:
    """Lines added so that cells are about h(x) = min(largest, smallest + growth · distance to `critical`)."""
    pieces = [lines[:1]]
    for start, stop in pairwise(lines.tolist()):
        t = np.linspace(0.0, 1.0, _SAMPLES)
        x = start + (stop - start) * np.concatenate([t**3 / 2, 1.0 - t[-2::-1] ** 3 / 2])  # dense at both ends
        distance = np.abs(x[:, None] - critical).min(axis=1, initial=np.inf)
        size = np.minimum(largest, smallest + growth * distance)
        cells = np.concatenate([[0.0], np.cumsum(np.diff(x) * (1.0 / size[1:] + 1.0 / size[:-1]) / 2.0)])
        count = max(1, int(np.ceil(cells[-1] - 1e-3)))
        pieces.append(np.append(np.interp(np.arange(1, count) * cells[-1] / count, cells, x), stop))
    return np.concatenate(pieces)


def _outlined(table: OutlineTable) -> TriangleMesh:
    """The body of an outline divided into triangles; errors name the place in the file."""
    corners = _corners(f"{_OUTLINE}.corners", table.corners)
    holes = [_ring(f"{_OUTLINE}.holes[{k}]", ring, ring.name or "") for k, ring in enumerate(table.holes)]
    joints = {
        line.name: _corners(f"{_OUTLINE}.joints[{k}].corners", line.corners) for k, line in enumerate(table.joints)
    }
    regions = {ring.name: _ring(f"{_OUTLINE}.regions[{k}]", ring) for k, ring in enumerate(table.regions)}
    for kind, found, tables in (("joints", joints, table.joints), ("regions", regions, table.regions)):
        if len(found) < len(tables):
            names = [each.name for each in tables]
            twice = next(k for k, name in enumerate(names) if name in names[:k])
            raise InputError(f"{_OUTLINE}.{kind}[{twice}].name", names[twice], "this name is taken: choose another one")
    sizes = {(entry.at[0], entry.at[1]): entry.size for entry in table.sizes}
    try:
        return TriangleMesh.outline(corners, table.size, holes=holes, joints=joints, regions=regions, sizes=sizes)
    except InputError as error:
        kind, _, name = error.field.partition(".")
        listed = {"joints": [line.name for line in table.joints], "regions": [ring.name for ring in table.regions]}
        if name in listed.get(kind, ()):
            place = f"{_OUTLINE}.{kind}[{listed[kind].index(name)}]"
        else:
            known = error.field.split("[")[0] in OutlineTable.model_fields
            place = f"{_OUTLINE}.{error.field}" if known else _OUTLINE
        raise type(error)(place, error.value, error.remedy) from error


def _corners(path: str, tables: Sequence[CornerTable]) -> list[Corner]:
    found = []
    for index, table in enumerate(tables):
        with located(f"{path}[{index}]", table):
            centre = None if table.centre is None else (table.centre[0], table.centre[1])
            at = (table.at[0], table.at[1])
            found.append(Corner(at, table.name or "", centre, table.clockwise, table.size))
    return found


def _ring(path: str, table: RingTable, name: str = "") -> Sequence[Corner]:
    """A closed line; the edges of a circle get the name."""
    if table.corners is not None:
        return _corners(f"{path}.corners", table.corners)
    assert table.centre is not None  # the table has checked both
    assert table.radius is not None
    with located(path, table):
        return Corner.circle((table.centre[0], table.centre[1]), table.radius, name, table.size)
