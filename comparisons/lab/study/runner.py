"""Running a study: what is missing in the store is done, and written row by row."""

import pickle
from collections import Counter, deque
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from comparisons.lab.machine import machine, versions
from comparisons.lab.progress import progress
from comparisons.lab.study.declaration import Study, canonical, plain
from comparisons.lab.study.rows import finished_keys, writing
from qvi_contact.errors import InputError
from qvi_contact.runs.cluster import Workers
from qvi_contact.runs.processes import Limits, NotLoadedError


@dataclass
class StudyRun:
    """What one run did.

    Attributes
    ----------
    study : Study
        What was run.
    store : Path
        Where the rows are.
    before : int
        Rows that earlier runs had finished.
    statuses : Counter
        Status → rows of this run.
    interrupted : bool
        Whether it was stopped from the keyboard.

    """

    study: Study
    store: Path
    before: int = 0
    statuses: Counter[str] = field(default_factory=Counter)
    interrupted: bool = False

    @property
    def finished(self) -> int:
        """Rows in the store."""
        return self.before + self.statuses.total()

    @property
    def complete(self) -> bool:
        """Whether every case has its row."""
        return self.finished == len(self.study.cases)


def run_study(
    study: Study,
    store_path: str | Path,
    workers: int = 1,
    dask: str | None = None,
    timeout: float | None = None,
    memory: int | None = None,
    progress: bool = True,
    threads: int = 1,
) -> StudyRun:
    """Do the cases that the store has no row of; a failure of a case is a row too, and not done again.

    Parameters
    ----------
    study : Study
        What to run.
    store_path : path
        The store; made if it is missing, with its folder. A store that is complete may be read-only.
    workers : int
        Worker processes on this machine.
    dask : str, optional
        Address of the scheduler of a Dask cluster to run on instead.
    timeout : float, optional
        Seconds a case may take, without the imports of the task's module.
    memory : int, optional
        MiB of address space a worker may have, where the system has such a limit (not on Windows).
    progress : bool
        Whether to show a bar, if standard error is a terminal.
    threads : int
        Threads of the libraries in each worker.

    Returns
    -------
    StudyRun
        Also after an interrupt from the keyboard, with `interrupted` set.

    Raises
    ------
    InputError
        If the store cannot be used, the task cannot be loaded in a worker, at all or with so little memory, or the
        cluster cannot be reached. Rows that were finished are in the store.

    """
    for name, value in (("workers", workers), ("timeout", timeout), ("memory", memory), ("threads", threads)):
        if value is not None and not value > 0:
            raise InputError(name, value, "give a number above 0")
    run = StudyRun(study, Path(store_path))
    run.before = len(finished_keys(run.store, study))
    if not run.complete:
        shared = Workers(workers, dask)
        try:
            _do(run, shared, Limits(timeout, memory, threads, study.fresh), progress)
        except KeyboardInterrupt:
            run.interrupted = True
            run.before = len(finished_keys(run.store, study)) - run.statuses.total()  # a row may be in, and not counted
        except NotLoadedError as error:
            if error.cramped:
                remedy = f"is too little (MiB) to load {study.task_name}: give more, or no limit"
                raise InputError("memory", memory, remedy) from error
            raise InputError("Study.task", study.task_name, f"cannot be loaded: {error.reason}") from error
    return run


def _do(run: StudyRun, workers: Workers, limits: Limits, shown: bool) -> None:
    study, job = run.study, pickle.dumps(partial(opened, run.study.task_name, run.study.packages))
    terms = {"threads": limits.threads, "timeout_seconds": limits.seconds, "memory_mib": limits.memory}
    with writing(run.store, study) as store:
        finished = store.keys()
        run.before = len(finished)
        pending = {case.position: case for case in study.cases if case.key not in finished}
        with (
            progress(study.name, len(study.cases), run.before, shown=shown) as advance,
            workers.ready(job, limits) as (_, outcomes),
            closing(outcomes(deque((place, dict(case.values)) for place, case in pending.items()))) as found,
        ):
            for (place, _), outcome in found:
                about = outcome.about or {"machine": None, "versions": {}}  # of a worker that a cluster has lost
                store.append(pending[place], outcome, {**about, **terms})
                run.statuses[outcome.status] += 1
                advance()


def opened(task: str, packages: tuple[str, ...]) -> tuple[dict[str, Any], Callable[[Any], dict[str, Any]]]:
    """What a worker process of a study does: machine and versions, and the function that does a case."""
    module, _, name = task.partition(":")
    function = getattr(import_module(module), name)
    if not callable(function):
        raise TypeError(f"{name} is of type {type(function).__name__}, not a function")

    def done(order: tuple[int, dict[str, Any]]) -> dict[str, Any]:
        return plain_result(function(order[1]))

    return {"machine": machine(), "versions": versions(packages)}, done


def plain_result(returned: object) -> dict[str, Any]:
    """What a task returned, in plain values. Infinite numbers and NaN are plain: a residual may well be infinite.

    Raises
    ------
    TypeError, ValueError
        If it is no mapping of plain values.

    """
    if not isinstance(returned, Mapping):
        raise TypeError(f"the task returned {type(returned).__name__}, not a mapping")
    result: dict[str, Any] = plain(returned, "result")
    canonical(result)
    return result
