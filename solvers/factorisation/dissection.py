"""Sparse factorisations by nested dissection with dense fronts: Cholesky for K, LU for unsymmetric matrices.

Parts of a body meet at separators, which are eliminated after them, and each is one dense front of unknowns: LAPACK
does all but the additions.

Source: J. Liu, The multifrontal method for sparse matrix solution: theory and practice, SIAM Rev. 34 (1992).
"""

from collections.abc import Iterator
from itertools import pairwise
from time import perf_counter
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse import csc_array, csr_array

from solvers.basics.types import IntVector, Matrix, Sparse, Vector
from solvers.factorisation.base import (
    FactorisationError,
    Front,
    Fronts,
    check_pivots,
    eliminated,
    limited_blas,
    symmetric,
)


class Multifrontal(Fronts):
    """K_II = Uᵀ U for K (n, n), n > k, in compressed columns, by `nested_dissection`."""

    backend = "multifrontal"

    def __init__(self, K: Sparse, interface: IntVector, places: Matrix | None = None) -> None:
        self.interface, self.size = interface, K.shape[0]
        start, diagonal = perf_counter(), K.diagonal()
        order, starts = interface_last(K, interface, places)
        analysed = perf_counter()
        with limited_blas(1):
            self._fronts, self.schur = _eliminated(K, order, starts, self.backend)
        pivots = np.concatenate([front.head.diagonal() for front in self._fronts]) ** 2
        check_pivots(pivots, diagonal[order[: len(pivots)]], self.backend, self.size)
        self.seconds = {"analysis": analysed - start, "numeric": perf_counter() - analysed}


def _eliminated(K: Sparse, order: IntVector, starts: IntVector, backend: str) -> tuple[list[Front], Matrix]:
    """Fronts of the unknowns order[starts[i] : starts[i + 1]], and S (k, k) of those from the last start on.

    Of symmetric matrices, stored by rows, the lower triangle is used: to LAPACK the upper one, by columns.
    """
    columns, numbers = K[:, order], np.arange(len(order), dtype=K.indices.dtype)
    position = np.empty_like(numbers)
    position[order] = numbers
    rows, column = position[columns.indices], np.repeat(numbers, np.diff(columns.indptr))
    lower = rows >= column
    rows, column, data = rows[lower], column[lower], columns.data[lower]
    fronts, waiting = list[Front](), dict[int, Matrix]()
    for i, part in enumerate(parts(np.append(starts, len(order)), column, rows)):
        front, count = np.zeros((part.size, part.size)), part.end - part.first
        front[part.places, column[part.entries] - part.first] = data[part.entries]
        for child, where in part.arriving:
            _add(front, where, waiting.pop(child))
        if i == len(starts) - 1:
            break
        head, tail, left = eliminated(
            front[:count, :count].T, front[count:, :count].T, front[count:, count:].T, backend
        )
        fronts.append(Front(order[part.first : part.end], order[part.later], head, tail))
        waiting[i] = left.T
    return fronts, symmetric(front.T)


def _add(front: Matrix, where: IntVector, left: Matrix) -> None:
    """Add left (i, i) to front[where][:, where], runs of columns and of rows at once."""
    begins = np.flatnonzero(np.diff(where, prepend=-2) != 1).tolist()
    runs = [(first, end, int(where[first])) for first, end in pairwise([*begins, len(where)])]
    spread = np.zeros((len(where), len(front)))
    for first, end, place in runs:
        spread[:, place : place + end - first] = left[:, first:end]
    for first, end, place in runs:
        front[place : place + end - first] += spread[first:end]


class Part(NamedTuple):
    """A front as it is known before its numbers: unknowns first to end of the order, and `later` ones that stay."""

    first: int
    end: int
    later: IntVector
    entries: slice  # those that come in here
    places: IntVector  # where in the front what they touch is
    arriving: list[tuple[int, IntVector]]  # numbers of fronts before, and where in this one lies what they leave

    @property
    def size(self) -> int:
        """How many unknowns it has."""
        return self.end - self.first + len(self.later)


def parts(starts: IntVector, owner: NDArray[np.integer], touched: NDArray[np.integer]) -> Iterator[Part]:
    """The fronts of an elimination of unknowns that are in order already; one begins at each start but the last.

    Each entry comes in at the front of its owner, in the order of these fronts, and touches another unknown. A front is
    the sum of its entries and of what fronts before leave for it. That is on unknowns of this front and of later ones,
    and waits at the first of them that comes.
    """
    number, local = np.repeat(np.arange(len(starts) - 1), np.diff(starts)), np.empty(starts[-1], dtype=np.int64)
    coming = np.searchsorted(number[owner], np.arange(len(starts))).tolist()
    waiting: list[list[tuple[int, IntVector]]] = [[] for _ in starts]
    for i, (first, end) in enumerate(pairwise(starts.tolist())):
        entries, arrived, waiting[i] = slice(coming[i], coming[i + 1]), waiting[i], []
        later = np.unique(np.concatenate([touched[..., entries].ravel(), *(left for _, left in arrived)]))
        later = later[later >= end]
        local[first:end], local[later] = np.arange(end - first), np.arange(end - first, end - first + len(later))
        arriving = [(child, local[left]) for child, left in arrived]
        yield Part(first, end, later, entries, local[touched[..., entries]], arriving)
        if len(later):
            waiting[number[later[0]]].append((i, later))


# Orders of elimination.


_LEAF: Final = 50  # unknowns that are not parted any more; from 30 to 80 times hardly differ


def interface_last(K: Sparse, interface: IntVector, places: Matrix | None = None) -> tuple[IntVector, IntVector]:
    """A permutation of 0 … n − 1: the interior of K (n, n) by nested dissection of places (n, d), then Γ.

    Also where in it the parts start that are eliminated at once, and last where Γ does.

    Unknowns of a mesh node share their columns' pattern and are eliminated together in any good order, so the order is
    sought for the graph of such groups, which has a fraction of the entries.
    """
    interior = np.setdiff1d(np.arange(K.shape[0]), interface)
    pattern: Sparse = csc_array((np.ones(K.nnz, dtype=np.int8), K.indices, K.indptr), shape=K.shape)
    pattern = pattern[interior][:, interior] if len(interface) else pattern
    mark = np.random.default_rng(0).integers(1, 2**62, len(interior))  # equal sums: equal columns (modulo 2⁶⁴)
    first, group = np.unique(pattern.T @ mark, return_index=True, return_inverse=True)[1:]
    graph = pattern[first][:, first]
    position = np.empty(graph.shape[0], dtype=np.int64)
    of_groups = None
    if places is not None:
        of_groups = np.empty((graph.shape[0], places.shape[1]))
        of_groups[group] = places[interior]  # of one of its unknowns, which are at one vertex or edge
    order, parts = nested_dissection(of_groups, graph.indptr.astype(np.int64), graph.indices.astype(np.int64))
    position[order] = np.arange(graph.shape[0])
    before = np.concatenate([[0], np.cumsum(np.bincount(position[group], minlength=len(position)))])
    return np.concatenate([interior[np.argsort(position[group], kind="stable")], interface]), before[parts]


def nested_dissection(places: Matrix | None, starts: IntVector, columns: IntVector) -> tuple[IntVector, IntVector]:
    """A permutation of 0 … n − 1 for a symmetric pattern in compressed rows whose unknowns are at places (n, d).

    Also where in it the parts start that are not parted further or are between two others, and n. Without places
    unknowns are where their distances from a few of them say, by links of the pattern.

    Unknowns are halved across the longer side of where they are; those of one half that neighbour the other, the fewer
    of the two, come last, and each half is halved again. On a grid what comes last is a line of it. All parts of one
    size are halved at once.

    Source: A. George, Nested dissection of a regular finite element mesh, SIAM J. Numer. Anal. 10 (1973).
    """
    n = len(starts) - 1
    if places is None:
        places = _distances(starts, columns) if n else np.empty((0, 1))
    parts = [np.array([n])]
    order, unknowns = np.empty(n, dtype=np.int64), np.arange(n)  # the latter part by part
    counts, first = np.array([n]), np.zeros(1, dtype=np.int64)  # of the parts, and where they begin in the order
    ends = np.repeat(unknowns, np.diff(starts)), np.asarray(columns)  # of all links inside parts
    side = np.empty(n, dtype=np.int64)
    while len(unknowns):
        begins, number = np.cumsum(counts) - counts, np.repeat(np.arange(len(counts)), counts)
        where = places[unknowns]
        least, most = (bound.reduceat(where, begins) for bound in (np.minimum, np.maximum))
        axis = np.argmax(most - least, axis=1)
        least, most = (bound[np.arange(len(axis)), axis] for bound in (least, most))
        along = where[np.arange(len(where)), axis[number]]
        ranked = along[np.lexsort((along, number))]
        middle = 0.5 * (ranked[begins + (counts - 1) // 2] + ranked[begins + counts // 2])
        lower = np.where((middle < most)[number], along <= middle[number], along < most[number])
        whole = (counts <= _LEAF) | (least == most)  # parted no more
        side[unknowns] = np.where(whole[number], -1, 2 * number + ~lower)
        rows, others = side[ends[0]], side[ends[1]]
        across = (rows >= 0) & (rows % 2 == 0) & (others == rows + 1)
        touching = np.zeros(n, dtype=np.bool_)
        touching[ends[0][across]] = touching[ends[1][across]] = True
        touching = touching[unknowns]
        found = np.bincount(number[touching & lower], minlength=len(counts))
        fewer = 2 * found <= np.bincount(number[touching], minlength=len(counts))
        last = whole[number] | (touching & (lower == fewer[number]))
        kind = 3 * number + np.where(last, 2, ~lower)  # lower, upper, what comes last
        sizes = np.bincount(kind, minlength=3 * len(counts)).reshape(-1, 3)
        firsts = (first[:, None] + np.cumsum(sizes, axis=1) - sizes).ravel()
        grouped = np.argsort(kind, kind="stable")
        rank = np.arange(len(kind)) - (np.cumsum(sizes) - sizes.ravel())[kind[grouped]]
        done = last[grouped]
        order[firsts[kind[grouped[done]]] + rank[done]] = unknowns[grouped[done]]
        parts.append(firsts[2::3][sizes[:, 2] > 0])
        side[unknowns] = np.where(last, -1, kind)
        inside = (side[ends[0]] >= 0) & (side[ends[0]] == side[ends[1]])
        ends = ends[0][inside], ends[1][inside]
        unknowns = unknowns[grouped[~done]]
        left = np.flatnonzero(sizes.ravel() * (np.arange(sizes.size) % 3 < 2))
        counts, first = sizes.ravel()[left], firsts[left]
    return order, np.sort(np.concatenate(parts))


def _distances(starts: IntVector, columns: IntVector) -> Matrix:
    """(n, 4) distances from three unknowns far from each other, and numbers; those that many know are no links."""
    from scipy.sparse.csgraph import connected_components, dijkstra  # what few solves need is not loaded at the start

    n, counts = len(starts) - 1, np.diff(starts)
    few = counts <= 16.0 + 10.0 * np.sqrt(n)
    links = csr_array((np.repeat(few, counts) & few[columns], columns, starts), (n, n), copy=True)
    links.eliminate_zeros()
    part = connected_components(links, directed=False)[1]
    ends = np.unique(part, return_index=True)[1]
    # Parts without a link are joined, one to the next.
    links = links + csr_array((np.ones(len(ends) - 1), (ends[:-1], ends[1:])), (n, n))
    found = np.empty((n, 0))
    for _ in range(3):
        farthest = int(np.argmax(found.min(axis=1, initial=n)))
        away: Any = dijkstra(links, directed=False, indices=np.array(farthest), unweighted=True)
        found = np.column_stack([found, away])
    return np.column_stack([found, np.arange(n) / n])


# H = L U of unsymmetric matrices that share one symmetric pattern, as Newton's method meets them.
#
# The order and what each front consists of are found once. Pivots are sought within the front.


class MultifrontalLU:
    """One matrix H (n, n) after the other, in compressed rows of the given symmetric pattern; one thread."""

    backend = "multifrontal"

    def __init__(self, starts: IntVector, columns: IntVector, places: Matrix | None = None) -> None:
        n = len(starts) - 1
        pattern: Sparse = csc_array((np.ones(len(columns), dtype=np.int8), columns, starts), (n, n))
        self._order, begins = interface_last(pattern, np.zeros(0, dtype=np.int64), places)
        position, number = np.empty(n, dtype=np.int64), np.repeat(np.arange(len(begins) - 1), np.diff(begins))
        position[self._order] = np.arange(n)
        rows, across = position[np.repeat(np.arange(n), np.diff(starts))], position[columns]
        self._sorted = np.argsort(number[np.minimum(rows, across)], kind="stable")
        rows, across = rows[self._sorted], across[self._sorted]
        self._parts = [
            part._replace(places=part.places[0] * part.size + part.places[1])
            for part in parts(begins, np.minimum(rows, across), np.stack([rows, across]))
        ]
        self._factors: list[tuple[Matrix, IntVector, Matrix, Matrix]] = []

    def factorise(self, values: Vector) -> None:
        """Factorise H, its entries row by row; solves are by this matrix from now on.

        Raises `FactorisationError` where H is singular.
        """
        values, self._factors = values[self._sorted], []
        left: dict[int, Matrix] = {}  # what fronts leave for later ones
        with limited_blas(1):
            for i, part in enumerate(self._parts):
                front, count = np.zeros((part.size, part.size)), part.end - part.first
                front.ravel()[part.places] = values[part.entries]
                for child, where in part.arriving:
                    _add(front, where, left.pop(child))
                head, pivots, info = dgetrf(front[:count, :count])
                if info > 0:
                    raise FactorisationError("singular", self.backend, "a pivot is zero")
                below, beside = front[count:, :count].copy(), front[:count, count:]
                if len(part.later):
                    beside = dgetrs(head, pivots, beside)[0]
                    left[i] = front[count:, count:]
                    left[i] -= below @ beside
                self._factors.append((head, pivots, below, beside))

    def solve(self, right: Vector) -> Vector:
        """H⁻¹ right (n,)."""
        x, found = right[self._order], np.empty_like(right)
        with limited_blas(1):
            for part, (head, pivots, below, _) in zip(self._parts, self._factors, strict=True):
                own = slice(part.first, part.end)
                x[own] = dgetrs(head, pivots, x[own])[0]
                x[part.later] -= below @ x[own]
            for part, (*_, beside) in zip(reversed(self._parts), reversed(self._factors), strict=True):
                x[part.first : part.end] -= beside @ x[part.later]
        found[self._order] = x
        return found
