"""Build and solve the plate several times by one code, in a process of its own, and measure times and memory.

    python process.py < order.json

`comparisons.peers.study` starts the process. It imports only the standard library and the code's module beside this
one, so that a Python without this project can run it. Output of libraries goes to standard error; the answer is one
line of JSON on standard output.
"""

import gc
import json
import os
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any, Final

BUDGET: Final = 5.0
"""Seconds after which no further repetition begins."""


Build = Callable[..., Callable[[], dict[str, Any]]]
"""(Case, options of the code) → a function that solves the case anew and returns status, message and numbers."""


def main() -> None:
    """Read the order, solve, and write the answer."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    order = json.load(sys.stdin)
    build = import_module(order.pop("module")).plate
    answers.write(json.dumps(repeated(build, **order)) + "\n")
    answers.close()


def repeated(build: Build, case: dict[str, Any], warm_up: dict[str, Any], options: dict[str, Any], repetitions: int
             ) -> dict[str, Any]:  # fmt: skip
    """Solve a case up to `repetitions` times, but start no repetition after `BUDGET`.

    Returns the last answer with "setup" and "solve", lists of processor times [s], and "before" and "peak", the largest
    resident memory [bytes] after a tiny case that loads all libraries, and after the first solve of the case. If the
    code raises an exception, only status and message.
    """
    answer: dict[str, Any] = {}
    times: dict[str, list[float]] = {"setup": [], "solve": []}
    try:
        build(warm_up, **options)()
        before, peak, began = peak_memory(), None, time.perf_counter()
        for count in range(repetitions):
            if count and time.perf_counter() - began > BUDGET:
                break
            gc.collect()
            start = time.process_time()  # wall time would include other processes
            solve = build(case, **options)
            built = time.process_time()
            answer = solve()
            times["setup"].append(built - start)
            times["solve"].append(time.process_time() - built)
            del solve
            peak = peak_memory() if count == 0 else peak
    except Exception as error:  # a library may raise anything
        return {"status": "error", "message": f"{type(error).__name__}: {error}"}
    return {**answer, **times, "before": before, "peak": peak}


def peak_memory() -> int | None:
    """Largest resident memory of this process so far [bytes]; None where the system does not tell it in /proc."""
    with suppress(OSError):
        for line in Path("/proc/self/status").read_text(encoding="utf-8").splitlines():
            if line.startswith("VmHWM:"):  # ru_maxrss would include the parent process
                return 1024 * int(line.split()[1])
    return None


if __name__ == "__main__":
    main()
