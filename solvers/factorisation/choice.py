"""Which factorisation a problem gets: the one asked for, shared subdomains where they apply, or the first installed."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from solvers.basics.types import IntVector, Sparse
from solvers.errors import InputError, SolverUnavailableError
from solvers.factorisation.base import Factorisation
from solvers.factorisation.dissection import SharedSubdomains, SubdomainTree
from solvers.factorisation.registry import BACKENDS, chosen, factorise, resolve
from solvers.factorisation.threads import limited_blas, thread_count

SHARED: Final = "shared-subdomains"
CHOICES: Final = ("auto", SHARED, *BACKENDS)
"""What `using` takes."""

Structure: TypeAlias = Callable[[IntVector], SubdomainTree | None]
"""K as a tree of subdomains for an interface Γ, None where K has no such structure."""

_WORTH_SHARING: Final = 10_000  # unknowns from which on shared subdomains are faster than any sparse back end
_WORTH_THREADS: Final = 50_000  # unknowns below which more threads cost more than they bring


class _Request(NamedTuple):
    name: str = "auto"
    threads: int | None = None


_AUTOMATIC: Final = _Request()
_request: ContextVar[_Request] = ContextVar("factorisation", default=_AUTOMATIC)


@contextmanager
def using(name: str, threads: int | None, unknowns: int) -> Iterator[None]:
    """Take this factorisation, and so many threads within the context, by default one, and all cores for a large K.

    BLAS has the threads given, one by default: on busy machines more are slower by far.

    Raises
    ------
    SolverUnavailableError
        The name is not in `CHOICES`, or its library does not load.
    InputError
        `threads` is not a whole number ≥ 1.

    """
    canonical = str(name).lower()
    if canonical not in CHOICES:
        raise SolverUnavailableError("factorisation", name, f"choose one of {', '.join(CHOICES)}")
    if canonical in BACKENDS:
        resolve(canonical)
    number: object = threads
    if number is not None and (isinstance(number, bool) or not isinstance(number, int | np.integer) or number < 1):
        raise InputError("threads", threads, "give a whole number ≥ 1, or None")
    threads = int(threads) if threads is not None else None
    count = threads or _sensible_threads(unknowns)
    token = _request.set(_Request(canonical, count))
    try:
        with limited_blas(threads or 1):
            yield
    finally:
        _request.reset(token)


def fits(factor: Factorisation) -> bool:
    """Whether a factorisation made earlier is what is asked for now."""
    name = _request.get().name
    return name in ("auto", factor.backend) or factor.backend not in CHOICES


def make(K: Sparse, interface: IntVector, structure: Structure | None) -> Factorisation:
    """Factorise K as asked for; errors of `factorise`, and `SolverUnavailableError` if sharing does not apply."""
    name, threads = _request.get()
    wanted = name if name != "auto" else chosen()
    if wanted == SHARED or (wanted is None and structure is not None and K.shape[0] >= _WORTH_SHARING):
        tree = structure(interface) if structure is not None else None
        if tree is not None:
            return SharedSubdomains(tree, threads or 1)
        if wanted == SHARED:
            remedy = "takes a rectangle of equal cells and one material, contact on its sides; choose another one"
            raise SolverUnavailableError("factorisation", SHARED, remedy)
    return factorise(K, interface, name, threads or _sensible_threads(K.shape[0]))


def _sensible_threads(unknowns: int) -> int:
    return 1 if unknowns < _WORTH_THREADS else thread_count(None)
