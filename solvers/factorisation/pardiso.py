"""Intel MKL, found in the `mkl` wheel and called through ctypes, and its PARDISO; how many threads may be used.

The Schur complement comes out of PARDISO's numerical factorisation itself. Numbers of phases, parameters and errors are
those of the oneMKL Developer Reference, "oneMKL PARDISO - Parallel Direct Sparse Solver Interface" (C, iparm counted
from 0). K = [L 0; M 1] [1 0; 0 S] [Lᵀ Mᵀ; 0 1] with K_II = L Lᵀ.
"""

import ctypes
import os
import sys
import weakref
from collections.abc import Iterator
from contextlib import suppress
from enum import IntEnum
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from threading import RLock
from time import perf_counter
from typing import Any, Final, TypeAlias

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
    """MKL with its layers chosen, or None where it does not load.

    Another user of MKL in the same process may have fixed the layers before; then they stay as they are. In a working
    folder that has been deleted MKL would end the process.
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
    """Library and version, None if it does not load; the package's metadata are read once."""
    if library() is None:
        return None
    try:
        return f"mkl {distribution('mkl').version}"
    except PackageNotFoundError:
        return "mkl"


def _candidates() -> Iterator[Path]:
    """Places of the run-time library: the wheel's own list of files, then the environment's library folders."""
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


# How many threads a back end may use.


VARIABLES: Final = ("MKL_NUM_THREADS", "OMP_NUM_THREADS")
"""Environment variables that bound the threads of MKL, the first that is set."""


def thread_count(threads: int | None) -> int:
    """`threads`, or what the first of `VARIABLES` that is set says, or the number of cores this process may run on."""
    if threads is not None:
        return threads
    for variable in VARIABLES:
        first = os.environ.get(variable, "").split(",")[0].strip()  # OMP_NUM_THREADS may list nested levels
        if first.isdigit() and int(first) > 0:
            return int(first)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


# PARDISO.


_PERTURBATION: Final = 16  # digits after which a pivot is nothing; the usual 13 lose soft directions beside stiff ones
_MATRIX: Final = 1  # mnum: number of the matrix of a handle, here the only one
_PHASE, _COLUMNS, _ERROR = 3, 5, 7  # among the integer arguments
_WIDE_FROM: Final = int(np.iinfo(np.int32).max)  # entries of K that need 64-bit integers
_PROBES: Final = 2
_SINGULAR: Final = 0.1 / float(np.finfo(np.float64).eps)

_ONE_AT_A_TIME: Final = RLock()  # two threads in PARDISO end the process, even with matrices of their own
_UNNEEDED: "Final[list[_Handle]]" = []  # what is to be freed as soon as no other thread is inside


class Kind(IntEnum):
    """Argument `mtype`: what a real matrix is."""

    STRUCTURALLY_SYMMETRIC = 1
    POSITIVE_DEFINITE = 2


class Phase(IntEnum):
    """Argument `phase`."""

    ANALYSIS = 11
    NUMERIC = 22
    SOLVE = 33
    FORWARD = 331  # (g_I, g_Γ) → (L⁻¹ g_I, g_Γ − M L⁻¹ g_I)
    BACKWARD = 333  # (y_I, x_Γ) → (L⁻ᵀ (y_I − Mᵀ x_Γ), x_Γ)
    RELEASE = -1


class Setting(IntEnum):
    """Positions in `iparm`."""

    OWN_VALUES = 0  # 1: do not fill in defaults
    ORDERING = 1  # 2: METIS, 3: its parallel version
    PERTURBATION = 9  # p: pivots below 10⁻ᵖ |A| are made as large
    TWO_LEVEL = 23  # 1: two-level factorisation, in which S costs next to nothing
    ZERO_BASED = 34  # 1: indices from 0
    SCHUR = 35  # 2: dense S into x in the numeric phase, factors of K_II kept


_REASONS: Final[dict[int, tuple[Reason, str]]] = {
    -1: ("backend", "the input is inconsistent"),
    -2: ("memory", "out of memory"),
    -3: ("backend", "the ordering failed"),
    -4: ("singular", "a pivot is zero or negative"),
    -5: ("backend", "unclassified internal error"),
    -6: ("backend", "the ordering failed"),
    -7: ("singular", "a diagonal block is singular"),
    -8: ("memory", "32-bit integers overflow"),
}


class Pardiso(Factorisation):
    """Factors of K (n, n), n > k, in compressed columns with sorted indices; MKL holds them until nobody needs them.

    Every call runs with the number of threads given at the start.
    """

    backend = "pardiso"

    def __init__(self, K: Sparse, interface: IntVector, threads: int) -> None:
        self.version, self.interface, self.size = version() or "", interface, K.shape[0]
        start = perf_counter()
        # Upper triangle of K = Kᵀ in compressed rows: the lower triangle of its columns.
        keep = K.indices >= np.repeat(np.arange(self.size, dtype=K.indices.dtype), np.diff(K.indptr))
        starts = np.concatenate([[0], np.cumsum(keep)])[K.indptr]
        upper = (starts, K.indices[keep], K.data[keep])
        self._handle = handle = _Handle(Kind.POSITIVE_DEFINITE, upper, interface, threads, self)
        handle.call(Phase.ANALYSIS)
        analysed = perf_counter()
        schur = np.zeros((interface.size, interface.size))
        handle.call(Phase.NUMERIC, x=schur)
        self.schur = symmetrised(schur) if schur.size else schur
        factorised = perf_counter()
        diagonal = K.diagonal()
        self._diagonal = diagonal[interface]
        self._check_interior(diagonal)
        self.seconds = {
            "analysis": analysed - start,
            "numeric": factorised - analysed,
            "check": perf_counter() - factorised,
        }

    def _check_interior(self, diagonal: Vector) -> None:
        """`FactorisationError` if K_II is singular up to rounding, which PARDISO tells of exact zeros only.

        For g = D^½ ξ, D the diagonal of K_II and ξ of random signs, gᵀ K_II⁻¹ g = ‖L⁻¹ g‖² has the expectation
        tr (D^-½ K_II D^-½)⁻¹, about 1/λ with the smallest eigenvalue λ of the matrix scaled to unit diagonal. MKL
        would give pivots (iparm[55]), but without the two-level factorisation: 15 % dearer, this 2 %.
        """
        signs = np.random.default_rng(0).integers(2, size=(diagonal.size, _PROBES)) * 2.0 - 1.0
        y = self._phase(Phase.FORWARD, np.asarray(signs * np.sqrt(diagonal)[:, None], dtype=np.float64))
        y[self.interface] = 0.0
        energy = float(np.max(np.sum(y * y, axis=0)))
        if not energy < _SINGULAR:
            detail = f"an eigenvalue of the interior, scaled to unit diagonal, is {1.0 / energy:.1e}"
            raise FactorisationError("singular", self.backend, detail)

    def _forward(self, right: Matrix) -> State:
        return self._phase(Phase.FORWARD, right)

    def _backward(self, state: State, values: Matrix) -> Matrix:
        return self._phase(Phase.BACKWARD, self._with_values(state, values))

    def _phase(self, phase: Phase, b: Matrix) -> Matrix:
        b = np.asfortranarray(b)
        x = np.zeros(b.shape, order="F")
        if b.size:
            self._handle.call(phase, b, x)
        return x


class RefactorisedByPardiso:
    """H = L U for matrices H of one symmetric pattern, one after the other: ordering and symbolic analysis once.

    Pivots stay on the diagonal but for those inside a dense block. Methods are those of `MultifrontalLU`.
    """

    backend = "pardiso"

    def __init__(self, starts: IntVector, columns: IntVector, threads: int) -> None:
        self.version, rows = version() or "", (starts, columns, np.zeros(len(columns)))
        interface = np.zeros(0, dtype=np.int64)
        self._handle = _Handle(Kind.STRUCTURALLY_SYMMETRIC, rows, interface, threads, self)
        self._analysed = False

    def factorise(self, values: Vector) -> None:
        """Factorise H, its entries row by row; solves are by this matrix from now on."""
        handle = self._handle
        handle.values[:] = values
        if not self._analysed:
            handle.call(Phase.ANALYSIS)
            self._analysed = True
        handle.call(Phase.NUMERIC)

    def solve(self, right: Vector) -> Vector:
        """H⁻¹ right (n,)."""
        x = np.zeros_like(right)
        self._handle.call(Phase.SOLVE, np.array(right)[:, None], x[:, None])
        return x


_Rows: TypeAlias = tuple[NDArray[Any], NDArray[Any], Vector]
"""A matrix in compressed rows: row starts, columns, values."""


class _Handle:
    """PARDISO's arguments of one matrix: pt, iparm, and the matrix in compressed rows, if symmetric its upper half.

    What MKL holds is freed when the owner goes.
    """

    def __init__(self, kind: Kind, rows: _Rows, interface: IntVector, threads: int, owner: object) -> None:
        mkl = library()
        if mkl is None:
            raise FactorisationError("backend", "pardiso", "MKL does not load")
        self.mkl = mkl
        self.threads = threads
        self.kind = kind
        self.size = len(rows[0]) - 1
        self.integer: type[np.signedinteger[Any]] = np.int32 if len(rows[1]) < _WIDE_FROM else np.int64
        self.rows, self.columns = (np.ascontiguousarray(part, dtype=self.integer) for part in rows[:2])
        self.values = np.ascontiguousarray(rows[2])
        self.pt = np.zeros(64, dtype=np.int64)
        self.iparm = np.zeros(64, dtype=self.integer)
        self.iparm[[Setting.OWN_VALUES, Setting.ZERO_BASED, Setting.TWO_LEVEL]] = 1
        self.iparm[Setting.ORDERING] = 2
        self.iparm[Setting.PERTURBATION] = _PERTURBATION
        self.perm = np.zeros(self.size, dtype=self.integer)  # 1 on the interface
        if interface.size:
            self.iparm[Setting.SCHUR] = 2
            self.perm[interface] = 1
        # Addresses of all arguments but b and x, which stay where they are, in the order of `pardiso`.
        numbers = [1, _MATRIX, self.kind, 0, self.size, 0, 0, 0]
        self._integers = np.array(numbers, dtype=self.integer)
        maxfct, mnum, mtype, number, n, nrhs, msglvl, self._error = (_address(self._integers[i:]) for i in range(8))
        self._dummy = np.zeros(1)
        self._nothing = _address(self._dummy)
        self._arguments = (
            _address(self.pt), maxfct, mnum, mtype, number, n,
            _address(self.values), _address(self.rows), _address(self.columns), _address(self.perm),
            nrhs, _address(self.iparm), msglvl,
        )  # fmt: skip
        self._pardiso = self.mkl.pardiso_64 if self.integer is np.int64 else self.mkl.pardiso
        weakref.finalize(owner, self.release).atexit = False

    def call(self, phase: Phase, b: Matrix | None = None, x: Matrix | None = None) -> None:
        """One call of `pardiso`; `FactorisationError` for its error codes."""
        code = self._call(phase, b, x)
        if code:
            reason, detail = _REASONS.get(code, ("backend", "unknown error"))
            raise FactorisationError(reason, "pardiso", f"{detail} (code {code} in phase {phase.name.lower()})")

    def release(self) -> None:
        """Free everything that MKL holds for this matrix, now or when the next one goes."""
        _UNNEEDED.append(self)
        if _ONE_AT_A_TIME.acquire(blocking=False):  # the garbage collector must not wait: it may run inside any lock
            try:
                while _UNNEEDED:
                    _UNNEEDED.pop()._call(Phase.RELEASE, None, None)
            finally:
                _ONE_AT_A_TIME.release()

    def _call(self, phase: Phase, b: Matrix | None, x: Matrix | None) -> int:
        right = self._nothing if b is None else _address(b)
        left = self._nothing if x is None else _address(x)
        with foreign_code(), _ONE_AT_A_TIME:
            threads = self.mkl.MKL_Set_Num_Threads_Local(self.threads)  # of this Python thread
            self._integers[[_PHASE, _COLUMNS, _ERROR]] = phase, 1 if b is None else b.shape[1], 0
            self._pardiso(*self._arguments, right, left, self._error)
            self.mkl.MKL_Set_Num_Threads_Local(threads)
            return int(self._integers[_ERROR])


def _address(array: NDArray[Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
