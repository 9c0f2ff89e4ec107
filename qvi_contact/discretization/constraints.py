"""Sparse solution of linear conditions C u = d, one row after the other.

Each row is written in the degrees of freedom that are still free, one of them, its pivot, is solved for, and so on. How
many others the pivots depend on is a matter of the order of rows: along a line of edges, each one step further, every
row brings degrees of freedom of its own and is solved for one of them. Rows that nothing is left of show whether d is
consistent.
"""

from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray

_DEPENDENT: Final = 1e-9  # what is left of a row, relative to its largest entry, below which it follows from the others
_WORTHY: Final = 1e-2  # an entry, relative to the largest, that makes a good pivot

_Expression: TypeAlias = tuple[dict[int, float], float]  # Σ factor u + constant


@dataclass(frozen=True, eq=False)
class Solution:
    """All degrees of freedom as an affine function of the kept ones: u = basis z + particular.

    Attributes
    ----------
    kept : (n,) int array
        Degrees of freedom that are unknowns; z are their values.
    basis : (N, n) sparse array
        The identity on kept ones.
    particular : (N,) array
        Zero for kept ones.
    misfit : (r,) array
        What d misses in the rows that follow from the others.

    """

    kept: IntArray
    basis: sparse.csr_array
    particular: FloatArray
    misfit: FloatArray


def solve_conditions(C: sparse.csr_array, d: FloatArray, age: IntArray) -> Solution:
    """Solve C u = d for as many degrees of freedom as there are independent rows.

    Parameters
    ----------
    C : (m, N) sparse array
        Rows in the order in which they are taken; degrees of freedom in units that make its entries comparable.
    d : (m,) array
        Right-hand side.
    age : (N,) int array
        Of the possible pivots of a row those with the largest number are preferred, of these the largest entry.

    """
    solved: dict[int, _Expression] = {}
    misfit = list[float]()
    starts, columns, data, right = C.indptr.tolist(), C.indices.tolist(), C.data.tolist(), d.tolist()
    for row, value in enumerate(right):
        entries = slice(starts[row], starts[row + 1])
        given = dict(zip(columns[entries], data[entries], strict=True))
        terms, constant = _reduced(given, -value, solved)
        left = max(map(abs, terms.values()), default=0.0)
        if left <= _DEPENDENT * max(map(abs, given.values()), default=0.0):
            misfit.append(-constant)
            continue
        worthy = [column for column, factor in terms.items() if abs(factor) >= _WORTHY * left]
        pivot = max(worthy, key=lambda column: (age[column], abs(terms[column]), -column))
        factor = -1.0 / terms.pop(pivot)
        solved[pivot] = {column: factor * value for column, value in terms.items()}, factor * constant
    return _assembled(solved, C.shape[1], np.array(misfit))


def _reduced(terms: dict[int, float], constant: float, solved: dict[int, _Expression]) -> _Expression:
    """The expression with everything replaced that is solved for, until nothing is left to replace."""
    result, pending = dict[int, float](), list(terms.items())
    while pending:
        column, factor = pending.pop()
        expression = solved.get(column)
        if expression is None:
            result[column] = result.get(column, 0.0) + factor
            continue
        inner, shift = expression
        constant += factor * shift
        pending += [(other, factor * value) for other, value in inner.items()]
    return {column: factor for column, factor in result.items() if factor != 0.0}, constant


def _assembled(solved: dict[int, _Expression], count: int, misfit: FloatArray) -> Solution:
    """Basis and particular part. The latest pivots depend on kept ones only, earlier ones perhaps on them."""
    particular, rows, columns, data = np.zeros(count), list[int](), list[int](), list[float]()
    for pivot in reversed(list(solved)):
        terms, constant = solved[pivot] = _reduced(*solved[pivot], solved)
        particular[pivot] = constant
        rows += [pivot] * len(terms)
        columns += terms.keys()
        data += terms.values()
    free = np.ones(count, dtype=bool)
    free[list(solved)] = False
    kept, number = np.flatnonzero(free), np.cumsum(free) - 1
    at = (np.concatenate([kept, rows]).astype(np.int64), np.concatenate([kept, columns]).astype(np.int64))
    values = np.concatenate([np.ones(len(kept)), data])
    basis = sparse.csr_array((values, (at[0], number[at[1]])), shape=(count, len(kept)))
    return Solution(kept, basis, particular, misfit)
