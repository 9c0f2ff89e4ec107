"""Which reference cell a mesh has, and which degrees."""

from functools import cache

import numpy as np

from qvi_contact.companion.cell import Cell
from qvi_contact.companion.rectangle import Rectangle
from qvi_contact.companion.triangle import Triangle
from qvi_contact.errors import InputError
from qvi_contact.mesh.mesh import Mesh
from qvi_contact.mesh.rectilinear import RectilinearMesh


def kind_of(mesh: Mesh) -> type[Rectangle] | type[Triangle]:
    """The kind of cell that a mesh has."""
    return Rectangle if isinstance(mesh, RectilinearMesh) else Triangle


def cell_for(mesh: Mesh, degree: int | None = None) -> Cell:
    """The cell of a mesh with displacements of a degree: 2 to 4 on rectangles, 1 to 5 on triangles.

    Raises
    ------
    InputError
        If the cell is not offered with that degree.

    """
    kind = kind_of(mesh)
    chosen = kind.default if degree is None else degree
    if isinstance(chosen, bool) or not isinstance(chosen, int | np.integer) or chosen not in kind.degrees:
        raise InputError("degree", degree, f"give one of {', '.join(map(str, kind.degrees))}")
    return _cell(kind is Rectangle, int(chosen))


@cache
def _cell(on_rectangles: bool, degree: int) -> Cell:
    """The same cell again for the same degree, with its numbers and matrices."""
    return Rectangle(degree) if on_rectangles else Triangle(degree)
