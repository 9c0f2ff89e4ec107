"""Signals of the process, kept from libraries that set them for themselves."""

import ctypes
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

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
