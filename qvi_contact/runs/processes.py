"""Work in processes of this machine, with limits: what becomes of an order is an outcome, and the others go on.

A *job* is what every order of a run has in common: a callable without arguments, which is called once in each process.
It returns what there is to tell of the process, part of every outcome, and the function that does an order. Job, orders
and what is found are pickled; their functions belong to modules that the process finds as this one does.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Callable, Generator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import wait
from typing import Any, Final, TypeVar

from qvi_contact.errors import QVIError
from qvi_contact.runs.worker import IDLE, names_shortage, one_line

Order = TypeVar("Order")
Job = Callable[[], tuple[Any, Callable[[Any], Any]]]

FAILURES: Final[Mapping[str, str]] = {
    "error": "the task raised an exception, or returned other values than numbers, texts, lists and dictionaries",
    "timeout": "the case took longer than allowed and was ended",
    "memory": "the case needed more memory than allowed",
    "crashed": "the process that ran the case died",
}
"""Status of an outcome without a value → what it means. That of all others is "done"."""

THREADS: Final = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""Environment variables with the number of threads, read by libraries when they are loaded."""

_LAST_WORDS: Final = 200
_LOADING: Final = 300.0  # seconds for what a job imports; network folders are slow


@dataclass(frozen=True)
class Limits:
    """What an order may take: seconds, without those for loading the job, and MiB of address space (not on Windows).

    Libraries have so many threads. `fresh` gives each order a process of its own, as where peak memory is measured.
    """

    seconds: float | None = None
    memory: int | None = None
    threads: int = 1
    fresh: bool = False


@dataclass(frozen=True)
class Outcome:
    """What became of an order: "done", or a key of `FAILURES` with the reason in one line, and its error.

    `seconds` is the wall time of the work alone, or until it was ended, `load_average` the processes that wanted to run
    in the minute before, `about` what the job told of its process.
    """

    status: str
    value: Any = None
    reason: str = ""
    seconds: float = 0.0
    load_average: float | None = None
    about: Any = None
    error: BaseException | None = None


class NotLoadedError(QVIError):
    """A job cannot be loaded in a process: why, in one line, and whether it could without the limit of memory."""

    def __init__(self, reason: str, cramped: bool) -> None:
        super().__init__(reason, cramped)
        self.reason, self.cramped = reason, cramped

    def __str__(self) -> str:
        return f"the work cannot be loaded in another process: {self.reason}"


class Process:
    """A worker process for a pickled job, started when it is needed and replaced when it was lost; used by one thread.

    It leads a process group, and ends with all that its orders have started. It ends with the process that started it
    too, however that one ends.
    """

    def __init__(self, job: bytes, limits: Limits) -> None:
        self._job, self._limits = job, limits
        self._complaints = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - closed by close
        self._process: subprocess.Popen[bytes] | None = None
        self._lifeline: int | None = None
        self._about: Any = None
        self._loaded = self._proven = False  # this process, and any before: the job can be loaded
        self._killed = False  # one was killed while it loaded the job, which need not be the job's fault
        self._began = self._used = 0.0

    def give(self, order: object) -> None:
        """Begin an order; `link` is readable when there may be something to hear of it."""
        if time.monotonic() - self._used > IDLE / 2.0:  # it ends by itself, perhaps just when the order comes
            self.end()
        if self._process is None:
            self._start(self._limits.memory)
        self._complaints.seek(0)
        self._complaints.truncate()
        self._began = time.perf_counter()
        with suppress(OSError):  # it has ended before, which will be heard
            self.link.send_bytes(pickle.dumps(order))

    @property
    def left(self) -> float | None:
        """Seconds until there is something to hear at the latest."""
        limit = self._limits.seconds if self._loaded else _LOADING
        return None if limit is None else max(0.0, limit - (time.perf_counter() - self._began))

    def hear(self) -> Outcome | None:
        """What became of the order; None as long as it is under way, `NotLoadedError` if the job cannot be loaded."""
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
        except Exception as error:  # what was found cannot be unpickled here
            answer = "error", seconds, None, one_line(f"{type(error).__name__}: {error}"), error
        if answer[0] == "loaded":
            self._loaded, self._proven, self._about, self._began = True, True, answer[1], time.perf_counter()
            return None
        if answer[0] in ("refused", "ended", "timeout"):
            code = self.end()
            status, reason = answer if len(answer) == 2 else self._last_words(code)
            killed_first, self._killed = code < 0 and answer[0] == "ended" and not self._killed, True
            if not self._proven and not killed_first:
                raise NotLoadedError(reason, self._limits.memory is not None and self._loads_with_more())
            return Outcome("crashed" if status == "refused" else status, None, reason, seconds, about=self._about)
        self._used = time.monotonic()
        status, seconds, load, found, *errors = answer
        if self._limits.fresh or status == "memory":  # of the latter, who knows what it left behind
            self.end()
        if status == "done":
            return Outcome(status, found, "", seconds, load, self._about)
        return Outcome(status, None, found, seconds, load, self._about, *errors)

    def end(self) -> int:
        """End the process if there is one, and all it started; its exit status, negative if that was a signal."""
        process, self._process, self._loaded = self._process, None, False
        if process is None:
            return 0
        if os.name == "posix":
            with suppress(PermissionError):  # macOS, of one that has just died
                os.killpg(process.pid, signal.SIGKILL)  # it was not waited for, so its number is no other's
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

    def _start(self, memory: int | None) -> None:
        self.link, theirs = multiprocessing.Pipe()
        inherited, lifeline = [theirs.fileno()], None
        if os.name == "posix":
            lifeline, self._lifeline = os.pipe()
            inherited.append(lifeline)
        else:
            os.set_handle_inheritable(theirs.fileno(), True)  # type: ignore[attr-defined, unused-ignore]
        script = (
            f"import sys; sys.path[:] = {sys.path!r}; "
            f"from qvi_contact.runs.worker import main; main({theirs.fileno()}, {lifeline})"
        )
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-c", script], stdin=subprocess.DEVNULL, stdout=self._complaints,
                stderr=self._complaints, pass_fds=inherited if os.name == "posix" else (),
                close_fds=os.name == "posix", start_new_session=True,
                env={**os.environ, **dict.fromkeys(THREADS, str(self._limits.threads))},
            )  # fmt: skip
        except OSError as error:
            raise NotLoadedError(f"no process can be started ({error.strerror})", False) from error
        finally:
            theirs.close()
            if lifeline is not None:
                os.close(lifeline)
        self._used = time.monotonic()
        with suppress(OSError):
            self.link.send((memory,))
            self.link.send_bytes(self._job)

    def _last_words(self, code: int) -> tuple[str, str]:
        """Status and reason of a process that has ended by itself."""
        self._complaints.seek(0)
        lines = self._complaints.read().decode(errors="replace").strip().splitlines()
        words = one_line(lines[-1][-_LAST_WORDS:]) if lines else ""
        ending = f"signal {-code} ({signal.strsignal(-code)})" if code < 0 else f"exit status {code}"
        return ("memory" if names_shortage(words) else "crashed"), f"{ending}: {words or 'no message'}"

    def _loads_with_more(self) -> bool:
        """Whether the job can be loaded without the limit of memory, of which libraries seldom speak."""
        self._start(None)
        try:
            return bool(wait([self.link], _LOADING)) and self.link.recv()[0] == "loaded"
        except (EOFError, OSError):
            return False
        finally:
            self.end()


def done_here(
    job: bytes, limits: Limits, workers: int, orders: deque[Order]
) -> Generator[tuple[Order, Outcome], None, None]:
    """Orders and what became of each, as it comes, by so many processes; closing the iterator ends what is under way.

    Orders are taken from the left; more may be added while others are done. `NotLoadedError` if the pickled job cannot
    be loaded.
    """
    idle, busy = [Process(job, limits) for _ in range(min(workers, len(orders)))], dict[Process, Order]()
    processes = list(idle)
    try:
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
    finally:
        for process in processes:
            process.close()
