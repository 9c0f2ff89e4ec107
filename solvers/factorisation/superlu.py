"""SciPy's SuperLU in symmetric mode, the interface last, so that S is the product of trailing blocks.

SuperLU solves with the whole of a matrix only. That is enough, and one factor does. With the diagonal D of K_ΓΓ the
matrix K' = K + [0 0; 0 D] has the Schur complement S' = S + D, well conditioned however soft S is, and y = K'⁻¹ g gives

    g_Γ − K_ΓI K_II⁻¹ g_I = S' y_Γ,        K_II⁻¹ (g_I − K_IΓ x_Γ) = y_I + (K'⁻¹ [0; S' (x_Γ − y_Γ)])_I.
"""

from time import perf_counter
from typing import Literal

import numpy as np
import scipy
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import spilu, splu

from solvers.basics.types import IntVector, Matrix, Module, Sparse, Vector
from solvers.factorisation.base import Factorisation, FactorisationError, State, check_pivots, symmetrised


def version() -> str | None:
    """Library and version; it is always there."""
    return f"scipy {scipy.__version__}"


class SuperLU(Factorisation):
    """P K Pᵀ = L D Lᵀ with unit diagonal of L, once, for K (n, n), n > k, in compressed columns with sorted indices.

    P puts Γ last, behind the interior by nested dissection of `places` (n, 2), or by minimum degree where these are not
    known; then it is SuperLU's own where Γ has no unknowns.
    """

    backend = "superlu"

    def __init__(self, K: Sparse, interface: IntVector, places: Matrix | None = None) -> None:
        self.version = version() or ""
        self.interface, self.size = interface, K.shape[0]
        start, first = perf_counter(), K.shape[0] - interface.size
        own = first == self.size and places is None
        self._order = None if own else interface_last(K, interface, places)
        analysed = perf_counter()
        diagonal = K.diagonal()
        self._diagonal = added = diagonal[interface]
        raised = K if self._order is None else _reordered(K, self._order, added)
        try:  # every pivot on the diagonal
            ordering: Literal["MMD_AT_PLUS_A", "NATURAL"] = "MMD_AT_PLUS_A" if own else "NATURAL"
            self._factor: Module = splu(raised, ordering, 0.0, options={"SymmetricMode": True})
        except RuntimeError as error:
            raise FactorisationError("singular", self.backend, str(error)) from error
        if not np.array_equal(self._factor.perm_r, self._factor.perm_c):
            raise FactorisationError("singular", self.backend, "a pivot is zero")
        factorised = perf_counter()
        lower, pivots = self._factor.L, self._factor.U.diagonal()
        order = np.argsort(self._factor.perm_c) if self._order is None else self._order
        check_pivots(pivots[:first], diagonal[order[:first]], self.backend, self.size)
        last = lower[:, first:][first:].toarray()
        self._raised = symmetrised((last * pivots[first:]) @ last.T)  # S'
        self.schur = self._raised - np.diag(added)
        ended = perf_counter()
        self.seconds = {"analysis": analysed - start, "numeric": factorised - analysed, "check": ended - factorised}

    def square(self, right: Vector, state: State) -> float:
        """See `Factorisation`; here the state is y_I = K_II⁻¹ (g_I − K_IΓ y_Γ) on I."""
        there = state[self.interface]
        y = np.array(state)
        y[self.interface] = np.linalg.solve(self._raised, there)
        return float(y @ right - y[self.interface] @ there)

    def _forward(self, right: Matrix) -> State:
        state = self._whole(right)
        state[self.interface] = self._raised @ state[self.interface]
        return state

    def _backward(self, state: State, values: Matrix) -> Matrix:
        if not self.interface.size:
            return np.array(state, order="F")
        right = np.zeros(state.shape, order="F")
        right[self.interface] = self._raised @ values - state[self.interface]
        return np.asarray(state + self._whole(right))

    def _whole(self, right: Matrix) -> Matrix:
        """Return K'⁻¹ right (n, j)."""
        if self._order is None or not right.size:
            return (
                np.asarray(self._factor.solve(np.asfortranarray(right))) if right.size else np.array(right, order="F")
            )
        x = np.empty(right.shape, order="F")
        x[self._order] = self._factor.solve(np.asfortranarray(right[self._order]))
        return x


def _reordered(K: Sparse, order: IntVector, added: Vector) -> Sparse:
    """K[order][:, order] for a symmetric K in compressed columns, with `added` (k,) on the end of its diagonal."""
    columns = K[:, order]
    place = np.empty(order.size, dtype=K.indices.dtype)
    place[order] = np.arange(order.size)
    rows = place[columns.indices]
    first = order.size - added.size
    end, column = columns.indptr[first], np.repeat(np.arange(order.size), np.diff(columns.indptr))
    columns.data[end:][rows[end:] == column[end:]] += added
    return csc_array((columns.data, rows, columns.indptr), shape=K.shape)


# Orders of elimination: by minimum degree on groups of unknowns with the same neighbours, or by places.


_LEAF = 30  # unknowns that are not parted any more; from 20 to 60 times hardly differ


def interface_last(K: Sparse, interface: IntVector, places: Matrix | None = None) -> IntVector:
    """A permutation of 0 … n − 1: the interior of K (n, n) by nested dissection of places (n, 2), then Γ.

    Without places the interior is in the order of minimum degree.

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
    if places is None:  # SciPy has no order without a factor: an incomplete one, of numbers that suit every order
        sums = np.asarray(graph.sum(axis=0), dtype=np.float64).ravel()
        dominant = csc_array(graph + diags_array(sums), dtype=np.float64)
        factor = spilu(dominant, 1e300, 1.0, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                       options={"SymmetricMode": True})  # fmt: skip
        order = np.argsort(factor.perm_c)
    else:
        of_groups = np.empty((graph.shape[0], 2))
        of_groups[group] = places[interior]  # of one of its unknowns, which are at one vertex or edge
        order = nested_dissection(of_groups, graph.indptr.astype(np.int64), graph.indices.astype(np.int64))
    position[order] = np.arange(graph.shape[0])
    return np.concatenate([interior[np.argsort(position[group], kind="stable")], interface])


def nested_dissection(places: Matrix, starts: IntVector, columns: IntVector) -> IntVector:
    """A permutation of 0 … n − 1 for a symmetric pattern in compressed rows whose unknowns are at places (n, 2).

    Unknowns are halved across the longer side of where they are; those of one half that neighbour the other, the fewer
    of the two, come last, and each half is halved again. On a grid what comes last is a line of it. All parts of one
    size are halved at once.

    Source: A. George, Nested dissection of a regular finite element mesh, SIAM J. Numer. Anal. 10 (1973).
    """
    n = len(places)
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
        side[unknowns] = np.where(last, -1, kind)
        inside = (side[ends[0]] >= 0) & (side[ends[0]] == side[ends[1]])
        ends = ends[0][inside], ends[1][inside]
        unknowns = unknowns[grouped[~done]]
        left = np.flatnonzero(sizes.ravel() * (np.arange(sizes.size) % 3 < 2))
        counts, first = sizes.ravel()[left], firsts[left]
    return order


# H = L U of unsymmetric matrices that share one symmetric pattern, as Newton's method meets them.
#
# PARDISO orders and analyses once. Where MKL is not installed SuperLU does all of it every time, but for an order that
# is given.


_THRESHOLD = 1e-3  # a pivot on the diagonal may be so much smaller than the largest of its column


class RefactorisedBySuperLU:
    """One matrix after the other: pivots on the diagonal as long as they are large enough; one thread."""

    backend = "superlu"

    def __init__(self, starts: IntVector, columns: IntVector, order: IntVector | None) -> None:
        self.version, size = f"scipy {scipy.__version__}", len(starts) - 1
        self._own, self._order = order is None, np.arange(size) if order is None else order
        entries = csr_array((np.arange(len(columns)), columns, starts), (size, size))
        if order is not None:
            entries = entries[order][:, order]
            entries.sort_indices()
        self._entries = entries  # of H, by their places in its rows, in the order of elimination
        self._factor: Module = None

    def factorise(self, values: Vector) -> None:
        """Factorise H, its entries row by row; solves are by this matrix from now on.

        Raises `FactorisationError` where H is singular. Rows of H are columns of its transpose.
        """
        places = self._entries
        transposed = csc_array((values[places.data], places.indices, places.indptr), places.shape)
        ordering: Literal["MMD_AT_PLUS_A", "NATURAL"] = "MMD_AT_PLUS_A" if self._own else "NATURAL"
        try:
            self._factor = splu(transposed, ordering, _THRESHOLD, options={"SymmetricMode": True})
        except RuntimeError as error:
            raise FactorisationError("singular", self.backend, str(error)) from error

    def solve(self, right: Vector) -> Vector:
        """H⁻¹ right (n,)."""
        found = np.empty_like(right)
        found[self._order] = self._factor.solve(right[self._order], "T")
        return found
