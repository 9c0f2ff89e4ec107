"""PARDISO of Intel MKL, which is found in the `mkl` wheel and called through ctypes; the default number of threads.

PARDISO's numerical factorisation gives the Schur complement too: K = [L 0; M 1] [1 0; 0 S] [Lᵀ Mᵀ; 0 1], K_II = L Lᵀ.
Numbers of phases, parameters and errors are those of the oneMKL Developer Reference, "oneMKL PARDISO - Parallel Direct
Sparse Solver Interface" (C, iparm counted from 0).
"""

import ctypes
import os
import sys
import weakref
from collections.abc import Iterator
from contextlib import suppress
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from threading import RLock
from time import perf_counter
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from solvers.basics.foreign import foreign_code
from solvers.basics.types import IntVector, Matrix, Sparse, Vector
from solvers.factorisation.base import Factorisation, FactorisationError, Reason, State, blas_libraries, symmetrised

_PATTERNS: Final = ("libmkl_rt.so*", "libmkl_rt*.dylib", "mkl_rt*.dll")
_OPENMP: Final = ("libiomp5.so", "libiomp5.dylib", "libiomp5md.dll")

INTEL, SEQUENTIAL = 0, 1  # arguments of MKL_Set_Threading_Layer: Intel's OpenMP, or no threads
LP64: Final = 0  # argument of MKL_Set_Interface_Layer: 32-bit integers


@lru_cache(maxsize=1)
def library() -> ctypes.CDLL | None:
    """MKL with its layers chosen, or None if it does not load.

    If another library in the process has used MKL before, its layers cannot be changed. MKL is not loaded in a working
    folder that has been deleted, where it would end the process.
    """
    try:
        Path.cwd()
    except OSError:
        return None
    for path in _candidates():
        with suppress(OSError):
            mkl = ctypes.CDLL(str(path))
            mkl.MKL_Set_Interface_Layer(LP64)
            threaded = any(map(_loads, (place for name in _OPENMP for place in (str(path.parent / name), name))))
            mkl.MKL_Set_Threading_Layer(INTEL if threaded else SEQUENTIAL)
            blas_libraries.cache_clear()
            return mkl
    return None


@lru_cache(maxsize=1)
def version() -> str | None:
    """Library and version, None if it does not load."""
    if library() is None:
        return None
    try:
        return f"mkl {distribution('mkl').version}"
    except PackageNotFoundError:
        return "mkl"


def _candidates() -> Iterator[Path]:
    """Possible paths of the run-time library: in the wheel's list of files, then in the environment's folders."""
    with suppress(PackageNotFoundError):
        package = distribution("mkl")
        for file in package.files or ():
            if any(file.match(pattern) for pattern in _PATTERNS):
                yield Path(str(package.locate_file(file))).resolve()
    for folder in (Path(sys.prefix, "lib"), Path(sys.prefix, "Library", "bin")):
        for pattern in _PATTERNS:
            yield from sorted(folder.glob(pattern), reverse=True)


def _loads(library: str) -> bool:
    try:
        return bool(ctypes.CDLL(library))
    except OSError:
        return False


# The default number of threads.

VARIABLES: Final = ("MKL_NUM_THREADS", "OMP_NUM_THREADS")
"""Environment variables with the number of threads; the first that is set counts."""


def thread_count() -> int:
    """The number in the first of `VARIABLES` that is set, else that of the cores this process may run on."""
    for variable in VARIABLES:
        first = os.environ.get(variable, "").split(",")[0].strip()  # OMP_NUM_THREADS may list nested levels
        if first.isdigit() and int(first) > 0:
            return int(first)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


# PARDISO.

STRUCTURALLY_SYMMETRIC, POSITIVE_DEFINITE = 1, 2  # argument `mtype`, for real matrices
ANALYSIS, NUMERIC, SOLVE, RELEASE = 11, 22, 33, -1  # argument `phase`
FORWARD, BACKWARD = 331, 333  # (g_I, g_Γ) → (L⁻¹ g_I, g_Γ − M L⁻¹ g_I), and (y_I, x_Γ) → (L⁻ᵀ (y_I − Mᵀ x_Γ), x_Γ)

_SETTINGS: Final = {  # of `iparm`, by their positions
    0: 1,  # no defaults are filled in
    1: 2,  # METIS orders
    9: 16,  # pivots are raised to 10⁻¹⁶ |A|; the default 10⁻¹³ would spoil soft directions beside stiff ones
    23: 1,  # two-level factorisation, which gives S at almost no cost
    34: 1,  # indices count from 0
}
_SCHUR: Final = {35: 2}  # dense S into x in the numeric phase, factors of K_II kept
_REASONS: Final[dict[int, tuple[Reason, str]]] = {
    -2: ("memory", "out of memory"),
    -4: ("singular", "a pivot is zero or negative"),
    -7: ("singular", "a diagonal block is singular"),
    -8: ("memory", "32-bit integers overflow"),
}
_MATRIX: Final = 1  # mnum: number of the matrix of a handle, here the only one
_PHASE, _COLUMNS, _ERROR = 3, 5, 7  # positions among the integer arguments
_LEAST_WIDE: Final = int(np.iinfo(np.int32).max)  # number of entries from which 64-bit integers are needed
_PROBES: Final = 2
_SINGULAR: Final = 0.1 / float(np.finfo(np.float64).eps)

_LOCK: Final = RLock()  # two threads in PARDISO end the process, even with different matrices
_RELEASED: "Final[list[_Handle]]" = []  # handles to be freed when no other thread is in PARDISO


class Pardiso(Factorisation):
    """Factors of K (n, n), n > k, in compressed columns with sorted indices; MKL holds them until this object goes.

    Every call runs with the given number of threads.
    """

    backend = "pardiso"

    def __init__(self, K: Sparse, interface: IntVector, threads: int) -> None:
        self.version, self.interface, self.size = version() or "", interface, K.shape[0]
        start = perf_counter()
        # Upper triangle of K = Kᵀ in compressed rows: the lower triangle of its columns.
        is_lower = K.indices >= np.repeat(np.arange(self.size, dtype=K.indices.dtype), np.diff(K.indptr))
        starts = np.concatenate([[0], np.cumsum(is_lower)])[K.indptr]
        upper = starts, K.indices[is_lower], K.data[is_lower]
        self._handle = handle = _Handle(POSITIVE_DEFINITE, *upper, threads, self, interface)
        handle.call(ANALYSIS)
        analysed = perf_counter()
        schur = np.zeros((interface.size, interface.size))
        handle.call(NUMERIC, x=schur)
        self.schur = symmetrised(schur) if schur.size else schur
        factorised = perf_counter()
        self._check_interior(K.diagonal())
        self.seconds = {"analysis": analysed - start, "numeric": factorised - analysed}
        self.seconds["check"] = perf_counter() - factorised

    def _check_interior(self, diagonal: Vector) -> None:
        """`FactorisationError` if K_II is singular up to rounding; PARDISO itself reports only zero pivots.

        With random signs ξ and g = D^½ ξ, D the diagonal of K_II, ‖L⁻¹ g‖² is about 1/λ, λ the smallest eigenvalue of
        D^-½ K_II D^-½. The two-level factorisation does not give the pivots (iparm[55]).
        """
        signs = np.random.default_rng(0).integers(2, size=(diagonal.size, _PROBES)) * 2.0 - 1.0
        y = self._phase(FORWARD, np.asarray(signs * np.sqrt(diagonal)[:, None], dtype=np.float64))
        y[self.interface] = 0.0
        energy = float(np.max(np.sum(y * y, axis=0)))
        if not energy < _SINGULAR:
            detail = f"an eigenvalue of the interior, scaled to unit diagonal, is {1.0 / energy:.1e}"
            raise FactorisationError("singular", self.backend, detail)

    def _forward(self, right: Vector | Matrix) -> State:
        return self._phase(FORWARD, right)

    def _backward(self, state: State, values: Vector | Matrix) -> Vector | Matrix:
        return self._phase(BACKWARD, self._with_values(state, values))

    def _phase(self, phase: int, b: Vector | Matrix) -> Vector | Matrix:
        b = np.asfortranarray(b)
        x = np.zeros(b.shape, order="F")
        if b.size:
            self._handle.call(phase, b, x)
        return x


class RefactorisedByPardiso:
    """H = L U for one matrix H after another, all of one symmetric pattern, which is ordered and analysed once.

    Pivots are chosen inside dense diagonal blocks only. The methods are those of `MultifrontalLU`.
    """

    backend = "pardiso"

    def __init__(self, starts: IntVector, columns: IntVector, threads: int) -> None:
        self._handle = _Handle(STRUCTURALLY_SYMMETRIC, starts, columns, np.zeros(len(columns)), threads, self)
        self._handle.call(ANALYSIS)

    def factorise(self, values: Vector) -> None:
        """Factorise H, given its entries row by row, for `solve`."""
        self._handle.values[:] = values
        self._handle.call(NUMERIC)

    def solve(self, right: Vector) -> Vector:
        """H⁻¹ right (n,)."""
        x = np.zeros_like(right)
        self._handle.call(SOLVE, np.array(right)[:, None], x[:, None])
        return x


class _Handle:
    """PARDISO's arguments for one matrix: pt, iparm, and the compressed rows, of a symmetric one the upper triangle.

    MKL's memory is freed when the owner is.
    """

    def __init__(
        self, kind: int, starts: NDArray[Any], columns: NDArray[Any], values: Vector, threads: int, owner: object,
        interface: IntVector | None = None,
    ) -> None:  # fmt: skip
        mkl = library()
        if mkl is None:
            raise FactorisationError("backend", "pardiso", "MKL does not load")
        size, is_wide = len(starts) - 1, len(columns) >= _LEAST_WIDE
        integer: type[np.signedinteger[Any]] = np.int64 if is_wide else np.int32
        self._mkl, self._threads, self._pardiso = mkl, threads, mkl.pardiso_64 if is_wide else mkl.pardiso
        self.values = np.ascontiguousarray(values)
        pt, iparm, perm = np.zeros(64, dtype=np.int64), np.zeros(64, dtype=integer), np.zeros(size, dtype=integer)
        settings = _SETTINGS
        if interface is not None and interface.size:
            settings = {**_SETTINGS, **_SCHUR}
            perm[interface] = 1
        iparm[list(settings)] = list(settings.values())
        rows = (np.ascontiguousarray(part, dtype=integer) for part in (starts, columns))
        self._arrays = pt, self.values, *rows, perm, iparm, np.zeros(1)  # kept, as MKL has their addresses
        self._integers = np.array([1, _MATRIX, kind, 0, size, 0, 0, 0], dtype=integer)
        # Addresses of all arguments but b and x, in the order of `pardiso`.
        handle, *matrix, parameters, self._nothing = map(_address, self._arrays)
        maxfct, mnum, mtype, phase, n, nrhs, msglvl, self._error = (_address(self._integers[i:]) for i in range(8))
        self._arguments = (handle, maxfct, mnum, mtype, phase, n, *matrix, nrhs, parameters, msglvl)
        weakref.finalize(owner, self.release).atexit = False

    def call(self, phase: int, b: Vector | Matrix | None = None, x: Matrix | None = None) -> None:
        """One call of `pardiso`; `FactorisationError` for its error codes."""
        right, left = (self._nothing if array is None else _address(array) for array in (b, x))
        with foreign_code(), _LOCK:
            threads = self._mkl.MKL_Set_Num_Threads_Local(self._threads)  # of this Python thread
            self._integers[[_PHASE, _COLUMNS, _ERROR]] = phase, 1 if b is None or b.ndim == 1 else b.shape[1], 0
            self._pardiso(*self._arguments, right, left, self._error)
            self._mkl.MKL_Set_Num_Threads_Local(threads)
            code = int(self._integers[_ERROR])
        if code:
            reason, detail = _REASONS.get(code, ("backend", "an internal error"))
            raise FactorisationError(reason, "pardiso", f"{detail} (code {code} in phase {phase})")

    def release(self) -> None:
        """Free MKL's memory of this matrix, now or, if another thread is in PARDISO, with the next matrix."""
        _RELEASED.append(self)
        if _LOCK.acquire(blocking=False):  # the garbage collector, which may run inside any lock, must not wait
            try:
                while _RELEASED:
                    with suppress(FactorisationError):
                        _RELEASED.pop().call(RELEASE)
            finally:
                _LOCK.release()


def _address(array: NDArray[Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
