"""Bodies of many blocks: limits that are known by hand, and states of their joints."""

import numpy as np
import pytest

from qvi_contact import TriangleMesh, discretize, limit_load_factor, solve
from qvi_contact.gallery import jointed_slope, masonry_wall
from qvi_contact.mechanism import find_mechanism
from qvi_contact.problem import Contact, ContactProblem, Material, Traction
from solvers import Status

BLOCK, COURSE, WEIGHT = 0.5, 0.25, 20.0


def test_a_stack_tips():
    limit = limit_load_factor(masonry_wall(4, 1, (), friction=2.0, wind=1.0), ["wind"])
    exact = WEIGHT * BLOCK**2 / (4 * COURSE)
    assert limit.upper == pytest.approx(exact, rel=1e-9)
    assert 0.7 * exact < limit.lower < exact  # the pressure at the toe is spread over the last edge
    assert max(abs(motion.rotation) for motion in limit.mechanism.motions) > 0.1


@pytest.mark.parametrize("dip", [20.0, 30.0])
def test_a_dry_slope_has_the_factor_of_safety_of_a_plane(dip):
    """The factor is tan φ/tan β: friction divided by less holds the weight, divided by more it does not."""
    factor = 0.7 / np.tan(np.radians(dip))
    holds, slides = (
        jointed_slope(3, 1, dip=dip, friction=0.7 / (factor * share), crack_water=0.0) for share in (0.999, 1.001)
    )
    assert find_mechanism(holds) is None
    assert find_mechanism(slides).contacts["bedding"].slides
    assert (found := limit_load_factor(slides, ["body"])).lower == found.upper == 0.0
    assert solve(slides).status is Status.INFEASIBLE


def test_joints_that_open_have_forces_in_balance():
    """Where a wall is soft little force out of balance is much stress: the method itself has to balance it.

    Sparse steps that compute multipliers from all of a step leave 3e-11 to 2e-10 here, by processor; added up, 5e-14.
    """
    result = solve(masonry_wall(5, 5, [(3, 0, 2, 3)], friction=0.3), method="condensed", system="sparse")
    assert result.status is Status.SOLVED
    assert result.solution.certificate.measures["stationarity"] <= 1e-12


WALL = masonry_wall(4, 6, (), friction=0.5)


def test_an_iteration_ends_where_forces_out_of_balance_make_no_stress(monkeypatch):
    """As on walls of 49 152 points, where forces do not come to their floor; here the floor is out of reach."""
    usual = solve(WALL, method="condensed", system="sparse")
    for floor in ("_FORCE", "_FORCE_FLOOR"):
        monkeypatch.setattr(f"solvers.condensed.method.{floor}", 1e-18)
    result = solve(WALL, method="condensed", system="sparse")
    assert result.status is Status.SOLVED
    assert result.iterations <= usual.iterations + 10  # 20 more without it


def test_a_wall_that_is_stopped_has_the_answer_so_far():
    whole, part = (solve(WALL, method="condensed", system="sparse", max_iterations=most) for most in (100, 6))
    assert (whole.status, part.status, part.iterations) == (Status.SOLVED, Status.MAX_ITERATIONS, 6)
    assert part.message.startswith("max iterations after 6 iterations; certificate failed")
    assert "raise max_iterations" in part.message
    assert 1e-8 < part.certificate.accuracy < 1e-2
    for name, line in whole.contacts.items():
        assert part.contacts[name].normal_force == pytest.approx(line.normal_force, rel=1e-3)


def test_each_bed_is_a_contact():
    """Their points have no unknown in common; head joints connect those of a masonry wall."""
    mesh = TriangleMesh.rectangle((4, 9), 1.0, 3.0)
    for name, level in (("a", 1.0), ("b", 2.0)):
        mesh = mesh.with_joint(name, lambda _, y, level=level: np.isclose(y, level))
    contacts = [Contact(name, 0.6) for name in ("bottom", "a", "b")]
    loads = [Traction("left", 1.0, 0.0), Traction("right", 0.0, 0.0), Traction("top", 0.0, -1.0)]
    contacts = discretize(ContactProblem(mesh, Material(1e3, 0.2), [*contacts, *loads])).qvi.contact.contacts
    assert np.unique(contacts, return_counts=True)[1].tolist() == [len(contacts) // 3] * 3
    assert set(discretize(masonry_wall(2, 2, ())).qvi.contact.contacts) == {0}
