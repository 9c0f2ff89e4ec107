"""Files for other programs hold the numbers of the result they are made from."""

import json
import sys

import meshio
import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    RectilinearMesh,
    Region,
    RigidPlate,
    Symmetry,
    Traction,
    exact,
    principal_stresses,
    solve,
)
from qvi_contact.export import summary, write_contacts_vtu, write_json, write_npz, write_vtu
from qvi_contact.gallery import compressed_plate
from qvi_contact.solution.contact_line import ContactState
from qvi_contact.solution.sampling import von_mises
from qvi_contact.units import Units
from solvers import Status

pytestmark = pytest.mark.usefixtures(
    "bogner_fox_schmit"
)  # rows, columns and Airy coefficients of grids; triangles: test_triangle_files

UNITS = Units("mm", "MPa")
STATES = [state.name.lower() for state in ContactState]


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
def lifted():
    """A block pulled off the ground."""
    mesh = RectilinearMesh.rectangle((2, 2))
    conditions = [Contact("bottom", friction=0.3), Traction("top", x=0.0, y=1.0)]
    conditions += [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
    result = solve(ContactProblem(mesh, Material(1000.0, 0.3), conditions))
    assert result.status is Status.INFEASIBLE
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


class TestUnits:
    """Names of units."""

    def test_products(self):
        assert (UNITS.force, UNITS.moment, UNITS.energy, UNITS.displacement) == ("MPa mm", "MPa mm²", "MPa mm²", "mm")

    @pytest.mark.parametrize("name", ["", "  ", None, 3, "m\nm"])
    @pytest.mark.parametrize("field", ["length", "stress"])
    def test_a_name_must_be_a_text(self, field, name):
        with pytest.raises(InputError, match=rf"Units\.{field}"):
            Units(**{field: name})


def refuse(constant):
    raise AssertionError(f"{constant} is no JSON")


class TestSummary:
    """The summary as a document and as a file."""

    def test_a_file_reads_back_as_the_document(self, plate, tmp_path):
        write_json(tmp_path / "a.json", plate, UNITS)
        text = (tmp_path / "a.json").read_text(encoding="utf-8")
        assert json.loads(text, parse_constant=refuse) == summary(plate, UNITS)

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

    def test_numbers_of_a_contact(self, plate):
        line, found = plate.contacts["plate"], summary(plate, UNITS)["contacts"]["plate"]
        assert found["normal_force"] == {"value": line.normal_force, "unit": "MPa mm"}
        assert found["tangential_force"]["value"] == line.tangential_force < 0.0
        assert found["largest_pressure"] == {"value": -line.normal_stress.min(), "unit": "MPa"}
        assert found["largest_shear"]["value"] == -line.tangential_stress.min()
        assert found["largest_slip"] == {"value": line.slip.max(), "unit": "mm"}
        lengths = [found["length"][state]["value"] for state in STATES]
        assert sum(lengths) == pytest.approx(1.5)
        assert lengths[0] == 0.0
        assert lengths[1] > 0.0
        assert lengths[2] > 0.0

    def test_forces_on_all_sides_balance(self, plate):
        found = summary(plate, UNITS)["resultants"]
        assert set(found) == {"bottom", "right", "top", "left"}
        for component in ("x", "y", "moment"):
            values = [side[component]["value"] for side in found.values()]
            assert sum(values) == pytest.approx(0.0, abs=1e-8 * max(map(abs, values)))
        assert found["top"]["moment"]["unit"] == "MPa mm²"

    def test_energies(self, plate):
        found = summary(plate, UNITS)["energies"]
        assert found["strain"] == {"value": plate.energies.strain, "unit": "MPa mm²"}
        assert set(found) == {"strain", "load", "complementary", "dissipation"}
        assert found["dissipation"]["value"] > 0.0

    def test_an_infeasible_problem_has_a_message_and_no_state(self, lifted):
        found = json.loads(json.dumps(summary(lifted), allow_nan=False))
        assert found["status"] == "infeasible"
        assert found["solved"] is False
        assert found["message"] == lifted.message
        assert found["advice"] == lifted.status.advice
        assert found["contacts"] is found["energies"] is found["resultants"] is found["traction_misfit"] is None

    def test_what_is_not_a_number_is_none(self, lifted):
        assert not np.isfinite(list(lifted.certificate.measures.values())).all()
        measures = summary(lifted)["certificate"]["measures"]
        for name, value in lifted.certificate.measures.items():
            assert measures[name] == (value if np.isfinite(value) else None)

    def test_a_failed_solve_that_left_a_state_is_summarised_whole(self):
        result = solve(compressed_plate(0.2, (4, 4)), method="fixed-point", max_iterations=1)
        assert result.status is not Status.SOLVED
        found = summary(result)
        assert found["solved"] is False
        assert found["contacts"]["plate"]["normal_force"]["value"] > 0.0
        json.dumps(found, allow_nan=False)

    def test_motion_of_a_plate(self):
        contact = Contact("top", friction=0.0, plate=RigidPlate(force_y=-10.0))
        conditions = [Symmetry("left"), Symmetry("bottom"), Traction("right", x=0.0, y=0.0), contact]
        result = solve(ContactProblem(RectilinearMesh.rectangle((2, 2)), Material(1000.0, 0.3), conditions))
        moved = summary(result, UNITS)["plates"]["top"]
        assert moved["y"]["value"] == pytest.approx(-0.01, rel=1e-7)
        assert moved["rotation"]["unit"] == "rad"


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

    def test_contacts_by_name(self, loaded, notched):
        line = notched.contacts["ground / rough"]
        assert loaded["ground / rough.gap"].max() > 1e-3
        for name in (
            "x",
            "y",
            "weights",
            "normal_stress",
            "tangential_stress",
            "gap",
            "slip",
            "state",
            "friction_bound",
        ):
            assert np.array_equal(loaded[f"ground / rough.{name}"], getattr(line, name))

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

    def test_materials(self, grid):
        middles = grid.points[grid.cells[0].data].mean(axis=1)
        assert (grid.cell_data["material"][0] == (middles[:, 1] < 1.0)).all()

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

    def test_names_carry_units_on_request(self, notched, tmp_path):
        write_vtu(tmp_path / "a.vtu", notched, UNITS, subdivisions=1)
        names = set(meshio.read(tmp_path / "a.vtu").point_data)
        assert {"stress [MPa]", "von Mises [MPa]", "Airy function [MPa mm²]"} <= names

    def test_vtk_opens_it(self, path, notched):
        pyvista = pytest.importorskip("pyvista")
        grid = pyvista.read(path)
        assert grid.n_cells == 16 * int(notched.problem.mesh.active.sum())
        assert grid.point_data["stress"].shape == (grid.n_points, 6)
        assert grid.compute_cell_sizes()["Area"].sum() == pytest.approx(4.5)

    @pytest.mark.parametrize("count", [0, -1, 1.5, True, "2"])
    def test_bad_subdivisions(self, notched, tmp_path, count):
        with pytest.raises(InputError, match="subdivisions"):
            write_vtu(tmp_path / "a.vtu", notched, subdivisions=count)

    def test_without_meshio_the_command_to_type_is_told(self, notched, tmp_path, monkeypatch):
        monkeypatch.setitem(sys.modules, "meshio", None)
        with pytest.raises(InputError, match=r"pip install 'qvi-contact\[vtk\]'"):
            write_vtu(tmp_path / "a.vtu", notched)


@pytest.mark.parametrize("kind", ["grid", "triangles"])
class TestMore:
    """Displacement, error of cells and contacts, on meshes of both kinds."""

    @pytest.fixture
    def result(self, kind):
        problem = compressed_plate(0.2, (3, 2), 1.5)
        return solve(problem if kind == "grid" else problem.triangulated())

    def test_displacement_and_error_by_cell(self, result, tmp_path):
        bracket = result.bracket
        write_vtu(tmp_path / "a.vtu", result, UNITS, subdivisions=2, bracket=bracket)
        grid = meshio.read(tmp_path / "a.vtu")
        moved = grid.point_data["displacement [mm]"]
        assert moved[:, :2] == pytest.approx(result.displacement(*grid.points[:, :2].T), abs=1e-9)
        cell, gap = grid.cell_data["cell"][0], grid.cell_data["energy gap [MPa mm²]"][0]
        once = np.unique(cell, return_index=True)[1]
        assert gap[once].sum() == pytest.approx(bracket.gap, rel=1e-6)
        assert np.array_equal(gap, bracket.cell_gaps[cell])

    def test_another_bracket_is_refused(self, result, tmp_path):
        other = solve(compressed_plate(0.2, (1, 1))).bracket
        with pytest.raises(InputError, match="another mesh"):
            write_vtu(tmp_path / "a.vtu", result, bracket=other)

    def test_contacts(self, result, tmp_path):
        line = result.contacts["plate"]
        write_contacts_vtu(tmp_path / "a.vtu", result, UNITS)
        grid = meshio.read(tmp_path / "a.vtu")
        assert grid.points[:, :2] == pytest.approx(np.column_stack([line.x, line.y]))
        wanted = {
            "pressure [MPa]": -line.normal_stress, "shear [MPa]": line.tangential_stress,
            "fluid pressure [MPa]": line.pore_pressure, "friction bound [MPa]": line.friction_bound,
            "gap [mm]": line.gap, "slip [mm]": line.slip,
            "state": line.state,
        }  # fmt: skip
        for name, values in wanted.items():
            assert grid.point_data[name] == pytest.approx(values), name
        assert grid.point_data["traction [MPa]"][:, 1] == pytest.approx(line.normal_stress)
        pairs = grid.cells_dict["line"]
        assert len(pairs) == len(line.x) - 1
        steps = np.abs(np.diff(grid.points[pairs, 0], axis=1))
        assert steps.sum() == pytest.approx(np.ptp(line.x))  # each joins neighbours

    def test_a_body_without_contact_has_none_to_write(self, kind, tmp_path):
        mesh, material = RectilinearMesh([0.0, 1.0], [0.0, 1.0]), Material(1000.0, 0.3)
        sides = {"bottom": "uu", "right": "tt", "top": "tt", "left": "tt"}
        problem = exact.problem_from_state(exact.uniform(material, yy=-1.0), mesh, material, sides)
        with pytest.raises(InputError, match="no contact"):
            write_contacts_vtu(tmp_path / "a.vtu", solve(problem if kind == "grid" else problem.triangulated()))


@pytest.mark.parametrize(("write", "right", "wrong"), [(write_npz, ".npz", ".zip"), (write_vtu, ".vtu", ".vtk")])
class TestFiles:
    """What all binary files have in common."""

    def test_another_suffix_is_refused_with_the_right_one(self, write, right, wrong, notched, tmp_path):
        with pytest.raises(InputError, match=rf"ends in \{right}"):
            write(tmp_path / f"a{wrong}", notched)

    def test_without_a_state_the_earlier_file_stays(self, write, right, wrong, lifted, tmp_path):
        assert wrong != right
        path = tmp_path / f"a{right}"
        path.write_text("earlier")
        with pytest.raises(InputError, match="no stress state"):
            write(path, lifted)
        assert path.read_text() == "earlier"
        assert list(tmp_path.iterdir()) == [path]

    def test_a_folder_that_is_not_there(self, write, right, wrong, notched, tmp_path):
        assert wrong != right
        with pytest.raises(InputError, match="cannot be written"):
            write(tmp_path / "missing" / f"a{right}", notched)
