"""SciPy's SuperLU in symmetric mode, the interface last, so that S is the product of trailing blocks."""

from time import perf_counter
from typing import Literal

import numpy as np
import scipy
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import splu

from solvers.basics.types import IntVector, Matrix, Module, Sparse, Vector
from solvers.factorisation.base import Factorisation, State, check_pivots, symmetrised
from solvers.factorisation.errors import FactorisationError
from solvers.factorisation.ordering import interface_last

__all__ = ["SuperLU", "factorise", "version"]


def version() -> str | None:
    """Library and version; it is always there."""
    return f"scipy {scipy.__version__}"


def factorise(K: Sparse, interface: IntVector, threads: int | None) -> Factorisation:  # noqa: ARG001
    """Factorise K (n, n), n > k, in compressed columns with sorted indices; one thread whatever is asked for."""
    return SuperLU(K, interface) if interface.size else PlainSuperLU(K)


class PlainSuperLU(Factorisation):
    """K without interface: SciPy's `splu`, and a look at the pivots, for which it takes another third of the time."""

    backend = "superlu"

    def __init__(self, K: Sparse) -> None:
        self.version = version() or ""
        self.interface = np.zeros(0, dtype=np.int64)
        self.schur = np.zeros((0, 0))
        self._size = int(K.shape[0])
        start = perf_counter()
        self._factor: Module = _symmetric_splu(K, "MMD_AT_PLUS_A")
        factorised = perf_counter()
        diagonal = np.empty(self._size)
        diagonal[self._factor.perm_c] = K.diagonal()
        check_pivots(self._factor.U.diagonal(), diagonal, self.backend)
        self.seconds = {"analysis": 0.0, "numeric": factorised - start, "check": perf_counter() - factorised}

    @property
    def size(self) -> int:
        """Number of unknowns n."""
        return self._size

    def release(self) -> None:
        """Drop the factors; may be called again."""
        self._factor = None

    def _forward(self, right: Matrix) -> State:
        return np.array(right, order="F")

    def _backward(self, state: State) -> Matrix:
        if self._factor is None:
            raise FactorisationError("backend", self.backend, "the factors have been released")
        return np.asarray(self._factor.solve(state)) if state.size else state


class SuperLU(Factorisation):
    """P K Pᵀ = L̃ [D 0; 0 S] L̃ᵀ with the lower triangle L̃ = [L 0; M 1], unit diagonal; P puts Γ last."""

    backend = "superlu"

    def __init__(self, K: Sparse, interface: IntVector) -> None:
        self.version = version() or ""
        self.interface = interface
        start = perf_counter()
        self._order = interface_last(K, interface, _minimum_degree)
        analysed = perf_counter()
        self._pivots, lower, self.schur = _eliminated(K, self._order, interface.size)
        self._lower: Module = _symmetric_splu(lower, "NATURAL")  # solves several times faster than SciPy with L̃ itself
        self.seconds = {"analysis": analysed - start, "numeric": perf_counter() - analysed}

    @property
    def size(self) -> int:
        """Number of unknowns n."""
        return int(self._order.size)

    def release(self) -> None:
        """Drop the factors; may be called again."""
        self._lower = None

    def _forward(self, right: Matrix) -> State:
        y = np.empty(right.shape, order="F")
        y[self._order] = self._triangular(right[self._order], transposed=False)
        return y

    def _backward(self, state: State) -> Matrix:
        y = state[self._order]
        y[: self._pivots.size] /= self._pivots[:, None]
        x = np.empty(state.shape, order="F")
        x[self._order] = self._triangular(y, transposed=True)
        return x

    def _triangular(self, right: Matrix, transposed: bool) -> Matrix:
        if self._lower is None:
            raise FactorisationError("backend", self.backend, "the factors have been released")
        return np.asarray(self._lower.solve(right, "T" if transposed else "N")) if right.size else right


def _eliminated(K: Sparse, order: IntVector, k: int) -> tuple[Vector, Sparse, Matrix]:
    """Pivots D (n − k,), L̃ (n, n) and S (k, k) of K in the given order."""
    interior = K.shape[0] - k
    factor = _symmetric_splu(K[order][:, order], "NATURAL")
    lower, upper = factor.L, factor.U
    pivots = upper.diagonal()
    check_pivots(pivots, K.diagonal()[order], "superlu")
    last = lower[:, interior:][interior:].toarray()
    return pivots[:interior], _identity_last(lower, interior), symmetrised((last * pivots[interior:]) @ last.T)


def _symmetric_splu(K: Sparse, order: Literal["NATURAL", "MMD_AT_PLUS_A"]) -> Module:
    """SuperLU's factors with every pivot on the diagonal."""
    try:
        factor = splu(K, order, 0.0, options={"SymmetricMode": True})
    except RuntimeError as error:
        raise FactorisationError("singular", "superlu", str(error)) from error
    if not np.array_equal(factor.perm_r, factor.perm_c):
        raise FactorisationError("singular", "superlu", "a pivot is zero")
    return factor


def _identity_last(lower: Sparse, interior: int) -> Sparse:
    """[L 0; M 1] from [L 0; M N]."""
    n = lower.shape[0]
    end = lower.indptr[interior]
    data = np.concatenate([lower.data[:end], np.ones(n - interior)])
    indices = np.concatenate([lower.indices[:end], np.arange(interior, n)])
    starts = np.concatenate([lower.indptr[:interior], end + np.arange(n - interior + 1)])
    return csc_array((data, indices, starts), shape=lower.shape)


def _minimum_degree(graph: Sparse) -> IntVector:
    """SuperLU's multiple minimum degree of Aᵀ + A, which SciPy gives only with a factorisation of some matrix."""
    dominant = graph + diags_array(np.asarray(graph.sum(axis=0), dtype=np.float64).ravel())
    factor = _symmetric_splu(csc_array(dominant, dtype=np.float64), "MMD_AT_PLUS_A")
    return np.argsort(factor.perm_c).astype(np.int64)
