"""Admissible stresses without interior, bodies at rest, obstacles out of reach: solved by default."""

from itertools import product

import numpy as np
import pytest

from qvi_contact import Contact, ContactProblem, Material, RectilinearMesh, Symmetry, Traction, solve
from qvi_contact.discretization.scaling import REACH
from qvi_contact.export import write_npz
from qvi_contact.files.stored import load_result
from qvi_contact.verification import verify_result
from tests.effort import thinned

STEEL = Material(1e3, 0.3)


def rectangle(bottom, *others, cells=(2, 2), size=(2.0, 2.0)):
    """A rectangle with this contact, and free where nothing else is said."""
    mesh = RectilinearMesh(*(np.linspace(0.0, length, n + 1) for length, n in zip(size, cells, strict=True)))
    said = {condition.edges for condition in (bottom, *others)}
    free = [Traction(side, 0.0, 0.0) for side in ("bottom", "right", "top", "left") if side not in said]
    return ContactProblem(mesh, STEEL, [bottom, *others, *free])


@pytest.mark.parametrize(
    ("gap", "friction", "cohesion"), thinned(product((0.0, 1e-3, 1.0, 1e9), (0.0, 0.3, 1e3), (0.0, 0.03, 1e3)), 16)
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

    @pytest.mark.parametrize("method", [None, "condensed"])
    def test_a_cell_without_unknowns_that_is_pulled_off_it(self, method):
        """No unknown is undefined where there is none: that does not make a state."""
        free = [Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)]
        conditions = [Contact("top", 0.3, gap=1e3), Traction("bottom", 0.0, -1.0), *free]
        cell = RectilinearMesh.rectangle((1, 1))
        result = solve(ContactProblem(cell, STEEL, conditions), element="bfs", method=method)
        assert result.discretization.qvi.n == 0
        assert result.status == "infeasible"
        assert not result.has_state
