"""Intel MKL's run-time library, found in the `mkl` wheel and called through ctypes."""

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from enum import IntEnum
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Final

from solvers.basics.types import Module, load

_PATTERNS: Final = ("libmkl_rt.so*", "libmkl_rt*.dylib", "mkl_rt*.dll")
_OPENMP: Final = ("libiomp5.so", "libiomp5.dylib", "libiomp5md.dll")


class ThreadingLayer(IntEnum):
    """Arguments of MKL_Set_Threading_Layer (mkl_service.h)."""

    INTEL = 0
    SEQUENTIAL = 1


LP64: Final = 0
"""Argument of MKL_Set_Interface_Layer: 32-bit integers."""


@lru_cache(maxsize=1)
def library() -> ctypes.CDLL | None:
    """MKL with its layers chosen, or None where it does not load.

    Another user of MKL in the same process may have fixed the layers before; then they stay as they are. In a working
    folder that has been deleted MKL would end the process.
    """
    if not _has_working_folder():
        return None
    for path in _candidates():
        with suppress(OSError):
            mkl = ctypes.CDLL(str(path))
            mkl.MKL_Set_Interface_Layer(LP64)
            mkl.MKL_Set_Threading_Layer(_threading_layer(path.parent))
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


@contextmanager
def limited_threads(mkl: ctypes.CDLL, count: int) -> Iterator[None]:
    """MKL with `count` threads in this Python thread, as before on exit."""
    previous = mkl.MKL_Set_Num_Threads_Local(count)
    try:
        yield
    finally:
        mkl.MKL_Set_Num_Threads_Local(previous)


def _has_working_folder() -> bool:
    try:
        return bool(Path.cwd())
    except OSError:
        return False


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


def _threading_layer(folder: Path) -> ThreadingLayer:
    """Intel's OpenMP if its library loads, else no threads."""
    for name in _OPENMP:
        for path in (str(folder / name), name):
            with suppress(OSError):
                ctypes.CDLL(path)
                return ThreadingLayer.INTEL
    return ThreadingLayer.SEQUENTIAL


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


@contextmanager
def limited_blas(count: int) -> Iterator[None]:
    """Every BLAS loaded so far limited to `count` threads, as before on exit; left alone without threadpoolctl."""
    libraries = _blas_libraries(len(sys.modules), library.cache_info().currsize)
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
def _blas_libraries(modules: int, libraries: int) -> list[Module]:  # noqa: ARG001  # they are the key
    """Looked for anew only when something was imported or MKL loaded: that takes milliseconds."""
    try:
        found = load("threadpoolctl").ThreadpoolController().lib_controllers
    except ImportError:
        return []
    return [each for each in found if each.user_api == "blas"]
