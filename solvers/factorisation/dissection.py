"""Sparse factorisations by nested dissection with dense fronts: Cholesky for K, LU for unsymmetric matrices.

Parts of the body are eliminated before the separators at which they meet. Each part and each separator is a dense front
of unknowns, on which LAPACK does all operations but the additions.

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
    """Fronts of the unknowns order[starts[i] : starts[i + 1]], and S (k, k) of the unknowns from the last start on.

    The lower triangle of symmetric matrices is stored by rows, which to LAPACK is the upper triangle by columns.
    """
    columns, numbers = K[:, order], np.arange(len(order), dtype=K.indices.dtype)
    position = np.empty_like(numbers)
    position[order] = numbers
    rows, column = position[columns.indices], np.repeat(numbers, np.diff(columns.indptr))
    lower = rows >= column
    rows, column, data = rows[lower], column[lower], columns.data[lower]
    fronts, updates = list[Front](), dict[int, Matrix]()  # Schur complements for later fronts
    for i, part in enumerate(parts(np.append(starts, len(order)), column, rows)):
        front, count = np.zeros((part.size, part.size)), part.end - part.first
        front[part.places, column[part.entries] - part.first] = data[part.entries]
        for child, where in part.arriving:
            _add(front, where, updates.pop(child))
        if i == len(starts) - 1:
            break
        head, tail, update = eliminated(
            front[:count, :count].T, front[count:, :count].T, front[count:, count:].T, backend
        )
        fronts.append(Front(order[part.first : part.end], order[part.later], head, tail))
        updates[i] = update.T
    return fronts, symmetric(front.T)


def _add(front: Matrix, where: IntVector, update: Matrix) -> None:
    """Add update (i, i) to front[where][:, where], by runs of consecutive columns, then of rows."""
    begins = np.flatnonzero(np.diff(where, prepend=-2) != 1).tolist()
    runs = [(first, end, int(where[first])) for first, end in pairwise([*begins, len(where)])]
    spread = np.zeros((len(where), len(front)))
    for first, end, place in runs:
        spread[:, place : place + end - first] = update[:, first:end]
    for first, end, place in runs:
        front[place : place + end - first] += spread[first:end]


class Part(NamedTuple):
    """The symbolic data of a front."""

    first: int
    end: int
    """The front eliminates the unknowns first to end − 1 of the order."""
    later: IntVector  # its other unknowns, which later fronts eliminate
    entries: slice  # the entries of the matrix that are added to this front
    places: IntVector  # their positions in the front
    arriving: list[tuple[int, IntVector]]  # earlier fronts whose updates are added, and the positions of these

    @property
    def size(self) -> int:
        """Number of unknowns of the front."""
        return self.end - self.first + len(self.later)


def parts(starts: IntVector, owner: NDArray[np.integer], touched: NDArray[np.integer]) -> Iterator[Part]:
    """The fronts of an elimination of unknowns that are in their order; one begins at each start but the last.

    The matrix has entries for the unknowns `owner` and `touched`, sorted by the front that eliminates the owner; they
    are added to that front. The update of a front is its Schur complement on the `later` unknowns. It is added to the
    front that eliminates the first of them.
    """
    number, local = np.repeat(np.arange(len(starts) - 1), np.diff(starts)), np.empty(starts[-1], dtype=np.int64)
    first_entries = np.searchsorted(number[owner], np.arange(len(starts))).tolist()
    waiting: list[list[tuple[int, IntVector]]] = [[] for _ in starts]  # updates for each front
    for i, (first, end) in enumerate(pairwise(starts.tolist())):
        entries, arrived, waiting[i] = slice(first_entries[i], first_entries[i + 1]), waiting[i], []
        later = np.unique(np.concatenate([touched[..., entries].ravel(), *(left for _, left in arrived)]))
        later = later[later >= end]
        local[first:end], local[later] = np.arange(end - first), np.arange(end - first, end - first + len(later))
        arriving = [(child, local[left]) for child, left in arrived]
        yield Part(first, end, later, entries, local[touched[..., entries]], arriving)
        if len(later):
            waiting[number[later[0]]].append((i, later))


# Orders of elimination.

_LEAF: Final = 50  # unknowns of a part that is not divided; the time is nearly the same from 30 to 80


def interface_last(K: Sparse, interface: IntVector, places: Matrix | None = None) -> tuple[IntVector, IntVector]:
    """A permutation of 0 … n − 1: the interior of K (n, n) by nested dissection of places (n, d), then Γ.

    The second array has the starts of the parts in it, each of which is a front; the last is the start of Γ.

    Unknowns of a mesh node have columns of the same pattern and are eliminated together in any good order. So the
    order is computed for the graph of these groups, which has far fewer entries.
    """
    interior = np.setdiff1d(np.arange(K.shape[0]), interface)
    pattern: Sparse = csc_array((np.ones(K.nnz, dtype=np.int8), K.indices, K.indptr), shape=K.shape)
    pattern = pattern[interior][:, interior] if len(interface) else pattern
    mark = np.random.default_rng(0).integers(1, 2**62, len(interior))  # columns with equal sums (modulo 2⁶⁴) are equal
    first, group = np.unique(pattern.T @ mark, return_index=True, return_inverse=True)[1:]
    graph = pattern[first][:, first]
    position = np.empty(graph.shape[0], dtype=np.int64)
    of_groups = None
    if places is not None:
        of_groups = np.empty((graph.shape[0], places.shape[1]))
        of_groups[group] = places[interior]  # the place of any unknown of the group: all are at one vertex or edge
    order, parts = nested_dissection(of_groups, graph.indptr.astype(np.int64), graph.indices.astype(np.int64))
    position[order] = np.arange(graph.shape[0])
    before = np.concatenate([[0], np.cumsum(np.bincount(position[group], minlength=len(position)))])
    return np.concatenate([interior[np.argsort(position[group], kind="stable")], interface]), before[parts]


def nested_dissection(places: Matrix | None, starts: IntVector, columns: IntVector) -> tuple[IntVector, IntVector]:
    """A permutation of 0 … n − 1 for a symmetric pattern in compressed rows whose unknowns are at places (n, d).

    The second array has the starts in it of all undivided parts and separators, and n. Without places graph distances
    from a few unknowns take their role.

    A part is halved across the longer side of its bounding box. In each half some unknowns have links to the other one;
    the half with fewer of these gives them to the separator, which comes last; on a grid it is a line. Then each half
    is halved again, all parts of a level at once.

    Source: A. George, Nested dissection of a regular finite element mesh, SIAM J. Numer. Anal. 10 (1973).
    """
    n = len(starts) - 1
    if places is None:
        places = _distances(starts, columns) if n else np.empty((0, 1))
    parts = [np.array([n])]
    order, unknowns = np.empty(n, dtype=np.int64), np.arange(n)  # unknowns that are not ordered yet, part by part
    counts, first = np.array([n]), np.zeros(1, dtype=np.int64)  # sizes of the parts, and their starts in the order
    ends = np.repeat(unknowns, np.diff(starts)), np.asarray(columns)  # both ends of all links inside parts
    side = np.empty(n, dtype=np.int64)
    while len(unknowns):
        # The median of each part along the longer side of its bounding box.
        begins, number = np.cumsum(counts) - counts, np.repeat(np.arange(len(counts)), counts)
        where = places[unknowns]
        least, most = (bound.reduceat(where, begins) for bound in (np.minimum, np.maximum))
        axis = np.argmax(most - least, axis=1)
        least, most = (bound[np.arange(len(axis)), axis] for bound in (least, most))
        along = where[np.arange(len(where)), axis[number]]
        ranked = along[np.lexsort((along, number))]
        middle = 0.5 * (ranked[begins + (counts - 1) // 2] + ranked[begins + counts // 2])
        is_lower = np.where((middle < most)[number], along <= middle[number], along < most[number])
        is_final = (counts <= _LEAF) | (least == most)  # these parts are not divided
        # Unknowns with a link between the halves; the half with fewer of them gives the separator.
        side[unknowns] = np.where(is_final[number], -1, 2 * number + ~is_lower)
        rows, others = side[ends[0]], side[ends[1]]
        is_cut = (rows >= 0) & (rows % 2 == 0) & (others == rows + 1)
        touching = np.zeros(n, dtype=np.bool_)
        touching[ends[0][is_cut]] = touching[ends[1][is_cut]] = True
        touching = touching[unknowns]
        n_lower = np.bincount(number[touching & is_lower], minlength=len(counts))
        from_lower = 2 * n_lower <= np.bincount(number[touching], minlength=len(counts))
        is_last = is_final[number] | (touching & (is_lower == from_lower[number]))
        # Groups: lower half, upper half, and separator or undivided part, which gets its final places in the order.
        group = 3 * number + np.where(is_last, 2, ~is_lower)
        sizes = np.bincount(group, minlength=3 * len(counts)).reshape(-1, 3)
        firsts = (first[:, None] + np.cumsum(sizes, axis=1) - sizes).ravel()
        grouped = np.argsort(group, kind="stable")
        rank = np.arange(len(group)) - (np.cumsum(sizes) - sizes.ravel())[group[grouped]]
        is_ordered = is_last[grouped]
        order[firsts[group[grouped[is_ordered]]] + rank[is_ordered]] = unknowns[grouped[is_ordered]]
        parts.append(firsts[2::3][sizes[:, 2] > 0])
        # The halves are the parts of the next level, with the links inside them.
        side[unknowns] = np.where(is_last, -1, group)
        inside = (side[ends[0]] >= 0) & (side[ends[0]] == side[ends[1]])
        ends = ends[0][inside], ends[1][inside]
        unknowns = unknowns[grouped[~is_ordered]]
        halves = np.flatnonzero(sizes.ravel() * (np.arange(sizes.size) % 3 < 2))
        counts, first = sizes.ravel()[halves], firsts[halves]
    return order, np.sort(np.concatenate(parts))


def _distances(starts: IntVector, columns: IntVector) -> Matrix:
    """Coordinates (n, 4): graph distances from three unknowns far from each other, and i/n to part equal distances.

    Unknowns with very many links, such as the motion of a plate, are left out of the graph.
    """
    from scipy.sparse.csgraph import connected_components, dijkstra  # imported here, as few solves need it

    n, counts = len(starts) - 1, np.diff(starts)
    is_local = counts <= 16.0 + 10.0 * np.sqrt(n)
    links = csr_array((np.repeat(is_local, counts) & is_local[columns], columns, starts), (n, n), copy=True)
    links.eliminate_zeros()
    part = connected_components(links, directed=False)[1]
    ends = np.unique(part, return_index=True)[1]
    # Connected components are joined, one to the next.
    links = links + csr_array((np.ones(len(ends) - 1), (ends[:-1], ends[1:])), (n, n))
    distances = np.empty((n, 0))
    for _ in range(3):
        farthest = int(np.argmax(distances.min(axis=1, initial=n)))
        distance: Any = dijkstra(links, directed=False, indices=np.array(farthest), unweighted=True)
        distances = np.column_stack([distances, distance])
    return np.column_stack([distances, np.arange(n) / n])


# H = L U of unsymmetric matrices that share a symmetric pattern, such as Newton's matrices.
#
# The order and the fronts are computed once. Pivots are chosen within a front.


class MultifrontalLU:
    """Factors of one matrix H (n, n) at a time, in compressed rows of the given symmetric pattern; one thread."""

    backend = "multifrontal"

    def __init__(self, starts: IntVector, columns: IntVector, places: Matrix | None = None) -> None:
        n = len(starts) - 1
        pattern: Sparse = csc_array((np.ones(len(columns), dtype=np.int8), columns, starts), (n, n))
        self._order, begins = interface_last(pattern, np.zeros(0, dtype=np.int64), places)
        position, number = np.empty(n, dtype=np.int64), np.repeat(np.arange(len(begins) - 1), np.diff(begins))
        position[self._order] = np.arange(n)
        rows, columns = position[np.repeat(np.arange(n), np.diff(starts))], position[columns]
        self._sorted = np.argsort(number[np.minimum(rows, columns)], kind="stable")
        rows, columns = rows[self._sorted], columns[self._sorted]
        self._parts = [
            part._replace(places=part.places[0] * part.size + part.places[1])
            for part in parts(begins, np.minimum(rows, columns), np.stack([rows, columns]))
        ]
        self._factors: list[tuple[Matrix, IntVector, Matrix, Matrix]] = []

    def factorise(self, values: Vector) -> None:
        """Factorise H, given its entries row by row, for `solve`; `FactorisationError` if H is singular."""
        values, self._factors = values[self._sorted], []
        updates: dict[int, Matrix] = {}  # Schur complements for later fronts
        with limited_blas(1):
            for i, part in enumerate(self._parts):
                front, count = np.zeros((part.size, part.size)), part.end - part.first
                front.ravel()[part.places] = values[part.entries]
                for child, where in part.arriving:
                    _add(front, where, updates.pop(child))
                head, pivots, info = dgetrf(front[:count, :count])
                if info > 0:
                    raise FactorisationError("singular", self.backend, "a pivot is zero")
                lower_block, right_block = front[count:, :count].copy(), front[:count, count:]
                if len(part.later):
                    right_block = dgetrs(head, pivots, right_block)[0]
                    updates[i] = front[count:, count:]
                    updates[i] -= lower_block @ right_block
                self._factors.append((head, pivots, lower_block, right_block))

    def solve(self, right: Vector) -> Vector:
        """H⁻¹ right (n,)."""
        x, solution = right[self._order], np.empty_like(right)
        with limited_blas(1):
            for part, (head, pivots, lower_block, _) in zip(self._parts, self._factors, strict=True):
                block = slice(part.first, part.end)
                x[block] = dgetrs(head, pivots, x[block])[0]
                x[part.later] -= lower_block @ x[block]
            for part, (*_, right_block) in zip(reversed(self._parts), reversed(self._factors), strict=True):
                x[part.first : part.end] -= right_block @ x[part.later]
        solution[self._order] = x
        return solution
