"""Runs: whatever happens to an order is its outcome, none is lost or done twice, and nothing stays behind."""

import multiprocessing
import os
import pickle
import signal
import socket
import subprocess
import sys
import time
from collections import deque
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from threading import Event, Timer
from types import SimpleNamespace
from unittest.mock import Mock
from uuid import uuid4

import pytest

from qvi_contact import InputError
from qvi_contact.runs import FAILURES, Limits, NotLoadedError, Workers
from qvi_contact.runs import processes as runs
from tests.cases import refused_at
from tests.run_tasks import MARK, ROOT, eventually, marked, numbers, opened, started, unloadable, workers

processes = pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="looks for processes in /proc")


@contextmanager
def running(job, orders, count=1, limits=None, dask=None):
    """The outcomes of these orders, as they come."""
    ready = Workers(count, dask).ready(pickle.dumps(job), limits or Limits())
    with ready as (_, outcomes), closing(outcomes(deque(orders))) as found:
        yield found


def done(job, orders, *terms, **more):
    """All of them."""
    with running(job, orders, *terms, **more) as found:
        return list(found)


@pytest.fixture
def mark(environ):
    """What all that is started has in its environment; in the end there is nothing."""
    found = uuid4().hex
    environ(**{MARK: found})
    yield found
    if Path("/proc/self/environ").exists():
        assert eventually(lambda: not marked(found)), marked(found)


WAYS = {
    "plain": ("done", ""),
    "hold": ("timeout", "more than 1 s"),
    "allocate": ("memory", "MemoryError (run_tasks.py, line"),
    "exit": ("crashed", "exit status 0: no message"),
    "fault": ("crashed", "signal 11 (Segmentation fault): before the fault"),
    "fork": ("crashed", "exit status 4: no message"),
    "raise": ("error", "ZeroDivisionError: integer division or modulo by zero (run_tasks.py, line"),
    "odd": ("error", "OddError: this and that (run_tasks.py, line"),
    "leave": ("error", "SystemExit: left (run_tasks.py, line"),
    "function": ("error", "AttributeError: Can't"),
    "nan": ("done", ""),
}


@pytest.mark.skipif(os.name != "posix", reason="needs limits of memory")
@pytest.mark.usefixtures("mark")
def test_every_failure_is_an_outcome_and_the_others_go_on():
    """In so few processes that each has to be replaced; what an order has started ends with it."""
    found = dict(done(partial(opened, "here"), WAYS, 2, Limits(1.0, 1000, 3)))
    assert {way: outcome.status for way, outcome in found.items()} == {way: status for way, (status, _) in WAYS.items()}
    for way, (status, reason) in WAYS.items():
        assert found[way].reason.startswith(reason)
        assert bool(reason) == (status in FAILURES) == (found[way].value is None)
        assert found[way].about == "here"
    assert found["hold"].seconds >= 1.0
    value = found["plain"].value
    assert (value["text"], value["threads"], value["input"]) == ("µ", "3", "")
    assert value["pid"] != os.getpid()
    assert isinstance(found["raise"].error, ZeroDivisionError)
    assert found["odd"].error is None


def test_none_is_lost_or_done_twice_and_more_may_be_given_meanwhile():
    orders, seen = deque((number, 0.0) for number in range(100)), []
    with Workers(2).ready(pickle.dumps(numbers), Limits()) as (size, outcomes):
        for order, outcome in outcomes(orders):
            seen.append(outcome.value)
            if order[0] < 10:
                orders.append((order[0] + 100, 0.0))
    assert size == 2
    assert sorted(seen) == list(range(110))


@processes
def test_a_process_killed_from_outside_costs_its_order_only(mark):
    with running(numbers, [(0, 0.0), (1, 1000.0), (2, 0.0)]) as found:
        assert next(found)[1].value == 0
        Timer(0.5, lambda: os.kill(*workers(mark), signal.SIGKILL)).start()
        assert next(found)[1].reason == "signal 9 (Killed): no message"
        assert next(found)[1].value == 2


@processes
def test_one_killed_between_orders_costs_nothing_or_its_next_order(mark):
    with running(numbers, [(number, 0.0) for number in range(5)]) as found:
        outcomes = [next(found)[1]]
        os.kill(*workers(mark), signal.SIGKILL)
        outcomes += [outcome for _, outcome in found]
    assert len(outcomes) == 5
    assert [outcome.status for outcome in outcomes].count("done") >= 4


@pytest.mark.usefixtures("mark")
def test_closing_ends_what_is_under_way():
    began = time.monotonic()
    with running(opened, ["plain", "hold", "wait"], 3) as found:
        assert next(found)[0] == "plain"
    assert time.monotonic() - began < 60.0


WRITING = """
import time, click
from qvi_contact.basics import terminal
from qvi_contact.basics import replacing

@click.command()
def write():
    with replacing("a.txt") as temporary:
        temporary.write_text("half")
        print("writing", flush=True)
        for _ in range(6000):  # in steps: a signal just before one long sleep would not end it
            time.sleep(0.01)

terminal.run(write, "tool")
"""


@processes
def test_a_command_ended_by_sigterm_leaves_no_file(tmp_path):
    with started() as start:
        process = start("-c", WRITING, folder=tmp_path)
        assert process.stdout.readline() == "writing\n"
        assert len(list(tmp_path.glob(".*"))) == 1
        process.terminate()
        _, err = process.communicate(timeout=60)
        assert (process.returncode, err) == (143, "tool: terminated\n")
        assert list(tmp_path.iterdir()) == []


ENDLESS = """
import pickle, sys
from collections import deque
from qvi_contact.runs import Limits, Workers
from tests.run_tasks import opened
with Workers(2).ready(pickle.dumps(opened), Limits()) as (_, outcomes):
    list(outcomes(deque(["wait", "hold"])))
"""
"""A script without ``if __name__ == "__main__"``."""


@processes
def test_however_a_run_ends_no_process_is_left():
    """Neither of its workers, be it inside of C code, nor of what they have started."""
    with started() as start:
        process = start("-c", ENDLESS)
        assert eventually(lambda: sum("sleep" in line for line in marked(process.mark).values()) == 2)
        assert len(workers(process.mark)) == 2
        process.kill()
        process.communicate(timeout=60)
        assert eventually(lambda: not marked(process.mark)), marked(process.mark)


def test_a_job_that_cannot_be_loaded_ends_the_run():
    with pytest.raises(NotLoadedError, match="ValueError: no such thing"):
        done(unloadable, ["plain"], 2, Limits(memory=8000))


@pytest.mark.skipif(os.name != "posix", reason="needs limits of memory")
def test_so_does_one_that_needs_more_memory():
    with pytest.raises(NotLoadedError):
        done(opened, ["plain"], 1, Limits(memory=10))


def test_a_process_does_many_orders_or_one(monkeypatch):
    monkeypatch.setattr(sys, "path", [*sys.path, Path("odd")])  # which Python passes over
    pids = [{outcome.value["pid"] for _, outcome in done(opened, ["plain"] * 3, 1, Limits(fresh=fresh))}
            for fresh in (False, True)]  # fmt: skip
    assert [len(each) for each in pids] == [1, 3]


@pytest.mark.skipif(os.name != "posix", reason="hands over a file descriptor")
def test_a_worker_without_work_ends():
    """As on a cluster where the client was lost."""
    ours, theirs = multiprocessing.Pipe()
    script = f"from qvi_contact.runs import worker\nworker.IDLE = 0.1\nworker.main({theirs.fileno()}, None)"
    words = [sys.executable, "-c", script]
    with subprocess.Popen(words, cwd=ROOT, start_new_session=True, pass_fds=[theirs.fileno()]) as process, ours, theirs:
        ours.send((None,))
        ours.send(opened)
        assert ours.recv() == ("loaded", None)
        assert process.wait(timeout=60) == -signal.SIGKILL


def test_an_order_that_comes_when_its_run_is_over_starts_no_process(mark):
    """As where the client of a cluster left while Dask had the order on its way."""
    runs.forget("late")
    outcome = runs.do_there("late", pickle.dumps(numbers), Limits(), (0, 0.0))
    assert (outcome.status, outcome.reason, workers(mark)) == ("crashed", "stopped", [])


def test_numbers_of_workers_that_cannot_be(monkeypatch):
    for count in (0, 1.5, 10_001):
        with refused_at("workers"):
            Workers(count)
    for name in ("os.pipe", "multiprocessing.Pipe", "tempfile.TemporaryFile"):
        with monkeypatch.context() as patch, refused_at("workers", "Too many open files"):
            patch.setattr(name, Mock(side_effect=OSError(24, "Too many open files")))
            done(opened, ["plain"], 2)
    monkeypatch.setattr("os.pipe", Mock(side_effect=OSError(24, "Too many open files")))
    with pytest.raises(NotLoadedError, match="Too many open files"):  # on a worker of a cluster
        runs.do_there("full", b"", Limits(), "plain")
    runs.forget("full")


@pytest.fixture(scope="module")
def cluster():
    """A scheduler and two workers, each a process of its own that is started again when it is lost."""
    distributed = pytest.importorskip("distributed")
    import dask

    quiet = {"distributed.worker.profile.enabled": False}
    with dask.config.set(quiet), pytest.MonkeyPatch.context() as patch:
        patch.setenv(MARK, uuid4().hex)
        with distributed.LocalCluster(2, threads_per_worker=1, dashboard_address=":0", silence_logs=50) as found:
            found.mark = os.environ[MARK]
            yield found


class TestCluster:
    """The same on a Dask cluster."""

    def test_limits_and_outcomes_are_the_same(self, cluster):
        ways = ["plain", "wait", "fault", "raise", "nan"] * 2
        found = done(partial(opened, "there"), ways, dask=cluster.scheduler_address, limits=Limits(1.0, 4000, 2))
        assert sorted((way, outcome.status) for way, outcome in found) == sorted((way, {
            "plain": "done", "nan": "done", "raise": "error", "fault": "crashed", "wait": "timeout",
        }[way]) for way in ways)  # fmt: skip
        values = [outcome.value for way, outcome in found if way == "plain"]
        assert {value["threads"] for value in values} == {"2"}
        assert {outcome.about for _, outcome in found} == {"there"}
        assert eventually(lambda: not workers(cluster.mark))

    @processes
    def test_the_order_of_a_lost_worker_is_done_by_another(self, cluster):
        with running(numbers, [(number, 0.3) for number in range(12)], dask=cluster.scheduler_address) as found:
            seen = [next(found)[1].value]
            os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL)
            seen += [outcome.value for _, outcome in found]
        assert sorted(seen) == list(range(12))

    @processes
    def test_closing_ends_what_is_under_way_there(self, cluster):
        with running(opened, ["plain", "hold", "wait"], dask=cluster.scheduler_address) as found:
            assert next(found)[0] == "plain"
            assert eventually(lambda: any("sleep" in line for line in marked(cluster.mark).values()))
        assert eventually(lambda: not any("sleep" in line for line in marked(cluster.mark).values()))
        assert eventually(lambda: not workers(cluster.mark))

    def test_a_job_that_cannot_be_loaded_there(self, cluster):
        with pytest.raises(NotLoadedError, match="no such thing"):
            done(unloadable, ["plain"], dask=cluster.scheduler_address)

    def test_a_lost_scheduler_is_one_line(self, monkeypatch):
        distributed = pytest.importorskip("distributed")
        monkeypatch.setattr(runs, "PATIENCE", 2.0)
        monkeypatch.setattr(runs, "uuid4", lambda: SimpleNamespace(hex="lost"))
        quiet = {"threads_per_worker": 1, "processes": False, "dashboard_address": ":0", "silence_logs": 50}
        other = distributed.LocalCluster(1, **quiet)
        with running(numbers, [(0, 0.0), (1, 0.5), (2, 0.5)], dask=other.scheduler_address) as found:
            next(found)
            other.close()
            with refused_at("dask", "the scheduler was lost"):
                list(found)
        runs.forget("lost")  # which nobody could tell its worker, that is in this process

    def test_who_takes_the_call_and_says_nothing_is_not_waited_for(self, monkeypatch):
        """Another program's port, or a scheduler that hangs; Dask's client would wait for its first word for ever."""
        pytest.importorskip("distributed")
        monkeypatch.setattr(runs, "PATIENCE", 0.5)
        hung_up = Event()
        with closing(socket.create_server(("127.0.0.1", 0))) as mute:
            patience = Timer(40.0, lambda: (hung_up.set(), mute.close()))
            patience.start()
            with pytest.raises(InputError, match="no scheduler answers there"):
                done(opened, ["plain"], dask=f"tcp://127.0.0.1:{mute.getsockname()[1]}")
            patience.cancel()
        assert not hung_up.is_set()

    def test_addresses_of_every_kind_and_what_is_none_is_refused_before_anything_is_done(self):
        pytest.importorskip("distributed")
        for address in ("nowhere", "127.0.0.1:8786", "ftp://x:1", "tcp://x", "tcp://x:y", ""):
            with refused_at("dask", "is not scheme://host:port", address):
                Workers(dask=address)
        for address in ("tcp://x:1", "tls://[::1]:8786", "wss://x.org:8786", "inproc://10.0.0.1/2/3"):
            assert Workers(dask=address).dask == address

    def test_no_dask(self, without):
        without("distributed")
        with pytest.raises(InputError, match="pip install distributed"):
            Workers(dask="tcp://127.0.0.1:1")
