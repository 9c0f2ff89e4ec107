"""Storage and checks of matrices, and linearly independent rows of them.

Large matrices are sparse, small ones dense, as the overhead of a sparse product exceeds the time of a small dense one.
Rows in the unknowns z are in compressed columns (`Columns`), rows in trace coordinates in compressed rows (`Rows`).
"""

from copy import copy
from heapq import heapify, heappop, heappush
from typing import Any, NamedTuple, TypeAlias

import numpy as np
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
    """A matrix in compressed columns, float64, with 32-bit indices if they suffice; SciPy would keep 64-bit ones.

    A matrix that has this form already is returned itself.
    """
    is_csc = isinstance(matrix, csc_array) and matrix.dtype == np.float64
    columns = matrix if is_csc else csc_array(matrix, dtype=np.float64)
    if columns.indices.dtype == np.int32 or max(columns.nnz, *columns.shape) > np.iinfo(np.int32).max:
        return columns
    narrow = copy(columns)  # not by the constructor, which would check all indices again
    narrow.indices, narrow.indptr = columns.indices.astype(np.int32), columns.indptr.astype(np.int32)
    return narrow


def columns_of(matrix: Columns) -> IntVector:
    """Indices of the columns in which a matrix has an entry, sorted."""
    entries = (matrix != 0.0).any(axis=0) if isinstance(matrix, np.ndarray) else np.diff(by_columns(matrix).indptr)
    return entries.nonzero()[0]


def stored(rows: Columns | SparseRows) -> Rows:
    """The rows dense if they are few, else in compressed rows."""
    return dense(rows) if are_few(*rows.shape) else csr_array(rows)


def largest(vector: Vector) -> float:
    """Max |v|, 0 for an empty vector."""
    return float(np.maximum.reduce(np.abs(vector), initial=0.0))


def most(vector: Vector) -> float:
    """Max v, 0 for an empty or negative vector."""
    return float(np.maximum.reduce(vector, initial=0.0))


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
    """(size,) numbers from −1 to 1 without a regular pattern; faster than random numbers."""
    return np.asarray(np.sin(np.arange(1.0, size + 1.0) ** 2))


# Checks of arguments.


def checked_matrix(name: str, value: Any, empty: int | None = None) -> Columns:
    """A matrix of finite numbers in its form of storage, read-only if it is dense; `InputError` for other values.

    None gives a matrix (0, `empty`), if `empty` is given.
    """
    if value is None:
        if empty is None:
            raise InputError(name, None, "give a matrix")
        return np.zeros((0, empty))
    if not issparse(value):
        if type(value) is not np.ndarray:
            value = real_array(name, value, "give a matrix of real numbers, sparse or dense")
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
    """A read-only array of numbers without NaN, finite unless `infinite`; `InputError` for other values."""
    vector = real_array(name, value, "give a vector of real numbers")
    if not (~np.isnan(vector) if infinite else np.isfinite(vector)).all():
        raise InputError(name, "NaN or infinity", "give finite numbers")
    vector.setflags(write=False)
    return vector


# Linearly independent rows of a matrix: by QR with pivoting of the rows scaled to length one if the matrix is small,
# else by sparse Gaussian elimination.

LEAST_PIVOT = 1e-10
"""Pivots of QR, over the largest one, below which rows of length one count as linearly dependent."""

_LAST_WEIGHT = 0.9  # least weight of the last column in the choice of pivots, 1 of the first
_CANCELLATION = 1e-9  # a row reduced by elimination to less than this share of its terms is linearly dependent
_PIVOT_THRESHOLD = 0.1  # least size of a pivot over the largest entry of its row


class Echelon(NamedTuple):
    """Linearly independent rows, in increasing order, and columns whose unit vectors complete them to a basis."""

    rows: IntVector
    free: IntVector


def basis(Y: Columns | SparseRows) -> Echelon:
    """The basis of the rows Y: of a small matrix by QR with pivoting, first of the rows, then of the columns.

    The rank is decided once, by the rows: a second decision, by the columns, could differ by rounding.
    """
    if not are_few(*Y.shape):
        return echelon(csr_array(Y))
    Y = dense(Y)
    lengths = np.linalg.norm(Y, axis=1)
    scaled = Y / np.where(lengths > 0.0, lengths, 1.0)[:, None]
    pivots, order = _by_qr(scaled.T)
    rows = np.sort(order[: len(pivots)][pivots > LEAST_PIVOT * pivots.max(initial=0.0)])
    _, columns = _by_qr(scaled[rows])
    return Echelon(rows, np.sort(columns[len(rows) :]))


def _by_qr(A: Matrix) -> tuple[Vector, IntVector]:
    """Sizes of the pivots of QR of A (r, k), and its permutation of the columns (k,); of equal ones the first is taken.

    Each column has a little less weight than the one before it: rounding would else choose among equal lengths.
    """
    if not A.size:
        return np.zeros(0), np.arange(A.shape[1])
    packed, order, *_ = dgeqp3(A * _LAST_WEIGHT ** (np.arange(A.shape[1]) / A.shape[1]))
    return np.abs(np.diagonal(packed)), np.asarray(order - 1, dtype=np.int64)


class _Pivot(NamedTuple):
    """A pivot column as a combination of other columns, which may have become pivots later."""

    number: int
    expression: dict[int, float]


def echelon(Y: SparseRows) -> Echelon:
    """A basis of the rows Y by sparse Gaussian elimination, row by row; each row is reduced by all pivots before it.

    Rows along a contact line touch few unknowns each. Their expressions stay short if two rules hold. A pivot is taken
    among the unknowns that no earlier row touches. Rows that touch the same unknowns follow each other: if all normal
    rows of a closed rim came first, they would link every unknown to the beginning of the rim, and each tangential row
    would have to be reduced all the way back.
    """
    pivots: dict[int, _Pivot] = {}
    independent, touched = list[int](), set[int]()
    for number in _neighbours_together(Y):
        part = slice(Y.indptr[number], Y.indptr[number + 1])
        row = dict(zip(Y.indices[part].tolist(), Y.data[part].tolist(), strict=True))
        new = set(row) - touched
        touched |= new
        row, size = _reduce(row, pivots)
        largest = max((abs(value) for value in row.values()), default=0.0)
        if largest <= _CANCELLATION * size or largest == 0.0:
            continue
        candidates = [column for column in row if column in new and abs(row[column]) >= _PIVOT_THRESHOLD * largest]
        pivot = max(candidates or row, key=lambda column: abs(row[column]))
        scale = -1.0 / row.pop(pivot)
        expression = {column: scale * value for column, value in row.items() if value != 0.0}
        pivots[pivot] = _Pivot(len(independent), expression)
        independent.append(number)
    free = np.setdiff1d(np.arange(Y.shape[1]), np.fromiter(pivots, dtype=np.int64, count=len(pivots)))
    return Echelon(np.sort(np.array(independent, dtype=np.int64)), free)


def _neighbours_together(Y: SparseRows) -> list[int]:
    """The order of the rows in which each comes after the first row that shares a column with it."""
    rows = np.repeat(np.arange(Y.shape[0]), np.diff(Y.indptr))
    first = np.full(Y.shape[1], Y.shape[0])
    np.minimum.at(first, Y.indices, rows)
    earliest = np.full(Y.shape[0], Y.shape[0])
    np.minimum.at(earliest, rows, first[Y.indices])
    return [int(row) for row in np.argsort(earliest, kind="stable")]


def _reduce(row: dict[int, float], pivots: dict[int, _Pivot]) -> tuple[dict[int, float], float]:
    """The row with every pivot column replaced by its expression, and the largest of the terms that may cancel.

    Pivot columns are replaced in the order in which they became pivots. As an expression has no earlier pivots, each
    column is replaced once. In another order columns would come back, in a closed chain of rows very often.
    """
    size = max(map(abs, row.values()), default=0.0)
    pivot_columns = [(pivots[column].number, column) for column in row if column in pivots]
    heapify(pivot_columns)
    while pivot_columns:
        _, column = heappop(pivot_columns)
        value = row.pop(column)
        for other, factor in pivots[column].expression.items():
            term = value * factor
            size = max(size, abs(term))
            if other not in row and other in pivots:
                heappush(pivot_columns, (pivots[other].number, other))
            row[other] = row.get(other, 0.0) + term
    return row, size
