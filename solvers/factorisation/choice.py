"""`factorise`, the names of the back ends, and the choice of one for a problem."""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from scipy.sparse import csc_array

from solvers.basics.checks import whole_number
from solvers.basics.progress import LOGGER, Progress, deadline, report
from solvers.basics.types import IntVector, Matrix, Sparse
from solvers.errors import SolverUnavailableError
from solvers.factorisation import pardiso
from solvers.factorisation.base import DENSE, SMALL, DenseFactor, Factorisation, FactorisationError
from solvers.factorisation.dissection import Multifrontal, MultifrontalLU
from solvers.factorisation.pardiso import Pardiso, RefactorisedByPardiso, thread_count

VARIABLE: Final = "QVI_CONTACT_FACTORISATION"
"""Environment variable with the name of the default back end."""

_VERSIONS: Final[Mapping[str, Callable[[], str | None]]] = {
    "pardiso": pardiso.version,
    "multifrontal": lambda: Multifrontal.version,
}
BACKENDS: Final = tuple(_VERSIONS)
"""Names of the sparse back ends, the fastest first."""

_INSTALL: Final = {"pardiso": "pip install mkl"}
_WORTH_THREADS: Final = 50_000  # unknowns below which one thread is fastest


def factorise(
    K: Sparse | Matrix,
    interface: IntVector,
    backend: str = "auto",
    threads: int | None = None,
    places: Matrix | None = None,
) -> Factorisation:
    """Factorise K and form the dense Schur complement S = K_ΓΓ − K_ΓI K_II⁻¹ K_IΓ.

    Parameters
    ----------
    K : (n, n)
        Symmetric positive definite and finite, both triangles stored, which is not checked.
    interface : IntVector (k,)
        Γ: indices in increasing order, none twice. With k = 0 this is the plain factorisation.
    backend : str
        A name in `BACKENDS`, "dense", or "auto": the one in the environment variable QVI_CONTACT_FACTORISATION, else
        "dense" for up to 400 unknowns, else the first that is installed.
    threads : int, optional
        Threads to use. By default one below 50 000 unknowns, above it the value of OMP_NUM_THREADS or MKL_NUM_THREADS,
        or all cores this process may run on. "multifrontal" always uses one.
    places : Matrix (n, 2), optional
        Coordinates of the unknowns, in any unit: with them "multifrontal" takes half the time.

    Raises
    ------
    SolverUnavailableError
        The back end does not exist or is not installed.
    FactorisationError
        K_II is not positive definite, memory is lacking, or the back end fails.
        With the reason "time": K is large, and the time limit is over (`deadline`).

    """
    n, threads = K.shape[0], threads or _sensible_threads(K.shape[0])
    is_small = backend == "auto" and chosen() is None and n <= SMALL
    is_interface_only = interface.size == n  # S = K
    name = DENSE if is_small or is_interface_only or backend == DENSE else resolve(backend)
    diagonal = K.diagonal()
    is_definite = diagonal > 0.0
    is_definite[interface] = True  # of K_II alone: equations may fix what K does not
    if not is_definite.all():
        row = int(np.argmin(is_definite))
        raise FactorisationError("singular", name, f"diagonal entry {row} of K is {diagonal[row]:.3g}")
    try:
        if name == DENSE:
            return DenseFactor(K if isinstance(K, np.ndarray) else K.toarray(), interface)
        K = csc_array(K)
        if not K.has_canonical_format:
            K = K.copy()
            K.sum_duplicates()
        _begin(K.shape[0], name)
        if name == BACKENDS[-1]:
            return Multifrontal(K, interface, places)
        return Pardiso(K, interface, threads)
    except MemoryError as error:
        raise FactorisationError("memory", name, "out of memory") from error


Refactorisation: TypeAlias = RefactorisedByPardiso | MultifrontalLU


def refactorisation(
    starts: IntVector,
    columns: IntVector,
    backend: str = "auto",
    threads: int | None = None,
    places: Matrix | None = None,
) -> Refactorisation:
    """Factorisation of one unsymmetric matrix after another, all of a symmetric pattern.

    The pattern is in compressed rows with sorted columns; backend, threads and places are those of `factorise`.
    """
    backend = resolve(backend if backend in BACKENDS else "auto")
    threads = threads or _sensible_threads(len(starts) - 1)
    _begin(len(starts) - 1, backend)
    if backend == "pardiso":
        return RefactorisedByPardiso(starts, columns, threads)
    return MultifrontalLU(starts, columns, places)


def _begin(unknowns: int, backend: str) -> None:
    """Report a factorisation that will take seconds; `FactorisationError` if the time limit is over."""
    if unknowns < _WORTH_THREADS:
        return
    if deadline.over:
        raise FactorisationError("time", backend, f"{unknowns} unknowns are left, and the time limit is over")
    report(Progress(backend, stage=f"factorising {unknowns} unknowns"))
    LOGGER.info("%s: factorising %d unknowns", backend, unknowns)


def _sensible_threads(unknowns: int) -> int:
    return 1 if unknowns < _WORTH_THREADS else thread_count()


def available_backends() -> dict[str, str]:
    """Back ends that load here, with their library and version, e.g. ``{"pardiso": "mkl 2026.2.0", …}``."""
    versions = {name: version() for name, version in _VERSIONS.items()}
    return {name: version for name, version in versions.items() if version is not None}


def missing_backends() -> dict[str, str]:
    """Back ends that do not load here, with the command that installs them."""
    return {name: command for name, command in _INSTALL.items() if _VERSIONS[name]() is None}


def resolve(backend: str = "auto") -> str:
    """Name of the back end for the argument `backend`; `SolverUnavailableError` if it cannot be used."""
    if backend != "auto":
        return usable("backend", backend)
    return chosen() or next(name for name in BACKENDS if _VERSIONS[name]() is not None)


def chosen() -> str | None:
    """Name of the back end in the environment variable, None if it is not set."""
    name = os.environ.get(VARIABLE, "").strip().lower()
    return None if name in ("", "auto") else usable(VARIABLE, name)


def usable(field: str, name: str, others: Sequence[str] = ("auto",)) -> str:
    """The name if its back end loads here, else `SolverUnavailableError`, which lists these names and `others`."""
    if name not in BACKENDS:
        raise SolverUnavailableError(field, name, f"choose one of {', '.join((*others, *BACKENDS))}")
    if _VERSIONS[name]() is None:
        remedy = f"its library does not load ({_INSTALL.get(name, 'reinstall scipy')}); choose one of"
        raise SolverUnavailableError(field, name, f"{remedy} {', '.join((*others, *available_backends()))}")
    return name


# The factorisation of a problem: the one asked for, or the first installed.

OTHERS: Final = ("auto", DENSE)
"""Names that are accepted besides those of the sparse back ends."""

CHOICES: Final = (*OTHERS, *BACKENDS)
"""All names that are accepted."""

_ALWAYS_CONDENSED: Final = 400  # unknowns of the interface up to which it is always condensed
_SLOWER: Final = 3.6  # time of a sparse operation over that of a dense one, measured with plates and walls
_MOST_THREADS: Final = 1024  # more gain nothing on any machine, and libraries accept only 32-bit numbers


class Request(NamedTuple):
    """A requested factorisation, one of `CHOICES`, and its number of threads, None for the default."""

    name: str = "auto"
    threads: int | None = None

    @classmethod
    def checked(cls, name: object, threads: object) -> "Request":
        """The request for a user's arguments; `SolverUnavailableError` as `usable`, `InputError` for the threads."""
        canonical = str(name).lower()
        if canonical not in OTHERS:
            usable("factorisation", canonical, OTHERS)
        return cls(canonical, None if threads is None else whole_number("threads", threads, _MOST_THREADS))


def condensing_pays(K: Sparse | Matrix, interface: int) -> bool:
    """Whether a dense matrix of the interface is factorised in less time than a sparse unsymmetric one like K.

    Dense elimination takes ⅔ k³ operations for k unknowns of the interface. Nested dissection of a plane mesh of
    squares with b unknowns at each node takes about 10 (b n)^1.5 for L Lᵀ and twice as many for L U, b = nnz / 9 n.
    These are slower, as their blocks are smaller. A few hundred unknowns are always condensed, as the overhead of the
    sparse system then exceeds the time of the dense one.
    """
    if interface <= _ALWAYS_CONDENSED or isinstance(K, np.ndarray):
        return True
    return bool(2.0 / 3.0 * float(interface) ** 3 <= _SLOWER * 20.0 * float(K.nnz / 9.0) ** 1.5)
