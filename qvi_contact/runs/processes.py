"""Work in processes with limits, on this machine or on the machines of a Dask cluster.

A run has *orders*, the cases to compute. Each order ends with an *outcome*, a value or a failure, on its own.

The *job* is common to all orders of a run: a callable without arguments, which is called once in each process. It
returns information about the process, which is part of every outcome, and the function that computes an order. Job,
orders and values are pickled; their functions are in modules that the process can import as this one does.

On a cluster each thread of a Dask worker has its own process, as on this machine. So limits and failures are the same,
and an order that ends its process does not end Dask's. Orders of a lost worker go to another, three times at most.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import pickle
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import wait
from queue import Empty, SimpleQueue
from threading import Event, Lock, get_ident
from typing import TYPE_CHECKING, Any, Final, TypeVar
from uuid import uuid4

from qvi_contact.basics.checks import whole_number
from qvi_contact.errors import InputError, QVIError
from qvi_contact.runs.worker import IDLE, names_shortage
from solvers.errors import one_line

if TYPE_CHECKING:
    from distributed import Client, Future

Order = TypeVar("Order")
Outcomes = Callable[[deque[Order]], Generator[tuple[Order, "Outcome"], None, None]]

FAILURES: Final[Mapping[str, str]] = {
    "error": "the task raised an exception, or returned other values than numbers, texts, lists and dictionaries",
    "timeout": "the case took longer than allowed and was ended",
    "memory": "the case needed more memory than allowed",
    "crashed": "the process that ran the case died",
}
"""Status of an outcome without a value, and its meaning; the status of an outcome with a value is "done"."""

THREADS: Final = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""Environment variables from which libraries read their number of threads when they are loaded."""

_LAST_WORDS: Final = 200  # characters of the last line of output that a message about a crash has
_LOADING: Final = 300.0  # seconds to load a job; imports from network folders are slow


@dataclass(frozen=True)
class Limits:
    """Limits of an order: seconds, without loading the job, and MiB of address space (not on Windows).

    `threads` is the number of threads of libraries. `fresh` gives each order a new process, to measure peak memory.
    """

    seconds: float | None = None
    memory: int | None = None
    threads: int = 1
    fresh: bool = False


@dataclass(frozen=True)
class Outcome:
    """Result of an order: status "done" and a value, or a key of `FAILURES`, a reason in one line, and the exception.

    `seconds` is the wall time of the work, or until it was ended; `load_average` the number of processes ready to run,
    as a mean of the minute before; `about` the job's information about the process.
    """

    status: str
    value: Any = None
    reason: str = ""
    seconds: float = 0.0
    load_average: float | None = None
    about: Any = None
    error: BaseException | None = None


class NotLoadedError(QVIError):
    """A job cannot be loaded in a process, for a reason in one line."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason

    def __str__(self) -> str:
        return f"the work cannot be loaded in another process: {self.reason}"


class Process:
    """A worker process for a pickled job, started when needed, and replaced if it was lost; used by one thread.

    It leads a process group: all that its orders have started ends with it. It ends whenever its parent ends.
    """

    def __init__(self, job: bytes, limits: Limits) -> None:
        self._job, self._limits = job, limits
        self._complaints = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - closed by close
        self._process: subprocess.Popen[bytes] | None = None
        self._lifeline: int | None = None
        self._about: Any = None
        self._loaded = self._proven = False  # whether this process, or any process before, has loaded the job
        self._lost_one = False  # whether a process was lost before; a first kill need not be the job's fault
        self._began = self._used = 0.0

    def give(self, order: object) -> None:
        """Begin an order; call `hear` when `link` is readable."""
        if time.monotonic() - self._used > IDLE / 2.0:  # the worker might end just when the order comes
            self.end()
        if self._process is None:
            self._start()
        self._complaints.seek(0)
        self._complaints.truncate()
        self._began = time.perf_counter()
        with suppress(OSError):  # a process that has ended is noticed by `hear`
            self.link.send_bytes(pickle.dumps(order))

    @property
    def left(self) -> float | None:
        """Seconds until the limit of the order, or of loading the job; None without a limit."""
        limit = self._limits.seconds if self._loaded else _LOADING
        return None if limit is None else max(0.0, limit - (time.perf_counter() - self._began))

    def hear(self) -> Outcome | None:
        """The outcome of the order; None while it is under way. `NotLoadedError` if the job cannot be loaded."""
        seconds = time.perf_counter() - self._began
        try:
            if self.link.poll():
                answer = self.link.recv()
            elif self.left == 0.0:
                answer = "timeout", f"more than {self._limits.seconds if self._loaded else _LOADING:g} s"
            else:
                return None
        except (EOFError, OSError):
            answer = ("ended",)
        except Exception as error:  # the answer cannot be unpickled here
            answer = "error", seconds, None, one_line(f"{type(error).__name__}: {error}"), error
        if answer[0] == "loaded":
            self._loaded, self._proven, self._about, self._began = True, True, answer[1], time.perf_counter()
            return None
        if answer[0] in ("refused", "ended", "timeout"):
            code = self.end()
            status, reason = answer if len(answer) == 2 else self._last_words(code)
            killed_first, self._lost_one = code < 0 and answer[0] == "ended" and not self._lost_one, True
            if not self._proven and not killed_first:
                raise NotLoadedError(reason)
            return Outcome("crashed" if status == "refused" else status, None, reason, seconds, about=self._about)
        self._used = time.monotonic()
        status, seconds, load, result, *errors = answer  # the value, or the reason of a failure
        if self._limits.fresh or status == "memory":  # after a lack of memory the process's state is unknown
            self.end()
        if status == "done":
            return Outcome(status, result, "", seconds, load, self._about)
        return Outcome(status, None, result, seconds, load, self._about, *errors)

    def end(self) -> int:
        """Kill the process, if there is one, and all that it started; returns its exit status, −n for signal n."""
        process, self._process, self._loaded = self._process, None, False
        if process is None:
            return 0
        if os.name == "posix":
            with suppress(PermissionError):  # on macOS for a process that has just died
                os.killpg(process.pid, signal.SIGKILL)  # before `wait` no other process has this number
        else:
            process.kill()
        code = process.wait()
        self.link.close()
        if self._lifeline is not None:
            os.close(self._lifeline)
        return code

    def close(self) -> None:
        """End the process for good."""
        self.end()
        self._complaints.close()

    def _start(self) -> None:
        self.link, theirs = multiprocessing.Pipe()
        inherited, lifeline = [theirs.fileno()], None
        if os.name == "posix":
            lifeline, self._lifeline = os.pipe()
            inherited.append(lifeline)
        else:
            os.set_handle_inheritable(theirs.fileno(), True)  # type: ignore[attr-defined, unused-ignore]
        script = (
            f"import sys; sys.path[:] = {[*map(str, sys.path)]!r}; "
            f"from qvi_contact.runs.worker import main; main({theirs.fileno()}, {lifeline})"
        )
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-c", script], stdin=subprocess.DEVNULL, stdout=self._complaints,
                stderr=self._complaints, pass_fds=inherited if os.name == "posix" else (),
                close_fds=os.name == "posix", start_new_session=True,
                env={**os.environ, **dict.fromkeys(THREADS, str(self._limits.threads))},
            )  # fmt: skip
        finally:
            theirs.close()
            if lifeline is not None:
                os.close(lifeline)
        self._used = time.monotonic()
        with suppress(OSError):
            self.link.send((self._limits.memory,))
            self.link.send_bytes(self._job)

    def _last_words(self, code: int) -> tuple[str, str]:
        """Status and reason for a process that ended by itself, with the last line of its output."""
        self._complaints.seek(0)
        lines = self._complaints.read().decode(errors="replace").strip().splitlines()
        words = one_line(lines[-1][-_LAST_WORDS:]) if lines else ""
        ending = f"signal {-code} ({signal.strsignal(-code)})" if code < 0 else f"exit status {code}"
        return ("memory" if names_shortage(words) else "crashed"), f"{ending}: {words or 'no message'}"


def done_here(
    job: bytes, limits: Limits, workers: int, orders: deque[Order]
) -> Generator[tuple[Order, Outcome], None, None]:
    """Orders with their outcomes, in the order in which they end; closing the iterator ends the orders under way.

    Orders are taken from the left of the queue; the caller may add more at any time. `NotLoadedError` if the pickled
    job cannot be loaded, `InputError` of "workers" if the system does not allow so many processes.
    """
    idle, busy, processes = list[Process](), dict[Process, Order](), list[Process]()
    try:
        processes.extend(Process(job, limits) for _ in range(min(workers, len(orders))))
        idle.extend(processes)
        while orders or busy:
            while orders and idle:
                busy[idle[-1]] = orders.popleft()
                idle[-1].give(busy[idle.pop()])
            wait([process.link for process in busy], min((p.left for p in busy if p.left is not None), default=None))
            for process in list(busy):
                outcome = process.hear()
                if outcome is not None:
                    idle.append(process)
                    yield busy.pop(process), outcome
    except OSError as error:
        remedy = f"not so many processes can be started ({error.strerror}): give fewer, or raise limits of the system"
        raise InputError("workers", workers, remedy) from error
    finally:
        for process in processes:
            process.close()


# Where the work is done: on this machine, or on a cluster.

_MOST_WORKERS: Final = 10_000
_AHEAD: Final = 2  # orders sent to each thread of a cluster: the one it computes, and the next
PATIENCE = 10.0  # seconds to wait for an answer from a scheduler's address
_JOINING: Final = 10.0  # seconds to wait for the first worker of a cluster
_FETCHING: Final = 30.0  # seconds to transfer one outcome
_LOOK: Final = 0.5  # seconds between two checks of a cluster, or of an order on it
_ADDRESS: Final = re.compile(r"(tcp|tls|wss?)://.*:\d+|(ucx|inproc)://.+")
_REMEDY: Final = "give the address that dask scheduler prints, as tcp://host:8786"
_LOST: Final = "the scheduler was lost: give the same command again when it is back"


@dataclass(frozen=True)
class Workers:
    """Where orders are computed: `count` processes of this machine, or the threads of the Dask cluster at `dask`.

    `InputError` of "workers" or "dask" if the number or the scheduler's address is wrong.
    """

    count: int = 1
    dask: str | None = None

    def __post_init__(self) -> None:
        whole_number("workers", self.count, _MOST_WORKERS)
        if self.dask is None:
            return
        if not (isinstance(self.dask, str) and _ADDRESS.fullmatch(self.dask)):
            raise InputError("dask", self.dask, f"is not scheme://host:port with a known scheme: {_REMEDY}")
        try:
            import distributed  # noqa: F401 - before `_quiet`, as it sets up its logging when it is imported
        except ImportError as error:
            remedy = "needs the package distributed: python -m pip install distributed"
            raise InputError("dask", self.dask, remedy) from error

    @contextmanager
    def ready(self, job: bytes, limits: Limits) -> Iterator[tuple[int, Outcomes[Any]]]:
        """The number of orders of a pickled job that run at a time, and a function as `done_here` that runs a queue.

        `InputError` if the cluster cannot be reached, has no workers, cannot load this package, or is lost.
        """
        if self.dask is None:
            yield self.count, partial(done_here, job, limits, self.count)
            return
        with _quiet(), closing(_client(self.dask)) as client:
            yield _threads(client, self.dask), partial(_done_on_cluster, client, self.dask, job, limits)


def _threads(client: Client, address: str) -> int:
    """Number of threads of all workers that the cluster has now."""
    try:
        return sum(client.nthreads().values())
    except Exception as error:
        raise InputError("dask", address, _LOST) from error


def _done_on_cluster(
    client: Client, address: str, job: bytes, limits: Limits, orders: deque[Order]
) -> Generator[tuple[Order, Outcome], None, None]:
    """`done_here` on a cluster. Workers may join during the run; while there are no workers the run waits."""
    run, busy = uuid4().hex, dict["Future", Order]()
    ended: SimpleQueue[Future] = SimpleQueue()
    try:
        while orders or busy:
            for _ in range(min(len(orders), _AHEAD * _threads(client, address) - len(busy))):
                order = orders.popleft()
                future = client.submit(_unpacking(), pickle.dumps((do_there, run, job, limits, order)), pure=False)
                busy[future] = order
                future.add_done_callback(ended.put)
            with suppress(Empty):
                future = ended.get(timeout=_LOOK)
                yield busy.pop(future), _outcome(client, address, future)
    finally:
        with suppress(Exception):  # orders of a lost cluster have ended already
            if client.status == "running":
                client.cancel(list(busy), force=True)
                client.run(forget, run)


def _outcome(client: Client, address: str, future: Future) -> Outcome:
    try:
        outcome: Outcome = future.result(timeout=_FETCHING)
    except NotLoadedError:
        raise
    except Exception as error:
        if type(error).__name__ == "KilledWorker":
            return Outcome("crashed", None, "the workers of the cluster that had it were lost, again and again")
        remedy = f"install this package and the task's on its scheduler and workers ({one_line(str(error))})"
        if future.status in ("cancelled", "lost") or client.status != "running":
            remedy = _LOST
        raise InputError("dask", address, remedy) from error
    return outcome


def _unpacking() -> Callable[[bytes], Outcome]:
    """A nested function, which Dask sends by value, so that a worker without this package can load it.

    The worker then reports which package is missing. A worker that cannot load an order would lose its connection to
    the scheduler again and again instead, and the run would wait for it.
    """

    def unpacked(order: bytes) -> Any:  # not `Outcome`: annotations are sent too, and must exist there
        from pickle import loads

        work, *arguments = loads(order)
        return work(*arguments)

    return unpacked


_HELD: Final[dict[str, tuple[dict[int, tuple[Lock, Process]], Event]]] = {}
"""In a Dask worker: run → its processes by thread, with locks; and whether the run is over, and refuses orders."""


def do_there(run: str, job: bytes, limits: Limits, order: object) -> Outcome:
    """Compute an order in this thread's process of the run; called in a worker of the cluster."""
    processes, over = _HELD.setdefault(run, ({}, Event()))
    if get_ident() not in processes:
        processes[get_ident()] = Lock(), Process(job, limits)
    lock, process = processes[get_ident()]
    with lock:
        if not over.is_set():
            try:
                process.give(order)
            except OSError as error:
                raise NotLoadedError(f"no process can be started ({error.strerror})") from error
        while not over.is_set():
            outcome = process.hear()
            if outcome is not None:
                return outcome
            left = process.left
            wait([process.link], _LOOK if left is None else min(left, _LOOK))
        process.close()
    return Outcome("crashed", None, "stopped")


def forget(run: str) -> None:
    """End the processes of a run; called in a worker of the cluster."""
    processes, over = _HELD.setdefault(run, ({}, Event()))
    over.set()
    for lock, process in list(processes.values()):
        with lock:
            process.close()
    processes.clear()


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence the logs of Dask's client on standard error, whose errors are raised as exceptions here.

    Its event loop would also log an error of its own if an interrupt comes just before the client waits.
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
    """A client of the cluster with this scheduler."""
    from asyncio import run, timeout  # not needed in worker processes

    from distributed import Client, Security
    from distributed.comm import connect

    class QuietClient(Client):  # type: ignore[misc]
        """A client that is deleted without a message, also if it found no scheduler and cannot be closed."""

        def __del__(self) -> None:
            with suppress(Exception):
                super().__del__()

    async def greet() -> None:
        """Connect once within a time limit; Dask's client would wait without end for an answer."""
        security = Security().get_connection_args("client")
        async with timeout(PATIENCE):
            comm = await connect(address, timeout=PATIENCE, **security)
        await comm.close()

    try:
        run(greet())
        client = QuietClient(address, timeout=PATIENCE, set_as_default=False)
    except Exception as error:  # its type depends on the program that answers there
        raise InputError("dask", address, f"no scheduler answers there: {_REMEDY}") from error
    try:
        client.wait_for_workers(1, timeout=_JOINING)
    except Exception as error:
        client.close()
        raise InputError("dask", address, "the cluster has no workers: start some") from error
    return client
