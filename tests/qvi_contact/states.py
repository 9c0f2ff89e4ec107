"""Solved states and how far they differ, for several test files."""

import numpy as np

from qvi_contact import solve
from solvers import Status


def solved(problem, tolerance=1e-9, **options):
    """The result of a problem that must be solved."""
    result = solve(problem, tolerance=tolerance, **options)
    assert result.status is Status.SOLVED, result.message
    return result


def difference(one, other):
    """Largest difference of the stresses at the Gauss points of all cells, relative."""
    first, second = one.gauss_stress()[2], other.gauss_stress()[2]
    return np.abs(first - second).max() / np.abs(first).max()
