"""What all factorisations have: K with its interior eliminated, and the dense Schur complement on the interface Γ.

In `docs/theory.md`: (D3).
"""

import sys
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import lru_cache
from time import perf_counter
from typing import Any, ClassVar, Final, Literal, NamedTuple, TypeAlias

import numpy as np
from scipy import __version__ as scipy_version
from scipy.linalg.blas import dsyrk, dtrsm, dtrsv
from scipy.linalg.lapack import dpotrf

from solvers.basics.types import IntVector, Matrix, Module, Vector, load
from solvers.errors import InputError, QVIError

State: TypeAlias = Matrix
"""A right-hand side after elimination of the interior, (n,) or (n, j): L⁻¹ g_I in the back end's form, and g̃ on Γ."""

_ROUNDING: Final = 10.0 * np.finfo(np.float64).eps


class Factorisation(ABC):
    """K = [K_II K_IΓ; K_ΓI K_ΓΓ], symmetric positive definite, with the interior I eliminated.

    S = K_ΓΓ − K_ΓI K_II⁻¹ K_IΓ. Made by `factorise`; K itself may be changed or dropped afterwards.
    """

    backend: ClassVar[str]
    version: str
    """Name of the back end, and its library with the version."""
    size: int
    """Number of unknowns n."""
    interface: IntVector
    """(k,): Sorted indices Γ; k = 0 and k = n are allowed."""
    schur: Matrix
    """(k, k): S, dense and exactly symmetric."""
    seconds: dict[str, float]
    """Wall time of "analysis" (ordering, symbolic) and "numeric" (with S), conversions included. "check", if present,
    is that of a separate test whether K is singular up to rounding."""

    @abstractmethod
    def _forward(self, right: Vector | Matrix) -> State:
        """Eliminate I from right-hand sides g, (n,) or (n, j): a new array with g_Γ − K_ΓI K_II⁻¹ g_I on Γ."""

    @abstractmethod
    def _backward(self, state: State, values: Vector | Matrix) -> Vector | Matrix:
        """Unknowns x, (n,) or (n, j), from an unchanged state and x_Γ; rows Γ of the result need not be set."""

    def keeps(self, unknowns: IntVector) -> bool:
        """Whether all these unknowns are on the interface."""
        is_kept = np.zeros(self.size, dtype=np.bool_)
        is_kept[self.interface] = True
        return bool(is_kept[unknowns].all())

    def reduce(self, right: Vector | Matrix) -> tuple[Vector | Matrix, State]:
        """(g_Γ − K_ΓI K_II⁻¹ g_I, state for `expand`) for right-hand sides g, (n,) or (n, j)."""
        right = np.asarray(right, dtype=np.float64)
        if right.ndim not in (1, 2) or len(right) != self.size:
            raise InputError("right", right.shape, f"give an array ({self.size},) or ({self.size}, j)")
        state = self._forward(right)
        return state[self.interface], state

    def expand(self, state: State, values: Vector | Matrix) -> Vector | Matrix:
        """x, (n,) or (n, j), with x_Γ = values and x_I = K_II⁻¹ (g_I − K_IΓ values), g the argument of `reduce`.

        The state is not changed and may be used again.
        """
        values, expected = np.asarray(values, dtype=np.float64), (self.interface.size, *state.shape[1:])
        if values.shape != expected:
            raise InputError("values", values.shape, f"give an array {expected}, as the right-hand side was")
        x = self._backward(state, values)
        x[self.interface] = values
        return x

    def _with_values(self, state: State, values: Vector | Matrix) -> State:
        """A copy of a state with x_Γ in place of g̃ on Γ."""
        start = np.array(state, order="F")
        start[self.interface] = values
        return start


def symmetrised(matrix: Matrix) -> Matrix:
    """(A + Aᵀ)/2, exactly symmetric."""
    return np.asarray(0.5 * (matrix + matrix.T))


def check_pivots(pivots: Vector, diagonal: Vector, backend: str, n: int) -> None:
    """`FactorisationError` if a pivot dᵢ of K = L D Lᵀ, (n, n), is within rounding of 0: dᵢ ≤ 10 ε √n Kᵢᵢ.

    0 < dᵢ ≤ Kᵢᵢ holds for every positive definite K, and dᵢ/Kᵢᵢ does not depend on the scaling of the unknowns.
    """
    bound = float(_ROUNDING * np.sqrt(n))
    if not np.all(pivots > bound * diagonal):
        worst = float(np.min(pivots / diagonal))
        detail = f"a pivot is {worst:.1e} of its diagonal entry, where rounding alone gives {bound:.1e}"
        raise FactorisationError("singular", backend, detail)


# The error of a failed factorisation.

Reason: TypeAlias = Literal["singular", "memory", "time", "backend"]
"""Why a factorisation failed: not positive definite, out of memory, no time left, or another error of the back end."""

_REMEDY: Final[dict[Reason, str]] = {
    "singular": "fix the free modes and give positive stiffnesses, so that K is positive definite",
    "memory": "take fewer cells, or a machine with more memory",
    "time": "allow more time (time_limit), or take fewer cells",
    "backend": "choose another back end (factorisation)",
}


class FactorisationError(QVIError):
    """K could not be factorised by `backend`, or a solve with the factors failed, for a `reason`.

    The reason "singular" includes indefinite matrices; "time": a large factorisation is not begun after the time limit.
    """

    def __init__(self, reason: Reason, backend: str, detail: str) -> None:
        self.reason = reason
        self.backend = backend
        self._detail = detail
        super().__init__(f"factorisation by {backend}: {detail}; {_REMEDY[reason]}")

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickles, by which worker processes send errors."""
        return type(self), (self.reason, self.backend, self._detail)


# Fronts: dense blocks of unknowns that are eliminated at once.


class Front(NamedTuple):
    """Rows of U, K = UᵀU, for e eliminated unknowns: U₁₁ (e, e), `head`, and U₁₂ (e, s), `tail`, for s later ones."""

    eliminated: IntVector
    staying: IntVector
    head: Matrix
    tail: Matrix


class Fronts(Factorisation):
    """K_II = Uᵀ U by fronts, in the order of elimination."""

    version = f"scipy {scipy_version}"
    _fronts: list[Front]

    def _forward(self, right: Vector | Matrix) -> State:
        state = np.array(right, order="F")
        with self._threads():
            for eliminated, staying, head, tail in self._fronts if state.size else ():
                y = state[eliminated]
                # for one right-hand side, BLAS of level 2 takes a third of the time of level 3
                y = dtrsv(head, y, trans=1, overwrite_x=1) if y.ndim == 1 else dtrsm(1.0, head, y, trans_a=1)
                state[eliminated] = y
                state[staying] -= tail.T @ y
        return state

    def _backward(self, state: State, values: Vector | Matrix) -> Vector | Matrix:
        state = self._with_values(state, values)
        with self._threads():
            for eliminated, staying, head, tail in reversed(self._fronts) if state.size else ():
                y = state[eliminated] - tail @ state[staying]
                state[eliminated] = dtrsv(head, y, overwrite_x=1) if y.ndim == 1 else dtrsm(1.0, head, y)
        return state

    def _threads(self) -> AbstractContextManager[None]:
        """One thread for many fronts: several are slower on small ones, on a busy machine by orders of magnitude."""
        return limited_blas(1) if len(self._fronts) > 1 else nullcontext()


def eliminated(block: Matrix, coupling: Matrix, others: Matrix, backend: str) -> tuple[Matrix, Matrix, Matrix]:
    """U₁₁ and U₁₂ for K₁₁ = block and K₁₂ = coupling, and the upper triangle of the update others − U₁₂ᵀ U₁₂.

    All arrays are by columns and overwritten. `FactorisationError` if K₁₁ is not positive definite.
    """
    head, info = dpotrf(block, clean=0, overwrite_a=1)
    if info > 0:
        raise FactorisationError("singular", backend, "a pivot is not positive")
    if coupling.size:
        coupling = dtrsm(1.0, head, coupling, trans_a=1, overwrite_b=1)
        others = dsyrk(-1.0, coupling, 1.0, others, trans=1, overwrite_c=1)
    return head, coupling, others


def symmetric(upper: Matrix) -> Matrix:
    """The symmetric matrix whose upper triangle this is."""
    return np.where(np.tri(len(upper), k=-1, dtype=bool), upper.T, upper)


@contextmanager
def limited_blas(count: int) -> Iterator[None]:
    """Limit every loaded BLAS to `count` threads within the context; without threadpoolctl nothing is limited."""
    libraries = blas_libraries(len(sys.modules))
    changed = [(library, threads) for library in libraries if (threads := library.get_num_threads()) != count]
    try:
        for library, _ in changed:
            library.set_num_threads(count)
        yield
    finally:
        for library, threads in changed:
            library.set_num_threads(threads)


@lru_cache(maxsize=1)
def blas_libraries(modules: int) -> list[Module]:  # noqa: ARG001  # the key of the cache
    """The loaded BLAS libraries. Searched, in milliseconds, only after an import or after MKL was loaded."""
    try:
        libraries = load("threadpoolctl").ThreadpoolController().lib_controllers
    except ImportError:
        return []
    return [library for library in libraries if library.user_api == "blas"]


DENSE: Final = "dense"
"""Name of the back end with one front, for small matrices, for which an ordering costs more than it saves."""

SMALL: Final = 400
"""Unknowns up to which the dense back end is faster than sparse ones."""


class DenseFactor(Fronts):
    """The whole interior of K (n, n) as one front."""

    backend = DENSE

    def __init__(self, K: Matrix, interface: IntVector) -> None:
        start = perf_counter()
        self.interface, self.size, self._fronts = interface, K.shape[0], []
        inside = np.ones(self.size, dtype=np.bool_)
        inside[interface] = False
        interior = inside.nonzero()[0]
        diagonal, self.schur = K.diagonal(), symmetrised(K[interface][:, interface])
        if interior.size:
            rows = K.take(interior, axis=0)
            # K_II is symmetric
            block, coupling = rows.take(interior, axis=1).T, np.asfortranarray(rows.take(interface, axis=1))
            head, tail, update = eliminated(block, coupling, self.schur.T, self.backend)
            check_pivots(head.diagonal() ** 2, diagonal[interior], self.backend, self.size)
            self._fronts, self.schur = [Front(interior, interface, head, tail)], symmetric(update)
        self.seconds = {"analysis": 0.0, "numeric": perf_counter() - start}
