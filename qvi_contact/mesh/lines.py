"""Grid lines: made, checked, looked up, and made denser where it matters."""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import (
    FloatArray,
    finite_number,
    positive_number,
    real_array,
    true_or_false,
    whole_number,
)
from qvi_contact.errors import InputError

LARGEST: Final = 1e100  # of a coordinate: squares and areas of larger ones are beyond floating-point numbers
_MOST_CELLS: Final = 1_000_000
_SAMPLES: Final = 2000  # points per half interval where sizes are summed


def graded_lines(start: float, stop: float, cells: int, grading: float = 1.0, both_ends: bool = False) -> FloatArray:
    """Grid lines from start to stop whose cells form a geometric sequence.

    Parameters
    ----------
    start, stop : float
        Ends [length], start < stop.
    cells : int
        Number of cells, at least 1.
    grading : float
        Ratio of each cell to the one before it: below 1 the cells shrink towards `stop`.
    both_ends : bool
        Mirror the sequence about the middle: below 1 the cells shrink towards both ends.

    Returns
    -------
    (cells + 1,) array
        The lines; the two ends are exact.

    """
    start, stop = finite_number("start", start), finite_number("stop", stop)
    cells = whole_number("cells", cells, _MOST_CELLS)
    grading = positive_number("grading", grading)
    both_ends = true_or_false("both_ends", both_ends)
    if not start < stop:
        raise InputError("stop", stop, f"give a number greater than start = {start:g}")
    steps = np.arange(cells, dtype=float)
    if both_ends:
        steps = np.maximum(steps, steps[::-1]) - steps[-1] / 2.0  # distance from the middle
    with np.errstate(over="ignore", invalid="ignore"):
        sizes = grading**steps
        lines: FloatArray = start + (stop - start) * np.concatenate([[0.0], np.cumsum(sizes)]) / sizes.sum()
    lines[-1] = stop
    if not (np.isfinite(lines).all() and (np.diff(lines) > 0.0).all()):
        remedy = "cells would be too large or too small to be told apart: give less grading, or ends closer to 0"
        raise InputError("grading", grading, remedy)
    return lines


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


def checked_lines(name: str, lines: ArrayLike) -> FloatArray:
    """Strictly increasing finite grid lines as an array that cannot be written to, or `InputError`."""
    values = real_array(name, lines, "give a sequence of real numbers")
    if values.ndim != 1 or len(values) < 2:
        raise InputError(name, lines, "give a sequence of at least two grid lines")
    if not np.isfinite(values).all():
        raise InputError(name, lines, "give finite numbers")
    if np.abs(values).max() > LARGEST:
        raise InputError(name, float(np.abs(values).max()), f"give at most {LARGEST:.0e}: take other units")
    steps = np.diff(values)
    if (steps <= 0).any():
        raise InputError(name, lines, "give strictly increasing grid lines")
    resolution = 1e3 * np.finfo(float).eps * np.abs(values).max()
    if steps.min() <= resolution:
        remedy = f"cells below {resolution:.1e} are lost to rounding: move the domain to the origin or merge lines"
        raise InputError(name, float(steps.min()), remedy)
    values.flags.writeable = False
    return values


def on_line(name: str, value: object, lines: FloatArray) -> float:
    """The grid line at `value`, or an error that names the nearest one."""
    number = finite_number(name, value)
    nearest = float(lines[np.argmin(np.abs(lines - number))])
    if abs(nearest - number) > 1e-9 * (lines[-1] - lines[0]):
        raise InputError(name, number, f"must lie on a grid line; the nearest one is at {nearest:.12g}")
    return nearest
