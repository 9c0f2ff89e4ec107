"""Jobs and tasks for tests of runs, which fail in every possible way; few imports, so that the module loads fast."""

import ctypes
import math
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from os import _exit as end_at_once
from pathlib import Path
from uuid import uuid4


def opened(about=None):
    """The job that runs these tasks by their names."""
    return about, lambda way: WAYS[way]()


def unloadable():
    raise ValueError("no such thing")


def numbers():
    """The job that returns the number of an order after its seconds."""
    return None, waited


def waited(order):
    number, seconds = order
    time.sleep(seconds)
    return number


def failing(case):
    """A study's task that fails in the way of the case."""
    return WAYS[case["way"]]()


def measured(case):
    """A study's task: plain arithmetic for a while, with a certificate; some methods fail."""
    time.sleep(float(os.environ.get("DEMO_SECONDS", "0")))
    if case["method"] == "crash":
        end_at_once(3)
    if case["method"] == "raise":
        raise ValueError(f"no method for {case['mesh']}")
    force = case["mesh"] * case["friction"] + case["seed"]
    return {"force": force, "error": math.inf, "certificate": {"passed": True, "gap": 1e-9 * case["mesh"]}}


def deadly(x, y):
    """A gap that ends every process but the one whose number is in the environment."""
    if str(os.getpid()) != os.environ["RUN_TEST_RUNNER"]:
        end_at_once(9)
    return 0.0 * (x + y)


def holding():
    """Start another process, and keep the interpreter's lock while this one sleeps."""
    subprocess.Popen(["sleep", "1000"])
    ctypes.PyDLL(None).sleep(1000)


def waiting():
    """The same without the lock."""
    subprocess.Popen(["sleep", "1000"])
    time.sleep(1000.0)


def crashing():
    """The same, and then crash with some last words."""
    subprocess.Popen(["sleep", "1000"])
    print("before the fault", file=sys.stderr)
    ctypes.string_at(0)


def forking():
    """End while a copy of this process lives on."""
    if os.fork():
        end_at_once(4)
    time.sleep(1000.0)


def plain():
    print("printed")
    return {"pid": os.getpid(), "text": "µ", "threads": os.environ["OMP_NUM_THREADS"], "input": sys.stdin.read()}


class OddError(Exception):
    """Cannot be made again from its arguments."""

    def __init__(self, one, other):
        super().__init__(f"{one} and {other}")


def odd():
    raise OddError("this", "that")


WAYS = {
    "plain": plain, "hold": holding, "wait": waiting, "allocate": lambda: {"length": len(bytearray(2_000_000_000))},
    "exit": lambda: end_at_once(0), "fault": crashing, "fork": forking, "raise": lambda: 1 // 0, "odd": odd,
    "leave": lambda: sys.exit("left"), "function": lambda: {"found": [{"f": lambda: 0}]}, "number": lambda: 3.0,
    "nan": lambda: {"value": math.nan, "bound": -math.inf},
}  # fmt: skip


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
