"""Work spread over processes: what becomes of them, and of the one that waits for them."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, nullcontext
from pathlib import Path

import pytest

from qvi_contact import InputError, SolveError
from qvi_contact.basics import spread
from qvi_contact.basics.spread import Crew

ROOT = Path(__file__).parents[2]


def slept(seconds):
    """Tell which process it is, and sleep."""
    print(os.getpid(), flush=True)
    time.sleep(seconds)
    return os.getpid()


def ended(_order):
    """Take the process with it."""
    os._exit(3)


def test_a_process_that_is_lost():
    with pytest.raises(SolveError, match="worker process"):
        list(Crew(1).spread(ended, lambda _: [1]))


def alive(number):
    """Whether there is such a process, and it is no zombie."""
    try:
        state = Path(f"/proc/{number}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()[0]
    except OSError:
        return False
    return state != "Z"


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="tells processes by /proc")
def test_processes_end_with_the_one_that_is_killed():
    script = "from tests.qvi_contact.test_spread import *\nlist(Crew(1).spread(slept, lambda _: [60.0]))"
    with subprocess.Popen([sys.executable, "-c", script], cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        worker = int(process.stdout.readline())
        assert alive(worker)
        os.kill(process.pid, signal.SIGKILL)
    end = time.monotonic() + 10.0
    while alive(worker) and time.monotonic() < end:
        time.sleep(0.05)
    assert not alive(worker)


def test_processes_end_with_what_they_are_for():
    began = time.monotonic()
    with closing(Crew(2).spread(slept, lambda _: [0.0, 60.0])) as found:
        worker = next(found)
    assert time.monotonic() - began < 30.0
    assert not alive(worker)


def halved(number):
    """Half of it, if it is even."""
    if number % 2:
        raise InputError("number", number, "give an even one")
    return number // 2


def test_a_cluster_does_the_same():
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None
    ) as cluster:
        crew, seen = Crew(dask=cluster.scheduler_address), []
        assert sorted(crew.spread(halved, lambda size: seen.append(size) or range(0, 40, 2))) == list(range(20))
        assert seen == [2]
        with pytest.raises(InputError, match="even"):
            list(crew.spread(halved, lambda _: [1]))


class Leaving:
    """The client of a cluster whose scheduler is lost after the first look."""

    status, looks = "running", 0

    def nthreads(self):
        self.looks += 1
        if self.looks > 2:
            raise OSError("connection closed")
        return {"worker": 1}

    def get_executor(self, pure):
        assert not pure
        return ThreadPoolExecutor(1)


def test_a_scheduler_that_is_lost(monkeypatch):
    monkeypatch.setattr(spread, "check", lambda _: None)
    monkeypatch.setattr(spread, "connected", lambda _: nullcontext(Leaving()))
    found = Crew(dask="tcp://somewhere:1").spread(halved, lambda _: range(0, 1000, 2))
    assert next(found) == 0
    with pytest.raises(InputError, match="scheduler was lost"):
        list(found)
