"""Grids: rectangular cells between lines, each cut into two triangles."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import (
    BoolArray,
    FloatArray,
    IntArray,
    finite_number,
    positive_number,
    real_array,
    true_or_false,
    whole_number,
)
from qvi_contact.basics.schema import LARGEST
from qvi_contact.errors import InputError, place_of
from qvi_contact.mesh.curves import MeshParts
from qvi_contact.mesh.edges import cross
from qvi_contact.mesh.selection import Point, between, point

LONGEST: Final = 500.0
"""Largest ratio of a cell's length to its width; longer cells are cut, as thinner triangles lose too many digits."""

SIDES: Final = ("bottom", "right", "top", "left")
"""Names of the sides of a grid, counterclockwise from the one that faces −y."""

_AREA_TOLERANCE: Final = 1e-6  # relative difference of areas that is more than rounding
_MOST_LINES: Final = 1_000_000
_MOST_CELLS: Final = 10_000_000
_FEW_CELLS: Final = 10_000  # cutting long cells may always make so many


def graded_lines(start: float, stop: float, cells: int, grading: float = 1.0, both_ends: bool = False) -> FloatArray:
    """Grid lines (cells + 1,) from start to stop [length] with sizes of cells in geometric progression.

    The grading is the ratio of each cell's size to that of the cell before it. Below 1 the cells shrink towards `stop`;
    with `both_ends` they shrink from the middle towards both ends, symmetrically. Both ends are exact.
    """
    start, stop = finite_number("start", start), finite_number("stop", stop)
    cells = whole_number("cells", cells, _MOST_LINES)
    grading = positive_number("grading", grading)
    both_ends = true_or_false("both_ends", both_ends)
    if not start < stop:
        raise InputError("stop", stop, f"give a number greater than start = {start:g}")
    steps = np.arange(cells, dtype=float)
    if both_ends:
        steps = np.maximum(steps, steps[::-1]) - steps[-1] / 2.0  # distance from the middle
    with np.errstate(over="ignore", invalid="ignore"):
        sizes = grading**steps
        lines: FloatArray = start + (stop - start) * np.concatenate([[0.0], np.cumsum(sizes)]) / sizes.sum()
    lines[-1] = stop
    if not (np.isfinite(lines).all() and (np.diff(lines) > 0.0).all()):
        remedy = "cells would be too large or too small to be told apart: give less grading, or ends closer to 0"
        raise InputError("grading", grading, remedy)
    return lines


def rectangle_lines(
    cells: tuple[int, int], width: float, height: float, origin: Point, grading: float | Point
) -> tuple[FloatArray, FloatArray]:
    """Grid lines x, y of a rectangle; see `TriangleMesh.rectangle`."""
    width, height = positive_number("width", width), positive_number("height", height)
    if not isinstance(cells, (tuple, list)) or len(cells) != 2:
        raise InputError("cells", cells, "give a pair, for x and y")
    ratios = point("grading", grading if isinstance(grading, (tuple, list)) else (grading, grading))
    across, up = (whole_number("cells", number) for number in cells)
    if across * up > _MOST_CELLS:
        raise InputError("cells", tuple(cells), f"give at most {_MOST_CELLS:,} cells in all")
    left, bottom = point("origin", origin)
    return graded_lines(left, left + width, across, ratios[0]), graded_lines(bottom, bottom + height, up, ratios[1])


def checked_lines(name: str, lines: ArrayLike) -> FloatArray:
    """Strictly increasing finite grid lines as a read-only array, or `InputError`."""
    values = real_array(name, lines, "give a sequence of real numbers")
    if values.ndim != 1 or len(values) < 2:
        raise InputError(name, lines, "give a sequence of at least two grid lines")
    if not (np.abs(values) <= LARGEST).all():
        raise InputError(name, lines, f"give finite numbers, at most {LARGEST:.0e}: take other units")
    steps = np.diff(values)
    if (steps <= 0).any():
        raise InputError(name, lines, "give strictly increasing grid lines")
    resolution = 1e3 * np.finfo(float).eps * np.abs(values).max()
    if steps.min() <= resolution:
        remedy = f"cells below {resolution:.1e} are lost to rounding: move the domain to the origin or merge lines"
        raise InputError(name, float(steps.min()), remedy)
    values.flags.writeable = False
    return values


def on_line(name: str, value: object, lines: FloatArray) -> float:
    """The grid line at `value`, or an error that names the nearest one."""
    number = finite_number(name, value)
    nearest = float(lines[np.argmin(np.abs(lines - number))])
    if abs(nearest - number) > 1e-9 * (lines[-1] - lines[0]):
        raise InputError(name, number, f"must lie on a grid line; the nearest one is at {nearest:.12g}")
    return nearest


def grid_parts(x: ArrayLike, y: ArrayLike, active: ArrayLike | None) -> MeshParts:
    """The triangles of a grid, and its sides "bottom", "right", "top" and "left"; see `TriangleMesh.grid`."""
    lines = checked_lines("x", x), checked_lines("y", y)
    shape = len(lines[1]) - 1, len(lines[0]) - 1
    remedy = f"give a boolean array of shape (ny, nx) = {shape}"
    try:
        mask = np.ones(shape, dtype=bool) if active is None else np.array(active)
    except ValueError as error:  # rows of different lengths
        raise InputError("active", active, remedy) from error
    if mask.dtype != bool or mask.shape != shape:
        raise InputError("active", active, remedy)
    if not mask.any():
        raise InputError("active", active, "at least one cell must belong to the body")
    x_lines, y_lines, is_body = _without_long_cells(*lines, mask)
    vertices = np.column_stack([np.tile(x_lines, len(y_lines)), np.repeat(y_lines, len(x_lines))])
    row, column = np.nonzero(is_body)
    around = np.array([0, 1, len(x_lines) + 1, len(x_lines)])  # counterclockwise from the lower left corner
    quads = (column + row * len(x_lines))[:, None] + around
    is_upper, is_right = 2 * row + 1 >= is_body.shape[0], 2 * column + 1 >= is_body.shape[1]
    body, neighbours = np.pad(is_body, 1), ((0, 1), (1, 2), (2, 1), (1, 0))  # much faster than `sides_of`
    is_outer = ~np.column_stack([body[row + up, column + right] for up, right in neighbours])
    sets = {name: quads[is_outer[:, side]][:, [side, side - 3]] for side, name in enumerate(SIDES)}
    triangles, _ = triangles_of(vertices, quads, is_outer, prefers_bd=is_upper != is_right)
    return MeshParts(vertices, triangles, sets).without_others()


def triangles_of(
    points: FloatArray, cells: IntArray, on_boundary: BoolArray | None = None, *, prefers_bd: BoolArray | bool = False
) -> tuple[IntArray, IntArray]:
    """Triangles (t, 3) of cells (m, 4), and the cell (t,) of each; triangles have their last corner twice in `cells`.

    A quadrilateral in a corner of the body is cut from that corner, as in `TriangleMesh.grid`. Otherwise the diagonal
    with the larger smaller triangle is taken, of two equal ones the first, or the second where `prefers_bd`. Give the
    sides `on_boundary` (m, 4) if `sides_of` has been called.
    """
    quads = cells[:, 3] != cells[:, 2]
    if not quads.any():
        return cells[:, :3], np.arange(len(cells))
    on_boundary = sides_of(cells)[1] if on_boundary is None else on_boundary
    in_corner = on_boundary & np.roll(on_boundary, 1, axis=1)  # of the body, at a, b, c, d
    halves = cells[:, [[[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]]]]  # for diagonal ac, bd
    a, b, c = points[halves].transpose(3, 0, 1, 2, 4)
    with np.errstate(all="ignore"):  # `TriangleMesh` refuses coordinates that are too large or not finite
        double_areas = cross(b - a, c - a)
        is_inside, least = (np.sign(double_areas).prod(axis=2) > 0.0), np.abs(double_areas).min(axis=2)
    least[~is_inside] = -1.0
    # take diagonal bd instead of ac if it runs into more corners of the body, else by the areas
    b_larger = least[:, 1] > least[:, 0] * (1.0 + np.where(prefers_bd, -_AREA_TOLERANCE, _AREA_TOLERANCE))
    corners_bd = in_corner[:, [1, 3]].sum(axis=1) - in_corner[:, [0, 2]].sum(axis=1)
    from_b = quads & np.where(is_inside.all(axis=1) & (corners_bd != 0), corners_bd > 0, b_larger)
    is_triangle = np.column_stack([np.ones(len(cells), dtype=bool), quads])
    triangles = np.where(from_b[:, None, None], halves[:, 1], halves[:, 0])[is_triangle]
    return triangles, np.repeat(np.arange(len(cells)), is_triangle.sum(axis=1))


def sides_of(cells: IntArray) -> tuple[IntArray, BoolArray]:
    """Ends (m, 4, 2) of the sides ab, bc, cd, da of cells (m, 4), and whether one cell only has a side (m, 4)."""
    ends = np.sort(np.stack([cells, np.roll(cells, -1, axis=1)], axis=2), axis=2)
    keys = ends[..., 0] * (cells.max(initial=0) + 1) + ends[..., 1]
    _, number, count = np.unique(keys, return_inverse=True, return_counts=True)
    return ends, (count == 1)[number].reshape(keys.shape) & (ends[..., 0] != ends[..., 1])


def _without_long_cells(x: FloatArray, y: FloatArray, active: BoolArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """The grid with lines added until no cell of the body is more than `LONGEST` times as long as wide.

    Lines that cut a long cell make others thinner, which may then need cuts in the other direction. `InputError` if one
    round of cuts is not enough or makes too many cells: a grid is the wrong mesh for such a body.
    """
    max_cells, lines = max(_FEW_CELLS, 4 * active.size), [x, y]
    for axis in (0, 1):
        sizes, cross_sizes = np.diff(lines[axis]), np.diff(lines[1 - axis])
        least_cross_size = np.where(active if axis == 0 else active.T, cross_sizes[:, None], np.inf).min(axis=0)
        count = np.maximum(np.ceil(sizes / (LONGEST * least_cross_size) - 1e-9), 1.0)
        if count.sum() * active.shape[axis] > max_cells:
            break
        count = count.astype(np.int64)
        old_cell, step = between(0 * count, count)
        places = np.append(old_cell + step / count[old_cell], len(count))
        lines[axis] = checked_lines("lines", np.interp(places, np.arange(len(count) + 1), lines[axis]))
        active = np.repeat(active, count, axis=1 - axis)
    x, y = lines
    width, height = np.diff(x), np.diff(y)[:, None]
    elongation = np.where(active, np.maximum(width / height, height / width), 1.0)
    if elongation.max() > (1.0 + 1e-6) * LONGEST:
        row, column = np.unravel_index(int(np.argmax(elongation)), active.shape)
        around = place_of((x[column : column + 2].mean(), y[row : row + 2].mean()))
        remedy = (
            f"the cell around {around} is this many times as long as wide: give at most {LONGEST:g}, by more lines "
            "across it, or grade the lines less; `graded` of a mesh makes small triangles at points alone"
        )
        raise InputError("TriangleMesh.grid", float(elongation.max()), remedy)
    return x, y, active
