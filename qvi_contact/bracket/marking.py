"""A finer grid for the cells where the bounds are apart."""

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray, finite_number
from qvi_contact.bracket.outcome import Bracket
from qvi_contact.errors import InputError
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement.marking import regular_lines


def refined_where_apart(problem: ContactProblem, bracket: Bracket, share: float = 0.7) -> ContactProblem:
    """The problem with those grid intervals bisected that hold a given share of the gap.

    The parts of `Bracket.cells` are added up along the columns and along the rows of the grid. Intervals are taken in
    the order of what they hold for each cell that bisecting them adds, until columns or rows chosen hold `share` of the
    gap of their direction (Dörfler's marking, by strips). Neighbouring intervals stay within a ratio of 4.

    Parameters
    ----------
    problem : ContactProblem
        The problem stated, on the mesh of the bracket.
    bracket : Bracket
        With an admissible displacement. Where the lower bound is missing, because no stress on this mesh obeys the
        contact law on whole edges, the parts of the stress at hand count.
    share : float
        In (0, 1].

    Raises
    ------
    InputError
        If the meshes differ, the upper bound is missing, or `share` is out of range.

    """
    if not isinstance(problem, ContactProblem):
        raise InputError("problem", problem, "give the ContactProblem of the bracket")
    mesh = problem.grid
    if not 0.0 < finite_number("share", share) <= 1.0:
        raise InputError("share", share, "give a number above 0, at most 1")
    if not isinstance(bracket, Bracket):
        raise InputError("bracket", bracket, "give the bracket of a result")
    if bracket.cells.shape != mesh.shape:
        raise InputError("bracket", bracket.cells.shape, f"give one on the mesh of the problem, {mesh.shape}")
    if not np.isfinite(bracket.upper):
        raise InputError("bracket", bracket.upper, f"there is no displacement to compare with: {bracket.message}")
    parts = np.maximum(bracket.cells, 0.0)  # below zero only where no admissible stress was found
    columns, rows = parts.sum(axis=0), parts.sum(axis=1)
    gains = np.concatenate([columns / mesh.active.sum(axis=0).clip(1), rows / mesh.active.sum(axis=1).clip(1)])
    chosen = _marked(np.concatenate([columns, rows]), gains, 2.0 * share * float(columns.sum()))
    nx = mesh.shape[1]
    x, y = _bisected(mesh.x, chosen[chosen < nx]), _bisected(mesh.y, chosen[chosen >= nx] - nx)
    return problem.on_lines(*regular_lines(problem, x, y))


def _marked(parts: FloatArray, gains: FloatArray, goal: float) -> IntArray:
    """Indices of the fewest entries, those of the largest gain first, whose parts add up to the goal."""
    order = np.argsort(-gains, kind="stable")
    enough = int(np.searchsorted(np.cumsum(parts[order]), goal * (1.0 - 1e-12))) + 1
    return order[:enough]


def _bisected(lines: FloatArray, chosen: IntArray) -> FloatArray:
    return np.sort(np.concatenate([lines, (lines[chosen] + lines[chosen + 1]) / 2.0]))
