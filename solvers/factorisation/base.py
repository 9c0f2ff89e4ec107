"""What every factorisation offers: K with its interior eliminated, and the dense Schur complement on the interface.

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
"""A right-hand side after elimination of the interior, (n,) or (n, j): the back end's own numbers on I, g̃ on Γ."""

_ROUNDING: Final = 10.0 * np.finfo(np.float64).eps


class Factorisation(ABC):
    """K = [K_II K_IΓ; K_ΓI K_ΓΓ], symmetric positive definite, with the interior I eliminated.

    S = K_ΓΓ − K_ΓI K_II⁻¹ K_IΓ. Made by `factorise`; K itself may be changed or dropped afterwards.
    """

    backend: ClassVar[str]
    version: str
    """Name in `BACKENDS`, and the library with its version."""
    size: int
    """Number of unknowns n."""
    interface: IntVector
    """(k,): Sorted indices Γ; k = 0 and k = n are allowed."""
    schur: Matrix
    """(k, k): S, dense and exactly symmetric."""
    seconds: dict[str, float]
    """Wall time of "analysis" (ordering, symbolic) and "numeric" (with S), conversions included, and of the "check" for
    a matrix that is singular up to rounding where that is a step of its own."""

    @abstractmethod
    def _forward(self, right: Vector | Matrix) -> State:
        """Eliminate I from right-hand sides, (n,) or (n, j): a new array, g_Γ − K_ΓI K_II⁻¹ g_I on Γ."""

    @abstractmethod
    def _backward(self, state: State, values: Vector | Matrix) -> Vector | Matrix:
        """Unknowns x from a state, which is left as it is, and x_Γ, all (n,) or (n, j); rows on Γ may be anything."""

    def keeps(self, unknowns: IntVector) -> bool:
        """Whether all these unknowns, none given twice, are on the interface."""
        kept = np.zeros(self.size, dtype=np.bool_)
        kept[self.interface] = True
        return bool(kept[unknowns].all())

    def reduce(self, right: Vector | Matrix) -> tuple[Vector | Matrix, State]:
        """(g_Γ − K_ΓI K_II⁻¹ g_I, state for `expand`) for right-hand sides g, (n,) or (n, j)."""
        right = np.asarray(right, dtype=np.float64)
        if right.ndim not in (1, 2) or len(right) != self.size:
            raise InputError("right", right.shape, f"give an array ({self.size},) or ({self.size}, j)")
        state = self._forward(right)
        return state[self.interface], state

    def expand(self, state: State, values: Vector | Matrix) -> Vector | Matrix:
        """x, (n,) or (n, j), with x_Γ = values and x_I = K_II⁻¹ (g_I − K_IΓ values), g as it was given to `reduce`.

        The state is left as it is and may be used again.
        """
        values, expected = np.asarray(values, dtype=np.float64), (self.interface.size, *state.shape[1:])
        if values.shape != expected:
            raise InputError("values", values.shape, f"give an array {expected}, as the right-hand side was")
        x = self._backward(state, values)
        x[self.interface] = values
        return x

    def square(self, state: State) -> float:
        """g_Iᵀ K_II⁻¹ g_I for the state of a right-hand side g (n,): what relaxing the interior alone does, twice."""
        inside = np.array(state)
        inside[self.interface] = 0.0
        return float(inside @ inside)  # L⁻¹ g_I on I, with K_II = L Lᵀ

    def _with_values(self, state: State, values: Vector | Matrix) -> State:
        """A copy of a state with x_Γ in place of g̃."""
        start = np.array(state, order="F")
        start[self.interface] = values
        return start


def symmetrised(matrix: Matrix) -> Matrix:
    """(A + Aᵀ)/2, exactly symmetric."""
    return np.asarray(0.5 * (matrix + matrix.T))


def check_pivots(pivots: Vector, diagonal: Vector, backend: str, n: int) -> None:
    """`FactorisationError` for a pivot dᵢ of K = L D Lᵀ, (n, n), that is not above rounding: dᵢ ≤ 10 ε √n Kᵢᵢ.

    0 < dᵢ ≤ Kᵢᵢ holds for every positive definite K, and dᵢ/Kᵢᵢ does not depend on the scaling of the unknowns.
    """
    bound = float(_ROUNDING * np.sqrt(n))
    if not np.all(pivots > bound * diagonal):
        worst = float(np.min(pivots / diagonal))
        detail = f"a pivot is {worst:.1e} of its diagonal entry, where rounding alone gives {bound:.1e}"
        raise FactorisationError("singular", backend, detail)


# The error of a factorisation that cannot be done.


Reason: TypeAlias = Literal["singular", "memory", "time", "backend"]
"""Why a factorisation failed: not positive definite, out of memory, no time left, or what else the back end reports."""

_REMEDY: Final[dict[Reason, str]] = {
    "singular": "fix the free modes and give positive stiffnesses, so that K is positive definite",
    "memory": "take fewer cells, or a machine with more memory",
    "time": "allow more time (time_limit), or take fewer cells",
    "backend": "choose another back end (factorisation)",
}


class FactorisationError(QVIError):
    """K could not be factorised, or a solve with the factors failed.

    Attributes
    ----------
    reason : "singular", "memory", "time" or "backend"
        "singular" covers indefinite matrices too; "time": it is large, and the time limit over.
    backend : str
        Name of the back end.

    """

    def __init__(self, reason: Reason, backend: str, detail: str) -> None:
        self.reason = reason
        self.backend = backend
        self._detail = detail
        super().__init__(f"factorisation by {backend}: {detail}; {_REMEDY[reason]}")

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickles, as worker processes send it."""
        return type(self), (self.reason, self.backend, self._detail)


# Fronts: dense blocks of unknowns that are eliminated at once.


class Front(NamedTuple):
    """Rows of K = UᵀU for e unknowns: U₁₁ (e, e), upper triangular, and U₁₂ (e, s) for s unknowns that stay."""

    eliminated: IntVector
    staying: IntVector
    head: Matrix
    tail: Matrix


class Fronts(Factorisation):
    """K_II = Uᵀ U by fronts, parts before what they are parts of."""

    version = f"scipy {scipy_version}"
    _fronts: list[Front]

    def _forward(self, right: Vector | Matrix) -> State:
        state = np.array(right, order="F")
        with self._threads():
            for eliminated, staying, head, tail in self._fronts if state.size else ():
                y = state[eliminated]
                # of one right-hand side, BLAS of level 2 takes a third of the time of level 3
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
        """Many small fronts are slower on several threads, on a busy machine by orders of magnitude."""
        return limited_blas(1) if len(self._fronts) > 1 else nullcontext()


def eliminated(own: Matrix, coupling: Matrix, others: Matrix, backend: str) -> tuple[Matrix, Matrix, Matrix]:
    """U₁₁ and U₁₂ of K₁₁ = own and K₁₂ = coupling, and others − U₁₂ᵀ U₁₂, of which the upper triangle counts.

    All by columns and overwritten. `FactorisationError` where K₁₁ is not positive definite.
    """
    head, info = dpotrf(own, clean=0, overwrite_a=1)
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
    """Every BLAS loaded so far limited to `count` threads, as before on exit; left alone without threadpoolctl."""
    libraries = blas_libraries(len(sys.modules))
    before = [each.get_num_threads() for each in libraries]
    changed = [(each, threads) for each, threads in zip(libraries, before, strict=True) if threads != count]
    try:
        for each, _ in changed:
            each.set_num_threads(count)
        yield
    finally:
        for each, threads in changed:
            each.set_num_threads(threads)


@lru_cache(maxsize=1)
def blas_libraries(modules: int) -> list[Module]:  # noqa: ARG001  # it is the key
    """Looked for anew only when something was imported (or MKL loaded: it clears this): that takes milliseconds."""
    try:
        found = load("threadpoolctl").ThreadpoolController().lib_controllers
    except ImportError:
        return []
    return [each for each in found if each.user_api == "blas"]


DENSE: Final = "dense"
"""Name of the back end with one front, for matrices so small that an ordering costs more than it saves."""

SMALL: Final = 400
"""Unknowns up to which no sparse back end is faster, its ordering included."""


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
            rows = K[interior]
            own, coupling = rows[:, interior].T, np.asfortranarray(rows[:, interface])  # K_II is symmetric
            head, tail, left = eliminated(own, coupling, self.schur.T, self.backend)
            check_pivots(head.diagonal() ** 2, diagonal[interior], self.backend, self.size)
            self._fronts, self.schur = [Front(interior, interface, head, tail)], symmetric(left)
        self.seconds = {"analysis": 0.0, "numeric": perf_counter() - start}
