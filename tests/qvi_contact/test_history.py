"""Load histories against a closed form and energy balance; and those that are kept in a folder, step by step."""

import pickle
import shutil
import sqlite3
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from qvi_contact import Expression, InputError, TriangleMesh, solve, solve_history
from qvi_contact.files import OWN, STORE, write_archive
from qvi_contact.plots import history_figure
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Polynomial, Traction
from qvi_contact.solution import loop_area
from qvi_contact.verification import verify_file
from solvers import Status
from tests.cases import refused_at

YOUNG, PRESSURE, FRICTION, WIDTH, HEIGHT = 1000.0, 10.0, 0.3, 2.0, 1.0
YIELD = FRICTION * PRESSURE * HEIGHT / (YOUNG / 2.0)  # ν = 0: G = E/2


def ramp(*corners, steps):
    """Values from corner to corner, `steps` for each of them."""
    return np.concatenate([[corners[0]], *(np.linspace(a, b, steps + 1)[1:] for a, b in pairwise(corners))])


def sheared_layer(displacement, cells=(3, 2), grading=1.0, offset=0.0):
    """A layer in uniform shear on a rough base: elastic until |σ_xy| = μp, then sliding; u_y = −p y/E on the sides."""
    mesh = TriangleMesh.rectangle(cells, WIDTH, HEIGHT, grading=grading)
    sides = [
        condition
        for side in ("left", "right")
        for condition in (Traction(side, x=0.0), Displacement(side, y=lambda x, y: -PRESSURE / YOUNG * y + 0 * x))
    ]
    top = [Displacement("top", x=displacement), Traction("top", y=-PRESSURE)]
    base = Contact("bottom", FRICTION, offset=offset, name="base")
    return ContactProblem(mesh, Material(YOUNG, 0.0), [base, *top, *sides])


def elastic_sliding(displacements):
    """Shear stress in each step: the element of Jenkins, G/h (U − s) within ±μp."""
    slip, found = 0.0, []
    for displacement in displacements:
        trial = YOUNG / 2.0 / HEIGHT * (displacement - slip)
        stress = np.clip(trial, -FRICTION * PRESSURE, FRICTION * PRESSURE)
        slip += (trial - stress) * HEIGHT / (YOUNG / 2.0)
        found.append(stress)
    return np.array(found)


def test_layer_follows_the_closed_form():
    path, grading = YIELD * ramp(0.0, 2.3, -1.7, 0.4, -0.2, 2.3, steps=2), 0.5
    history = solve_history([sheared_layer(u, grading=grading) for u in path])
    displacement, force = history.loop("top")
    assert history.status is Status.SOLVED
    assert displacement == pytest.approx(path)
    assert force == pytest.approx(WIDTH * elastic_sliding(path), abs=1e-7 * WIDTH * PRESSURE)
    assert (history.dissipated >= -1e-12).all()
    by_base = solve_history([sheared_layer(0.0, grading=grading, offset=-u) for u in path[:9]]).loop("base")
    assert by_base[0] == pytest.approx(-path[:9])
    assert by_base[1] == pytest.approx(-force[:9], abs=1e-7)


def test_closed_loop_repeats_and_its_area_is_the_energy_lost():
    """The steps meet every beginning and end of sliding, so that both rules are exact; 4 μp L (U − U_y) around."""
    amplitude = 2.0 * YIELD
    path = ramp(0.0, amplitude, -amplitude, amplitude, -amplitude, amplitude, steps=4)
    history = solve_history([sheared_layer(u) for u in path])
    displacement, force = history.loop("top")
    assert force[-8:] == pytest.approx(force[-16:-8], rel=1e-9, abs=1e-9)
    area = 4.0 * FRICTION * PRESSURE * WIDTH * (amplitude - YIELD)
    assert loop_area(displacement[-9:], force[-9:]) == pytest.approx(area, rel=1e-6)
    assert history.dissipated[-8:].sum() == pytest.approx(area, rel=1e-6)
    assert history.friction_work[-8:].sum() == pytest.approx(area, rel=1e-6)
    assert sum(step.energies.dissipation for step in history.steps[-8:]) == pytest.approx(area, rel=1e-6)


def pressed_block(offset, cells=(6, 4), poisson=0.3):
    """A block under a rough plate that moves sideways: parts slip, parts stick."""
    mesh = TriangleMesh.rectangle(cells, WIDTH, HEIGHT)
    free = [Traction("left", x=0.0, y=0.0), Traction("right", x=0.0, y=0.0)]
    plate = Contact("top", FRICTION, gap=-0.01, offset=offset, name="plate")
    return ContactProblem(mesh, Material(YOUNG, poisson), [plate, Displacement("bottom", x=0.0, y=0.0), *free])


def test_a_plate_that_moves_to_and_fro_makes_parts_slip_and_parts_stick():
    """Cycles come to repeat; then the work of friction is the area of the loop, the implicit rule a little more."""
    history = solve_history([pressed_block(w, (4, 2)) for w in 0.01 * ramp(0.0, *3 * (1.0, -1.0), 1.0, steps=4)])
    assert history.status is Status.SOLVED
    assert {1, 2} in [set(step.contacts["plate"].state.tolist()) for step in history.steps]
    displacement, force = history.loop("plate")
    changes = [np.abs(force[end - 8 : end] - force[end - 16 : end - 8]).max() for end in (-8, len(force))]
    assert changes[1] < 0.5 * changes[0] < 0.05 * np.abs(force).max()
    area = loop_area(displacement[-9:], force[-9:])
    assert area > 0.0
    assert history.friction_work[-8:].sum() == pytest.approx(area, rel=0.06)
    assert (history.dissipated >= -1e-12 * history.dissipated.max()).all()
    lost = [step.energies.dissipation for step in history.steps]
    assert lost == pytest.approx(history.dissipated, rel=1e-6, abs=1e-12)
    slips = [step.contacts["plate"].slip for step in history.steps]
    assert history.slip("plate")[-1] == pytest.approx(np.sum(slips, axis=0))


def test_bad_steps_are_refused():
    with pytest.raises(InputError, match="at least one"):
        solve_history([])
    problem, finer, layer = pressed_block(0.0), pressed_block(0.0, cells=(4, 4)), sheared_layer(0.0, (6, 4))
    sides = problem.mesh.edge_sets
    mesh = replace(problem.mesh, edge_sets={**sides, "top": sides["bottom"], "bottom": sides["top"]})
    for other, what in ((finer, "mesh"), (layer, "contacts"), (replace(problem, mesh=mesh), "contacts")):
        with pytest.raises(InputError, match=f"same {what}"):
            solve_history([other, problem])
    stiffer = replace(problem, material=Material(2.0 * YOUNG, 0.3))  # is none of these: its law is that of all strain
    forces = [step.contacts["plate"].normal_force for step in solve_history([problem, stiffer]).steps]
    assert forces[1] == pytest.approx(2.0 * forces[0], rel=1e-9)
    with pytest.raises(InputError, match="contacts"):
        solve_history([pressed_block(0.0)]).loop("left")


def dragged_block(u, shift=0.0):
    """A block pressed on rough ground and moved by its right side, the ground by `shift`."""
    mesh = TriangleMesh.rectangle((4, 2), WIDTH, HEIGHT)
    sides = [Traction("top", x=0.0, y=-10.0), Traction("left", x=0.0, y=0.0), Displacement("right", x=u, y=0.0)]
    ground = Contact("bottom", FRICTION, offset=shift, name="ground")
    return ContactProblem(mesh, Material(YOUNG, 0.0), [ground, *sides])


class TestWhatDrives:
    """An obstacle at rest has no loop where displacements move the body; what moves it has one."""

    path = 0.05 * ramp(0.0, 1.0, -1.0, 1.0, steps=2)

    def test_an_obstacle_at_rest_is_told(self):
        history = solve_history([sheared_layer(u) for u in self.path])
        with pytest.raises(InputError, match="'top'"):
            history.loop("base")
        assert "top" in [axes.get_title() for axes in history_figure(history).axes]
        assert np.ptp(history.loop("top")[0]) > 0.0

    @pytest.mark.parametrize("way", [(1.0, 0.0), (0.6, 0.8), (0.0, 1.0)])
    def test_a_slanted_side_has_the_loop_of_its_whole_motion(self, way):
        flat = TriangleMesh.rectangle((4, 2), WIDTH, HEIGHT)
        mesh = TriangleMesh(flat.vertices @ [[0.8, 0.6], [-0.6, 0.8]], flat.cells, flat.edge_sets)
        held = [Displacement("bottom", 0.0, 0.0), *(Traction(side, 0.0, 0.0) for side in ("left", "right"))]
        moved = [[*held, Displacement("top", *(u * d for d in way))] for u in self.path]
        history = solve_history([ContactProblem(mesh, Material(YOUNG, 0.0), each) for each in moved])
        displacement, force = history.loop("top")
        assert displacement == pytest.approx(self.path)
        assert displacement * force == pytest.approx([2.0 * step.energies.strain for step in history.steps])

    def test_a_ground_that_moves_has_a_loop_whatever_else_moves_and_a_body_at_rest_one_at_rest(self):
        history = solve_history([dragged_block(u, shift=-u) for u in self.path])
        assert history.loop("ground")[0] == pytest.approx(-self.path)
        assert solve_history([dragged_block(0.0)] * 2).loop("ground")[0].tolist() == [0.0, 0.0]


def test_steps_done_in_time_are_kept(clock):
    """A second a step: two are done in a second and a half, a third is not begun."""
    steps = [pressed_block(w) for w in (0.0, 0.001, 0.002)]
    heard = []
    history = solve_history(steps, lambda *told: (heard.append(told), clock.passes(1.0)), time_limit=1.5)
    assert heard == list(enumerate(history.steps, 1))
    assert [step.status for step in history.steps] == [Status.SOLVED, Status.SOLVED]
    assert history.status is Status.TIME_LIMIT
    assert history.message.startswith("time limit after 2 of 3 steps")


def test_a_step_at_rest_does_not_set_the_units():
    """Steel under its own weight from rest: stresses of 1e-8 E are as exact as alone."""

    def weighed(gravity):
        mesh = TriangleMesh.rectangle((4, 4), 0.1, 0.1)
        free = [Traction("left", x=0.0, y=0.0), Traction("right", x=0.0, y=0.0), Traction("top", x=0.0, y=0.0)]
        ground = Contact("bottom", 0.1, gap=Polynomial([[0.0], [0.0], [1e-9]]), name="ground")
        return ContactProblem(mesh, Material(2.1e11, 0.3), [ground, *free], Polynomial([[0.0, 7850.0 * gravity]]))

    alone = solve(weighed(9.81)).contacts["ground"]
    history = solve_history([weighed(0.0), weighed(9.81)])
    after = history.steps[1].contacts["ground"]
    assert history.status is Status.SOLVED
    size = np.abs(alone.normal_stress).max()
    assert np.abs(after.normal_stress - alone.normal_stress).max() < 1e-7 * size
    assert np.abs(after.tangential_stress - alone.tangential_stress).max() < 1e-7 * size


@pytest.mark.parametrize("method", ["condensed", "fixed-point"])
def test_a_free_body_stays_where_it_was(method):
    """Pushed aside by a wall, lifted, and set down again: the other wall meets it there, and pushes it back."""

    def step(pressure, left, right):
        walls = [Contact("left", 0.0, gap=left), Contact("right", 0.0, gap=right), Traction("top", 0.0, -pressure)]
        return ContactProblem(TriangleMesh.rectangle((3, 2)), Material(1e3, 0.0), [Contact("bottom", 0.3), *walls])

    steps = [step(10.0, -0.2, 0.5), step(0.0, 0.5, 0.5), step(10.0, 0.5, 0.5), step(10.0, 0.5, 0.19)]
    history = solve_history(steps, method=method)
    assert history.steps[-1].contacts["right"].normal_force == pytest.approx(3.0)
    assert history.slip("bottom").mean(axis=1) == pytest.approx([0.197, 0.198, 0.198, 0.193], abs=1e-3)


PATH = 0.01 * np.array([0.0, 0.5, 1.0, 0.2, -0.6, -1.0, 0.1])


def block(offset, friction=0.3):
    """A block under a rough plate that moves sideways: parts slip, parts stick."""
    problem = pressed_block(offset, (3, 2))
    plate = replace(problem.conditions[0], friction=friction, gap=lambda x, y: -0.01 + 0.001 * x + 0.0 * y)
    return replace(problem, conditions=[plate, *problem.conditions[1:]])


STEPS = [block(offset) for offset in PATH]


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
    with pytest.raises(sqlite3.Error, match="the end"):  # of the user's own database
        solve_history(STEPS, Mock(side_effect=[None, None, None, sqlite3.Error("the end")]), store=folder)
    return folder


@pytest.fixture(name="begun")
def _begun(stopped, tmp_path):
    return shutil.copytree(stopped, tmp_path / "begun")


def done(folder):
    """The steps that a run in the folder still had to solve, and the history; a second run meanwhile is refused."""
    told = []

    def hear(number, _):
        told.append(number)
        with refused_at("store", "another run is at work"):
            solve_history(STEPS, store=folder)

    return told, solve_history(STEPS, hear, store=folder)


def test_it_goes_on_where_it_stopped(begun, whole):
    told, history = done(begun)
    assert told == [5, 6, 7]
    assert whole.slip("plate")[3].any()  # without it the steps that follow would be others
    same(history, whole)
    for kept, known in zip(history.steps[1:3], whole.steps[1:3], strict=True):
        assert kept.certificate.measures == known.certificate.measures
        assert (kept.solution.z == known.solution.z).all()
    with pytest.raises(IndexError):
        history.steps[7]
    assert done(begun)[0] == []


@pytest.mark.parametrize("of_another_history", [False, True])
def test_a_damaged_step_is_solved_again(begun, whole, of_another_history):
    path = begun / "step-000003.npz"
    if of_another_history:
        with np.load(path) as archive:
            arrays = {name: archive[name] for name in archive.files if name not in OWN}
        write_archive(path, arrays | {STORE: "another"})
    else:
        path.write_bytes(path.read_bytes()[:-100])
    told, history = done(begun)
    assert told == [3, 4, 5, 6, 7]
    same(history, whole)


def test_a_last_step_that_is_not_carried_is_there_and_tried_again(tmp_path, monkeypatch):
    ground = [Contact("bottom", 0.3), Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)]
    loads = [Traction("top", shear, -1.0) for shear in (0.2, 0.4, 0.1)]
    mesh, material = TriangleMesh.rectangle((2, 1), 2.0), Material(1000.0, 0.3)
    pushed = [ContactProblem(mesh, material, [*ground, load]) for load in loads]
    for told, seen in (([1, 2], []), ([2], [])):
        monkeypatch.chdir(tmp_path)
        history = solve_history(pushed, lambda number, _, seen=seen: seen.append(number), store="steps")
        history = pickle.loads(pickle.dumps(history))
        monkeypatch.chdir("/")
        assert (seen, history.statuses) == (told, (Status.SOLVED, Status.INFEASIBLE))
        assert [step.status for step in history.steps] == list(history.statuses)
        assert replace(history, steps=history.steps[:1], planned=1).status is Status.SOLVED
        assert history.steps[0].contacts["bottom"].tangential_force == pytest.approx(-0.4, rel=1e-8)


@pytest.mark.parametrize(
    "other",
    [{"problems": STEPS[:-1]}, {"problems": [*STEPS[:-1], block(0.009)]},
     {"problems": [block(offset, 0.31) for offset in PATH]},
     {"problems": [replace(step, material=Material(1001.0, 0.3)) for step in STEPS]}, {"degree": 3},
     {"tolerance": 1e-7}],
)  # fmt: skip
def test_a_store_of_another_history_is_refused(begun, other):
    held = {path.name: path.read_bytes() for path in begun.iterdir()}
    given = {"problems": STEPS, **other}
    with pytest.raises(InputError, match="another history"):
        solve_history(given.pop("problems"), store=begun, **given)
    assert {path.name: path.read_bytes() for path in begun.iterdir()} == held


def test_a_folder_of_other_files_or_without_room_is_refused(tmp_path, monkeypatch):
    (tmp_path / "letter.txt").write_text("kept", encoding="utf-8")
    old = b'{"format": "qvi_contact steps", "version": 1}'
    for place, words, header in ((tmp_path, "other files", b"[]"), (tmp_path, "another history", old),
                                 (tmp_path, "options or version", old), (tmp_path / "letter.txt", "not a folder", old),
                                 (tmp_path / "full", "No space left", old)):  # fmt: skip
        with refused_at("store", words):
            solve_history(STEPS, store=place)
        (tmp_path / "store.json").write_bytes(header)
        monkeypatch.setattr(Path, "write_text", Mock(side_effect=OSError(28, "No space left")))


def test_each_step_can_be_checked_from_its_file(tmp_path):
    """That of a problem with expressions: the answer and its certificate, after the slip of the steps before."""
    plate = replace(STEPS[0].conditions[0], gap=Expression("0.001 * x - 0.01"))
    steps = [replace(block(w), conditions=[replace(plate, offset=w), *STEPS[0].conditions[1:]]) for w in PATH[:4]]
    history = solve_history(steps, store=tmp_path)
    for number, step in enumerate(history.steps, 1):
        found = verify_file(tmp_path / f"step-{number:06}.npz")
        assert found.passed, found.summary()
        gap = next(row.value for row in found.rows if row.name == "energy_gap")
        assert gap == pytest.approx(step.certificate.measures["energy_gap"], abs=1e-12)


def test_a_step_with_another_answer_is_found_out(tmp_path):
    held = replace(STEPS[0], conditions=[replace(STEPS[0].conditions[0], gap=-0.01), *STEPS[0].conditions[1:]])
    solve_history([held], store=tmp_path / "steps")
    path = tmp_path / "steps" / "step-000001.npz"
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files if name not in OWN}
    write_archive(path, {**arrays, "z": 1.001 * arrays["z"]})
    assert {row.name for row in verify_file(path).failures} >= {"status", "stationarity"}
    solve_history(STEPS[:1], store=tmp_path / "functions")
    with pytest.raises(InputError, match="no problem to check"):
        verify_file(tmp_path / "functions" / "step-000001.npz")
