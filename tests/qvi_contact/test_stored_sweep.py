"""Sweeps with a store: what is in the file, going on after a stop, several processes."""

import json
import os
import sqlite3
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from qvi_contact import Contact, InputError, read_sweep, solve_sweep
from qvi_contact.basics import Units
from qvi_contact.gallery import compressed_plate
from solvers import Status
from tests.qvi_contact.test_sweep import command, pushed
from tests.run_tasks import deadly

PLATE = compressed_plate(0.2, (4, 4))
VALUES = (0.1, 0.2, 0.3, 0.4)
ROOT = Path(__file__).parents[2]


def stopped(number):
    """A callback that stops at a value."""

    def callback(here, _row):
        if here == number:
            raise KeyboardInterrupt

    return callback


def test_rows_are_those_of_the_results(tmp_path):
    stored = solve_sweep(PLATE, "friction", VALUES, store=tmp_path / "a.sqlite")
    results = solve_sweep(PLATE, "friction", VALUES)
    assert (stored.status, stored.message, stored.values) == (results.status, results.message, VALUES)
    assert stored.to_frame(Units("mm", "MPa")).equals(results.to_frame(Units("mm", "MPa")))
    assert [row.accuracy for row in stored.rows()] == [step.certificate.accuracy for step in results.steps]
    first, *_ = stored.rows()
    assert first.contacts["plate"] == pytest.approx(results.steps[0].contacts["plate"].summary(), nan_ok=True)


def test_the_file_alone_tells_everything(tmp_path):
    path = tmp_path / "a.sqlite"
    stored = solve_sweep(pushed(), "friction", [0.5, 0.05], store=path)
    with closing(sqlite3.connect(path)) as connection:
        rows = connection.execute("SELECT number, value, status, contact, normal_force FROM rows").fetchall()
    assert [row[:4] for row in rows] == [(1, 0.5, "solved", "base"), (2, 0.05, "infeasible", None)]
    assert rows[0][4] == pytest.approx(2.0)
    assert read_sweep(path) == stored
    assert (stored.status, stored.statuses) == (Status.INFEASIBLE, (Status.SOLVED, Status.INFEASIBLE))
    assert "friction = 0.05" in stored.message


def test_a_sweep_that_was_stopped_goes_on(tmp_path):
    path, told = tmp_path / "a.sqlite", []
    with pytest.raises(KeyboardInterrupt):
        solve_sweep(PLATE, "friction", VALUES, store=path, callback=stopped(2))
    assert [row.number for row in read_sweep(path).rows()] == [1, 2]
    assert read_sweep(path).status is Status.TIME_LIMIT
    stored = solve_sweep(
        PLATE, "friction", VALUES, store=path, callback=lambda number, row: told.append((number, row.value))
    )
    assert told == [(3, 0.3), (4, 0.4)]
    forces = stored.to_frame().normal_force.to_numpy()
    assert forces == pytest.approx(solve_sweep(PLATE, "friction", VALUES).to_frame().normal_force.to_numpy(), rel=1e-10)


def test_a_value_that_the_time_cut_short_has_no_row(tmp_path):
    path = tmp_path / "a.sqlite"
    slow = {"callback": lambda *_: time.sleep(0.3), "time_limit": 0.3}
    assert solve_sweep(PLATE, "friction", VALUES, store=path, **slow).statuses == (Status.SOLVED,)
    assert solve_sweep(PLATE, "friction", VALUES, store=path, time_limit=1e-3).statuses == (Status.SOLVED,)
    assert solve_sweep(PLATE, "friction", VALUES, store=path).status is Status.SOLVED


def test_several_processes_find_the_same(tmp_path):
    values, told = np.linspace(0.05, 1.0, 4), []
    one = solve_sweep(PLATE, "friction", values, store=tmp_path / "a")
    two = solve_sweep(
        PLATE, "friction", values, store=tmp_path / "b", callback=lambda *seen: told.append(seen[0]), workers=2
    )
    assert sorted(told) == [1, 2, 3, 4]
    assert two.statuses == one.statuses
    names = ["friction", "normal_force", "tangential_force", "share_slip"]
    assert two.to_frame()[names].to_numpy() == pytest.approx(one.to_frame()[names].to_numpy(), rel=1e-7)


def test_functions_that_other_processes_cannot_have(tmp_path):
    conditions = [replace(c, gap=lambda x, y: 0.0 * (x + y)) if isinstance(c, Contact) else c for c in PLATE.conditions]
    problem = replace(PLATE, conditions=conditions)
    assert solve_sweep(problem, "friction", [0.1], store=tmp_path / "a").status is Status.SOLVED
    with pytest.raises(InputError) as caught:
        solve_sweep(problem, "friction", [0.1, 0.2], store=tmp_path / "b", workers=2)
    assert caught.value.field == "problem"


def test_a_value_that_ends_its_process_has_a_row_that_says_so(tmp_path, environ):
    environ(RUN_TEST_RUNNER=os.getpid())
    conditions = [replace(c, gap=deadly) if isinstance(c, Contact) else c for c in PLATE.conditions]
    problem = replace(PLATE, conditions=conditions)
    stored = solve_sweep(problem, "friction", [0.1], store=tmp_path / "a", workers=2)
    assert stored.statuses == (Status.BACKEND_FAILED,)
    assert "exit status 9" in stored.message


def test_several_processes_need_a_store():
    for shared in ({"workers": 2}, {"dask": "tcp://127.0.0.1:1"}):
        with pytest.raises(InputError) as caught:
            solve_sweep(PLATE, "friction", [0.1], **shared)
        assert caught.value.field in shared


def test_what_is_refused(tmp_path):
    """Another sweep than that of the store, and arguments that are wrong; the store stays as it was."""
    path = tmp_path / "a.sqlite"
    given = {"problem": PLATE, "parameter": "friction", "values": (0.1,), "store": path}
    solve_sweep(**given)
    before = path.read_bytes()
    for field, changes in {
        "store": [{"values": (0.1, 0.2)}, {"parameter": "gap"}, {"tolerance": 1e-7}, {"store": "."},
                  {"problem": compressed_plate(0.2, (4, 5))}],
        "workers": [{"workers": 0}], "dask": [{"dask": "nowhere"}], "parameter": [{"parameter": "mu"}],
        "of": [{"of": ["base"]}],
    }.items():  # fmt: skip
        for change in changes:
            with pytest.raises(InputError) as caught:
                solve_sweep(**{**given, **change})
            assert caught.value.field == field
    assert path.read_bytes() == before


def test_a_store_without_rows_is_nobodys(tmp_path):
    path = tmp_path / "a"
    with pytest.raises(InputError, match="nonsense"):
        solve_sweep(PLATE, "friction", [0.1], store=path, nonsense=1)
    assert solve_sweep(PLATE, "gap", [0.0], store=path).status is Status.SOLVED


def test_files_of_others_are_refused(tmp_path):
    path = tmp_path / "a"
    path.write_text("not a database, but long enough to be one" * 30, encoding="utf-8")
    for read in (read_sweep, lambda place: solve_sweep(PLATE, "friction", [0.1], store=place)):
        with pytest.raises(InputError, match="not the store of a sweep"):
            read(path)
    with pytest.raises(InputError, match="store"):
        read_sweep(tmp_path / "missing")


FILE = ROOT / "examples" / "compressed_plate.toml"
SWEPT = ("solve", FILE, "--set", "friction=0.1:0.3:3")


def test_on_the_command_line(tmp_path):
    path, told = tmp_path / "a.sqlite", tmp_path / "told.json"
    status, out = command(*SWEPT, "--store", path)
    assert status == 0
    assert "friction: 3 values from 0.1 to 0.3\n3 solved\n" in out
    assert read_sweep(path).values == pytest.approx((0.1, 0.2, 0.3))
    before = path.read_bytes()
    assert command(*SWEPT, "--store", path, "--save-json", told, "--json")[0] == 0
    assert path.read_bytes() == before
    document = json.loads(told.read_text(encoding="utf-8"))
    assert (document["solved"], document["values"], document["statuses"]) == (True, 3, {"solved": 3})


@pytest.mark.parametrize(
    ("words", "option"),
    [(["--plot", "a.png"], "--plot"), (["--certificate"], "--certificate"), (["--workers", "0"], "--workers"),
     (["--dask", "nowhere"], "--dask"), (["--set", "friction=0:1:0"], "--set"),
     (["--set", "friction=0:1:9999999"], "--set"), (["--set", "nobody.gap=0:1:3"], "--set")],
)  # fmt: skip
def test_what_the_command_line_refuses(tmp_path, words, option):
    status, message = command(*SWEPT, "--store", tmp_path / "a", *words)
    assert status == 2
    assert message.startswith(option)
    assert not (tmp_path / "a").exists() or not read_sweep(tmp_path / "a").statuses


def test_workers_are_for_stored_sweeps():
    assert command(*SWEPT, "--workers", "2")[1].startswith("--workers")
    assert command("solve", FILE, "--store", "a")[1].startswith("--store")


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """The bytes of a store of two values."""
    path = tmp_path_factory.mktemp("store") / "a.sqlite"
    solve_sweep(PLATE, "friction", [0.1, 0.2], store=path)
    return path.read_bytes()


class TestChanged:
    """Stores that were changed after they were made: one line, nothing believed, no memory."""

    @pytest.fixture
    def path(self, tmp_path, stored):
        (tmp_path / "a.sqlite").write_bytes(stored)
        return tmp_path / "a.sqlite"

    @staticmethod
    def read(path):
        stored = read_sweep(path)
        return stored.status, stored.message, list(stored.rows())

    @staticmethod
    def changed(path, statements):
        with closing(sqlite3.connect(path)) as connection, connection:
            connection.executescript(statements)

    @pytest.mark.parametrize(
        "statements",
        ["UPDATE sweep SET parameter = 'gap'", "UPDATE sweep SET fingerprint = x'00'", "DELETE FROM sweep",
         "UPDATE planned SET value = 0.3 WHERE number = 2", "INSERT INTO planned VALUES (3, 0.3)",
         "UPDATE results SET status = 'splendid'", "UPDATE results SET message = x'ff'",
         "UPDATE results SET accuracy = 'good'", "UPDATE contacts SET normal_force = 'great'",
         "UPDATE contacts SET contact = x'ff'", "CREATE TABLE more (a)",
         "CREATE TRIGGER t AFTER INSERT ON results BEGIN DELETE FROM results; END"],
    )  # fmt: skip
    def test_one_line(self, path, statements):
        self.changed(path, statements)
        with pytest.raises(InputError) as caught:
            self.read(path)
        assert caught.value.field == "store"
        assert "\n" not in str(caught.value)

    @pytest.mark.parametrize("name", ["planned", "results"])
    def test_views_in_place_of_tables(self, path, name):
        """Rows of a view need no room in the file, and may have no end."""
        endless = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i, i, i, i, i, i FROM n"
        self.changed(path, f"PRAGMA foreign_keys = OFF; DROP TABLE {name}; CREATE VIEW {name} AS {endless}")
        for use in (read_sweep, lambda place: solve_sweep(PLATE, "friction", [0.1, 0.2], store=place)):
            with pytest.raises(InputError) as caught:
                use(path)
            assert caught.value.field == "store"

    def test_stores_without_the_digest_are_read_and_gone_on_with(self, path):
        undone = "PRAGMA foreign_keys = ON; DELETE FROM results WHERE number = 2"
        self.changed(path, f"{undone}; UPDATE sweep SET fingerprint = substr(fingerprint, 1, 64)")
        assert read_sweep(path).values == (0.1, 0.2)
        assert solve_sweep(PLATE, "friction", [0.1, 0.2], store=path).statuses == (Status.SOLVED, Status.SOLVED)

    def test_what_they_are_asked_for_is_compared_all_the_same(self, path):
        self.changed(path, "UPDATE sweep SET fingerprint = substr(fingerprint, 1, 64), parameter = 'gap'")
        with pytest.raises(InputError, match="changed"):
            solve_sweep(PLATE, "friction", [0.1, 0.2], store=path)


def test_zero_of_either_sign_is_kept(tmp_path):
    assert solve_sweep(PLATE, "gap", [-0.0], store=tmp_path / "a").status is Status.SOLVED
    assert solve_sweep(PLATE, "gap", [-0.0], store=tmp_path / "a").values == (0.0,)
