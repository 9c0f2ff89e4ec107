"""Stresses, resultants and energies of a result, and results that do not exist."""

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Expression,
    Material,
    RectilinearMesh,
    Traction,
    solve,
)
from qvi_contact.gallery import compressed_plate
from solvers import Status

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


class TestEnergies:
    """Clapeyron: 2 strain = work of the tractions on the true displacements = work of loads − dissipation."""

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
