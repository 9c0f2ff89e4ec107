"""Fresh processes for measurements, with their threads limited before NumPy is loaded.

Peak memory is then that of one problem, and no time depends on what ran before.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Generator, Iterator
from contextlib import suppress
from threading import Event, Timer
from typing import Any

from comparisons.lab.study.children import environment, last_words


def records(task: dict[str, Any], threads: int, limit: float | None = None) -> Iterator[dict[str, Any]]:
    """Do a task of `worker` in a process of its own, and yield its records as they come.

    The last record has the kind "end", and a "reason", such as "more than 120 s", unless the task was completed.

    Parameters
    ----------
    task : dict
        What to do, see `worker`.
    threads : int
        Threads that its libraries may use.
    limit : float, optional
        Seconds after which the process is ended.

    """
    with tempfile.TemporaryFile() as complaints:
        process = subprocess.Popen(
            [sys.executable, "-m", "comparisons.benchmark.worker"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=complaints, env=environment(threads),
        )  # fmt: skip
        late = Event()
        timer = Timer(limit or 0.0, _stop, (process, late))
        timer.daemon = True
        completed, ended = False, False
        try:
            if limit is not None:
                timer.start()
            completed = yield from _exchange(process, task)
            ended = True
        finally:
            if not ended:  # nobody wants the rest
                process.kill()
            process.wait()
            timer.cancel()
            _close(process)
        reason = "" if completed else _reason(process.returncode, complaints, limit if late.is_set() else None)
        yield {"kind": "end", "reason": reason}


def _exchange(process: "subprocess.Popen[bytes]", task: dict[str, Any]) -> Generator[dict[str, Any], None, bool]:
    """Send the task, yield the records; returns whether the process said that it was done."""
    assert process.stdin is not None
    assert process.stdout is not None
    with suppress(BrokenPipeError):  # it has ended before; its exit status says so
        process.stdin.write(json.dumps(task).encode())
        process.stdin.close()
    for line in process.stdout:
        if not line.endswith(b"\n"):  # it was ended while it wrote
            return False
        record: dict[str, Any] = json.loads(line)
        if record["kind"] == "done":
            return True
        yield record
    return False


def _stop(process: "subprocess.Popen[bytes]", late: Event) -> None:
    late.set()
    process.kill()


def _close(process: "subprocess.Popen[bytes]") -> None:
    """Close both ends; what a dead process has not read is lost."""
    for stream in (process.stdin, process.stdout):
        with suppress(BrokenPipeError):
            if stream is not None:
                stream.close()


def _reason(code: int, complaints: Any, limit: float | None) -> str:
    """Why a process ended before it was done."""
    if limit is not None:
        return f"more than {limit:g} s"
    return f"the process ended with status {code}: {last_words(complaints) or 'no message'}"
