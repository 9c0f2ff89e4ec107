"""Dense Cholesky of the interior, for matrices so small that an ordering costs more than it saves.

    K_II = L Lᵀ,    E = L⁻¹ K_IΓ,    S = K_ΓΓ − Eᵀ E

in three calls of LAPACK and BLAS.
"""

from time import perf_counter
from typing import Final

import numpy as np
from scipy import __version__ as scipy_version
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf

from solvers.basics.types import IntVector, Matrix, Sparse
from solvers.factorisation.base import Factorisation, FactorisationError, State, check_pivots

DENSE: Final = "dense"
"""Name of this back end."""

SMALL: Final = 500
"""Unknowns up to which no sparse back end is faster, its ordering included."""


class DenseFactor(Factorisation):
    """L and E of K (n, n) in compressed columns without duplicates."""

    backend = DENSE

    def __init__(self, K: Sparse, interface: IntVector) -> None:
        start = perf_counter()
        self.version = f"scipy {scipy_version}"
        self.interface = interface
        inside = np.ones(K.shape[0], dtype=np.bool_)
        inside[interface] = False
        self._interior: IntVector = inside.nonzero()[0]
        dense, diagonal = K.toarray(), K.diagonal()
        rows = dense[self._interior]
        own, coupling = rows[:, self._interior], np.asfortranarray(rows[:, interface])
        factor, info = dpotrf(own.T, lower=1, clean=0, overwrite_a=1)  # the transposed is K_II too, in LAPACK's order
        if info > 0:
            raise FactorisationError("singular", self.backend, f"pivot {info} of the interior is not positive")
        check_pivots(factor.diagonal() ** 2, diagonal[self._interior], self.backend, self.size)
        S = dense[interface][:, interface]
        if coupling.size:
            coupling = dtrsm(1.0, factor, coupling, lower=1, overwrite_b=1)
            lower = dsyrk(-1.0, coupling, 1.0, S.T, trans=1, lower=1, overwrite_c=1)
            S = np.tril(lower) + np.tril(lower, -1).T
        self._factor: Matrix | None = factor
        self._coupling, self.schur, self._scale = coupling, S, diagonal[interface]
        self.seconds = {"analysis": 0.0, "numeric": perf_counter() - start}

    @property
    def size(self) -> int:
        """Number of unknowns n."""
        return len(self._interior) + len(self.interface)

    def release(self) -> None:
        """Drop the factors; may be called again."""
        self._factor = None

    def _schur_scale(self) -> Matrix:
        return self._scale

    def _forward(self, right: Matrix) -> State:
        state = np.array(right, order="F")
        if state.size:
            y = dtrsm(1.0, self._open(), state[self._interior], lower=1)
            state[self._interior] = y
            state[self.interface] -= self._coupling.T @ y
        return state

    def _backward(self, state: State, values: Matrix) -> Matrix:
        state = self._with_values(state, values)
        if state.size:
            y = state[self._interior] - self._coupling @ values
            state[self._interior] = dtrsm(1.0, self._open(), y, lower=1, trans_a=1)
        return state

    def _open(self) -> Matrix:
        if self._factor is None:
            raise FactorisationError("backend", self.backend, "the factors have been released")
        return self._factor
