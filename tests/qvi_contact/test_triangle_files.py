"""Problem files on triangles: in the file, in a mesh file, with parts by name, by segment and by box."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from qvi_contact import InputError, TriangleMesh, load_problem, solve
from qvi_contact.files import problem_from_toml, problem_to_toml
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Region, Traction
from tests.cases import examples, refusal, refused_at
from tests.qvi_contact.builders import PROBLEMS, RICH, TRIANGLES, same
from tests.qvi_contact.test_mesh_files import INP, MSH_2, MSH_4

WITH_FILE = (PROBLEMS / "part.toml").read_text(encoding="utf-8")


@st.composite
def problems(draw):
    """Turned and distorted rectangles with a joint, regions and conditions by either kind of component."""
    cells = (draw(st.integers(2, 4)), draw(st.integers(2, 4)))
    mesh = TriangleMesh.rectangle(cells, draw(st.floats(0.5, 5.0)), 1.0)
    mesh = mesh.with_joint("bed", lambda x, y: (np.abs(y - round(cells[1] / 2) / cells[1]) < 1e-9) & (x > 0.0))
    mesh = mesh.with_region(draw(st.sampled_from(["core", 'a "b"', "c.d"])), lambda x, y: x < mesh.length / 2 + 0 * y)
    angle, shift = draw(st.floats(-3.0, 3.0)), draw(st.floats(-1e3, 1e3))
    bent = mesh.vertices + 0.02 * np.sin(7.0 * mesh.vertices[:, ::-1])
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    mesh = TriangleMesh(bent @ turn + shift, mesh.cells, mesh.edge_sets, mesh.regions)
    number = st.floats(-1e3, 1e3).map(float)
    conditions = [
        Displacement("top", normal=draw(number), tangential=draw(number)),
        Traction("left", normal=draw(number), tangential=draw(number), name="wind"),
        Traction("right", x=draw(number), y=draw(number)),
        Contact("bottom", friction=0.3, gap=draw(number)),
    ]
    conditions += [Contact.tied("bed")] if draw(st.booleans()) else []
    regions = [Region(Material(7.0, 0.1), name=mesh.region_names[0])] if draw(st.booleans()) else []
    return ContactProblem(mesh, Material(1.0, 0.3), conditions, regions=regions)


@settings(max_examples=examples(12), derandomize=True, deadline=None, suppress_health_check=list(HealthCheck))
@given(problems())
def test_round_trip(problem):
    text = problem_to_toml(problem)
    assert same(problem_from_toml(text).problem, problem)
    assert max(map(len, text.splitlines())) <= 120


class TestMeshFiles:
    """[mesh] file."""

    @pytest.mark.parametrize(("kind", "text"), [("a.msh", MSH_2), ("sub/b.msh", MSH_4), ("c.inp", INP)])
    def test_names_of_the_file_are_edges_joints_and_regions(self, tmp_path, kind, text):
        pytest.importorskip("meshio")
        (tmp_path / "sub").mkdir()
        (tmp_path / kind).write_text(text)
        (tmp_path / "part.toml").write_text(WITH_FILE.replace("part.msh", kind))
        (tmp_path / "sub" / "link.toml").symlink_to(tmp_path / "part.toml")
        problem = (file := load_problem(tmp_path / "sub" / "link.toml")).problem
        assert file.files == {kind: (tmp_path / kind).resolve()}
        assert problem.mesh.edge_names == ("floor", "roof", "sides", "wall")
        assert problem.mesh.joint_names == ("seam",)
        assert problem.cell_materials.tolist() == [1, 0]
        assert same(problem_from_toml(problem_to_toml(problem)).problem, problem)  # without the mesh file
        result = solve(problem, degree=3)
        assert result.status == "solved"
        assert result.contacts["floor"].normal_force > 0.0

    @pytest.mark.parametrize("name", ["none.msh", "part.toml", ".", "a\\u0000.msh", "x.msh" * 19])
    def test_what_is_no_mesh_file_is_named(self, tmp_path, name):
        (tmp_path / "part.toml").write_text(WITH_FILE.replace("part.msh", name))
        with refused_at("mesh.file"):
            load_problem(tmp_path / "part.toml")

    @pytest.mark.usefixtures("in_tmp_path")
    def test_a_text_without_a_place_reads_no_file_and_one_body_is_not_joined(self, tmp_path):
        (tmp_path / "part.msh").write_text(MSH_2)
        with pytest.raises(InputError, match="load_problem"):
            problem_from_toml(WITH_FILE)
        assert problem_from_toml(WITH_FILE, tmp_path).problem.mesh.cell_count == 2
        with refused_at("mesh.join", "no pieces", "line"):
            problem_from_toml(WITH_FILE.replace("[mesh]", '[mesh]\njoin = "line"'), tmp_path)

    def test_files_beyond_measure_are_refused_before_they_are_read(self, tmp_path):
        pytest.importorskip("h5py")
        meshio = pytest.importorskip("meshio")
        path = tmp_path / "part.msh"
        with path.open("wb") as stream:
            stream.truncate(200_000_001)  # takes no room
        with pytest.raises(InputError, match="coarser"):
            TriangleMesh.load(path)
        many = meshio.Mesh(np.zeros((3, 2)), [("triangle", np.zeros((1_000_001, 3), dtype=int))])
        meshio.med.write(tmp_path / "many.med", many)
        with pytest.raises(InputError, match="1000001 triangles"):
            TriangleMesh.load(tmp_path / "many.med")


@pytest.mark.parametrize(
    ("old", "new", "field", "words"),
    [
        ("[[0, 1, 3], ", "[[0, 1, 9], ", "mesh.triangles", "0 to 5"),
        ("[[0, 1, 3], ", "[[0, 1], ", "mesh.triangles[0]", "3 entries"),
        ("[[0, 1, 3], ", "[[0, 1, 1], ", "mesh", "no area"),
        ("seam = [[1, 4]]", "seam = [[0, 4]]", "mesh.edges.seam", "no edge"),
        ("seam = [[1, 4]]", "seam = []", "mesh.edges.seam", "one or more"),
        ("seam = [[1, 4]]", "seam = [[1, 4], [0, 1]]", "mesh.edges.seam", "two sets"),
        ("left = [0, 1]", "left = [0, 7]", "mesh.regions.left", "0 to 3"),
        ("[mesh]", "[mesh]\nfile = \"a.msh\"", "mesh.vertices", "one of these"),
        ("[mesh]", "[mesh]\nrefine = { largest = 1.0 }", "mesh.refine", "leave it out"),
        ("[[0.0, 1.0], [2.0, 1.0]]", "[[0.0, 1.0], [1.5, 1.0]]", "edges[0].segment", "(1, 1)"),
        ("[[0.0, 1.0], [2.0, 1.0]]", "[[0.0, 1.5], [2.0, 1.5]]", "edges[0].segment", "no edge of the boundary"),
        ("[[0.0, 1.0], [2.0, 1.0]]", "[[0.0, 1.0], [0.0, 1.0]]", "edges[0].segment", "two different"),
        ("box = { x = [-0.1, 0.1] }", "box = { x = [0.3, 0.4] }", "edges[1].box", "larger"),
        ("box = { x = [-0.1, 0.1] }", "box = {}", "edges[1].box", "range of x"),
        ("box = { x = [-0.1, 0.1] }", "box = { x = [0.1, -0.1] }", "edges[1].box.x", "smaller end"),
        ("box = { x = [-0.1, 0.1] }", 'side = "left"', "edges[1].segment", "sides"),
        ("box = { x = [-0.1, 0.1] }", 'box = { x = [-0.1, 0.1] }\nside = "left"', "edges[1].box", "one of"),
        ("box = { x = [-0.1, 0.1] }", "box = { x = [-0.1, 0.1] }\nat = 1.0", "edges[1].at", "leave it out"),
        ("[[1.0, 0.1], [0.0, 1.0]]", "[[0.0, 0.0], [1.0, 0.1]]", "joints[0].segment", "inside the body"),
        ("segment = [[1.0, 0.1], [0.0, 1.0]]", 'direction = "vertical"\nat = 1.0', "joints[0].segment", "directions"),
        ('name = "left"', 'name = "right"', "regions[0]", "left, unused"),
        ('name = "left"', "", "regions[0].name", "name a region"),
        ("x = [1.0, 2.0]", "x = [0.5, 2.0]", "regions[1]", "cuts the triangle"),
        ("x = [1.0, 2.0]", 'name = "left"\nx = [1.0, 2.0]', "regions[1].name", "exists already"),
        ('edges = "end"', 'edges = "ende"', "tractions[1].edges", "[[edges]]"),
        ("degree = 3", "degree = 40", "solve.degree", "3 to 12"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_by_its_place(old, new, field, words):
    assert old in TRIANGLES
    text = TRIANGLES.replace(old, new, 1)
    if field.startswith("solve"):
        file = problem_from_toml(text)
        with pytest.raises(InputError, match=words) as caught, file.named_errors():
            solve(file.problem, **file.solve_options)
        found = caught.value
    else:
        found = refusal(problem_from_toml, text)
    assert found.field == field
    assert words in str(found)


@pytest.mark.parametrize(
    ("old", "new"),
    [('side = "top"\nat = 1.0', "segment = [[0, 1], [0.5, 1]]\n[[edges]]\nname = 'roof'\nsegment = [[0.5, 1], [1, 1]]"),
     ('direction = "horizontal"\nat = 0.5\nstop = 1.0', "segment = [[0.0, 0.5], [1.0, 0.5]]")],
)  # fmt: skip
def test_parts_of_a_grid_may_be_named_by_segments(old, new):
    assert old in RICH
    assert same(*(problem_from_toml(text).problem for text in (RICH, RICH.replace(old, new))))
