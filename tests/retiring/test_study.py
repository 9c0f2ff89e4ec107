"""The study's declaration, its keys, its store and its exports; runs are in the files beside this one."""

import csv
import json
import math
import os
import signal
import sqlite3
import subprocess
import sys
import tempfile
from contextlib import closing, contextmanager
from dataclasses import replace
from enum import Enum
from pathlib import Path

import numpy as np
import pytest
from comparisons.lab.study.differences import differences
from comparisons.lab.worker.plain import canonical, plain
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from pandas import DataFrame

from comparisons.lab.study import Outcome, Study, frame_of, largest_of, read_csv, read_study, run_study, write_csv
from comparisons.lab.study import store as stores
from comparisons.lab.study.declaration import case_key
from comparisons.lab.study.rows import finite_json
from qvi_contact import InputError
from qvi_contact.basics import database
from tests.retiring.study_demo import ENVIRONMENT, SMALL

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
    with stores.writing(path, study) as store:
        for case in study.cases[:count]:
            outcome = Outcome(
                "done", "", {"n": case.position, "gap": math.inf}, {"passed": True}, 0.25, 1.5, ENVIRONMENT
            )
            store.append(case, outcome)
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
        assert told_apart(json.loads(canonical(plain(value, "value")))) == told_apart(value)

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
        with stores.writing(tmp_path / "a", SMALL) as store:
            for case in reversed(SMALL.cases):
                environment = {**ENVIRONMENT, "threads": 1 + case.position % 2}
                store.append(case, Outcome("error", "because", environment=environment))
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
import os
from pathlib import Path
from comparisons.lab.study import store
from tests.retiring.study_demo import SMALL
with store.writing(Path({str(path)!r}), SMALL) as opened:
    opened._connection.execute("PRAGMA cache_size = 10")
    opened._connection.execute("UPDATE rows SET result = ?", ("x" * 10_000_000,))
    os.kill(os.getpid(), {int(signal.SIGKILL)})
"""
        done = subprocess.run([sys.executable, "-c", script], check=False, cwd=Path(__file__).parents[2])
        assert done.returncode == -signal.SIGKILL
        assert (tmp_path / "a-journal").stat().st_size > 0
        assert path.stat().st_size > 1_000_000
        assert read_study(path) == before
        with stores.writing(path, SMALL) as store:
            assert store.keys() == {case.key for case in SMALL.cases[:2]}

    def test_killed_without_leaving_a_journal(self, tmp_path):
        script = f"""
import os
from pathlib import Path
from comparisons.lab.study import store
from tests.retiring.study_demo import SMALL
with store.writing(Path({str(tmp_path / "a")!r}), SMALL):
    os.kill(os.getpid(), {int(signal.SIGKILL)})
"""
        subprocess.run([sys.executable, "-c", script], check=False, cwd=Path(__file__).parents[2])
        assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "a.lock"]


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """A row that comes from a store."""
    return read_study(filled(tmp_path_factory.mktemp("study") / "a", count=1)).rows[0]


class TestExport:
    """Rows for others."""

    def test_frame(self, tmp_path):
        path = filled(tmp_path / "a", count=2)
        with stores.writing(path, SMALL) as store:
            store.append(SMALL.cases[2], Outcome("timeout", "more than 2 s", environment=ENVIRONMENT))
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
        with stores.writing(path, SMALL) as store:
            store.append(SMALL.cases[1], Outcome("done", "", {"status": "stalled"}, {"accuracy": 1e-3}))
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
        monkeypatch.setattr("comparisons.lab.study.runner._outcomes", lambda *_: pytest.fail("work was begun"))
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
        assert stores.finished_keys(path, moved) == {case.key for case in SMALL.cases[:3]}
        with stores.writing(path, moved) as store:
            assert len(store.keys()) == 3
            store.append(moved.cases[3], Outcome("done", environment=ENVIRONMENT))
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

    def test_a_new_store_has_its_name_when_its_tables_are_there(self, tmp_path, monkeypatch):
        """A run that is killed before leaves no empty file that would stand in the way of the next."""

        def killed(*_):
            assert not (tmp_path / "a").exists()
            raise KeyboardInterrupt

        monkeypatch.setattr(stores, "_declare", killed)
        with pytest.raises(KeyboardInterrupt):
            filled(tmp_path / "a")
        assert not (tmp_path / "a").exists()
        monkeypatch.undo()
        assert len(read_study(filled(tmp_path / "a")).rows) == 2

    @pytest.mark.parametrize("change", [{"seed": 6}, {"name": "other"}, {"version": 2}])
    def test_without_rows_it_is_the_next_study_s(self, tmp_path, change):
        """What a run leaves that came to nothing."""
        path, other = filled(tmp_path / "a", count=0), replace(SMALL, **change)
        assert read_study(path).declaration == SMALL.declaration()
        assert stores.finished_keys(path, other) == set()
        assert read_study(filled(path, other, count=1)).declaration == other.declaration()
        with pytest.raises(InputError, match="belongs to the study"):
            filled(path)

    def test_full(self, tmp_path, monkeypatch):
        path = filled(tmp_path / "a", count=2)
        monkeypatch.setattr(database, "SETTINGS", (*database.SETTINGS, "max_page_count = 8"))
        large = Outcome("done", "", {"text": "x" * 20_000}, environment=ENVIRONMENT)
        with stores.writing(path, SMALL) as store:
            with pytest.raises(InputError, match="no room left"):
                store.append(SMALL.cases[2], large)
            store.append(SMALL.cases[3], Outcome("done", environment=ENVIRONMENT))
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
        monkeypatch.setattr("comparisons.lab.study.runner._outcomes", lambda *_: pytest.fail("work was begun"))
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
