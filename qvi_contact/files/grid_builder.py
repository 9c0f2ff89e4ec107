"""From the document of a problem file to its rectilinear mesh."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray
from qvi_contact.errors import InputError
from qvi_contact.files.located import located
from qvi_contact.files.problem_document import Axis, Document, Missing, Rectangle, RefineTable, Segment
from qvi_contact.mesh.grid import graded_lines, on_line
from qvi_contact.mesh.rectilinear import RectilinearMesh

_MOST_CELLS: Final = 1_000_000


def grid_mesh(document: Document) -> RectilinearMesh:
    """The grid with cells left out, its named edges and joints, refined."""
    table = document.mesh
    x, y = (_lines(f"mesh.{name}", axis) for name, axis in (("x", table.x), ("y", table.y)))
    if (len(x) - 1) * (len(y) - 1) > _MOST_CELLS:
        raise InputError("mesh", (len(x) - 1, len(y) - 1), f"give at most {_MOST_CELLS} cells in all")
    with located("mesh", table):
        mesh = RectilinearMesh(x, y)
    removed = np.zeros(mesh.shape, dtype=bool)
    for index, rectangle in enumerate(table.remove):
        removed[_cells(f"mesh.remove[{index}]", mesh, rectangle)] = True
    with located("mesh.remove"):
        mesh = _without(x, y, removed, table.remove)
    for index, edges in enumerate(document.edges):
        with located(f"edges[{index}]", edges):
            if edges.side is None:
                raise InputError("side", None, "segments and boxes are for triangles: on a grid name the side")
            mesh = mesh.with_edges(edges.name, edges.side, edges.start, edges.stop, edges.at)
    for index, joint in enumerate(document.joints):
        with located(f"joints[{index}]", joint):
            if joint.direction is None or joint.at is None:
                raise InputError("direction", None, "segments are for triangles: on a grid give direction and at")
            mesh = mesh.with_joint(joint.name, joint.direction, joint.at, joint.start, joint.stop)
    return mesh if table.refine is None else _refined(mesh, table.refine)


def _without(x: FloatArray, y: FloatArray, removed: BoolArray, rectangles: Sequence[Rectangle]) -> RectilinearMesh:
    """The grid without cells; an error shows the rectangles that the file removes, not the array made of them."""
    try:
        return RectilinearMesh(x, y, ~removed)
    except InputError as error:
        value = [rectangle.model_dump(exclude_none=True) for rectangle in rectangles]
        raise type(error)(error.field, value, error.remedy) from error


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


def _cells(path: str, mesh: RectilinearMesh, rectangle: Rectangle) -> tuple[slice, slice]:
    """Rows and columns of the cells of a rectangle."""
    found = []
    for key, lines in (("y", mesh.y), ("x", mesh.x)):
        bounds = getattr(rectangle, key)
        if bounds is None:
            found.append(slice(None))
            continue
        with located(f"{path}.{key}"):
            first, last = (int(np.searchsorted(lines, on_line("", bound, lines))) for bound in bounds)
        if first >= last:
            raise InputError(f"{path}.{key}", bounds, "give the smaller end first")
        found.append(slice(first, last))
    return found[0], found[1]


def _refined(mesh: RectilinearMesh, table: RefineTable) -> RectilinearMesh:
    for index, name in enumerate(table.towards):
        with located(f"mesh.refine.towards[{index}]"):
            mesh.edges(name)
    with located("mesh.refine", table):
        wanted = _refined_size(mesh.x, table) * _refined_size(mesh.y, table)
        if wanted > _MOST_CELLS:
            raise InputError("largest", table.largest, f"give more: this makes some {wanted:.0e} cells in all")
        return mesh.refined(table.largest, table.towards, table.smallest, table.ratio)


def _refined_size(lines: FloatArray, table: RefineTable) -> float:
    """About how many cells a refined row has at most: 2 log(1 + growth · largest/smallest)/growth around each line."""
    smallest = table.smallest or table.largest
    if not 0.0 < smallest <= table.largest:
        return 0.0  # refused where it is used
    extent, growth = float(lines[-1] - lines[0]), -float(np.log(table.ratio))
    uniform = len(lines) + extent / table.largest
    graded = uniform + len(lines) * 2.0 * np.log1p(growth * table.largest / smallest) / growth
    return float(min(graded, len(lines) + extent / smallest))
