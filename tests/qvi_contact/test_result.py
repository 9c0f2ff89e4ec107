"""Stresses, forces, energies and states of results against closed forms; and what becomes of them in a copy."""

import copy
import pickle
from dataclasses import astuple
from functools import partial

import numpy as np
import pytest

from qvi_contact import InputError, Symmetry, Traction, TriangleMesh, discretize, load_problem, solve, solve_companion
from qvi_contact.bracket import bracket
from qvi_contact.discretization import physical
from qvi_contact.gallery import compressed_plate
from qvi_contact.limit import limit_load_factor
from qvi_contact.mesh import SIDES
from qvi_contact.problem import Contact, ContactProblem, Displacement, Expression, Material, Polynomial, Region
from qvi_contact.solution import stress_at
from qvi_contact.verification import verify_result
from solvers import Status

FORCE = 209.0
"""Size of the plate's contact force."""


@pytest.fixture(scope="module")
def plate():
    """A plate with stick and slip, so that its stress is not uniform."""
    result = solve(compressed_plate(0.2, (4, 3), width=1.5), tolerance=1e-10)
    assert result.status is Status.SOLVED
    return result


def angle_bracket():
    """An L-shape, pulled: cell (1, 1) of a 2×2 grid is left out."""
    mesh = TriangleMesh.grid([0, 1, 2], [0, 1, 3], [[True, True], [True, False]])
    free = [Traction(side, x=0.0, y=0.0) for side in ("right", "top")]
    held = [Displacement("bottom", x=0.0, y=0.0), Displacement("left", x=lambda x, y: 1e-3 * y + 0 * x, y=0.0)]
    return solve(ContactProblem(mesh, Material(1000.0, 0.3), [*held, *free]))


class TestStress:
    """Stress at points, and in cells."""

    def test_on_the_border_of_the_body_it_is_one_sided(self):
        bracket, step = angle_bracket(), 1e-9
        for inside, border in (((1 - step, 2.2), (1.0, 2.2)), ((1.7, 1 - step), (1.7, 1.0))):
            value = bracket.stress(*inside)
            assert np.abs(value).max() > 1e-3
            assert bracket.stress(*border) == pytest.approx(value, abs=1e-6)
        assert np.abs([bracket.resultant(side).x for side in SIDES]).max() > 1e-2
        assert total(bracket) == pytest.approx(np.zeros(3), abs=1e-9)
        x, y = np.array([0.2, 0.7]), np.array([[0.1], [0.5], [0.8]])
        assert bracket.stress(x, y).shape == (3, 2, 3)
        assert bracket.stress(x, y)[2, 1] == pytest.approx(bracket.stress(0.7, 0.8), rel=1e-12)

    @pytest.mark.parametrize("point", [(1.5, 2.0), (2.5, 0.5), (0.5, -1e-3), (np.nan, 0.5), (0.5, np.inf)])
    def test_points_outside_are_named(self, point):
        bracket = angle_bracket()
        x, y = np.array([0.5, point[0]]), np.array([0.5, point[1]])
        with pytest.raises(InputError, match="give points") as caught:
            bracket.stress(x, y)
        named = np.atleast_1d(caught.value.value)
        assert np.isin(named, point).all() or np.isnan(named).any()


def total(result):
    return np.sum([(r.x, r.y, r.moment) for r in map(result.resultant, SIDES)], axis=0)


def test_forces_and_moments_of_sides_balance(plate):
    line = plate.contacts["plate"]
    top = plate.resultant("top")
    assert total(plate) == pytest.approx(np.zeros(3), abs=1e-9 * FORCE)
    assert top.x == pytest.approx(line.tangential_force, rel=1e-10)
    assert top.y == pytest.approx(-line.normal_force, rel=1e-10)
    moment = line.weights @ (line.x * line.normal_stress - line.y * line.tangential_stress)
    assert top.moment == pytest.approx(moment, rel=1e-10)
    assert top.x < -1.0  # friction does hold the plate together


def test_energies_of_a_plate_with_slip(plate):
    """Clapeyron: 2 strain = work of the tractions on the true displacements = work of loads − dissipation."""
    energies = plate.energies
    assert energies.dissipation > 1e-3 * energies.strain
    assert 2 * energies.strain == pytest.approx(energies.load - energies.dissipation, rel=1e-9)
    minimised = plate.discretization.scales.energy * plate.history[-1].energy
    assert energies.complementary == pytest.approx(minimised, rel=1e-6)


LIFTED = (Symmetry("left"), Traction("right", x=0.0, y=0.0), Traction("top", x=0.0, y=5.0))
DRAGGED = (*(Traction(side, x=0.0, y=0.0) for side in ("left", "right")), Traction("top", x=4.0, y=-10.0))


@pytest.mark.parametrize("sides", [LIFTED, DRAGGED], ids=["lifted", "dragged"])
@pytest.mark.parametrize("inner", ["qp:osqp", "direct:clarabel", "socp:clarabel"])
def test_loads_that_no_traction_carries(sides, inner):
    """A block pulled off, or dragged beyond the friction of, the obstacle it lies on."""
    mesh = TriangleMesh.rectangle((3, 2))
    problem = ContactProblem(mesh, Material(1000.0, 0.3), [*sides, Contact("bottom", friction=0.3)])
    result = solve(problem, inner=inner)
    assert result.status is Status.INFEASIBLE
    assert "proved by a mechanism" in result.message
    assert not result.certificate.passed
    values = [partial(getattr, result, name) for name in ("contacts", "energies", "plates")]
    for value in (*values, partial(result.stress, 0.5, 0.5), result.gauss_stress, partial(result.resultant, "top")):
        with pytest.raises(InputError, match="no stress state"):
            value()


@pytest.mark.parametrize(("unit", "shift"), [(1e-9, 1e3), (1e-3, -1e3), (1.0, 0.0), (7.3, 17.7), (1e12, 17.7)])
def test_points_of_the_boundary_belong_to_the_body(shift, unit):
    """Those of contacts and joints are computed, and may lie outside by an ulp; a body with steps, at any place."""
    numbers = np.random.default_rng(1)
    active = np.ones((6, 6), dtype=bool)
    active[3:, 4:] = active[:2, :2] = False
    x, y = (unit * (at + np.append(0.0, np.cumsum(numbers.uniform(0.05, 1.0, 6)))) for at in (shift, -2.0 * shift))
    mesh = TriangleMesh.grid(x, y, active).with_joint("joint", lambda _, at: np.isclose(at, y[2]))
    contacts = [Contact(side, 0.3) for side in SIDES]
    known = discretize(ContactProblem(mesh, Material(1.0, 0.3), [*contacts, Contact.tied("joint")]))
    nothing = known.values(np.zeros(known.qvi.n))
    for rows in known.contacts:
        points = physical(known.problem, known.scales, rows.points.coordinates)
        assert np.isfinite(stress_at(known, nothing, *points)).all()
    with pytest.raises(InputError, match="inside the body"):
        stress_at(known, nothing, np.array([x[5]]), np.array([y[3] + 1e-9 * mesh.length]))


@pytest.mark.parametrize("shift", [0.0, 1e3])
def test_the_stress_at_a_contact_is_that_of_the_contact(shift):
    """Also on a line inside the body, from whichever side."""
    x, y = shift + np.array([0.0, 0.3, 0.7, 1.1]), shift + np.array([0.0, 0.4, 0.9])
    mesh = TriangleMesh.grid(x, y, np.array([[True, True, True], [True, True, False]]))
    mesh = mesh.with_edges("step", lambda _, at: np.isclose(at, y[1])).with_edges(
        "roof", lambda _, at: np.isclose(at, y[2])
    )
    conditions = [
        Contact("bottom", 0.3), Contact("left", 0.0), Contact("right", 0.0), Contact("step", 0.2, gap=1e-4),
        Traction("roof", x=0.0, y=-1e-3),
    ]  # fmt: skip
    result = solve(ContactProblem(mesh, Material(1.0, 0.3), conditions))
    assert result.status is Status.SOLVED
    for name, line in result.contacts.items():
        component = {"bottom": 1, "step": 1}.get(name, 0)
        assert result.stress(line.x, line.y)[:, component] == pytest.approx(line.normal_stress, abs=1e-9)


def half(x, y):
    """A function that has a name."""
    return 0.5 + 0.0 * x * y


COPIES = [lambda value: pickle.loads(pickle.dumps(value)), copy.deepcopy, copy.copy]


@pytest.fixture(scope="module")
def remembering():
    mesh = TriangleMesh.rectangle((2, 4), 1.0, 2.0).with_joint("joint", lambda _, y: np.isclose(y, 1.0))
    mesh = mesh.with_edges("upper", lambda x, y: (x == 0.0) & (y > 1.0))
    conditions = [Displacement("bottom", x=0.0, y=0.0), *(Traction(side, 0.0, 0.0) for side in ("left", "right"))]
    conditions += [Contact("joint", half), Traction("top", Expression("0.1 * x * (1 - x)"), Polynomial([[-1.0]]))]
    problem = ContactProblem(mesh, Material(1e3, 0.3), conditions, regions=[Region(Material(2e3, 0.3), y=(1.0, 2.0))])
    found = solve(problem)
    _ = found.contacts, found.energies, found.solution.uniqueness, found.discretization.remarks  # what is remembered
    return found


@pytest.mark.parametrize("copied", COPIES)
def test_a_result_stays_what_it_is(remembering, copied):
    again = copied(remembering)
    assert (again.status, again.message) == (remembering.status, remembering.message)
    assert ", T = " in repr(again) == repr(remembering)
    assert np.array_equal(again.solution.z, remembering.solution.z)
    assert again.certificate.measures == remembering.certificate.measures
    energies = astuple(remembering.energies)  # sums depend on where arrays lie in memory, to their last digit
    assert astuple(again.energies) == pytest.approx(energies, rel=0.0, abs=1e-12 * remembering.energies.strain)
    with pytest.raises(TypeError):
        again.contacts["other"] = None
    for name, line in copied(remembering.contacts).items():
        assert np.array_equal(again.contacts[name].slip, line.slip)
    assert not again.problem.mesh.vertices.flags.writeable
    assert verify_result(again).passed


def test_limit_loads_displacements_and_bounds(pytestconfig):
    block = load_problem(pytestconfig.rootpath / "examples" / "dragged_block_slides.toml").problem
    limit, plate = limit_load_factor(block, ["drag"]), compressed_plate(0.2, (2, 2))
    companion, between = solve_companion(plate), bracket(solve(plate))
    force = companion.contacts["plate"].normal_force  # remembered
    for copied in COPIES:
        again = copied(limit)
        assert (again, again.lower, again.upper, again.bound) == (limit, limit.lower, limit.upper, limit.bound)
        assert again.mechanism.works == limit.mechanism.works
        assert again.mechanism.contacts["base"] == limit.mechanism.contacts["base"]
        with pytest.raises(TypeError):
            again.mechanism.works["drag"] = 0.0
        assert copied(companion).contacts["plate"].normal_force == pytest.approx(force, rel=1e-12)
        assert copied(between).lower == between.lower
