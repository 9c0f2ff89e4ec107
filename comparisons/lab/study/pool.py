"""Cases on this machine: a few threads, each of which waits for a worker process."""

from collections.abc import Generator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import closing

from comparisons.lab.study.children import Crew, Terms
from comparisons.lab.study.declaration import Case
from comparisons.lab.worker.outcome import Outcome

Done = tuple[Case, Outcome]


def outcomes(terms: Terms, cases: Sequence[Case], workers: int) -> Generator[Done]:
    """Do the cases in `workers` processes at a time, and yield what became of each as it comes.

    When the iterator is closed, the processes are ended.
    """
    with ThreadPoolExecutor(workers) as threads, closing(Crew(terms)) as crew:
        try:
            for future in as_completed([threads.submit(_done, crew, case) for case in cases]):
                yield future.result()
        finally:
            threads.shutdown(wait=False, cancel_futures=True)


def _done(crew: Crew, case: Case) -> Done:
    return case, crew.run(case.values)
