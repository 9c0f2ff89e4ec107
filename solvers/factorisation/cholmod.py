"""CHOLMOD as cvxopt carries it: supernodal K = L Lᵀ, the interface last, so that S is the product of trailing blocks.

Y. Chen, T. A. Davis, W. W. Hager, S. Rajamanickam, Algorithm 887: CHOLMOD, ACM Trans. Math. Software 35 (2008).
"""

from collections.abc import Iterator
from contextlib import contextmanager
from enum import IntEnum
from functools import lru_cache
from importlib.metadata import version as package_version
from time import perf_counter
from typing import Final

import numpy as np

from solvers.basics.types import IntVector, Matrix, Module, Sparse, Vector, load
from solvers.factorisation.base import Factorisation, State, check_pivots, symmetrised
from solvers.factorisation.cholmod_factor import trailing_block
from solvers.factorisation.errors import FactorisationError
from solvers.factorisation.ordering import interface_last
from solvers.factorisation.threads import limited_blas, thread_count

__all__ = ["Cholmod", "factorise", "version"]

_OPTIONS: Final = {"supernodal": 2, "nmethods": 1, "postorder": False}  # L Lᵀ; the order given, and no other


class System(IntEnum):
    """Argument `sys` of cvxopt's `cholmod.solve`."""

    LOWER = 4  # L⁻¹
    LOWER_TRANSPOSED = 5  # L⁻ᵀ


@lru_cache(maxsize=1)
def version() -> str | None:
    """Library and version, None if it does not load."""
    try:
        load("cvxopt.cholmod")
        return f"cvxopt {package_version('cvxopt')}"
    except ImportError:
        return None


def factorise(K: Sparse, interface: IntVector, threads: int | None) -> "Cholmod":
    """Factorise K (n, n), n > k, in compressed columns with sorted indices."""
    return Cholmod(K, interface, thread_count(threads, ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")))


class Cholmod(Factorisation):
    """P K Pᵀ = [L 0; M N] [L 0; M N]ᵀ, P puts Γ last; S = N Nᵀ is found positive definite or not at once."""

    backend = "cholmod"

    def __init__(self, K: Sparse, interface: IntVector, threads: int) -> None:
        self.version = version() or ""
        self.interface = interface
        self._threads = threads
        self._cholmod = load("cvxopt.cholmod")
        start = perf_counter()
        self._order = interface_last(K, interface, _minimum_degree)
        matrix = _cvxopt_lower(K)
        with _options(self._cholmod), limited_blas(threads):
            permutation = _cvxopt(self._order)
            self._factor: Module = self._cholmod.symbolic(matrix, permutation)
            analysed = perf_counter()
            self._numeric(matrix)
            diagonal = np.array(self._cholmod.diag(self._factor)).ravel()
            check_pivots(diagonal**2, K.diagonal()[self._order], self.backend)
            last = trailing_block(self._factor, diagonal, interface.size)
            if last is None:
                last = self._copied_block()
                self._factor = self._cholmod.symbolic(matrix, permutation)
                self._numeric(matrix)
        self._last = last
        self.schur = symmetrised(last @ last.T)
        self.seconds = {"analysis": analysed - start, "numeric": perf_counter() - analysed}

    @property
    def size(self) -> int:
        """Number of unknowns n."""
        return int(self._order.size)

    def release(self) -> None:
        """Drop the factors; may be called again."""
        self._factor = None

    def _forward(self, right: Matrix) -> State:
        ordered = self._triangular(System.LOWER, right[self._order])
        first = self.size - self.interface.size
        ordered[first:] = self._last @ ordered[first:]
        return self._unordered(ordered)

    def _backward(self, state: State, values: Matrix) -> Matrix:
        ordered = self._with_values(state, values)[self._order]
        first = self.size - self.interface.size
        ordered[first:] = self._last.T @ ordered[first:]
        return self._unordered(self._triangular(System.LOWER_TRANSPOSED, ordered))

    def _unordered(self, ordered: Matrix) -> Matrix:
        x = np.empty(ordered.shape, order="F")
        x[self._order] = ordered
        return x

    def _triangular(self, system: System, right: Matrix) -> Matrix:
        if self._factor is None:
            raise FactorisationError("backend", self.backend, "the factors have been released")
        if right.size == 0:
            return right
        x = _cvxopt(right)
        with _options(self._cholmod), limited_blas(self._threads):
            self._cholmod.solve(self._factor, x, sys=int(system))
        return np.array(x, order="F")

    def _numeric(self, matrix: Module) -> None:
        try:
            self._cholmod.numeric(matrix, self._factor)
        except ArithmeticError as error:
            raise FactorisationError("singular", self.backend, f"pivot {error} is not positive") from error
        except ValueError as error:
            raise FactorisationError("backend", self.backend, str(error)) from error

    def _copied_block(self) -> Matrix:
        """N (k, k) out of a copy of the factor, which cvxopt spoils by making it."""
        copy, first = self._cholmod.getfactor(self._factor), self.size - self.interface.size
        return np.tril(np.array(load("cvxopt").matrix(copy[first:, first:])))


@contextmanager
def _options(cholmod: Module) -> Iterator[None]:
    """Options of cvxopt, which are those of the whole process, ours for a while."""
    before = dict(cholmod.options)
    cholmod.options.clear()
    cholmod.options.update(_OPTIONS)
    try:
        yield
    finally:
        cholmod.options.clear()
        cholmod.options.update(before)


def _minimum_degree(graph: Sparse) -> IntVector:
    """Approximate minimum degree (AMD)."""
    return np.array(load("cvxopt.amd").order(_cvxopt_lower(graph)), dtype=np.int64).ravel()


def _cvxopt_lower(K: Sparse) -> Module:
    """Lower triangle of K as a matrix of cvxopt."""
    columns = np.repeat(np.arange(K.shape[0], dtype=np.int64), np.diff(K.indptr))
    keep = K.indices >= columns
    values, rows, columns = K.data[keep].astype(np.float64), K.indices[keep].astype(np.int64), columns[keep]
    return load("cvxopt").spmatrix(_cvxopt(values), _cvxopt(rows), _cvxopt(columns), K.shape)


def _cvxopt(array: Vector | IntVector | Matrix) -> Module:
    return load("cvxopt").matrix(array)
