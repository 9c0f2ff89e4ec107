"""Sweeps of thousands of values: rows of numbers that go to a file as they are found, by one process or several."""

from __future__ import annotations

import math
import pickle
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from uuid import uuid4

from qvi_contact import __version__
from qvi_contact.basics.spread import Crew
from qvi_contact.errors import InputError
from qvi_contact.problem.fingerprint import run_digest
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.sweep_rows import COLUMNS, Parameter, SweepRow
from qvi_contact.solution.sweep_run import SweepRun, SweepTask, checked_values
from solvers import Status
from solvers.basics.checks import function_or_none
from solvers.basics.narration import narrated
from solvers.basics.types import load
from solvers.basics.watch import expired, left, watched

if TYPE_CHECKING:
    from qvi_contact.files.sweep_store import StoredSweep

_LARGEST: Final = 50  # values of a slice: rows come slice by slice
_LEAST: Final = 1e-3  # seconds that a slice has which comes too late
_SLICES: Final = 4  # for each worker at least, so that all end at about the same time


def stream_sweep(
    problem: ContactProblem,
    parameter: Parameter,
    values: Sequence[float],
    store: str | Path,
    of: Sequence[str] | None = None,
    callback: Callable[[int, SweepRow], object] | None = None,
    *,
    workers: int = 1,
    dask: str | None = None,
    time_limit: float | None = None,
    verbose: bool = False,
    **options: Any,  # checked by SweepTask and solve
) -> StoredSweep:
    """Solve a problem for thousands of values as `solve_sweep` does, and keep rows of numbers in a file.

    The same call again goes on where the last one stopped, whatever stopped it. A value without an answer has its row
    too, and is not tried again; one that the time limit cut short has none.

    Parameters
    ----------
    problem, parameter, values, of
        As for `solve_sweep`.
    store : str or Path
        An SQLite file, made if it is missing, with a row for each value and contact. A row is on the disk as soon as
        its value is done, or the slice of values that a worker process does at a time; no result is kept.
    callback : callable, optional
        Called with the number of each value, from 1, and its row. Values already in the file are not told.
    workers : int
        Processes of this machine that share the values. Each does slices of neighbouring values, on one thread, and
        keeps its factorisation from one slice to the next. A script needs ``if __name__ == "__main__"`` then.
    dask : str, optional
        Address of the scheduler of a Dask cluster that does so instead, as tcp://host:8786.
    time_limit : float, optional
        Seconds for all values together.
    verbose : bool
        Print a header, a line a value, and a footer with status and time.
    **options
        As for `solve_sweep`.

    Returns
    -------
    StoredSweep

    Raises
    ------
    InputError
        If a value or a name is wrong, the store cannot be written or holds another sweep, the cluster cannot be
        reached, or the problem cannot be sent to other processes.
    SolveError
        If a worker process is lost. Rows that were written stay.

    """
    function_or_none("callback", callback)
    title = f"qvi_contact {__version__}: stream_sweep"
    kept, crew = load("qvi_contact.files.sweep_store"), Crew(workers, dask)
    with watched(time_limit), narrated(title, verbose, COLUMNS, iterations=False) as story:
        task = SweepTask.of(problem, parameter, of, **options)
        numbers = checked_values(parameter, values)
        story.begin({"values": len(numbers), "parameter": parameter, "cells": task.problem.mesh.cell_count})
        with (
            kept.writing(store, _fingerprint(task, numbers), parameter, numbers) as opened,
            closing(_rows_of(task, opened.pending(), crew)) as found,
        ):
            for rows in found:
                opened.append(rows)
                for row in rows:
                    story.line(row.number, row.value, str(row.status), row.iterations, row.accuracy)
                    if callback is not None:
                        callback(row.number, row)
        sweep: StoredSweep = kept.read_sweep(store)
        story.end(str(sweep.status), sweep.message, {}, sweep.status is Status.SOLVED)
        return sweep


def _fingerprint(task: SweepTask, values: Sequence[float]) -> str:
    asked = {"parameter": task.parameter, "of": task.names, "values": tuple(values), "warm_start": task.warm}
    return run_digest([task.problem], {**task.space, **task.options, **asked})


def _rows(run: SweepRun, planned: Sequence[tuple[int, float]]) -> Iterator[SweepRow]:
    """The rows of these numbers and values, until the time is over: a value that it has cut short has no row."""
    for number, value in planned:
        if expired():
            return
        found = run.result(value)
        if found.status is Status.TIME_LIMIT:
            return
        yield SweepRow.of(number, value, found, run.seconds)


def _rows_of(task: SweepTask, planned: Sequence[tuple[int, float]], crew: Crew) -> Generator[list[SweepRow]]:
    """Rows of these numbers and values as they come, a few at a time, until the time is over."""
    if not crew.elsewhere:
        yield from ([row] for row in _rows(SweepRun(task), planned))
        return
    yield from crew.spread(_solved, _slices(_pickled(replace(task, options={"threads": 1, **task.options})), planned))


@dataclass(frozen=True, eq=False)
class _Slice:
    """Neighbouring values for one worker.

    Attributes
    ----------
    run : str
        Tells the task from others.
    task : bytes
        The `SweepTask`, pickled once for all slices.
    planned : list of (int, float)
        Numbers and values.
    end : float
        When the time is over, by `time.time`, which clocks of a cluster share.

    """

    run: str
    task: bytes
    planned: Sequence[tuple[int, float]]
    end: float


def _slices(task: bytes, planned: Sequence[tuple[int, float]]) -> Callable[[int], Iterator[_Slice]]:
    """Slices of all that is planned, for so many workers."""
    run, seconds = uuid4().hex, left()
    end = time.time() + seconds

    def slices(workers: int) -> Iterator[_Slice]:
        size = min(_LARGEST, max(1, math.ceil(len(planned) / (_SLICES * workers))))
        return (_Slice(run, task, planned[first : first + size], end) for first in range(0, len(planned), size))

    return slices


def _pickled(task: SweepTask) -> bytes:
    try:
        return pickle.dumps(task)
    except Exception as error:  # PicklingError, AttributeError or TypeError, by what it is
        remedy = (
            "cannot be sent to other processes: give Expression or Polynomial for its functions, or those of modules"
        )
        raise InputError("problem", task.problem, f"{remedy} ({error})") from error


_HELD = threading.local()
"""Run and `SweepRun` of the slice before, of each thread of a worker: the next slice has its factorisation."""


def _solved(part: _Slice) -> list[SweepRow]:
    """The rows of a slice; called in a worker."""
    if getattr(_HELD, "run", "") != part.run:
        _HELD.run, _HELD.sweep = part.run, SweepRun(pickle.loads(part.task))
    seconds = max(part.end - time.time(), _LEAST)
    with watched(seconds if seconds < math.inf else None):
        return list(_rows(_HELD.sweep, part.planned))
