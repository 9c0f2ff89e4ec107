"""Files for other programs hold the numbers of the result they are made from."""

import json

import meshio
import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    Region,
    RigidPlate,
    Symmetry,
    Traction,
    TriangleMesh,
    solve,
)
from qvi_contact.export import field_arrays, summary, write_contacts_vtu, write_json, write_npz, write_vtu
from qvi_contact.gallery import compressed_plate
from qvi_contact.units import Units
from solvers import Status

UNITS = Units("mm", "MPa")
STATES = ["open", "stick", "slip"]


@pytest.fixture(scope="module")
def plate():
    """Stick and slip on a graded mesh."""
    return solve(compressed_plate(0.2, (4, 3), width=1.5, grading=0.8))


@pytest.fixture(scope="module")
def notched():
    """Graded cells, some left out, two materials in plane strain, a body force, a gap that stays open."""
    active = np.ones((3, 3), dtype=bool)
    active[2, 1:] = False
    mesh = TriangleMesh.grid([0.0, 0.5, 1.0, 3.0], [0.0, 1.0, 1.2, 3.0], active)
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
    mesh = TriangleMesh.rectangle((2, 2))
    conditions = [Contact("bottom", friction=0.3), Traction("top", x=0.0, y=1.0)]
    conditions += [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
    result = solve(ContactProblem(mesh, Material(1000.0, 0.3), conditions))
    assert result.status is Status.INFEASIBLE
    return result


@pytest.fixture(scope="module")
def path(notched, tmp_path_factory):
    path = tmp_path_factory.mktemp("vtu") / "a.vtu"
    write_vtu(path, notched)
    return path


def refuse(constant):
    raise AssertionError(f"{constant} is no JSON")


class TestSummary:
    """The summary as a document and as a file."""

    def test_a_file_reads_back_as_the_document(self, plate, tmp_path):
        write_json(tmp_path / "a.json", plate, UNITS)
        text = (tmp_path / "a.json").read_text(encoding="utf-8")
        assert json.loads(text, parse_constant=refuse) == summary(plate, UNITS)

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

    def test_an_infeasible_problem_has_a_message_and_no_state(self, lifted):
        found = json.loads(json.dumps(summary(lifted), allow_nan=False))
        assert found["status"] == "infeasible"
        assert found["solved"] is False
        assert found["message"] == lifted.message
        assert found["advice"] == lifted.status.advice
        for name, value in lifted.certificate.measures.items():
            assert found["certificate"]["measures"][name] == (value if np.isfinite(value) else None)
        assert found["contacts"] is found["energies"] is found["resultants"] is found["traction_misfit"] is None

    def test_motion_of_a_plate(self):
        contact = Contact("top", friction=0.0, plate=RigidPlate(force_y=-10.0))
        conditions = [Symmetry("left"), Symmetry("bottom"), Traction("right", x=0.0, y=0.0), contact]
        result = solve(ContactProblem(TriangleMesh.rectangle((1, 1)), Material(1000.0, 0.3), conditions))
        moved = summary(result, UNITS)["plates"]["top"]
        assert moved["y"]["value"] == pytest.approx(-0.01, rel=1e-7)
        assert moved["rotation"]["unit"] == "rad"


def test_an_archive_has_contacts_by_name(notched, tmp_path):
    write_npz(tmp_path / "a.npz", notched)
    with np.load(tmp_path / "a.npz", allow_pickle=False) as archive:
        loaded = dict(archive)
    line = notched.contacts["ground / rough"]
    assert loaded["ground / rough.gap"].max() > 1e-3
    names = "x y weights normal_stress tangential_stress gap slip state friction_bound"
    for name in names.split():
        assert np.array_equal(loaded[f"ground / rough.{name}"], getattr(line, name))


class TestVtu:
    """VTU files, read back by meshio."""

    def test_materials(self, path):
        grid = meshio.read(path)
        middles = grid.points[grid.cells[0].data].mean(axis=1)
        assert (grid.cell_data["material"][0] == (middles[:, 1] < 1.0)).all()

    def test_names_carry_units_on_request(self, notched, tmp_path):
        write_vtu(tmp_path / "a.vtu", notched, UNITS, subdivisions=1)
        names = set(meshio.read(tmp_path / "a.vtu").point_data)
        for count in (0, 1.5, True, "2"):
            with pytest.raises(InputError, match="subdivisions"):
                write_vtu(tmp_path / "a.vtu", notched, subdivisions=count)
        assert {"stress [MPa]", "von Mises [MPa]", "Airy function [MPa mm²]"} <= names

    def test_vtk_opens_it(self, path, notched):
        pyvista = pytest.importorskip("pyvista")
        grid = pyvista.read(path)
        assert grid.n_cells == 3 * 16 * notched.problem.mesh.cell_count
        assert grid.point_data["stress"].shape == (grid.n_points, 6)
        assert grid.compute_cell_sizes()["Area"].sum() == pytest.approx(4.5)


class TestMore:
    """Displacement, error of cells and contacts."""

    def test_displacement_and_error_by_cell(self, plate, tmp_path):
        bracket = plate.bracket
        write_vtu(tmp_path / "a.vtu", plate, UNITS, subdivisions=2, bracket=bracket)
        grid = meshio.read(tmp_path / "a.vtu")
        moved = grid.point_data["displacement [mm]"]
        assert moved[:, :2] == pytest.approx(plate.displacement(*grid.points[:, :2].T), abs=1e-9)
        cell, gap = grid.cell_data["cell"][0], grid.cell_data["energy gap [MPa mm²]"][0]
        once = np.unique(cell, return_index=True)[1]
        assert gap[once].sum() == pytest.approx(bracket.gap, rel=1e-6)
        assert np.array_equal(gap, bracket.cell_gaps[cell])

    def test_contacts(self, plate, tmp_path):
        line = plate.contacts["plate"]
        write_contacts_vtu(tmp_path / "a.vtu", plate, UNITS)
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


@pytest.mark.parametrize(("write", "right", "wrong"), [(write_npz, ".npz", ".zip"), (write_vtu, ".vtu", ".vtk")])
def test_what_all_binary_files_refuse(write, right, wrong, notched, lifted, tmp_path):
    """Another suffix, and a result without a state, which leaves the earlier file as it is."""
    with pytest.raises(InputError, match=rf"ends in \{right}"):
        write(tmp_path / f"a{wrong}", notched)
    path = tmp_path / f"a{right}"
    path.write_text("earlier")
    with pytest.raises(InputError, match="no stress state"):
        write(path, lifted)
    assert path.read_text() == "earlier"
    assert list(tmp_path.iterdir()) == [path]


def test_a_body_without_contact_has_none_to_write(tmp_path):
    free = [Traction(side, x=0.0, y=0.0) for side in ("right", "top", "left")]
    problem = ContactProblem(
        TriangleMesh.rectangle((1, 1)), Material(1.0, 0.3), [Displacement("bottom", 0.0, 0.0), *free]
    )
    with pytest.raises(InputError, match="no contact"):
        write_contacts_vtu(tmp_path / "a.vtu", solve(problem))


def test_fields_say_where_they_are(notched):
    fields = field_arrays(notched)
    centres = fields["vertices"][fields["cells"]].mean(axis=1)
    assert ((fields["material"] == 1) == (centres[:, 1] < 1.0)).all()
    assert fields["gauss_stress"].shape == (*fields["gauss_x"].shape, 3)
    inside = np.column_stack([fields["gauss_x"].ravel(), fields["gauss_y"].ravel()])
    assert notched.stress(*inside.T) == pytest.approx(fields["gauss_stress"].reshape(-1, 3), rel=1e-9)


def test_files_hold_a_result(notched, tmp_path):
    write_vtu(tmp_path / "cut.vtu", notched, subdivisions=3)
    drawn = meshio.read(tmp_path / "cut.vtu")
    points, stress = drawn.points[:, :2], drawn.point_data["stress"]
    chosen = drawn.cells_dict["triangle"]
    assert len(chosen) == 3 * 9 * 14  # in each of the three parts of a triangle
    areas = [np.linalg.det(points[part[1:]] - points[part[0]]) / 2.0 for part in chosen]
    assert np.abs(areas).sum() == pytest.approx(4.5)
    middle = points[chosen].mean(axis=1)
    misses = np.abs(notched.stress(*middle.T)[:, 1] - stress[chosen].mean(axis=1)[:, 1])
    assert misses.max() < 0.2 * np.ptp(stress[:, 1])
