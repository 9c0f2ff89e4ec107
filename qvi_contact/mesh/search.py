"""Which triangles hold a point, straight or curved ones, and where it lies in them."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.mesh.arcs import reference_of

_INSIDE: Final = -1e-9  # least barycentric coordinate of a point that counts as inside
_NEIGHBOURS: Final = 12  # triangles with the nearest centres where a point is looked for first
_TOGETHER: Final = 256  # points that are looked for in all triangles at a time


@dataclass(frozen=True, eq=False)
class PointSearch:
    """Points in triangles (m,), whose sides bend so (m, 3, k).

    `curved` tells which of them bend, `reach` the radii [length] of circles at the centres of the corners that hold
    them.
    """

    cells: IntArray
    corners: FloatArray
    sides: FloatArray
    curved: BoolArray
    reach: FloatArray

    @cached_property
    def _centres(self) -> cKDTree:
        return cKDTree(self.corners.mean(axis=1))

    @cached_property
    def _neighbours(self) -> list[IntArray]:
        """The triangles that share a vertex with each, itself among them."""
        ones = np.ones(self.cells.size)
        at = (np.repeat(np.arange(len(self.cells)), 3), self.cells.ravel())
        touching = sparse.csr_array((ones, at), shape=(len(self.cells), int(self.cells.max()) + 1))
        shared = sparse.csr_array(touching @ touching.T)
        shared.sort_indices()
        return np.split(shared.indices.astype(np.int64), shared.indptr[1:-1])

    def locate(self, points: FloatArray) -> IntArray:
        """The triangle of lowest number that holds each of the points (k, 2), −1 if none does."""
        count = min(_NEIGHBOURS, len(self.cells))
        near = self._centres.query(points, count)[1].reshape(-1, count)
        found = self._lowest(points, np.repeat(np.arange(len(points)), count), near.ravel())
        missing = np.flatnonzero(found < 0)  # in or beside long triangles, or outside
        for start in range(0, len(missing), _TOGETHER):
            some = missing[start : start + _TOGETHER]
            found[some] = self._lowest(points[some], *self._in_reach(points[some]))
        return found

    def around(self, points: FloatArray, first: IntArray) -> tuple[IntArray, IntArray]:
        """All pairs (point (l,), triangle (l,)) of points and triangles that hold them, from one triangle of each."""
        inside = np.flatnonzero(first >= 0)
        near = [self._neighbours[cell] for cell in first[inside].tolist()]
        point = np.repeat(inside, [len(own) for own in near])
        cell = np.concatenate([np.zeros(0, dtype=np.int64), *near])
        held = self._holds(cell, points[point])
        return point[held], cell[held]

    def touching(self, points: FloatArray) -> BoolArray:
        """Triangles (m,) that hold any of the points (k, 2), on their border too."""
        found = np.zeros(len(self.cells), dtype=bool)
        point, cell = self._in_reach(points)
        found[cell[self._holds(cell, points[point])]] = True
        return found

    def reference(self, cells: IntArray, points: FloatArray) -> FloatArray:
        """Barycentric coordinates (l, 3) of points (l, 2) in the triangles (l,), see `TriangleMesh.reference`."""
        a, b, c = self.corners[cells].swapaxes(0, 1)
        (ux, uy), (vx, vy), (wx, wy) = (b - a).T, (c - a).T, (points - a).T
        area = ux * vy - uy * vx
        second, third = (wx * vy - wy * vx) / area, (ux * wy - uy * wx) / area
        found = np.column_stack([1.0 - second - third, second, third])
        bent = self.curved[cells]
        if bent.any():
            found[bent] = reference_of(self.corners[cells[bent]], self.sides[cells[bent]], found[bent])
        return found

    def _lowest(self, points: FloatArray, point: IntArray, cell: IntArray) -> IntArray:
        """The triangle of lowest number that holds each point, among pairs (point (l,), triangle (l,)); −1 if none."""
        held = self._holds(cell, points[point])
        found = np.full(len(points), len(self.cells))
        np.minimum.at(found, point[held], cell[held])
        return np.where(found < len(self.cells), found, -1)

    def _holds(self, cells: IntArray, points: FloatArray) -> BoolArray:
        """Whether triangles (l,) hold points (l, 2), on their border too."""
        return np.asarray(self.reference(cells, points).min(axis=1) >= _INSIDE)

    def _in_reach(self, points: FloatArray) -> tuple[IntArray, IntArray]:
        """Pairs (point (l,), triangle (l,)): all whose triangle may hold the point, by a circle around its centre."""
        found = cKDTree(points).query_ball_point(self._centres.data, self.reach)
        cell = np.repeat(np.arange(len(self.cells)), [len(own) for own in found])
        return np.concatenate([np.zeros(0), *found]).astype(np.int64), cell
