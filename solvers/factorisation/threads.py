"""How many threads a back end may use."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from functools import lru_cache
from typing import Final

from solvers.basics.types import Module, load
from solvers.factorisation import mkl

VARIABLES: Final = ("MKL_NUM_THREADS", "OMP_NUM_THREADS")
"""Environment variables that bound the threads of MKL, the first that is set."""


def thread_count(threads: int | None, variables: tuple[str, ...] = VARIABLES) -> int:
    """`threads`, or what the first of the variables set says, or the number of cores this process may run on."""
    if threads is not None:
        return threads
    for variable in variables:
        first = os.environ.get(variable, "").split(",")[0].strip()  # OMP_NUM_THREADS may list nested levels
        if first.isdigit() and int(first) > 0:
            return int(first)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def limited_blas(count: int) -> Iterator[None]:
    """Every BLAS loaded so far limited to `count` threads, as before on exit; left alone without threadpoolctl."""
    controller = _controller(len(sys.modules), mkl.library.cache_info().currsize)
    with nullcontext() if controller is None else controller.limit(limits=count, user_api="blas"):
        yield


@lru_cache(maxsize=1)
def _controller(modules: int, libraries: int) -> Module | None:  # noqa: ARG001  # they are the key
    """Made anew only when something was imported or MKL loaded: looking through all libraries takes milliseconds."""
    try:
        return load("threadpoolctl").ThreadpoolController()
    except ImportError:
        return None
