"""Fields given by their values at the points of a mesh, such as a temperature computed by another program."""

from __future__ import annotations

from contextlib import redirect_stderr
from dataclasses import dataclass
from functools import cached_property
from io import StringIO
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.spatial import cKDTree

from qvi_contact.basics.checks import FloatArray, IntArray, real_array
from qvi_contact.basics.writing import given_path
from qvi_contact.errors import InputError
from qvi_contact.mesh.triangles import TriangleMesh
from solvers.basics.names import known_name
from solvers.basics.types import load

_NEAREST: Final = 8  # triangles that are looked at for a point outside of all
_BEYOND: Final = -1.0  # least barycentric coordinate to which they are extended


@dataclass(frozen=True, eq=False)
class PointData:
    """The function that is linear on each triangle and has these values at the vertices.

    The mesh need not be that of the problem. Beside chords of its boundary, as along an arc, the nearest triangle is
    extended.

    Parameters
    ----------
    mesh : TriangleMesh
        The triangles.
    values : (v,) array_like
        The values at its vertices.

    Raises
    ------
    InputError
        If there is not one finite value for each vertex; later, if a point lies far outside of the triangles.

    """

    mesh: TriangleMesh
    values: FloatArray

    def __post_init__(self) -> None:
        if not isinstance(self.mesh, TriangleMesh):
            raise InputError("PointData.mesh", self.mesh, "give a TriangleMesh")
        values = real_array("PointData.values", self.values, "give a number for each vertex")
        if values.shape != (len(self.mesh.vertices),) or not np.isfinite(values).all():
            remedy = f"give one finite number for each of the {len(self.mesh.vertices)} vertices"
            raise InputError("PointData.values", self.values, remedy)
        object.__setattr__(self, "values", values)

    @classmethod
    def load(cls, path: str | Path, name: str) -> PointData:
        """The point data of that name in a file with triangles that meshio reads, such as .vtu, .vtk, .msh or .med.

        Raises
        ------
        InputError
            If meshio is missing, the file cannot be read, has no triangles, or no such data with one number a point.

        """
        path, printed = given_path("file", path), StringIO()
        try:
            with redirect_stderr(printed):
                read: Any = load("meshio").read(path)
        except (Exception, SystemExit) as error:  # whatever a broken file makes a reader stumble over
            told = " ".join(f"{error} {printed.getvalue()}".split()) or type(error).__name__
            raise InputError("file", str(path), f"cannot be read ({told}): write the file again") from error
        data = read.point_data[known_name("data", name, {"point data": read.point_data})]
        blocks = [block.data[:, :3] for block in read.cells if block.type.startswith("triangle")]
        if not blocks or np.ndim(data) != 1:
            raise InputError("file", str(path), f"needs triangles, and one number a point as {name!r}")
        cells = np.concatenate(blocks).astype(np.int64)
        used, places = np.unique(cells, return_inverse=True)
        return cls(
            TriangleMesh(read.points[used, :2], places.reshape(cells.shape)), np.asarray(data, dtype=float)[used]
        )

    @cached_property
    def _centres(self) -> cKDTree:
        return cKDTree(self.mesh.corners.mean(axis=1))

    def __call__(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Values at (x, y) [length]."""
        points = np.column_stack([np.ravel(x), np.ravel(y)])
        cells = self.mesh.locate(points)
        outside = np.flatnonzero(cells < 0)
        if len(outside):
            cells[outside] = self._nearest(points[outside])
        weights = self.mesh.reference(cells, points)
        if weights.min(initial=0.0) < _BEYOND:
            place = tuple(points[np.argmin(weights.min(axis=1))].tolist())
            raise InputError("PointData", place, "this point lies outside of the triangles of the data")
        return np.asarray((weights * self.values[self.mesh.cells[cells]]).sum(axis=1).reshape(np.shape(x)))

    def _nearest(self, points: FloatArray) -> IntArray:
        """The triangles that points outside (k, 2) are least far from, by their barycentric coordinates."""
        count = min(_NEAREST, self.mesh.cell_count)
        near = self._centres.query(points, count)[1].reshape(len(points), count)
        weights = self.mesh.reference(near.ravel(), np.repeat(points, count, axis=0)).min(axis=1).reshape(near.shape)
        return np.asarray(near[np.arange(len(near)), weights.argmax(axis=1)])
