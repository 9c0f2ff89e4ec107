"""Calls of libraries without side effects: their output does not reach standard output, signal handlers are restored.

    with foreign_code():
        answer = linprog(…)

Compiled libraries write to file descriptor 1, at once or when a buffer of C is full; others print by Python. Their
output is dropped. If the project's log is set to DEBUG, it goes to standard error. `handlers_kept` restores the signal
handlers that a library has changed.
"""

import ctypes
import logging
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from threading import Lock, RLock, local
from typing import Any, Final, TextIO, cast


class _Thread(local):
    """The number of nested blocks of foreign code in this thread.

    Not a context variable: factors that the garbage collector frees enter such a block, and before Python 3.12 the
    collector may run while another variable of the same context is set, as by `numpy.errstate`. Setting one then
    ends the process with a segmentation fault.
    """

    depth = 0


_THREAD: Final = _Thread()


@contextmanager
def foreign_code() -> Iterator[None]:
    """Keep the output of the code inside away from standard output.

    Descriptor 1 belongs to the whole process: other threads can still `print`, but their direct writes to the
    descriptor are dropped. If it is closed, it stays closed. The context may be nested, and entered by several threads
    at a time. It takes 20 μs.
    """
    _STANDARD_OUTPUT.hide()
    _THREAD.depth += 1
    try:
        yield
    finally:
        _THREAD.depth -= 1
        _STANDARD_OUTPUT.show()


def lead_nowhere() -> int | None:
    """Flush all buffers and redirect descriptor 1 to nowhere; returns a duplicate of it, None if it was closed."""
    if _is_standard(sys.stdout):
        with suppress(OSError):
            sys.stdout.flush()
    _flush_c()(None)
    try:
        kept = os.dup(1)
    except OSError:
        return None
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    if _shows_output():
        with suppress(OSError):  # standard error is closed
            os.dup2(2, 1)
    return kept


def _is_standard(stream: TextIO | None) -> bool:
    """Whether a stream writes to descriptor 1."""
    with suppress(OSError, ValueError, AttributeError):  # none, no file, or closed
        return stream is not None and stream.fileno() == 1
    return False


def _shows_output() -> bool:
    return logging.getLogger("qvi_contact").isEnabledFor(logging.DEBUG)


@cache
def _flush_c() -> Callable[[None], Any]:
    """C's fflush; with None it flushes all buffers."""
    return cast("Callable[[None], Any]", ctypes.CDLL("ucrtbase" if os.name == "nt" else None).fflush)


class _StandardOutput:
    """Standard output, hidden from the time when the first thread enters foreign code until the last one leaves it.

    The garbage collector may run at any line of this class, and factors that it frees enter foreign code themselves.
    """

    def __init__(self) -> None:
        self._lock, self._n_inside = RLock(), 0
        self._duplicate: int | None = None
        self._filter: _Filter | None = None

    def hide(self) -> None:
        with self._lock:
            self._n_inside += 1
            if self._n_inside > 1:
                return
            self._duplicate = lead_nowhere()
            if sys.stdout is not None:
                self._filter = _Filter(sys.stdout, self._duplicate)
                sys.stdout = cast("TextIO", self._filter)

    def show(self) -> None:
        with self._lock:
            if self._n_inside == 1:
                _flush_c()(None)
                if self._filter is not None:
                    if sys.stdout is self._filter:  # else another one was set meanwhile
                        sys.stdout = self._filter.stream
                    self._filter.end()
                if self._duplicate is not None:
                    os.dup2(self._duplicate, 1)
                    os.close(self._duplicate)
                self._duplicate = self._filter = None
            self._n_inside -= 1


class _Filter:
    """`sys.stdout` while it is hidden: silent in threads that run foreign code; others write to the duplicate."""

    def __init__(self, stream: TextIO, kept: int | None) -> None:
        self.stream, self._duplicate, self._lock = stream, kept, Lock()

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)

    def write(self, text: str) -> int:
        if _THREAD.depth:
            return sys.stderr.write(text) if _shows_output() else len(text)
        with self._lock:
            if self._duplicate is None or not _is_standard(self.stream):
                return self.stream.write(text)
            data = text.replace("\n", os.linesep).encode(self.stream.encoding, self.stream.errors or "strict")
            with open(self._duplicate, "wb", closefd=False) as place:
                place.write(data)
            return len(text)

    def end(self) -> None:
        """Write to the stream again, for objects that still refer to this filter."""
        with self._lock:
            self._duplicate = None


_STANDARD_OUTPUT: Final = _StandardOutput()

_SIGACTION_BYTES: Final = 1024
"""Bytes for a `struct sigaction`, which has at most 152 on any system; its content is not read."""


@contextmanager
def handlers_kept() -> Iterator[None]:
    """Restore all signal handlers on exit.

    They are read and set by the operating system's functions: Python's work in the main thread only, and for Python's
    handlers only, not for those of `faulthandler` and of other libraries. On Windows nothing is restored.
    """
    if os.name != "posix":
        yield
        return
    system, actions = ctypes.CDLL(None), {}
    for number in map(int, signal.valid_signals()):
        action = ctypes.create_string_buffer(_SIGACTION_BYTES)
        if system.sigaction(number, None, action) == 0:
            actions[number] = action
    try:
        yield
    finally:
        for signal_number, action in actions.items():
            system.sigaction(signal_number, action, None)  # fails for SIGKILL and SIGSTOP, which cannot be set
