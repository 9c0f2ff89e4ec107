"""Tasks for tests of the study runner, which fail in every way there is; apart, as what loads them is waited for."""

import ctypes
import math
import os
import signal
import subprocess
import sys
import time
from os import _exit as end_at_once
from pathlib import Path


def measured(case):
    """Plain arithmetic for a while, with a certificate; some methods fail."""
    time.sleep(float(os.environ.get("DEMO_SECONDS", "0")))
    if case["method"] == "crash":
        end_at_once(3)
    if case["method"] == "raise":
        raise ValueError(f"no method for {case['mesh']}")
    force = case["mesh"] * case["friction"] + case["seed"]
    return {"force": force, "error": math.inf, "certificate": {"passed": True, "gap": 1e-9 * case["mesh"]}}


def failing(case):
    """Fail as the case says."""
    return WAYS[case["way"]]()


def holding():
    """Start another process, and keep the interpreter's lock while this one sleeps."""
    subprocess.Popen(["sleep", "1000"])
    ctypes.PyDLL(None).sleep(1000)


def waiting():
    """The same without the lock."""
    subprocess.Popen(["sleep", "1000"])
    time.sleep(1000.0)


def allocating():
    return {"length": len(bytearray(2_000_000_000))}


def fault():
    print("before the fault", file=sys.stderr)
    ctypes.string_at(0)


def plain():
    print("printed")
    return {"pid": os.getpid(), "text": "µ", "threads": os.environ["OMP_NUM_THREADS"], "input": sys.stdin.read()}


def cyclic():
    found = {}
    found["self"] = found
    return found


WAYS = {
    "plain": plain,
    "hold": holding,
    "wait": waiting,
    "allocate": allocating,
    "exit": lambda: end_at_once(0),
    "fault": fault,
    "raise": lambda: 1 // 0,
    "leave": lambda: sys.exit("left"),
    "function": lambda: {"found": [{"f": plain}]},
    "number": lambda: 3.0,
    "nan": lambda: {"value": math.nan, "bound": -math.inf},
    "cyclic": cyclic,
}


def losing(case):
    """Kill the process that waits for this one, the first times; files in a folder remember how often."""
    folder = Path(os.environ["DEMO_FOLDER"])
    done = len(list(folder.glob(f"{case['times']}-*")))
    if done < case["times"]:
        (folder / f"{case['times']}-{done}").touch()
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(60.0)
    return {"tried": done + 1}


def meeting(case):
    """Wait until as many processes as the case says do so at the same time."""
    folder = Path(os.environ["DEMO_FOLDER"])
    (folder / f"meeting-{os.getpid()}").touch()
    while len(list(folder.glob("meeting-*"))) < case["processes"]:
        time.sleep(0.01)
    return {"pid": os.getpid()}
