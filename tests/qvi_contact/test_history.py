"""Load histories against a closed form, against energy balance, and against themselves."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    Polynomial,
    RectilinearMesh,
    Traction,
    solve,
)
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import RigidPlate
from qvi_contact.solution.history import loop_area, solve_history
from solvers import Status

YOUNG, PRESSURE, FRICTION, WIDTH, HEIGHT = 1000.0, 10.0, 0.3, 2.0, 1.0
YIELD = FRICTION * PRESSURE * HEIGHT / (YOUNG / 2.0)  # ν = 0: G = E/2


def ramp(*corners, steps):
    """Values from corner to corner, `steps` for each of them."""
    return np.concatenate([[corners[0]], *(np.linspace(a, b, steps + 1)[1:] for a, b in pairwise(corners))])


def sheared_layer(displacement, cells=(3, 2), grading=1.0, offset=0.0):
    """A layer in uniform shear on a rough base: elastic until |σ_xy| = μp, then sliding; u_y = −p y/E on the sides."""
    mesh = RectilinearMesh.rectangle(cells, WIDTH, HEIGHT, grading=grading)
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


@pytest.mark.parametrize(("cells", "grading"), [((1, 1), 1.0), ((3, 2), 1.0), ((4, 3), 0.5)])
def test_layer_follows_the_closed_form(cells, grading):
    path = YIELD * ramp(0.0, 2.3, -1.7, 0.4, -0.2, 2.3, steps=3)
    history = solve_history([sheared_layer(u, cells, grading) for u in path])
    displacement, force = history.loop("top")
    assert history.status is Status.SOLVED
    assert displacement == pytest.approx(path)
    assert force == pytest.approx(WIDTH * elastic_sliding(path), abs=1e-8 * WIDTH * PRESSURE)
    assert (history.dissipated >= -1e-12).all()


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


def test_moving_base_or_moving_top_is_the_same():
    path = YIELD * ramp(0.0, 1.5, -1.5, steps=3)
    by_top = solve_history([sheared_layer(u) for u in path]).loop("top")
    by_base = solve_history([sheared_layer(0.0, offset=-u) for u in path]).loop("base")
    assert by_base[0] == pytest.approx(-by_top[0])
    assert by_base[1] == pytest.approx(-by_top[1], abs=1e-7)


def pressed_block(offset, cells=(6, 4), poisson=0.3):
    """A block under a rough plate that moves sideways: parts slip, parts stick."""
    mesh = RectilinearMesh.rectangle(cells, WIDTH, HEIGHT)
    free = [Traction("left", x=0.0, y=0.0), Traction("right", x=0.0, y=0.0)]
    plate = Contact("top", FRICTION, gap=-0.01, offset=offset, name="plate")
    return ContactProblem(mesh, Material(YOUNG, poisson), [plate, Displacement("bottom", x=0.0, y=0.0), *free])


@pytest.fixture(scope="module", name="history")
def _history():
    """On rectangles, whose corners never slip: shear locked in settles at once."""
    path = 0.01 * ramp(0.0, *5 * (1.0, -1.0), 1.0, steps=4)
    return solve_history([pressed_block(w) for w in path], element="bfs")


class TestPartialSlip:
    """A plate moving to and fro on a block."""

    def test_parts_slip_and_parts_stick(self, history):
        assert history.status is Status.SOLVED
        states = [set(step.contacts["plate"].state.tolist()) for step in history.steps]
        assert {1, 2} in states

    def test_closed_cycle_repeats(self, history):
        _, force = history.loop("plate")
        assert np.abs(force[-8:] - force[-16:-8]).max() < 1e-6 * np.abs(force).max()

    def test_area_of_the_loop_is_the_work_of_friction(self, history):
        displacement, force = history.loop("plate")
        area = loop_area(displacement[-9:], force[-9:])
        assert area > 0.0
        assert history.friction_work[-8:].sum() == pytest.approx(area, rel=1e-6)

    def test_every_step_loses_energy(self, history):
        assert (history.dissipated >= -1e-12 * history.dissipated.max()).all()
        lost = [step.energies.dissipation for step in history.steps]
        assert lost == pytest.approx(history.dissipated, rel=1e-6, abs=1e-12)

    def test_slip_adds_up(self, history):
        steps = [step.contacts["plate"].slip for step in history.steps]
        assert history.slip("plate")[-1] == pytest.approx(np.sum(steps, axis=0))


def test_energy_lost_tends_to_the_area_with_smaller_steps():
    gaps = []
    for steps in (2, 4, 6):  # none of which meets the beginning of sliding
        history = solve_history([sheared_layer(u) for u in YIELD * ramp(0.0, 1.6, -1.6, 1.6, steps=steps)])
        gaps.append(history.dissipated.sum() - history.friction_work.sum())
    assert gaps[0] > gaps[1] > gaps[2] > 0.0
    assert gaps[2] < 0.4 * gaps[0]


def test_one_step_is_the_static_problem():
    problem = pressed_block(0.01)
    alone, step = solve(problem), solve_history([problem]).steps[0]
    assert step.contacts["plate"].tangential_stress == pytest.approx(alone.contacts["plate"].tangential_stress)


def test_history_matters():
    """The same load with and without an excursion before it."""
    direct = solve_history([pressed_block(0.002)]).steps[-1]
    after = solve_history([pressed_block(w) for w in (0.02, 0.002)]).steps[-1]
    forces = [result.contacts["plate"].tangential_force for result in (direct, after)]
    assert abs(forces[1] - forces[0]) > 0.1 * abs(forces[0])


def test_plate_driven_by_force_reports_its_own_motion():
    def problem(force):
        base = pressed_block(0.0)
        plate = Contact("top", FRICTION, gap=-0.01, name="plate", plate=RigidPlate(force_x=force))
        return replace(base, conditions=[plate, *base.conditions[1:]])

    by_force = solve_history([problem(force) for force in (0.5, 1.5, 0.2)])
    displacement, force = by_force.loop("plate")
    assert force == pytest.approx([0.5, 1.5, 0.2])
    by_displacement = solve_history([pressed_block(w) for w in displacement])
    assert by_displacement.loop("plate")[1] == pytest.approx(force, rel=1e-6)


def test_stops_at_the_first_step_without_an_answer():
    def dragged(shear):
        mesh = RectilinearMesh.rectangle((3, 2), WIDTH, HEIGHT)
        sides = [Traction("left", x=0.0, y=-shear), Traction("right", x=0.0, y=shear)]
        load = Traction("top", x=shear, y=-PRESSURE)
        return ContactProblem(mesh, Material(YOUNG, 0.3), [Contact("bottom", FRICTION, name="base"), load, *sides])

    history = solve_history([dragged(share * FRICTION * PRESSURE) for share in (0.5, 1.1, 0.5)])
    assert len(history.steps) == 2
    assert history.planned == 3
    assert history.status is Status.INFEASIBLE
    assert "step 2 of 3" in history.message
    assert "friction on 'base'" in history.message
    assert len(history.dissipated) == 1


def test_bad_steps_are_refused():
    with pytest.raises(InputError, match="at least one"):
        solve_history([])
    with pytest.raises(InputError, match="same mesh"):
        solve_history([pressed_block(0.0), pressed_block(0.0, cells=(4, 4))])
    with pytest.raises(InputError, match="same contacts"):
        solve_history([sheared_layer(0.0, (6, 4)), pressed_block(0.0)])
    with pytest.raises(InputError, match="name a contact"):
        solve_history([pressed_block(0.0)]).loop("left")


def dragged_block(u, shift=0.0):
    """A block pressed on rough ground and moved by its right side, the ground by `shift`."""
    mesh = RectilinearMesh.rectangle((4, 2), WIDTH, HEIGHT)
    sides = [Traction("top", x=0.0, y=-10.0), Traction("left", x=0.0, y=0.0), Displacement("right", x=u, y=0.0)]
    ground = Contact("bottom", FRICTION, offset=shift, name="ground")
    return ContactProblem(mesh, Material(YOUNG, 0.0), [ground, *sides])


class TestWhatDrives:
    """An obstacle at rest has no loop where displacements move the body; what moves it has one."""

    path = 0.05 * ramp(0.0, 1.0, -1.0, 1.0, steps=2)

    def test_an_obstacle_at_rest_is_told(self):
        history = solve_history([sheared_layer(u) for u in self.path])
        with pytest.raises(InputError, match="name what drives the body, 'top'"):
            history.loop("base")
        assert np.ptp(history.loop("top")[0]) > 0.0

    def test_what_is_moved_across_its_edges_has_a_loop(self):
        history = solve_history([dragged_block(u) for u in self.path])
        assert history.status is Status.SOLVED
        with pytest.raises(InputError, match="'right'"):
            history.loop("ground")
        displacement, force = history.loop("right")
        assert displacement == pytest.approx(self.path)
        ground = [step.contacts["ground"].tangential_force for step in history.steps]
        assert force == pytest.approx(-np.array(ground), abs=1e-6)  # nothing else acts along x
        assert loop_area(displacement, force) > 0.0

    def test_edges_that_slant_have_one_too(self):
        def dragged(u):
            flat = TriangleMesh.rectangle((4, 2), WIDTH, HEIGHT)
            x, y = flat.vertices.T
            slanted = np.column_stack([x + 0.2 * x * y, y])  # the right side leans
            mesh = TriangleMesh(slanted, flat.cells).with_edges(
                "right", lambda x, y: x > WIDTH * (1.0 + 0.2 * y) - 1e-9
            )
            mesh = mesh.with_edges("top", lambda _, y: y > HEIGHT - 1e-9).with_edges("left", lambda x, _: x < 1e-9)
            mesh = mesh.with_edges("bottom", lambda _, y: y < 1e-9)
            return ContactProblem(mesh, Material(YOUNG, 0.0), dragged_block(u).conditions)

        history = solve_history([dragged(u) for u in self.path])
        assert history.status is Status.SOLVED
        with pytest.raises(InputError, match="'right'"):
            history.loop("ground")
        displacement, force = history.loop("right")
        assert displacement == pytest.approx(self.path)
        ground = [step.contacts["ground"].tangential_force for step in history.steps]
        assert force == pytest.approx(-np.array(ground), abs=1e-6)

    def test_a_ground_that_moves_has_a_loop_whatever_else_moves(self):
        history = solve_history([dragged_block(u, shift=-u) for u in self.path])
        assert history.loop("ground")[0] == pytest.approx(-self.path)

    def test_loads_that_change_leave_the_loop_at_rest(self):
        problem = dragged_block(0.0)
        loads = [replace(problem, conditions=[*problem.conditions[:-1], Displacement("right", x=0.0, y=0.0)])] * 2
        assert solve_history(loads).loop("ground")[0].tolist() == [0.0, 0.0]

    def test_the_picture_shows_what_drives(self):
        plots = pytest.importorskip("qvi_contact.plots")
        pytest.importorskip("matplotlib")
        for problems, name in (
            ([sheared_layer(u) for u in self.path], "top"),
            ([dragged_block(u) for u in self.path], "right"),
        ):
            figure = plots.history_figure(solve_history(problems))
            assert figure.axes[0].get_title() == name


def test_callback_hears_of_every_step():
    heard = []
    history = solve_history(
        [pressed_block(w) for w in (0.0, 0.001)], callback=lambda n, result: heard.append((n, result))
    )
    assert heard == list(enumerate(history.steps, 1))


def test_steps_done_in_time_are_kept(clock):
    """A second a step: two are done in a second and a half, a third is not begun."""
    steps = [pressed_block(w) for w in (0.0, 0.001, 0.002)]
    history = solve_history(steps, callback=lambda *_: clock.passes(1.0), time_limit=1.5)
    assert [step.status for step in history.steps] == [Status.SOLVED, Status.SOLVED]
    assert history.status is Status.TIME_LIMIT
    assert history.message.startswith("time limit after 2 of 3 steps")


def test_no_time_for_the_first_step():
    late = solve_history([pressed_block(w) for w in (0.0, 0.001)], time_limit=1e-9)
    assert [step.status for step in late.steps] == [Status.TIME_LIMIT]
    assert late.status is Status.TIME_LIMIT


def test_a_step_at_rest_does_not_set_the_units():
    """Steel under its own weight from rest: stresses of 1e-8 E are as exact as alone."""

    def weighed(gravity):
        mesh = RectilinearMesh.rectangle((4, 4), 0.1, 0.1)
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


def test_corners_given_up_in_one_step_are_given_up_in_all():
    def driven(offset):
        mesh = RectilinearMesh.rectangle((3, 2), WIDTH, HEIGHT)
        sides = [Traction("left", x=0.0, y=8.0), Traction("right", x=0.0, y=-8.0)]
        held = Displacement("top", x=0.0, y=-0.01)
        return ContactProblem(mesh, Material(YOUNG, 0.3), [Contact("bottom", FRICTION, offset=offset), held, *sides])

    steps = [driven(w) for w in 0.03 * ramp(0.0, 1.0, -1.0, 1.0, -1.0, 1.0, steps=3)]
    history = solve_history(steps, element="bfs")  # whose corners have one shear for both sides
    assert history.status is Status.SOLVED
    freed = {tuple(step.discretization.freed.tolist()) for step in history.steps}
    assert len(freed) == 1
    assert len(freed.pop()) > 0
    _, force = history.loop("bottom")
    assert force[-6:] == pytest.approx(force[-12:-6], rel=1e-5, abs=1e-5)


def test_loop_of_a_plate_that_turns_does_not_depend_on_its_pivot():
    def pressed(force, pivot):
        base = pressed_block(0.0)
        driving = RigidPlate(
            force_x=force, force_y=-25.0, moment=-25.0 * (0.9 - pivot[0]) - force * (1.0 - pivot[1]), pivot=pivot
        )
        plate = Contact("top", FRICTION, name="plate", plate=driving)
        return replace(base, conditions=[plate, *base.conditions[1:]])

    loops = [
        solve_history([pressed(f, at) for f in (1.0, 3.0, -2.0)]).loop("plate") for at in ((1.0, 1.0), (5.0, -3.0))
    ]
    assert loops[1][0] == pytest.approx(loops[0][0], rel=1e-5)
    assert loops[1][1] == pytest.approx(loops[0][1], rel=1e-9)
