"""Rows that depend linearly on each other: a few that span them.

By QR with pivoting of the rows scaled to one, where they are few, or by sparse elimination in their order.
"""

from copy import copy
from heapq import heapify, heappop, heappush
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.linalg.lapack import dgeqp3
from scipy.sparse import csc_array, csr_array, diags_array, issparse

from solvers.basics.checks import real_array
from solvers.basics.types import IntVector, Matrix, Sparse, SparseRows, Vector
from solvers.errors import InputError

_RANK = 1e-10
"""Rows, scaled to length one, that are shorter than this beside the others depend on them."""


_CANCELLED = 1e-9  # a row that elimination reduces to less than this share of its terms depends on those before it
_PREFERRED = 0.1  # pivots of at least this share of the largest are good enough


def independent_rows(B: Sparse) -> tuple[Matrix, Sparse]:
    """B = E Y with E (rows, r) and orthonormal rows Y (r, n) sparse."""
    Q, R, order, lengths, touched = _pivoted(B)
    E = np.empty((B.shape[0], len(R)))
    E[order] = R.T
    selection = csc_array((np.ones(len(touched)), (np.arange(len(touched)), touched)), (len(touched), B.shape[1]))
    return E * lengths[:, None], csc_array(csc_array(Q.T) @ selection)


def spanning_rows(B: Sparse) -> tuple[Matrix, IntVector]:
    """B = E B[chosen] with E (rows, r) of moderate entries, those of the r chosen rows a unit matrix."""
    _, R, order, lengths, _ = _pivoted(B)
    r = len(R)
    E = np.empty((B.shape[0], r))
    E[order[:r]] = np.eye(r)
    E[order[r:]] = solve_triangular(R[:, :r], R[:, r:]).T
    return E * (lengths[:, None] / lengths[order[:r]]), order[:r]


class Echelon(NamedTuple):
    """Rows that are independent, in increasing order, and columns whose unit vectors complete them to a basis."""

    rows: IntVector
    free: IntVector


def basis_rows(Y: Matrix) -> Echelon:
    """The same for a few rows, dense, by QR with pivoting: of the rows, then of the columns of those chosen.

    Only the rows decide on the rank: asked twice, rounding could answer differently.
    """
    lengths = np.linalg.norm(Y, axis=1)
    scaled = Y / np.where(lengths > 0.0, lengths, 1.0)[:, None]
    pivots, order = _by_qr(scaled.T)
    rows = np.sort(order[: len(pivots)][pivots > _RANK * pivots.max(initial=0.0)])
    _, columns = _by_qr(scaled[rows])
    return Echelon(rows, np.sort(columns[len(rows) :]))


def _by_qr(A: Matrix) -> tuple[Vector, IntVector]:
    """Sizes of the pivots of QR of A (r, k), and the order in which it takes the columns (k,)."""
    if not A.size:
        return np.zeros(0), np.arange(A.shape[1])
    packed, order, *_ = dgeqp3(A)
    return np.abs(np.diagonal(packed)), np.asarray(order - 1, dtype=np.int64)


class _Pivot(NamedTuple):
    """A column expressed by others, among them columns that became pivots later."""

    number: int
    expression: dict[int, float]


def echelon(Y: SparseRows) -> Echelon:
    """Gaussian elimination row by row, each row reduced by all pivots before it.

    Rows along a line touch few unknowns at a time: expressed by the unknowns at the beginning of the line they stay
    short, if pivots are taken among the unknowns that come up first in a row, and if rows that touch the same unknowns
    are taken one after the other. Else all of the first kind link every unknown of a closed rim to its beginning before
    a row of the second kind comes, and each of those walks all the way back.
    """
    pivots: dict[int, _Pivot] = {}
    chosen, seen = list[int](), set[int]()
    for number in _neighbours_together(Y):
        part = slice(Y.indptr[number], Y.indptr[number + 1])
        row = dict(zip(Y.indices[part].tolist(), Y.data[part].tolist(), strict=True))
        new = set(row) - seen
        seen |= new
        row, size = _reduce(row, pivots)
        largest = max((abs(value) for value in row.values()), default=0.0)
        if largest <= _CANCELLED * size or largest == 0.0:
            continue
        candidates = [column for column in row if column in new and abs(row[column]) >= _PREFERRED * largest]
        pivot = max(candidates or row, key=lambda column: abs(row[column]))
        scale = -1.0 / row.pop(pivot)
        expression = {column: scale * value for column, value in row.items() if value != 0.0}
        pivots[pivot] = _Pivot(len(chosen), expression)
        chosen.append(number)
    free = np.setdiff1d(np.arange(Y.shape[1]), np.fromiter(pivots, dtype=np.int64, count=len(pivots)))
    return Echelon(np.sort(np.array(chosen, dtype=np.int64)), free)


def _neighbours_together(Y: SparseRows) -> list[int]:
    """The rows in an order in which each comes right after the first one that it shares a column with."""
    rows = np.repeat(np.arange(Y.shape[0]), np.diff(Y.indptr))
    first = np.full(Y.shape[1], Y.shape[0])
    np.minimum.at(first, Y.indices, rows)
    earliest = np.full(Y.shape[0], Y.shape[0])
    np.minimum.at(earliest, rows, first[Y.indices])
    return [int(row) for row in np.argsort(earliest, kind="stable")]


def _reduce(row: dict[int, float], pivots: dict[int, _Pivot]) -> tuple[dict[int, float], float]:
    """The row with every pivot column replaced by its expression, and the size of the terms that may cancel.

    Pivots come in the order in which they were found. An expression holds none of the earlier ones, so each is replaced
    once; in another order they come back again and again, in a closed chain of rows some power of its length often.
    """
    size = max(map(abs, row.values()), default=0.0)
    held = [(pivots[column].number, column) for column in row if column in pivots]
    heapify(held)
    while held:
        _, column = heappop(held)
        value = row.pop(column)
        for other, factor in pivots[column].expression.items():
            term = value * factor
            size = max(size, abs(term))
            if other not in row and other in pivots:
                heappush(held, (pivots[other].number, other))
            row[other] = row.get(other, 0.0) + term
    return row, size


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


# Rows by trace coordinates: sparse where there are many, dense where there are few and sparse overhead counts.


Rows: TypeAlias = SparseRows | Matrix
"""Rows (q, k), a csr array or a dense one."""

_DENSE = 60_000  # entries up to which rows are kept dense


def by_columns(matrix: Any) -> Sparse:
    """A matrix in compressed columns, float64, with 32-bit indices where they suffice; SciPy would keep wider ones.

    A matrix that is so already is returned itself: problems of a sequence are known to share it.
    """
    if isinstance(matrix, np.ndarray) and matrix.dtype == np.float64 and matrix.ndim == 2:
        return _compressed(matrix)  # SciPy would go through coordinates
    kept = isinstance(matrix, csc_array) and matrix.dtype == np.float64
    columns = matrix if kept else csc_array(matrix, dtype=np.float64)
    if columns.indices.dtype == np.int32 or max(columns.nnz, *columns.shape) > np.iinfo(np.int32).max:
        return columns
    narrow = copy(columns)  # whose parts are exchanged: the constructor would check them all again
    narrow.indices, narrow.indptr = columns.indices.astype(np.int32), columns.indptr.astype(np.int32)
    return narrow


def _compressed(matrix: Matrix) -> Sparse:
    """A dense matrix in compressed columns."""
    entries = matrix.T.ravel()
    places = np.flatnonzero(entries)
    rows = (places % len(matrix)).astype(np.int32) if len(matrix) else places.astype(np.int32)
    starts = np.searchsorted(places, len(matrix) * np.arange(matrix.shape[1] + 1)).astype(np.int32)
    return csc_array((entries[places], rows, starts), matrix.shape)


def stacked_columns(upper: Sparse, lower: Sparse) -> Sparse:
    """Rows on top of each other, both by columns; SciPy's `vstack` would go through coordinates."""
    first = np.arange(upper.nnz) + np.repeat(lower.indptr[:-1], np.diff(upper.indptr))
    second = np.arange(lower.nnz) + np.repeat(upper.indptr[1:], np.diff(lower.indptr))
    data, indices = np.empty(upper.nnz + lower.nnz), np.empty(upper.nnz + lower.nnz, dtype=upper.indices.dtype)
    data[first], data[second] = upper.data, lower.data
    indices[first], indices[second] = upper.indices, lower.indices + upper.shape[0]
    return csc_array((data, indices, upper.indptr + lower.indptr), (upper.shape[0] + lower.shape[0], upper.shape[1]))


def are_few(rows: int, columns: int) -> bool:
    """Whether a matrix of this shape is kept dense."""
    return rows * columns <= _DENSE


def stored(rows: Sparse | SparseRows) -> Rows:
    """The rows as they are best kept."""
    return rows.toarray() if are_few(*rows.shape) else csr_array(rows)


def for_products(matrix: Sparse) -> Any:
    """The matrix as products with vectors are taken with it: dense where it is small, else as it is."""
    return matrix.toarray() if are_few(*matrix.shape) else matrix


def largest(vector: Vector) -> float:
    """Max |v|, 0 for no entries."""
    return float(np.maximum.reduce(np.abs(vector), initial=0.0))


def dense(rows: Rows) -> Matrix:
    """The rows as a dense array."""
    return rows if isinstance(rows, np.ndarray) else np.asarray(rows.toarray())


def scaled(factors: Vector, rows: Rows) -> Rows:
    """diag(factors) rows."""
    return factors[:, None] * rows if isinstance(rows, np.ndarray) else csr_array(diags_array(factors) @ rows)


def scaled_columns(rows: Rows, factors: Vector) -> Rows:
    """Rows diag(factors)."""
    return rows * factors if isinstance(rows, np.ndarray) else csr_array(rows @ diags_array(factors))


def magnitudes(rows: Rows) -> Rows:
    """Absolute values of all entries."""
    return np.abs(rows) if isinstance(rows, np.ndarray) else csr_array(abs(rows))


def mapped(rows: Rows, matrix: Rows) -> Rows:
    """Rows times a matrix (k, u)."""
    return np.asarray(rows @ matrix) if isinstance(rows, np.ndarray) else csr_array(rows @ matrix)


def transposed(rows: Rows) -> Rows:
    """rowsᵀ (k, q)."""
    return rows.T if isinstance(rows, np.ndarray) else csr_array(rows.T)


def absolute_product(matrix: Sparse, vector: Vector) -> Vector:
    """|matrix| |vector| (q,) of a csc array (q, k): the size of the terms of matrix vector."""
    columns = np.repeat(np.abs(vector), np.diff(matrix.indptr))
    sums = np.bincount(matrix.indices, np.abs(matrix.data) * columns, matrix.shape[0])
    return np.asarray(sums, dtype=np.float64)


# Checks of what is given.


def checked_matrix(name: str, value: Any, empty: int | None = None) -> Sparse:
    """A matrix in compressed columns, `InputError` if it is none; without one no rows of `empty` columns."""
    if value is None:
        if empty is None:
            raise InputError(name, None, "give a matrix")
        return csc_array((0, empty))
    try:
        if np.iscomplexobj(value):
            raise TypeError("complex numbers")
        matrix = by_columns(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(name, type(value).__name__, "give a matrix of real numbers, sparse or dense") from error
    if not issparse(value) and np.ndim(value) != 2:
        raise InputError(name, f"{np.ndim(value)} dimensions", "give a matrix, with two dimensions")
    if not np.isfinite(matrix.data).all():
        raise InputError(name, "NaN or infinity", "give finite numbers")
    return matrix


def checked_vector(name: str, value: Any, *, infinite: bool = False) -> Vector:
    """An array of numbers that cannot be changed; `InputError` if it is none."""
    vector = real_array(name, value, "give a vector of real numbers")
    if not (~np.isnan(vector) if infinite else np.isfinite(vector)).all():
        raise InputError(name, "NaN or infinity", "give finite numbers")
    vector.setflags(write=False)
    return vector
