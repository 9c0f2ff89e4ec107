"""SciPy's SuperLU in symmetric mode, the interface last, so that S is the product of trailing blocks.

SuperLU solves with the whole of a matrix only. That is enough, and one factor does. With the diagonal D of K_ΓΓ the
matrix K' = K + [0 0; 0 D] has the Schur complement S' = S + D, well conditioned however soft S is, and y = K'⁻¹ g gives

    g_Γ − K_ΓI K_II⁻¹ g_I = S' y_Γ,        K_II⁻¹ (g_I − K_IΓ x_Γ) = y_I + (K'⁻¹ [0; S' (x_Γ − y_Γ)])_I.
"""

from time import perf_counter
from typing import Final, Literal

import numpy as np
import scipy
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import spilu, splu

from solvers.basics.types import IntVector, Matrix, Module, Sparse, Vector
from solvers.factorisation.base import Factorisation, FactorisationError, State, check_pivots, symmetrised
from solvers.factorisation.ordering import interface_last

__all__ = ["SuperLU", "filled", "version"]

_DROPPED: Final = 1e300  # entries of a factor below it: all of them


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
        self.interface = interface
        start = perf_counter()
        k = interface.size
        own = k == 0 and places is None
        self._order = None if own else interface_last(K, interface, _minimum_degree, places)
        analysed = perf_counter()
        diagonal = K.diagonal()
        added = diagonal[interface]
        raised = K if self._order is None else _reordered(K, self._order, added)
        self._factor: Module = _symmetric_splu(raised, "MMD_AT_PLUS_A" if own else "NATURAL")
        factorised = perf_counter()
        self._raised = self._checked_schur(diagonal, k)
        self.schur = self._raised - np.diag(added)
        self._added = added
        ended = perf_counter()
        self.seconds = {"analysis": analysed - start, "numeric": factorised - analysed, "check": ended - factorised}

    @property
    def size(self) -> int:
        """Number of unknowns n."""
        return int(self._open().shape[0])

    def release(self) -> None:
        """Drop the factors; may be called again."""
        self._factor = None

    def _schur_scale(self) -> Vector:
        return self._added

    def _checked_schur(self, diagonal: Vector, k: int) -> Matrix:
        """S' (k, k) by the trailing block of L and pivots; `FactorisationError` if one of the interior is rounding."""
        lower, pivots = self._factor.L, self._factor.U.diagonal()
        place = self._factor.perm_c if self._order is None else np.argsort(self._order)
        ordered = np.empty_like(diagonal)
        ordered[place] = diagonal
        first = self.size - k
        check_pivots(pivots[:first], ordered[:first], self.backend, self.size)
        last = lower[:, first:][first:].toarray()
        return symmetrised((last * pivots[first:]) @ last.T)

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
        factor = self._open()
        if self._order is None or not right.size:
            return np.asarray(factor.solve(np.asfortranarray(right))) if right.size else np.array(right, order="F")
        x = np.empty(right.shape, order="F")
        x[self._order] = factor.solve(np.asfortranarray(right[self._order]))
        return x

    def _open(self) -> Module:
        if self._factor is None:
            raise FactorisationError("backend", self.backend, "the factors have been released")
        return self._factor


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


def _symmetric_splu(K: Sparse, order: Literal["NATURAL", "MMD_AT_PLUS_A"]) -> Module:
    """SuperLU's factors with every pivot on the diagonal."""
    try:
        factor = splu(K, order, 0.0, options={"SymmetricMode": True})
    except RuntimeError as error:
        raise FactorisationError("singular", "superlu", str(error)) from error
    if not np.array_equal(factor.perm_r, factor.perm_c):
        raise FactorisationError("singular", "superlu", "a pivot is zero")
    return factor


def filled(graph: Sparse) -> tuple[IntVector, IntVector, IntVector]:
    """An order of elimination of a symmetric pattern with full diagonal, and the pattern of L: rows, column starts.

    By a factorisation of some matrix with this pattern.
    """
    dominant = graph + diags_array(np.asarray(graph.sum(axis=0), dtype=np.float64).ravel())
    factor = _symmetric_splu(csc_array(dominant, dtype=np.float64), "MMD_AT_PLUS_A")
    lower = factor.L
    return np.argsort(factor.perm_c).astype(np.int64), lower.indices, lower.indptr


def _minimum_degree(graph: Sparse) -> IntVector:
    """SuperLU's multiple minimum degree of Aᵀ + A, which SciPy gives with a factorisation only: one that drops all."""
    sums = np.asarray(graph.sum(axis=0), dtype=np.float64).ravel()
    dominant = csc_array(graph + diags_array(sums), dtype=np.float64)
    factor = spilu(dominant, _DROPPED, 1.0, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                   options={"SymmetricMode": True})  # fmt: skip
    return np.argsort(factor.perm_c).astype(np.int64)
