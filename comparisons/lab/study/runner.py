"""Running a study: what is missing in the store is done, and written row by row."""

from collections import Counter
from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

from comparisons.lab.progress import progress
from comparisons.lab.study import cluster, pool
from comparisons.lab.study.children import Terms
from comparisons.lab.study.declaration import Case, Study
from comparisons.lab.study.store import finished_keys, writing
from comparisons.lab.worker.outcome import CRAMPED, REFUSED, Outcome
from qvi_contact.basics.cluster import check
from qvi_contact.errors import InputError


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
        Address of the scheduler of a Dask cluster to run on instead; see `cluster`.
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
    _check(workers, timeout, memory, threads)
    run = StudyRun(study, Path(store_path))
    run.before = len(finished_keys(run.store, study))
    if not run.complete:
        if dask is not None:
            check(dask)
        terms = Terms(study.task_name, study.packages, threads, timeout, memory, study.fresh)
        try:
            _do(run, terms, workers, dask, progress)
        except KeyboardInterrupt:
            run.interrupted = True
            run.before = len(finished_keys(run.store, study)) - run.statuses.total()  # a row may be in, and not counted
    return run


def _check(workers: int, timeout: float | None, memory: int | None, threads: int) -> None:
    for name, value in (("workers", workers), ("timeout", timeout), ("memory", memory), ("threads", threads)):
        if value is not None and not value > 0:
            raise InputError(name, value, "give a number above 0")


def _do(run: StudyRun, terms: Terms, workers: int, dask: str | None, shown: bool) -> None:
    with writing(run.store, run.study) as store:
        finished = store.keys()
        run.before = len(finished)
        pending = [case for case in run.study.cases if case.key not in finished]
        with (
            progress(run.study.name, len(run.study.cases), run.before, shown=shown) as advance,
            closing(_outcomes(terms, pending, workers, dask)) as outcomes,
        ):
            for case, outcome in outcomes:
                _check_loaded(terms, outcome)
                store.append(case, outcome)
                run.statuses[outcome.status] += 1
                advance()


def _check_loaded(terms: Terms, outcome: Outcome) -> None:
    if outcome.status == CRAMPED:
        raise InputError("memory", terms.memory, f"is too little (MiB) to load {terms.task}: give more, or no limit")
    if outcome.status == REFUSED:
        raise InputError("Study.task", terms.task, outcome.reason)


def _outcomes(terms: Terms, cases: Sequence[Case], workers: int, dask: str | None) -> Generator[pool.Done]:
    return pool.outcomes(terms, cases, workers) if dask is None else cluster.outcomes(terms, cases, dask)
