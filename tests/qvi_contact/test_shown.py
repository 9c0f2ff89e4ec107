"""What people see of meshes, problems and results: tables, one line, and the pieces of HTML of notebooks."""

import sys
from xml.etree import ElementTree

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    RectilinearMesh,
    Traction,
    TriangleMesh,
    exact,
    solve,
)
from qvi_contact.gallery import compressed_plate
from qvi_contact.solution.contact_path import ContactPath
from qvi_contact.units import Units


@pytest.fixture(scope="module")
def slanted():
    """A block on triangles that slides down a plane turned by 30°."""
    mesh = TriangleMesh.rectangle((3, 2), 3.0, 2.0)
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    turned = TriangleMesh(mesh.vertices @ np.array([[c, s], [-s, c]]), mesh.cells, mesh.edge_sets)
    conditions = [Contact("bottom", friction=0.3, name="plane <a>"), Displacement("top", x=0.05, y=-0.02)]
    conditions += [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
    return solve(ContactProblem(turned, Material(1000.0, 0.3), conditions))


class TestPath:
    """Edges in order."""

    def test_around_a_ring_in_any_order(self):
        angle = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False) + 0.1
        ring = np.column_stack([np.cos(angle), np.sin(angle)])
        ends = np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)
        ends = np.where((ends[:, 1, 0] > ends[:, 0, 0])[:, None, None], ends, ends[:, ::-1])[
            np.random.default_rng(3).permutation(12)
        ]
        path = ContactPath.of(ends)
        walked = np.where(path.forward[:, None, None], ends[path.edges], ends[path.edges, ::-1])
        assert np.array_equal(walked[1:, 0], walked[:-1, 1])
        assert np.array_equal(walked[-1, 1], walked[0, 0])
        assert walked[0, 0] == pytest.approx(ring[np.argmin(ring[:, 0])])
        assert 0 < path.forward.sum() < 12
        assert path.starts[-1] + path.lengths[-1] == pytest.approx(24.0 * np.sin(np.pi / 12))

    def test_lines_apart_come_behind_each_other(self):
        ends = np.array([[[3.0, 0.0], [4.0, 0.0]], [[1.0, 0.0], [2.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]]])
        path = ContactPath.of(ends)
        assert path.edges.tolist() == [2, 1, 0]
        assert path.line.tolist() == [0, 0, 1]
        assert path.starts.tolist() == [0.0, 1.0, 2.0]
        assert path.points(2).tolist() == [[4, 5], [2, 3], [0, 1]]


class TestFrame:
    """Contacts as tables."""

    def test_rows_follow_the_contact(self, slanted):
        line = slanted.contacts["plane <a>"]
        frame = line.to_frame()
        assert frame["s"].to_numpy() == pytest.approx(np.hypot(frame["x"], frame["y"]))  # from the corner at the origin
        assert (np.diff(frame["s"]) > 0).all()
        assert frame["weight"] @ frame["normal_stress"] == pytest.approx(-line.normal_force)
        assert (frame["state"] == "slip").sum() == (line.state == 2).sum() > 0

    def test_units_in_the_names(self, slanted):
        columns = list(slanted.contacts["plane <a>"].to_frame(Units("mm", "MPa")).columns)
        assert {"s [mm]", "normal_stress [MPa]", "slip [mm]", "friction", "state"} < set(columns)

    def test_without_pandas_the_command_to_type_is_told(self, slanted, monkeypatch):
        monkeypatch.setitem(sys.modules, "pandas", None)
        with pytest.raises(InputError, match=r"pip install 'qvi-contact\[frame\]'"):
            slanted.contacts["plane <a>"].to_frame()


def test_one_line_says_the_numbers(slanted):
    line = slanted.contacts["plane <a>"]
    shown = [slanted, slanted.problem, slanted.problem.mesh, line, RectilinearMesh([0, 1, 2], [0, 1], [[True, True]])]
    texts = [repr(found) for found in shown]
    assert all("\n" not in text and len(text) < 250 for text in texts)
    assert f"N = {line.normal_force:.6g}" in texts[0]
    assert f"N = {line.normal_force:.6g}" in texts[3]
    assert "plane <a>" in texts[1]
    assert "12 triangles" in texts[2]
    assert "2 × 1 cells" in texts[4]


def test_pieces_of_html_are_well_formed(slanted):
    line = slanted.contacts["plane <a>"]
    for found in (slanted, slanted.problem, slanted.problem.mesh, line, RectilinearMesh([0, 1, 2], [0, 1])):
        text = found._repr_html_()
        tree = ElementTree.fromstring(text)
        assert len(text) < 6000
        if found in (slanted, line):
            assert f"{line.normal_force:.6g}" in [cell.text for cell in tree.iter("td")]
    drawn = slanted.problem.mesh._repr_html_()
    for name in slanted.problem.mesh.edge_names:
        assert f"<title>{name}</title>" in drawn


def test_a_displacement_is_that_of_the_state():
    material = Material(1000.0, 0.3)
    sides = {"bottom": "uu", "right": "tt", "top": "tt", "left": "tt"}
    mesh = RectilinearMesh.rectangle((2, 2))
    result = solve(exact.problem_from_state(exact.uniform(material, yy=-20.0), mesh, material, sides))
    x, y = np.array([0.1, 0.9]), np.array([0.3, 1.0])
    wanted = np.column_stack([0.3 * 20.0 / 1000.0 * x, -20.0 / 1000.0 * y])
    found = result.displacement(x, y)
    assert found - found[0] == pytest.approx(wanted - wanted[0], abs=1e-10)
    with pytest.raises(InputError):
        result.displacement(2.0, 0.0)


def test_a_displacement_obeys_the_contact():
    result = solve(compressed_plate(0.2, (4, 4)))
    _, down = result.displacement(np.linspace(0.0, 1.0, 9), 1.0).T
    assert down == pytest.approx(-1e-3, abs=1e-8)  # the plate's
