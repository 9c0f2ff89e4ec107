"""Several body forces by name: together one potential, each a load that can be multiplied."""

import copy
import pickle

import numpy as np
import pytest

from qvi_contact import (
    BodyForces,
    Contact,
    ContactProblem,
    Expression,
    InputError,
    Material,
    Traction,
    TriangleMesh,
    limit_load_factor,
    solve,
    solve_sweep,
)
from qvi_contact.files import problem_from_toml, problem_to_toml

FORCES = {"weight": Expression("2 * y"), "quake": Expression("-2 * x")}


def block(potential, mu=0.3):
    """A block on a rough base: an acceleration along x of μ times gravity drags it off."""
    conditions = [Contact("bottom", mu), *(Traction(name, x=0, y=0) for name in ("left", "right", "top"))]
    return ContactProblem(TriangleMesh.rectangle((4, 2), 4.0, 1.0), Material(10.0, 0.3), conditions, potential)


def test_each_force_is_a_load_of_its_own():
    problem = block(BodyForces(FORCES))
    limit = limit_load_factor(problem, ["quake"])
    assert limit.upper == pytest.approx(0.3, rel=1e-9)
    assert limit.lower == pytest.approx(0.3, rel=1e-6)
    assert {"weight", "quake"} < set(limit.mechanism.works)
    assert limit_load_factor(problem, ["body"]).upper == limit_load_factor(problem, ["weight", "quake"]).upper
    with pytest.raises(InputError, match="weight"):
        limit_load_factor(problem, ["wieght"])


def test_together_they_are_one_potential():
    forces = BodyForces({"weight": Expression("2 * y"), "quake": Expression("-0.2 * x"), "constant": 1.0})
    one, several = (solve(block(potential)) for potential in (Expression("2 * y - 0.2 * x + 1"), forces))
    assert several.status == "solved"
    assert several.stress([1.0, 2.5], [0.2, 0.7]) == pytest.approx(one.stress([1.0, 2.5], [0.2, 0.7]), abs=1e-9)


def test_a_sweep_scales_one_of_them():
    sweep = solve_sweep(block(BodyForces(FORCES)), "load", [0.1, 0.2], of=["quake"])
    shear = [result.contacts["bottom"].tangential_force for result in sweep.steps]
    assert np.abs(shear) == pytest.approx([0.8, 1.6], rel=1e-6)  # of the weight 2 · 4


def test_files_hold_them():
    problem = block(BodyForces({**FORCES, "more": 0.5}))
    text = problem_to_toml(problem)
    assert problem_from_toml(text).problem.body_potential == problem.body_potential
    with pytest.raises(InputError) as caught:
        problem_from_toml(text.replace("version = 1", "version = 1\nbody_potential = 1.0"))
    assert caught.value.field == "body_potential"
    with pytest.raises(InputError) as caught:
        problem_from_toml(text.replace("weight =", '"body" ='))
    assert caught.value.field == "body_forces"


def test_they_can_be_copied_and_are_checked():
    forces = BodyForces(FORCES)
    assert pickle.loads(pickle.dumps(forces)) == forces == copy.deepcopy(forces)
    for wrong in ({}, [1.0], {"body": 1.0}, {"": 1.0}, {"weight": "y"}):
        with pytest.raises(InputError):
            BodyForces(wrong)
