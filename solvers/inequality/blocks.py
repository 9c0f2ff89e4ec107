"""Rows by trace coordinates: sparse where there are many, dense where there are few and sparse overhead counts."""

from typing import Any, TypeAlias

import numpy as np
from scipy.sparse import csr_matrix, diags, vstack

from solvers.basics.types import Matrix, Sparse, Vector

Rows: TypeAlias = Sparse | Matrix
"""Rows (q, k), a csr matrix or a dense array."""

_DENSE = 60_000  # entries up to which rows are kept dense


def are_few(rows: int, columns: int) -> bool:
    """Whether a matrix of this shape is kept dense."""
    return rows * columns <= _DENSE


def stored(rows: Sparse) -> Rows:
    """The rows as they are best kept."""
    return rows.toarray() if are_few(*rows.shape) else csr_matrix(rows)


def dense(rows: Rows) -> Matrix:
    """The rows as a dense array."""
    return rows if isinstance(rows, np.ndarray) else np.asarray(rows.toarray())


def scaled(factors: Vector, rows: Rows) -> Rows:
    """diag(factors) rows."""
    return factors[:, None] * rows if isinstance(rows, np.ndarray) else csr_matrix(diags(factors) @ rows)


def scaled_columns(rows: Rows, factors: Vector) -> Rows:
    """Rows diag(factors)."""
    return rows * factors if isinstance(rows, np.ndarray) else csr_matrix(rows @ diags(factors))


def stacked(parts: list[Rows]) -> Rows:
    """Rows on top of each other, all dense or all sparse."""
    if isinstance(parts[0], np.ndarray):
        return np.vstack(parts)
    sparse: Any = parts
    return csr_matrix(vstack(sparse))


def mapped(rows: Rows, matrix: Sparse) -> Rows:
    """Rows times a sparse matrix (k, u)."""
    return np.asarray(rows @ matrix) if isinstance(rows, np.ndarray) else csr_matrix(rows @ matrix)


def transposed(rows: Rows) -> Rows:
    """rowsᵀ (k, q)."""
    return rows.T if isinstance(rows, np.ndarray) else csr_matrix(rows.T)


def absolute_product(matrix: Sparse, vector: Vector) -> Vector:
    """|matrix| |vector| (q,) of a csc matrix (q, k): the size of the terms of matrix vector."""
    columns = np.repeat(np.abs(vector), np.diff(matrix.indptr))
    sums = np.bincount(matrix.indices, np.abs(matrix.data) * columns, matrix.shape[0])
    return np.asarray(sums, dtype=np.float64)


def add_product(target: Matrix, left: Rows, right: Rows) -> None:
    """Add left right to target (k, k)."""
    if isinstance(left, np.ndarray):
        target += left @ right
        return
    product: Any = csr_matrix(left @ right).tocoo()
    target[product.row, product.col] += product.data
