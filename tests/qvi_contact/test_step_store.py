"""Histories that are kept in a folder, step by step: interrupted, damaged, and those of other problems."""

import gc
import json
import shutil
import tracemalloc
import weakref
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    RectilinearMesh,
    Traction,
    save_problem,
    solve_history,
)
from qvi_contact.cli import group
from qvi_contact.command.page.numbers import step_tables
from qvi_contact.files import step_store
from qvi_contact.files.archive import OWN, write_archive
from qvi_contact.files.stored import answer_from_archive
from qvi_contact.gallery import rings
from qvi_contact.plots import history_figure
from qvi_contact.problem.fields import Expression
from qvi_contact.verification.verification import verify_file
from solvers import Status

PATH = 0.01 * np.array([0.0, 0.5, 1.0, 0.2, -0.6, -1.0, 0.1])


class StopError(Exception):
    """What ends a run before its time."""


def block(offset, friction=0.3):
    """A block under a rough plate that moves sideways: parts slip, parts stick."""
    mesh = RectilinearMesh.rectangle((3, 2), 2.0, 1.0)
    free = [Traction("left", x=0.0, y=0.0), Traction("right", x=0.0, y=0.0)]
    plate = Contact("top", friction, gap=lambda x, y: -0.01 + 0.001 * x + 0.0 * y, offset=offset, name="plate")
    return ContactProblem(mesh, Material(1000.0, 0.3), [plate, Displacement("bottom", x=0.0, y=0.0), *free])


STEPS = [block(offset) for offset in PATH]


def stopping(number):
    def callback(step, _result):
        if step == number:
            raise StopError

    return callback


def same(one, other):
    assert one.statuses == other.statuses
    assert one.slip("plate") == pytest.approx(other.slip("plate"), abs=1e-12)
    assert np.array(one.loop("plate")) == pytest.approx(np.array(other.loop("plate")), rel=1e-9, abs=1e-9)
    assert one.dissipated == pytest.approx(other.dissipated, rel=1e-8, abs=1e-12)
    assert one.friction_work == pytest.approx(other.friction_work, rel=1e-8, abs=1e-12)


@pytest.fixture(scope="module", name="whole")
def _whole():
    return solve_history(STEPS)


@pytest.fixture(scope="module", name="stopped")
def _stopped(tmp_path_factory):
    """A folder with the first four steps, to be copied."""
    folder = tmp_path_factory.mktemp("stopped") / "steps"
    with pytest.raises(StopError):
        solve_history(STEPS, stopping(4), store=folder)
    return folder


@pytest.fixture(name="begun")
def _begun(stopped, tmp_path):
    return shutil.copytree(stopped, tmp_path / "begun")


def done(folder):
    """The steps that a run in the folder still had to solve, and the history."""
    told = []
    history = solve_history(STEPS, lambda number, _: told.append(number), store=folder)
    return told, history


def test_it_goes_on_where_it_stopped(begun, whole):
    told, history = done(begun)
    assert told == [5, 6, 7]
    assert history.status is Status.SOLVED
    assert whole.slip("plate")[3].any()  # without it the steps that follow would be others
    same(history, whole)
    assert done(begun)[0] == []


def test_steps_are_read_with_their_certificates(begun, whole):
    history = done(begun)[1]
    for kept, known in zip(history.steps[1:3], whole.steps[1:3], strict=True):
        assert kept.certificate.measures == known.certificate.measures
        assert (kept.solution.z == known.solution.z).all()
    assert len(history.steps[2:]) == 5
    with pytest.raises(IndexError):
        history.steps[7]


def test_a_damaged_step_is_solved_again(begun, whole):
    path = begun / "step-000003.npz"
    path.write_bytes(path.read_bytes()[:-100])
    told, history = done(begun)
    assert told == [3, 4, 5, 6, 7]
    same(history, whole)


@pytest.mark.parametrize(
    "other",
    [
        {"problems": STEPS[:-1]},
        {"problems": [*STEPS[:-1], block(0.009)]},
        {"problems": [block(offset, 0.31) for offset in PATH]},
        {"problems": [replace(step, material=Material(1001.0, 0.3)) for step in STEPS]},
        {"degree": 3},
        {"tolerance": 1e-7},
    ],
)
def test_a_store_of_another_history_is_refused(begun, other):
    held = {path.name: path.read_bytes() for path in begun.iterdir()}
    given = {"problems": STEPS, **other}
    with pytest.raises(InputError, match="another history"):
        solve_history(given.pop("problems"), store=begun, **given)
    assert {path.name: path.read_bytes() for path in begun.iterdir()} == held


def test_a_store_of_a_body_with_arcs_is_not_that_of_one_with_chords(tmp_path):
    arcs = rings(4)
    chords = replace(arcs, mesh=replace(arcs.mesh, arcs=()))
    solve_history([arcs], store=tmp_path / "steps")
    with pytest.raises(InputError, match="another history"):
        solve_history([chords], store=tmp_path / "steps")
    assert solve_history([arcs], store=tmp_path / "steps").status is Status.SOLVED


def test_a_folder_of_other_files_is_refused(tmp_path):
    (tmp_path / "letter.txt").write_text("kept", encoding="utf-8")
    with pytest.raises(InputError, match="other files"):
        solve_history(STEPS, store=tmp_path)
    (tmp_path / "store.json").write_text("[]", encoding="utf-8")
    with pytest.raises(InputError, match=r"store\.json"):
        solve_history(STEPS, store=tmp_path)
    with pytest.raises(InputError, match="store"):
        solve_history(STEPS, store=tmp_path / "letter.txt")


def test_a_step_that_failed_is_tried_again(tmp_path, whole):
    failed = solve_history(STEPS, store=tmp_path / "steps", time_limit=1e-9)
    assert failed.status is Status.TIME_LIMIT
    told, history = done(tmp_path / "steps")
    assert told == list(range(1, 8))
    same(history, whole)


class Made(Sequence):
    """Problems made when they are asked for."""

    def __init__(self, offsets):
        self.offsets = offsets

    def __len__(self):
        return len(self.offsets)

    def __getitem__(self, index):
        return block(self.offsets[index])


def test_memory_does_not_grow_with_the_steps(tmp_path):
    def used(number, _):
        if number == 3:
            tracemalloc.start()  # what is made only once, at the beginning, need not be traced
        if number in (5, 12):
            gc.collect()
            seen.append(tracemalloc.get_traced_memory()[0])

    seen: list[int] = []
    offsets = 0.01 * np.sin(np.arange(12))
    gc.collect()
    gc.freeze()
    try:
        solve_history(Made(offsets), used, store=tmp_path / "steps", element="bfs")
    finally:
        tracemalloc.stop()
    assert seen[1] - seen[0] < 7 * 5000  # without a store a step takes several times as much


@pytest.fixture(name="alive")
def _alive(monkeypatch):
    """How many results that were read there are at the same time, at each reading."""
    read, counts = [], []
    gc.collect()
    gc.freeze()  # what is there already is not looked through again at each reading

    def reading(*given):
        gc.collect()
        counts.append(sum(one() is not None for one in read))
        found = answer_from_archive(*given)
        read.append(weakref.ref(found))
        return found

    monkeypatch.setattr(step_store, "answer_from_archive", reading)
    return counts


@pytest.fixture(name="stored")
def _stored(tmp_path):
    """A history whose steps are in files."""
    solve_history(STEPS, store=tmp_path / "steps", element="bfs")
    return solve_history(STEPS, store=tmp_path / "steps", element="bfs")


def test_the_picture_keeps_no_step(stored, alive):
    assert history_figure(stored).axes
    assert len(STEPS) - 1 <= len(alive) <= 3 * len(STEPS)  # forces, loops, and the first step
    assert max(alive) <= 3


def test_the_page_reads_each_step_once(stored, alive):
    assert len(step_tables(stored.steps, PATH)[0]) == len(STEPS)
    assert len(alive) <= len(STEPS)
    assert max(alive) <= 3


def test_each_step_can_be_checked_from_its_file(tmp_path):
    """That of a problem with expressions: the answer and its certificate, after the slip of the steps before."""
    plate = replace(STEPS[0].conditions[0], gap=Expression("0.001 * x - 0.01"))
    steps = [replace(block(w), conditions=[replace(plate, offset=w), *STEPS[0].conditions[1:]]) for w in PATH[:4]]
    history = solve_history(steps, store=tmp_path)
    for number, step in enumerate(history.steps, 1):
        found = verify_file(tmp_path / f"step-{number:06}.npz")
        assert found.passed, found.summary()
        assert next(row.value for row in found.rows if row.name == "energy_gap") == pytest.approx(
            step.certificate.measures["energy_gap"], abs=1e-12
        )


def test_a_step_with_another_answer_is_found_out(tmp_path):
    held = replace(STEPS[0], conditions=[replace(STEPS[0].conditions[0], gap=-0.01), *STEPS[0].conditions[1:]])
    solve_history([held], store=tmp_path)
    path = tmp_path / "step-000001.npz"
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files if name not in OWN}
    write_archive(path, {**arrays, "z": 1.001 * arrays["z"]})
    assert {row.name for row in verify_file(path).failures} >= {"status", "stationarity"}


def test_steps_with_python_functions_have_no_problem_to_check(tmp_path):
    solve_history(STEPS[:1], store=tmp_path)
    with pytest.raises(InputError, match="no problem to check"):
        verify_file(tmp_path / "step-000001.npz")


def test_the_command_goes_on(tmp_path):
    plate = replace(STEPS[0].conditions[0], gap=-0.01, offset=Expression("0.01 * sin(t)"))
    problem = replace(STEPS[0], conditions=[plate, *STEPS[0].conditions[1:]])
    file, folder = tmp_path / "block.toml", tmp_path / "steps"
    save_problem(file, problem, times=[0.0, 1.0, 2.0, 3.0])
    words = ["solve", str(file), "--json"]
    known = json.loads(CliRunner().invoke(group, words).stdout)
    first = CliRunner().invoke(group, [*words, "--store", str(folder)])
    (folder / "step-000004.npz").unlink()
    kept = (folder / "step-000003.npz").stat().st_mtime_ns
    second = CliRunner().invoke(group, [*words, "--store", str(folder)])
    for found in (first, second):
        steps = json.loads(found.stdout)["steps"]
        assert [step["contacts"] for step in steps] == [step["contacts"] for step in known["steps"]]
    assert (folder / "step-000003.npz").stat().st_mtime_ns == kept
    refused = CliRunner().invoke(group, [*words, "--store", str(folder), "--degree", "3"], standalone_mode=False)
    assert isinstance(refused.exception, InputError)
    save_problem(file, replace(problem, conditions=[replace(plate, offset=0.0), *problem.conditions[1:]]))
    single = CliRunner().invoke(group, [*words, "--store", str(tmp_path / "none")], standalone_mode=False)
    assert "history" in str(single.exception)
    assert not (tmp_path / "none").exists()


def test_corners_given_up_on_the_way_are_remembered(tmp_path):
    """The history starts again with them; one that goes on starts with them."""

    def driven(offset):
        mesh = RectilinearMesh.rectangle((3, 2), 2.0, 1.0)
        sides = [Traction("left", x=0.0, y=8.0), Traction("right", x=0.0, y=-8.0)]
        held = Displacement("top", x=0.0, y=-0.01)
        base = Contact("bottom", 0.3, offset=offset, name="plate")
        return ContactProblem(mesh, Material(1000.0, 0.3), [base, held, *sides])

    steps, told = [driven(offset) for offset in (0.0, 0.03, 0.01)], []
    whole = solve_history(steps, element="bfs")
    solve_history(steps, lambda number, _: told.append(number), store=tmp_path / "steps", element="bfs")
    assert len(told) > len(steps)
    (tmp_path / "steps" / "step-000003.npz").unlink()
    told.clear()
    again = solve_history(steps, lambda number, _: told.append(number), store=tmp_path / "steps", element="bfs")
    assert told == [3]
    assert len(again.steps[2].discretization.freed)
    same(again, whole)
