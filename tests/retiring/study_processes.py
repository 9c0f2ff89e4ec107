"""Processes of the tests of the study runner: started with a mark, found by it, gone in the end."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from uuid import uuid4

from comparisons.lab.study import read_study
from qvi_contact import InputError

ROOT = Path(__file__).parents[2]
MARK = "STUDY_TEST_MARK"
"""Environment variable that is inherited by all that a process starts."""


@contextmanager
def interruptible():
    """What is started meanwhile hears an interrupt, even in a suite that ignores it, as one started with ``&`` does.

    Programs inherit that a signal is ignored, but not that a function handles it.
    """
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def commands(store):
    """A function that starts the demo on this store; afterwards nothing of it is alive."""
    mark = uuid4().hex
    running = []

    def start(*arguments, seconds=0.0):
        with interruptible():
            process = subprocess.Popen(
                [sys.executable, "-m", "tests.retiring.study_demo", "--store", str(store), *arguments],
                cwd=ROOT, env={**os.environ, MARK: mark, "DEMO_SECONDS": str(seconds)}, text=True,
                stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            )  # fmt: skip
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


def alive(pid):
    """Whether there is such a process, and not only its exit status."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def eventually(condition, limit=60.0):
    """Wait until it is true; whether it became so. The limit is for a machine that has much else to do."""
    until = time.monotonic() + limit
    while not condition():
        if time.monotonic() > until:
            return False
        time.sleep(0.05)
    return True


def rows_in(path):
    """How many rows a store has, which may not be there yet."""
    try:
        return len(read_study(path).rows)
    except InputError:
        return 0


def comparable(path):
    """All of a store's rows but the times, machine and versions included."""
    return [replace(row, seconds=0.0, finished="", load_average=None) for row in read_study(path).rows]
