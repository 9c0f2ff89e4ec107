"""Points that divide a square or a triangle into equal parts, for drawing what varies in it."""

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray


def square_lattice(divisions: int) -> tuple[FloatArray, IntArray]:
    """Points (k, 2) of the unit square, row by row, and the corners (c, 4) of its parts, counterclockwise."""
    t = np.linspace(0.0, 1.0, divisions + 1)
    points = np.column_stack([np.tile(t, len(t)), np.repeat(t, len(t))])
    first = (np.arange(divisions)[:, None] * (divisions + 1) + np.arange(divisions)).ravel()
    return points, first[:, None] + np.array([0, 1, divisions + 2, divisions + 1])


def triangle_lattice(divisions: int) -> tuple[FloatArray, IntArray]:
    """Barycentric points (k, 3) of a triangle, and the corners (c, 3) of its parts."""
    n = divisions
    index = {(i, j): k for k, (i, j) in enumerate((i, j) for j in range(n + 1) for i in range(n + 1 - j))}
    points = np.array([(n - i - j, i, j) for i, j in index]) / n
    upright = [(index[i, j], index[i + 1, j], index[i, j + 1]) for i, j in index if i + j < n]
    turned = [(index[i + 1, j], index[i + 1, j + 1], index[i, j + 1]) for i, j in index if i + j < n - 1]
    return points, np.array(upright + turned)


def triangles_of(parts: IntArray) -> IntArray:
    """Corners (t, 3) of the triangles that parts with three or four corners (c, s) are made of."""
    return np.concatenate([parts[:, [0, k, k + 1]] for k in range(1, parts.shape[1] - 1)])
