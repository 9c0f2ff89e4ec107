"""Which factorisation a problem gets: the one asked for, or the first installed."""

from contextlib import AbstractContextManager
from typing import Final, NamedTuple

import numpy as np
from scipy.sparse import csc_array

from solvers.basics.checks import whole_number
from solvers.basics.types import IntVector, Matrix, Sparse
from solvers.factorisation.base import Factorisation
from solvers.factorisation.dense import DENSE
from solvers.factorisation.forecast import check_limits
from solvers.factorisation.ordering import nested_dissection
from solvers.factorisation.registry import BACKENDS, factorise, faster_than, resolve, usable
from solvers.factorisation.threads import limited_blas, thread_count
from solvers.factorisation.unsymmetric import Refactorisation, refactorisation

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
    """For matrices of a symmetric pattern (`unsymmetric`): by PARDISO, unless another back end is asked for.

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
