"""A worker process: cases as lines of JSON on standard input, outcomes as lines of JSON on standard output.

    python -m comparisons.lab.worker.child [END]

Started by `children`, not by hand. The first line names the task and the memory limit, the first answer is the
environment, or why the task cannot be loaded. What libraries print goes to standard error.

The process ends when its parent does: between cases it sees the end of standard input, and for the time of a case see
`limits.ends_with_parent`; END is the number of its end of a pipe to which the parent writes nothing. Standard input
would not do for that: on Linux the signal for a line can come after the line was read.
"""

import gc
import json
import os
import sys
import time
from collections.abc import Callable
from importlib import import_module
from typing import IO, Any

from comparisons.lab.machine import load_average, machine, versions
from comparisons.lab.worker.limits import end_group, ends_with_parent, limit_memory, next_line
from comparisons.lab.worker.outcome import of_exception, of_return

Task = Callable[[dict[str, Any]], Any]


def main() -> None:
    """Do what is asked, then end with all that the task may have started."""
    try:
        _serve(*_channels(), _lifeline())
    finally:
        end_group()


def _lifeline() -> IO[bytes] | None:
    """The pipe that is closed when the parent ends, for this process alone."""
    if len(sys.argv) < 2:
        return None
    os.set_inheritable(int(sys.argv[1]), False)
    return os.fdopen(int(sys.argv[1]), "rb")


def _serve(commands: IO[bytes], answers: IO[bytes], lifeline: IO[bytes] | None) -> None:
    """Load the task, then do the cases one after the other."""
    order = json.loads(commands.readline())
    pipe = lifeline or commands
    try:
        with ends_with_parent(pipe):
            limit_memory(order["memory"])
            task = _loaded(order["task"])
            gc.freeze()  # imported modules stay: to look through them for garbage takes longer than a small case
    except BaseException as error:  # a module may raise anything
        _answer(answers, {"refused": of_exception(error)["reason"]})
        return
    _answer(answers, {"environment": {"machine": machine(), "versions": versions(order["packages"])}})
    while line := next_line(commands):
        with ends_with_parent(pipe):
            outcome = _outcome(task, json.loads(line))
        _answer(answers, outcome)  # out there: the next case may follow at once


def _channels() -> tuple[IO[bytes], IO[bytes]]:
    """Both ends of the conversation; the task finds an empty standard input, and the other for all it prints."""
    commands, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)
    os.dup2(2, 1)
    return commands, answers


def _answer(answers: IO[bytes], document: dict[str, Any]) -> None:
    answers.write(json.dumps(document).encode() + b"\n")
    answers.flush()


def _loaded(name: str) -> Task:
    module, _, function = name.partition(":")
    task: Task = getattr(import_module(module), function)
    if not callable(task):
        raise TypeError(f"{function} is of type {type(task).__name__}, not a function")
    return task


def _outcome(task: Task, values: dict[str, Any]) -> dict[str, Any]:
    gc.collect()  # of the case before, whose time it belongs to
    load = load_average()
    began = time.perf_counter()
    try:
        returned = task(values)
    except BaseException as error:  # an exit is the task's failure too
        seconds, found = time.perf_counter() - began, of_exception(error)
    else:
        seconds, found = time.perf_counter() - began, of_return(returned)
    return {**found, "seconds": seconds, "load_average": load}


if __name__ == "__main__":
    main()
