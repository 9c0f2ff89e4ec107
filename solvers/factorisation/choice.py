"""Names of the back ends, the one taken by default, and `factorise`."""

import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from scipy.sparse import csc_array

from solvers.basics.checks import whole_number
from solvers.basics.progress import LOGGER, Progress, deadline, report
from solvers.basics.types import IntVector, Matrix, Module, Sparse, load
from solvers.errors import InputError, SolverUnavailableError
from solvers.factorisation.base import DENSE, SMALL, DenseFactor, Factorisation, FactorisationError, Reason
from solvers.factorisation.pardiso import thread_count
from solvers.factorisation.superlu import (
    Refactorisation,
    RefactorisedBySuperLU,
    SuperLU,
    filled,
    interior_groups,
    nested_dissection,
)

BACKENDS: Final = ("pardiso", "superlu")
"""Names of the sparse back ends, the fastest first."""

VARIABLE: Final = "QVI_CONTACT_FACTORISATION"
"""Environment variable with the name of the default back end."""

_INSTALL: Final = {"pardiso": "pip install mkl"}
_WORTH_INSTALLING: Final = 20_000  # unknowns from which on PARDISO is at least twice as fast
_WORTH_THREADS: Final = 50_000  # unknowns below which more threads cost more than they bring


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
        Symmetric positive definite, both triangles stored; the symmetry is not checked.
    interface : IntVector (k,)
        Γ: indices in increasing order, none twice. With k = 0 this is the plain factorisation, and nothing more.
    backend : str
        A name in `BACKENDS`, "dense", or "auto": the one in the environment variable QVI_CONTACT_FACTORISATION, else
        "dense" for up to 500 unknowns, else the first that is installed.
    threads : int, optional
        Threads to use; one below 50 000 unknowns if not given, and above what OMP_NUM_THREADS or MKL_NUM_THREADS say,
        or all cores this process may run on. "superlu" always has one.
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
        Before it begins: if it is estimated to take more than twice the time that is left (`deadline`), or twice the
        memory of the machine.

    """
    K, interface = _checked(K, interface)
    n = K.shape[0]
    if threads is not None and threads < 1:
        raise InputError("threads", threads, "give 1 or more, or None for all cores")
    threads = threads or _sensible_threads(n)
    small = backend == "auto" and chosen() is None and n <= SMALL
    nothing = interface.size == n  # is eliminated: S = K
    name = DENSE if small or nothing or backend == DENSE else resolve(backend)
    diagonal = K.diagonal()
    if not np.all(diagonal > 0.0):
        row = int(np.argmin(diagonal > 0.0))
        raise FactorisationError("singular", name, f"diagonal entry {row} of K is {diagonal[row]:.3g}")
    if name == BACKENDS[-1] and chosen() is None and n >= _WORTH_INSTALLING:
        LOGGER.info("%d unknowns by SuperLU; PARDISO takes half the time or less: %s", n, _INSTALL["pardiso"])
    try:
        if name == DENSE:
            return DenseFactor(K if isinstance(K, np.ndarray) else K.toarray(), interface)
        K = csc_array(K)
        check_limits(K, interface, name, threads)
        if name == BACKENDS[-1]:
            return SuperLU(K, interface, places)
        return _module(name).Pardiso(K, interface, threads)  # type: ignore[no-any-return]
    except MemoryError as error:
        raise FactorisationError("memory", name, "out of memory") from error


def _checked(K: Sparse | Matrix, interface: IntVector) -> tuple[Sparse | Matrix, IntVector]:
    """K as it is if it is dense, else in compressed columns with sorted indices; the interface as int64."""
    if len(K.shape) != 2 or K.shape[0] != K.shape[1]:
        raise InputError("K", K.shape, "give a square matrix")
    if not isinstance(K, np.ndarray):
        K = csc_array(K, dtype=np.float64)
        if not K.has_canonical_format:
            K = K.copy()
            K.sum_duplicates()
    if not np.isfinite(K if isinstance(K, np.ndarray) else K.data).all():
        raise InputError("K", "not finite", "give finite entries")
    indices = np.asarray(interface)
    if indices.size:
        if indices.ndim != 1 or indices.dtype.kind not in "iu" or np.any(np.diff(indices) <= 0):
            raise InputError("interface", indices, "give indices in increasing order, none twice: np.unique(indices)")
        if indices[0] < 0 or indices[-1] >= K.shape[0]:
            raise InputError("interface", indices, f"give indices from 0 to {K.shape[0] - 1}")
    return K, indices.astype(np.int64).ravel()


def refactorisation(
    starts: IntVector,
    columns: IntVector,
    backend: str = "auto",
    threads: int | None = None,
    places: Matrix | None = None,
) -> Refactorisation:
    """For matrices of a symmetric pattern in compressed rows with sorted columns.

    SuperLU eliminates unknowns by nested dissection of their places (n, 2) if these are known, else libraries look for
    an order: METIS, which PARDISO brings, finds as good ones. Backend and threads as for `factorise`.
    """
    backend = resolve(backend if backend in BACKENDS else "auto")
    threads = threads or _sensible_threads(len(starts) - 1)
    pattern = csc_array((np.ones(len(columns)), columns, starts))
    check_limits(pattern, np.zeros(0, dtype=np.int64), backend, threads, symmetric=False)
    if backend == "pardiso":
        return _module(backend).Refactorised(starts, columns, threads)  # type: ignore[no-any-return]
    return RefactorisedBySuperLU(
        starts, columns, None if places is None else nested_dissection(places, starts, columns)
    )


def _sensible_threads(unknowns: int) -> int:
    return 1 if unknowns < _WORTH_THREADS else thread_count(None)


def available_backends() -> dict[str, str]:
    """Back ends that load here, with their library and version, e.g. ``{"pardiso": "mkl 2026.2.0", …}``."""
    found = {name: _module(name).version() for name in BACKENDS}
    return {name: version for name, version in found.items() if version is not None}


def missing_backends() -> dict[str, str]:
    """Back ends that do not load here, with the command that installs them."""
    return {name: command for name, command in _INSTALL.items() if _module(name).version() is None}


def resolve(backend: str = "auto") -> str:
    """Name of the back end that `backend` means; `SolverUnavailableError` if it cannot be used."""
    if backend != "auto":
        return usable("backend", backend)
    return chosen() or next(name for name in BACKENDS if _module(name).version() is not None)


def chosen() -> str | None:
    """Name in the environment variable, None if there is none."""
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
        raise SolverUnavailableError(field, name, f"choose one of {', '.join((*others, *BACKENDS))}")
    if _module(name).version() is None:
        remedy = f"its library does not load ({_INSTALL.get(name, 'reinstall scipy')}); choose one of"
        raise SolverUnavailableError(field, name, f"{remedy} {', '.join((*others, *available_backends()))}")
    return name


def _module(name: str) -> Module:
    """Module of a back end, which has a `version()`."""
    return load(f"solvers.factorisation.{name}")


# Which factorisation a problem gets: the one asked for, or the first installed.


OTHERS: Final = ("auto", DENSE)
"""What is no back end."""

CHOICES: Final = (*OTHERS, *BACKENDS)
"""What can be asked for."""

_ALWAYS_CONDENSED: Final = 400  # unknowns of the interface
_SLOWER: Final = 3.6  # sparse operations beside dense ones, measured with plates and walls
_MOST_THREADS: Final = 1024  # more do not pay on any machine, and libraries take no number of any size


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


def condensing_pays(K: Sparse | Matrix, interface: int) -> bool:
    """Whether one dense matrix of the interface is factorised in less time than an unsymmetric sparse one like K.

    Dense elimination takes ⅔ k³ operations for k unknowns of the interface. Nested dissection of a plane mesh of
    squares with b unknowns at each node takes about 10 (b n)^1.5 for L Lᵀ and twice as many for L U, b = nnz / 9 n.
    They come in smaller blocks, and so more slowly. A few hundred unknowns are always condensed: what the sparse way
    costs besides is more than the dense one in all.
    """
    if interface <= _ALWAYS_CONDENSED or isinstance(K, np.ndarray):
        return True
    return bool(2.0 / 3.0 * float(interface) ** 3 <= _SLOWER * 20.0 * float(K.nnz / 9.0) ** 1.5)


# What a factorisation will take: told before it begins, and refused if it is far beyond the limits.
#
# Two numbers say how much work a factor L is, its entries |L| and its operations Σ_j |L_j|² over the columns. A law
# gives them from the size of K alone,
#
#     |L| ≈ nnz(K) (0.45 log₂ n − 3.65),    operations ≈ 0.1 |L|^1.5,
#
# as for nested dissection in the plane (A. George, SIAM J. Numer. Anal. 10, 1973). Constants are fitted to K of
# `compressed_plate` on 2 000 to 60 000 triangles with the degrees 3 to 7, on which the law is within 25 %. Long bodies
# need much less, so that nothing is refused by it: where the law is beyond a limit both numbers are counted, by minimum
# degree on groups of unknowns with the same neighbours. Times and bytes of a back end are proportional to them,
#
#     seconds = a |L| + b operations,    bytes = c |L| + 16 k²    (k: unknowns of the dense Schur complement),
#
# with constants measured on one core of an AMD EPYC. What is refused is beyond a limit by a factor of 2, or would begin
# when the time is over.


_CLEAR: Final = 2.0  # times a limit that is refused: machines differ, and so do bodies
_WORTH_TELLING: Final = 2.0  # seconds
_SMALL: Final = 20_000  # unknowns that every back end factorises in a second
_GIGABYTE: Final = 1e9
_CGROUP: Final = Path("/sys/fs/cgroup/memory.max")  # of a container
_RATES: Final = {"pardiso": (3e-8, 4e-11, 7.0), "superlu": (2.2e-7, 2e-10, 55.0)}  # a, b, c


class Work(NamedTuple):
    """How much a factor L is: its entries |L|, and operations Σ_j |L_j|²."""

    entries: float
    operations: float

    @classmethod
    def by_law(cls, n: int, nnz: int) -> "Work":
        """From the size of K (n, n) alone."""
        entries = nnz * max(1.0, 0.45 * float(np.log2(max(n, 2))) - 3.65)
        return cls(entries, 0.1 * entries**1.5)

    @classmethod
    def counted(cls, K: Sparse, interface: IntVector) -> "Work":
        """Of the interior of K, in the order of minimum degree; takes about a tenth of SuperLU's time for K."""
        _, graph, group = interior_groups(K, interface)
        order, rows, starts = filled(graph)
        width = np.bincount(group)[order].astype(np.float64)
        height = np.add.reduceat(width[rows], starts[:-1])  # of the columns of a group, its own rows included
        return cls(float((width * height - width * (width - 1.0) / 2.0).sum()), float((width * height**2).sum()))


class Forecast(NamedTuple):
    """Seconds and bytes that a factorisation is estimated to take."""

    seconds: float
    bytes: float

    @classmethod
    def of(cls, work: Work, backend: str, interface: int = 0, threads: int = 1, factors: float = 1.0) -> "Forecast":
        """By a back end on so many threads, which share the operations; SuperLU has one."""
        entry, operation, memory = _RATES[backend]
        shared = 1 if backend == "superlu" else threads
        seconds = factors * (entry * work.entries + operation * work.operations / shared)
        return cls(seconds, factors * memory * work.entries + 16.0 * float(interface) ** 2)

    @property
    def cost(self) -> str:
        """Time and memory in words."""
        time = f"{self.seconds:.2g} s" if self.seconds < 100.0 else f"{self.seconds:.0f} s"
        return f"about {time} and {self.bytes / _GIGABYTE:.2g} GB"


def check_limits(K: Sparse, interface: IntVector, backend: str, threads: int, *, symmetric: bool = True) -> None:
    """Tell what the factorisation of K will take if that is long, and refuse what is far beyond the limits.

    The limits are the time that is left (`deadline`) and the memory of the machine. L U of a K that is not `symmetric`
    is twice the work.

    Raises
    ------
    FactorisationError
        With the reason "time" or "memory".

    """
    n, k, factors = K.shape[0], len(interface), 1.0 if symmetric else 2.0
    if n < _SMALL:
        return
    work = Work.by_law(n, K.nnz)
    expected = Forecast.of(work, backend, k, threads, factors)
    late, seconds, memory = deadline.over, deadline.left, machine_memory()
    if not late and (expected.seconds > seconds or expected.bytes > memory):
        work = Work.counted(K, interface)
        expected = Forecast.of(work, backend, k, threads, factors)
    beyond: tuple[Reason, str] | None = None
    if late and expected.seconds >= _WORTH_TELLING:
        beyond = "time", "and the time limit is over"
    elif not late and expected.seconds > _CLEAR * seconds:
        beyond = "time", f"far beyond the time limit, of which {seconds:.3g} s are left"
    elif not late and expected.bytes > _CLEAR * memory:
        beyond = "memory", f"far beyond the memory of this machine, {memory / _GIGABYTE:.3g} GB"
    if beyond is not None:
        advice = ""
        if backend != BACKENDS[0]:
            how = missing_backends().get(BACKENDS[0], f"factorisation={BACKENDS[0]!r}")
            advice = f"; PARDISO takes {Forecast.of(work, BACKENDS[0], k, threads, factors).cost}: {how}"
        estimate = f"{n} unknowns are estimated to take {expected.cost}"
        raise FactorisationError(beyond[0], backend, f"{estimate}, {beyond[1]}{advice}")
    if expected.seconds >= _WORTH_TELLING:
        stage = f"factorising {n} unknowns, {expected.cost} (an estimate)"
        LOGGER.info("%s: %s", backend, stage)
        report(Progress(backend, stage=stage))


def machine_memory() -> float:
    """Bytes of memory that this machine, or the container on it, has; infinity where nobody says."""
    found = [float("inf")]
    with suppress(ValueError, OSError, AttributeError):
        found.append(float(os.sysconf("SC_PHYS_PAGES")) * float(os.sysconf("SC_PAGE_SIZE")))
    with suppress(ValueError, OSError):
        found.append(float(_CGROUP.read_text(encoding="ascii")))  # "max" where there is no limit
    return min(found)
