"""A small study for the tests of the study runner, as a command, and tasks that fail in every way there is."""

import ctypes
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import click

from comparisons.lab.study import Study, study_options
from qvi_contact.basics.terminal import run

DEMO = Study(
    "demo",
    1,
    "tests.comparisons.study_demo:measured",
    {"mesh": (8, 16), "friction": (0.1, 0.2, 0.5), "method": ("plain", "crash", "raise")},
    repeats=2,
    seed=7,
    keep=lambda case: case["method"] != "crash" or (case["mesh"], case["friction"]) == (8, 0.2),
    packages=("click", "no-such-package"),
)

SMALL = Study("small", 1, "package.module:function", {"mesh": (4, 8), "friction": (0.1,)}, repeats=2, seed=5)
ENVIRONMENT = {"machine": None, "versions": {"numpy": "2"}, "threads": 1, "timeout_seconds": 2.0, "memory_mib": None}


def measured(case):
    """Plain arithmetic for a while, with a certificate; some methods fail."""
    time.sleep(float(os.environ.get("DEMO_SECONDS", "0")))
    if case["method"] == "crash":
        os._exit(3)
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
    "exit": lambda: os._exit(0),
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


def ways(*names, **more):
    """The study of some of these."""
    return Study("ways", 1, "tests.comparisons.study_demo:failing", {"way": names or tuple(WAYS)}, packages=(), **more)


@click.command()
@study_options("demo.sqlite")
@click.option("--way", "names", multiple=True, help="Ways to fail, instead of the demo.")
def main(options, names):
    """The demo study."""
    study = ways(*names) if names else DEMO
    done = options.run(study)
    click.echo(f"{done.finished} of {len(study.cases)}")


if __name__ == "__main__":
    run(main, "study_demo")
