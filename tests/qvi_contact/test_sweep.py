"""Sweeps: the answers of single solves, one factorisation, and what a failing value or the time does."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from click.testing import CliRunner

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    Traction,
    TriangleMesh,
    solve,
    solve_sweep,
)
from qvi_contact.basics import Units
from qvi_contact.command import group
from qvi_contact.gallery import compressed_plate
from solvers import Status


def pushed(shear=0.1, friction=0.3):
    """A block pressed on the ground, and pushed to the side by its upper and right side."""
    mesh = TriangleMesh.rectangle((3, 2), 2.0, 1.0)
    sides = [Traction("left", x=0.0, y=-shear), Traction("right", x=0.0, y=shear)]
    top = [Traction("top", x=shear, y=-1.0, name="push")]
    return ContactProblem(mesh, Material(1e3, 0.2), [Contact("bottom", friction, name="base"), *top, *sides])


PLATE = compressed_plate(0.2, (4, 4))

SWEEPS = {
    "friction": ((0.1, 0.3, 0.2), lambda mu: compressed_plate(mu, (4, 4))),
    "gap": ((0.0, -1e-4, 1e-4), lambda shift: compressed_plate(0.2, (4, 4), displacement=1e-3 - shift)),
    "offset": (
        (0.0, 2e-5),
        lambda w: replace(
            PLATE, conditions=[replace(c, offset=w) if isinstance(c, Contact) else c for c in PLATE.conditions]
        ),
    ),
}


@pytest.mark.parametrize("parameter", SWEEPS)
def test_every_value_has_the_answer_of_a_solve_of_its_own(parameter):
    values, single = SWEEPS[parameter]
    sweep = solve_sweep(PLATE, parameter, values)
    assert sweep.status is Status.SOLVED
    for value, step in zip(values, sweep.steps, strict=True):
        alone = solve(single(value))
        line, expected = step.contacts["plate"], alone.contacts["plate"]
        assert step.certificate.passed
        assert line.normal_force == pytest.approx(expected.normal_force, rel=1e-10)
        assert line.tangential_force == pytest.approx(expected.tangential_force, abs=1e-10 * expected.normal_force)
        assert step.energies.strain == pytest.approx(alone.energies.strain, rel=1e-10)


def test_all_values_share_one_matrix_and_its_elimination():
    steps = solve_sweep(PLATE, "friction", [0.1, 0.2, 0.3, 0.4], factorisation="superlu").steps
    first, *others = (step.discretization.qvi for step in steps)
    assert all(qvi.K is first.K and qvi.stiffness is first.stiffness for qvi in others)


def test_starts_near_the_answer_are_kept_and_others_tried_ever_more_seldom():
    """A punch whose contact grows with each value."""
    sides = [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
    punch = Contact("top", 0.3, lambda x, y: 0.02 * (x - 1.0) ** 2 + 0.0 * y)
    mesh = TriangleMesh.rectangle((6, 2), 2.0, 1.0)
    layer = ContactProblem(mesh, Material(1e3, 0.3), [punch, Displacement("bottom", x=0.0, y=0.0), *sides])
    depths = -0.001 * np.array([1.0, 3.0, 6.0, 10.0, 15.0, 20.0, 30.0, 40.0])
    warm, cold = (solve_sweep(layer, "gap", depths, warm_start=warm) for warm in (True, False))
    near = [step.solution.near for step in warm.steps]
    assert [step.solution.near for step in cold.steps] == [None] * 8
    assert near[0] is None
    assert {False, None} <= set(near[1:])
    more = [one.iterations - other.iterations for one, other in zip(warm.steps, cold.steps, strict=True)]
    assert [number for number, extra in enumerate(more) if extra] == [k for k, one in enumerate(near) if one is False]
    near = solve_sweep(layer, "gap", [-0.02, -0.0201, -0.0202])
    assert [step.solution.near for step in near.steps] == [None, True, True]


def test_a_load_factor_multiplies_named_loads():
    problem = pushed(shear=0.0)
    base, top, *sides = problem.conditions
    problem = replace(problem, conditions=[base, replace(top, x=0.1), *sides])
    found = solve_sweep(problem, "load", [0.5, 2.0], of=["push"])
    for factor, step in zip(found.values, found.steps, strict=True):
        line = step.contacts["base"]
        assert (line.normal_force, abs(line.tangential_force)) == pytest.approx((2.0 * factor, 0.2 * factor), abs=1e-8)


def test_a_value_without_an_answer_does_not_end_the_sweep():
    seen = []
    problem = pushed()
    sweep = solve_sweep(problem, "friction", [0.5, 0.05, 0.4], callback=lambda number, _: seen.append(number))
    assert seen == [1, 2, 3]
    assert [step.status is Status.SOLVED for step in sweep.steps] == [True, False, True]
    assert sweep.status is sweep.steps[1].status is Status.INFEASIBLE
    assert "friction = 0.05" in sweep.message


def test_the_time_limit_keeps_what_was_done(clock):
    sweep = solve_sweep(PLATE, "friction", [0.1, 0.2, 0.3], callback=lambda *_: clock.passes(1.0), time_limit=0.5)
    assert len(sweep.steps) == 1
    assert sweep.status is Status.TIME_LIMIT


def test_as_a_table():
    frame = solve_sweep(PLATE, "gap", [0.0, -1e-4]).to_frame(Units("mm", "MPa"))
    assert frame["gap [mm]"].tolist() == [0.0, -1e-4]
    assert frame["contact"].tolist() == ["plate", "plate"]
    forces = frame[[name for name in frame if name.startswith("normal_force")]].to_numpy().ravel()
    assert forces[1] > forces[0]


@pytest.mark.parametrize(
    ("parameter", "values", "of", "field"),
    [("mu", [0.1], None, "parameter"), ("friction", [], None, "values"), ("friction", [-0.1], None, "values"),
     ("gap", [np.nan], None, "values"), ("gap", 1.0, None, "values"), ("gap", "0.1", None, "values"),
     ("friction", [0.1], ["base"], "of"), ("friction", [0.1], "plate", "of"), ("load", [1.0], ["base"], "of"),
     ("load", [1.0], [], "of")],
)  # fmt: skip
def test_bad_sweeps_are_refused(parameter, values, of, field):
    with pytest.raises(InputError) as caught:
        solve_sweep(PLATE, parameter, values, of)
    assert caught.value.field == field


def test_values_by_way_of_a_history_are_other_problems():
    """A sweep of offsets up and down ends where it began; a history does not."""
    path = [0.0, 3e-4, 0.0]
    forces = [step.contacts["plate"].tangential_force for step in solve_sweep(PLATE, "offset", path).steps]
    assert forces[2] == pytest.approx(forces[0], rel=1e-8)
    assert all(abs(one - other) > 1e-3 * abs(one) for one, other in pairwise(forces))


def command(*arguments):
    """Exit status and output of qvi-contact."""
    outcome = CliRunner().invoke(group, [str(word) for word in arguments], standalone_mode=False)
    if isinstance(outcome.exception, InputError):
        return 2, str(outcome.exception)
    assert outcome.exception is None, outcome.output
    return outcome.return_value, outcome.output
