"""Orders of elimination: by minimum degree on groups of unknowns with the same neighbours, or by places."""

from collections.abc import Callable, Iterator
from typing import TypeAlias

import numpy as np
from scipy.sparse import csc_array

from solvers.basics.types import BoolVector, IntVector, Matrix, Sparse

MinimumDegree: TypeAlias = Callable[[Sparse], IntVector]
"""A symmetric pattern (m, m) with full diagonal → its elimination order, a permutation of 0 … m − 1."""

_LEAF = 30  # unknowns that are not parted any more; from 20 to 60 times hardly differ
_UPPER, _TOUCHING = 1, 2  # marks of unknowns


def interface_last(
    K: Sparse, interface: IntVector, minimum_degree: MinimumDegree, places: Matrix | None = None
) -> IntVector:
    """A permutation of 0 … n − 1: the interior of K (n, n) by nested dissection of places (n, 2), then Γ.

    Without places the interior is in the order of minimum degree.

    Unknowns of a mesh node share their columns' pattern and are eliminated together in any good order, so the order is
    sought for the graph of such groups, which has a fraction of the entries.
    """
    interior, graph, group = interior_groups(K, interface)
    position = np.empty(graph.shape[0], dtype=np.int64)
    if places is None:
        order = minimum_degree(graph)
    else:
        of_groups = np.empty((graph.shape[0], 2))
        of_groups[group] = places[interior]  # of one of its unknowns, which are at one vertex or edge
        order = nested_dissection(of_groups, graph.indptr.astype(np.int64), graph.indices.astype(np.int64))
    position[order] = np.arange(graph.shape[0])
    return np.concatenate([interior[np.argsort(position[group], kind="stable")], interface])


def interior_groups(K: Sparse, interface: IntVector) -> tuple[IntVector, Sparse, IntVector]:
    """The interior of K (n, n), the pattern of its groups of unknowns with the same neighbours, the group of each."""
    interior = np.setdiff1d(np.arange(K.shape[0]), interface)
    return interior, *_graph_of_groups(_pattern(K)[interior][:, interior] if len(interface) else _pattern(K))


def nested_dissection(places: Matrix, starts: IntVector, columns: IntVector) -> IntVector:
    """A permutation of 0 … n − 1 for a symmetric pattern in compressed rows whose unknowns are at places (n, 2).

    Unknowns are halved across the longer side of where they are; those of one half that neighbour the other come last,
    and each half is halved again. On a grid what comes last is a line of it.

    Source: A. George, Nested dissection of a regular finite element mesh, SIAM J. Numer. Anal. 10 (1973).
    """
    return np.concatenate(list(_Dissection(places, starts, columns).parts(np.arange(len(places)))))


class _Dissection:
    """Unknowns of a pattern, halved by their places."""

    def __init__(self, places: Matrix, starts: IntVector, columns: IntVector) -> None:
        self._places, self._columns = places, columns
        self._starts, self._counts = np.asarray(starts[:-1], dtype=np.int64), np.diff(starts)
        self._side = np.zeros(len(places), dtype=np.int8)

    def parts(self, unknowns: IntVector) -> Iterator[IntVector]:
        """The unknowns in the order in which they are eliminated."""
        first = self._lower(unknowns) if len(unknowns) > _LEAF else np.ones(len(unknowns), dtype=bool)
        if first.all():
            yield unknowns
            return
        lower, upper, between = self._parted(unknowns[first], unknowns[~first])
        yield from self.parts(lower)
        yield from self.parts(upper)
        yield between

    def _lower(self, unknowns: IntVector) -> BoolVector:
        """Which are in the lower half; all of them if they are at one place."""
        places = self._places[unknowns]
        along = places[:, np.argmax(np.ptp(places, axis=0))]
        middle, least, most = np.median(along), along.min(), along.max()
        if least == most:
            return np.ones(len(unknowns), dtype=bool)
        return np.asarray(along <= middle if middle < most else along < most)

    def _parted(self, lower: IntVector, upper: IntVector) -> tuple[IntVector, IntVector, IntVector]:
        """What is left of either half without those of one of them that neighbour the other, and these, the fewer."""
        self._side[upper] = _UPPER
        rows, columns = self._entries(lower)
        across = self._side[columns] == _UPPER
        self._side[upper] = 0
        ends = rows[across], columns[across]
        for end in ends:
            self._side[end] = _TOUCHING
        touching = [self._side[half] == _TOUCHING for half in (lower, upper)]
        for end in ends:
            self._side[end] = 0
        if touching[0].sum() <= touching[1].sum():
            return lower[~touching[0]], upper, lower[touching[0]]
        return lower, upper[~touching[1]], upper[touching[1]]

    def _entries(self, unknowns: IntVector) -> tuple[IntVector, IntVector]:
        """Rows and columns of all entries in the rows of these unknowns."""
        counts = self._counts[unknowns]
        skipped = self._starts[unknowns] - (np.cumsum(counts) - counts)
        return np.repeat(unknowns, counts), self._columns[np.repeat(skipped, counts) + np.arange(counts.sum())]


def _pattern(K: Sparse) -> Sparse:
    return csc_array((np.ones(K.nnz, dtype=np.int8), K.indices, K.indptr), shape=K.shape)


def _graph_of_groups(pattern: Sparse) -> tuple[Sparse, IntVector]:
    """(pattern (m, m) of the groups, group (n,) of each unknown): a group has equal columns in the pattern (n, n)."""
    mark = np.random.default_rng(0).integers(1, 2**62, pattern.shape[0])  # equal sums: equal columns (modulo 2⁶⁴)
    sums = pattern.T @ mark
    first, group = np.unique(sums, return_index=True, return_inverse=True)[1:]
    return pattern[first][:, first], np.asarray(group, dtype=np.int64)
