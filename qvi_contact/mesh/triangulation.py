"""Rectangular cells cut into triangles, and triangles in corners cut into two."""

from typing import Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.mesh.parts import MeshParts
from qvi_contact.mesh.rectilinear import RectilinearMesh
from qvi_contact.mesh.topology import Topology

_SHARPEST: Final = 0.2  # sine of the angle below which no triangle is made


def triangulated(mesh: RectilinearMesh) -> MeshParts:
    """The same body with every rectangle cut into two triangles; edge sets and joints keep their names.

    Diagonals run away from the middle of the grid: from lower left to upper right in its lower left and upper right
    quarters, from upper left to lower right in the others. So a body that is its own mirror image has triangles that
    are, if the grid has an even number of cells across; a grid with twice the cells has triangles inside these. A
    middle row counts as upper, a middle column as right: neither spoils the symmetry about the other. In a corner of
    the body diagonals always run into the corner: a triangle with two edges on the boundary could follow the
    tractions on neither of them. The triangles 2k and 2k + 1 lie in the active cell k, counted row by row.
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
    """Cells (ny, nx) cut from upper left to lower right.

    Those are the ones in more such corners of the body than of the others, and where that does not say it those in the
    upper left and lower right quarters of the grid, by their number of cells.
    """
    padded = np.pad(active, 1)
    below, above = ~padded[:-2, 1:-1], ~padded[2:, 1:-1]
    left, right = ~padded[1:-1, :-2], ~padded[1:-1, 2:]
    rising = (below & left).astype(int) + (above & right)
    falling = (below & right).astype(int) + (above & left)
    upper, right_half = (2 * np.arange(count) + 1 >= count for count in active.shape)
    return np.asarray(np.where(falling == rising, upper[:, None] != right_half, falling > rising))


def divided_corners(vertices: FloatArray, cells: IntArray, fixed: IntArray) -> IntArray:
    """The triangles (m, 3), corners of the body no longer filled by a single one where that can be helped.

    A triangle with two edges on the boundary could follow the tractions on neither of them. The edge opposite the
    corner is turned, unless it is one of the `fixed` ones (k, 2) or that would make a needle.
    """
    cells = np.sort(cells, axis=1)
    topology = Topology.of(cells, len(vertices))
    kept = np.zeros(len(topology.ends), dtype=bool)
    known = topology.number(fixed[(fixed >= 0).all(axis=1)], len(vertices))
    kept[known[known >= 0]] = True
    changed, touched = cells.copy(), np.zeros(len(cells), dtype=bool)
    in_corners = np.flatnonzero(topology.boundary[topology.of_cells].sum(axis=1) == 2)
    for cell in in_corners.tolist():
        edges = topology.of_cells[cell]
        opposite = int(edges[~topology.boundary[edges]][0])
        pair = topology.cells[opposite]
        if kept[opposite] or touched[pair].any():
            continue
        b, c = topology.ends[opposite].tolist()
        other = int(pair[pair != cell][0])
        a, d = (int(np.setdiff1d(cells[each], (b, c))[0]) for each in (cell, other))
        turned = np.array([[a, b, d], [a, d, c]])
        if _sharpest(vertices[turned]) > _SHARPEST:
            changed[[cell, other]] = turned
            touched[pair] = True
    return changed


def _sharpest(corners: FloatArray) -> float:
    """The least sine of an angle of two triangles (2, 3, 2) that share an edge; negative if one is turned over."""
    sides = np.roll(corners, -1, axis=1) - corners
    before = -np.roll(sides, 1, axis=1)
    cross = sides[..., 0] * before[..., 1] - sides[..., 1] * before[..., 0]
    sines = cross / (np.hypot(*np.moveaxis(sides, 2, 0)) * np.hypot(*np.moveaxis(before, 2, 0)))
    return float((sines * np.sign(sines[0, 0])).min())
