"""What a worker process may do: how much memory, and how long without its parent.

On Windows memory is not limited, and a worker whose parent has died first finishes its case.
"""

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread
from typing import IO, Final

if os.name == "posix":
    import fcntl
    import resource
    import select

IDLE: Final = 60.0
"""Seconds without work after which a worker ends: nobody may be left to close it."""

KERNEL: Final = os.name == "posix" and hasattr(fcntl, "F_SETSIG")
"""Whether the kernel can end a process when a pipe is closed."""

_LOOK: Final = 1.0


def limit_memory(mebibytes: int | None) -> None:
    """Limit the address space, of this process and of each that it starts."""
    if mebibytes is None or os.name != "posix":
        return
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    limit = mebibytes << 20
    limit = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def next_line(commands: IO[bytes]) -> bytes:
    """The next line of a pipe; nothing at its end, or after a long silence."""
    if os.name == "posix" and not select.select([commands], [], [], IDLE)[0]:
        return b""
    return commands.readline()


def end_group() -> None:
    """End this process and those it started, at once."""
    if os.name == "posix":
        os.killpg(0, signal.SIGKILL)


@contextmanager
def ends_with_parent(commands: IO[bytes]) -> Iterator[None]:
    """While inside, this process and those it started end when the parent's end of the pipe is closed.

    The parent must send nothing meanwhile, so that all that can happen to the pipe is its end. On Linux the kernel then
    sends SIGKILL to the process group, which works even if a library never gives control back to Python. Elsewhere a
    thread looks for the parent once a second.
    """
    if os.name != "posix":
        yield
    elif KERNEL:
        yield from _ended_by_kernel(commands)
    else:
        _start_looking()
        yield


def _ended_by_kernel(commands: IO[bytes]) -> Iterator[None]:
    flags = fcntl.fcntl(commands, fcntl.F_GETFL)
    fcntl.fcntl(commands, fcntl.F_SETSIG, signal.SIGKILL)
    fcntl.fcntl(commands, fcntl.F_SETOWN, -os.getpgrp())
    fcntl.fcntl(commands, fcntl.F_SETFL, flags | os.O_ASYNC)
    if select.select([commands], [], [], 0.0)[0]:  # closed before
        end_group()
    try:
        yield
    finally:
        fcntl.fcntl(commands, fcntl.F_SETFL, flags)


_looking: list[Thread] = []


def _start_looking() -> None:
    """Start the thread that looks for the parent, unless it runs."""
    if not _looking:
        _looking.append(Thread(target=_look_for_parent, args=(os.getppid(),), daemon=True))
        _looking[0].start()


def _look_for_parent(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_LOOK)
    end_group()
