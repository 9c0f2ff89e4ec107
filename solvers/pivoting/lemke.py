"""Linear complementarity by pivoting: x ≥ 0, w = q + M x ≥ 0, xᵀw = 0.

Lemke's method (C. E. Lemke, Management Science 11, 1965; R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear
Complementarity Problem, section 4.4) follows the solutions of w = q + d θ + M x, d > 0, from θ so large that x = 0 down
to θ = 0. Each pivot goes along one edge of that path. It ends at a solution, or in a ray on which x grows without end.
"""

from dataclasses import dataclass

import numpy as np

from solvers.basics.types import BoolVector, IntVector, Matrix, Vector
from solvers.basics.watch import expired

_PIVOT = 1e-9  # share of its column's largest entry below which an entry is rounding
_TIE = 1e-10  # relative difference of steps that count as equal
_PIVOTS = 20  # pivots at most, times the number of unknowns


@dataclass(frozen=True, eq=False)
class Vertex:
    """Where the path has ended.

    Attributes
    ----------
    x : (n,) ≥ 0
    basic : (n,) bool, where x may be positive, w zero
    pivots : how many it took

    """

    x: Vector
    basic: BoolVector
    pivots: int


def solve_lcp(M: Matrix, q: Vector, d: Vector) -> Vertex | None:
    """A solution of the problem of this module, (n, n), (n,) and (n,) > 0; nothing if the path ends in a ray.

    Nor is there one if the time is over before the path ends, see `watch`.
    """
    n = len(q)
    if q.min(initial=0.0) >= 0.0:
        return Vertex(np.zeros(n), np.zeros(n, dtype=bool), 0)
    table = np.hstack([np.eye(n), -M, -d[:, None], q[:, None]])  # w − M x − d θ = q
    basis = np.arange(n)
    row, entering = int(np.argmin(q / d)), 2 * n
    for pivots in range(1, _PIVOTS * n):
        _pivot(table, row, entering)
        leaving, basis[row] = int(basis[row]), entering
        if leaving == 2 * n:
            return _vertex(table, basis, pivots)
        entering = leaving + n if leaving < n else leaving - n
        found = _leaving_row(table, basis, entering)
        if found is None or expired():
            return None
        row = found
    return None


def _pivot(table: Matrix, row: int, column: int) -> None:
    """Solve the row for the column's variable and eliminate it from all others."""
    table[row] /= table[row, column]
    factors = table[:, column].copy()
    factors[row] = 0.0
    table -= factors[:, None] * table[row]
    table[:, column] = 0.0
    table[row, column] = 1.0


def _leaving_row(table: Matrix, basis: IntVector, entering: int) -> int | None:
    """The basic variable that reaches zero first, θ before others and large pivots before small; none: a ray."""
    column = table[:, entering]
    falls = column > _PIVOT * max(1.0, float(np.maximum.reduce(np.abs(column))))
    steps = np.full(len(column), np.inf)
    np.divide(np.maximum(table[:, -1], 0.0), column, out=steps, where=falls)
    least = float(np.minimum.reduce(steps))
    if least == np.inf:
        return None
    tied = (steps <= least + _TIE * max(least, 1e-4)).nonzero()[0]
    if len(tied) == 1:
        return int(tied[0])
    last = tied[basis[tied] == 2 * len(basis)]
    return int(last[0]) if len(last) else int(tied[np.argmax(column[tied])])


def _vertex(table: Matrix, basis: IntVector, pivots: int) -> Vertex:
    n = len(basis)
    x, basic = np.zeros(n), np.zeros(n, dtype=bool)
    rows = np.flatnonzero(basis >= n)
    x[basis[rows] - n] = np.maximum(table[rows, -1], 0.0)
    basic[basis[rows] - n] = True
    return Vertex(x, basic, pivots)
