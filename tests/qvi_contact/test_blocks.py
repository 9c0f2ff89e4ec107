"""Bodies of many blocks: limits that are known by hand, and states of their joints."""

import numpy as np
import pytest

from qvi_contact import InputError, TriangleMesh, discretize, limit_load_factor, solve
from qvi_contact.gallery import jointed_slope, masonry_wall
from qvi_contact.mechanism import find_mechanism
from qvi_contact.problem import Contact, ContactProblem, Material, Traction
from solvers import Status

BLOCK, COURSE, WEIGHT = 0.5, 0.25, 20.0


def sliding_factor(rows, crest, friction, cohesion):
    """The multiple of the water's thrust at which all above the lowest bedding plane slides, by hand."""
    dip, rise, end = np.radians(30.0), 12.0 / (2 * rows), rows + crest
    run = rise / np.tan(dip)
    x, y = np.array([(0.0, 0.0), (end, end), (end, 2 * rows), (rows, 2 * rows)]).T * np.array([[run], [rise]])
    weight = 25.0 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0
    thrust, length = 10.0 * ((rows - crest) * rise) ** 2 / 2.0, end * np.hypot(run, rise)
    holds = cohesion * length + weight * (friction * np.cos(dip) - np.sin(dip))
    return holds / (thrust * (np.cos(dip) + friction * np.sin(dip)))


@pytest.mark.parametrize(("blocks", "friction"), [(1, 0.3), (3, 0.6)])
def test_a_wall_without_openings_slides(blocks, friction):
    limit = limit_load_factor(masonry_wall(4, blocks, (), friction=friction, wind=1.0), ["wind"])
    exact = friction * WEIGHT * blocks * BLOCK
    assert (limit.lower, limit.upper) == (pytest.approx(exact, rel=1e-6), pytest.approx(exact, rel=1e-9))
    assert limit.mechanism.contacts["beds"].slides or limit.mechanism.contacts["ground"].slides


def test_a_stack_tips():
    limit = limit_load_factor(masonry_wall(4, 1, (), friction=2.0, wind=1.0), ["wind"])
    exact = WEIGHT * BLOCK**2 / (4 * COURSE)
    assert limit.upper == pytest.approx(exact, rel=1e-9)
    assert 0.7 * exact < limit.lower < exact  # the pressure at the toe is spread over the last edge
    assert max(abs(motion.rotation) for motion in limit.mechanism.motions) > 0.1


def test_a_wall_with_openings():
    """Joints in all three states, carried weight, and a limit between its two sides."""
    result = solve(masonry_wall())
    assert result.status is Status.SOLVED
    ground, heads = result.contacts["ground"], result.contacts["heads"]
    assert ground.normal_force == pytest.approx(WEIGHT * BLOCK / 2.0 * COURSE * (8 * 12 - 8 - 9), rel=1e-9)
    assert ground.tangential_force == pytest.approx(-2.0 * 8 * COURSE, rel=1e-9)
    assert all(heads.shares[state] > 0.1 for state in ("open", "slip", "stick"))
    limit = limit_load_factor(result.problem, ["wind"])
    assert 9.4 < limit.lower < limit.upper < 10.3
    assert limit.upper < 0.6 * WEIGHT * 6 * BLOCK / 2.0  # openings weaken it
    assert len(limit.mechanism.motions) == 44


def test_cohesion_holds_a_wall():
    """By c at most, along a bed."""
    limits = [
        limit_load_factor(masonry_wall(2, 2, (), friction=0.3, wind=1.0, **more), ["wind"]).upper
        for more in ({}, {"cohesion": 1.0})
    ]
    assert limits[0] == pytest.approx(0.3 * WEIGHT * 2 * BLOCK, rel=1e-9)
    assert limits[0] < limits[1] <= limits[0] + 1.0 * 2 * BLOCK / 0.5 + 1e-9


@pytest.mark.parametrize(
    "openings",
    [((0, 0, 2, 2),), ((3, 5, 2, 3),), ((10, 0, 2, 2),), ((2, 0, 2, 2), (4, 0, 2, 2)), ((1, 0, 2),), ((1, 0, 1.5, 2),)],
)
def test_openings_that_do_not_fit(openings):
    with pytest.raises(InputError, match="openings"):
        masonry_wall(openings=openings)


@pytest.mark.parametrize(("rows", "crest", "cohesion"), [(4, 1, 0.0), (6, 2, 5.0)])
def test_a_slope_slides_by_hand_from_both_sides(rows, crest, cohesion):
    limit = limit_load_factor(jointed_slope(rows, crest, cohesion=cohesion), ["water"])
    exact = sliding_factor(rows, crest, 0.7, cohesion)
    assert (limit.lower, limit.upper) == (pytest.approx(exact, rel=1e-6), pytest.approx(exact, rel=1e-9))
    assert limit.mechanism.contacts["bedding"].slides


@pytest.mark.parametrize("dip", [20.0, 30.0])
def test_a_dry_slope_has_the_factor_of_safety_of_a_plane(dip):
    """The factor is tan φ/tan β: friction divided by less holds the weight, divided by more it does not."""
    factor = 0.7 / np.tan(np.radians(dip))
    holds, slides = (
        jointed_slope(3, 1, dip=dip, friction=0.7 / (factor * share), crack_water=0.0) for share in (0.999, 1.001)
    )
    assert find_mechanism(holds) is None
    assert find_mechanism(slides).contacts["bedding"].slides
    assert limit_load_factor(slides, ["body"]).upper == 0.0
    assert solve(slides).status is Status.INFEASIBLE


@pytest.mark.parametrize("wrong", [{"crest": 6}, {"rows": 0}, {"dip": 80.0}])
def test_slopes_that_are_none(wrong):
    with pytest.raises(InputError):
        jointed_slope(**wrong)


def test_joints_that_open_have_forces_in_balance():
    """Where a wall is soft little force out of balance is much stress: the method itself has to balance it.

    Sparse steps that compute multipliers from all of a step leave 3e-11 to 2e-10 here, by processor; added up, 5e-14.
    """
    result = solve(masonry_wall(5, 5, [(3, 0, 2, 3)], friction=0.3), method="condensed", system="sparse")
    assert result.status is Status.SOLVED
    assert result.solution.certificate.measures["stationarity"] <= 1e-12


def test_each_bed_is_a_contact():
    """Their points have no unknown in common; head joints connect those of a masonry wall."""
    mesh = TriangleMesh.rectangle((4, 9), 1.0, 3.0).with_joint("a", lambda _, y: np.isclose(y, 1.0))
    contacts = [Contact(name, 0.6) for name in ("bottom", "a", "b")]
    loads = [Traction("left", 1.0, 0.0), Traction("right", 0.0, 0.0), Traction("top", 0.0, -1.0)]
    wall = ContactProblem(
        mesh.with_joint("b", lambda _, y: np.isclose(y, 2.0)), Material(1e3, 0.2), [*contacts, *loads]
    )
    contacts = discretize(wall).qvi.contact.contacts
    assert np.unique(contacts, return_counts=True)[1].tolist() == [len(contacts) // 3] * 3
    assert set(discretize(masonry_wall(2, 2, ())).qvi.contact.contacts) == {0}
