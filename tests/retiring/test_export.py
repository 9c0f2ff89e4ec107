"""Files for other programs hold the numbers of the result they are made from."""

import meshio
import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Material,
    RectilinearMesh,
    Region,
    Traction,
    exact,
    principal_stresses,
    solve,
)
from qvi_contact.export import summary, write_npz, write_vtu
from qvi_contact.gallery import compressed_plate
from qvi_contact.solution.sampling import von_mises
from qvi_contact.units import Units
from solvers import Status

pytestmark = pytest.mark.usefixtures(
    "bogner_fox_schmit"
)  # rows, columns and Airy coefficients of grids; triangles: test_triangle_files

UNITS = Units("mm", "MPa")


@pytest.fixture(scope="module")
def plate():
    """Stick and slip on a graded mesh."""
    return solve(compressed_plate(0.2, (4, 3), width=1.5, grading=0.8))


@pytest.fixture(scope="module")
def notched():
    """Graded cells, some left out, two materials in plane strain, a body force, a gap that stays open."""
    active = np.ones((3, 3), dtype=bool)
    active[2, 1:] = False
    mesh = RectilinearMesh([0.0, 0.5, 1.0, 3.0], [0.0, 1.0, 1.2, 3.0], active)
    conditions = [
        Contact("bottom", friction=0.6, gap=lambda x, y: 0.01 * x**2 + 0 * y, name="ground / rough"),
        Traction("top", x=0.0, y=-10.0),
        Displacement("left", x=0.0),
        Traction("left", y=0.0),
        Traction("right", x=0.0, y=0.0),
    ]
    regions = [Region(Material(3000.0, 0.45, "strain"), y=(0.0, 1.0))]
    material = Material(1000.0, 0.2, "strain")
    result = solve(ContactProblem(mesh, material, conditions, lambda x, y: 3.0 * y + 0 * x, regions))
    assert result.status is Status.SOLVED
    return result


@pytest.fixture(scope="module")
def loaded(notched, tmp_path_factory):
    path = tmp_path_factory.mktemp("npz") / "a.npz"
    write_npz(path, notched)
    with np.load(path, allow_pickle=False) as archive:
        return dict(archive)


@pytest.fixture(scope="module")
def path(notched, tmp_path_factory):
    path = tmp_path_factory.mktemp("vtu") / "a.vtu"
    write_vtu(path, notched)
    return path


@pytest.fixture(scope="module")
def grid(path):
    return meshio.read(path)


class TestSummary:
    """The summary as a document and as a file."""

    def test_what_it_says_of_a_solved_problem(self, plate):
        found = summary(plate, UNITS)
        assert found["status"] == "solved"
        assert found["solved"] is True
        assert found["certificate"]["passed"] is True
        assert found["certificate"]["measures"] == dict(plate.certificate.measures)
        assert found["certificate"]["tolerance"] == 1e-8
        assert found["method"] == "condensed"
        assert found["factorisation"] == plate.solution.factorisation != ""
        assert found["iterations"] == plate.iterations
        assert (found["mesh"]["columns"], found["mesh"]["rows"], found["mesh"]["cells"]) == (4, 3, 12)
        assert found["mesh"]["unknowns"] == plate.discretization.qvi.n
        assert (found["units"]["length"], found["units"]["energy"]) == ("mm", "MPa mm²")


class TestArchive:
    """NumPy archives."""

    def test_grid_and_gauss_points(self, loaded, notched):
        x, y, stress = notched.gauss_stress()
        for name, wanted in (
            ("gauss_x", x),
            ("gauss_y", y),
            ("gauss_stress", stress),
            ("x_lines", notched.problem.mesh.x),
        ):
            assert np.array_equal(loaded[name], wanted)
        assert np.array_equal(loaded["active"], notched.problem.mesh.active)
        assert loaded["material"].tolist() == [[1, 1, 1], [0, 0, 0], [0, 0, 0]]
        assert str(loaded["status"]) == "solved"

    def test_nodal_values_are_derivatives_in_physical_units(self, tmp_path):
        """Φ = m y³/6 up to an affine function; Φ_xy is −σ_xy."""
        material = Material(1000.0, 0.3)
        mesh = RectilinearMesh([10.0, 10.5, 12.0], [0.0, 1.0, 1.2, 3.0])
        state = exact.pure_bending(material, 4.0)
        sides = dict.fromkeys(("bottom", "right", "top"), "tt") | {"left": "uu"}
        write_npz(tmp_path / "a.npz", solve(exact.problem_from_state(state, mesh, material, sides)))
        with np.load(tmp_path / "a.npz", allow_pickle=False) as archive:
            airy = archive["airy"]
        x, y = np.meshgrid(mesh.x, mesh.y)
        slope_x, slope_y = airy[0, 0, 1], airy[0, 0, 2]
        assert airy[..., 1] == pytest.approx(slope_x, abs=1e-7)
        assert airy[..., 2] - slope_y == pytest.approx(2.0 * y**2, abs=1e-7)
        assert airy[..., 3] == pytest.approx(0.0, abs=1e-7)
        affine = airy[0, 0, 0] + slope_x * (x - 10.0) + slope_y * y
        assert airy[..., 0] - affine == pytest.approx(4.0 / 6.0 * y**3, abs=1e-7)

    def test_nodes_outside_the_body_are_nan(self, loaded, notched):
        assert (np.isnan(loaded["airy"]).all(axis=-1) == ~notched.problem.mesh.active_nodes).all()


class TestVtu:
    """VTU files, read back by meshio."""

    def test_cells_share_no_points(self, grid, notched):
        cells = int(notched.problem.mesh.active.sum())
        assert len(grid.points) == cells * 25
        (block,) = grid.cells
        assert block.type == "quad"
        assert len(block.data) == cells * 16
        assert len(np.unique(block.data)) == cells * 25
        assert (np.ptp(block.data // 25, axis=1) == 0).all()

    def test_quadrilaterals_are_counterclockwise_and_fill_the_body(self, grid):
        x, y = np.moveaxis(grid.points[grid.cells[0].data][..., :2], -1, 0)
        areas = 0.5 * (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)
        assert (areas > 0).all()
        assert areas.sum() == pytest.approx(3.0 * 3.0 - 2.5 * 1.8)

    def test_stresses_inside_cells_are_those_of_the_result(self, grid, notched):
        local = np.arange(len(grid.points)) % 25
        inner = (local // 5 % 4 != 0) & (local % 5 % 4 != 0)
        x, y, _ = grid.points[inner].T
        stress = notched.stress(x, y)
        size = np.abs(stress).max()
        xx, yy, zz, xy, yz, xz = grid.point_data["stress"][inner].T
        assert np.column_stack([xx, yy, xy]) == pytest.approx(stress, abs=1e-10 * size)
        poisson = np.where(y < 1.0, 0.45, 0.2)
        assert zz == pytest.approx(poisson * (stress[:, 0] + stress[:, 1]), abs=1e-10 * size)
        assert not yz.any()
        assert not xz.any()
        assert grid.point_data["von Mises"][inner] == pytest.approx(von_mises(stress, poisson))
        first, second, _ = principal_stresses(stress)
        assert grid.point_data["principal 1"][inner] == pytest.approx(first, abs=1e-10 * size)
        assert grid.point_data["principal 2"][inner] == pytest.approx(second, abs=1e-10 * size)

    def test_jumps_between_cells_stay(self, grid):
        """Two points of one place and two σ_yy on the vertical line between two cells."""
        x, y, _ = grid.points.T
        here = np.flatnonzero((x == 0.5) & (y == 0.25))
        assert len(here) == 2
        left, right = grid.point_data["stress"][here]
        assert abs(left[1] - right[1]) > 1e-3
        assert left[0] == pytest.approx(right[0])  # traction agrees
        assert left[3] == pytest.approx(right[3])

    def test_the_airy_function_gives_the_stress(self, grid):
        """Second differences within one cell, body force added; Φ is cubic along x."""
        values = grid.point_data["Airy function"].reshape(-1, 5, 5)
        x, y, _ = (coordinate.reshape(-1, 5, 5) for coordinate in grid.points.T)
        h = x[:, :, 1] - x[:, :, 0]
        curvature = (values[:, :, 1] - 2 * values[:, :, 2] + values[:, :, 3]) / h**2
        stress = grid.point_data["stress"].reshape(-1, 5, 5, 6)[:, :, 2, 1]
        assert curvature + 3.0 * y[:, :, 2] == pytest.approx(stress, abs=1e-6 * np.abs(stress).max())

    def test_integral_of_a_linear_stress(self, tmp_path):
        """A column under its own weight, σ_yy = γ (y − h): −γ a h²/2 over the area."""
        material, mesh = Material(1000.0, 0.3), RectilinearMesh([0.0, 0.5, 2.0], [0.0, 1.0, 1.2, 3.0])
        sides = {"bottom": "uu", "right": "tt", "top": "tt", "left": "tt"}
        state = exact.gravity_column(material, 2.0, 3.0)
        write_vtu(tmp_path / "a.vtu", solve(exact.problem_from_state(state, mesh, material, sides)), subdivisions=2)
        grid = meshio.read(tmp_path / "a.vtu")
        corners = grid.cells[0].data
        x, y = np.moveaxis(grid.points[corners][..., :2], -1, 0)
        means = grid.point_data["stress"][corners][..., 1].mean(axis=1)
        assert (np.ptp(x, axis=1) * np.ptp(y, axis=1)) @ means == pytest.approx(-2.0 * 2.0 * 9.0 / 2.0, rel=1e-9)
