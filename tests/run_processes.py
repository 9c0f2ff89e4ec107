"""Processes of the tests of runs: started with a mark, found by it, gone in the end."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

ROOT = Path(__file__).parents[1]
MARK = "RUN_TEST_MARK"
"""Environment variable that is inherited by all that a process starts."""


@contextmanager
def started():
    """A function that starts Python with these words in a process that hears interrupts; afterwards nothing is alive.

    Programs inherit that a signal is ignored, as by a suite that was started with ``&``, but not that it is handled.
    """
    mark, running = uuid4().hex, []

    def start(*words, folder=ROOT, **environment):
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            process = subprocess.Popen(
                [sys.executable, *map(str, words)], cwd=folder, text=True,
                env={**os.environ, "PYTHONPATH": str(ROOT), MARK: mark, **environment},
                stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            )  # fmt: skip
        finally:
            signal.signal(signal.SIGINT, before)
        running.append(process)
        process.mark = mark
        return process

    try:
        yield start
    finally:
        for process in running:
            process.kill()
            process.communicate()
    assert eventually(lambda: not marked(mark)), marked(mark)


def marked(mark):
    """Number → command line of the living processes that were started with a mark."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if f"{MARK}={mark}".encode() in (folder / "environ").read_bytes().split(b"\0"):
                found[int(folder.name)] = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        except OSError:
            continue
    return found


def workers(mark):
    """Numbers of the worker processes among them."""
    return [number for number, line in marked(mark).items() if "runs.worker" in line]


def eventually(condition, limit=60.0):
    """Wait until it is true; whether it became so. The limit is for a machine that has much else to do."""
    until = time.monotonic() + limit
    while not condition():
        if time.monotonic() > until:
            return False
        time.sleep(0.05)
    return True
