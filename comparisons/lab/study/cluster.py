"""Cases on a Dask cluster: each thread of its workers gets a worker process of its own, as on this machine.

So limits and failures are the same there, and a case that takes its process with it does not take Dask's. The cluster's
workers need this package and the task in the same versions; the rows tell which they had. Only the client writes rows.

Which worker does a case is decided here, not by Dask, which would try a case three more times when workers are lost.
Here it is tried once more, on another worker if there is one.
"""

import pickle
import time
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, Final
from uuid import uuid4

from comparisons.lab.study.children import Crew, Terms
from comparisons.lab.study.declaration import Case
from comparisons.lab.study.pool import Done
from comparisons.lab.worker.outcome import CRASHED, Outcome, one_line
from qvi_contact.basics.cluster import connected
from qvi_contact.errors import InputError

if TYPE_CHECKING:
    from distributed import Client, Future

_FETCHING: Final = 30.0  # seconds for one outcome
_LOOK: Final = 0.5  # seconds between two looks at the cluster's workers
_ATTEMPTS: Final = 2


def outcomes(terms: Terms, cases: Sequence[Case], address: str) -> Generator[Done]:
    """Do the cases on the cluster of this scheduler, and yield what became of each as it comes.

    The address has passed `basics.cluster.check`. When the iterator is closed, the processes are ended.

    Raises
    ------
    InputError
        If the cluster cannot be reached, has no workers, cannot load this package or the task's, or is lost.

    """
    with connected(address) as client:
        dispatch = _Dispatch(client, address, terms, deque(_Trial(case) for case in cases))
        try:
            yield from dispatch.outcomes()
        finally:
            dispatch.end()


@dataclass
class _Trial:
    """A case, and the workers it was given to."""

    case: Case
    workers: list[str] = field(default_factory=list)
    began: float = 0.0


class _Dispatch:
    """Which case is where."""

    def __init__(self, client: "Client", address: str, terms: Terms, waiting: deque[_Trial]) -> None:
        self._client = client
        self._address = address
        self._terms = terms
        self._run = uuid4().hex
        self._waiting = waiting
        self._busy: dict[Future, _Trial] = {}
        self._news: SimpleQueue[Future] = SimpleQueue()
        self._lost_scheduler = False

    def outcomes(self) -> Iterator[Done]:
        """Until all cases are done; a worker that joins gets its share, without any worker it waits."""
        while self._waiting or self._busy:
            alive = self._alive()
            for future in [future for future, trial in self._busy.items() if trial.workers[-1] not in alive]:
                yield from self._lost(future)
            self._submit(alive)
            with suppress(Empty):
                future = self._news.get(timeout=_LOOK)
                if future in self._busy:
                    yield from self._finished(future)

    def end(self) -> None:
        """Take back what is under way, and end the processes on the cluster."""
        if self._lost_scheduler:  # nobody can be told; its workers end by themselves within half a minute
            return
        with suppress(Exception):  # what the cluster has lost is ended already
            self._client.cancel(list(self._busy), force=True)
            self._client.run(forget, self._run, self._terms)

    def _alive(self) -> Mapping[str, int]:
        """Address → threads of the workers there are now."""
        try:
            found: dict[str, int] = self._client.nthreads()
        except Exception as error:
            raise self._gone() from error
        return found

    def _submit(self, alive: Mapping[str, int]) -> None:
        """Give waiting cases to free threads."""
        used = Counter(trial.workers[-1] for trial in self._busy.values())
        free = {worker: threads - used[worker] for worker, threads in alive.items()}
        for _ in range(len(self._waiting)):
            if not any(count > 0 for count in free.values()):
                return
            trial = self._waiting.popleft()
            others = [worker for worker in alive if worker not in trial.workers] or list(alive)
            best = max(others, key=lambda worker: free[worker])
            if free[best] <= 0:  # it waits for another worker than the one that was lost
                self._waiting.append(trial)
                continue
            free[best] -= 1
            trial.workers.append(best)
            trial.began = time.monotonic()
            future = self._client.submit(
                _unpacking(), pickle.dumps((work, self._run, self._terms, dict(trial.case.values))),
                key=f"study-{self._run}-{trial.case.key}-{len(trial.workers)}",
                workers=[best], allow_other_workers=False, pure=False,
            )  # fmt: skip
            self._busy[future] = trial
            future.add_done_callback(self._news.put)

    def _finished(self, future: "Future") -> Iterator[Done]:
        if future.status != "finished":
            if self._client.status != "running":
                raise self._gone()
            error = future.exception() if future.status == "error" else None
            if error is not None and type(error).__name__ != "KilledWorker":
                remedy = f"install this package and the task's on its scheduler and workers ({one_line(str(error))})"
                raise InputError("dask", self._address, remedy)
            yield from self._lost(future)
            return
        try:
            outcome: Outcome = future.result(timeout=_FETCHING)
        except Exception:  # its worker was lost before it could be fetched
            yield from self._lost(future)
            return
        yield self._busy.pop(future).case, outcome

    def _lost(self, future: "Future") -> Iterator[Done]:
        """Try again, or tell that it failed twice."""
        trial = self._busy.pop(future)
        with suppress(Exception):
            future.cancel(force=True)
        if len(trial.workers) < _ATTEMPTS:
            self._waiting.appendleft(trial)
            return
        reason = f"the worker of the cluster was lost, {_ATTEMPTS} times"
        seconds = time.monotonic() - trial.began
        yield trial.case, Outcome(CRASHED, reason, seconds=seconds, environment=self._terms.environment({}))

    def _gone(self) -> InputError:
        self._lost_scheduler = True
        return InputError("dask", self._address, "the scheduler was lost: give the same command again when it is back")


def _unpacking() -> Callable[[bytes], Outcome]:
    """What Dask sends by value, as it has no name: a worker without this package can load it, and tells what it lacks.

    One that cannot load an order loses its line to the scheduler instead, again and again, and is waited for.
    """

    def unpacked(order: bytes) -> Any:  # types are sent too, and must be known there
        from pickle import loads

        work, *arguments = loads(order)
        return work(*arguments)

    return unpacked


_CREWS: dict[str, Crew] = {}
"""Run → its worker processes, in a worker of the cluster; those of a run that has ended refuse what comes too late."""


def work(run: str, terms: Terms, values: Mapping[str, Any]) -> Outcome:
    """Do a case in a worker process of this run; called by a worker of the cluster."""
    return _CREWS.setdefault(run, Crew(terms)).run(values)


def forget(run: str, terms: Terms) -> None:
    """End the worker processes of a run; called by a worker of the cluster."""
    _CREWS.setdefault(run, Crew(terms)).close()
