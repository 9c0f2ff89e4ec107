"""Rows that depend linearly on each other: a few that span them.

By QR with pivoting of the rows scaled to one, where they are few, or by sparse elimination in their order.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.sparse import csc_matrix, csr_matrix

from solvers.basics.types import IntVector, Matrix, Sparse, Vector

_RANK = 1e-10
"""Rows, scaled to length one, that are shorter than this beside the others depend on them."""


_CANCELLED = 1e-9  # a row that elimination reduces to less than this share of its terms depends on those before it
_PREFERRED = 0.1  # pivots of at least this share of the largest are good enough


def independent_rows(B: Sparse) -> tuple[Matrix, Sparse]:
    """B = E Y with E (rows, r) and orthonormal rows Y (r, n) sparse."""
    Q, R, order, lengths, touched = _pivoted(B)
    E = np.empty((B.shape[0], len(R)))
    E[order] = R.T
    selection = csc_matrix((np.ones(len(touched)), (np.arange(len(touched)), touched)), (len(touched), B.shape[1]))
    return E * lengths[:, None], csc_matrix(csc_matrix(Q.T) @ selection)


def spanning_rows(B: Sparse) -> tuple[Matrix, IntVector]:
    """B = E B[chosen] with E (rows, r) of moderate entries, those of the r chosen rows a unit matrix."""
    _, R, order, lengths, _ = _pivoted(B)
    r = len(R)
    E = np.empty((B.shape[0], r))
    E[order[:r]] = np.eye(r)
    E[order[r:]] = solve_triangular(R[:, :r], R[:, r:]).T
    return E * (lengths[:, None] / lengths[order[:r]]), order[:r]


class Echelon(NamedTuple):
    """Rows that are independent, and columns whose unit vectors complete them to a basis."""

    rows: IntVector
    free: IntVector


def echelon(Y: csr_matrix) -> Echelon:
    """Gaussian elimination row by row, each row reduced by all pivots before it.

    Rows along a line touch few unknowns at a time: expressed by the unknowns at the beginning of the line they stay
    short, if pivots are taken among the unknowns that come up first in a row.
    """
    reduced: dict[int, dict[int, float]] = {}
    chosen, seen = [], set[int]()
    for number in range(Y.shape[0]):
        part = slice(Y.indptr[number], Y.indptr[number + 1])
        row = dict(zip(Y.indices[part].tolist(), Y.data[part].tolist(), strict=True))
        new = set(row) - seen
        seen |= new
        row, size = _reduce(row, reduced)
        largest = max((abs(value) for value in row.values()), default=0.0)
        if largest <= _CANCELLED * size or largest == 0.0:
            continue
        candidates = [column for column in row if column in new and abs(row[column]) >= _PREFERRED * largest]
        pivot = max(candidates or row, key=lambda column: abs(row[column]))
        scale = -1.0 / row.pop(pivot)
        reduced[pivot] = {column: scale * value for column, value in row.items() if value != 0.0}
        chosen.append(number)
    free = np.setdiff1d(np.arange(Y.shape[1]), np.fromiter(reduced, dtype=np.int64, count=len(reduced)))
    return Echelon(np.array(chosen, dtype=np.int64), free)


def _reduce(row: dict[int, float], pivots: dict[int, dict[int, float]]) -> tuple[dict[int, float], float]:
    """The row with every pivot column replaced by its expression, and the size of the terms that may cancel."""
    size = max(map(abs, row.values()), default=0.0)
    while True:
        held = [column for column in row if column in pivots]
        if not held:
            return row, size
        for column in held:
            value = row.pop(column)
            for other, factor in pivots[column].items():
                term = value * factor
                size = max(size, abs(term))
                row[other] = row.get(other, 0.0) + term


def _pivoted(B: Sparse) -> tuple[Matrix, Matrix, IntVector, Vector, IntVector]:
    """Q (touched columns, r), R (r, rows) and the pivot order of the scaled rows, their lengths, touched columns."""
    touched = np.flatnonzero(np.diff(B.indptr))
    rows = B[:, touched].toarray()
    lengths = np.linalg.norm(rows, axis=1)
    lengths[lengths == 0.0] = 1.0
    Q, R, order = qr((rows / lengths[:, None]).T, mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(R))
    r = int((diagonal > _RANK * diagonal.max(initial=0.0)).sum())
    return Q[:, :r], R[:r], order, lengths, touched
