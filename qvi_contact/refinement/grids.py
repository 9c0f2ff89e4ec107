"""Grids beside a given one: all intervals bisected, every second line left out, cells of one in cells of another."""

from itertools import pairwise

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.mesh.rectilinear import RectilinearMesh
from qvi_contact.problem.problem import ContactProblem

_HORIZONTAL_SETS = ("bottom", "top", "horizontal")


def bisected(lines: FloatArray) -> FloatArray:
    """The lines, and one in the middle of every interval."""
    result = np.empty(2 * len(lines) - 1)
    result[::2], result[1::2] = lines, (lines[1:] + lines[:-1]) / 2.0
    return result


def halved(lines: FloatArray, needed: BoolArray) -> FloatArray:
    """About every second line: intervals merged in pairs between the `needed` lines.

    Of an odd number of intervals one stays alone: the largest at an even place, of equals the middlemost.
    """
    keep = needed.copy()
    for start, stop in pairwise(np.flatnonzero(needed).tolist()):
        count = stop - start
        keep[start:stop:2] = True
        if count % 2:
            sizes = np.diff(lines[start : stop + 1])[::2]
            largest = np.flatnonzero(sizes >= sizes.max() * (1.0 - 1e-9))
            alone = start + 2 * int(largest[np.argmin(np.abs(2 * largest - (count - 1) / 2.0))])
            keep[alone:stop] = False
            keep[alone] = True
            keep[alone + 1 : stop : 2] = True
    return lines[keep]


def needed_lines(problem: ContactProblem) -> tuple[BoolArray, BoolArray]:
    """Which lines x, y the outline, the edge sets and the regions need, shapes (nx + 1,) and (ny + 1,)."""
    mesh = problem.grid
    kind = np.where(mesh.active, problem.material_numbers, -1)
    padded = np.pad(kind, 1, constant_values=-1)
    in_x = (padded[:, 1:] != padded[:, :-1]).any(axis=0)
    in_y = (padded[1:] != padded[:-1]).any(axis=1)
    in_x[[0, -1]] = in_y[[0, -1]] = True
    for chosen in mesh.named.values():
        along, across = (in_x, in_y) if chosen.side in _HORIZONTAL_SETS else (in_y, in_x)
        lines, others = (mesh.x, mesh.y) if chosen.side in _HORIZONTAL_SETS else (mesh.y, mesh.x)
        for end in (chosen.start, chosen.stop):
            if end is not None:
                along[_nearest(lines, end)] = True
        if chosen.at is not None:
            across[_nearest(others, chosen.at)] = True
    return in_x, in_y


def coarser(problem: ContactProblem) -> ContactProblem:
    """The problem with about every second line left out, those it needs kept."""
    needed_x, needed_y = needed_lines(problem)
    return problem.on_lines(halved(problem.grid.x, needed_x), halved(problem.grid.y, needed_y))


def finer(problem: ContactProblem) -> ContactProblem:
    """The problem with every interval bisected."""
    return problem.on_lines(bisected(problem.grid.x), bisected(problem.grid.y))


def parents(lines: FloatArray, finer_lines: FloatArray) -> IntArray:
    """For each interval of a finer grid the interval of `lines` that holds it."""
    return np.searchsorted(lines, (finer_lines[1:] + finer_lines[:-1]) / 2.0) - 1


def summed(values: FloatArray, fine: RectilinearMesh, coarse: RectilinearMesh) -> FloatArray:
    """Values of the cells of a fine mesh summed in those of a coarse one, shape of the latter."""
    first_x, first_y = np.searchsorted(fine.x, coarse.x[:-1]), np.searchsorted(fine.y, coarse.y[:-1])
    return np.asarray(np.add.reduceat(np.add.reduceat(values, first_y, axis=0), first_x, axis=1))


def spread(values: FloatArray, coarse: RectilinearMesh, fine: RectilinearMesh) -> FloatArray:
    """The value of the coarse cell that each fine cell lies in, shape of the fine mesh."""
    return np.asarray(values[np.ix_(parents(coarse.y, fine.y), parents(coarse.x, fine.x))])


def _nearest(lines: FloatArray, value: float) -> int:
    return int(np.argmin(np.abs(lines - value)))
