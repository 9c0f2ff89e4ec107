"""Matrices as they are kept, checks of them, and a few rows that span others.

Matrices are sparse where they are large, and dense where they are small and the overhead of a sparse product is more
than the product in all: rows by unknowns by columns (`Columns`), rows by trace coordinates by rows (`Rows`).
"""

from copy import copy
from heapq import heapify, heappop, heappush
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from scipy.linalg import qr
from scipy.linalg.lapack import dgeqp3
from scipy.sparse import csc_array, csr_array, diags_array, issparse

from solvers.basics.checks import real_array
from solvers.basics.types import IntVector, Matrix, Sparse, SparseRows, Vector
from solvers.errors import InputError

Columns: TypeAlias = Sparse | Matrix
Rows: TypeAlias = SparseRows | Matrix

_DENSE = 100_000  # entries up to which a matrix is dense


def are_few(rows: int, columns: int) -> bool:
    """Whether a matrix of this shape is kept dense."""
    return rows * columns <= _DENSE


def by_columns(matrix: Any) -> Sparse:
    """A matrix in compressed columns, float64, with 32-bit indices where they suffice; SciPy would keep wider ones.

    A matrix that is so already is returned itself.
    """
    kept = isinstance(matrix, csc_array) and matrix.dtype == np.float64
    columns = matrix if kept else csc_array(matrix, dtype=np.float64)
    if columns.indices.dtype == np.int32 or max(columns.nnz, *columns.shape) > np.iinfo(np.int32).max:
        return columns
    narrow = copy(columns)  # whose parts are exchanged: the constructor would check them all again
    narrow.indices, narrow.indptr = columns.indices.astype(np.int32), columns.indptr.astype(np.int32)
    return narrow


def columns_of(matrix: Columns) -> IntVector:
    """The columns in which a matrix has an entry, sorted."""
    entries = (matrix != 0.0).any(axis=0) if isinstance(matrix, np.ndarray) else np.diff(by_columns(matrix).indptr)
    return entries.nonzero()[0]


def stored(rows: Columns | SparseRows) -> Rows:
    """The rows as they are best kept."""
    return dense(rows) if are_few(*rows.shape) else csr_array(rows)


def largest(vector: Vector) -> float:
    """Max |v|, 0 for no entries."""
    return float(np.maximum.reduce(np.abs(vector), initial=0.0))


def dense(rows: Columns | SparseRows) -> Matrix:
    """The rows as a dense array."""
    return rows if isinstance(rows, np.ndarray) else np.asarray(rows.toarray())


def scaled(factors: Vector, rows: Rows) -> Rows:
    """diag(factors) rows."""
    return factors[:, None] * rows if isinstance(rows, np.ndarray) else csr_array(diags_array(factors) @ rows)


def transposed(rows: Columns | SparseRows) -> Rows:
    """rowsᵀ (k, q)."""
    return rows.T if isinstance(rows, np.ndarray) else csr_array(rows.T)


def generic_vector(size: int) -> Vector:
    """(size,) numbers from −1 to 1 without a pattern that a matrix could share; quicker than random ones."""
    return np.asarray(np.sin(np.arange(1.0, size + 1.0) ** 2))


# Checks of what is given.


def checked_matrix(name: str, value: Any, empty: int | None = None) -> Columns:
    """A matrix as it is kept, `InputError` if it is none; without one no rows of `empty` columns.

    A dense one cannot be changed.
    """
    if value is None:
        if empty is None:
            raise InputError(name, None, "give a matrix")
        return np.zeros((0, empty))
    if not issparse(value):
        value = np.asarray(value)
        if value.ndim != 2:
            raise InputError(name, f"{value.ndim} dimensions", "give a matrix, with two dimensions")
    if value.dtype.kind not in "biuf":
        raise InputError(name, value.dtype, "give a matrix of real numbers, sparse or dense")
    value = dense(value) if are_few(*value.shape) else by_columns(value)
    if isinstance(value, np.ndarray) and (value.flags.writeable or value.dtype != np.float64):
        value = value.astype(np.float64)
        value.setflags(write=False)
    if not np.isfinite(value if isinstance(value, np.ndarray) else value.data).all():
        raise InputError(name, "NaN or infinity", "give finite numbers")
    return value  # type: ignore[no-any-return]


def checked_vector(name: str, value: Any, *, infinite: bool = False) -> Vector:
    """An array of numbers that cannot be changed; `InputError` if it is none."""
    vector = real_array(name, value, "give a vector of real numbers")
    if not (~np.isnan(vector) if infinite else np.isfinite(vector)).all():
        raise InputError(name, "NaN or infinity", "give finite numbers")
    vector.setflags(write=False)
    return vector


# Rows that depend linearly on each other: a few that span them, by QR with pivoting of the rows scaled to one, where
# they are few, or by sparse elimination in their order.


_RANK = 1e-10
"""Rows, scaled to length one, that are shorter than this beside the others depend on them."""


_CANCELLED = 1e-9  # a row that elimination reduces to less than this share of its terms depends on those before it
_PREFERRED = 0.1  # pivots of at least this share of the largest are good enough


def independent_rows(B: Columns) -> tuple[Matrix, Sparse]:
    """B = E Y with E (rows, r) and orthonormal rows Y (r, n) sparse."""
    touched = columns_of(B)
    rows = dense(B[:, touched])
    lengths = np.linalg.norm(rows, axis=1)
    lengths[lengths == 0.0] = 1.0
    Q, R, order = qr((rows / lengths[:, None]).T, mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(R))
    r = int((diagonal > _RANK * diagonal.max(initial=0.0)).sum())
    E = np.empty((B.shape[0], r))
    E[order] = R[:r].T
    selection = csc_array((np.ones(len(touched)), (np.arange(len(touched)), touched)), (len(touched), B.shape[1]))
    return E * lengths[:, None], csc_array(csc_array(Q[:, :r].T) @ selection)


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
