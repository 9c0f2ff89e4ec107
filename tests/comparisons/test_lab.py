"""Studies: keys, store, runs, exports, and their commands; what comes of processes is in test_runs."""

import gzip
import json
import math
import os
import signal
import sqlite3
from contextlib import closing
from dataclasses import replace
from enum import Enum
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pandas import DataFrame

from comparisons.lab.studies import (
    Study,
    frame_of,
    largest_of,
    plain,
    read_rows,
    run_study,
    write_rows,
    writing,
    written_rows,
)
from qvi_contact import InputError
from qvi_contact.runs import FAILURES, Outcome, database
from tests.cases import refused_at
from tests.comparisons.conftest import row
from tests.comparisons.demo import DEMO, demo, ways
from tests.run_tasks import eventually, marked, started

SMALL = Study("small", 1, "package.module:function", [{"mesh": mesh, "at": [mu]} for mesh in (4, 8) for mu in (0.1, 2)])
ENVIRONMENT = {"machine": None, "versions": {"numpy": "2"}, "threads": 1, "timeout_seconds": 2.0, "memory_mib": None}


SCALARS = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text()
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3)
)


def shuffled(value):
    """The same value with the entries of all its mappings the other way round."""
    if isinstance(value, dict):
        return {name: shuffled(value[name]) for name in reversed(value)}
    return [shuffled(item) for item in value] if isinstance(value, list) else value


def told_apart(value):
    """The value with the kind of each number, so that 1, 1.0 and True, or 0.0 and -0.0, differ."""
    if isinstance(value, dict):
        return {name: told_apart(item) for name, item in value.items()}
    if isinstance(value, list):
        return [told_apart(item) for item in value]
    return type(value).__name__, repr(value)


def filled(path, study=SMALL, numbers=(0, 1)):
    """A store with these rows of a study."""
    with writing(path, study) as append:
        for number in numbers:
            value = {"n": number, "gap": math.inf, "certificate": {"passed": True}}
            append(study.cases[number], Outcome("done", value, "", 0.25, 1.5), ENVIRONMENT)
    return path


class TestCases:
    """Plain values, and what finds a row."""

    @settings(max_examples=15, deadline=None)
    @given(VALUES, VALUES)
    def test_other_values_have_other_keys_and_the_order_of_entries_does_not_matter(self, one, other):
        keys = {SMALL.key({"factor": value}) for value in (one, shuffled(one), other)}
        assert len(keys) == (1 if told_apart(one) == told_apart(other) else 2)
        assert told_apart(json.loads(json.dumps(plain(one, "value")))) == told_apart(one)

    def test_name_and_version_are_in_the_key_which_stays_for_ever(self):
        keys = {replace(SMALL, name=name, version=number).key({}) for name in ("a", "b") for number in (1, 2)}
        assert len(keys) == 4
        assert SMALL.key({"mesh": 4, "friction": 0.1, "repeat": 0, "seed": 5}) == "399f5225b59e6ca6e8f9f4993ec7d936"

    def test_a_case_is_done_once(self):
        assert replace(SMALL, cases=[*SMALL.cases, *SMALL.cases[:2]]).cases == SMALL.cases

    def test_scalars_of_numpy_and_enumerations(self):
        class Colour(str, Enum):  # noqa: UP042 - whose text is not its value
            RED = "red"

        found = plain({"n": np.int64(3), "x": np.float32(0.5), "b": np.bool_(True), "c": Colour.RED, "t": (1, 2)}, "v")
        assert told_apart(found) == told_apart({"n": 3, "x": 0.5, "b": True, "c": "red", "t": [1, 2]})

    @pytest.mark.parametrize("value", [np.zeros(2), {1}, b"", 1j, np.longdouble(1), {"a": [object()]}])
    def test_other_things_are_named(self, value):
        with pytest.raises(TypeError, match=r"^value"):
            plain(value, "value")

    @pytest.mark.parametrize("cases", [[], [{"mesh": math.nan}], [{"mesh": len}], [{"two words": 1}], [{"status": 1}]])
    def test_bad_cases(self, cases):
        with pytest.raises(InputError, match=r"Study\.cases"):
            replace(SMALL, cases=cases)


class TestStore:
    """Rows in and out."""

    def test_rows_come_back_in_the_order_of_the_study(self, tmp_path):
        found = read_rows(SMALL, filled(tmp_path / "new" / "a", numbers=(3, 2, 1, 0)))
        assert [each.case for each in found] == [*SMALL.cases]
        one = found[1]
        assert (one.status, one.reason, one.certificate) == ("done", "", {"passed": True})
        assert (one.result, one.seconds, one.load_average) == ({"n": 1, "gap": math.inf}, 0.25, 1.5)
        assert (one.environment, one.finished[-6:]) == (ENVIRONMENT, "+00:00")

    def test_studies_share_a_store_and_a_larger_one_takes_the_rows_of_a_smaller_one(self, tmp_path):
        path, other = filled(tmp_path / "a"), replace(SMALL, version=2)
        larger = replace(SMALL, cases=[{"mesh": 99}, *SMALL.cases])
        assert read_rows(larger, path) == read_rows(SMALL, path) != ()
        assert read_rows(other, path) == read_rows(replace(SMALL, name="other"), path) == ()
        filled(path, other, range(4))
        assert (len(read_rows(SMALL, path)), len(read_rows(other, path))) == (2, 4)

    def test_no_row_twice(self, tmp_path):
        path = filled(tmp_path / "a", numbers=range(4))
        before = read_rows(SMALL, path)
        with pytest.raises(InputError, match="another process"):
            filled(path, numbers=[0])
        assert read_rows(SMALL, path) == before

    def test_nothing_there_and_what_is_no_store(self, tmp_path):
        assert read_rows(SMALL, tmp_path / "a") == ()
        (tmp_path / "empty").touch()
        for path, word in ((tmp_path, "cannot be opened"), (tmp_path / "empty", "is an empty file")):
            with pytest.raises(InputError, match=word):
                run_study(SMALL, path)

    def test_full(self, tmp_path, monkeypatch):
        path = filled(tmp_path / "a")
        monkeypatch.setattr(database, "SETTINGS", (*database.SETTINGS, "max_page_count = 8"))
        with writing(path, SMALL) as append:
            with pytest.raises(InputError, match="no room left"):
                append(SMALL.cases[2], Outcome("done", {"text": "x" * 20_000}), ENVIRONMENT)
            append(SMALL.cases[3], Outcome("done"), ENVIRONMENT)
        monkeypatch.undo()
        assert [each.case for each in read_rows(SMALL, path)] == [SMALL.cases[place] for place in (0, 1, 3)]


def other_schema(path):
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("PRAGMA user_version = 99")


def other_application(path):
    path.unlink()
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("CREATE TABLE rows (key TEXT)")


def text(path):
    path.write_text("not a database, but long enough to be looked at " * 100, encoding="utf-8")


@pytest.mark.parametrize(
    ("change", "word"),
    [(lambda path: os.truncate(path, path.stat().st_size - 8192), "damaged"), (text, "not the store of a study"),
     (other_application, "not the store of a study"), (other_schema, "version 99, not 3")],
)  # fmt: skip
def test_a_store_that_is_not_sound_is_one_line_and_stays_as_it_was(tmp_path, change, word):
    path = filled(tmp_path / "a")
    change(path)
    before = path.read_bytes()
    for use in (lambda: read_rows(SMALL, path), lambda: run_study(SMALL, path), lambda: filled(path)):
        with pytest.raises(InputError, match=word) as caught:
            use()
        assert len(str(caught.value).splitlines()) == 1
    assert path.read_bytes() == before


class TestExport:
    """Rows for others."""

    def test_frame(self):
        values = {"n": 1, "gap": math.inf, "status": "stalled", "certificate": {"accuracy": 1e-3}}
        rows = [
            row({"mesh": 4}, {"n": 0, "gap": 2.0}),
            row({"mesh": 8}, values),
            row({"mesh": 9}, {}, "timeout", "2 s"),
        ]
        frame = frame_of(rows, ("n", "gap", "other"))
        assert frame.mesh.tolist() == [4, 8, 9]
        assert frame.n.fillna(-1).tolist() == [0, 1, -1]
        assert frame.status.tolist() == ["done", "stalled", "timeout"]  # the task's own
        assert frame.reason.tolist() == ["", "", "2 s"]
        assert frame.has.tolist() == [True, True, False]
        assert frame.accuracy.fillna(0.0).tolist() == [0.0, 1e-3, 0.0]
        assert frame.other.isna().all()
        assert frame_of([], ("n",)).empty

    def test_the_largest_line_of_a_frame(self):
        frame = DataFrame({"name": ["a", "b", "c"], "value": [1.0, 3.0, math.nan]})
        assert largest_of(frame.value, frame) == {"name": "b", "value": 3.0}
        assert largest_of(frame.value[:0], frame) == largest_of(frame.value[2:], frame) == {"name": None, "value": None}

    @given(st.dictionaries(st.text("ab.", min_size=1), st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(), st.lists, max_leaves=3
    ), max_size=4))  # fmt: skip
    @example({"a": "\r", "b": math.inf})
    @settings(max_examples=40, derandomize=True)
    def test_rows_come_back_from_a_file(self, tmp_path_factory, result):
        """Whatever a result is, in a file that pandas reads too."""
        path = tmp_path_factory.mktemp("rows") / "a.jsonl.gz"
        rows = (row({"mesh": 4}, {**result, "certificate": {"passed": True}}), row({"mesh": 8}, {"n": "null"}, "1e3"))
        write_rows(path, rows)
        assert written_rows(path) == rows
        before = path.read_bytes()
        write_rows(path, written_rows(path))
        assert path.read_bytes() == before

    @pytest.mark.parametrize("content", [b"no rows", b"{}\n", b"[1]\n"])
    def test_what_are_no_rows_is_refused(self, tmp_path, content):
        (tmp_path / "a.jsonl.gz").write_bytes(gzip.compress(content))
        for name, reason in (("a.jsonl.gz", r"\(\S"), ("missing.jsonl.gz", r"\(No such file or directory\)")):
            with refused_at("rows", f"cannot be read {reason}"):
                written_rows(tmp_path / name)


def comparable(path):
    """All of the demo's rows but the times, machine and versions included."""
    return [replace(each, seconds=0.0, finished="", load_average=None) for each in read_rows(DEMO, path)]


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    """Rows of the demo from one process that nobody disturbs."""
    path = tmp_path_factory.mktemp("study") / "demo.sqlite"
    statuses = [each.status for each in run_study(DEMO, path)]
    assert {name: statuses.count(name) for name in set(statuses)} == {"done": 6, "crashed": 1, "error": 6}
    return comparable(path)


class TestRuns:
    """A study with successes and failures."""

    def test_rows_are_what_the_task_returned_and_tell_what_they_were_made_with(self, uninterrupted):
        for case, found in zip(DEMO.cases, uninterrupted, strict=True):
            assert found.case == case
            assert found.environment["versions"] == {"click": version("click"), "no-such-package": None}
            assert found.environment["machine"]["cores"] >= 1
            assert os.uname().nodename not in str(found.environment)
            if case["method"] == "plain":
                force = case["mesh"] * case["friction"] + case["seed"]
                assert (found.status, found.result) == ("done", {"force": force, "error": math.inf})
                assert found.certificate == {"passed": True, "gap": 1e-9 * case["mesh"]}
                continue
            assert found.status in FAILURES
            assert (found.result, found.certificate) == ({}, None)
            crashed = case["method"] == "crash"
            said = "exit status 3: no message" if crashed else f"ValueError: no method for {case['mesh']} (run_tasks.py"
            assert found.reason.startswith(said)

    def test_what_is_no_mapping_of_plain_values_is_an_error(self, tmp_path):
        rows = run_study(ways("nan", "number", "plain"), tmp_path / "a", 2, timeout=20.0, memory=4000, threads=3)
        nan, number, fine = rows
        assert repr(nan.result) == "{'value': nan, 'bound': -inf}"
        assert number.reason.startswith("TypeError: the task returned float, not a mapping")
        assert fine.result["threads"] == "3"
        environment = [fine.environment[name] for name in ("timeout_seconds", "memory_mib", "threads")]
        assert environment == [20.0, 4000, 3]

    def test_a_study_may_fix_threads(self, tmp_path):
        (found,) = run_study(replace(ways("plain"), threads=2), tmp_path / "a", threads=3)
        assert found.environment["threads"] == 2

    def test_a_second_run_on_one_store_is_refused(self, tmp_path):
        with writing(tmp_path / "a", SMALL), pytest.raises(InputError, match="another run is at work on it"):
            run_study(SMALL, tmp_path / "a")

    def test_a_task_that_cannot_be_loaded_ends_the_study(self, tmp_path):
        with refused_at("Study.task", r"cannot be loaded within memory = 4000 MiB: .*AttributeError"):
            run_study(replace(SMALL, task="tests.run_tasks:nothing"), tmp_path / "a", memory=4000)

    @pytest.mark.parametrize("name", ["workers", "timeout", "memory", "threads"])
    def test_bad_input(self, tmp_path, name):
        with pytest.raises(InputError, match=f"{name}: 0: give a number above 0"):
            run_study(SMALL, tmp_path / "a", **{name: 0})
        assert list(tmp_path.iterdir()) == []


COMMAND = "from qvi_contact.basics import run\nfrom tests.comparisons.demo import demo\nrun(demo, 'demo')"


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="looks for processes in /proc")
def test_killed_and_interrupted(shell, tmp_path, uninterrupted):
    store = tmp_path / "a"
    words = ("-c", COMMAND, "--store", store, "--out", tmp_path / "out")
    with started() as start:
        process = start(*words, DEMO_SECONDS="0.2")
        assert eventually(lambda: len(read_rows(DEMO, store)) > 0)
        process.kill()
        process.wait()
        assert eventually(lambda: not marked(process.mark)), marked(process.mark)
        count = len(read_rows(DEMO, store))
        assert 0 < count < 13
        process = start(*words, DEMO_SECONDS="0.1")
        assert eventually(lambda: len(read_rows(DEMO, store)) > count)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
        count = len(read_rows(DEMO, store))
        assert not marked(process.mark)
        assert (process.returncode, out) == (130, "")
        assert err == f"interrupted: {count} of 13 rows are in {store}; the same command goes on from there\n"
    run_study(DEMO, store)
    assert comparable(store) == uninterrupted
    status, out, err = shell("--store", store, "--out", tmp_path / "out", command=demo, name="demo")
    assert (status, err, "Written to" in out) == (0, "", True)
    assert [each.case for each in written_rows(tmp_path / "out" / "demo.jsonl.gz")] == [*DEMO.cases]
