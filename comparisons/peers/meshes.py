"""Families of meshes of the plate. A larger number is a finer mesh; every code gets the mesh as plain data.

The mesh has to be fine at the free corner (1, 1) and, if a part of the contact slips, at the transition: the point of
the contact where stick ends and slip begins. `TRANSITIONS` has it by μ; where it is not known, or the whole contact
sticks, meshes are graded to the corner alone.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from comparisons.settled import TRANSITIONS
from qvi_contact import TriangleMesh, graded_lines
from qvi_contact.basics.checks import FloatArray

_RATIOS: Final = ((12, 0.6), (24, 0.7), (48, 0.8))  # most cells a side, ratio of neighbouring cells
_FINEST_RATIO: Final = 0.9

_STRIPS: Final = (
    (1, 1, 1, 2), (2, 1, 2, 2), (2, 1, 2, 3), (3, 1, 3, 3), (3, 2, 3, 4), (4, 2, 4, 4), (4, 3, 4, 6), (5, 4, 5, 6),
)  # fmt: skip
"""By number: columns left of the transition, right of it, beside the corner; rows."""

_DEPTHS: Final = ((0, 0), (1, 0), (1, 1), (2, 1), (2, 2), (3, 2), (4, 6), (6, 8))
"""By number: halvings of triangles at the corner, and at the transition."""

_DEPTHS_WITHOUT_LINE: Final = ((0, 2), (0, 4), (0, 6), (1, 6), (2, 8), (3, 8), (4, 10), (4, 12))
"""The same for meshes without a vertex at the transition."""

_LAYERS: Final = ((0, 0), (1, 0), (1, 1), (2, 1), (3, 2), (4, 2), (5, 3), (6, 3))
"""By number: layers of triangles at the corner, and at the transition."""

_LAYER: Final = 0.15  # ratio of the distances of neighbouring layers from their point
_NEEDLE: Final = 0.1  # narrowest column that may end at a transition


Lines: TypeAlias = tuple[FloatArray, FloatArray]
"""x and y of the lines of a grid of rectangles."""


class Family(NamedTuple):
    """Meshes of one kind, see `report.md`, by number: cells a side if `counted`, otherwise a level from 0."""

    counted: bool
    make: Callable[[float, int], Lines | TriangleMesh]

    def label(self, number: int) -> str:
        """The name of a mesh in tables."""
        return f"{number}² cells" if self.counted else f"level {number}"


def plain_mesh(family: str, friction: float, number: int) -> dict[str, Any]:
    """A mesh as plain data.

    "vertices" are coordinates (n, 2), "cells" their vertices (m, 3 or 4), counter-clockwise, "sides" the edges of
    "left", "right", "bottom" and "top" by their vertices, "lines" for rectangles the grid lines (x, y), else None.
    """
    mesh = FAMILIES[family].make(friction, number)
    if isinstance(mesh, TriangleMesh):
        edges = {name: mesh.edges(name) for name in ("left", "right", "bottom", "top")}
        sides = {name: np.column_stack([each.first, each.second]) for name, each in edges.items()}
        vertices, cells, lines = mesh.vertices, counter_clockwise(mesh.vertices, mesh.cells), None
    else:  # rectangles between lines, node (i, j) with the number i + j (nx + 1)
        x, y = mesh
        stride, (row, column) = len(x), np.indices((len(y) - 1, len(x) - 1)).reshape(2, -1)
        a = column + row * stride
        across, up = np.arange(len(x) - 1), np.arange(len(y) - 1) * stride
        first = {"left": up, "right": up + stride - 1, "bottom": across, "top": across + (len(y) - 1) * stride}
        step = {"left": stride, "right": stride, "bottom": 1, "top": 1}
        sides = {name: np.column_stack([place, place + step[name]]) for name, place in first.items()}
        vertices = np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x))])
        cells, lines = np.column_stack([a, a + 1, a + 1 + stride, a + stride]), [x.tolist(), y.tolist()]
    return {
        "vertices": vertices.tolist(), "cells": cells.tolist(), "lines": lines,
        "sides": {name: pairs.tolist() for name, pairs in sides.items()},
    }  # fmt: skip


def ratio(cells: int) -> float:
    """Ratio of neighbouring cells of a mesh graded to the corner, for this number of cells a side."""
    return next((each for most, each in _RATIOS if cells <= most), _FINEST_RATIO)


def _strips(shrinking: float) -> Callable[[float, int], Lines]:
    """Rectangles that shrink towards corner and transition by this ratio from one to the next."""

    def make(friction: float, number: int) -> Lines:
        left, right, beside, rows = _STRIPS[number]
        transition = TRANSITIONS.get(friction)
        if transition is None:
            both = graded_lines(0.0, 1.0, left + beside, shrinking)
            return both, both
        middle = (transition + 1.0) / 2.0
        # more columns for a transition near x = 0, so that columns on both sides of it have similar widths
        right += max(0, round(math.log(transition / (1.0 - transition)) / math.log(shrinking)))
        parts = (
            graded_lines(0.0, transition, left, shrinking),
            graded_lines(transition, middle, right, 1.0 / shrinking)[1:],
            graded_lines(middle, 1.0, beside, shrinking)[1:],
        )
        return np.concatenate(parts), graded_lines(0.0, 1.0, rows, shrinking)

    return make


def _bisected(friction: float, number: int) -> TriangleMesh:
    """Four squares, or a column more that ends at the transition if it is not narrow; bisected at both points."""
    transition = TRANSITIONS.get(friction)
    lines = np.array([0.0, 0.5, 1.0])
    if transition is None:
        return TriangleMesh.grid(lines, lines).graded([(1.0, 1.0)], 2 * number)
    columns, depths = np.sort(np.append(lines, transition)), _DEPTHS[number]
    if np.diff(columns).min() < _NEEDLE:
        columns, depths = lines, _DEPTHS_WITHOUT_LINE[number]
    coarse = TriangleMesh.grid(columns, lines)
    return coarse.graded([(1.0, 1.0), (transition, 1.0)], depths)


def _layered(friction: float, number: int) -> TriangleMesh:
    """A square, or two rectangles that meet at the transition if neither is narrow; layers at both points."""
    transition = TRANSITIONS.get(friction, 0.0)
    if transition < _NEEDLE:
        return TriangleMesh.grid([0.0, 1.0], [0.0, 1.0]).graded([(1.0, 1.0)], number, ratio=_LAYER)
    coarse = TriangleMesh.grid([0.0, transition, 1.0], [0.0, 1.0])
    return coarse.graded([(1.0, 1.0), (transition, 1.0)], _LAYERS[number], ratio=_LAYER)


def counter_clockwise(vertices: FloatArray, cells: Any) -> Any:
    """The triangles with their vertices in counter-clockwise order."""
    (ax, ay), (bx, by) = ((vertices[cells[:, k]] - vertices[cells[:, 0]]).T for k in (1, 2))
    return np.where((ax * by < ay * bx)[:, None], cells[:, ::-1], cells)


FAMILIES: Final[Mapping[str, Family]] = {
    "uniform": Family(True, lambda _, n: (graded_lines(0.0, 1.0, n),) * 2),
    "graded": Family(True, lambda _, n: (graded_lines(0.0, 1.0, n, ratio(n)),) * 2),
    "cut squares": Family(True, lambda _, n: TriangleMesh.rectangle((n, n))),
    "strips": Family(False, _strips(0.5)),
    "narrow strips": Family(False, _strips(0.25)),
    "adaptive": Family(False, lambda *_: TriangleMesh.rectangle((1, 1))),
    "bisected": Family(False, _bisected),
    "layers": Family(False, _layered),
}
"""Name → family."""
