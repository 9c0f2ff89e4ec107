"""Files for other programs hold the numbers of the result they are made from."""

import json
from dataclasses import replace

import meshio
import numpy as np
import pytest

from qvi_contact import InputError, TriangleMesh, limit_load_factor, solve, solve_history
from qvi_contact.export import field_arrays, summary, write_contacts_vtu, write_json, write_npz, write_vtu
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Region, Traction
from qvi_contact.refinement import LimitFactor, refine
from qvi_contact.solution import ContactResult
from qvi_contact.units import Units
from qvi_contact.verification import difference, missed_tractions, scales_difference, worse_than_claimed
from solvers import Certificate, Status
from solvers.certificate import EXPONENTS
from tests.qvi_contact.test_plots import lifted
from tests.test_examples import example

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


@pytest.fixture(scope="module", name="lifted")
def _lifted():
    result = solve(lifted())
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
        assert found["normal_force"] == {"value": line.normal_force, "unit": "N/mm"}
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


class TestVtu:
    """VTU files, read back by meshio; with displacements, errors of cells and contacts."""

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

    def test_displacement_and_error_by_cell(self, plate, tmp_path):
        bracket = plate.bracket
        write_vtu(tmp_path / "a.vtu", plate, UNITS, subdivisions=2, bracket=bracket)
        grid = meshio.read(tmp_path / "a.vtu")
        moved = grid.point_data["displacement [mm]"]
        assert moved[:, :2] == pytest.approx(plate.displacement(*grid.points[:, :2].T), abs=1e-9)
        cell, gap = grid.cell_data["cell"][0], grid.cell_data["energy gap [N mm/mm]"][0]
        once = np.unique(cell, return_index=True)[1]
        assert gap[once].sum() == pytest.approx(bracket.gap, rel=1e-6)
        assert np.array_equal(gap, bracket.cell_gaps[cell])

    def test_contacts(self, tmp_path):
        lug = solve(example("lug").problem)
        line = lug.contacts["bore"]
        write_contacts_vtu(tmp_path / "a.vtu", lug, UNITS)
        grid = meshio.read(tmp_path / "a.vtu")
        assert grid.points[:, :2] == pytest.approx(np.column_stack([line.x, line.y]))
        wanted = {
            "pressure [MPa]": -line.normal_stress, "shear [MPa]": line.tangential_stress,
            "fluid pressure [MPa]": line.pore_pressure, "friction bound [MPa]": line.friction_bound,
            "gap [mm]": line.gap, "slip [mm]": line.slip, "state": line.state,
        }  # fmt: skip
        for name, values in wanted.items():
            assert grid.point_data[name] == pytest.approx(values), name
        along = grid.point_data["traction [MPa]"] * -grid.points / 10.0  # to the centre of the bore
        assert along.sum(axis=1) == pytest.approx(line.normal_stress, abs=1e-9)
        ends = grid.points[grid.cells_dict["line"]]
        assert (np.bincount(grid.cells_dict["line"].ravel()) == 2).all()  # a closed line
        assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(20.0 * np.pi, rel=1e-3)


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
    assert stress.shape == (len(points), 6)
    areas = [np.linalg.det(points[part[1:]] - points[part[0]]) / 2.0 for part in chosen]
    assert np.abs(areas).sum() == pytest.approx(4.5)
    middle = points[chosen].mean(axis=1)
    misses = np.abs(notched.stress(*middle.T)[:, 1] - stress[chosen].mean(axis=1)[:, 1])
    assert misses.max() < 0.2 * np.ptp(stress[:, 1])


def test_a_result_has_the_points_of_its_contacts_and_a_row_for_each(plate):
    points, forces = plate.to_frame(), plate.forces_frame()
    line = plate.contacts["plate"]
    assert list(points["contact"].unique()) == list(forces["contact"]) == ["plate"]
    assert len(points) == len(line.x)
    assert points["weight"] @ points["normal_stress"] == pytest.approx(-forces["normal_force"][0])
    assert forces["largest_pressure"][0] == -points["normal_stress"].min()
    assert forces[["share_open", "share_stick", "share_slip"]].sum(axis=1)[0] == pytest.approx(1.0)
    assert {"normal_force [N/mm]", "largest_slip [mm]", "share_slip"} <= set(plate.forces_frame(UNITS).columns)
    assert "slip [mm]" in plate.to_frame(UNITS).columns
    held = replace(plate.problem, conditions=[*plate.problem.conditions[:3], Displacement("top", x=0.0, y=-1e-3)])
    assert solve(held).to_frame().columns.tolist() == ["contact"]
    assert [entry.number for entry in plate.solution.history] == list(range(1, plate.solution.iterations + 1))


def test_a_history_has_a_row_for_each_step_and_contact():
    history = solve_history([compressed_plate(0.3, (2, 2), displacement=u) for u in (1e-3, 2e-3, 1.5e-3)])
    table = history.to_frame()
    assert list(table["step"]) == [1, 2, 3]
    assert set(table["status"]) == {"solved"}
    assert np.array_equal(table["dissipated"], history.dissipated)
    assert list(table["normal_force"]) == [step.contacts["plate"].normal_force for step in history.steps]
    assert "dissipated [N mm/mm]" in history.to_frame(UNITS).columns


def test_a_limit_load_is_a_row():
    dragged, loads = example("dragged_block_holds").problem, ["drag"]
    limit = limit_load_factor(dragged, loads)
    row = limit.to_frame().loc[0]
    assert (row["lower"], row["upper"], row["slides"]) == (limit.lower, limit.upper, "base")
    rounds = refine(dragged, quantity=LimitFactor(loads)).to_frame()
    assert rounds["value"].iloc[-1] == pytest.approx(limit.lower)


def test_each_entry_by_its_own_size():
    values = np.array([1.0, 1e-3, 1e-8])
    assert difference(values, values) == 0.0
    assert difference(values * [1.0, 1.0 + 1e-6, 1.0], values) == pytest.approx(1e-9 / 1.1e-3)
    assert difference(values + np.array([0.0, 0.0, 1e-9]), values) == pytest.approx(1e-5, rel=1e-3)
    assert difference([1e-12], [0.0], unit=1.0) == pytest.approx(1e-8)
    assert difference([1.0 + 1e-12], [1.0], rounding=1e-11) == 0.0
    assert difference([np.nan, np.inf, 1.0], [np.nan, np.inf, 1.0]) == 0.0
    for wrong in ([1.0, np.inf, 1.0], [np.nan, 1.0, 1.0], [np.nan, -np.inf, 1.0], [np.nan, np.inf, np.nan]):
        assert difference(wrong, [np.nan, np.inf, 1.0]) == np.inf
    assert difference([True, False], [True, True]) == 1.0
    assert difference(np.array("a"), np.array("b")) == 1.0
    assert difference([1.0, 2.0], [1.0]) == difference([1], [1.0]) == np.inf


def test_what_is_not_a_number_is_the_largest_of_all():
    """Python's max would pass over it."""
    measures = dict.fromkeys(EXPONENTS, 1e-12)
    computed = Certificate(measures, 1e-8, {"stress": 1.0}, {"energy_gap": 1e-12})
    for wrong in (
        replace(computed, measures=measures | {"friction": np.nan}),
        replace(computed, signed={"energy_gap": np.nan}),
        replace(computed, signed={}),
    ):
        assert worse_than_claimed(wrong, computed) == np.inf
    former = dict.fromkeys(("alart_curnier", "bipotential"), 1.0)  # in archives of earlier versions
    earlier = replace(computed, measures=measures | former, signed=computed.signed | {"bipotential": -1.0})
    assert worse_than_claimed(computed, computed) == worse_than_claimed(earlier, computed) == 0.0
    other = replace(computed, signed={"energy_gap": -1e-8})
    assert worse_than_claimed(other, computed) == pytest.approx(1.0, rel=1e-3)
    for scales in ({"stress": np.nan}, {}, {"stress": 1.0, "rounding": np.nan}, {"stress": 1.0, "rounding": 1e-3}):
        assert scales_difference(replace(computed, scales=scales), computed) == np.inf
    assert scales_difference(replace(computed, scales={"stress": 1.0, "rounding": 1e-8}), computed) == 0.0


def test_resultants_of_prescribed_tractions():
    """Met though the load is no polynomial; missed by 1 % where the particular stress is 1 % too large."""
    top = Traction("top", x=lambda x, y: np.sin(3.0 * x) + 0.0 * y, y=lambda x, y: -10.0 * np.exp(x) + 0.0 * y)
    sides = [Traction("left", x=0.0, y=0.0), Traction("right", x=0.0, y=0.0)]
    problem = ContactProblem(TriangleMesh.rectangle((3, 2)), Material(1e3, 0.3), [Contact("bottom", 0.5), top, *sides])
    result = solve(problem)
    assert result.traction_misfit > 1e-3
    assert missed_tractions(result) < 1e-12
    known = result.discretization
    larger = replace(known.root, particular=1.01 * known.root.particular)
    wrong = ContactResult(replace(known, root=larger), result.solution)
    assert 1e-3 < missed_tractions(wrong) < 1e-2
