"""Joints along lines of a grid."""

import numpy as np


def with_line(mesh, name, direction, at, start=-np.inf, stop=np.inf):
    """The mesh with a joint along y = at ("horizontal") or x = at ("vertical"), between two places on it."""
    if direction == "horizontal":
        return mesh.with_joint(name, lambda x, y: np.isclose(y, at) & (x > start) & (x < stop))
    return mesh.with_joint(name, lambda x, y: np.isclose(x, at) & (y > start) & (y < stop))
