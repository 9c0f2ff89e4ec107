"""A wrong number is never called solved: graded cells, sizes far apart, stresses without interior, far obstacles."""

from functools import cache
from itertools import product

import numpy as np
import pytest

from qvi_contact import ContactState, InputError, TriangleMesh, discretize, solve
from qvi_contact.discretization import REACH
from qvi_contact.export import write_npz
from qvi_contact.files import load_result
from qvi_contact.gallery import compressed_plate, sliding_block
from qvi_contact.problem import Contact, ContactProblem, Material, Symmetry, Traction
from qvi_contact.solution import posed
from qvi_contact.verification import verify_result
from solvers import Status
from solvers.factorisation import ORTHOGONAL
from tests.effort import examples, thinned
from tests.qvi_contact.frictions import with_friction

STEEL = Material(1e3, 0.3)


@cache
def beside_an_obstacle(gap):
    """A pressed plate with an obstacle at a distance from its free side."""
    conditions = [
        Symmetry("left"),
        Symmetry("bottom"),
        Contact("right", friction=0.3, gap=gap),
        Contact("top", friction=0.3, gap=-1e-3),
    ]
    return solve(ContactProblem(TriangleMesh.rectangle((6, 6)), Material(2.09e5, 0.3), conditions))


@pytest.mark.parametrize("gap", [1.0, 1000.0])
def test_an_obstacle_far_away_does_not_swamp_the_contact(gap):
    near = solve(compressed_plate(0.3, (6, 6))).contacts["plate"].normal_force
    result = beside_an_obstacle(gap)
    assert result.status is Status.SOLVED
    # The corner node is shared, so its shear is not prescribed here: the same body, a slightly richer space.
    assert result.contacts["top"].normal_force == pytest.approx(near, rel=2e-3)
    assert result.contacts["right"].normal_force == pytest.approx(0.0, abs=1e-5)
    again = beside_an_obstacle(0.1).contacts["top"].normal_force
    assert result.contacts["top"].normal_force == pytest.approx(again, rel=1e-7)


@pytest.mark.parametrize("side", [1e5, 1e7])
def test_a_large_stress_elsewhere_does_not_hide_an_error_in_the_contact(side):
    """ν = 0: side pressure and contact pressure, here 1, do not feel each other."""
    mesh = TriangleMesh.rectangle((6, 4), grading=0.9)
    conditions = [
        Symmetry("left"),
        Symmetry("bottom"),
        Traction("right", x=-side, y=0.0),
        Contact("top", friction=0.0, gap=-1e-3),
    ]
    result = solve(ContactProblem(mesh, Material(1000.0, 0.0), conditions))
    assert result.status in ((Status.SOLVED,) if side <= 1e5 else (Status.SOLVED, Status.INACCURATE))
    assert result.contacts["top"].normal_stress == pytest.approx(-1.0, rel=1e-5)


def drawn_along(pressure, degree=None, rows=None):
    """A block pressed on a floor, and stretched to twice its width: it slides everywhere, by far."""
    conditions = [
        Contact("bottom", 0.3),
        Traction("top", 0.0, -pressure),
        Traction("right", 1.0, 0.0),
        Symmetry("left"),
    ]
    problem = ContactProblem(TriangleMesh.rectangle((4, 4)), Material(1.0, 0.0), conditions)
    return solve(problem, degree=degree, contact_rows=rows) if degree else solve(problem)


@pytest.mark.parametrize(("degree", "rows"), [(None, None), (4, "gauss"), (4, "bernstein"), (5, "bernstein")])
def test_small_pressures_beside_far_slips_are_certified_on_their_own_scale(degree, rows):
    results = [drawn_along(pressure, degree, rows) for pressure in (1e-3, 1e-5)]
    small, smaller = (result.contacts["bottom"].normal_stress for result in results)
    assert [result.status for result in results] == 2 * [Status.SOLVED]
    assert smaller == pytest.approx(1e-2 * small, rel=1e-6)


def test_the_stiffness_of_a_contact_does_not_depend_on_what_its_rows_are():
    gauss, bernstein = (drawn_along(0.1, 6, rows).solution.problem for rows in ("gauss", "bernstein"))
    assert bernstein.contact_stiffness == pytest.approx(gauss.contact_stiffness, rel=1e-9)


def test_tractions_that_count_as_none_are_remarked_on():
    seen, unseen = drawn_along(1e-5, 4), drawn_along(1e-8, 4)
    assert seen.remarks == ()
    assert unseen.status is Status.SOLVED
    assert len(unseen.remarks) == 1


@pytest.mark.parametrize("translation", [50.0, 5000.0])
def test_large_slip_is_solved(translation):
    problem, _ = sliding_block((3, 2), translation=translation)
    result = solve(problem)
    assert result.status in ((Status.SOLVED,) if translation <= 1e3 else (Status.SOLVED, Status.INACCURATE))
    assert result.contacts["base"].normal_force == pytest.approx(200.0, rel=1e-6)


def rectangle(bottom, *others, cells=(2, 2), size=(2.0, 2.0)):
    """A rectangle with this contact, and free where nothing else is said."""
    mesh = TriangleMesh.grid(*(np.linspace(0.0, length, n + 1) for length, n in zip(size, cells, strict=True)))
    said = {condition.edges for condition in (bottom, *others)}
    free = [Traction(side, 0.0, 0.0) for side in ("bottom", "right", "top", "left") if side not in said]
    return ContactProblem(mesh, STEEL, [bottom, *others, *free])


@pytest.mark.parametrize(
    ("gap", "friction", "cohesion"), thinned(product((0.0, 1e-3, 1.0, 1e9), (0.0, 0.3, 1e3), (0.0, 0.03, 1e6)), 9)
)
def test_a_body_that_nothing_presses_has_no_stress(gap, friction, cohesion):
    result = solve(rectangle(Contact("bottom", friction, gap=gap, cohesion=cohesion)))
    assert result.status == "solved"
    assert np.abs(result.gauss_stress()[2]).max() <= 1e-12 * STEEL.young


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
        """Pressed down on the bottom, with an obstacle at the right that stands `gap` away."""
        right = Contact("right", 0.4, gap=gap)
        return rectangle(Contact("bottom", 0.2), Traction("top", 0.0, -10.0), Symmetry("left"), right, cells=(4, 4))

    def test_an_obstacle_out_of_reach_changes_the_gap_alone(self):
        near, far = (solve(self.pressed(gap)) for gap in (1.0, 1e9))
        assert near.status == far.status == "solved"
        accuracy = 10.0 * near.certificate.tolerance  # both are certified to it, relative to a stress of 10
        assert far.gauss_stress()[2] == pytest.approx(near.gauss_stress()[2], abs=accuracy)
        assert far.contacts["right"].gap - near.contacts["right"].gap == pytest.approx(1e9 - 1.0, rel=1e-12)
        assert (far.contacts["right"].state == 0).all()

    def test_is_stored_and_verified(self, tmp_path):
        result = solve(self.pressed(1e9))
        write_npz(tmp_path / "far.npz", result)
        again = load_result(tmp_path / "far.npz")
        assert again.discretization.scales.reach == REACH
        assert again.contacts["right"].gap == pytest.approx(result.contacts["right"].gap)
        assert verify_result(again).passed

    def test_a_body_that_gets_there_is_stopped(self):
        """Pushed to the right without friction, it slides until the obstacle presses back, however far that is."""
        far = Contact("right", 0.0, gap=1e3 * 10.0 * 2.0 / STEEL.young)
        loads = [Traction("top", 0.0, -10.0), Traction("left", 4.0, 0.0)]
        result = solve(rectangle(Contact("bottom", 0.0), *loads, far, cells=(4, 4)))
        assert result.status == "solved"
        assert np.isinf(result.discretization.scales.reach)
        assert result.contacts["right"].normal_force == pytest.approx(8.0)
        assert np.abs(result.contacts["right"].gap).max() < 1e-6
        assert result.contacts["bottom"].slip == pytest.approx(20.0, abs=0.1)


BONDED = {
    (18, 0.6): 214.366845874428,
    (19, 0.6): 214.366846552723,
    (24, 0.6): 214.366847291526,
    (28, 0.6): 214.366847329517,
    (32, 0.65): 214.367238857135,
    (32, 0.8): 214.367623133544,
}
"""P/2 of the bonded plate on n² cells of a grading: discrete values by 200-bit arithmetic."""


STICK = ContactState.STICK


@cache
def meshed(cells, grading):
    """A plate on graded cells, in fitting units."""
    return posed(compressed_plate(1.0, (cells, cells), grading=grading))


def plate_on(cells, grading, friction):
    return with_friction(meshed(cells, grading), friction)


@cache
def condensed(friction, cells, grading):
    """Result by the condensed method, which several tests look at."""
    return solve(plate_on(cells, grading, friction), method="condensed")


def ratio(cells, grading):
    """Smallest cell over the largest."""
    return grading ** (cells - 1)


@pytest.mark.parametrize(("mesh", "friction"), thinned(product(BONDED, (1.0, 2.0, 20.0)), 6))
def test_full_stick_is_the_bonded_plate(mesh, friction):
    cells, grading = mesh
    result = condensed(friction, cells, grading)
    assert result.status is Status.SOLVED, result.message
    plate = result.contacts["plate"]
    assert (plate.state == STICK).all()
    accuracy = 1e-9 if ratio(cells, grading) > 0.99e-4 else 1e-6
    assert plate.normal_force == pytest.approx(BONDED[cells, grading], rel=accuracy)
    assert 2.0 * result.energies.strain == pytest.approx(1e-3 * BONDED[mesh], rel=1e-6)  # P U, by Clapeyron


@pytest.mark.parametrize(
    ("cells", "grading", "expected"),
    [(16, 0.7, False), (32, 0.8, False), (19, 0.6, True), (24, 0.6, True), (32, 0.65, True)],
)
def test_the_factorisation_used_is_named(cells, grading, expected):
    """QR where the assembled K is lost, the sparse Cholesky factorisation where it is good enough."""
    used = condensed(0.2, cells, grading).solution.factorisation
    assert used.startswith(f"{ORTHOGONAL}, ") == expected


@pytest.mark.parametrize(
    ("mesh", "friction"), thinned(product([(18, 0.6), (24, 0.6), (28, 0.6), (32, 0.65)], (0.0, 0.02, 0.2, 0.5, 1.0)), 8)
)
def test_few_iterations_and_a_force_between_slip_and_stick(mesh, friction):
    cells, grading = mesh
    result = condensed(friction, cells, grading)
    assert result.status is Status.SOLVED, result.message
    force = result.contacts["plate"].normal_force
    assert 209.0 * (1.0 - 1e-9) < force < BONDED[cells, grading] * (1.0 + 1e-9)
    if friction == 0.0:
        assert force == pytest.approx(209.0, rel=1e-9)
    slow = (cells, friction) == (28, 1.0)  # cells down to 1e-6 of the largest: its path is centred slowly
    assert result.iterations <= (60 if slow else 40)  # some ten of them for the gap that the smallest edges need


WITHOUT_ANSWER = (
    Status.ILL_CONDITIONED, Status.STALLED, Status.INACCURATE, Status.INNER_INFEASIBLE, Status.MAX_ITERATIONS,
)  # fmt: skip
"""How a method ends that rounding keeps from an answer; which of them, rounding decides as well."""


@pytest.mark.parametrize(
    ("cells", "grading", "friction"),
    [
        *((30, 0.6, friction) for friction in (0.0, 20.0)),
        (24, 0.5, 0.2),
        *((40, 0.6, friction) for friction in (0.0, 2.0)[: examples(1)]),  # stalls, which takes its time
        *((48, 0.6, friction) for friction in thinned([0.0, 20.0], 1)),  # refused
    ],
)
def test_beyond_double_precision_there_is_no_wrong_number(cells, grading, friction):
    """An error about the mesh, a status, or the right force; a result to look at is right to its stated accuracy."""
    assert ratio(cells, grading) < 1e-6
    problem = compressed_plate(friction, (cells, cells), grading=grading)
    try:
        result = solve(problem, method="condensed")
    except InputError:
        with pytest.raises(InputError, match=r"ContactProblem\.mesh.*less grading"):
            discretize(problem)
        return
    if result.status is not Status.SOLVED:
        assert result.status in WITHOUT_ANSWER
    if result.status in (Status.SOLVED, Status.INACCURATE):
        expected = {0.0: 209.0, 0.2: 214.2327}.get(friction, BONDED[28, 0.6])
        allowed = 1e-5 if result.status is Status.SOLVED else 1e3 * result.certificate.accuracy
        assert result.contacts["plate"].normal_force == pytest.approx(expected, rel=allowed)


@pytest.mark.parametrize(("cells", "grading"), thinned(BONDED, 3))
def test_inaccurate_results_are_nearly_right(cells, grading):
    """More is asked for than can be had: the force is right to a hundred times the stated accuracy, 1e-3 at worst."""
    result = solve(plate_on(cells, grading, 1.0), method="condensed", gap=1e-8, tolerance=1e-12)
    assert result.status in (Status.SOLVED, Status.INACCURATE)
    error = abs(result.contacts["plate"].normal_force / BONDED[cells, grading] - 1.0)
    assert error < max(100.0 * result.certificate.accuracy, 1e-9)
