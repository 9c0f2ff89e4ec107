"""Cases on a Dask cluster: each thread of its workers gets a worker process of its own, as on this machine.

So limits and failures are the same there, and a case that takes its process with it does not take Dask's. The cluster's
workers need this package and the task in the same versions; the rows tell which they had. Only the client writes rows.

Which worker does a case is decided here, not by Dask, which would try a case three more times when workers are lost.
Here it is tried once more, on another worker if there is one.
"""

import logging
import time
from collections import Counter, deque
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, Final
from uuid import uuid4

from comparisons.lab.study.children import Crew, Terms
from comparisons.lab.study.declaration import Case
from comparisons.lab.study.outcome import CRASHED, Outcome, one_line
from comparisons.lab.study.pool import Done
from qvi_contact.errors import InputError

if TYPE_CHECKING:
    from distributed import Client, Future

_CONNECTING: Final = 10.0  # seconds
_JOINING: Final = 10.0  # seconds until a cluster has a worker
_FETCHING: Final = 30.0  # seconds for one outcome
_LOOK: Final = 0.5  # seconds between two looks at the cluster's workers
_ATTEMPTS: Final = 2
_WITHOUT_PORT: Final = ("inproc", "ucx")  # schemes whose addresses `distributed` itself does not take apart
_REMEDY: Final = "give the address that dask scheduler prints, as tcp://host:8786"


def outcomes(terms: Terms, cases: Sequence[Case], address: str) -> Generator[Done]:
    """Do the cases on the cluster of this scheduler, and yield what became of each as it comes.

    The address has passed `check`. When the iterator is closed, the processes are ended.

    Raises
    ------
    InputError
        If the cluster cannot be reached, has no workers, cannot load this package or the task's, or is lost.

    """
    with _quiet(), closing(_client(address)) as client:
        dispatch = _Dispatch(client, address, terms, deque(_Trial(case) for case in cases))
        try:
            yield from dispatch.outcomes()
        finally:
            dispatch.end()


def check(address: str) -> None:
    """Refuse an address that cannot be a scheduler's, as `distributed` reads it, before anything is done.

    Raises
    ------
    InputError
        If `distributed` is missing, or the address is not scheme://host:port with a scheme it knows.

    """
    _check_installed(address)
    from distributed.comm.addressing import get_address_host_port, parse_address
    from distributed.comm.registry import get_backend

    try:
        scheme, _ = parse_address(address, strict=True)
        get_backend(scheme)
        if scheme not in _WITHOUT_PORT:
            get_address_host_port(address, strict=True)
    except (ValueError, ImportError) as error:
        raise InputError("dask", address, f"is not scheme://host:port with a known scheme: {_REMEDY}") from error


def _check_installed(address: str) -> None:
    try:
        import distributed  # noqa: F401 - logging is set up when it is loaded
    except ImportError as error:
        remedy = "needs the package distributed: pip install 'qvi-contact[dask]'"
        raise InputError("dask", address, remedy) from error


@contextmanager
def _quiet() -> Iterator[None]:
    """What Dask's client would log on standard error is told by an exception.

    Its event loop would log a fault of its own besides where an interrupt finds the client about to wait.
    """
    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client", "tornado.application")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


async def _greet(address: str) -> None:
    """Exchange the first words with whoever listens there; Dask's client alone would wait for them without end."""
    from asyncio import timeout

    from distributed import Security
    from distributed.comm import connect

    security = Security().get_connection_args("client")
    async with timeout(_CONNECTING):
        comm = await connect(address, timeout=_CONNECTING, **security)
    await comm.close()


def _client(address: str) -> "Client":
    from asyncio import run  # which worker processes need not load

    try:
        run(_greet(address))
        client = _quiet_client()(address, timeout=_CONNECTING, set_as_default=False)
    except Exception as error:  # of many kinds, for whatever answers there
        raise InputError("dask", address, f"no scheduler answers there: {_REMEDY}") from error
    try:
        client.wait_for_workers(1, timeout=_JOINING)
    except Exception as error:
        client.close()
        raise InputError("dask", address, "the cluster has no workers: start some") from error
    return client


def _quiet_client() -> "type[Client]":
    """Dask's client; one that was only half built, for want of a scheduler, cannot always be closed, and goes so."""
    from distributed import Client

    class QuietClient(Client):  # type: ignore[misc]
        def __del__(self) -> None:
            with suppress(Exception):
                super().__del__()

    return QuietClient


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
                work, self._run, self._terms, dict(trial.case.values),
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


_CREWS: dict[str, Crew] = {}
"""Run → its worker processes, in a worker of the cluster; those of a run that has ended refuse what comes too late."""


def work(run: str, terms: Terms, values: Mapping[str, Any]) -> Outcome:
    """Do a case in a worker process of this run; called by a worker of the cluster."""
    return _CREWS.setdefault(run, Crew(terms)).run(values)


def forget(run: str, terms: Terms) -> None:
    """End the worker processes of a run; called by a worker of the cluster."""
    _CREWS.setdefault(run, Crew(terms)).close()
