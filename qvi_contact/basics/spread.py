"""Work spread over processes: of this machine, or of a Dask cluster.

Processes of this machine end with the one that started them, however it ends: they hold one end of a pipe, whose other
end nobody has but that one.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from threading import Thread
from typing import TYPE_CHECKING, Final, TypeVar

from qvi_contact.basics.checks import whole_number
from qvi_contact.basics.cluster import check, connected
from qvi_contact.errors import InputError, QVIError, SolveError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

_MOST_WORKERS: Final = 10_000
_AHEAD: Final = 2  # orders that are given out for each worker: one more than it does
_LOOK: Final = 0.5  # seconds between two looks at a cluster

Order = TypeVar("Order")
Found = TypeVar("Found")


@dataclass(frozen=True)
class Crew:
    """Who does the work.

    Attributes
    ----------
    workers : int
        Processes of this machine.
    dask : str, optional
        Address of the scheduler of a Dask cluster to take instead, each thread of its workers.

    Raises
    ------
    InputError
        If one of them cannot be.

    """

    workers: int = 1
    dask: str | None = None

    def __post_init__(self) -> None:
        whole_number("workers", self.workers, _MOST_WORKERS)
        if self.dask is not None:
            check(self.dask)

    @property
    def elsewhere(self) -> bool:
        """Whether anything is gained by other processes than this one."""
        return self.workers > 1 or self.dask is not None

    def spread(self, work: Callable[[Order], Found], orders: Callable[[int], Iterable[Order]]) -> Generator[Found]:
        """What the work finds for each order, as it comes; closing the iterator ends what is under way.

        Parameters
        ----------
        work : callable
            A function of a module, which processes elsewhere can import.
        orders : callable
            The orders, by the number of workers there are at the beginning.

        Raises
        ------
        InputError
            If the cluster cannot be reached, or cannot load this package.
        SolveError
            If a process is lost with its order.

        """
        with self._executor() as (executor, size):
            waiting, busy = iter(orders(size())), set[Future[Found]]()
            while True:
                for order in islice(waiting, max(0, _AHEAD * size() - len(busy))):
                    busy.add(executor.submit(work, order))
                if not busy:
                    return
                done, busy = wait(busy, _LOOK, FIRST_COMPLETED)
                yield from (self._found(future) for future in done)

    @contextmanager
    def _executor(self) -> Iterator[tuple[Executor, Callable[[], int]]]:
        """Who takes orders, and how many of them at a time."""
        if self.dask is None:
            with _processes(self.workers) as executor:
                yield executor, lambda: self.workers
            return
        with connected(self.dask) as client:

            def threads() -> int:
                try:
                    return sum(client.nthreads().values())
                except Exception as error:
                    remedy = "the scheduler was lost: give the same command again when it is back"
                    raise InputError("dask", self.dask, remedy) from error

            executor = client.get_executor(pure=False)
            try:
                yield executor, threads
            finally:
                executor.shutdown(wait=False)

    def _found(self, future: Future[Found]) -> Found:
        """What an order gave."""
        try:
            return future.result()
        except QVIError:
            raise
        except BrokenProcessPool as error:
            raise SolveError(
                "a worker process ended before its work was done: it was killed, ran out of memory, or was started by "
                'a script without if __name__ == "__main__". Give the same command again, with fewer workers if memory '
                "is short"
            ) from error
        except Exception as error:
            if self.dask is None:
                raise
            remedy = (
                f"the cluster could not do its work ({_one_line(error)}): its scheduler and workers need this package "
                "in the same version; then give the same command again"
            )
            raise InputError("dask", self.dask, remedy) from error


@contextmanager
def _processes(count: int) -> Iterator[ProcessPoolExecutor]:
    """Processes that are started afresh, as threads do not survive a fork."""
    context = multiprocessing.get_context("spawn")
    lifeline, held = context.Pipe(duplex=False)
    executor = ProcessPoolExecutor(count, mp_context=context, initializer=_bind, initargs=(lifeline,))
    try:
        yield executor
        executor.shutdown()
    finally:
        held.close()
        executor.shutdown(cancel_futures=True)
        lifeline.close()


def _bind(lifeline: Connection) -> None:
    """Let this process end with the one that holds the other end; an interrupt from the keyboard is for that one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with, args=(lifeline,), daemon=True).start()


def _end_with(lifeline: Connection) -> None:
    with suppress(EOFError, OSError):
        lifeline.recv_bytes()
    os._exit(1)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
