"""Studies: declaration, keys, store, runs, exports, and the command; what comes of processes is in test_runs."""

import csv
import json
import math
import os
import random
import re
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from contextlib import closing, contextmanager
from dataclasses import replace
from enum import Enum
from importlib.metadata import version
from pathlib import Path

import click
import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from pandas import DataFrame

from comparisons.lab.progress import progress
from comparisons.lab.run_options import study_options
from comparisons.lab.study import (
    DONE,
    FAILURES,
    Outcome,
    Study,
    case_key,
    differences,
    finished_keys,
    finite_json,
    frame_of,
    largest_of,
    plain,
    read_csv,
    read_study,
    run_study,
    write_csv,
    writing,
)
from qvi_contact import InputError
from qvi_contact.basics import run
from qvi_contact.runs import database
from tests.run_processes import ROOT, eventually, marked, started

DEMO = Study(
    "demo",
    1,
    "tests.run_tasks:measured",
    {"mesh": (8, 16), "friction": (0.1, 0.2, 0.5), "method": ("plain", "crash", "raise")},
    repeats=2,
    seed=7,
    keep=lambda case: case["method"] != "crash" or (case["mesh"], case["friction"]) == (8, 0.2),
    packages=("click", "no-such-package"),
)
SMALL = Study("small", 1, "package.module:function", {"mesh": (4, 8), "friction": (0.1,)}, repeats=2, seed=5)
ENVIRONMENT = {"machine": None, "versions": {"numpy": "2"}, "threads": 1, "timeout_seconds": 2.0, "memory_mib": None}


def ways(*names, **more):
    """The study of some ways to fail."""
    return Study("ways", 1, "tests.run_tasks:failing", {"way": names}, packages=(), **more)


@click.command()
@study_options("demo.sqlite")
@click.option("--way", "names", multiple=True, help="Ways to fail, instead of the demo.")
def main(options, names):
    """The demo study."""
    study = ways(*names) if names else DEMO
    done = options.run(study)
    click.echo(f"{done.finished} of {len(study.cases)}")


SCALARS = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text()
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3)
)
CASES = st.dictionaries(st.text(), VALUES, max_size=5)
few = settings(max_examples=40, suppress_health_check=[HealthCheck.too_slow])  # which a busy machine is


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


def filled(path, study=SMALL, count=2):
    """A store with the first rows of a study."""
    with writing(path, study) as store:
        for case in study.cases[:count]:
            value = {"n": case.position, "gap": math.inf, "certificate": {"passed": True}}
            store.append(case, Outcome("done", value, "", 0.25, 1.5), ENVIRONMENT)
    return path


@contextmanager
def connected(path):
    with closing(sqlite3.connect(path)) as connection, connection:
        yield connection


class TestKeys:
    """A case's key."""

    @few
    @given(CASES)
    def test_order_of_entries_does_not_matter(self, case):
        assert case_key("study", 1, case) == case_key("study", 1, shuffled(case))

    @few
    @given(CASES, CASES)
    def test_other_cases_have_other_keys(self, one, other):
        same = told_apart(one) == told_apart(other)
        assert (case_key("study", 1, one) == case_key("study", 1, other)) is same

    @few
    @given(VALUES, VALUES)
    def test_other_values_have_other_keys(self, one, other):
        keys = {case_key("study", 1, {"factor": value}) for value in (one, other)}
        assert len(keys) == (1 if told_apart(one) == told_apart(other) else 2)

    @few
    @given(VALUES)
    def test_a_plain_value_comes_back_from_its_json(self, value):
        assert told_apart(json.loads(json.dumps(plain(value, "value")))) == told_apart(value)

    def test_name_and_version_are_in_the_key(self):
        keys = {case_key(name, version, {}) for name in ("a", "b") for version in (1, 2)}
        assert len(keys) == 4

    def test_keys_stay_for_ever(self):
        assert SMALL.cases[0].key == "399f5225b59e6ca6e8f9f4993ec7d936"


class TestDeclaration:
    """What a study is."""

    def test_last_factor_runs_fastest_and_repeats_inside(self):
        study = replace(SMALL, factors={"mesh": (4, 8), "friction": (0.1, 0.2)})
        found = [tuple(case.values.values()) for case in study.cases]
        assert found == [(n, mu, r, 5 + r) for n in (4, 8) for mu in (0.1, 0.2) for r in (0, 1)]
        assert [case.position for case in study.cases] == list(range(8))

    def test_what_is_left_out_changes_the_declaration_but_no_key(self):
        fewer = replace(SMALL, keep=lambda case: case["mesh"] == 8)
        assert [case.key for case in fewer.cases] == [case.key for case in SMALL.cases[2:]]
        assert fewer.declaration() != SMALL.declaration()
        assert fewer.declaration()["cases"] == 2

    def test_a_study_of_listed_cases_is_the_product_without_the_others(self):
        cases = [{"mesh": mesh, "at": at} for mesh, at in ((8, (0.5, 1)), (4, (0.5, 1)), (4, (0, 1.0)), (8, (0.5, 1)))]
        study = Study.of("listed", 1, "module:task", cases)
        left_out = {"mesh": 8, "at": [0, 1.0]}
        product = Study("listed", 1, "module:task", {"mesh": (8, 4), "at": ((0.5, 1), (0, 1.0))},
                        keep=lambda case: {name: case[name] for name in left_out} != left_out)  # fmt: skip
        assert study.declaration() == product.declaration()
        assert [case.values for case in study.cases] == [case.values for case in product.cases]

    @pytest.mark.parametrize(
        ("change", "word"),
        [
            ({"name": ""}, "name"),
            ({"only": [(16,)]}, "level of every factor"),
            ({"only": [(8, 4)]}, "level of every factor"),
            ({"task": "module.function"}, "module:function"),
            ({"repeats": 0}, "at least 1"),
            ({"factors": {"seed": (1,)}}, "row's own"),
            ({"factors": {"two words": (1,)}}, "word"),
            ({"factors": {"mesh": [1]}}, "tuple"),
            ({"factors": {"mesh": ()}}, "tuple"),
            ({"factors": {"mesh": (1, 2, 1)}}, "once"),
            ({"factors": {"mesh": (math.nan,)}}, "plain"),
            ({"factors": {"mesh": ({1: 2},)}}, "not a text"),
            ({"factors": {"mesh": (len,)}}, "builtin_function"),
            ({"keep": lambda _: False}, "no case"),
        ],
    )
    def test_bad_input(self, change, word):
        with pytest.raises(InputError, match=word):
            replace(SMALL, **change)


class TestPlain:
    """What is plain, and what is not."""

    def test_scalars_of_numpy_and_enumerations(self):
        class Colour(str, Enum):  # noqa: UP042 - whose text is not its value
            RED = "red"

        found = plain({"n": np.int64(3), "x": np.float32(0.5), "b": np.bool_(True), "c": Colour.RED, "t": (1, 2)}, "v")
        assert told_apart(found) == told_apart({"n": 3, "x": 0.5, "b": True, "c": "red", "t": [1, 2]})

    @pytest.mark.parametrize("value", [np.zeros(2), {1}, b"", 1j, np.longdouble(1), "\ud800", {"a": [object()]}])
    def test_other_things_are_named(self, value):
        with pytest.raises(TypeError, match=r"^value"):
            plain(value, "value")


class TestStore:
    """Rows in and out."""

    def test_rows_come_back(self, tmp_path):
        found = read_study(filled(tmp_path / "new" / "a.sqlite", count=3))
        assert found.declaration == SMALL.declaration()
        assert [row.key for row in found.rows] == [case.key for case in SMALL.cases[:3]]
        row = found.rows[1]
        assert row.case == {"mesh": 4, "friction": 0.1, "repeat": 1, "seed": 6}
        assert list(row.case) == ["mesh", "friction", "repeat", "seed"]
        assert (row.status, row.reason, row.result, row.certificate) == (
            "done",
            "",
            {"n": 1, "gap": math.inf},
            {"passed": True},
        )
        assert (row.seconds, row.load_average, row.environment) == (0.25, 1.5, ENVIRONMENT)
        assert row.finished.endswith("+00:00")

    def test_rows_are_in_the_order_of_the_study(self, tmp_path):
        with writing(tmp_path / "a", SMALL) as store:
            for case in reversed(SMALL.cases):
                environment = {**ENVIRONMENT, "threads": 1 + case.position % 2}
                store.append(case, Outcome("error", None, "because"), environment)
        assert [row.key for row in read_study(tmp_path / "a").rows] == [case.key for case in SMALL.cases]

    def test_no_row_twice(self, tmp_path):
        path = filled(tmp_path / "a")
        before = read_study(path)
        with pytest.raises(InputError, match="another process"):
            filled(path, count=1)
        assert read_study(path) == before

    def test_a_machine_is_written_once(self, tmp_path):
        with connected(filled(tmp_path / "a", count=4)) as connection:
            assert connection.execute("SELECT count(*) FROM environments").fetchone() == (1,)

    def test_killed_inside_a_transaction(self, tmp_path):
        """So late that a part of the row is in the file already and SQLite has to take it out again."""
        path = filled(tmp_path / "a", count=2)
        before = read_study(path)
        script = f"""
import os, sqlite3
opened = sqlite3.connect({str(path)!r}, isolation_level="IMMEDIATE")
opened.execute("PRAGMA cache_size = 10")
opened.execute("UPDATE rows SET result = ?", ("x" * 10_000_000,))
os.kill(os.getpid(), {int(signal.SIGKILL)})
"""
        with started() as start:
            assert start("-c", script).wait() == -signal.SIGKILL
        assert (tmp_path / "a-journal").stat().st_size > 0
        assert path.stat().st_size > 1_000_000
        assert read_study(path) == before
        with writing(path, SMALL) as store:
            assert store.keys() == {case.key for case in SMALL.cases[:2]}


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """A row that comes from a store."""
    return read_study(filled(tmp_path_factory.mktemp("study") / "a", count=1)).rows[0]


class TestExport:
    """Rows for others."""

    def test_frame(self, tmp_path):
        path = filled(tmp_path / "a", count=2)
        with writing(path, SMALL) as store:
            store.append(SMALL.cases[2], Outcome("timeout", None, "more than 2 s"), ENVIRONMENT)
        rows = read_study(path).rows
        frame = frame_of(rows[::-1], ("n", "gap", "other"))
        assert frame.mesh.tolist() == [4, 4, 8]
        assert frame.n.fillna(-1).tolist() == [0, 1, -1]
        assert frame.gap.tolist()[:2] == [math.inf, math.inf]
        assert frame.status.tolist() == ["done", "done", "timeout"]
        assert frame.reason.tolist() == ["", "", "more than 2 s"]
        assert frame.has.tolist() == [True, True, False]
        assert frame.spent.tolist() == [0.25, 0.25, 0.0]
        assert frame[["accuracy", "other"]].isna().all(axis=None)

    def test_the_status_is_the_tasks_own(self, tmp_path):
        path = filled(tmp_path / "a", count=1)
        with writing(path, SMALL) as store:
            value = {"status": "stalled", "certificate": {"accuracy": 1e-3}}
            store.append(SMALL.cases[1], Outcome("done", value), ENVIRONMENT)
        frame = frame_of(read_study(path).rows)
        assert frame.status.tolist() == ["done", "stalled"]
        assert frame.accuracy.fillna(0.0).tolist() == [0.0, 1e-3]

    def test_the_largest_line_of_a_frame(self):
        frame = DataFrame({"name": ["a", "b", "c"], "value": [1.0, 3.0, math.nan]})
        assert largest_of(frame.value, frame) == {"name": "b", "value": 3.0}
        assert largest_of(frame.value[:0], frame) == largest_of(frame.value[2:], frame) == {"name": None, "value": None}

    def test_csv(self, tmp_path):
        rows = read_study(filled(tmp_path / "a")).rows
        write_csv(tmp_path / "a.csv", rows)
        with open(tmp_path / "a.csv", encoding="utf-8", newline="") as file:
            found = list(csv.DictReader(file))
        assert [row["result.n"] for row in found] == ["0", "1"]
        assert found[0]["result.gap"] == "Infinity"
        assert json.loads(found[0]["versions"]) == {"numpy": "2"}
        assert found[0]["machine"] == "null"

    @given(st.dictionaries(st.text("ab.", min_size=1), st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(), st.lists, max_leaves=3
    ), max_size=4), st.sampled_from(["a.csv", "a.csv.gz"]))  # fmt: skip
    @example({"a": "\r"}, "a.csv")
    @settings(max_examples=40, derandomize=True)
    def test_rows_come_back_from_csv(self, tmp_path_factory, stored, result, name):
        """Whatever a result is, also a text that reads like a number or like nothing."""
        path = tmp_path_factory.mktemp("rows")
        rows = (
            replace(stored, result=result),
            replace(stored, position=1, certificate=None, reason="1e3", result={"n": "null"}),
        )
        write_csv(path / name, rows)
        assert read_csv(path / name) == rows
        before = (path / name).read_bytes()
        write_csv(path / name, read_csv(path / name))
        assert (path / name).read_bytes() == before

    def test_numbers_that_json_has_not(self):
        found = finite_json({"a": [math.inf, 1.0], "b": {"c": (math.nan, -math.inf)}})
        assert found == {"a": ["inf", 1.0], "b": {"c": ["nan", "-inf"]}}
        assert finite_json({"a": [math.inf, 1.0]}, null=True) == {"a": [None, 1.0]}


def overwritten(path):
    """Rubbish in the middle of the file."""
    content = bytearray(path.read_bytes())
    content[4096:12288] = b"\xa5" * 8192
    path.write_bytes(content)


def cut(path):
    os.truncate(path, path.stat().st_size - 8192)


def not_json(path):
    with connected(path) as connection:
        connection.execute("UPDATE study SET declaration = '{'")


def other_schema(path):
    with connected(path) as connection:
        connection.execute("PRAGMA user_version = 99")


def other_application(path):
    path.unlink()
    with connected(path) as connection:
        connection.execute("CREATE TABLE rows (key TEXT)")


def text(path):
    path.write_text("not a database, but long enough to be looked at " * 100, encoding="utf-8")


class TestRefused:
    """What cannot be used is one line, and stays as it was."""

    @pytest.mark.parametrize(
        ("change", "word"),
        [
            (overwritten, "damaged"),
            (cut, "damaged"),
            (not_json, "damaged"),
            (text, "not the store of a study"),
            (other_application, "not the store of a study"),
            (other_schema, "version 99, not 1"),
        ],
    )
    def test_not_a_sound_store(self, tmp_path, change, word):
        path = filled(tmp_path / "a")
        change(path)
        before = path.read_bytes()
        for use in (lambda: read_study(path), lambda: run_study(SMALL, path), lambda: filled(path)):
            with pytest.raises(InputError, match=word) as caught:
                use()
            assert len(str(caught.value).splitlines()) == 1
        assert path.read_bytes() == before

    def test_any_page_that_is_damaged(self, tmp_path, monkeypatch):
        """Also one that is not read to find out which rows are there."""
        monkeypatch.setattr("subprocess.Popen", lambda *_, **__: pytest.fail("work was begun"))
        content = filled(tmp_path / "a").read_bytes()
        assert len(content) > 5 * 4096
        for start in range(4096, len(content), 4096):
            path = tmp_path / str(start)
            path.write_bytes(content[:start] + b"\xa5" * 4096 + content[start + 4096 :])
            with pytest.raises(InputError, match="damaged"):
                run_study(SMALL, path)

    @pytest.mark.parametrize(
        ("change", "word"),
        [
            ({"name": "other"}, "belongs to the study small .version 1.: give"),
            ({"version": 2}, "small .version 1."),
            ({"seed": 6}, r"with other settings .seed: 5 only there, 6 only here.: give another file"),
            ({"repeats": 3}, ".repeats of each: 2 only there, 3 only here."),
            ({"keep": lambda case: case["mesh"] == 4}, ".other combinations: 4 there, 2 here."),
            ({"factors": {"mesh": (4,), "friction": (0.1, 0.2, 0.3)}},
             ".mesh: 8 only there; friction: 0.2, 0.3 only here."),
            ({"factors": {"mesh": (4, 16), "friction": (0.1,)}}, ".mesh: 8 only there, 16 only here."),
            ({"factors": {"mesh": (8, 4), "friction": (0.1,)}}, ".mesh: the same values in another order."),
            ({"factors": {"friction": (0.1,), "mesh": (4, 8)}}, ".the factors in another order."),
            ({"factors": {"mesh": (4, 8), "method": ("a",)}}, '.friction: 0.1 only there; method: "a" only here.'),
        ],
    )  # fmt: skip
    def test_another_study(self, tmp_path, change, word):
        path = filled(tmp_path / "a")
        before = path.read_bytes()
        with pytest.raises(InputError, match=word):
            run_study(replace(SMALL, **change), path)
        assert path.read_bytes() == before

    def test_a_task_that_has_moved_resumes_the_store(self, tmp_path):
        """Rooms are renamed; what a task computes is told by the study's version."""
        path, moved = filled(tmp_path / "a", count=3), replace(SMALL, task="elsewhere.named:differently")
        assert finished_keys(path, moved) == {case.key for case in SMALL.cases[:3]}
        with writing(path, moved) as store:
            assert len(store.keys()) == 3
            store.append(moved.cases[3], Outcome("done"), ENVIRONMENT)
        assert [row.key for row in read_study(path).rows] == [case.key for case in SMALL.cases]

    def test_long_lists_of_values_are_shortened(self):
        there, here = (replace(SMALL, factors={"mesh": tuple(range(n, n + 5))}).declaration() for n in (0, 10))
        assert differences(there, here) == "mesh: 0, 1, 2 and 2 more only there, 10, 11, 12 and 2 more only here"
        there["factors"][0][1] = ["x" * 99] * 5
        assert len(differences(there, here)) < 250

    def test_nothing_there(self, tmp_path):
        with pytest.raises(InputError, match="cannot be opened"):
            read_study(tmp_path / "a")
        assert list(tmp_path.iterdir()) == []

    def test_a_folder(self, tmp_path):
        with pytest.raises(InputError, match="cannot be opened"):
            run_study(SMALL, tmp_path)

    def test_empty_file(self, tmp_path):
        """It is somebody else's, whoever made it; and stays empty."""
        (tmp_path / "a").touch()
        for use in (read_study, filled):
            with pytest.raises(InputError, match="is an empty file") as caught:
                use(tmp_path / "a")
            assert caught.value.field == "store"
        assert (tmp_path / "a").stat().st_size == 0

    @pytest.mark.parametrize("change", [{"seed": 6}, {"name": "other"}, {"version": 2}])
    def test_without_rows_it_is_the_next_study_s(self, tmp_path, change):
        """What a run leaves that came to nothing."""
        path, other = filled(tmp_path / "a", count=0), replace(SMALL, **change)
        assert read_study(path).declaration == SMALL.declaration()
        assert finished_keys(path, other) == set()
        assert read_study(filled(path, other, count=1)).declaration == other.declaration()
        with pytest.raises(InputError, match="belongs to the study"):
            filled(path)

    def test_full(self, tmp_path, monkeypatch):
        path = filled(tmp_path / "a", count=2)
        monkeypatch.setattr(database, "SETTINGS", (*database.SETTINGS, "max_page_count = 8"))
        large = Outcome("done", {"text": "x" * 20_000})
        with writing(path, SMALL) as store:
            with pytest.raises(InputError, match="no room left"):
                store.append(SMALL.cases[2], large, ENVIRONMENT)
            store.append(SMALL.cases[3], Outcome("done"), ENVIRONMENT)
        monkeypatch.undo()
        assert [row.position for row in read_study(path).rows] == [0, 1, 3]

    def test_no_room_for_the_tables(self, tmp_path, monkeypatch):
        monkeypatch.setattr(database, "SETTINGS", (*database.SETTINGS, "max_page_count = 2"))
        with pytest.raises(InputError, match="no room left"):
            filled(tmp_path / "a")
        monkeypatch.undo()
        assert len(read_study(filled(tmp_path / "a")).rows) == 2


@pytest.fixture
def folder():
    """A folder that everybody may go through, unlike pytest's own."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        yield Path(name)


@contextmanager
def read_only(*paths):
    """Take the right to write away; root, who has it anyway, is somebody else meanwhile."""
    root = os.geteuid() == 0
    modes = {path: path.stat().st_mode for path in paths}
    for path, mode in modes.items():
        path.chmod(mode & 0o555)
    if root:
        os.seteuid(65534)
    try:
        yield
    finally:
        if root:
            os.seteuid(0)
        for path, mode in modes.items():
            path.chmod(mode)


class TestReadOnly:
    """Without the right to write."""

    @pytest.mark.parametrize("folder_too", [False, True])
    def test_refused_before_any_work(self, folder, monkeypatch, folder_too):
        path = filled(folder / "a")
        before = path.read_bytes()
        folder.chmod(0o777)
        (folder / "a.lock").chmod(0o666)
        monkeypatch.setattr("subprocess.Popen", lambda *_, **__: pytest.fail("work was begun"))
        paths = [folder, path] if folder_too else [path]
        with read_only(*paths), pytest.raises(InputError, match="cannot be written"):
            run_study(SMALL, path)
        assert path.read_bytes() == before

    def test_can_be_read(self, folder):
        path = filled(folder / "a")
        with read_only(folder, path):
            assert len(read_study(path).rows) == 2

    def test_complete_study_needs_no_rights(self, folder):
        path = filled(folder / "a", count=4)
        with read_only(folder, path):
            run = run_study(SMALL, path)
        assert (run.complete, run.before, run.statuses.total()) == (True, 4, 0)


def comparable(path):
    """All of a store's rows but the times, machine and versions included."""
    return [replace(row, seconds=0.0, finished="", load_average=None) for row in read_study(path).rows]


def rows_in(path):
    """How many rows a store has, which may not be there yet."""
    try:
        return len(read_study(path).rows)
    except InputError:
        return 0


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    """Rows of the demo from one process that nobody disturbs."""
    path = tmp_path_factory.mktemp("study") / "demo.sqlite"
    done = run_study(DEMO, path)
    assert done.complete
    assert done.statuses == {"done": 12, "crashed": 2, "error": 12}
    return comparable(path)


class TestRuns:
    """A study with successes and failures."""

    def test_rows_are_what_the_task_returned(self, uninterrupted):
        for case, row in zip(DEMO.cases, uninterrupted, strict=True):
            assert (row.position, row.key, row.case) == (case.position, case.key, case.values)
            values = row.case
            if values["method"] == "plain":
                force = values["mesh"] * values["friction"] + values["seed"]
                assert (row.status, row.reason) == (DONE, "")
                assert row.result == {"force": force, "error": math.inf}
                assert row.certificate == {"passed": True, "gap": 1e-9 * values["mesh"]}
                continue
            assert row.status in FAILURES
            assert (row.result, row.certificate) == ({}, None)
            if values["method"] == "crash":
                assert (row.status, row.reason) == ("crashed", "exit status 3: no message")
            else:
                assert row.reason.startswith(f"ValueError: no method for {values['mesh']} (run_tasks.py, line ")

    def test_rows_tell_what_they_were_made_with(self, uninterrupted):
        for row in uninterrupted:
            assert row.environment["versions"] == {"click": version("click"), "no-such-package": None}
            assert row.environment["machine"]["cores"] >= 1
            assert row.environment["threads"] == 1
            assert os.uname().nodename not in str(row.environment)

    def test_what_is_no_mapping_of_plain_values_is_an_error(self, tmp_path):
        done = run_study(ways("nan", "number", "plain"), tmp_path / "a", 2, timeout=20.0, memory=4000, threads=3)
        nan, number, plain = read_study(tmp_path / "a").rows
        assert done.statuses == {"done": 2, "error": 1}
        assert repr(nan.result) == "{'value': nan, 'bound': -inf}"
        assert number.reason.startswith("TypeError: the task returned float, not a mapping")
        assert plain.result["threads"] == "3"
        environment = [plain.environment[name] for name in ("timeout_seconds", "memory_mib", "threads")]
        assert environment == [20.0, 4000, 3]

    def test_complete_study_is_not_run_again(self, tmp_path, monkeypatch):
        path, study = filled(tmp_path / "a", count=4), SMALL
        before = path.read_bytes()
        monkeypatch.setattr("subprocess.Popen", lambda *_, **__: pytest.fail("work was begun"))
        done = run_study(study, path)
        assert (done.before, done.statuses.total(), done.complete) == (4, 0, True)
        assert path.read_bytes() == before

    @pytest.mark.parametrize(
        ("task", "word"),
        [
            ("tests.no_such_module:f", "ModuleNotFoundError: No module named 'tests.no_such_module'"),
            ("tests.run_tasks:nothing", "AttributeError"),
            ("tests.run_tasks:WAYS", "TypeError: WAYS is of type dict"),
        ],
    )
    def test_a_task_that_cannot_be_loaded_ends_the_study(self, tmp_path, task, word):
        with pytest.raises(InputError, match="cannot be loaded: .*" + word) as caught:
            run_study(replace(SMALL, task=task), tmp_path / "a", workers=2, memory=4000)
        assert caught.value.field == "Study.task"
        assert read_study(tmp_path / "a").rows == ()

    def test_too_little_memory_for_the_task_ends_the_study(self, tmp_path):
        with pytest.raises(InputError, match=r"is too little .MiB. to load tests.run_tasks:failing") as caught:
            run_study(ways("plain"), tmp_path / "a", memory=10)
        assert (caught.value.field, caught.value.value) == ("memory", 10)
        assert len(str(caught.value).splitlines()) == 1

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


COMMAND = "from tests.comparisons.test_study import main, run\nrun(main, 'demo')"


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="looks for processes in /proc")
class TestEnds:
    """However a run ends."""

    def test_killed_again_and_again(self, tmp_path, uninterrupted):
        moments, counts = random.Random(0), []
        with started() as start:
            for attempt in range(6):
                process = start("-c", COMMAND, "--store", tmp_path / "a", "--workers", "2", DEMO_SECONDS="0.2")
                if attempt % 2:  # any moment of the start is hit by the others
                    assert eventually(lambda: rows_in(tmp_path / "a") > max(counts, default=0))
                time.sleep(moments.uniform(0.0, 0.4))
                assert process.poll() is None
                process.kill()
                process.wait()
                assert eventually(lambda mark=process.mark: not marked(mark)), marked(process.mark)
                counts.append(rows_in(tmp_path / "a"))
            assert counts == sorted(counts)
            assert 0 < counts[-1] < 26
            last = start("-c", COMMAND, "--store", tmp_path / "a", "--workers", "2")
            assert last.communicate(timeout=60) == ("26 of 26\n", "")
        assert comparable(tmp_path / "a") == uninterrupted

    def test_from_the_keyboard(self, tmp_path, uninterrupted):
        with started() as start:
            process = start("-c", COMMAND, "--store", tmp_path / "a", "--workers", "2", DEMO_SECONDS="0.1")
            assert eventually(lambda: rows_in(tmp_path / "a") >= 3)
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=60)
            count = rows_in(tmp_path / "a")
            assert not marked(process.mark)
        assert (process.returncode, out) == (130, "")
        store = tmp_path / "a"
        assert err == f"interrupted: {count} of 26 rows are in {store}; the same command goes on from there\n"
        assert 3 <= count < 26
        assert run_study(DEMO, store, workers=2).complete
        assert comparable(store) == uninterrupted

    def test_second_run_on_one_store_is_refused(self, tmp_path):
        words = ("-c", COMMAND, "--store", tmp_path / "a", "--way", "plain", "--way", "wait")
        with started() as start:
            first = start(*words)
            assert eventually(lambda: rows_in(tmp_path / "a") == 1)
            second = start(*words)
            out, err = second.communicate(timeout=60)
            assert (second.returncode, out, len(err.splitlines())) == (2, "", 1)
            assert "another run is at work on it" in err
            assert first.poll() is None
        assert run_study(ways("plain", "wait"), tmp_path / "a", timeout=0.1).statuses == {"timeout": 1}

    @pytest.mark.parametrize(
        "words",
        [
            ("--workers", "0"), ("--store", "/proc/a/b"), ("--timeout", "-1"), ("--timeout", "nan"),
            ("--timeout", "inf"), ("--memory", "0"), ("--memory", "9" * 30), ("--threads", "9" * 30),
            ("--workers", "10001"), ("--dask", "nowhere"),
        ],
    )  # fmt: skip
    def test_bad_options_are_one_line(self, capfd, monkeypatch, tmp_path, words):
        monkeypatch.setattr(sys, "argv", ["demo", "--store", str(tmp_path / "a"), *words])
        with pytest.raises(SystemExit) as caught:
            run(main, "demo")
        out, err = capfd.readouterr()
        assert (caught.value.code, out, len(err.splitlines())) == (2, "", 1)
        assert list(tmp_path.iterdir()) == []


class TestProgress:
    """What is shown meanwhile."""

    def test_silent_when_piped(self, capfd):
        with progress("title", 3, 1) as advance:
            advance("something")
        assert capfd.readouterr() == ("", "")

    def test_shown_on_a_terminal(self):
        shown = on_a_terminal(True)
        for word in ("title: μ = 0.15", "3/3", "left"):
            assert word in shown
        assert re.search(r"\d/(s|min|h)\b", shown)
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
