"""Rows by trace coordinates: sparse where there are many, dense where there are few and sparse overhead counts."""

from typing import Any, TypeAlias

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array, vstack

from solvers.basics.types import Matrix, Sparse, SparseRows, Vector

Rows: TypeAlias = SparseRows | Matrix
"""Rows (q, k), a csr array or a dense one."""

_DENSE = 60_000  # entries up to which rows are kept dense


def by_columns(matrix: Any) -> Sparse:
    """A matrix in compressed columns, float64, with 32-bit indices where they suffice; SciPy would keep wider ones.

    A matrix that is so already is returned itself: problems of a sequence are known to share it.
    """
    kept = isinstance(matrix, csc_array) and matrix.dtype == np.float64
    columns = matrix if kept else csc_array(matrix, dtype=np.float64)
    if columns.indices.dtype == np.int32 or max(columns.nnz, *columns.shape) > np.iinfo(np.int32).max:
        return columns
    indices, starts = columns.indices.astype(np.int32), columns.indptr.astype(np.int32)
    return csc_array((columns.data, indices, starts), columns.shape)


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


def stacked(parts: list[Rows]) -> Rows:
    """Rows on top of each other, all dense or all sparse."""
    sparse = [part for part in parts if not isinstance(part, np.ndarray)]
    return csr_array(vstack(sparse)) if sparse else np.vstack([dense(part) for part in parts])


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


def add_product(target: Matrix, left: Rows, right: Rows) -> None:
    """Add left right to target (k, k)."""
    if isinstance(left, np.ndarray):
        target += left @ right
        return
    product = csr_array(left @ right).tocoo()
    target[product.row, product.col] += product.data
