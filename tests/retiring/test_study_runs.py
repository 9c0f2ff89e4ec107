"""Runs of studies: every failure is a row, nothing is lost or repeated however a run ends, nothing stays behind."""

import os
import random
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from uuid import uuid4

import pytest
from comparisons.lab.study.children import Child, Crew, Terms
from comparisons.lab.worker import limits
from comparisons.lab.worker.outcome import REFUSED
from tests.retiring.study_processes import MARK, ROOT, alive, commands, comparable, eventually, marked, rows_in

from comparisons.lab.progress import progress, rate
from comparisons.lab.study import FAILURES, options, read_study, run_study
from comparisons.lab.study import store as stores
from qvi_contact import InputError
from qvi_contact.basics import database, terminal
from tests.retiring.study_demo import DEMO, SMALL, main, ways


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    """Rows of the demo from one process that nobody disturbs."""
    path = tmp_path_factory.mktemp("study") / "demo.sqlite"
    run = run_study(DEMO, path)
    assert run.complete
    assert run.statuses == {"done": 12, "crashed": 2, "error": 12}
    return comparable(path)


@pytest.fixture
def command(tmp_path):
    """Start the demo as a process."""
    with commands(tmp_path / "a") as start:
        yield start


class TestDemo:
    """A study with successes and failures."""

    def test_rows_are_what_the_task_returned(self, uninterrupted):
        for case, row in zip(DEMO.cases, uninterrupted, strict=True):
            assert (row.position, row.key, row.case) == (case.position, case.key, case.values)
            values = row.case
            if values["method"] == "plain":
                assert row.status == "done"
                assert row.result == {
                    "force": values["mesh"] * values["friction"] + values["seed"],
                    "error": float("inf"),
                }
                assert row.certificate == {"passed": True, "gap": 1e-9 * values["mesh"]}
            elif values["method"] == "crash":
                assert (row.status, row.reason) == ("crashed", "exit status 3: no message")
            else:
                assert row.status == "error"
                assert row.reason.startswith(f"ValueError: no method for {values['mesh']} (study_tasks.py, line ")

    def test_rows_tell_what_they_were_made_with(self, uninterrupted):
        for row in uninterrupted:
            assert row.environment["versions"] == {"click": version("click"), "no-such-package": None}
            assert row.environment["machine"]["cores"] >= 1
            assert row.environment["threads"] == 1
            assert os.uname().nodename not in str(row.environment)

    def test_complete_study_is_not_run_again(self, tmp_path):
        path = tmp_path / "a"
        study = ways("plain", "raise")
        assert run_study(study, path).statuses == {"done": 1, "error": 1}
        before = path.read_bytes()
        run = run_study(study, path)
        assert (run.before, run.statuses.total(), run.complete) == (2, 0, True)
        assert path.read_bytes() == before


@pytest.fixture(scope="module")
def failures(tmp_path_factory):
    """Way → row, with limits, in so few processes that each has to be replaced; and what was left alive."""
    path = tmp_path_factory.mktemp("study") / "a"
    mark = uuid4().hex
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(MARK, mark)
        run = run_study(ways(), path, workers=2, timeout=1.0, memory=1000, threads=3)
    alive = [line for line in marked(mark).values() if "worker.child" in line or "sleep" in line]
    assert run.complete
    return {row.case["way"]: row for row in read_study(path).rows}, alive


class TestFailures:
    """Whatever comes of a case."""

    @pytest.mark.parametrize(
        ("way", "status", "reason"),
        [
            ("hold", "timeout", "more than 1 s"),
            ("wait", "timeout", "more than 1 s"),
            ("allocate", "memory", "MemoryError (study_tasks.py, line"),
            ("exit", "crashed", "exit status 0: no message"),
            ("fault", "crashed", "signal 11 (Segmentation fault): before the fault"),
            ("raise", "error", "ZeroDivisionError: integer division or modulo by zero (study_tasks.py, line"),
            ("leave", "error", "SystemExit: left (study_tasks.py, line"),
            ("function", "error", "TypeError: result.found[0].f is of type function, not a plain value"),
            ("number", "error", "TypeError: the task returned float, not a mapping"),
            ("cyclic", "error", "RecursionError: "),
        ],
    )
    def test_is_a_row(self, failures, way, status, reason):
        row = failures[0][way]
        assert row.status == status
        assert row.reason.startswith(reason)
        assert (row.result, row.certificate) == ({}, None)
        assert status in FAILURES

    def test_time_until_it_was_ended(self, failures):
        assert failures[0]["wait"].seconds == pytest.approx(1.0, abs=0.5)
        assert failures[0]["wait"].seconds >= 1.0

    def test_infinite_numbers_and_nan_are_results(self, failures):
        row = failures[0]["nan"]
        assert (row.status, repr(row.result)) == ("done", "{'value': nan, 'bound': -inf}")

    def test_a_task_that_prints_and_reads(self, failures):
        result = failures[0]["plain"].result
        assert (result["text"], result["threads"], result["input"]) == ("µ", "3", "")
        assert result["pid"] != os.getpid()

    def test_rows_tell_the_limits(self, failures):
        for row in failures[0].values():
            environment = row.environment
            found = [environment[name] for name in ("timeout_seconds", "memory_mib", "threads")]
            assert found == [1.0, 1000, 3]

    def test_nothing_stays_behind(self, failures):
        assert failures[1] == []

    @pytest.mark.parametrize(
        ("task", "word"),
        [
            ("tests.no_such_module:f", "ModuleNotFoundError: No module named 'tests.no_such_module'"),
            ("tests.retiring.study_tasks:nothing", "AttributeError"),
            ("tests.retiring.study_tasks:WAYS", "TypeError: WAYS is of type dict"),
        ],
    )
    def test_a_task_that_cannot_be_loaded_ends_the_study(self, tmp_path, task, word):
        study = replace(SMALL, task=task)
        with pytest.raises(InputError, match="cannot be loaded: .*" + word):
            run_study(study, tmp_path / "a", workers=2)
        assert read_study(tmp_path / "a").rows == ()

    @pytest.mark.parametrize("memory", [1, 10])
    def test_too_little_memory_for_the_task_ends_the_study(self, tmp_path, memory):
        with pytest.raises(
            InputError, match=r"is too little .MiB. to load tests.retiring.study_tasks:failing"
        ) as caught:
            run_study(ways("plain"), tmp_path / "a", memory=memory)
        assert (caught.value.field, caught.value.value) == ("memory", memory)
        assert len(str(caught.value).splitlines()) == 1

    def test_memory_is_not_blamed_for_a_task_that_cannot_be_loaded_anyway(self, tmp_path):
        with pytest.raises(InputError, match="ModuleNotFoundError") as caught:
            run_study(replace(SMALL, task="tests.no_such_module:f"), tmp_path / "a", memory=4000)
        assert caught.value.field == "Study.task"

    def test_a_store_that_cannot_be_made_is_named(self, tmp_path):
        (tmp_path / "a").touch()
        with pytest.raises(InputError, match="is a file, not a folder") as caught:
            run_study(SMALL, tmp_path / "a" / "b.sqlite")
        assert (caught.value.field, caught.value.value) == ("store", str(tmp_path / "a"))

    @pytest.mark.parametrize("name", ["workers", "timeout", "memory", "threads"])
    def test_bad_input(self, tmp_path, name):
        with pytest.raises(InputError, match=f"{name}: 0: give a number above 0"):
            run_study(SMALL, tmp_path / "a", **{name: 0})
        assert list(tmp_path.iterdir()) == []

    def test_full_disk_keeps_what_is_finished(self, tmp_path, uninterrupted, monkeypatch):
        """And in which order cases come does not matter."""
        monkeypatch.setattr(database, "SETTINGS", (*database.SETTINGS, "max_page_count = 7"))
        with pytest.raises(InputError, match="no room left"):
            run_study(DEMO, tmp_path / "a", workers=2)
        monkeypatch.undo()
        assert 5 < rows_in(tmp_path / "a") < 26
        run_study(DEMO, tmp_path / "a", workers=2)
        assert comparable(tmp_path / "a") == uninterrupted


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="looks for processes in /proc")
class TestEnds:
    """However a run ends."""

    def test_killed_ten_times(self, command, tmp_path, uninterrupted):
        moments = random.Random(0)
        counts = []
        for attempt in range(10):
            process = command("--workers", "2", seconds=0.2)
            if attempt % 2:  # any moment of the start is hit by the others
                assert eventually(lambda: rows_in(tmp_path / "a") > max(counts, default=0))
            time.sleep(moments.uniform(0.0, 0.4 if attempt % 2 == 0 else 0.2))
            assert process.poll() is None
            process.kill()
            process.wait()
            assert eventually(lambda mark=process.mark: not marked(mark)), marked(process.mark)
            counts.append(rows_in(tmp_path / "a"))
        assert counts == sorted(counts)
        assert 0 < counts[-1] < 26
        assert len(set(counts)) > 3
        last = command("--workers", "2")
        assert last.communicate(timeout=60) == ("26 of 26\n", "")
        assert comparable(tmp_path / "a") == uninterrupted

    @pytest.mark.parametrize("way", ["hold", "wait"])
    def test_workers_and_what_they_started_die_with_the_runner(self, command, way):
        process = command("--way", way)
        assert eventually(lambda: any("sleep" in line for line in marked(process.mark).values()))
        assert len(marked(process.mark)) == 3
        process.kill()
        process.wait()
        assert eventually(lambda: not marked(process.mark)), marked(process.mark)

    def test_a_row_that_is_in_when_the_interrupt_comes_is_counted(self, tmp_path, monkeypatch):
        append = stores.Store.append

        def interrupted(store, *row):
            append(store, *row)
            raise KeyboardInterrupt

        monkeypatch.setattr(stores.Store, "append", interrupted)
        run = run_study(DEMO, tmp_path / "a", progress=False)
        assert (run.interrupted, run.finished, rows_in(tmp_path / "a")) == (True, 1, 1)

    def test_from_the_keyboard(self, command, tmp_path, uninterrupted):
        process = command("--workers", "2", seconds=0.1)
        assert eventually(lambda: rows_in(tmp_path / "a") >= 3)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
        count = rows_in(tmp_path / "a")
        assert (process.returncode, out) == (130, "")
        assert err == f"interrupted: {count} of 26 rows are in {tmp_path / 'a'}; the same command goes on from there\n"
        assert not marked(process.mark)
        assert 3 <= count < 26
        assert run_study(DEMO, tmp_path / "a", workers=2).complete
        assert comparable(tmp_path / "a") == uninterrupted

    def test_second_run_on_one_store_is_refused(self, command, tmp_path):
        first = command("--way", "plain", "--way", "wait")
        assert eventually(lambda: rows_in(tmp_path / "a") == 1)
        second = command("--way", "plain", "--way", "wait")
        out, err = second.communicate(timeout=60)
        assert (second.returncode, out) == (2, "")
        assert len(err.splitlines()) == 1
        assert "another run is at work on it" in err
        assert first.poll() is None
        first.kill()
        first.wait()
        assert run_study(ways("plain", "wait"), tmp_path / "a", timeout=0.1).statuses == {"timeout": 1}

    def test_a_worker_killed_from_outside_is_replaced(self, command, tmp_path):
        process = command("--way", "wait", "--way", "plain")
        assert eventually(lambda: any("sleep" in line for line in marked(process.mark).values()))
        (child,) = (pid for pid, line in marked(process.mark).items() if "worker.child" in line)
        os.kill(child, signal.SIGKILL)
        assert process.communicate(timeout=60) == ("2 of 2\n", "")
        first, second = read_study(tmp_path / "a").rows
        assert (first.status, first.reason) == ("crashed", "signal 9 (Killed): no message")
        assert second.status == "done"


class TestLimits:
    """What a worker does by itself; here without the kernel's help, as on systems other than Linux."""

    @pytest.mark.skipif(os.name != "posix", reason="needs process groups")
    def test_a_thread_looks_for_the_parent(self):
        inner = (
            "import os, sys, time\nfrom comparisons.lab.worker import limits\n"
            "limits.KERNEL = False\nlimits._LOOK = 0.02\n"
            "with limits.ends_with_parent(sys.stdin.buffer):\n    print(os.getpid(), flush=True)\n    time.sleep(1000)"
        )
        outer = (
            "import subprocess, sys\n"
            f"p = subprocess.Popen([sys.executable, '-c', {inner!r}], stdin=subprocess.PIPE, start_new_session=True)\n"
            "p.wait()"
        )
        with subprocess.Popen([sys.executable, "-c", outer], cwd=ROOT, stdout=subprocess.PIPE, text=True) as parent:
            pid = int(parent.stdout.readline())
            os.kill(pid, 0)
            parent.kill()
        assert eventually(lambda: not alive(pid))

    def test_a_worker_is_used_again_but_not_after_a_long_rest(self):
        """It ends by itself after twice that time, and a case must not arrive at that moment."""
        with closing(Child(Terms("tests.retiring.study_tasks:failing", ()))) as child:
            first, again = (child.run({"way": "plain"}).result["pid"] for _ in range(2))
            child._used -= limits.IDLE / 2.0
            other = child.run({"way": "plain"}).result["pid"]
        assert first == again != other

    def test_every_case_has_a_process_of_its_own_where_the_study_says_so(self, tmp_path):
        for fresh in (False, True):
            study = replace(ways("plain"), repeats=2, fresh=fresh)
            assert run_study(study, tmp_path / str(fresh)).statuses == {"done": 2}
            pids = {row.result["pid"] for row in read_study(tmp_path / str(fresh)).rows}
            assert len(pids) == (2 if fresh else 1)

    @pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="looks for processes in /proc")
    def test_a_crew_can_be_ended_while_it_works(self, monkeypatch):
        """Each thread has its own process; afterwards there is none, and nobody gets a new one."""
        mark = uuid4().hex
        monkeypatch.setenv(MARK, mark)
        crew = Crew(Terms("tests.retiring.study_tasks:failing", ()))
        with ThreadPoolExecutor(1) as threads:
            busy = threads.submit(crew.run, {"way": "hold"})
            pids = {crew.run({"way": "plain"}).result["pid"] for _ in range(2)}
            assert eventually(lambda: any("sleep" in line for line in marked(mark).values()))
            assert len(pids) == 1
            assert len(marked(mark)) == 3
            crew.close()
            assert busy.result(timeout=60).status == "crashed"
            assert threads.submit(crew.run, {"way": "plain"}).result().status == REFUSED
        assert eventually(lambda: not marked(mark)), marked(mark)

    @pytest.mark.skipif(not hasattr(os, "waitid"), reason="waits for a process and leaves its exit status")
    def test_a_worker_that_dies_before_it_is_asked_does_not_take_the_runner_with_it(self):
        """Even where SIGPIPE is not ignored, as gmsh leaves it: the test that is hit would end the suite."""
        code = (
            "import os, signal\nfrom comparisons.lab.study.children import Child, Terms\n"
            "signal.signal(signal.SIGPIPE, signal.SIG_DFL)\n"
            "child = Child(Terms('tests.retiring.study_tasks:failing', ()))\n"
            "assert child.run({'way': 'plain'}).status == 'done'\n"
            "os.kill(child._process.pid, signal.SIGKILL)\n"
            "os.waitid(os.P_PID, child._process.pid, os.WEXITED | os.WNOWAIT)\n"
            "print(child._ask({'way': 'plain'}, None), child.run({'way': 'plain'}).status)\n"
            "child.close()\n"
            "print(signal.SIGPIPE in signal.sigpending(), signal.pthread_sigmask(signal.SIG_BLOCK, ()))"
        )
        done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout == "(None, False) done\nFalse set()\n"

    def test_nobody_is_ended_while_a_look_may_free_its_number(self):
        with closing(Child(Terms("tests.retiring.study_tasks:failing", ()))) as child:
            child.run({"way": "plain"})
            looks, poll = [], child._process.poll
            child._process.poll = lambda: looks.append(child._lock.locked()) or poll()
            child.run({"way": "plain"})
            assert looks == [True]
            del child._process.poll

    @pytest.mark.skipif(os.name != "posix", reason="needs process groups")
    def test_a_worker_without_work_ends(self):
        code = "import sys\nfrom comparisons.lab.worker import child, limits\nlimits.IDLE = 0.1\nchild.main()"
        order = b'{"task": "tests.retiring.study_tasks:failing", "packages": [], "memory": null}\n'
        with subprocess.Popen(
            [sys.executable, "-c", code],
            cwd=ROOT,
            start_new_session=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        ) as process:
            process.stdin.write(order)
            process.stdin.flush()
            assert b"environment" in process.stdout.readline()
            assert process.wait(timeout=60) == -signal.SIGKILL


class TestCommand:
    """A command made of the options."""

    def test_options(self, tmp_path, monkeypatch):
        taken = []
        monkeypatch.setattr(options, "run_study", lambda *a, **k: taken.append((a, k)) or pytest.fail("stop"))
        arguments = ["--workers=3", "--dask=tcp://x:1", "--timeout=1.5", "--memory=900", "--threads=2"]
        with pytest.raises(pytest.fail.Exception):
            main.main([*arguments, "--store", str(tmp_path / "a")], standalone_mode=False)
        assert taken == [((DEMO, tmp_path / "a", 3, "tcp://x:1", 1.5, 900), {"threads": 2})]

    @pytest.mark.parametrize(
        "arguments",
        [
            ("--workers", "0"),
            ("--store", "/proc/a/b"),
            ("--timeout", "-1"),
            ("--timeout", "nan"),
            ("--timeout", "inf"),
            ("--memory", "0"),
            ("--memory", "9" * 30),
            ("--threads", "9" * 30),
            ("--workers", "10001"),
        ],
    )
    def test_bad_input_is_one_line(self, capfd, monkeypatch, tmp_path, arguments):
        monkeypatch.setattr(sys, "argv", ["study_demo", "--store", str(tmp_path / "a"), *arguments])
        with pytest.raises(SystemExit) as caught:
            terminal.run(main, "study_demo")
        out, err = capfd.readouterr()
        assert (caught.value.code, out, len(err.splitlines())) == (2, "", 1)
        assert list(tmp_path.iterdir()) == []


class TestProgress:
    """What is shown meanwhile."""

    @pytest.mark.parametrize(
        ("speed", "text"), [(None, ""), (0.0, ""), (12.34, "12.3/s"), (0.5, "30/min"), (0.01, "36/h")]
    )
    def test_rate(self, speed, text):
        assert rate(speed) == text

    def test_silent_when_piped(self, capfd):
        with progress("title", 3, 1) as advance:
            advance("something")
        assert capfd.readouterr() == ("", "")

    def test_shown_on_a_terminal(self):
        shown = on_a_terminal(True)
        for word in ("title: μ = 0.15", "3/3", "/s", "left"):
            assert word in shown
        assert on_a_terminal(False) == ""


def on_a_terminal(shown):
    """What a terminal gets on standard error of a run."""
    pty = pytest.importorskip("pty")
    pause = 0.15 if shown else 0.0
    script = (
        "from comparisons.lab.progress import progress\nimport time\n"
        f"with progress('title', 3, 1, shown={shown}) as advance:\n"
        f"    for _ in range(2):\n        time.sleep({pause})\n        advance('μ = 0.15')\n    time.sleep({pause})"
    )
    ours, theirs = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "120"}
    subprocess.run([sys.executable, "-c", script], cwd=ROOT, stderr=theirs, check=True, env=environment)
    os.close(theirs)
    found = b""
    try:
        while part := os.read(ours, 65536):
            found += part
    except OSError:  # Linux says so at the end
        pass
    os.close(ours)
    return found.decode()
