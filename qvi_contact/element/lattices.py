"""Points that divide a square or a triangle into equal parts, for drawing what varies in it."""

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray


def square_lattice(divisions: int) -> tuple[FloatArray, IntArray]:
    """Points (k, 2) of the unit square, row by row, and the corners (c, 4) of its parts, counterclockwise."""
    t = np.linspace(0.0, 1.0, divisions + 1)
    points = np.column_stack([np.tile(t, len(t)), np.repeat(t, len(t))])
    first = (np.arange(divisions)[:, None] * (divisions + 1) + np.arange(divisions)).ravel()
    return points, first[:, None] + np.array([0, 1, divisions + 2, divisions + 1])


def _parts(number: IntArray, i: IntArray, j: IntArray, corners: list[tuple[int, int]]) -> IntArray:
    """Numbers of the points that lie these steps across and up from the points (i, j), shape (c, corners)."""
    return np.column_stack([number[j + up, i + across] for across, up in corners])


def triangle_lattice(divisions: int) -> tuple[FloatArray, IntArray]:
    """Barycentric points (k, 3) of a triangle, and the corners (c, 3) of its parts."""
    n = divisions
    j, i = np.indices((n + 1, n + 1))
    inside = i + j <= n
    number = (np.cumsum(inside) - 1).reshape(inside.shape)  # of the points inside, row by row
    i, j = i[inside], j[inside]
    upright, turned = i + j < n, i + j < n - 1
    parts = [
        _parts(number, i[upright], j[upright], [(0, 0), (1, 0), (0, 1)]),
        _parts(number, i[turned], j[turned], [(1, 0), (1, 1), (0, 1)]),
    ]
    return np.column_stack([n - i - j, i, j]) / n, np.concatenate(parts)


def triangles_of(parts: IntArray) -> IntArray:
    """Corners (t, 3) of the triangles that parts with three or four corners (c, s) are made of."""
    return np.concatenate([parts[:, [0, k, k + 1]] for k in range(1, parts.shape[1] - 1)])
