"""Rectangular cells cut into triangles."""

import numpy as np

from qvi_contact.basics.checks import BoolArray, IntArray
from qvi_contact.mesh.parts import MeshParts
from qvi_contact.mesh.rectilinear import RectilinearMesh


def triangulated(mesh: RectilinearMesh) -> MeshParts:
    """The same body with every rectangle cut into two triangles; edge sets and joints keep their names.

    Diagonals run from lower left to upper right, but in a corner of the body always into the corner: a triangle with
    two edges on the boundary could follow the tractions on neither of them. The triangles 2k and 2k + 1 lie in the
    active cell k, counted row by row.
    """
    row, column = np.nonzero(mesh.active)
    stride = len(mesh.x)
    a = column + row * stride
    b, c, d = a + 1, a + 1 + stride, a + stride
    falling = _falling(mesh.active)[row, column]
    first = np.column_stack([a, b, np.where(falling, d, c)])
    second = np.column_stack([np.where(falling, b, a), c, d])
    cells = np.stack([first, second], axis=1).reshape(-1, 3)
    number = np.full(mesh.node_count, -1)
    used = np.flatnonzero(mesh.active_nodes.ravel())
    number[used] = np.arange(len(used))
    edges = {name: mesh.edges(name) for name in (*mesh.edge_names, *mesh.joint_names)}
    sets = {name: number[_pairs(chosen.first, chosen.second)] for name, chosen in edges.items() if len(chosen)}
    return MeshParts(mesh.coordinates[used], number[cells], sets)


def _pairs(first: IntArray, second: IntArray) -> IntArray:
    return np.column_stack([first, second])


def _falling(active: BoolArray) -> BoolArray:
    """Cells (ny, nx) cut from upper left to lower right: those in more such corners of the body than of the others."""
    padded = np.pad(active, 1)
    below, above = ~padded[:-2, 1:-1], ~padded[2:, 1:-1]
    left, right = ~padded[1:-1, :-2], ~padded[1:-1, 2:]
    rising = (below & left).astype(int) + (above & right)
    falling = (below & right).astype(int) + (above & left)
    return np.asarray(falling > rising)
