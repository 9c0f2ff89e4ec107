"""Meshes from other programs: names come along, broken files and such that claim more than they hold are refused."""

import os
import tracemalloc
from pathlib import Path
from struct import pack

import numpy as np
import pytest

from qvi_contact import InputError, TriangleMesh
from solvers.basics import handlers_kept

meshio = pytest.importorskip("meshio")
MUCH = 300_000_000
STEP = "ENS_MAA/mesh/-0000000000000000001-0000000000000000001"  # of a file of MED
SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
HALVES = [(0, 1, 2), (0, 2, 3)]
MSH_2, MSH_4, INP = (
    Path(__file__).with_name(name).read_text(encoding="utf-8") for name in ("named_2.msh", "named_4.msh", "named.inp")
)


def med_file(path):
    """A MED file as Salome writes it: names are groups of families."""
    h5py = pytest.importorskip("h5py")
    points = np.array([*SQUARE, (5.0, 5.0)])
    blocks = [("line", np.array([[0, 1], [0, 2]])), ("triangle", np.array(HALVES))]
    tags = [np.array([-6, -7]), np.array([-8, 0])]
    mesh = meshio.Mesh(points, blocks, cell_data={"cell_tags": tags})
    mesh.cell_tags = {-6: ["floor"], -7: ["seam"], -8: ["steel"]}
    mesh.point_tags = {}
    meshio.med.write(path, mesh)
    assert h5py.is_hdf5(path)


class TestFiles:
    """Gmsh, and by meshio Abaqus and MED."""

    @pytest.mark.parametrize(("name", "text"), [("a.msh", MSH_2), ("b.MSH", MSH_4), ("c.inp", INP), ("d.med", None)])
    def test_names_of_curves_and_surfaces(self, tmp_path, name, text):
        path = tmp_path / name
        if text is None:
            med_file(path)
        else:
            path.write_text(text)
        mesh, names = TriangleMesh.load(path), ("steel", "rest") if text is MSH_4 else ("steel",)
        assert (mesh.edge_names, mesh.joint_names, mesh.region_names) == (("floor",), ("seam",), names)
        assert mesh.vertices == pytest.approx(np.array(SQUARE))
        assert mesh.cells.tolist() == [[0, 1, 2], [0, 2, 3]]
        assert [mesh.edge_sets[name].tolist() for name in ("floor", "seam")] == [[[0, 1]], [[0, 2]]]
        assert mesh.regions["steel"].tolist() == [0]

    @pytest.mark.parametrize(
        ("name", "text", "told"),
        [("a.stl", "", "endings"), ("a.msh", None, "no such file"), ("a.msh", "nonsense", "cannot be read"),
         ("a.msh", "", "cannot be read"), ("a.inp", INP.replace("CPS3", "CPE9"), "cannot be read"),
         *(("a.inp", INP.replace("2, 1, 0", "2, 1, nan").replace("CPS3\n3, 1, 2, 3\n4, 1, 3", f"{new}, 1, 2, 3"), told)
           for new, told in (("C3D4\n3", "'C3D4'"), ("CPS4\n3", "no finite"))),
         ("a.inp", INP.partition("*ELEMENT, TYPE=CPS3")[0], "no triangles"),
         ("a.msh", MSH_2.replace("3 1 1 0\n", "3 1 1 1\n"), "not plane"), ("a.med", "nonsense", "as .msh"),
         *(("a.msh", MSH_4.replace("4.1 0 8", f"{v} 0 8"), "4.1 or 2.2") for v in ("4.0", "4", "3", "1"))],
    )  # fmt: skip
    def test_what_cannot_be_read_is_told_in_one_line(self, tmp_path, capsys, name, text, told):
        path = tmp_path / name
        if text is not None:
            path.write_text(text)
        with pytest.raises(InputError, match=told) as caught:
            TriangleMesh.load(path)
        assert "\n" not in str(caught.value)
        assert capsys.readouterr() == ("", "")

    def test_names_may_be_given_to_some_curves_and_surfaces_only(self, tmp_path):
        changes = [("0 1 4 0\n", "0 0 0\n"), ("0 1 2 0\n", "0 0 0\n")]
        mesh = TriangleMesh.load(written(tmp_path / "a.msh", MSH_4, *changes))
        assert (mesh.edge_names, mesh.joint_names, mesh.region_names) == (("floor",), (), ("steel",))
        assert mesh.cells.tolist() == [[0, 1, 2], [0, 2, 3]]
        assert [entry.name for entry in tmp_path.iterdir()] == ["a.msh"]

    @pytest.mark.parametrize("binary", [0, 1])
    def test_gmsh_itself_writes_such_files(self, tmp_path, binary):
        gmsh = pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
        with handlers_kept():
            gmsh.initialize(interruptible=False)
        try:
            gmsh.option.setNumber("General.Terminal", 0)
            gmsh.option.setNumber("Mesh.SaveAll", 1)
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.model.occ.addRectangle(0.0, 0.0, 0.0, 2.0, 1.0)
            gmsh.model.occ.synchronize()
            gmsh.model.addPhysicalGroup(1, [1], name="floor")
            gmsh.model.mesh.generate(2)
            gmsh.write(str(tmp_path / "a.msh"))
        finally:
            gmsh.finalize()
        assert TriangleMesh.load(tmp_path / "a.msh").edges("floor").length.sum() == pytest.approx(2.0)

    def test_without_meshio_the_command_to_type_is_told(self, tmp_path, without):
        (tmp_path / "a.vtk").write_text("")
        without("meshio.vtk")
        assert "pip install" in refusal(tmp_path / "a.vtk")


def refusal(path):
    """The error of a file, which is one line and takes little memory."""
    with pytest.raises(InputError):  # loads what reading needs once
        TriangleMesh.load(path)
    tracemalloc.start()
    try:
        with pytest.raises(InputError) as caught:
            TriangleMesh.load(path)
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()
    assert caught.value.field == "mesh"
    assert "\n" not in str(caught.value)
    return str(caught.value)


def written(path, text, *changes):
    """A file of the text with changes, each of a part that is there."""
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path.write_text(text)
    return path


class TestGmsh:
    """Counts, tags and sections."""

    @pytest.mark.parametrize(
        ("text", "old", "new"),
        [(MSH_4, "$Nodes\n1 5", f"$Nodes\n1 {MUCH}"), (MSH_4, "$Nodes\n1 5", f"$Nodes\n{MUCH} 5"),
         (MSH_4, "$Nodes\n1 5 1 5\n2 1 0 5", f"$Nodes\n1 {MUCH} 1 5\n2 1 0 {MUCH}"),
         (MSH_4, "$Nodes\n1 5 1 5\n2 1 0 5", "$Nodes\n1 4 1 5\n2 1 0 4"),
         (MSH_4, "$Nodes\n1 5 1 5\n2 1 0 5", "$Nodes\n1 5 1 5\n2 1 1 5"),
         (MSH_4, "$Elements\n4 4", f"$Elements\n{MUCH} 4"), (MSH_4, "$Elements\n4 4", "$Elements\n3 4"),
         (MSH_4, "1 1 1 1\n", f"1 1 1 {MUCH}\n"), (MSH_4, "1 1 1 1\n", f"1 1 1 {2**63}\n"),
         (MSH_4, "0 2 2 0\n", f"{MUCH} 2 2 0\n"), (MSH_4, "0 1 1 0\n", f"0 {MUCH} 1 0\n"),
         (MSH_4, "0 1 1 0\n", f"0 1 1 {MUCH}\n"),
         (MSH_4, "$PhysicalNames\n4", f"$PhysicalNames\n{MUCH}"), (MSH_4, "\n5\n0 0 0\n", "\n4\n0 0 0\n"),
         (MSH_4, "\n5\n0 0 0\n", f"\n{2**53}\n0 0 0\n"),
         (MSH_4, "\n5\n0 0 0\n", "\n0\n0 0 0\n"), (MSH_4, "$EndElements", ""), (MSH_4, "$PhysicalNames", "$Nodes"),
         (MSH_2, "$Nodes\n5", f"$Nodes\n{MUCH}"), (MSH_2, "$Nodes\n5", "$Nodes\n4"),
         (MSH_2, "$Nodes\n5", "$Nodes\n-1"), (MSH_2, "9 5 5 0", "9.5 5 5 0"), (MSH_2, "9 5 5 0", "nan 5 5 0"),
         (MSH_2, "$Elements\n4", f"$Elements\n{MUCH}"), (MSH_2, "$Elements\n4", "$Elements\n3"),
         (MSH_2, "3 2 2 3 1 1 2 3", "3 2 2 3 1 1 2 7"), (MSH_2, "3 2 2 3 1 1 2 3", "3 2 2 3 1 1 2 70"),
         (MSH_2, "1 1 2 1 1 1 2", "1 1 2 1 1 1 7"), (MSH_2, "3 2 2 3 1 1 2 3", "3 2 2 3 1 1 2 0"),
         (MSH_4, "3 1 2 3", "3 1 2 7"), (MSH_4, "3 1 2 3", "3 1 2 0")],
    )  # fmt: skip
    def test_what_is_claimed_and_not_held_and_nodes_that_are_not_there(self, tmp_path, text, old, new):
        refusal(written(tmp_path / "a.msh", text, (old, new)))

    def test_numbers_with_gaps_are_read_and_take_no_memory(self, tmp_path):
        path = written(tmp_path / "a.msh", "\ufeff" + MSH_4, ("\n5\n0 0 0", f"\n{MUCH}\n0 0 0"))
        assert TriangleMesh.load(path).cells.tolist() == [[0, 1, 2], [0, 2, 3]]

    @pytest.mark.parametrize("text", [MSH_2, MSH_4])
    def test_sections_that_no_mesh_needs_are_not_read(self, tmp_path, text):
        """Periodic nodes and fields, whose counts are wrong here."""
        more = f'$Periodic\n{MUCH}\n$EndPeriodic\n$NodeData\n1\n"a"\n0\n3\n0\n{MUCH}\n{MUCH}\n$EndNodeData\n'
        assert TriangleMesh.load(written(tmp_path / "a.msh", text + more)).region_names[0] == "steel"

    def test_names_times_elements(self, tmp_path):
        """Each element may have all names."""
        names = "".join(f'1 {number} "{number}"\n' for number in range(10, 5_010))
        elements = "1 1 1 20001\n" + 20_000 * "7 1 2\n"
        changes = [("$PhysicalNames\n4\n", f"$PhysicalNames\n5004\n{names}"), ("$Elements\n4 4", "$Elements\n4 20003")]
        path = written(tmp_path / "a.msh", MSH_4, *changes, ("1 1 1 1\n", elements))
        with pytest.raises(InputError, match="names"):
            TriangleMesh.load(path)

    @pytest.mark.parametrize("kind", ["gmsh", "gmsh22"])
    @pytest.mark.parametrize("binary", [False, True])
    def test_what_meshio_writes_is_read(self, tmp_path, kind, binary):
        """Blocks of one element and of several, each named but the last; fields are read over."""
        mesh, parts = TriangleMesh.rectangle((2, 2)), np.repeat([1, 2, 3], [3, 4, 1])
        lines = {"floor": mesh.pairs("bottom"), "seam": np.array([[1, 4]])}
        blocks = [("line", pairs) for pairs in lines.values()]
        blocks += [("triangle", mesh.cells[parts == part]) for part in (1, 2, 3)]
        given = {
            name: [np.full(len(cells), tag) for tag, (_, cells) in zip(tags, blocks, strict=True)]
            for name, tags in (("gmsh:physical", (1, 2, 7, 4, 5)), ("gmsh:geometrical", (1, 2, 1, 2, 3)))
        }
        nodes = {"gmsh:dim_tags": np.array([[1, 1], [1, 2], [2, 1], [2, 2], *[[2, 3]] * 5]), "heat": np.arange(9.0)}
        names = {"floor": (1, 1), "seam": (2, 1), "one": (7, 2), "two": (4, 2)}
        names = {name: np.array(tags) for name, tags in names.items()}
        written = meshio.Mesh(np.c_[mesh.vertices, np.zeros(9)], blocks, nodes, given, names)
        meshio.write(tmp_path / "a.msh", written, file_format=kind, binary=binary)
        found = TriangleMesh.load(tmp_path / "a.msh")
        assert found.same_as(mesh)
        assert (found.edge_names, found.joint_names) == (("floor",), ("seam",))
        assert all((found.pairs(name) == pairs).all() for name, pairs in lines.items())
        regions = {name: cells.tolist() for name, cells in found.regions.items()}
        assert regions == {"one": [0, 1, 2], "two": [3, 4, 5, 6]}

    def test_elements_with_nothing_but_a_physical_number(self, tmp_path):
        """In a binary file, where those of one kind may be one block."""
        nodes = b"".join(pack("=i3d", n, x, y, 0.0) for n, (x, y) in enumerate(SQUARE, 1))
        elements = pack("=3i", 2, 2, 1) + pack("=10i", 1, 7, 1, 2, 3, 2, 8, 1, 3, 4)
        parts = [b"$MeshFormat\n2.2 1 8\n", pack("=i", 1), b"\n$EndMeshFormat\n$PhysicalNames\n2\n",
                 b'2 7 "one"\n2 8 "other"\n$EndPhysicalNames\n$Nodes\n4\n', nodes,
                 b"\n$EndNodes\n$Elements\n2\n", elements, b"\n$EndElements\n"]  # fmt: skip
        (tmp_path / "a.msh").write_bytes(b"".join(parts))
        regions = TriangleMesh.load(tmp_path / "a.msh").regions
        assert {name: cells.tolist() for name, cells in regions.items()} == {"one": [0], "other": [1]}

    def test_a_name_of_several_numbers_is_that_of_all(self, tmp_path):
        """And a triangle in several surfaces, which stands there once for each, is one; its partition is read over."""
        changes = [("$PhysicalNames\n3", '$PhysicalNames\n5\n1 8 "floor"\n2 9 "all"'), ("$Elements\n4", "$Elements\n7")]
        more = "3 2 4 3 1 1 7 1 2 3\n5 1 2 8 1 2 3\n6 2 2 9 1 1 2 3\n7 2 2 9 1 1 3 4\n"
        mesh = TriangleMesh.load(written(tmp_path / "a.msh", MSH_2, *changes, ("3 2 2 3 1 1 2 3\n", more)))
        assert mesh.pairs("floor").tolist() == [[0, 1], [1, 2]]
        assert {name: cells.tolist() for name, cells in mesh.regions.items()} == {"steel": [0], "all": [0, 1]}


class TestAbaqus:
    """Sets of elements."""

    def test_blocks_of_nodes_ranges_sets_of_sets_and_other_files(self, tmp_path):
        """Keywords that go on, comments that are set in, and reference points of an assembly among them."""
        nodes = "\ufeff*Node\n11, 2., 0.\n  ** the last one\n12, 2., 1.\n*Assembly\n*Node\n1, 9., 9.\n*End Assembly\n"
        (tmp_path / "ends.inc").write_text(f"{nodes}*Element, type=cpe4r,\nelset=STEEL, input=quad.inc\n")
        (tmp_path / "quad.inc").write_text("9, 2, 11, 12, 3\n")
        sets = "*NSET, NSET=top, ELSET=rest\n*ELSET, ELSET=both, GENERATE\n3, 4, 1\n"
        sets += "*ELSET, ELSET=all\nSteel, rest\n*ELSET, ELSET=rest\n4\n"
        text = INP.replace("5, 5, 5", "13, 0.5, 1") + "*ELEMENT, TYPE=T3D3, ELSET=lid\n7, 4, 13, 3\n" + sets
        mesh = TriangleMesh.load(written(tmp_path / "a.inp", f"{text}*INCLUDE, INPUT=ends.inc\n"))
        assert mesh.vertices.tolist() == [*map(list, SQUARE), [2.0, 0.0], [2.0, 1.0]]
        named = {name: numbers.tolist() for name, numbers in (*mesh.regions.items(), *mesh.edge_sets.items())}
        lines = {"floor": [[0, 1]], "seam": [[0, 2]], "lid": [[2, 3]], "top": [[0, 3], [2, 3]]}
        assert named == {"steel": [0, 2, 3], "all": [0, 1, 2, 3], "rest": [1], "both": [0, 1], **lines}

    @pytest.mark.parametrize(("kind", "side", "seam"), [("CPS3", "S2", "S3"), ("S3", "S4", "S5"), ("M3D3", "E2", "E3")])
    def test_surfaces_and_node_sets(self, tmp_path, kind, side, seam):
        """Two squares, the right one cut in two: by elements, sides and nodes, in a part and its assembly."""
        text = f"""*PART, NAME=P\n*NODE, NSET=Nodes\n1, , 0D0,\n2, 1.0d0, ,\n3, 1, 1\n4, 0, 1\n5, 2, 0\n6, 2, 1
        *NODE\n7, 9, 9\n*ELEMENT, TYPE=CPS4\n1, 1, 2, 3, 4\n*ELEMENT, TYPE={kind}, ELSET=right\n2, 2, 5, 6\n3, 2, 6, 3
        *ELEMENT, TYPE=T2D2, ELSET=wall\n4, 4, 1\n*NSET, NSET=Base\n5, 1, 2, 7\n*NSET, NSET=Twice\n1, 2
        *NSET, NSET=_Picked, INTERNAL\n1, 2\n*ELSET, ELSET=Base\n1, 2\n*ELSET, ELSET=Twice\n1
        *SURFACE, NAME="Right"\n"right",\n*SURFACE, NAME=Top\n1, S3\n3, E2\n3, S7\n1, SPOS
        *SURFACE, NAME=Two, COMBINE=UNION\nTop, Right
        *SURFACE, NAME=Rigid, TYPE=SEGMENTS\nSTART, 0, 0\n*SURFACE, NAME=Floor, TYPE=NODE\nBase, 1.0\n*END PART
        *ASSEMBLY\n*INSTANCE, NAME=I, PART=P\n*END INSTANCE\n*NSET, NSET=Twice, INSTANCE=I\n2, 5\n*ELSET, ELSET=Twice\n2
        *NODE\n3, 9, 9\n6, 9, 9\n*NSET, NSET=Points, GENERATE\n3, 6, 3\n*NSET, NSET=Rim, ELSET=I."Twice"\n3, 6
        *ELEMENT, TYPE=CONN2D2, ELSET=Links\n8, 3, I.3\n*ELSET, ELSET=All Links\nLinks
        *ELSET, ELSET=_S2, INTERNAL, INSTANCE=I\n2\n*SURFACE, NAME=Side\n_S2, {side}\n*SURFACE, NAME=wall\n1, S1
        *NSET, NSET=Low, GENERATE\n1, 2, 1\n*SURFACE, NAME=West\n"I"."wall", SPOS\n*SURFACE, NAME=Seam\n3, {seam}"""
        mesh = TriangleMesh.load(written(tmp_path / "a.inp", text))
        middle = {name: mesh.vertices[mesh.pairs(name)].mean(axis=1).tolist() for name in mesh.edge_sets}
        below, above, east, west = [[0.5, 0.0], [1.5, 0.0]], [[0.5, 1.0], [1.5, 1.0]], [2.0, 0.5], [0.0, 0.5]
        assert {name: sorted(points) for name, points in middle.items()} == {
            "wall": [west], "Base": below, "Floor": below, "Low": below[:1], "Right": [below[1], above[1], east],
            "Top": above, "Seam": [[1.0, 0.5]], "Side": [east], "West": [west], "Rim": [west, below[0], above[0]],
            "Nodes": sorted([*below, *above, east, west]), "Twice": below[1:], "I.Twice": below[:1],
        }  # fmt: skip
        regions = {name: len(cells) for name, cells in mesh.regions.items()}
        assert regions == {"right": 2, "Base": 3, "Twice": 1, "I.Twice": 2}

    @pytest.mark.parametrize(
        ("new", "told"),
        [("*PART\n*END PART\n*PART\n", "several parts"), ("*INSTANCE, NAME=a\n0, 1, 0\n", "INSTANCE"),
         ("*NODE, SYSTEM=C\n", "moves or makes"), ("*NODE\n1, 0, 9\n", "two nodes"), ("*NGEN\n1, 3, 1\n", "NGEN"),
         ("*ELSET, ELSET=a, GENERATE\n1, 1000000000000, 0\n", "zero"), ("*INCLUDE, INPUT=a.inp\n", "includes"),
         ("*ELSET, ELSET=a\nb\n", "no set B"), ("*NSET, NSET=a\nb\n", "no set B"),
         ("*ASSEMBLY\n*ELEMENT, TYPE=CPS3\n9, 1, 2, 3\n", "of an assembly"),
         ("*ELEMENT, TYPE=CPS4\n9, 1, 2, 3\n", "reshape"), ("*ELEMENT, TYPE=CPS3\n9, 1, 2, 7\n", "joins nodes")],
    )  # fmt: skip
    def test_what_is_not_read_is_told(self, tmp_path, new, told):
        assert told in refusal(written(tmp_path / "a.inp", INP, ("*NODE\n", f"{new}*NODE\n")))


def test_nodes_that_are_not_there_in_a_file_of_med(tmp_path):
    med_file(tmp_path / "a.med")
    with pytest.importorskip("h5py").File(tmp_path / "a.med", "r+") as file:
        file[f"{STEP}/MAI/TR3/NOD"][0] = 9
    assert "nodes" in refusal(tmp_path / "a.med")


class TestQuadrilaterals:
    """Each is cut in two."""

    @pytest.mark.parametrize("name", ["a.vtk", "a.vtu", "a.inp", "a.msh"])
    def test_a_grid_of_them_has_the_triangles_of_a_grid(self, tmp_path, name):
        """Rectangles in corners of the body are cut from there; the first triangle has the region of its rectangle."""
        grid = TriangleMesh.grid(*[np.arange(5.0)] * 2)
        first = (np.arange(4) + 5 * np.arange(4)[:, None]).ravel()
        points, quads = np.pad(grid.vertices, [(0, 0), (0, 1)]), first[:, None] + [0, 1, 6, 5]
        given = {"gmsh:physical": [np.repeat([1, 2], 8)], "gmsh:geometrical": [np.repeat([1, 2], 8)]}
        more = (given, {"low": np.array([1, 2])}) if name == "a.msh" else ({}, {})
        dimensions = {"gmsh:dim_tags": np.full((25, 2), (2, 1))} if name == "a.msh" else {}
        kind = {"file_format": "gmsh22"} if name == "a.msh" else {}
        meshio.write(tmp_path / name, meshio.Mesh(points, [("quad", quads)], dimensions, *more), **kind)
        mesh = TriangleMesh.load(tmp_path / name)
        assert len(mesh.cells) == 32
        assert (mesh.topology.boundary[mesh.topology.of_cells].sum(axis=1) < 2).all()
        corners = mesh.cells[[0, 1, 6, 7, 24, 25, 30, 31]]
        assert set(map(frozenset, grid.cells.tolist())) >= set(map(frozenset, corners.tolist()))
        if name == "a.msh":
            assert mesh.regions["low"].tolist() == list(range(16))

    def test_the_cut_lies_inside_and_leaves_no_needle(self, tmp_path):
        """Of a dart, and of a kite beside a triangle."""
        points = np.array([(0, 0), (4, 0), (1, 1), (0, 4), (-1, 1), (-9, -9)], dtype=float)
        blocks = [("quad", np.array([[0, 1, 2, 3]])), ("triangle", np.array([[0, 3, 4]]))]
        for points[2] in ((1.0, 1.0), (0.5, 3.0)):  # the second is convex: its corners 0 and 2 are nearer
            meshio.write(tmp_path / "a.vtk", meshio.Mesh(np.c_[points, np.zeros(6)], blocks))
            assert TriangleMesh.load(tmp_path / "a.vtk").cells.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4]]

    @pytest.mark.parametrize(("kind", "count"), [("quad8", 8), ("quad9", 9), ("quad16", 16)])
    def test_of_higher_order_they_are_their_corners(self, tmp_path, kind, count):
        points = np.zeros((16, 3))
        points[:9, :2] = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)]
        body = meshio.Mesh(points[:count], [(kind, np.arange(count)[None])])
        meshio.write(tmp_path / "a.msh", body, file_format="gmsh22")
        assert TriangleMesh.load(tmp_path / "a.msh").cells.tolist() == [[0, 1, 2], [0, 2, 3]]


@pytest.mark.skipif(os.name != "posix", reason="there are no such files")
def test_pipes_are_not_waited_for_and_folders_not_called_missing(tmp_path):
    os.mkfifo(tmp_path / "a.msh")
    assert "regular" in refusal(tmp_path / "a.msh")
    (tmp_path / "b.msh").mkdir()
    assert "cannot be read" in refusal(tmp_path / "b.msh")
