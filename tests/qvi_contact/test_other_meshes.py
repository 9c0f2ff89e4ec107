"""What results of a mesh that is not rectilinear can do, and what is refused with a reason."""

import json

import numpy as np
import pytest
from matplotlib.collections import PolyCollection, TriMesh

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    RectilinearMesh,
    Region,
    Traction,
    refined_where_apart,
    solve,
    verify_result,
)
from qvi_contact.export import field_arrays, summary, write_json, write_npz, write_vtu
from qvi_contact.plots.bracket import bracket_figure
from qvi_contact.plots.companion import deformed_figure

MESH = RectilinearMesh.rectangle((3, 2), 1.5, 1.0, origin=(10.0, -3.0))
CUT = ContactProblem(
    MESH,
    Material(1000.0, 0.3),
    [
        Contact("bottom", 0.3),
        Traction("left", 0.0, 0.0),
        Traction("right", 0.0, 0.0),
        Displacement("top", x=0.001, y=-0.002),
    ],
    body_potential=lambda x, y: 0.2 * y - 0.01 * x,
    regions=[Region(Material(3000.0, 0.2), x=(10.0, 10.5))],
).triangulated()


@pytest.fixture(scope="module")
def result():
    return solve(CUT, degree=4)


def test_it_is_verified_from_its_own_data(result):
    found = verify_result(result)
    assert found.passed
    moved = solve(CUT, degree=4)
    moved.__dict__["dofs"] = result.dofs * (1.0 + 1e-5)
    assert not verify_result(moved).passed


def test_its_fields_say_where_they_are(result):
    fields = field_arrays(result)
    corners = fields["vertices"][fields["cells"]]
    centres = corners.mean(axis=1)
    assert np.bincount(fields["material"]).tolist() == [8, 4]
    assert (centres[fields["material"] == 1, 0] < 10.5).all()
    assert fields["gauss_stress"].shape == (*fields["gauss_x"].shape, 3)
    inside = np.column_stack([fields["gauss_x"].ravel(), fields["gauss_y"].ravel()])
    assert result.stress(*inside.T) == pytest.approx(fields["gauss_stress"].reshape(-1, 3), rel=1e-9)


def test_files_hold_it(result, tmp_path):
    meshio = pytest.importorskip("meshio")
    write_vtu(tmp_path / "cut.vtu", result, subdivisions=3)
    write_npz(tmp_path / "cut.npz", result)
    write_json(tmp_path / "cut.json", result)
    drawn = meshio.read(tmp_path / "cut.vtu")
    points, stress = drawn.points[:, :2], drawn.point_data["stress"]
    chosen = drawn.cells_dict["triangle"]
    assert len(chosen) == 3 * 9 * 12  # in each of the three parts of a triangle
    areas = [np.linalg.det(points[part[1:]] - points[part[0]]) / 2.0 for part in chosen]
    assert np.abs(areas).sum() == pytest.approx(1.5)
    middle = points[chosen].mean(axis=1)
    assert np.abs(result.stress(*middle.T)[:, 1] - stress[chosen].mean(axis=1)[:, 1]).max() < 0.2 * np.ptp(stress[:, 1])
    said = json.loads((tmp_path / "cut.json").read_text(encoding="utf-8"))
    assert said["mesh"] == summary(result)["mesh"]
    assert said["mesh"]["cells"] == 12


def test_the_gap_of_each_cell_is_drawn(result):
    found = result.bracket
    figure = bracket_figure(found)
    (drawn,) = (c for c in figure.axes[0].collections if isinstance(c, PolyCollection))
    corners = result.problem.mesh.corners
    density = 2.0 * found.cell_gaps / np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    assert np.asarray(drawn.get_array()) == pytest.approx(np.maximum(density, 1e-6 * density.max()))
    for path, wanted in zip(drawn.get_paths(), corners, strict=True):
        assert path.vertices[:3] == pytest.approx(wanted)


def test_the_deformed_body_is_drawn(result):
    companion = result.bracket.companion
    axes = deformed_figure(companion, scale=3.0).axes[0]
    (field,) = (c for c in axes.collections if isinstance(c, TriMesh))
    vertices = result.problem.mesh.vertices
    moved = vertices + 3.0 * companion.displacement(*vertices.T)
    drawn = np.column_stack([field._triangulation.x, field._triangulation.y])
    for place in moved:
        assert np.hypot(*(drawn - place).T).min() < 1e-9
    assert drawn.min(axis=0) == pytest.approx(moved.min(axis=0), abs=0.02)


@pytest.mark.parametrize(
    "task",
    [
        lambda found: refined_where_apart(found.problem, found.bracket),
        lambda found: found.nodal,
        lambda found: found.problem.refined(0.1),
        lambda found: found.problem.material_numbers,
    ],
)
def test_what_needs_a_grid_says_so(result, task):
    with pytest.raises(InputError, match=r"'TriangleMesh'.* RectilinearMesh.*'bfs'"):
        task(result)


def test_the_element_is_chosen_once(result):
    with pytest.raises(InputError, match="belongs to discretize"):
        solve(result.discretization, degree=5)
    problem = ContactProblem(MESH, Material(1.0, 0.3), [Displacement(s, 0.0, 0.0) for s in MESH.edge_names])
    with pytest.raises(InputError, match=r"degree: 4: rectangles have"):
        solve(problem, element="bfs", degree=4)


def test_regions_are_named_where_there_are_no_lines():
    body = [Displacement(side, 0.0, 0.0) for side in MESH.edge_names]
    with pytest.raises(InputError, match="give the name of a region"):
        ContactProblem(CUT.mesh, Material(1.0, 0.3), body, regions=[Region(Material(2.0, 0.3), x=(10.0, 10.5))])
    with pytest.raises(InputError, match="have no names"):
        ContactProblem(MESH, Material(1.0, 0.3), body, regions=[Region(Material(2.0, 0.3), name="steel")])
    with pytest.raises(InputError, match="or ranges"):
        Region(Material(2.0, 0.3), x=(0.0, 1.0), name="steel")
