"""Studies on a Dask cluster: a real one, of a scheduler and two workers, each a process of its own."""

import multiprocessing
import signal
import socket
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path
from threading import Event, Timer

import pytest
from tests.retiring.study_processes import MARK, ROOT, commands, comparable, eventually, marked, rows_in

from comparisons.lab.study import Study, read_study, run_study
from qvi_contact import InputError
from qvi_contact.basics import cluster
from tests.retiring import study_dask
from tests.retiring.study_demo import DEMO, SMALL, ways

pytestmark = pytest.mark.skipif(find_spec("distributed") is None, reason="Dask's clusters need the extra 'dask'")


@pytest.fixture(scope="module")
def forks():
    """Where processes come from that find Dask loaded, which takes most of the time they need to start."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["distributed"])
    return context


class Cluster:
    """A scheduler and its workers."""

    def __init__(self, forks, folder, workers=2, path=ROOT):
        self.mark, self.path = str(folder), str(path)
        self._forks, self._folder, self.processes = forks, str(folder), []
        told, tells = forks.Pipe(duplex=False)
        with told, tells:
            self._start(study_dask.scheduler, tells)
            assert told.poll(60.0), self.tell()
            self.address = told.recv()
        for _ in range(workers):
            self.add_worker()

    def _start(self, what, *arguments):
        environment = {MARK: self.mark, "DEMO_SECONDS": "0.04", "DEMO_FOLDER": self._folder}
        words = (self._folder, environment, self.path, *arguments)
        process = self._forks.Process(target=what, args=words, daemon=True)
        process.start()
        self.processes.append(process)

    def add_worker(self):
        self._start(study_dask.worker, self.address)

    def lost(self):
        """How many of its processes were killed."""
        return sum(process.exitcode == -signal.SIGKILL for process in self.processes)

    def tell(self):
        return (Path(self._folder) / "log").read_text(encoding="utf-8", errors="replace")

    def close(self):
        for process in self.processes:
            process.kill()
            process.join()
        assert eventually(lambda: not marked(self.mark)), marked(self.mark)


@pytest.fixture(scope="module")
def running(forks, tmp_path_factory):
    """One cluster for all tests; the last ones that use it take its workers away, and in the end its scheduler."""
    found = Cluster(forks, tmp_path_factory.mktemp("cluster"))
    yield found
    found.close()


@pytest.fixture(scope="module")
def local(tmp_path_factory):
    """Rows of the demo from this machine."""
    path = tmp_path_factory.mktemp("local") / "a"
    run_study(DEMO, path)
    return comparable(path)


@pytest.fixture
def started(forks, tmp_path):
    """Start a cluster for one test."""
    clusters = []

    def start(**options):
        clusters.append(Cluster(forks, tmp_path, **options))
        return clusters[-1]

    yield start
    for each in clusters:
        each.close()


@pytest.fixture
def command(tmp_path):
    """Start the demo as a process."""
    with commands(tmp_path / "a") as start:
        yield start


@pytest.fixture
def hurried(monkeypatch):
    monkeypatch.setattr(cluster, "_CONNECTING", 0.5)


def children(mark):
    """Numbers of the cluster's worker processes that do cases."""
    return [pid for pid, line in marked(mark).items() if "worker.child" in line]


class TestRows:
    """What comes back from a cluster."""

    def test_both_workers_work(self, running, tmp_path):
        study = Study("meeting", 1, "tests.retiring.study_tasks:meeting", {"processes": (2,)}, repeats=2, packages=())
        run_study(study, tmp_path / "dask", dask=running.address, timeout=60.0)
        rows = read_study(tmp_path / "dask").rows
        assert len({row.result["pid"] for row in rows}) == len(rows) == 2

    def test_limits_hold_there(self, running, tmp_path):
        study = ways("plain", "wait", "allocate", "fault", "nan", repeats=2)
        run_study(study, tmp_path / "dask", dask=running.address, timeout=0.5, memory=1000)
        rows = read_study(tmp_path / "dask").rows
        statuses = ("done", "timeout", "memory", "crashed", "done")
        assert [row.status for row in rows] == [status for status in statuses for _ in range(2)]
        assert rows[0].environment["timeout_seconds"] == 0.5
        assert children(running.mark) == []


class TestEnds:
    """Runs that end before the study does."""

    def test_nothing_is_lost_or_repeated(self, running, local, command, tmp_path):
        """And what comes from a cluster is the same as from one process here."""
        process = command("--dask", running.address)
        assert eventually(lambda: rows_in(tmp_path / "a") >= 3)
        process.kill()
        process.communicate(timeout=60)
        assert 3 <= rows_in(tmp_path / "a") < 26
        assert run_study(DEMO, tmp_path / "a", dask=running.address).complete
        assert comparable(tmp_path / "a") == local

    def test_an_interrupt_ends_long_cases_and_keeps_what_is_finished(self, running, command, tmp_path):
        before = children(running.mark)  # a run that was killed leaves some for a while
        process = command("--dask", running.address, "--way", "plain", "--way", "nan", "--way", "hold")
        assert eventually(lambda: rows_in(tmp_path / "a") == 2)
        assert eventually(lambda: any("sleep" in line for line in marked(running.mark).values()))
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
        assert (process.returncode, out) == (130, "")
        assert len(err.splitlines()) == 1
        assert set(children(running.mark)) <= set(before)
        assert eventually(lambda: not any("sleep" in line for line in marked(running.mark).values()))
        study = ways("plain", "nan", "hold")
        assert run_study(study, tmp_path / "a", dask=running.address, timeout=0.1).statuses == {"timeout": 1}

    def test_task_that_cannot_be_loaded(self, running, tmp_path):
        with pytest.raises(InputError, match="cannot be loaded: ModuleNotFoundError"):
            run_study(SMALL, tmp_path / "a", dask=running.address)


class TestLosses:
    """Workers and schedulers that die."""

    def test_lost_worker(self, running, tmp_path):
        """Tried again on another one, once; a run waits while there is none, and takes those that come later."""
        study = Study("losses", 1, "tests.retiring.study_tasks:losing", {"times": (1, 2)}, packages=())
        with ThreadPoolExecutor() as threads:
            run = threads.submit(run_study, study, tmp_path / "a", dask=running.address, progress=False)
            assert eventually(lambda: running.lost() == 2)
            assert not run.done()
            for _ in range(2):  # one of them is lost to the case that is then given up
                running.add_worker()
            assert run.result(timeout=60).statuses == {"done": 1, "crashed": 1}
        assert running.lost() == 3
        first, second = read_study(tmp_path / "a").rows
        assert (first.status, first.result) == ("done", {"tried": 2})
        assert (second.status, second.reason) == ("crashed", "the worker of the cluster was lost, 2 times")
        assert second.environment["threads"] == 1

    def test_lost_scheduler(self, running, command, tmp_path):
        process = command("--dask", running.address, "--way", "plain", "--way", "hold")
        assert eventually(lambda: rows_in(tmp_path / "a") == 1)
        running.processes[0].kill()
        out, err = process.communicate(timeout=60)
        assert (process.returncode, out) == (2, "")
        assert "the scheduler was lost" in err
        assert len(err.splitlines()) == 1
        assert rows_in(tmp_path / "a") == 1

    @pytest.mark.parametrize("scheduler_too", [False, True])
    def test_no_workers_and_workers_without_this_package(self, started, tmp_path, monkeypatch, scheduler_too):
        missing = "raise ModuleNotFoundError(f'No module named {__name__!r}', name=__name__)"  # whatever is installed
        (tmp_path / "comparisons.py").write_text(missing, encoding="utf-8")
        bare = started(workers=0, path=tmp_path if scheduler_too else ROOT)
        with monkeypatch.context() as patch:
            patch.setattr(cluster, "_JOINING", 0.1)
            with pytest.raises(InputError, match="has no workers"):
                run_study(SMALL, tmp_path / "a", dask=bare.address)
        bare.path = str(tmp_path)
        bare.add_worker()
        with pytest.raises(InputError, match="install this package and the task's on its scheduler and workers"):
            run_study(SMALL, tmp_path / "a", dask=bare.address)

    @pytest.mark.usefixtures("hurried")
    def test_no_scheduler(self, tmp_path):
        with pytest.raises(InputError, match="no scheduler answers there"):
            run_study(SMALL, tmp_path / "a", dask="tcp://127.0.0.1:1")
        other = ways("plain")  # for which the store that is left has room
        assert run_study(other, tmp_path / "a").complete

    @pytest.mark.usefixtures("hurried")
    def test_who_takes_the_call_and_says_nothing_is_not_waited_for(self, tmp_path):
        """Another program's port, or a scheduler that hangs; Dask's client would wait for its first word for ever."""
        hung_up = Event()
        with closing(socket.create_server(("127.0.0.1", 0))) as mute:
            patience = Timer(20.0, lambda: (hung_up.set(), mute.close()))
            patience.start()
            with pytest.raises(InputError, match="no scheduler answers there"):
                run_study(SMALL, tmp_path / "a", dask=f"tcp://127.0.0.1:{mute.getsockname()[1]}")
            patience.cancel()
        assert not hung_up.is_set()

    @pytest.mark.parametrize("address", ["nowhere", "127.0.0.1:8786", "ftp://x:1", "tcp://x", "tcp://x:y", ""])
    def test_what_is_no_address_is_refused_before_anything_is_done(self, tmp_path, monkeypatch, address):
        monkeypatch.setattr(cluster, "_client", lambda _: pytest.fail("connected"))
        with pytest.raises(InputError, match="is not scheme://host:port") as caught:
            run_study(SMALL, tmp_path / "a", dask=address)
        assert (caught.value.field, caught.value.value) == ("dask", address)
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize("address", ["tcp://x:1", "tls://[::1]:8786", "wss://x.org:8786", "inproc://10.0.0.1/2/3"])
    def test_addresses_of_every_kind(self, address):
        cluster.check(address)

    def test_a_half_built_client_goes_quietly(self, monkeypatch, capfd):
        """Python would tell on standard error what is raised when an object is removed."""
        client = cluster._quiet_client()
        half = client.__new__(client)
        monkeypatch.setattr(client.__mro__[1], "__del__", lambda _: 1 // 0)
        del half
        assert capfd.readouterr().err == ""

    def test_no_dask(self, tmp_path, monkeypatch):
        monkeypatch.setitem(sys.modules, "distributed", None)
        with pytest.raises(InputError, match="pip install distributed"):
            run_study(SMALL, tmp_path / "a", dask="tcp://127.0.0.1:1")
