"""Who does the work of a run: processes of this machine, or of the machines of a Dask cluster.

On a cluster each thread of its workers has a process of its own, as on this machine. So limits and failures are the
same there, and an order that takes its process with it does not take Dask's. What a lost worker of the cluster had in
hand is done by another one, three times at most.
"""

from __future__ import annotations

import logging
import pickle
from collections import deque
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import wait
from queue import Empty, SimpleQueue
from threading import Event, Lock, get_ident
from typing import TYPE_CHECKING, Any, Final, TypeVar
from uuid import uuid4

from qvi_contact.basics.checks import whole_number
from qvi_contact.errors import InputError
from qvi_contact.runs.processes import Limits, NotLoadedError, Outcome, Process, done_here
from qvi_contact.runs.worker import one_line

if TYPE_CHECKING:
    from distributed import Client, Future

_MOST_WORKERS: Final = 10_000
_AHEAD: Final = 2  # orders that are given out for each thread of a cluster: one more than it does
PATIENCE = 10.0  # seconds for whoever listens at an address
_JOINING: Final = 10.0  # seconds until a cluster has a worker
_FETCHING: Final = 30.0  # seconds for one outcome
_LOOK: Final = 0.5  # seconds between two looks at a cluster
_WITHOUT_PORT: Final = ("inproc", "ucx")  # schemes whose addresses `distributed` itself does not take apart
_REMEDY: Final = "give the address that dask scheduler prints, as tcp://host:8786"
_LOST: Final = "the scheduler was lost: give the same command again when it is back"

Order = TypeVar("Order")
Outcomes = Callable[[deque[Order]], Generator[tuple[Order, Outcome], None, None]]


@dataclass(frozen=True)
class Workers:
    """Who does the work: so many processes of this machine, or each thread of a Dask cluster with this scheduler.

    `InputError` by the name "workers" or "dask" if one of them cannot be.
    """

    count: int = 1
    dask: str | None = None

    def __post_init__(self) -> None:
        whole_number("workers", self.count, _MOST_WORKERS)
        if self.dask is not None:
            _check_address(self.dask)

    @contextmanager
    def ready(self, job: bytes, limits: Limits) -> Iterator[tuple[int, Outcomes[Any]]]:
        """How many orders of a pickled job are done at a time, and what does them, see `processes.done_here`.

        `InputError` if the cluster cannot be reached, has no workers, cannot load this package, or is lost.
        """
        if self.dask is None:
            yield self.count, lambda orders: done_here(job, limits, self.count, orders)
            return
        with _quiet(), closing(_client(self.dask)) as client:
            cluster = _Cluster(client, self.dask, job, limits)
            yield cluster.threads(), cluster.done


class _Cluster:
    """A run on a cluster."""

    def __init__(self, client: Client, address: str, job: bytes, limits: Limits) -> None:
        self._client, self._address, self._job, self._limits = client, address, job, limits
        self._run = uuid4().hex

    def threads(self) -> int:
        """Of all workers there are now."""
        try:
            return sum(self._client.nthreads().values())
        except Exception as error:
            raise InputError("dask", self._address, _LOST) from error

    def done(self, orders: deque[Order]) -> Generator[tuple[Order, Outcome], None, None]:
        """Orders and their outcomes; workers that join get their share, and without any they are waited for."""
        busy: dict[Future, Order] = {}
        news: SimpleQueue[Future] = SimpleQueue()
        try:
            while orders or busy:
                for _ in range(min(len(orders), _AHEAD * self.threads() - len(busy))):
                    order = orders.popleft()
                    sent = pickle.dumps((do_there, self._run, self._job, self._limits, order))
                    future = self._client.submit(_unpacking(), sent, pure=False)
                    busy[future] = order
                    future.add_done_callback(news.put)
                with suppress(Empty):
                    future = news.get(timeout=_LOOK)
                    yield busy.pop(future), self._outcome(future)
        finally:
            with suppress(Exception):  # what the cluster has lost is ended already
                if self._client.status == "running":
                    self._client.cancel(list(busy), force=True)
                    self._client.run(forget, self._run)

    def _outcome(self, future: Future) -> Outcome:
        try:
            found: Outcome = future.result(timeout=_FETCHING)
        except NotLoadedError:
            raise
        except Exception as error:
            if type(error).__name__ == "KilledWorker":
                return Outcome("crashed", None, "the workers of the cluster that had it were lost, again and again")
            if future.status in ("cancelled", "lost") or self._client.status != "running":
                raise InputError("dask", self._address, _LOST) from error
            remedy = f"install this package and the task's on its scheduler and workers ({one_line(str(error))})"
            raise InputError("dask", self._address, remedy) from error
        return found


def _unpacking() -> Callable[[bytes], Outcome]:
    """What Dask sends by value, as it has no name: a worker without this package can load it, and tells what it lacks.

    One that cannot load an order loses its line to the scheduler instead, again and again, and is waited for.
    """

    def unpacked(order: bytes) -> Any:  # types are sent too, and must be known there
        from pickle import loads

        work, *arguments = loads(order)
        return work(*arguments)

    return unpacked


class _Held:
    """The processes of a run in a worker of the cluster, one for each thread."""

    def __init__(self) -> None:
        self.processes: dict[int, tuple[Lock, Process]] = {}
        self.over = Event()


_HELD: Final[dict[str, _Held]] = {}
"""By run; those of a run that is over refuse what comes too late."""


def do_there(run: str, job: bytes, limits: Limits, order: object) -> Outcome:
    """Do an order in a process of this run; called by a worker of the cluster."""
    held = _HELD.setdefault(run, _Held())
    if get_ident() not in held.processes:
        held.processes[get_ident()] = Lock(), Process(job, limits)
    turn, process = held.processes[get_ident()]
    with turn:
        if not held.over.is_set():
            process.give(order)
        while not held.over.is_set():
            outcome = process.hear()
            if outcome is not None:
                return outcome
            left = process.left
            wait([process.link], _LOOK if left is None else min(left, _LOOK))
        process.close()
    return Outcome("crashed", None, "stopped")


def forget(run: str) -> None:
    """End the processes of a run; called by a worker of the cluster."""
    held = _HELD.setdefault(run, _Held())
    held.over.set()
    for turn, process in list(held.processes.values()):
        with turn:
            process.close()
    held.processes.clear()


def _check_address(address: str) -> None:
    """Refuse an address that cannot be a scheduler's, as `distributed` reads it, before anything is done."""
    if not isinstance(address, str):
        raise InputError("dask", address, _REMEDY)
    try:
        import distributed  # noqa: F401 - logging is set up when it is loaded
    except ImportError as error:
        remedy = "needs the package distributed: python -m pip install distributed"
        raise InputError("dask", address, remedy) from error
    from distributed.comm.addressing import get_address_host_port, parse_address
    from distributed.comm.registry import get_backend

    try:
        scheme, _ = parse_address(address, strict=True)
        get_backend(scheme)
        if scheme not in _WITHOUT_PORT:
            get_address_host_port(address, strict=True)
    except (ValueError, ImportError) as error:
        raise InputError("dask", address, f"is not scheme://host:port with a known scheme: {_REMEDY}") from error


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


def _client(address: str) -> Client:
    """A client of the cluster of this scheduler, which has passed `_check_address`."""
    from asyncio import run, timeout  # which worker processes need not load

    from distributed import Client, Security
    from distributed.comm import connect

    class QuietClient(Client):  # type: ignore[misc]
        """One that was only half built, for want of a scheduler, cannot always be closed, and goes without a word."""

        def __del__(self) -> None:
            with suppress(Exception):
                super().__del__()

    async def greet() -> None:
        """Exchange the first words with whoever listens there; Dask's client alone would wait for them without end."""
        security = Security().get_connection_args("client")
        async with timeout(PATIENCE):
            comm = await connect(address, timeout=PATIENCE, **security)
        await comm.close()

    try:
        run(greet())
        client = QuietClient(address, timeout=PATIENCE, set_as_default=False)
    except Exception as error:  # of many kinds, for whatever answers there
        raise InputError("dask", address, f"no scheduler answers there: {_REMEDY}") from error
    try:
        client.wait_for_workers(1, timeout=_JOINING)
    except Exception as error:
        client.close()
        raise InputError("dask", address, "the cluster has no workers: start some") from error
    return client
