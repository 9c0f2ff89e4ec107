"""Grid lines made denser where it matters."""

from itertools import pairwise
from typing import Final

import numpy as np

from qvi_contact.basics.checks import FloatArray

_SAMPLES: Final = 2000  # points per half interval where sizes are summed


def subdivided(lines: FloatArray, critical: FloatArray, largest: float, smallest: float, growth: float) -> FloatArray:
    """Lines added so that cells are about h(x) = min(largest, smallest + growth · distance to `critical`)."""
    pieces = [lines[:1]]
    for start, stop in pairwise(lines.tolist()):
        t = np.linspace(0.0, 1.0, _SAMPLES)
        x = start + (stop - start) * np.concatenate([t**3 / 2, 1.0 - t[-2::-1] ** 3 / 2])  # dense at both ends
        distance = np.abs(x[:, None] - critical).min(axis=1, initial=np.inf)
        size = np.minimum(largest, smallest + growth * distance)
        cells = np.concatenate([[0.0], np.cumsum(np.diff(x) * (1.0 / size[1:] + 1.0 / size[:-1]) / 2.0)])
        count = max(1, int(np.ceil(cells[-1] - 1e-3)))
        pieces.append(np.append(np.interp(np.arange(1, count) * cells[-1] / count, cells, x), stop))
    return np.concatenate(pieces)
