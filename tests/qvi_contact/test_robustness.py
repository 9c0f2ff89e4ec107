"""A wrong number is never called solved: graded cells, sizes far apart, stresses without interior, far obstacles."""

from cProfile import Profile
from dataclasses import replace
from functools import cache
from itertools import product
from pstats import Stats

import numpy as np
import pytest
import qpsolvers

from qvi_contact import ContactState, Expression, InputError, SolveError, TriangleMesh, solve
from qvi_contact.discretization import REACH, discretize
from qvi_contact.export import write_npz
from qvi_contact.files import load_result
from qvi_contact.gallery import ExactState, compressed_plate, problem_from_state, sliding_block
from qvi_contact.plots import problem_figure
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, RigidPlate, Symmetry, Traction
from qvi_contact.verification import verify_result
from solvers import Status
from tests.cases import refused_at, thinned
from tests.qvi_contact.builders import solved, with_friction

STEEL = Material(1e3, 0.3)


@pytest.mark.parametrize("side", [1e5, 1e7])
def test_a_large_stress_elsewhere_does_not_hide_an_error_in_the_contact(side):
    """ν = 0: side pressure and contact pressure, here 1, do not feel each other."""
    mesh = TriangleMesh.rectangle((6, 4), grading=0.9)
    conditions = [
        Symmetry("left"), Symmetry("bottom"), Traction("right", x=-side, y=0.0),
        Contact("top", friction=0.0, gap=-1e-3),
    ]  # fmt: skip
    result = solve(ContactProblem(mesh, Material(1000.0, 0.0), conditions))
    assert result.status in ((Status.SOLVED,) if side <= 1e5 else (Status.SOLVED, Status.INACCURATE))
    assert result.contacts["top"].normal_stress == pytest.approx(-1.0, rel=1e-5)


def drawn_along(pressure, degree=None, rows=None):
    """A block pressed on a floor, and stretched to twice its width: it slides everywhere, by far."""
    conditions = [
        Contact("bottom", 0.3), Traction("top", 0.0, -pressure), Traction("right", 1.0, 0.0), Symmetry("left"),
    ]  # fmt: skip
    problem = ContactProblem(TriangleMesh.rectangle((4, 4)), Material(1.0, 0.0), conditions)
    return solve(problem, degree=degree, law_on=rows) if degree else solve(problem)


@pytest.mark.parametrize(("degree", "rows"), [(None, None), (4, "points"), (4, "edges"), (5, "edges")])
def test_small_pressures_beside_far_slips_are_certified_on_their_own_scale(degree, rows):
    results = [drawn_along(pressure, degree, rows) for pressure in (1e-3, 1e-5)]
    small, smaller = (result.contacts["bottom"].normal_stress for result in results)
    assert [result.status for result in results] == 2 * [Status.SOLVED]
    assert smaller == pytest.approx(1e-2 * small, rel=1e-6)


def test_the_stiffness_of_a_contact_depends_neither_on_what_its_rows_are_nor_on_rounding():
    """A block that nothing else holds: balance fixes uniform tractions, of which power iteration could make nothing."""
    gauss, bernstein = (drawn_along(0.1, 6, rows).solution.problem for rows in ("points", "edges"))
    assert bernstein.contact_stiffness == pytest.approx(gauss.contact_stiffness, rel=1e-9)
    loads = [Traction(side, normal=-float(side == "top"), tangential=0.0) for side in ("left", "right", "top")]
    block = ContactProblem(TriangleMesh.rectangle((4, 2), 2.0), Material(1e3, 0.2), [Contact("bottom", 0.3), *loads])
    gauss, bernstein = (discretize(block, law_on=rows).qvi.contact_stiffness for rows in ("points", "edges"))
    assert bernstein == pytest.approx(gauss, rel=1e-5)


def test_tractions_that_count_as_none_are_remarked_on():
    seen, unseen = drawn_along(1e-5, 4), drawn_along(1e-8, 4)
    assert unseen.status is Status.SOLVED
    assert [len(each.remarks) for each in (seen, unseen)] == [1, 2]  # one on its strain of 1


@pytest.mark.parametrize("translation", [50.0, 5000.0])
def test_large_slip_is_solved(translation):
    block, exact = sliding_block((3, 2))
    moved = ExactState(exact.stress, lambda x, y: exact.displacement(x, y) + np.stack([0 * x + translation, 0 * y]))
    sides = {"bottom": "cc", "right": "uu", "top": "tt", "left": "tt"}
    result = solve(problem_from_state(moved, block.mesh, block.material, sides, block.contacts))
    assert result.status in ((Status.SOLVED,) if translation <= 1e3 else (Status.SOLVED, Status.INACCURATE))
    assert result.contacts["base"].normal_force == pytest.approx(200.0, rel=1e-6)


def rectangle(bottom, *others, cells=(2, 2), size=(2.0, 2.0)):
    """A rectangle with this contact, and free where nothing else is said."""
    mesh = TriangleMesh.grid(*(np.linspace(0.0, length, n + 1) for length, n in zip(size, cells, strict=True)))
    said = {condition.edges for condition in (bottom, *others)}
    free = [Traction(side, 0.0, 0.0) for side in ("bottom", "right", "top", "left") if side not in said]
    return ContactProblem(mesh, STEEL, [bottom, *others, *free])


@pytest.mark.parametrize(
    ("gap", "friction", "cohesion"), thinned(product((0.0, 1e-3, 1.0, 1e9), (0.0, 0.3, 1e3), (0.0, 0.03, 1e6)), 4)
)
def test_a_body_that_nothing_presses_has_no_stress(gap, friction, cohesion):
    result = solve(rectangle(Contact("bottom", friction, gap=gap, cohesion=cohesion)))
    assert result.status == "solved"
    assert np.abs(result.gauss_stress()[2]).max() <= 1e-12 * STEEL.young


def test_a_body_that_supports_only_move_has_stresses_that_count_as_rounding():
    held = [Displacement("bottom", y=0.0), Displacement("top", x=2e-4, y=0.0), Traction("bottom", x=0.0)]
    free = [Traction(side, 0.0, 0.0) for side in ("left", "right")]
    moved = ContactProblem(TriangleMesh.rectangle((3, 2)), Material(1e3, 0.2), [*held, *free])
    result = solve(moved)
    assert np.abs(result.stress(*np.meshgrid([0.1, 0.5, 0.9], [0.1, 0.5, 0.9]))).max() < result.rounding.stress


@pytest.mark.parametrize(("friction", "load"), [(0.0, 0.0), (0.3, 0.0), (0.3, 1e-310), (0.0, Expression("1e-320"))])
def test_gaps_that_only_move_plates_and_the_least_loads_stress_nothing(friction, load):
    """What gaps do to the body cancels but for rounding, which is no scale of a stress; nor is a strain below 1e-60."""
    plates = [
        Contact("bottom", friction, gap=1e-3, plate=RigidPlate(force_y=0.0, moment=0.0, pivot=(2.4, 0.8))),
        Contact("top", friction, gap=0.3, plate=RigidPlate(force_x=0.0, force_y=0.0, moment=0.0, pivot=(1.7, 0.9))),
    ]
    sides = [Displacement("left", x=0.0), Traction("left", y=0.0), Traction("right", 0.0, load)]
    result = solve(ContactProblem(TriangleMesh.rectangle((3, 3)), Material(1.0, 0.2, "stress"), [*sides, *plates]))
    assert result.status is Status.SOLVED
    assert np.abs(result.stress([0.3, 0.7], [0.2, 0.6])).max() < 1e-20
    assert abs(result.bracket.gap) < 1e-20
    problem_figure(result.problem)


def test_a_side_whose_resultant_is_zero_carries_nothing():
    """The bottom could only pull to balance what is in balance already: the one admissible pressure is zero."""
    squeezed = [Traction("left", 5.0, 0.0), Traction("right", -5.0, 0.0)]
    result = solve(rectangle(Contact("bottom", 0.3), *squeezed, cells=(4, 3)))
    line = result.contacts["bottom"]
    assert result.status == "solved"
    assert np.abs(line.normal_stress).max() < 1e-8
    assert result.stress(1.0, 1.0) == pytest.approx([-5.0, 0.0, 0.0], abs=1e-8)


class TestReach:
    """Obstacles that the body does not get to, and one that it does."""

    def pressed(self, gap):
        """Pressed down on the bottom, with a fluid and an obstacle at the right that stands `gap` away."""
        right = Contact("right", 0.4, gap=gap, pore_pressure=0.5)
        return rectangle(Contact("bottom", 0.2), Traction("top", 0.0, -10.0), Symmetry("left"), right, cells=(4, 4))

    def test_an_obstacle_out_of_reach_changes_the_gap_alone_and_is_stored_and_verified(self, tmp_path):
        near, far = (solved(self.pressed(gap), 1e-8) for gap in (1.0, 1e9))
        accuracy = 10.0 * near.certificate.tolerance  # both are certified to it, relative to a stress of 10
        assert far.gauss_stress()[2] == pytest.approx(near.gauss_stress()[2], abs=accuracy)
        assert far.contacts["right"].gap - near.contacts["right"].gap == pytest.approx(1e9 - 1.0, rel=1e-12)
        assert (far.contacts["right"].state == 0).all()
        assert far.energies.complementary == pytest.approx(near.energies.complementary, rel=1e-6)
        assert far.bracket.relative_error == pytest.approx(near.bracket.relative_error, rel=1e-5)  # of all energies
        write_npz(tmp_path / "far.npz", far)
        again = load_result(tmp_path / "far.npz")
        assert again.discretization.scales.reach == REACH
        assert again.contacts["right"].gap == pytest.approx(far.contacts["right"].gap)
        assert verify_result(again).passed

    def test_a_body_that_gets_there_is_stopped(self):
        """Pushed to the right without friction, it slides until the obstacle presses back, however far that is."""
        far = Contact("right", 0.0, gap=1e3 * 10.0 * 2.0 / STEEL.young)
        loads = [Traction("top", 0.0, -10.0), Traction("left", 4.0, 0.0)]
        result = solved(rectangle(Contact("bottom", 0.0), *loads, far, cells=(4, 4)))
        assert np.isinf(result.discretization.scales.reach)
        assert result.contacts["right"].normal_force == pytest.approx(8.0)
        assert np.abs(result.contacts["right"].gap).max() < 1e-6
        assert result.contacts["bottom"].slip == pytest.approx(20.0, abs=0.1)


BONDED = 214.367658387
"""P/2 of the bonded plate, settled by degrees up to 9; coarse cells away from the corner are 5e-7 off."""
STICK = ContactState.STICK


@cache
def meshed(depth):
    """The paper's plate on 2 × 2 cells, its triangles at the free corner halved so often, in fitting units."""
    problem = compressed_plate(1.0, (2, 2))
    return discretize(replace(problem, mesh=problem.mesh.graded([(1.0, 1.0)], depth)))


@cache
def condensed(friction, depth):
    """Result by the condensed method, which several tests look at."""
    return solve(with_friction(meshed(depth), friction), method="condensed")


@pytest.mark.parametrize(("depth", "friction"), [(8, 1.0), (32, 20.0)])
def test_full_stick_is_the_bonded_plate(depth, friction):
    result = condensed(friction, depth)
    assert result.status is Status.SOLVED, result.message
    plate = result.contacts["plate"]
    assert (plate.state == STICK).all()
    assert plate.normal_force == pytest.approx(BONDED, rel=1e-6)
    assert 2.0 * result.energies.strain == pytest.approx(1e-3 * plate.normal_force, rel=1e-9)  # P U, by Clapeyron


@pytest.mark.parametrize(("friction", "expected"), [(0.0, 209.0), (0.2, 214.232587)])
def test_the_smallest_cells_that_there_are_give_no_wrong_number(friction, expected):
    """Cells of 2⁻³² of the plate: solved or nearly so, and right; smaller ones are refused."""
    result = condensed(friction, 32)
    assert result.status in (Status.SOLVED, Status.INACCURATE)
    assert result.contacts["plate"].normal_force == pytest.approx(expected, rel=1e-8)
    with pytest.raises(InputError, match="depth"):
        compressed_plate(friction, (2, 2)).mesh.graded([(1.0, 1.0)], 60)


@pytest.mark.parametrize("form", ["full", "condensed"])
def test_the_fixed_point_in_units_far_too_large_on_meshes_graded_to_a_corner(form):
    """Tolerances of inner solvers are absolute; the unit of their problems is the bonded stress."""
    plate = compressed_plate(0.0, (2, 2))
    known = discretize(replace(plate, mesh=plate.mesh.graded([(1.0, 1.0)], 10)))
    large = discretize(known.problem, scales=replace(known.scales, stress=1e6 * known.scales.stress))
    assert solve(large, method="fixed-point", form=form).status is Status.SOLVED


def test_inaccurate_results_are_nearly_right():
    """More is asked for than can be had: the force is right to a hundred times the stated accuracy, 1e-3 at worst."""
    result = solve(with_friction(meshed(20), 20.0), method="condensed", gap=1e-8, tolerance=1e-12)
    assert result.status in (Status.SOLVED, Status.INACCURATE)
    error = abs(result.contacts["plate"].normal_force / condensed(20.0, 20).contacts["plate"].normal_force - 1.0)
    assert error < max(100.0 * result.certificate.accuracy, 1e-9)


def test_a_start_from_an_earlier_result_is_in_physical_units():
    """Started from the answer, or from that of half the load scaled up, the first residual is that of the answer."""
    first = solve(compressed_plate(0.2, (6, 6)))
    half = solve(compressed_plate(0.2, (6, 6), displacement=0.5e-3))
    pressure = -first.contacts["plate"].normal_stress
    for initial in (first, pressure, -2.0 * half.contacts["plate"].normal_stress):
        again = solve(compressed_plate(0.2, (6, 6)), method="fixed-point", initial=initial)
        assert again.status is Status.SOLVED
        assert again.iterations <= 2
        assert again.history[0].residual < 1e-7
    with refused_at("initial", "the same mesh"):
        solve(compressed_plate(0.2, (6, 5)), method="condensed", initial=first)


def test_claims_of_infeasibility_are_checked(monkeypatch):
    """A back end that says infeasible of a problem with a solution has failed, not proved anything."""

    def liar(problem, *_, **__):
        return qpsolvers.Solution(problem, found=False, extras={"status": "PrimalInfeasible"})

    monkeypatch.setattr(qpsolvers, "solve_problem", liar)
    result = solve(compressed_plate(0.2), inner="qp:clarabel")
    assert result.status is Status.BACKEND_FAILED
    assert "nothing proves it" in result.message


def test_the_state_when_the_time_is_over_is_a_state():
    """Whatever it is worth is what its certificate says."""
    result = solve(compressed_plate(0.2, (6, 6)), time_limit=1e-9)
    assert result.status is Status.TIME_LIMIT
    assert result.has_state
    assert 1e-8 < result.certificate.accuracy < np.inf
    assert result.contacts["plate"].normal_force > 100.0
    with pytest.raises(SolveError, match="time limit"):
        solve(compressed_plate(0.2, (6, 6)), time_limit=1e-9, throw=True)


def test_options_of_all_methods_keep_the_default():
    """A callback, a limit and a start are no choice of a method."""
    first = solve(compressed_plate(0.2, (6, 6)))
    seen = []
    again = solve(compressed_plate(0.2, (6, 6)), initial=first, callback=seen.append, max_iterations=50, time_limit=60)
    assert again.solution.method == first.solution.method == "pivoting"
    assert len(seen) == again.iterations == 1
    assert seen[0].inner_iterations < first.history[0].inner_iterations


def test_a_small_solve_stays_short():
    """Calls of Python and built-in functions, 10 % above what they were last; fewer are welcome, and then the limit."""
    problems = [compressed_plate(0.2, (4, 4)) for _ in range(3)]
    for problem in problems[:2]:  # so that nothing is imported
        solve(problem)
    for problem, most in ((problems[2], 10_900), (problems[1], 5_750)):  # on a new mesh, and on one solved on before
        profile = Profile()
        profile.runcall(solve, problem)
        assert Stats(profile).total_calls <= most
