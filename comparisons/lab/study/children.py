"""The parent's side of a worker process: started when needed, asked one case at a time, replaced when it was lost."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Lock, Timer, get_ident
from typing import IO, Any, Final

from comparisons.lab.worker.limits import IDLE
from comparisons.lab.worker.outcome import CRAMPED, CRASHED, MEMORY, REFUSED, TIMEOUT, Outcome, names_shortage, one_line

LIMITING: Final = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""Environment variables with the number of threads, read by libraries when they are loaded."""

_ROOT: Final = Path(__file__).resolve().parents[3]
_LAST_WORDS: Final = 200
_LOADING: Final = 300.0  # seconds for the imports of a task; network folders are slow


def environment(threads: int) -> dict[str, str]:
    """Environment variables of a process that finds this package and whose libraries take `threads` threads."""
    path = os.pathsep.join([str(_ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    return {**os.environ, **dict.fromkeys(LIMITING, str(threads)), "PYTHONPATH": path}


def last_words(complaints: IO[bytes]) -> str:
    """The end of the last line that a process wrote to this file."""
    complaints.seek(0)
    words = complaints.read().decode(errors="replace").strip().splitlines()
    return words[-1][-_LAST_WORDS:] if words else ""


@contextmanager
def _broken_pipes_raise() -> Iterator[None]:
    """A pipe without a reader is an exception here, also where a library has put SIGPIPE back to ending the process."""
    if os.name != "posix":
        yield
        return
    pipe = {signal.SIGPIPE}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, pipe)
    try:
        yield
    finally:
        if signal.SIGPIPE in signal.sigpending():
            signal.sigwait(pipe)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@dataclass(frozen=True)
class Terms:
    """What every case of a study gets: the task, versions to tell, threads, seconds, MiB, whether a new process."""

    task: str
    packages: tuple[str, ...]
    threads: int = 1
    timeout: float | None = None
    memory: int | None = None
    fresh: bool = False

    def environment(self, found: Mapping[str, Any]) -> dict[str, Any]:
        """A row's environment, from what a worker says of its own."""
        return {
            "machine": found.get("machine"), "versions": found.get("versions", {}), "threads": self.threads,
            "timeout_seconds": self.timeout, "memory_mib": self.memory,
        }  # fmt: skip


class Child:
    """A worker process, the leader of a process group so that it ends with all it started.

    Cases are done one after the other; `close` may be called by any thread, at any time.
    """

    def __init__(self, terms: Terms) -> None:
        self._terms = terms
        self._turn = Lock()  # one case at a time
        self._lock = Lock()  # so that nobody ends a process that was waited for, whose number may be another's by now
        self._process: subprocess.Popen[bytes] | None = None
        self._lifeline: int | None = None
        self._stopped = False
        self._complaints = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - see close
        self._environment: dict[str, Any] = {}
        self._used = 0.0

    def run(self, values: Mapping[str, Any]) -> Outcome:
        """Do a case, whatever comes of it; `REFUSED` or `CRAMPED` if there is no process to do it."""
        with self._turn:
            refusal = self._start(self._terms.memory)
            if refusal:
                self._end()
                return Outcome(CRAMPED if self._is_cramped() else REFUSED, refusal)
            began = time.perf_counter()
            answer, late = self._ask(values, self._terms.timeout)
            seconds = time.perf_counter() - began
            self._used = time.monotonic()
            if answer is None:
                status, reason = self._verdict(self._end(), late, self._terms.timeout)
                return Outcome(status, reason, seconds=seconds, environment=self._environment)
            if self._terms.fresh or late or answer["status"] == MEMORY:  # of the latter, who knows what it left behind
                self._end()
            return Outcome(**answer, environment=self._environment)

    def close(self) -> None:
        """End the process for good; a case that it is busy with fails, and there will not be another one."""
        with self._lock:
            self._stopped = True
            if self._process is not None:
                _kill(self._process)
        with self._turn:
            self._end()
            self._complaints.close()

    def _is_cramped(self) -> bool:
        """Whether the process that could not be started can be without the limit of memory.

        This is tried: libraries say what they like when they get no memory, or die without a word.
        """
        if self._terms.memory is None:
            return False
        refusal = self._start(None)
        self._end()
        return not refusal

    def _start(self, memory: int | None) -> str:
        """Start the process, with this limit of memory, unless there is one; returns why there is none."""
        rested = time.monotonic() - self._used
        with self._lock:
            runs = self._process is not None and self._process.poll() is None
        if runs and rested < IDLE / 2.0:
            return ""  # a case for one that has waited longer might come just when it ends by itself
        self._end()
        try:
            with self._lock:
                if self._stopped:
                    return "stopped"
                self._process = self._popen()
        except OSError as error:
            return f"no process can be started ({error.strerror})"
        order = {"task": self._terms.task, "packages": self._terms.packages, "memory": memory}
        answer, late = self._ask(order, _LOADING)
        if answer is None:
            answer = {"refused": self._verdict(self._end(), late, _LOADING)[1]}
        self._environment = self._terms.environment(answer.get("environment", {}))
        return f"cannot be loaded: {answer['refused']}" if "refused" in answer else ""

    def _popen(self) -> "subprocess.Popen[bytes]":
        """The process, with the end of a pipe to which nothing is ever written: it is closed when this one ends."""
        words, ends = [sys.executable, "-m", "comparisons.lab.worker.child"], []
        if os.name == "posix":
            end, self._lifeline = os.pipe()
            words, ends = [*words, str(end)], [end]
        try:
            return subprocess.Popen(
                words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._complaints, pass_fds=ends,
                env=environment(self._terms.threads), start_new_session=True,
            )  # fmt: skip
        finally:
            for end in ends:
                os.close(end)

    def _ask(self, document: Mapping[str, Any], limit: float | None) -> tuple[dict[str, Any] | None, bool]:
        """Send a line and wait for the answer; None if the process ended before, and whether that was our doing."""
        process = self._process
        assert process is not None
        assert process.stdin is not None
        assert process.stdout is not None
        self._complaints.seek(0)
        self._complaints.truncate()
        late = Event()
        timer = Timer(limit or 0.0, self._give_up, (process, late))
        timer.daemon = True
        if limit is not None:
            timer.start()
        try:
            with suppress(BrokenPipeError), _broken_pipes_raise():  # it has ended before, and reading will tell
                process.stdin.write(json.dumps(document).encode() + b"\n")
                process.stdin.flush()
            line = process.stdout.readline()
        finally:
            timer.cancel()
        return (json.loads(line) if line.endswith(b"\n") else None), late.is_set()

    def _give_up(self, process: "subprocess.Popen[bytes]", late: Event) -> None:
        """End a process that takes too long, unless it has been replaced by now."""
        with self._lock:
            if process is self._process:
                late.set()
                _kill(process)

    def _end(self) -> int:
        """End the process if there is one; its exit status, negative if that was a signal."""
        process = self._process
        if self._lifeline is not None:
            os.close(self._lifeline)
            self._lifeline = None
        if process is None:
            return 0
        with self._lock:
            _kill(process)
            code = process.wait()
            self._process = None
        for stream in (process.stdin, process.stdout):
            with suppress(BrokenPipeError), _broken_pipes_raise():  # what it has not read is lost
                if stream is not None:
                    stream.close()
        return code

    def _verdict(self, code: int, late: bool, limit: float | None) -> tuple[str, str]:
        """Status and reason of a case whose process ended before it had answered."""
        if late:
            return TIMEOUT, f"more than {limit:g} s"
        words = one_line(last_words(self._complaints))
        ending = f"signal {-code} ({signal.strsignal(-code)})" if code < 0 else f"exit status {code}"
        return (MEMORY if names_shortage(words) else CRASHED), f"{ending}: {words or 'no message'}"


class Crew:
    """The worker processes of a study, one for each thread that wants cases done."""

    def __init__(self, terms: Terms) -> None:
        self._terms = terms
        self._lock = Lock()
        self._children: dict[int, Child] = {}
        self._closed = False

    def run(self, values: Mapping[str, Any]) -> Outcome:
        """Do a case, see `Child.run`."""
        with self._lock:
            if self._closed:
                return Outcome(REFUSED, "stopped")
            if get_ident() not in self._children:
                self._children[get_ident()] = Child(self._terms)
            child = self._children[get_ident()]
        return child.run(values)

    def close(self) -> None:
        """End the processes for good, and with them the cases that threads wait for."""
        with self._lock:
            self._closed = True
        for child in self._children.values():
            child.close()


def _kill(process: "subprocess.Popen[bytes]") -> None:
    """End a process that was not waited for, and all it started."""
    if process.returncode is not None:
        return
    if os.name == "posix":
        with suppress(PermissionError):  # macOS, of one that has just died
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
