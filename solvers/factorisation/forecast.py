"""What a factorisation will take: told before it begins, and refused if it is far beyond the limits.

Two numbers say how much work a factor L is, its entries |L| and its operations Σ_j |L_j|² over the columns. A law gives
them from the size of K alone,

    |L| ≈ nnz(K) (0.45 log₂ n − 3.65),    operations ≈ 0.1 |L|^1.5,

as for nested dissection in the plane (A. George, SIAM J. Numer. Anal. 10, 1973). Constants are fitted to K of
`compressed_plate` on 2 000 to 60 000 triangles with the degrees 3 to 7, on which the law is within 25 %. Long bodies
need much less, so that nothing is refused by it: where the law is beyond a limit both numbers are counted, by minimum
degree on groups of unknowns with the same neighbours. Times and bytes of a back end are proportional to them,

    seconds = a |L| + b operations,    bytes = c |L| + 16 k²    (k: unknowns of the dense Schur complement),

with constants measured on one core of an AMD EPYC. What is refused is beyond a limit by a factor of 2, or would begin
when the time is over.
"""

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from solvers.basics.progress import LOGGER, Progress, deadline, report
from solvers.basics.types import IntVector, Sparse
from solvers.factorisation.base import FactorisationError
from solvers.factorisation.superlu import filled, interior_groups

__all__ = ["Forecast", "Work", "check_limits", "machine_memory"]

_CLEAR: Final = 2.0  # times a limit that is refused: machines differ, and so do bodies
_WORTH_TELLING: Final = 2.0  # seconds
_SMALL: Final = 20_000  # unknowns that every back end factorises in a second
_GIGABYTE: Final = 1e9
_CGROUP: Final = Path("/sys/fs/cgroup/memory.max")  # of a container


class _Rate(NamedTuple):
    """Seconds an entry of L, seconds an operation, bytes an entry."""

    entry: float
    operation: float
    memory: float


_RATES: Final = {
    "pardiso": _Rate(3e-8, 4e-11, 7.0),
    "superlu": _Rate(2.2e-7, 2e-10, 55.0),
}


class Work(NamedTuple):
    """How much a factor L is.

    Attributes
    ----------
    entries : |L|
    operations : Σ_j |L_j|²

    """

    entries: float
    operations: float

    def times(self, factors: float) -> "Work":
        """Of so many factors like this one."""
        return Work(factors * self.entries, factors * self.operations)

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
    """What a factorisation is estimated to take.

    Attributes
    ----------
    seconds, bytes : float

    """

    seconds: float
    bytes: float

    @classmethod
    def of(cls, work: Work, backend: str, interface: int = 0, threads: int = 1) -> "Forecast":
        """By a back end on so many threads, which share the operations; SuperLU has one."""
        rate = _RATES[backend]
        shared = 1 if backend == "superlu" else threads
        seconds = rate.entry * work.entries + rate.operation * work.operations / shared
        return cls(seconds, rate.memory * work.entries + 16.0 * float(interface) ** 2)

    @property
    def cost(self) -> str:
        """Time and memory in words."""
        time = f"{self.seconds:.2g} s" if self.seconds < 100.0 else f"{self.seconds:.0f} s"
        return f"about {time} and {self.bytes / _GIGABYTE:.2g} GB"


def check_limits(
    K: Sparse, interface: IntVector, backend: str, threads: int, faster: str, *, symmetric: bool = True
) -> None:
    """Tell what the factorisation of K will take if that is long, and refuse what is far beyond the limits.

    The limits are the time that is left (see `watch`) and the memory of the machine. `faster` says how to get PARDISO
    where it is not the back end, and is empty where it is. L U of a K that is not `symmetric` is twice the work.

    Raises
    ------
    FactorisationError
        With the reason "time" or "memory".

    """
    n, k = K.shape[0], len(interface)
    if n < _SMALL:
        return
    factors = 1.0 if symmetric else 2.0
    work = Work.by_law(n, K.nnz).times(factors)
    expected = Forecast.of(work, backend, k, threads)
    late, seconds, memory = deadline.over, deadline.left, machine_memory()
    if not late and (expected.seconds > seconds or expected.bytes > memory):
        work = Work.counted(K, interface).times(factors)
        expected = Forecast.of(work, backend, k, threads)
    estimate = f"{n} unknowns are estimated to take {expected.cost}"
    advice = f"; PARDISO takes {Forecast.of(work, 'pardiso', k, threads).cost}: {faster}" if faster else ""
    if late and expected.seconds >= _WORTH_TELLING:
        raise FactorisationError("time", backend, f"{estimate}, and the time limit is over{advice}")
    if not late and expected.seconds > _CLEAR * seconds:
        limit = f"far beyond the time limit, of which {seconds:.3g} s are left"
        raise FactorisationError("time", backend, f"{estimate}, {limit}{advice}")
    if not late and expected.bytes > _CLEAR * memory:
        limit = f"far beyond the memory of this machine, {memory / _GIGABYTE:.3g} GB"
        raise FactorisationError("memory", backend, f"{estimate}, {limit}{advice}")
    if expected.seconds >= _WORTH_TELLING:
        stage = f"factorising {n} unknowns, {expected.cost} (an estimate)"
        LOGGER.info("%s: %s", backend, stage)
        report(Progress(backend, stage=stage))


def machine_memory() -> float:
    """Bytes of memory that this machine, or the container on it, has; infinity where nobody says."""
    return min(_memories(), default=float("inf"))


def _memories() -> Iterator[float]:
    with suppress(ValueError, OSError, AttributeError):
        yield float(os.sysconf("SC_PHYS_PAGES")) * float(os.sysconf("SC_PAGE_SIZE"))
    with suppress(ValueError, OSError):
        yield float(_CGROUP.read_text(encoding="ascii"))  # "max" where there is no limit
