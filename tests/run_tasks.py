"""Jobs and tasks for tests of runs, which fail in every way there is; apart, as what loads them is waited for."""

import ctypes
import math
import os
import subprocess
import sys
import time
from os import _exit as end_at_once


def opened(about=None):
    """The job of these tasks, by their names."""
    return about, lambda way: WAYS[way]()


def unloadable():
    raise ValueError("no such thing")


def numbers():
    """The job that returns its orders, after so many seconds."""
    return None, waited


def waited(order):
    number, seconds = order
    time.sleep(seconds)
    return number


def failing(case):
    """A study's task: fail as the case says."""
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
    "plain": plain,
    "hold": holding,
    "wait": waiting,
    "allocate": lambda: {"length": len(bytearray(2_000_000_000))},
    "exit": lambda: end_at_once(0),
    "fault": crashing,
    "fork": forking,
    "raise": lambda: 1 // 0,
    "odd": odd,
    "leave": lambda: sys.exit("left"),
    "function": lambda: {"found": [{"f": lambda: 0}]},
    "number": lambda: 3.0,
    "nan": lambda: {"value": math.nan, "bound": -math.inf},
}
