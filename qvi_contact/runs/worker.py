"""A worker process: loads a job, then does its orders one after the other. Started by `processes`, not by hand.

It imports little, to start quickly. Libraries print to standard error; the parent quotes the last line of a crash.
"""

from __future__ import annotations

import errno
import gc
import os
import pickle
import select
import signal
import sys
import time
import traceback
from contextlib import suppress
from multiprocessing import connection
from pathlib import Path
from threading import Thread
from typing import Any, Final

from solvers.errors import one_line

if sys.platform != "win32":
    import fcntl
    import resource

IDLE: Final = 60.0
"""Seconds without an order after which a worker ends, as on a cluster the parent may be gone."""

SHORTAGE: Final = ("MemoryError", "bad_alloc", "Cannot allocate memory", "failed to map segment")
"""Words in messages of libraries that could not allocate memory."""


def main(link: int, lifeline: int | None) -> None:
    """Serve the parent at the other end of the link, then end this process and all that the orders have started."""
    if sys.platform == "win32":
        channel: Any = connection.PipeConnection(link)
    else:
        channel = connection.Connection(link)
        os.register_at_fork(after_in_child=channel.close)  # so that the link closes when this process ends
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.dup2(2, 1)
    if lifeline is not None:
        _end_with(lifeline)
    try:
        _serve(channel)
    finally:
        end_group()


def _serve(channel: Any) -> None:
    """Receive limits, the job, and then orders; send the answers that `Process.hear` expects."""
    try:
        (mebibytes,) = pickle.loads(channel.recv_bytes())
        if mebibytes is not None and sys.platform != "win32":  # of the address space of this process and its children
            _, hard = resource.getrlimit(resource.RLIMIT_AS)
            limit = mebibytes << 20 if hard == resource.RLIM_INFINITY else min(mebibytes << 20, hard)
            resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        about, work = pickle.loads(channel.recv_bytes())()
        gc.freeze()  # excludes imported modules from garbage collection, which would take longer than a small case
    except EOFError:
        return
    except BaseException as error:  # a module may raise anything
        channel.send(("refused", of_exception(error)[1]))
        return
    channel.send(("loaded", about))
    with suppress(EOFError):
        while channel.poll(IDLE):
            order = channel.recv_bytes()
            gc.collect()  # garbage of the order before, not part of this order's time
            load = round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None
            began, value, failed = time.perf_counter(), None, None
            try:
                value = work(pickle.loads(order))
            except BaseException as error:  # a call of exit counts as a failure too
                failed = error
            answer = time.perf_counter() - began, load, value
            try:
                channel.send_bytes(pickle.dumps(("done", *answer) if failed is None else _failure(failed, *answer)))
            except Exception as error:  # the value cannot be pickled
                channel.send(_failure(error, *answer))


def _failure(error: BaseException, seconds: float, load: float | None, _value: object) -> tuple[Any, ...]:
    """The answer for an order that failed; with the exception itself only if pickling preserves it."""
    status, reason = of_exception(error)
    try:
        kept = error if repr(pickle.loads(pickle.dumps(error))) == repr(error) else None
    except Exception:
        kept = None
    return status, seconds, load, reason, kept


def of_exception(error: BaseException) -> tuple[str, str]:
    """Status, "error" or "memory", and the exception in one line, with the line of code that it came from."""
    text = ": ".join(filter(None, [type(error).__name__, str(error)]))
    short = isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno == errno.ENOMEM)
    places = traceback.extract_tb(error.__traceback__)[-1:]
    where = "".join(f" ({Path(place.filename).name}, line {place.lineno})" for place in places)
    return ("memory" if short or names_shortage(text) else "error"), one_line(text) + where


def names_shortage(text: str) -> bool:
    """Whether a message of a library says that memory could not be allocated."""
    return any(word in text for word in SHORTAGE)


def end_group() -> None:
    """Kill this process and all that it started."""
    if sys.platform != "win32":
        os.killpg(0, signal.SIGKILL)


def _end_with(lifeline: int) -> None:
    """End this process group when the parent ends, which closes the lifeline, a pipe to which nobody writes.

    On Linux the kernel then sends SIGKILL, even while a library keeps control. Elsewhere a thread waits for the end.
    """
    if sys.platform == "linux":
        fcntl.fcntl(lifeline, fcntl.F_SETSIG, signal.SIGKILL)
        fcntl.fcntl(lifeline, fcntl.F_SETOWN, -os.getpgrp())
        fcntl.fcntl(lifeline, fcntl.F_SETFL, fcntl.fcntl(lifeline, fcntl.F_GETFL) | os.O_ASYNC)
        if select.select([lifeline], [], [], 0.0)[0]:  # the parent has ended already
            end_group()
    elif sys.platform != "win32":
        Thread(target=lambda: (os.read(lifeline, 1), end_group()), daemon=True).start()
