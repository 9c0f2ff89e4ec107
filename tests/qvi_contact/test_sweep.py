"""Sweeps: the answers of single solves, one factorisation, and what a failing value or the time does."""

import json
import os
import pickle
import sqlite3
import struct
import time
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from qvi_contact import InputError, Settings, TriangleMesh, read_sweep, solve, solve_sweep
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem import Contact, ContactProblem, Displacement, Expression, Material, Traction
from qvi_contact.runs import Outcome, Workers
from qvi_contact.units import Units
from solvers import Status
from tests.cases import refused_at
from tests.run_tasks import deadly


def pushed(shear=0.1, friction=0.3):
    """A block pressed on the ground, and pushed to the side by its upper and right side."""
    mesh = TriangleMesh.rectangle((3, 2), 2.0, 1.0)
    sides = [Traction("left", x=0.0, y=-shear), Traction("right", x=0.0, y=shear)]
    top = [Traction("top", x=shear, y=-1.0, name="push")]
    return ContactProblem(mesh, Material(1e3, 0.2), [Contact("bottom", friction, name="base"), *top, *sides])


PLATE = compressed_plate(0.2, (4, 4))
*SIDES, PRESS = PLATE.conditions

SWEEPS = {
    "friction": ((0.1, 0.3, 0.2), lambda mu: compressed_plate(mu, (4, 4))),
    "gap": ((0.0, -1e-4, 1e-4), lambda shift: compressed_plate(0.2, (4, 4), displacement=1e-3 - shift)),
    "offset": ((0.0, 2e-5), lambda w: replace(PLATE, conditions=[*SIDES, replace(PRESS, offset=w)])),
}


@pytest.mark.parametrize("parameter", SWEEPS)
def test_every_value_has_the_answer_of_a_solve_of_its_own(parameter):
    values, single = SWEEPS[parameter]
    beside = replace(PLATE, conditions=[Contact("left", 0.0, law="bilateral"), *PLATE.conditions[1:]])  # the symmetry
    sweep = solve_sweep(beside, parameter, values, ["plate"])
    assert sweep.status is Status.SOLVED
    column = parameter if parameter == "friction" else f"{parameter} [mm]"
    assert sweep.to_frame(Units("mm", "MPa"))[column].unique().tolist() == list(values)
    for value, step in zip(values, sweep.steps, strict=True):
        alone = solve(single(value))
        line, expected = step.contacts["plate"], alone.contacts["plate"]
        assert step.certificate.passed
        assert line.normal_force == pytest.approx(expected.normal_force, rel=1e-10)
        assert line.tangential_force == pytest.approx(expected.tangential_force, abs=1e-10 * expected.normal_force)
        assert step.energies.strain == pytest.approx(alone.energies.strain, rel=1e-10)


def test_all_values_share_one_matrix_and_its_elimination():
    steps = solve_sweep(PLATE, "friction", [0.1, 0.2, 0.3, 0.4], factorisation="multifrontal").steps
    first, *others = (step.discretization.qvi for step in steps)
    assert all(qvi.K is first.K and qvi.stiffness is first.stiffness for qvi in others)


def test_starts_far_from_the_answer_cost_an_iteration_or_two():
    """A punch whose contact grows with each value."""
    sides = [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
    punch = Contact("top", 0.3, lambda x, y: 0.02 * (x - 1.0) ** 2 + 0.0 * y)
    mesh = TriangleMesh.rectangle((6, 2), 2.0, 1.0)
    layer = ContactProblem(mesh, Material(1e3, 0.3), [punch, Displacement("bottom", x=0.0, y=0.0), *sides])
    depths = -0.001 * np.array([1.0, 3.0, 6.0, 10.0, 15.0, 20.0, 30.0, 40.0])
    warm, cold = (solve_sweep(layer, "gap", depths, warm_start=warm, method="condensed") for warm in (True, False))
    assert [step.solution.near for step in (*cold.steps, *warm.steps)] == [None] * 9 + [False] * 7
    more = [one.iterations - other.iterations for one, other in zip(warm.steps, cold.steps, strict=True)]
    assert (more[0], min(more[1:]) > 0, max(more) <= 2) == (0, True, True)
    near = solve_sweep(layer, "gap", [-0.02, -0.0201, -0.0202])
    assert [step.solution.near for step in near.steps] == [None, True, True]


def test_friction_holds_at_points_of_bilateral_contacts_after_values_without_any():
    base, top, *_, right = pushed().conditions
    tipped = replace(base, law="bilateral"), replace(top, y=Expression("10 * x - 7")), Displacement("left", 0.0, 0.0)
    problem = replace(pushed(), conditions=[*tipped, right])
    line = solve_sweep(problem, "friction", [0.0, 0.0, 0.3], method="condensed").steps[2].contacts["base"]
    assert (abs(line.tangential_stress) <= 0.3 * abs(line.normal_stress) + 1e-9).all()


def test_loads_are_multiplied_and_tied_contacts_moved_if_they_are_named():
    base, top, *sides = pushed(shear=0.0).conditions
    problem = replace(pushed(), conditions=[base, replace(top, x=0.1), *sides])
    found = solve_sweep(problem, "load", [0.5, 2.0], of=["push"])
    for factor, step in zip(found.values, found.steps, strict=True):
        line = step.contacts["base"]
        assert (line.normal_force, abs(line.tangential_force)) == pytest.approx((2.0 * factor, 0.2 * factor), abs=1e-8)
    glued = replace(PLATE, conditions=[*SIDES, Contact.tied("top")])
    one, two = solve_sweep(glued, "gap", [-1e-3, -2e-3], ["top"]).steps
    assert 2.0 * one.contacts["top"].normal_force == pytest.approx(two.contacts["top"].normal_force)


def test_a_value_without_an_answer_does_not_end_the_sweep():
    seen = []
    sweep = solve_sweep(pushed(), "friction", [0.5, 0.05, 0.4], callback=lambda number, _: seen.append(number))
    assert (seen, [step.status is Status.SOLVED for step in sweep.steps]) == ([1, 2, 3], [True, False, True])
    assert sweep.status is sweep.steps[1].status is Status.INFEASIBLE
    assert "friction = 0.05" in sweep.message


def test_the_time_limit_keeps_what_was_done(clock):
    sweep = solve_sweep(PLATE, "friction", [0.1, 0.2, 0.3], callback=lambda *_: clock.passes(1.0), time_limit=0.5)
    assert (len(sweep.steps), sweep.status) == (1, Status.TIME_LIMIT)


@pytest.mark.parametrize(
    ("parameter", "values", "of", "field"),
    [("mu", [0.1], None, "parameter"), ("friction", [], None, "values"), ("friction", [-0.1], None, "values"),
     ("gap", [np.nan], None, "values"), ("gap", 1.0, None, "values"), ("gap", "0.1", None, "values"),
     ("friction", [0.1, 1e100], None, "values"), ("load", [-1e160], None, "values"),
     ("friction", [0.1], ["base"], "of"), ("friction", [0.1], "plate", "of"), ("load", [1.0], ["base"], "of"),
     ("load", [1.0], [], "of"), ("load", [1.0], ["body"], "of")],
)  # fmt: skip
def test_bad_sweeps_are_refused(parameter, values, of, field):
    with refused_at(field):
        solve_sweep(PLATE, parameter, values, of)


VALUES = (0.1, 0.2, 0.3, 0.4)
ROOT = Path(__file__).parents[2]


def test_rows_are_those_of_the_results(tmp_path):
    stored = solve_sweep(PLATE, "friction", VALUES, store=tmp_path / "a.sqlite")
    results = solve_sweep(PLATE, "friction", VALUES)
    assert (stored.status, stored.message, stored.values) == (results.status, results.message, VALUES)
    assert stored.to_frame(Units("mm", "MPa")).equals(results.to_frame(Units("mm", "MPa")))
    assert [row.accuracy for row in stored.rows()] == [step.certificate.accuracy for step in results.steps]


def test_the_file_alone_tells_everything(tmp_path):
    path = tmp_path / "a.sqlite"
    stored = solve_sweep(pushed(), "friction", [0.5, 0.05], store=path)
    with closing(sqlite3.connect(path)) as connection:
        rows = connection.execute("SELECT number, value, status, contact, normal_force FROM rows").fetchall()
    assert [row[:4] for row in rows] == [(1, 0.5, "solved", "base"), (2, 0.05, "infeasible", None)]
    assert rows[0][4] == pytest.approx(2.0)
    assert (read_sweep(path), "friction = 0.05" in stored.message) == (stored, True)
    assert (stored.status, stored.statuses) == (Status.INFEASIBLE, (Status.SOLVED, Status.INFEASIBLE))


def test_a_sweep_that_was_stopped_goes_on(tmp_path):
    path, told = tmp_path / "a.sqlite", []
    with pytest.raises(KeyboardInterrupt):
        solve_sweep(PLATE, "friction", VALUES, store=path, callback=Mock(side_effect=[None, KeyboardInterrupt]))
    assert [row.number for row in read_sweep(path).rows()] == [1, 2]
    found = read_sweep(path)
    assert (found.status, found.message.split(":")[0]) == (Status.TIME_LIMIT, "2 of 4 values are done")
    stored = solve_sweep(PLATE, "friction", VALUES, None, lambda *each: told.append(each), store=path)
    assert [(number, row.value) for number, row in told] == [(3, 0.3), (4, 0.4)]
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
    two = solve_sweep(PLATE, "friction", values, None, lambda *row: told.append(row), store=tmp_path / "b", workers=2)
    assert (sorted(number for number, _ in told), two.statuses) == ([1, 2, 3, 4], one.statuses)
    names = ["friction", "normal_force", "tangential_force", "share_slip"]
    assert two.to_frame()[names].to_numpy() == pytest.approx(one.to_frame()[names].to_numpy(), rel=1e-7)


def test_rows_that_come_in_any_order_are_each_on_disk_before_the_next(tmp_path, monkeypatch):
    """As those of a cluster: the first slice comes last, as its worker was lost, and is done again value by value."""
    path, values, seen = tmp_path / "a.sqlite", np.linspace(0.05, 0.5, 20), []

    @contextmanager
    def ready(_, job, __):
        _, rows = pickle.loads(job)()

        def outcomes(slices):
            lost = slices.popleft()
            while slices:
                part = slices.pop()
                yield part, Outcome("done", rows(part))
                seen.extend(number for number, _ in part)
                assert sorted(row.number for row in read_sweep(path).rows()) == sorted(seen)
                if lost is not None and not slices:
                    yield lost, Outcome("crashed", None, "lost")
                    lost = None

        yield 2, outcomes

    monkeypatch.setattr(Workers, "ready", ready)
    stored = solve_sweep(PLATE, "friction", values, store=path, workers=2)
    found = stored.status, stored.values, sorted(seen), sorted(seen[-2:])
    assert found == (Status.SOLVED, tuple(values), list(range(1, 21)), [1, 2])


def test_functions_that_other_processes_cannot_have(tmp_path):
    conditions = [replace(c, gap=lambda x, y: 0.0 * (x + y)) if isinstance(c, Contact) else c for c in PLATE.conditions]
    problem, told = replace(PLATE, conditions=conditions), lambda *_: None
    assert solve_sweep(problem, "friction", [0.1], store=tmp_path / "a").status is Status.SOLVED
    for field, given, settings in (("Contact.gap", problem, Settings()), ("settings", PLATE, Settings(callback=told))):
        with refused_at(field):
            solve_sweep(given, "friction", [0.1, 0.2], None, None, settings, store=tmp_path / "b", workers=2)


def test_a_value_that_ends_its_process_has_a_row_that_says_so(tmp_path, environ):
    environ(RUN_TEST_RUNNER=os.getpid())
    conditions = [replace(c, gap=deadly) if isinstance(c, Contact) else c for c in PLATE.conditions]
    stored = solve_sweep(replace(PLATE, conditions=conditions), "friction", [0.1], store=tmp_path / "a", workers=2)
    assert (stored.statuses, "exit status 9" in stored.message) == ((Status.BACKEND_FAILED,), True)


def test_what_is_refused(tmp_path):
    """Another sweep than that of the store, several processes without one, wrong arguments. It stays as it was."""
    path = tmp_path / "a.sqlite"
    start = solve(PLATE)
    near = replace(start, solution=replace(start.solution, z=(1.0 + 1e-9) * start.solution.z))  # its repr is the same
    given = {"problem": PLATE, "parameter": "friction", "values": (0.1,), "store": path, "initial": start}
    solve_sweep(**given)
    before = path.read_bytes()
    for field, changes in {
        "store": [{"values": (0.1, 0.2)}, {"parameter": "gap"}, {"tolerance": 1e-7}, {"store": "."}, {"initial": near},
                  {"problem": compressed_plate(0.2, (4, 5))}], "initial": [{"initial": 0.0, "store": tmp_path / "b"}],
        "workers": [{"workers": 0}, {"workers": 2, "store": None}], "parameter": [{"parameter": "mu"}],
        "dask": [{"dask": "nowhere"}, {"dask": "tcp://127.0.0.1:1", "store": None}], "of": [{"of": ["base"]}],
    }.items():  # fmt: skip
        for change in changes:
            with refused_at(field):
                solve_sweep(**{**given, **change})
    assert path.read_bytes() == before


def test_a_store_without_rows_is_nobodys_and_one_without_room_is_named_as_it_was_given(tmp_path, monkeypatch):
    path = tmp_path / "a"
    with pytest.raises(InputError, match="nonsense"):
        solve_sweep(PLATE, "friction", [0.1], store=path, nonsense=1)
    assert solve_sweep(PLATE, "gap", [0.0], store=path).status is Status.SOLVED
    monkeypatch.setattr("qvi_contact.solution.sweep.datetime", Mock(**{"now.side_effect": sqlite3.OperationalError}))
    with refused_at("store", "SQLite says", str(tmp_path / "b")):
        solve_sweep(PLATE, "gap", [0.0], store=tmp_path / "b")


def test_files_of_others_are_refused(tmp_path):
    path = tmp_path / "a"
    path.write_text("not a database, but long enough to be one" * 30, encoding="utf-8")
    for read in (read_sweep, lambda place: solve_sweep(PLATE, "friction", [0.1], store=place)):
        with pytest.raises(InputError, match="not the store of a sweep"):
            read(path)
    (tmp_path / "circle").symlink_to("circle")
    for name, words in {"missing": "no such file", "circle": "no (such )?file"}.items():
        with refused_at("store", words):
            read_sweep(tmp_path / name)


FILE = ROOT / "examples" / "compressed_plate.toml"
SWEPT = ("solve", FILE, "--set", "friction=0.1:0.2:3")


def test_on_the_command_line(tmp_path, shell):
    path, told = tmp_path / "a.sqlite", tmp_path / "told.json"
    status, out, _ = shell(*SWEPT, "--store", path)
    assert (status, "friction: 3 values from 0.1 to 0.2\n3 solved\n" in out) == (0, True)
    assert read_sweep(path).values == (0.1, 0.15, 0.2)  # 0.15000000000000002 was stored
    before = path.read_bytes()
    assert (shell(*SWEPT, "--store", path, "--save-json", told, "--json")[0], path.read_bytes()) == (0, before)
    document = json.loads(told.read_text(encoding="utf-8"))
    assert (document["solved"], document["values"], document["statuses"]) == (True, 3, {"solved": 3})
    assert shell(*SWEPT, "--workers", "2")[2].startswith("qvi-contact: --workers")
    assert shell("solve", FILE, "--store", "a")[2].startswith("qvi-contact: --store")


@pytest.mark.parametrize(
    ("words", "option"),
    [(["--plot", "a.png"], "--plot"), (["--npz", "a.npz"], "--npz"), (["--workers", "0"], "--workers"),
     (["--dask", "nowhere"], "--dask"), (["--set", "friction=0:1:0"], "--set"),
     (["--set", "friction=0:1:9999999"], "--set"), (["--set", "nobody.gap=0:1:3"], "--set")],
)  # fmt: skip
def test_what_the_command_line_refuses(tmp_path, shell, words, option):
    status, _, message = shell(*SWEPT, "--store", tmp_path / "a", *words)
    assert (status, message[: 13 + len(option)]) == (2, f"qvi-contact: {option}")
    assert not (tmp_path / "a").exists() or not read_sweep(tmp_path / "a").statuses


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
            connection.executescript(f"PRAGMA ignore_check_constraints = ON; {statements}")

    @pytest.mark.parametrize(
        "statements",
        ["UPDATE sweep SET parameter = 'gap'", "UPDATE sweep SET fingerprint = x'00'", "DELETE FROM sweep",
         "UPDATE planned SET value = 0.3 WHERE number = 2", "INSERT INTO planned VALUES (3, 0.3)",
         "UPDATE results SET status = 'splendid'", "UPDATE contacts SET normal_force = 'great'",
         "UPDATE results SET seconds = 0", "DELETE FROM contacts", "UPDATE contacts SET contact = x'ff'",
         "CREATE TABLE more (a)",
         "PRAGMA writable_schema = ON; UPDATE sqlite_master SET sql = 'CREAT' || CAST(x'f2' AS TEXT) || sql",
         "CREATE TRIGGER t AFTER INSERT ON results BEGIN DELETE FROM results; END"],
    )  # fmt: skip
    def test_one_line(self, path, statements):
        self.changed(path, statements)
        with refused_at("store"):
            self.read(path)

    def test_a_row_with_a_flipped_bit_is_refused_and_solved_again(self, path, stored):
        first = self.read(path)[2][0].contacts["plate"]
        for number in (value for value in first.values() if not float(value).is_integer()):
            place, flipped = stored.index(struct.pack(">d", number)), bytearray(stored)
            flipped[place + 6] ^= 1
            path.write_bytes(flipped)
            with refused_at("store", "row . was changed .* repeat the sweep"):
                self.read(path)
        again = next(solve_sweep(PLATE, "friction", [0.1, 0.2], store=path).rows()).contacts["plate"]
        assert again == pytest.approx(first, rel=1e-10, abs=1e-12)

    @pytest.mark.parametrize("name", ["planned", "results"])
    def test_views_in_place_of_tables(self, path, name):
        """Rows of a view need no room in the file, and may have no end."""
        endless = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i, i, i, i, i, i FROM n"
        self.changed(path, f"PRAGMA foreign_keys = OFF; DROP TABLE {name}; CREATE VIEW {name} AS {endless}")
        for use in (read_sweep, lambda place: solve_sweep(PLATE, "friction", [0.1, 0.2], store=place)):
            with refused_at("store"):
                use(path)


@pytest.mark.usefixtures("in_tmp_path")
def test_zero_of_either_sign_is_kept_and_a_store_found_from_another_folder(monkeypatch):
    sweep = solve_sweep(PLATE, "gap", [-0.0], store="a")
    again = solve_sweep(PLATE, "gap", [-0.0], store="a")
    monkeypatch.chdir("/")
    assert (sweep.status, again.values) == (Status.SOLVED, (0.0,))
