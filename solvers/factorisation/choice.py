"""Names of the back ends, the one taken by default, and `factorise`."""

import os
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import Final, NamedTuple

import numpy as np
from scipy.sparse import csc_array

from solvers.basics.checks import whole_number
from solvers.basics.names import remedy_if_retired
from solvers.basics.progress import LOGGER
from solvers.basics.types import IntVector, Matrix, Module, Sparse, load
from solvers.errors import InputError, SolverUnavailableError
from solvers.factorisation.base import DENSE, SMALL, DenseFactor, Factorisation, FactorisationError, NoInterior
from solvers.factorisation.forecast import check_limits
from solvers.factorisation.mkl import limited_blas, thread_count
from solvers.factorisation.superlu import Refactorisation, SuperLU, nested_dissection, refactorisation

BACKENDS: Final = ("pardiso", "superlu")
"""Names of the sparse back ends, the fastest first."""

VARIABLE: Final = "QVI_CONTACT_FACTORISATION"
"""Environment variable with the name of the default back end."""

_INSTALL: Final = {"pardiso": "pip install mkl"}
_WORTH_INSTALLING: Final = 20_000  # unknowns from which on PARDISO is at least twice as fast
_default: str | None = None


def factorise(
    K: Sparse,
    interface: IntVector,
    backend: str = "auto",
    threads: int | None = None,
    places: Matrix | None = None,
) -> Factorisation:
    """Factorise K and form the dense Schur complement S = K_ΓΓ − K_ΓI K_II⁻¹ K_IΓ.

    Parameters
    ----------
    K : Sparse (n, n)
        Symmetric positive definite, both triangles stored; the symmetry is not checked.
    interface : IntVector (k,)
        Γ: indices in increasing order, none twice. With k = 0 this is the plain factorisation, and nothing more.
    backend : str
        A name in `BACKENDS`, "dense", or "auto": the name given to `set_default`, else the one in the environment
        variable QVI_CONTACT_FACTORISATION, else "dense" for up to 500 unknowns, else the first that is installed.
    threads : int, optional
        Threads to use; all cores this process may run on, or OMP_NUM_THREADS, or MKL_NUM_THREADS if not given.
        "superlu" always has one.
    places : Matrix (n, 2), optional
        Where the unknowns are, in any unit. SuperLU takes half the time with them: it eliminates by nested dissection.

    Raises
    ------
    InputError
        K is not square, holds numbers that are not finite, or the interface is not increasing or out of range.
    SolverUnavailableError
        The back end does not exist or is not installed.
    FactorisationError
        K_II is not positive definite, memory is lacking, or the back end fails. An indefinite S is found by `solve`.
        Before it begins: if it is estimated to take more than twice the time that is left (see `watch`), or twice the
        memory of the machine.

    """
    K, interface = _checked(K, interface)
    if threads is not None and threads < 1:
        raise InputError("threads", threads, "give 1 or more, or None for all cores")
    small = backend == "auto" and chosen() is None and K.shape[0] <= SMALL
    name = DENSE if small or backend == DENSE else resolve(backend)
    if interface.size == K.shape[0]:
        return NoInterior(K, interface)
    diagonal = K.diagonal()
    if not np.all(diagonal > 0.0):
        row = int(np.argmin(diagonal > 0.0))
        raise FactorisationError("singular", name, f"diagonal entry {row} of K is {diagonal[row]:.3g}")
    if name == BACKENDS[-1] and chosen() is None and K.shape[0] >= _WORTH_INSTALLING:
        LOGGER.info("%d unknowns by SuperLU; PARDISO takes half the time or less: %s", K.shape[0], _INSTALL["pardiso"])
    try:
        if name == DENSE:
            return DenseFactor(K, interface)
        check_limits(K, interface, name, thread_count(threads), faster_than(name))
        if name == BACKENDS[-1]:
            return SuperLU(K, interface, places)
        return _module(name).factorise(K, interface, threads)  # type: ignore[no-any-return]
    except MemoryError as error:
        raise FactorisationError("memory", name, "out of memory") from error


def faster_than(name: str) -> str:
    """How to get the fastest back end in the place of another one; empty if that is the fastest."""
    if name == BACKENDS[0]:
        return ""
    missing = _module(BACKENDS[0]).version() is None
    return _INSTALL[BACKENDS[0]] if missing else f"factorisation={BACKENDS[0]!r}"


def available_backends() -> dict[str, str]:
    """Back ends that load here, with their library and version, e.g. ``{"pardiso": "mkl 2026.2.0", …}``."""
    found = {name: _module(name).version() for name in BACKENDS}
    return {name: version for name, version in found.items() if version is not None}


def missing_backends() -> dict[str, str]:
    """Back ends that do not load here, with the command that installs them."""
    return {name: command for name, command in _INSTALL.items() if _module(name).version() is None}


def set_default(name: str | None) -> None:
    """Choose the back end that "auto" means; None: by the environment variable, or the first available."""
    global _default
    _default = None if name is None else usable("backend", name)


def resolve(backend: str = "auto") -> str:
    """Name of the back end that `backend` means; `SolverUnavailableError` if it cannot be used."""
    if backend != "auto":
        return usable("backend", backend)
    return chosen() or next(name for name in BACKENDS if _module(name).version() is not None)


def chosen() -> str | None:
    """Name given to `set_default`, else the one in the environment variable, None if neither is given."""
    if _default is not None:
        return _default
    name = os.environ.get(VARIABLE, "").strip().lower()
    return None if name in ("", "auto") else usable(VARIABLE, name)


def usable(field: str, name: str, others: Sequence[str] = ("auto",)) -> str:
    """The name if it is that of a back end that loads here; `others` are what `field` may name beside back ends.

    Raises
    ------
    SolverUnavailableError
        If it is not; about `field`.

    """
    if name not in BACKENDS:
        remedy = remedy_if_retired(name) or f"choose one of {', '.join((*others, *BACKENDS))}"
        raise SolverUnavailableError(field, name, remedy)
    if _module(name).version() is None:
        remedy = f"its library does not load ({_INSTALL.get(name, 'reinstall scipy')}); choose one of"
        raise SolverUnavailableError(field, name, f"{remedy} {', '.join((*others, *available_backends()))}")
    return name


def _module(name: str) -> Module:
    """Module of a back end: `version()`, and `factorise(K, interface, threads)`."""
    return load(f"solvers.factorisation.{name}")


def _checked(K: Sparse, interface: IntVector) -> tuple[Sparse, IntVector]:
    """K in compressed columns with sorted indices, and the interface as int64."""
    if len(K.shape) != 2 or K.shape[0] != K.shape[1]:
        raise InputError("K", K.shape, "give a square matrix")
    if getattr(K, "format", "") != "csc" or K.dtype != np.float64:
        K = csc_array(K, dtype=np.float64)
    if not K.has_canonical_format:
        K = K.copy()
        K.sum_duplicates()
    if not np.isfinite(K.data).all():
        raise InputError("K", "not finite", "give finite entries")
    return K, _checked_interface(interface, K.shape[0])


def _checked_interface(interface: IntVector, n: int) -> IntVector:
    indices = np.asarray(interface)
    if indices.size == 0:
        return np.zeros(0, dtype=np.int64)
    if indices.ndim != 1 or indices.dtype.kind not in "iu":
        raise InputError("interface", indices.shape, "give a one-dimensional array of indices")
    if np.any(np.diff(indices) <= 0):
        raise InputError("interface", indices, "give the indices in increasing order, none twice: np.unique(indices)")
    if indices[0] < 0 or indices[-1] >= n:
        raise InputError("interface", indices, f"give indices from 0 to {n - 1}")
    return indices.astype(np.int64)


# Which factorisation a problem gets: the one asked for, or the first installed.


OTHERS: Final = ("auto", DENSE)
"""What is no back end."""

CHOICES: Final = (*OTHERS, *BACKENDS)
"""What can be asked for."""

_ALWAYS_CONDENSED: Final = 400  # unknowns of the interface
_SLOWER: Final = 3.6  # sparse operations beside dense ones, measured with plates and walls
_MOST_THREADS: Final = 1024  # more do not pay on any machine, and libraries take no number of any size
_WORTH_THREADS: Final = 50_000  # unknowns below which more threads cost more than they bring


class Request(NamedTuple):
    """The factorisation that is wanted, one of `CHOICES`, and on how many threads: None for as many as make sense."""

    name: str = "auto"
    threads: int | None = None

    @classmethod
    def checked(cls, name: object, threads: object) -> "Request":
        """From what a user gave.

        Raises
        ------
        SolverUnavailableError
            The name is not in `CHOICES`, or its library does not load.
        InputError
            `threads` is not a whole number from 1 to 1024.

        """
        canonical = str(name).lower()
        if canonical not in OTHERS:
            usable("factorisation", canonical, OTHERS)
        if threads is None:
            return cls(canonical)
        return cls(canonical, whole_number("threads", threads, _MOST_THREADS))

    def fits(self, factor: Factorisation) -> bool:
        """Whether a factorisation made earlier is what is asked for."""
        return self.name in ("auto", factor.backend) or factor.backend not in CHOICES

    def limited_blas(self) -> AbstractContextManager[None]:
        """BLAS with the threads given, one by default: on busy machines more are slower by far."""
        return limited_blas(self.threads or 1)


def make(K: Sparse, interface: IntVector, request: Request, places: Matrix | None = None) -> Factorisation:
    """Factorise K as asked for, `places` (n, 2) of the unknowns if they are known; errors of `factorise`.

    Without a number of threads it is one, and all cores for a large K.
    """
    return factorise(K, interface, request.name, request.threads or _sensible_threads(K.shape[0]), places)


def make_unsymmetric(starts: IntVector, columns: IntVector, places: Matrix | None, request: Request) -> Refactorisation:
    """For matrices of a symmetric pattern (`Refactorisation`): by PARDISO, unless another back end is asked for.

    SuperLU eliminates unknowns by nested dissection of their places (n, 2) if these are known, else libraries look for
    an order: METIS, which PARDISO brings, finds as good ones.
    """
    backend = resolve(request.name if request.name in BACKENDS else "auto")
    threads = request.threads or _sensible_threads(len(starts) - 1)
    pattern = csc_array((np.ones(len(columns)), columns, starts))
    nothing = np.zeros(0, dtype=np.int64)
    check_limits(pattern, nothing, backend, threads, faster_than(backend), symmetric=False)
    order = None if places is None or backend == "pardiso" else nested_dissection(places, starts, columns)
    return refactorisation(starts, columns, backend, threads, order)


def condensing_pays(K: Sparse, interface: int) -> bool:
    """Whether one dense matrix of the interface is factorised in less time than an unsymmetric sparse one like K.

    Operations of the sparse way come in smaller blocks, and so more slowly; by how much is what `python -m comparisons
    systems` measures. A few hundred unknowns are always condensed: what the sparse way costs besides is more than the
    dense one in all.
    """
    if interface <= _ALWAYS_CONDENSED:
        return True
    dense, sparse = operations(K, interface)
    return dense <= _SLOWER * sparse


def operations(K: Sparse, interface: int) -> tuple[float, float]:
    """Of a dense factorisation of the interface, and of an unsymmetric sparse one like K.

    Dense elimination takes ⅔ k³ operations for k unknowns of the interface. Nested dissection of a plane mesh of
    squares with b unknowns at each node takes about 10 (b n)^1.5 for L Lᵀ and twice as many for L U, b = nnz / 9 n.
    """
    return 2.0 / 3.0 * float(interface) ** 3, 2.0 * 10.0 * float(K.nnz / 9.0) ** 1.5


def _sensible_threads(unknowns: int) -> int:
    return 1 if unknowns < _WORTH_THREADS else thread_count(None)
