"""The equality-constrained linear system of (D2), factored once."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import bmat, csc_matrix, identity
from scipy.sparse.linalg import splu

from solvers.errors import InputError
from solvers.types import Matrix, Module, Sparse, Vector

_REGULARISATION = 1e-11  # of the equality block, relative to K, when rows of A are linearly dependent
_REFINEMENTS = 3


@dataclass(frozen=True, eq=False)
class EqualitySystem:
    """Solves  [K Aᵀ; A 0] (x, ν) = (r, c)  with one sparse factorisation and a few refinements.

    K is (n, n), positive definite on the null space of A; A is (p, n), p = 0 allowed. Linearly dependent but
    consistent rows of A are accepted: the lower right block is then regularised and the error refined away.
    """

    K: Sparse
    A: Sparse

    @cached_property
    def _matrix(self) -> Sparse:
        if self.A.shape[0] == 0:
            return self.K
        return csc_matrix(bmat([[self.K, self.A.T], [self.A, None]]))

    @cached_property
    def _factor(self) -> Module:
        if self.A.shape[0] == 0:
            try:
                return splu(self.K, "MMD_AT_PLUS_A", 0.0, options={"SymmetricMode": True})
            except RuntimeError as error:
                raise InputError("K", "singular", "give a K that is positive definite: fix the free modes") from error
        try:
            factor = splu(self._matrix)
            if np.abs(factor.U.diagonal()).min() > 1e-13 * np.abs(factor.U.diagonal()).max():
                return factor
        except RuntimeError:
            pass
        p = self.A.shape[0]
        shift = _REGULARISATION * float(np.abs(self.A.data).max(initial=1.0)) ** 2 / float(self.K.diagonal().mean())
        return splu(csc_matrix(bmat([[self.K, self.A.T], [self.A, -shift * identity(p)]])))

    def solve(self, r: Vector | Matrix, c: Vector | Matrix | None = None) -> tuple[Vector, Vector]:
        """(x, ν) for right-hand sides r (n,) or (n, k) and c (p,) or (p, k), zero if not given."""
        n, p = self.K.shape[0], self.A.shape[0]
        if n == 0:
            return np.zeros_like(r), np.zeros((p, *r.shape[1:]))
        if c is None:
            c = np.zeros((p, *r.shape[1:]))
        right = np.concatenate([r, c])
        x = self._factor.solve(right)
        for _ in range(_REFINEMENTS if p else 1):
            x = x + self._factor.solve(right - self._matrix @ x)
        return x[:n], x[n:]
