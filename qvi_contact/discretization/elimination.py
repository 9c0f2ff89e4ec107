"""Linear conditions C u = d on all degrees of freedom, and their solution u = B z + u₀ with the unknowns z.

Conditions are solved one row after the other. Each row is written in the degrees of freedom that are still free, one of
them, its pivot, is solved for, and so on. How many others the pivots depend on is a matter of the order of rows: along
a line of edges, each one step further, every row brings degrees of freedom of its own and is solved for one of them.
Rows that nothing is left of show whether d is consistent.

In `docs/theory.md`: (D2).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, TypeAlias

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.errors import QVIError

_SAME = 1e-13  # relative difference of two rows that is rounding

_DEPENDENT: Final = 1e-9  # what is left of a row, relative to its largest entry, below which it follows from the others
_WORTHY: Final = 1e-2  # an entry, relative to the largest, that makes a good pivot
_Expression: TypeAlias = tuple[dict[int, float], float]  # Σ factor u + constant


class UnbalancedLoadError(QVIError):
    """The prescribed tractions on a closed part of the boundary are not in equilibrium.

    Attributes
    ----------
    imbalance : float
        The largest resultant force or moment that is left, dimensionless.

    """

    def __init__(self, imbalance: float) -> None:
        self.imbalance = imbalance
        super().__init__(f"closed traction boundary out of balance by {imbalance:.3g} (dimensionless)")

    def __reduce__(self) -> tuple[type["UnbalancedLoadError"], tuple[float]]:
        """For pickles, as worker processes send it."""
        return type(self), (self.imbalance,)


@dataclass(frozen=True)
class Elimination:
    """All degrees of freedom u as an affine function of the kept ones z: u = basis z + particular.

    Attributes
    ----------
    kept : (N,) bool array
        Degrees of freedom that are unknowns; z are their values.
    slaves : (m,) int array
        The other degrees of freedom, those outside the body left out.
    slave_basis : (m, n) sparse array
        Their rows of the basis.
    particular : (N,) array
        Zero for kept ones and outside the body.
    source : Elimination, optional
        The one whose basis this one has.

    """

    kept: BoolArray
    slaves: IntArray
    slave_basis: sparse.csr_array
    particular: FloatArray
    source: "Elimination | None" = None

    def sharing(self, other: "Elimination") -> "Elimination":
        """Itself, with the very basis of another one if they differ in `particular` only.

        Rows of the basis that differ by rounding are the same.
        """
        mine, its = self.slave_basis, other.slave_basis
        same = (
            np.array_equal(self.kept, other.kept)
            and np.array_equal(self.slaves, other.slaves)
            and mine.shape == its.shape
            and np.array_equal(mine.indptr, its.indptr)
            and np.array_equal(mine.indices, its.indices)
            and np.allclose(mine.data, its.data, rtol=_SAME, atol=0.0)
        )
        if not same:
            return self
        source = other if other.source is None else other.source
        return replace(other, particular=self.particular, source=source)

    @cached_property
    def basis(self) -> sparse.csr_array:
        """The whole basis B, the identity on kept degrees of freedom, shape (N, n)."""
        if self.source is not None:
            return self.source.basis
        free = np.flatnonzero(self.kept)
        count = len(free)
        slaves = self.slave_basis.tocoo()
        rows = np.concatenate([free, self.slaves[slaves.row]])
        columns = np.concatenate([np.arange(count), slaves.col])
        data = np.concatenate([np.ones(count), slaves.data])
        return sparse.csr_array((data, (rows, columns)), shape=(len(self.kept), count))


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of a matrix, each with l entries at most.

    Attributes
    ----------
    columns, values : (m, l) arrays
        Entries of each row, at different columns; zeros are none.

    """

    columns: IntArray
    values: FloatArray

    def take(self, index: IntArray) -> "Rows":
        """Some of them."""
        return Rows(self.columns[index], self.values[index])

    def __iter__(self) -> Iterator[dict[int, float]]:
        """The entries of each by column."""
        for columns, values in zip(self.columns.tolist(), self.values.tolist(), strict=True):
            yield {column: value for column, value in zip(columns, values, strict=True) if value != 0.0}


def stacked(parts: Sequence[Rows], columns: int) -> sparse.csr_array:
    """Rows on top of each other as a matrix with so many columns, zeros left out."""
    if not parts:
        return sparse.csr_array((0, columns))
    values, indices = (np.concatenate([getattr(part, name) for part in parts]) for name in ("values", "columns"))
    kept = values != 0.0
    starts = np.concatenate([[0], np.cumsum(kept.sum(axis=1))])
    return sparse.csr_array((values[kept], indices[kept], starts), shape=(len(values), columns))


def solve_conditions(C: Rows, d: FloatArray, age: IntArray) -> tuple[Elimination, FloatArray]:
    """Solve C u = d for as many degrees of freedom as there are independent rows.

    Parameters
    ----------
    C : Rows of (m, N)
        Rows in the order in which they are taken; degrees of freedom in units that make its entries comparable.
    d : (m,) array
        Right-hand side.
    age : (N,) int array
        Of the possible pivots of a row those with the largest number are preferred, of these the largest entry.

    Returns
    -------
    Elimination, (r,) array
        All degrees of freedom as an affine function of the kept ones; what d misses in the rows that follow from the
        others.

    """
    solved: dict[int, _Expression] = {}
    misfit, ages = list[float](), age.tolist()
    for given, value in zip(C, d.tolist(), strict=True):
        terms, constant = _reduced(given, -value, solved)
        left = max(map(abs, terms.values()), default=0.0)
        if left <= _DEPENDENT * max(map(abs, given.values()), default=0.0):
            misfit.append(-constant)
            continue
        worthy = [column for column, factor in terms.items() if abs(factor) >= _WORTHY * left]
        pivot = max(worthy, key=lambda column: (ages[column], abs(terms[column]), -column))
        factor = -1.0 / terms.pop(pivot)
        solved[pivot] = {column: factor * value for column, value in terms.items()}, factor * constant
    return _assembled(solved, len(ages)), np.array(misfit)


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


def _assembled(solved: dict[int, _Expression], count: int) -> Elimination:
    """Basis and particular part. The latest pivots depend on kept ones only, earlier ones perhaps on them."""
    particular, lengths, columns, data = np.zeros(count), list[int](), list[int](), list[float]()
    slaves = sorted(solved)
    for pivot in reversed(list(solved)):
        solved[pivot] = _reduced(*solved[pivot], solved)
    for pivot in slaves:
        terms, particular[pivot] = solved[pivot]
        lengths.append(len(terms))
        columns += terms.keys()
        data += terms.values()
    kept = np.ones(count, dtype=bool)
    kept[slaves] = False
    number = np.cumsum(kept) - 1
    indices, starts = number[np.array(columns, dtype=np.int64)], np.concatenate([[0], np.cumsum(lengths)])
    basis = sparse.csr_array((np.array(data), indices, starts), shape=(len(slaves), int(kept.sum())))
    return Elimination(kept, np.array(slaves, dtype=np.int64), basis, particular)


@dataclass(frozen=True, eq=False)
class EdgeFunctionals:
    """The same r linear functionals on each of n edges.

    Attributes
    ----------
    columns : (n, l) int array
        Degrees of freedom of each edge: (Φ, Φ_x, Φ_y) at its first end, at its second, and its own.
    values : (n, r, l) array
        The functionals.
    size : int
        Degrees of freedom N of the body.

    """

    columns: IntArray
    values: FloatArray
    size: int

    def mapped(self, map_: FloatArray) -> "EdgeFunctionals":
        """Others, a map (q, r) of these on every edge or (n, q, r) on each."""
        return EdgeFunctionals(self.columns, np.asarray(map_ @ self.values), self.size)

    def apply(self, u: FloatArray) -> FloatArray:
        """Their values (n, r) of degrees of freedom u (N,)."""
        return np.asarray((self.values @ u[self.columns][:, :, None])[:, :, 0])

    def adjoint(self, weights: FloatArray) -> FloatArray:
        """The sum of weights (n, r) times the functionals, a vector over all degrees of freedom (N,)."""
        sums = (weights[:, None, :] @ self.values)[:, 0]
        return np.asarray(np.bincount(self.columns.ravel(), sums.ravel(), self.size), dtype=np.float64)

    def rows(self) -> Rows:
        """The functionals as n r rows, edge by edge."""
        n, r, width = self.values.shape
        return Rows(np.repeat(self.columns, r, axis=0), self.values.reshape(n * r, width))

    def matrix(self) -> sparse.csr_array:
        """The functionals as rows, edge by edge, without zeros; shape (n r, N)."""
        return stacked([self.rows()], self.size)
