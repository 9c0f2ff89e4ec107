"""Which grid lines to insert: those that pay most, foreseen over several bisections.

In `docs/theory.md`: (D15).
"""

from dataclasses import dataclass

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray
from qvi_contact.mesh.rectilinear import HORIZONTAL
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement.estimate import CellErrors

_SMOOTH = 1.0 / 16.0  # factor of an interval away from what makes its neighbour singular
_HEIR = 0.75  # share of the error from which a half is taken to hold a singularity
_DEPTH = 3  # bisections of one interval in a round
_ALIKE = 1e-3  # gains that differ by less count as equal, which keeps symmetric meshes symmetric
_NEIGHBOURS = 4.0  # largest ratio of neighbouring intervals
_ASPECT = 2.0  # largest depth of a cell over its edge on a contact
_SLACK = 1.0 + 1e-9


@dataclass(frozen=True)
class _Interval:
    """An interval of one direction: the error of its strip, the factor of bisecting it, its left half's share."""

    start: float
    stop: float
    error: float
    factor: float
    left: float
    depth: int = 0

    @property
    def gain(self) -> float:
        return self.error * (1.0 - self.factor)

    @property
    def halves(self) -> "tuple[_Interval, _Interval]":
        """Both halves as they are foreseen: a half with most of the error keeps the rate, the other is smooth."""
        middle = (self.start + self.stop) / 2.0
        rest = self.error * self.factor
        return (
            self._half(self.start, middle, rest * self.left, self.left),
            self._half(middle, self.stop, rest * (1.0 - self.left), 1.0 - self.left, mirrored=True),
        )

    def _half(self, start: float, stop: float, error: float, share: float, mirrored: bool = False) -> "_Interval":
        if share >= _HEIR:
            return _Interval(start, stop, error, self.factor, 1.0 - share if mirrored else share, self.depth + 1)
        factor = _SMOOTH if share <= 1.0 - _HEIR else self.factor
        return _Interval(start, stop, error, factor, 0.5, self.depth + 1)


def marked_lines(
    problem: ContactProblem, errors: CellErrors, goal: float, most_unknowns: float, thinnest: float
) -> tuple[FloatArray, FloatArray]:
    """New grid lines x, y for the coarse problem of two whose errors on the finer one are given.

    Intervals are bisected, those first that reduce the error most for the unknowns they cost, until what is foreseen
    for the finer grid falls to `goal` or its unknowns rise to `most_unknowns`. An interval costs a column or row of
    cells. Then neighbouring intervals are brought within a ratio of 4, and cells on contacts to a depth of at most
    twice their edge.

    Parameters
    ----------
    problem : ContactProblem
        The coarse one; the finer has every interval bisected.
    errors : CellErrors
        On the finer grid.
    goal : float
        Error to come down to [stress × length²].
    most_unknowns : float
        Of the finer problem.
    thinnest : float
        Smallest interval of the finer grid [length].

    """
    mesh = problem.grid
    strips = [
        _strips(mesh.x, errors.along_x.sum(axis=0), (errors.along_x * errors.factor_x).sum(axis=0)),
        _strips(mesh.y, errors.along_y.sum(axis=1), (errors.along_y * errors.factor_y).sum(axis=1)),
    ]
    filled = float(mesh.active.mean())
    remaining = errors.total
    while remaining > goal and 16.0 * filled * len(strips[0]) * len(strips[1]) < most_unknowns:
        chosen = _best(strips, thinnest)
        if not any(chosen):
            break
        for direction in (0, 1):
            remaining -= sum(strips[direction][index].gain for index in chosen[direction])
            strips[direction] = _with_halves(strips[direction], chosen[direction])
    x, y = (np.array([strip.start for strip in line] + [line[-1].stop]) for line in strips)
    return regular_lines(problem, x, y)


def _strips(lines: FloatArray, error: FloatArray, reduced: FloatArray) -> list[_Interval]:
    """Intervals of one direction from the errors of their halves, before and after a bisection."""
    total, left = error[::2] + error[1::2], error[::2]
    factor = (reduced[::2] + reduced[1::2]) / np.where(total > 0.0, total, 1.0)
    share = np.where(total > 0.0, left / np.where(total > 0.0, total, 1.0), 0.5)
    columns = np.column_stack([lines[:-1], lines[1:], total, factor, share]).tolist()
    return [_Interval(*row) for row in columns]


def _best(strips: list[list[_Interval]], thinnest: float) -> tuple[list[int], list[int]]:
    """Indices of the intervals in x and in y whose bisection gains most per unknown, equal ones together."""
    gains = []
    for line, other in ((strips[0], strips[1]), (strips[1], strips[0])):
        able = [strip.depth < _DEPTH and strip.stop - strip.start >= 4.0 * thinnest for strip in line]
        gains.append([strip.gain / len(other) if ok else 0.0 for strip, ok in zip(line, able, strict=True)])
    most = max(*gains[0], *gains[1])
    if most <= 0.0:
        return [], []
    in_x, in_y = ([i for i, gain in enumerate(line) if gain >= (1.0 - _ALIKE) * most] for line in gains)
    return in_x, in_y


def _with_halves(line: list[_Interval], chosen: list[int]) -> list[_Interval]:
    return [part for i, strip in enumerate(line) for part in (strip.halves if i in chosen else (strip,))]


def regular_lines(problem: ContactProblem, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lines x, y [length] with intervals bisected until neighbours, and the cells on contacts, have bounded ratios."""
    while True:
        x, y = _graded(x), _graded(y)
        deep_x, deep_y = _too_deep(problem, x, y)
        if not deep_x.any() and not deep_y.any():
            return x, y
        x, y = _split(x, deep_x), _split(y, deep_y)


def _graded(lines: FloatArray) -> FloatArray:
    """Intervals bisected as long as one is more than four times a neighbour."""
    while True:
        sizes = np.diff(lines)
        large = np.zeros(len(sizes), dtype=bool)
        large[1:] |= sizes[1:] > _NEIGHBOURS * _SLACK * sizes[:-1]
        large[:-1] |= sizes[:-1] > _NEIGHBOURS * _SLACK * sizes[1:]
        if not large.any():
            return lines
        lines = _split(lines, large)


def _too_deep(problem: ContactProblem, x: FloatArray, y: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Which intervals in x and in y hold a cell on a contact deeper than twice its edge."""
    mesh = problem.grid.on_lines(x, y)
    width, height = np.diff(x), np.diff(y)
    deep_x, deep_y = np.zeros(len(width), dtype=bool), np.zeros(len(height), dtype=bool)
    for contact in problem.contacts:
        edges = mesh.edges(contact.edges)
        along_x, w, h = edges.axis == HORIZONTAL, width[edges.column], height[edges.row]
        deep_y[edges.row[along_x & (h > _ASPECT * _SLACK * w)]] = True
        deep_x[edges.column[~along_x & (w > _ASPECT * _SLACK * h)]] = True
        if contact.edges in mesh.joint_names:  # the block on the other side
            deep_y[edges.row[along_x & (height[edges.row + along_x] > _ASPECT * _SLACK * w)] + 1] = True
            deep_x[edges.column[~along_x & (width[edges.column + ~along_x] > _ASPECT * _SLACK * h)] + 1] = True
    return deep_x, deep_y


def _split(lines: FloatArray, chosen: BoolArray) -> FloatArray:
    return np.sort(np.concatenate([lines, (lines[1:] + lines[:-1])[chosen] / 2.0]))
