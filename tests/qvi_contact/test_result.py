"""Stresses, resultants and energies of a result, and results that do not exist."""

from itertools import product

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
    Symmetry,
    Traction,
    discretize,
    exact,
    solve,
)
from qvi_contact.discretization.loads import physical
from qvi_contact.gallery import compressed_plate, sliding_block
from qvi_contact.mesh.rectilinear import SIDES
from qvi_contact.solution.stress import stress_at
from solvers import Status
from tests.effort import thinned

pytestmark = pytest.mark.usefixtures(
    "bogner_fox_schmit"
)  # Gauss points, lines and nodes of grids; triangles: test_triangle_results

FORCE = 209.0
"""Size of the plate's contact force."""


@pytest.fixture(scope="module")
def plate():
    """A plate with stick and slip, so that its stress is not uniform."""
    result = solve(compressed_plate(0.2, (4, 3), width=1.5), tolerance=1e-10)
    assert result.status is Status.SOLVED
    return result


@pytest.fixture(scope="module")
def bonded():
    """The same plate with friction that nothing overcomes."""
    result = solve(compressed_plate(5.0, (4, 3), width=1.5), tolerance=1e-10, variant="anderson")
    assert result.status is Status.SOLVED
    assert set(result.contacts["plate"].state) == {1}
    return result


def angle_bracket():
    """An L-shape, pulled: cell (1, 1) of a 2×2 grid is left out."""
    mesh = RectilinearMesh([0, 1, 2], [0, 1, 3], [[True, True], [True, False]])
    free = [Traction(side, x=0.0, y=0.0) for side in ("right", "top")]
    held = [Displacement("bottom", x=0.0, y=0.0), Displacement("left", x=lambda x, y: 1e-3 * y + 0 * x, y=0.0)]
    return solve(ContactProblem(mesh, Material(1000.0, 0.3), [*held, *free]))


class TestStress:
    """Stress at points, and in cells."""

    step = 1e-9

    def test_on_lines_it_is_the_mean_of_both_sides(self, plate):
        for line in plate.problem.mesh.x[1:-1]:
            y = np.array([0.1, 0.4, 0.95])
            left, right = plate.stress(line - self.step, y), plate.stress(line + self.step, y)
            assert np.abs(left - right)[:, 1].max() > 1e-2  # σ_yy does jump
            assert plate.stress(line, y) == pytest.approx((left + right) / 2, abs=1e-5)
        for line in plate.problem.mesh.y[1:-1]:
            x = np.array([0.1, 0.4, 1.4])
            below, above = plate.stress(x, line - self.step), plate.stress(x, line + self.step)
            assert np.abs(below - above)[:, 0].max() > 1e-2
            assert plate.stress(x, line) == pytest.approx((below + above) / 2, abs=1e-5)

    def test_at_a_node_it_is_the_mean_of_four(self, plate):
        x, y = plate.problem.mesh.x[2], plate.problem.mesh.y[1]
        around = [plate.stress(x + i * self.step, y + j * self.step) for i in (-1, 1) for j in (-1, 1)]
        assert np.ptp(around, axis=0)[:2].min() > 1e-2
        assert plate.stress(x, y) == pytest.approx(np.mean(around, axis=0), abs=1e-5)

    def test_on_the_border_of_the_body_it_is_one_sided(self):
        bracket = angle_bracket()
        assert bracket.status is Status.SOLVED
        for inside, border in (((1 - self.step, 2.2), (1.0, 2.2)), ((1.7, 1 - self.step), (1.7, 1.0))):
            value = bracket.stress(*inside)
            assert np.abs(value).max() > 1e-3
            assert bracket.stress(*border) == pytest.approx(value, abs=1e-6)

    @pytest.mark.parametrize("point", [(1.5, 2.0), (2.5, 0.5), (0.5, -1e-3), (np.nan, 0.5), (0.5, np.inf)])
    def test_points_outside_are_named(self, point):
        bracket = angle_bracket()
        x, y = np.array([0.5, point[0]]), np.array([0.5, point[1]])
        with pytest.raises(InputError, match="give points") as caught:
            bracket.stress(x, y)
        named = np.atleast_1d(caught.value.value)
        assert np.isin(named, point).all() or np.isnan(named).any()

    def test_coordinates_are_broadcast(self, plate):
        x, y = np.array([0.2, 0.7]), np.array([[0.1], [0.5], [0.8]])
        assert plate.stress(x, y).shape == (3, 2, 3)
        assert plate.stress(x, y)[2, 1] == pytest.approx(plate.stress(0.7, 0.8), rel=1e-12)
        assert plate.stress(0.7, 0.8).shape == (3,)

    def test_gauss_points(self, plate):
        x, y, stress = plate.gauss_stress()
        mesh = plate.problem.mesh
        assert x.shape == y.shape == (12, 16)
        assert stress.shape == (12, 16, 3)
        assert stress == pytest.approx(plate.stress(x, y), abs=1e-9 * FORCE)
        row, column = np.divmod(np.arange(12), 4)
        assert (mesh.x[column] < x.min(axis=1)).all()
        assert (x.max(axis=1) < mesh.x[column + 1]).all()
        assert (mesh.y[row] < y.min(axis=1)).all()
        assert (y.max(axis=1) < mesh.y[row + 1]).all()

    def test_left_out_cells_have_no_gauss_points(self):
        x, y, stress = angle_bracket().gauss_stress()
        assert stress.shape == (3, 16, 3)
        assert not ((x > 1) & (y > 1)).any()


class TestResultant:
    """Forces and moments of sides balance."""

    @staticmethod
    def total(result):
        return np.sum([(r.x, r.y, r.moment) for r in map(result.resultant, SIDES)], axis=0)

    def test_plate(self, plate):
        line = plate.contacts["plate"]
        top = plate.resultant("top")
        assert self.total(plate) == pytest.approx(np.zeros(3), abs=1e-9 * FORCE)
        assert top.x == pytest.approx(line.tangential_force, rel=1e-10)
        assert top.y == pytest.approx(-line.normal_force, rel=1e-10)
        moment = line.weights @ (line.x * line.normal_stress - line.y * line.tangential_stress)
        assert top.moment == pytest.approx(moment, rel=1e-10)
        assert top.x < -1.0  # friction does hold the plate together

    def test_bracket(self):
        bracket = angle_bracket()
        assert np.abs([bracket.resultant(side).x for side in SIDES]).max() > 1e-2
        assert self.total(bracket) == pytest.approx(np.zeros(3), abs=1e-9)

    @pytest.mark.parametrize("plane", ["stress", "strain"])
    def test_column_with_its_weight(self, plane):
        weight, width, height, left = 4.0, 2.0, 1.5, 3.0
        material = Material(1000.0, 0.3, plane)
        mesh = RectilinearMesh.rectangle((3, 2), width, height, origin=(left, 0.0), grading=0.7)
        state = exact.gravity_column(material, weight, height)
        sides = {"bottom": "uu", "right": "tt", "top": "tt", "left": "tt"}
        result = solve(exact.problem_from_state(state, mesh, material, sides))
        body = weight * width * height
        middle = left + width / 2
        foot = result.resultant("bottom")
        assert (foot.x, foot.y, foot.moment) == pytest.approx((0.0, body, body * middle), abs=1e-9 * body)
        assert self.total(result) - [0, body, body * middle] == pytest.approx(np.zeros(3), abs=1e-9 * body)

    def test_sliding_block(self):
        problem, _ = sliding_block((3, 2))
        result = solve(problem, tolerance=1e-10)
        expected = {  # (σ_xx, σ_yy, σ_xy) = (−20, −100, 30) on [0, 2] × [0, 1]
            "bottom": (-60.0, 200.0, 200.0),
            "right": (-20.0, 30.0, 70.0),
            "top": (60.0, -200.0, -260.0),
            "left": (20.0, -30.0, -10.0),
        }
        for side, values in expected.items():
            found = result.resultant(side)
            assert (found.x, found.y, found.moment) == pytest.approx(values, abs=1e-7)

    def test_unknown_side(self, plate):
        with pytest.raises(InputError, match="bottom, right, top, left"):
            plate.resultant("floor")


class TestEnergies:
    """Clapeyron: 2 strain = work of the tractions on the true displacements = work of loads − dissipation."""

    def test_bonded_plate(self, bonded):
        energies = bonded.energies
        assert energies.load == pytest.approx(1e-3 * bonded.contacts["plate"].normal_force, rel=1e-9)
        assert energies.strain == pytest.approx(energies.load / 2, rel=1e-9)
        assert energies.complementary == pytest.approx(-energies.load / 2, rel=1e-9)
        assert energies.dissipation == pytest.approx(0.0, abs=1e-9 * energies.load)

    def test_plate_with_slip(self, plate):
        energies = plate.energies
        assert energies.dissipation > 1e-3 * energies.strain
        assert 2 * energies.strain == pytest.approx(energies.load - energies.dissipation, rel=1e-9)

    def test_complementary_energy_is_what_the_solver_minimises(self, plate):
        unit = plate.discretization.scales.energy
        assert plate.energies.complementary == pytest.approx(unit * plate.history[-1].energy, rel=1e-6)

    @pytest.mark.parametrize("plane", ["stress", "strain"])
    def test_sliding_block(self, plane):
        problem, state = sliding_block((3, 2), plane=plane)
        result = solve(problem, tolerance=1e-10)
        energies, (contact,) = result.energies, result.contacts.values()
        stress = np.array([-20.0, -100.0, 30.0])
        strain = problem.material.compliance @ stress
        area, width = 2.0, 2.0
        assert energies.strain == pytest.approx(0.5 * area * stress @ strain, rel=1e-7)
        mean_slip = state.displacement(np.array(width / 2), np.array(0.0))[0]
        lost = 30.0 * mean_slip * width  # μp times the slip
        assert -contact.weights @ (contact.tangential_stress * contact.slip) == pytest.approx(lost, rel=1e-7)
        # the shear that the sides prescribe leaves the slip in the corners open: a part of what the last edges lose
        assert energies.dissipation == pytest.approx(lost, rel=5e-2)
        right = state.displacement(np.array(width), np.array(0.5))  # mean over the side, which is linear
        assert energies.load == pytest.approx(right @ [-20.0, 30.0], rel=1e-7)
        assert energies.complementary == pytest.approx(energies.strain - energies.load, rel=1e-12)

    @pytest.mark.parametrize(("friction", "shear"), [(0.2, 0.2), (2.0, -0.2)])
    def test_friction_loses_energy(self, friction, shear):
        """A coarse block sheared at its sides, where the projected slip would give back half of the strain energy."""
        sides = [Traction(side, x=0.0, y=shear) for side in ("left", "right")]
        gap = Expression("-1e-3 + 2.43e-3 * x") if friction < 1.0 else Expression("-1e-3 + 1e-4 * x")
        plate = Contact("top", friction, gap=gap, offset=1e-3)
        conditions = [plate, Displacement("bottom", x=0.0, y=0.0), *sides]
        mesh = RectilinearMesh.rectangle((2, 2) if friction < 1.0 else (1, 1))
        result = solve(ContactProblem(mesh, Material(1000.0, 0.3 if friction < 1.0 else 0.0), conditions))
        assert result.status is Status.SOLVED
        line, energies = result.contacts["top"], result.energies
        assert -line.weights @ (line.tangential_stress * line.slip) < -0.3 * energies.strain
        assert energies.dissipation >= -1e-8 * energies.strain

    def test_without_friction_nothing_is_lost(self):
        energies = solve(compressed_plate(0.0, (3, 2))).energies
        assert energies.strain == pytest.approx(FORCE * 1e-3 / 2, rel=1e-8)
        assert energies.load == pytest.approx(FORCE * 1e-3, rel=1e-8)
        assert energies.dissipation == pytest.approx(0.0, abs=1e-12)

    def test_column_stores_what_its_weight_does(self):
        """½∫(γ(y−h))²/E: the potential φ belongs to the stress."""
        material = Material(1000.0, 0.0)
        mesh = RectilinearMesh.rectangle((2, 3), 2.0, 1.5)
        sides = {"bottom": "uu", "right": "tt", "top": "tt", "left": "tt"}
        result = solve(exact.problem_from_state(exact.gravity_column(material, 4.0, 1.5), mesh, material, sides))
        assert result.energies.strain == pytest.approx(4.0**2 * 1.5**3 * 2.0 / (6 * 1000.0), rel=1e-9)
        assert result.energies.load == pytest.approx(0.0, abs=1e-12)


LIFTED = (Symmetry("left"), Traction("right", x=0.0, y=0.0), Traction("top", x=0.0, y=5.0))
DRAGGED = (*(Traction(side, x=0.0, y=0.0) for side in ("left", "right")), Traction("top", x=4.0, y=-10.0))


@pytest.mark.parametrize("sides", [LIFTED, DRAGGED], ids=["lifted", "dragged"])
@pytest.mark.parametrize("inner", ["qp:clarabel", "qp:osqp", "direct:clarabel", "direct:osqp", "socp:clarabel"])
def test_loads_that_no_traction_carries(sides, inner):
    """A block pulled off, or dragged beyond the friction of, the obstacle it lies on."""
    mesh = RectilinearMesh.rectangle((3, 2))
    problem = ContactProblem(mesh, Material(1000.0, 0.3), [*sides, Contact("bottom", friction=0.3)])
    result = solve(problem, inner=inner)
    assert result.status is Status.INFEASIBLE
    assert "proved by a mechanism" in result.message
    assert "reduce the tension or the sliding force" in result.message
    assert "\n" not in result.message
    assert not result.certificate.passed
    for attempt in (
        lambda: result.contacts,
        lambda: result.energies,
        lambda: result.stress(0.5, 0.5),
        lambda: result.gauss_stress(),
        lambda: result.resultant("top"),
    ):
        with pytest.raises(InputError, match="no stress state") as caught:
            attempt()
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("factor", "status"), [(0.999, Status.SOLVED), (1.001, Status.INFEASIBLE)])
def test_the_limit_load_of_a_dragged_block(factor, status):
    """Pressure p and uniform shear T: the base carries T ≤ μp and not more."""
    material = Material(1000.0, 0.3)
    state = exact.uniform(material, yy=-10.0, xy=factor * 0.3 * 10.0)
    sides = {"bottom": "cc", "right": "tt", "top": "tt", "left": "tt"}
    mesh = RectilinearMesh.rectangle((3, 2))
    result = solve(exact.problem_from_state(state, mesh, material, sides, (Contact("bottom", friction=0.3),)))
    assert result.status is status


@pytest.mark.parametrize(("unit", "shift"), thinned(product((1e-9, 1e-3, 1.0, 7.3, 1e12), (0.0, 1e3, -1e3, 17.7)), 8))
def test_points_of_the_boundary_belong_to_the_body(shift, unit):
    """Those of contacts and joints are computed, and may lie outside by an ulp; a body with steps, at any place."""
    numbers = np.random.default_rng(1)
    active = np.ones((6, 6), dtype=bool)
    active[3:, 4:] = active[:2, :2] = False
    for _ in range(4):
        x, y = (unit * (shift + np.append(0.0, np.cumsum(numbers.uniform(0.05, 1.0, 6)))) for _ in "xy")
        mesh = RectilinearMesh(x, y, active).with_joint("joint", "horizontal", at=y[2])
        contacts = [Contact(side, 0.3) for side in SIDES]
        known = discretize(ContactProblem(mesh, Material(1.0, 0.3), [*contacts, Contact.tied("joint")]))
        nothing = known.values(np.zeros(known.qvi.n))
        for rows in known.contacts:
            points = physical(known.problem, known.scales, rows.points.coordinates)
            assert np.isfinite(stress_at(known, nothing, *points)).all()
        beyond = np.array([x[5]]), np.array([y[3] + 1e-9 * mesh.length])
        with pytest.raises(InputError, match="inside the body"):
            stress_at(known, nothing, *beyond)


@pytest.mark.parametrize("shift", [0.0, 1e3])
def test_the_stress_at_a_contact_is_that_of_the_contact(shift):
    """Also on a line inside the body, from whichever side."""
    x, y = shift + np.array([0.0, 0.3, 0.7, 1.1]), shift + np.array([0.0, 0.4, 0.9])
    mesh = RectilinearMesh(x, y, np.array([[True, True, True], [True, True, False]]))
    mesh = mesh.with_edges("step", "top", at=y[1]).with_edges("roof", "top", at=y[2])
    conditions = [
        Contact("bottom", 0.3), Contact("left", 0.0), Contact("right", 0.0), Contact("step", 0.2, gap=1e-4),
        Traction("roof", x=0.0, y=-1e-3),
    ]  # fmt: skip
    result = solve(ContactProblem(mesh, Material(1.0, 0.3), conditions))
    assert result.status is Status.SOLVED
    for name, line in result.contacts.items():
        component = {"bottom": 1, "step": 1}.get(name, 0)
        stress = result.stress(line.x, line.y)
        assert stress[:, component] == pytest.approx(line.normal_stress, abs=1e-9)


@pytest.mark.parametrize(("grading", "lost"), [(1.0, False), (0.4, True)])
def test_rounding_of_single_stresses_is_said(grading, lost):
    """It is of the size ε (L/h)² of the stress, as stresses are second differences of what is stored."""
    result = solve(compressed_plate(0.2, cells=(14, 14), grading=grading))
    assert result.status is Status.SOLVED
    assert any("Rounding makes stresses" in remark for remark in result.remarks) is lost
    smallest = np.diff(result.problem.grid.x).min()
    stress = np.abs(result.gauss_stress()[2]).max()
    expected = np.finfo(float).eps / smallest**2 * stress
    assert 0.01 * expected < result.stress_rounding < 100.0 * expected
