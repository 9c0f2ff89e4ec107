"""Foreign code runs apart from standard output, which is for answers: what a library prints there is dropped.

    with foreign_code():
        answer = linprog(…)

Compiled libraries write to file descriptor 1, at once or when a buffer of C is full; others print by Python. Where the
project's log is set to DEBUG, their text goes to standard error instead. Others set signals for themselves, which are
kept (`handlers_kept`).
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
    """How many blocks of foreign code this thread is in.

    Not a context variable: factors that the garbage collector frees enter such a block, and before Python 3.12 the
    collector may run while another variable of the same context is set, as by `numpy.errstate`. Setting one then
    ends the process with a segmentation fault.
    """

    depth = 0


_THREAD: Final = _Thread()


@contextmanager
def foreign_code() -> Iterator[None]:
    """Keep what the code inside prints away from standard output.

    Descriptor 1 belongs to the whole process: other threads can still `print`, but what they write to the descriptor
    itself is dropped. Nothing is done to it where it is closed. May be nested, and entered by several threads at a
    time; takes 20 μs.
    """
    _STANDARD_OUTPUT.hide()
    _THREAD.depth += 1
    try:
        yield
    finally:
        _THREAD.depth -= 1
        _STANDARD_OUTPUT.show()


def lead_nowhere() -> int | None:
    """Let descriptor 1 lead nowhere once buffers are empty; a duplicate of what it was, None if it was closed."""
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
    if _is_told():
        with suppress(OSError):  # standard error is closed
            os.dup2(2, 1)
    return kept


def _is_standard(stream: TextIO | None) -> bool:
    """Whether a stream writes to descriptor 1."""
    with suppress(OSError, ValueError, AttributeError):  # none, no file, or closed
        return stream is not None and stream.fileno() == 1
    return False


def _is_told() -> bool:
    return logging.getLogger("qvi_contact").isEnabledFor(logging.DEBUG)


@cache
def _flush_c() -> Callable[[None], Any]:
    """The function of C that writes what waits in its buffers."""
    return cast("Callable[[None], Any]", ctypes.CDLL("ucrtbase" if os.name == "nt" else None).fflush)


class _StandardOutput:
    """Hidden from when the first thread enters foreign code until the last one leaves it.

    The garbage collector may run at any place here, and factors that it frees enter foreign code themselves.
    """

    def __init__(self) -> None:
        self._lock, self._inside = RLock(), 0
        self._kept: int | None = None
        self._filter: _Filter | None = None

    def hide(self) -> None:
        with self._lock:
            self._inside += 1
            if self._inside > 1:
                return
            self._kept = lead_nowhere()
            if sys.stdout is not None:
                self._filter = _Filter(sys.stdout, self._kept)
                sys.stdout = cast("TextIO", self._filter)

    def show(self) -> None:
        with self._lock:
            if self._inside == 1:
                _flush_c()(None)
                if self._filter is not None:
                    if sys.stdout is self._filter:  # else somebody has set another one
                        sys.stdout = self._filter.stream
                    self._filter.end()
                if self._kept is not None:
                    os.dup2(self._kept, 1)
                    os.close(self._kept)
                self._kept = self._filter = None
            self._inside -= 1


class _Filter:
    """`sys.stdout` meanwhile: silent in threads that run foreign code; others reach what descriptor 1 was."""

    def __init__(self, stream: TextIO, kept: int | None) -> None:
        self.stream, self._kept, self._lock = stream, kept, Lock()

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)

    def write(self, text: str) -> int:
        if _THREAD.depth:
            return sys.stderr.write(text) if _is_told() else len(text)
        with self._lock:
            if self._kept is None or not _is_standard(self.stream):
                return self.stream.write(text)
            data = text.replace("\n", os.linesep).encode(self.stream.encoding, self.stream.errors or "strict")
            with open(self._kept, "wb", closefd=False) as place:
                place.write(data)
            return len(text)

    def end(self) -> None:
        """What still holds this one goes the usual way again."""
        with self._lock:
            self._kept = None


_STANDARD_OUTPUT: Final = _StandardOutput()


_ROOM: Final = 1024
"""Bytes for a `struct sigaction`, of which no system has more than 152; nothing is read in it."""


@contextmanager
def handlers_kept() -> Iterator[None]:
    """Afterwards each signal does what it did before.

    Asked and set in the operating system, which Python allows in the main thread alone and for its own handlers alone:
    those of `faulthandler` and of other libraries are kept as well. On Windows nothing is done.
    """
    if os.name != "posix":
        yield
        return
    system, kept = ctypes.CDLL(None), {}
    for number in map(int, signal.valid_signals()):
        action = ctypes.create_string_buffer(_ROOM)
        if system.sigaction(number, None, action) == 0:
            kept[number] = action
    try:
        yield
    finally:
        for known, action in kept.items():
            system.sigaction(known, action, None)  # refused for the two that nobody can set
