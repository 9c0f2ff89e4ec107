"""A fluid in a contact: the law holds for the effective stress, everything else for the total one."""

import json
from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Expression,
    InputError,
    Material,
    RectilinearMesh,
    RigidPlate,
    Traction,
    discretize,
    limit_load_factor,
    solve,
    solve_history,
)
from qvi_contact.export import summary, write_npz
from qvi_contact.files.problem_file import problem_from_toml
from qvi_contact.files.problem_writer import problem_to_toml
from qvi_contact.verification import verify_file
from solvers import Status
from tests.qvi_contact.states import solved

WIDTH, HEIGHT = 3.0, 1.0
WEIGHT, PUSH, UPLIFT, FRICTION = 12.0, 1.5, 4.5, 0.4  # forces; the uplift that of a pressure which falls to zero
STEEL = Material(1000.0, 0.25, "strain")
ELEMENTS = {"rectangles": {}, "degree 4": {"degree": 4}}


def on(element, problem):
    """The problem on the mesh of an element, and what `solve` takes for it."""
    return (problem.triangulated() if element else problem), element


def block(pore_pressure=0.0, push=PUSH, friction=FRICTION, weight=WEIGHT):
    """A block of given weight on a rough base, pushed from the left by a pressure; a fluid presses under it."""
    mesh = RectilinearMesh.rectangle((6, 2), WIDTH, HEIGHT)
    conditions = [
        Traction("left", x=push / HEIGHT, y=0.0, name="water"),
        Traction("right", 0.0, 0.0),
        Traction("top", 0.0, 0.0),
        Contact("bottom", friction, pore_pressure=pore_pressure, name="base"),
    ]
    return ContactProblem(mesh, STEEL, conditions, body_potential=Expression(f"{weight / WIDTH / HEIGHT!r} * y"))


def falling(uplift=UPLIFT):
    """The pressure that falls from the left to nothing on the right and has a given resultant."""
    return Expression(f"{2.0 * uplift / WIDTH!r} * (1 - x / {WIDTH!r})")


@pytest.mark.parametrize("element", ELEMENTS.values(), ids=ELEMENTS)
class TestBlockWithUplift:
    """Factor of sliding μ (W − U) / H of a gravity dam's base."""

    def test_forces(self, element):
        problem, element = on(element, block(falling()))
        base = solved(problem, **element).contacts["base"]
        assert base.normal_force == pytest.approx(WEIGHT, rel=1e-10)
        assert base.effective_normal_force == pytest.approx(WEIGHT - UPLIFT, rel=1e-10)
        assert base.tangential_force == pytest.approx(-PUSH, rel=1e-10)
        assert base.effective_normal_stress.max() <= 1e-9
        assert (np.abs(base.tangential_stress) <= -FRICTION * base.effective_normal_stress + 1e-7).all()

    def test_factor_of_sliding(self, element):
        problem, element = on(element, block(falling()))
        limit, exact = limit_load_factor(problem, ["water"], **element), FRICTION * (WEIGHT - UPLIFT) / PUSH
        assert limit.lower == pytest.approx(exact, rel=1e-7)
        assert limit.upper == pytest.approx(exact, rel=1e-12)

    def test_slides_beyond_it(self, element):
        most = FRICTION * (WEIGHT - UPLIFT)
        for push, status in ((0.8 * most, Status.SOLVED), (1.001 * most, Status.INFEASIBLE)):
            problem, options = on(element, block(falling(), push))
            assert solve(problem, **options).status is status

    def test_floats(self, element):
        problem, element = on(element, block(1.001 * WEIGHT / WIDTH, push=0.0))
        assert solve(problem, **element).status is Status.INFEASIBLE


@pytest.mark.parametrize("element", ELEMENTS.values(), ids=ELEMENTS)
def test_constant_pressure_is_another_problem_without_it(element):
    """σ = σ' − p I: without the fluid, tractions p n more, and obstacles moved by the strain of −p I."""
    p, mesh = 0.7, RectilinearMesh.rectangle((6, 3), 2.0, 1.0)
    shrinks = p * float(STEEL.compliance[0, :2].sum())
    base = Contact("bottom", 0.1, gap=lambda x, _: 2e-3 * (x - 0.6) ** 2, name="base")
    wet = ContactProblem(
        mesh, STEEL,
        [Displacement("top", x=2e-4, y=-1e-3), Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0),
         replace(base, pore_pressure=p)],
    )  # fmt: skip
    dry = replace(
        wet,
        conditions=[
            Displacement("top", x=lambda x, _: 2e-4 + shrinks * x, y=-1e-3 + shrinks),
            Traction("left", -p, 0.0),
            Traction("right", p, 0.0),
            replace(base, offset=lambda x, _: shrinks * x),
        ],
    )
    found, options = on(element, wet)
    found = solved(found, **options).contacts["base"]
    other = solved(on(element, dry)[0], **options).contacts["base"]
    assert set(other.state.tolist()) == {0, 1, 2}
    size = np.abs(other.normal_stress).max()
    assert found.effective_normal_stress == pytest.approx(other.normal_stress, abs=1e-7 * size)
    assert found.tangential_stress == pytest.approx(other.tangential_stress, abs=1e-7 * size)
    assert found.friction_bound == pytest.approx(other.friction_bound, abs=1e-7 * size)
    assert found.gap == pytest.approx(other.gap, abs=1e-9)
    assert found.state.tolist() == other.state.tolist()
    assert found.excess_between_points == pytest.approx(other.excess_between_points, abs=1e-6 * size)


@pytest.mark.parametrize("element", ELEMENTS.values(), ids=ELEMENTS)
def test_the_fluid_alone_presses_on_an_open_contact(element):
    """It reaches in where nothing touches: σ_N = −p, σ_T = 0, on a joint as well."""
    mesh = RectilinearMesh.rectangle((3, 4), WIDTH, HEIGHT).with_joint("crack", "horizontal", 0.5)
    conditions = [
        Displacement("bottom", x=0.0, y=0.0),
        Displacement("top", x=0.0, y=0.0),
        Traction("left", 0.0, 0.0),
        Traction("right", 0.0, 0.0),
        Contact("crack", 0.5, pore_pressure=2.0),
    ]
    problem, element = on(element, ContactProblem(mesh, STEEL, conditions))
    crack = solved(problem, **element).contacts["crack"]
    assert crack.normal_stress == pytest.approx(-2.0, abs=1e-8)
    assert crack.tangential_stress == pytest.approx(0.0, abs=1e-8)
    assert (crack.state == 0).all()
    assert (crack.gap > 0.0).all()


def test_forces_of_plates_are_those_of_the_total_stress():
    mesh = RectilinearMesh.rectangle((4, 2), WIDTH, HEIGHT)
    plate = Contact("top", 0.0, plate=RigidPlate(force_y=-WEIGHT, moment=0.0, pivot=(1.5, 1.0)), pore_pressure=1.0)
    sides = [Traction(side, 0.0, 0.0) for side in ("left", "right")]
    result = solved(ContactProblem(mesh, STEEL, [plate, *sides, Displacement("bottom", x=0.0, y=0.0)]))
    top = result.contacts["top"]
    assert result.resultant("top").y == pytest.approx(-WEIGHT, rel=1e-9)
    assert top.effective_normal_force == pytest.approx(WEIGHT - WIDTH, rel=1e-9)


def test_a_rising_fluid_by_steps():
    """It holds until the uplift has taken so much that friction no longer carries the push."""
    uplifts = [0.0, 2.0, 6.0, 6.9, 7.1]
    steps = [block(falling(uplift), friction=0.3).triangulated() for uplift in uplifts]
    history = solve_history(steps, degree=4)
    assert [str(step.status) for step in history.steps] == ["solved"] * 4 + ["infeasible"]
    forces = [step.contacts["base"].effective_normal_force for step in history.steps[:4]]
    assert forces == pytest.approx([WEIGHT - uplift for uplift in uplifts[:4]], rel=1e-9)


@pytest.mark.parametrize("inner", ["strict-direct:clarabel"])
def test_strict_bounds_are_those_of_the_effective_stress(inner):
    base = solved(block(falling()), inner=inner, element="bfs").contacts["base"]
    assert base.pull_between_points <= 1e-7
    assert base.excess_between_points <= 1e-6
    with pytest.raises(InputError, match="pore pressure"):
        solve(block(Expression("x * (3 - x)")), inner=inner, element="bfs")


class TestFiles:
    """Problem files, archives and summaries."""

    def test_problem_file(self):
        text = problem_to_toml(block(falling()))
        again = problem_from_toml(text).problem
        assert problem_to_toml(again) == text
        assert np.array_equal(discretize(again).qvi.n0, discretize(block(falling())).qvi.n0)
        assert "pore_pressure" not in problem_to_toml(block())
        with pytest.raises(InputError, match=r"contacts\[0\].pore_pressure"):
            _ = problem_from_toml(text.replace('pore_pressure = "', 'pore_pressure = "-1 - ')).problem

    def test_archive_and_summary(self, tmp_path):
        result = solved(block(falling()))
        write_npz(tmp_path / "wet.npz", result)
        checked = verify_file(tmp_path / "wet.npz")
        assert checked.passed, checked.table()
        with np.load(tmp_path / "wet.npz") as fields:
            effective = fields["base.normal_stress"] + fields["base.pore_pressure"]
            assert fields["base.effective_normal_stress"] == pytest.approx(effective, rel=1e-12)
        force = json.loads(json.dumps(summary(result)))["contacts"]["base"]["effective_normal_force"]
        assert force["value"] == pytest.approx(WEIGHT - UPLIFT)
        assert "effective_normal_force" not in summary(solved(block()))["contacts"]["base"]


@pytest.mark.parametrize("value", [-1.0, float("nan"), "much", lambda x, _: -1.0 - x])
def test_bad_pressures_are_refused(value):
    with pytest.raises(InputError, match=r"Contact\.pore_pressure"):
        solve(block(value))


def test_a_tied_contact_takes_none():
    with pytest.raises(InputError, match=r"Contact\.pore_pressure"):
        Contact("bottom", 0.0, law="tied", pore_pressure=1.0)
