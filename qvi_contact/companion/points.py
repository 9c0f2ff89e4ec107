"""Cells that hold given points."""

from collections.abc import Iterator

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.mesh.rectilinear import RectilinearMesh

_ON_LINE = 1e-12  # distance from a grid line, relative to the body, below which a point is on it


def cells_around(mesh: RectilinearMesh, x: FloatArray, y: FloatArray) -> Iterator[tuple[IntArray, IntArray]]:
    """Columns and rows of up to four different cells that hold each point; −1 where there is none."""
    columns, rows = _beside(mesh.x, x, mesh.length), _beside(mesh.y, y, mesh.length)
    for column in columns:
        for row in rows:
            yield column, row


def _beside(lines: FloatArray, values: FloatArray, length: float) -> tuple[IntArray, IntArray]:
    """The interval below and the one above each value, the latter −1 where they are one; −1 outside."""
    count, near = len(lines) - 1, _ON_LINE * length
    low = np.searchsorted(lines, values - near, side="right") - 1
    high = np.searchsorted(lines, values + near, side="right") - 1
    inside = (values >= lines[0] - near) & (values <= lines[-1] + near)
    first = np.where(inside & (low >= 0), low, -1)
    second = np.where(inside & (high < count) & (high != first), high, -1)
    return np.where(first < count, first, -1), second
