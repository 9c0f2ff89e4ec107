"""Cases on this machine: a few worker processes, each with a thread that waits for it."""

from collections.abc import Generator, Sequence
from queue import Empty, SimpleQueue
from threading import Thread

from comparisons.lab.study.children import Child, Terms
from comparisons.lab.study.declaration import Case
from comparisons.lab.study.outcome import Outcome

Done = tuple[Case, Outcome]


def outcomes(terms: Terms, cases: Sequence[Case], workers: int) -> Generator[Done]:
    """Do the cases in `workers` processes at a time, and yield what became of each as it comes.

    When the iterator is closed, the processes are ended.
    """
    waiting: SimpleQueue[Case] = SimpleQueue()
    for case in cases:
        waiting.put(case)
    done: SimpleQueue[Done | BaseException] = SimpleQueue()
    children = [Child(terms) for _ in range(min(workers, len(cases)))]
    threads = [Thread(target=_work, args=(child, waiting, done), daemon=True) for child in children]
    try:
        for thread in threads:
            thread.start()
        for _ in cases:
            found = done.get()
            if isinstance(found, BaseException):
                raise found
            yield found
    finally:
        for child in children:
            child.stop()
        for thread, child in zip(threads, children, strict=True):
            if thread.ident is not None:
                thread.join()
            child.close()


def _work(child: Child, waiting: "SimpleQueue[Case]", done: "SimpleQueue[Done | BaseException]") -> None:
    try:
        while True:
            try:
                case = waiting.get_nowait()
            except Empty:
                return
            done.put((case, child.run(case.values)))
    except BaseException as error:  # for the thread that waits
        done.put(error)
