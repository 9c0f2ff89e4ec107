"""Bodies given by their outline: arcs, holes, inner lines, sizes, and what gmsh makes of them."""

import math
import signal
import sys
from contextlib import nullcontext

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from qvi_contact import Corner, InputError, TriangleMesh, load_problem, solve
from qvi_contact.files import problem_from_toml, problem_to_toml
from qvi_contact.mesh import polygons
from tests.cases import examples, refused_at
from tests.qvi_contact.builders import PROBLEMS, area

try:
    import gmsh
except (ImportError, OSError) as error:  # OSError: a library of the system is missing
    gmsh, MISSING = None, str(error)
else:
    MISSING = ""
needs_gmsh = pytest.mark.skipif(gmsh is None, reason=f"gmsh cannot be loaded: {MISSING}")


PLAIN = {"holes": (), "joints": None, "regions": None, "sizes": None}
SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
ARCH = [Corner((0.0, 0.0), "base"), Corner((2.0, 0.0), "side", size=0.05)]
ARCH += [Corner((2.0, 1.0), "arch", centre=(1.0, 1.0)), Corner((0.0, 1.0), "side")]
INSIDE = {
    "holes": [Corner.circle((1.0, 1.0), 0.4, "bore", size=0.1)],
    "joints": {"seam": [(0.0, 0.4), (2.0, 0.4)]},
    "regions": {"core": [(0.2, 0.1), (0.8, 0.1), (0.8, 0.3), (0.2, 0.3)]},
    "sizes": {(1.0, 0.2): 0.05},
}


def enclosed(polygon):
    x, y = polygon.pieces[:, 0].T
    return abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0


class TestPolygons:
    """What is done before gmsh is called."""

    @pytest.mark.parametrize("clockwise", [False, True])
    @pytest.mark.parametrize(("size", "last"), [(0.5, 0.5), (0.1, 0.1), (10.0, 10.0), (0.3, 0.02), (0.02, 0.3)])
    def test_points_of_an_arc_lie_on_its_circle(self, clockwise, size, last):
        start, stop = Corner((1.0, 0.0), "arc", (0.0, 0.0), clockwise), Corner((0.0, 1.0), size=last)
        line = polygons([start, stop, (3.0, 3.0) if clockwise else (-3.0, -3.0)], size, **PLAIN).boundary[0]
        chords = [piece for piece, name in zip(line.pieces, line.names, strict=True) if name == "arc"]
        assert np.hypot(*np.array(chords).reshape(-1, 2).T) == pytest.approx(1.0)
        angles = 2.0 * np.arcsin(np.hypot(*np.diff(chords, axis=1)[:, 0].T) / 2.0)
        size, last = (last, size) if clockwise else (size, last)  # lines of the boundary run counterclockwise
        assert angles.sum() == pytest.approx((1.5 if clockwise else 0.5) * np.pi)
        assert angles[1:] / angles[:-1] == pytest.approx((last / size) ** (1.0 / len(angles)))
        assert angles.max() <= min(max(size, last), np.pi / 6.0) * (1.0 + 1e-12)
        assert line.sizes[line.names == "arc", 0] == pytest.approx(np.geomspace(size, last, len(angles) + 1)[:-1])

    @settings(max_examples=examples(20), derandomize=True, deadline=None, suppress_health_check=list(HealthCheck))
    @given(st.lists(st.floats(0.3, 3.0), min_size=3, max_size=9), st.floats(-1e3, 1e3), st.booleans(), st.data())
    def test_lines_that_cross_are_found(self, radii, shift, reverse, data):
        """A star around a centre is a body; with two of its corners exchanged it mostly is none."""
        count = len(radii)
        angles = 2.0 * np.pi * np.arange(count) / count
        star = np.array(radii)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)]) + shift
        star = star[::-1] if reverse else star
        assert enclosed(polygons([tuple(p) for p in star.tolist()], 1.0, **PLAIN).boundary[0]) > 0.0
        if count > 3:
            k = data.draw(st.integers(0, count - 1))
            mixed = star.copy()
            mixed[[k, (k + 1) % count]] = mixed[[(k + 1) % count, k]]
            with nullcontext() if _simple(mixed) else pytest.raises(InputError, match="cross or touch"):
                polygons([tuple(p) for p in mixed.tolist()], 1.0, **PLAIN)

    @pytest.mark.parametrize(
        ("changes", "field", "words"),
        [
            ({"corners": SQUARE[:2]}, "corners", "three or more"),
            ({"corners": "abc"}, "outline", "list of corners"),
            ({"corners": [*SQUARE, (0.0, 1.0)]}, "corners", "one after the other"),
            ({"corners": [*SQUARE, (0.5, 0.5), (0.0, 1.0)]}, "outline", "cross or touch"),
            ({"corners": [(0, 0), (2, 0), (2, 2), (1, 0), (0, 2)]}, "outline", "cross or touch"),
            ({"corners": [(0, 0), (1, math.nan), (1, 1)]}, "Corner.at", "finite"),
            ({"corners": [(0, 0), (1, 0, 0), (1, 1)]}, "Corner.at", "pair"),
            ({"corners": [Corner((0, 0), centre=(0.4, 0.0)), (1, 0), (1, 1)]}, "corners", "from its centre"),
            ({"corners": [Corner((0, 0), centre=(0.5, -1e17)), (1, 0), (1, 1)]}, "corners", "too far"),
            ({"corners": Corner.circle((0.0, 0.0), 1e50, size=1e-50)}, "corners", "chords"),
            ({"size": 0.0}, "size", "greater than 0"),
            ({"size": 1e-9}, "size", "too small"),
            ({"size": 1e-4}, "size", "triangles"),
            ({"sizes": {(0.5, 0.5): -1.0}}, "sizes[(0.5, 0.5)]", "greater than 0"),
            ({"sizes": {(0.5, 1.5): 0.1}}, "sizes", "points of the body"),
            ({"holes": [Corner.circle((0.5, 0.5), 0.2)], "sizes": {(0.5, 0.5): 0.1}}, "sizes", "points of the body"),
            ({"holes": [Corner.circle((0.5, 0.5), 0.5)]}, "outline", "cross or touch"),
            ({"holes": [Corner.circle((2.5, 0.5), 0.2)]}, "holes[0]", "not inside"),
            ({"holes": [Corner.circle((0.5, 0.5), r) for r in (0.3, 0.1)]}, "holes[1]", "not inside"),
            ({"holes": Corner.circle((0.5, 0.5), 0.3)}, "outline", "lists for holes"),
            ({"corners": [*SQUARE, (0.0, 1.0 - 1e-9)]}, "outline", "one after the other"),
            ({"corners": [(x + 1e7, y) for x, y in SQUARE]}, "corners", "to the origin"),
            ({"joints": {"seam": [(0.5, 1e-7), (0.5, 0.5)]}}, "outline", "nearly lies"),
            ({"holes": [Corner.circle((0.5, 0.5), 0.4999999)]}, "outline", "nearly lies"),
            ({"joints": {"": [(0, 0), (1, 1)]}}, "joints", "not empty"),
            ({"joints": {"seam": [(0, 0)]}}, "joints.seam", "two or more"),
            ({"joints": {"seam": [[(0, 0), (1, 1)], [(0, 0)]]}}, "joints.seam[1]", "two or more"),
        ],
    )  # fmt: skip
    def test_what_is_no_outline_is_refused(self, changes, field, words):
        with refused_at(field, words):
            polygons(**PLAIN | {"corners": SQUARE, "size": 0.5} | changes)


def _simple(points):
    """Whether a polygon does not cross itself, in the plainest way; no three of the corners are on one line."""
    start, n = points @ [1.0, 1.0j], len(points)
    side = (np.roll(start, -1) - start)[:, None]
    is_left = ((start - start[:, None]) / side).imag > 0.0  # of side i is corner j
    parts = is_left != np.roll(is_left, -1, axis=1)  # side i the ends of side j
    distance = np.abs(np.arange(n) - np.arange(n)[:, None])
    return not (parts & parts.T & (distance > 1) & (distance < n - 1)).any()


def test_where_a_library_of_the_system_is_missing_one_line_says_how_to_get_it(monkeypatch, tmp_path):
    """In the place of gmsh stands a module that fails as gmsh does then."""
    (tmp_path / "gmsh.py").write_text('raise OSError("libGLU.so.1: cannot open shared object file:\\nNo such file")')
    monkeypatch.delitem(sys.modules, "gmsh", raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match="apt-get install") as caught:
        TriangleMesh.outline(SQUARE, 0.5)
    assert len(str(caught.value).splitlines()) == 1


@pytest.fixture(scope="module")
def arch():
    return TriangleMesh.outline(ARCH, 0.2, **INSIDE)


@pytest.mark.parametrize("line", [Corner.circle((0.5, 0.5), 0.3), [*SQUARE[:3], SQUARE[0]]])
def test_a_joint_is_closed_by_an_arc_or_by_its_first_corner(line):
    joint = polygons([(-1.0, -1.0), (2.0, -1.0), (0.5, 3.0)], 0.4, **PLAIN | {"joints": {"pin": line}}).inner[0]
    assert joint.pieces[-1, 1] == pytest.approx(joint.pieces[0, 0])


@needs_gmsh
class TestMeshes:
    """What gmsh makes of an outline."""

    def test_the_triangles_fill_the_body(self, arch):
        shape = polygons(ARCH, 0.2, **INSIDE)
        assert area(arch) == pytest.approx(enclosed(shape.boundary[0]) - enclosed(shape.boundary[1]))
        assert area(arch.part(arch.region("core"))) == pytest.approx(0.6 * 0.2)
        assert len(arch.outlines) == 2

    def test_names_are_edges_and_joints(self, arch):
        assert set(arch.edge_names) == {"base", "side", "arch", "bore"}
        assert arch.joint_names == ("seam",)
        lengths = {name: arch.edges(name).length.sum() for name in ("base", "side", "seam")}
        assert lengths == pytest.approx({"base": 2.0, "side": 2.0, "seam": 2.0})
        for name, radius in (("arch", 1.0), ("bore", 0.4)):
            ends = arch.vertices[np.unique(arch.edge_sets[name])]
            assert np.hypot(*(ends - [1.0, 1.0]).T) == pytest.approx(radius)

    def test_holes_beside_other_lines(self):
        """Gmsh's triangles between hole and side are too flat for the arc: they are divided, or the size is refused."""
        body = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)]
        hole = [Corner.circle((1.0, 0.5), 0.45, name="bore")]
        for corners in (body, body[::-1]):  # in either sense
            mesh = TriangleMesh.outline(corners, 0.2, holes=hole, joints={"cut": [(0.0, 0.5), (0.55, 0.5)]})
            assert np.hypot(*(mesh.vertices[mesh.edge_sets["bore"]] - [1.0, 0.5]).T) == pytest.approx(0.45, rel=1e-12)
            assert mesh.edges("cut").length.sum() == pytest.approx(0.55)
        with refused_at("size", "crosses a line, or is too close"):
            TriangleMesh.outline(body, 1.0, holes=hole)

    def test_sizes_are_kept(self, arch):
        for place, size in (((2.0, 0.0), 0.05), ((1.0, 0.2), 0.05), ((0.0, 0.0), 0.2), ((1.0, 2.0), 0.2)):
            vertex = np.argmin(np.hypot(*(arch.vertices - place).T))
            assert arch.vertices[vertex] == pytest.approx(place, abs=1e-12)
            assert 0.4 * size < arch.finest[vertex] < 1.6 * size

    def test_joints_may_cross_end_inside_and_be_closed(self):
        across = [(0.2, 0.5), (0.8, 0.5)], [(0.0, 0.9), (1.0, 0.8)]  # two lines of one joint
        joints = {"up": [(0.5, 0.0), (0.5, 0.7)], "across": across}
        cores = [[(x, 0.1), (x + 0.1, 0.1), (x, 0.3)] for x in (0.1, 0.7)]
        mesh = TriangleMesh.outline(SQUARE, 0.3, joints=joints, regions={"cores": cores})
        assert np.linalg.det(np.diff(mesh.corners[mesh.region("cores")], axis=1)).sum() == pytest.approx(0.04)
        assert [mesh.edges(name).length.sum() for name in joints] == pytest.approx([0.7, 0.6 + np.sqrt(1.01)])
        circle, finer = (Corner.circle((0.5, 0.5), 0.3, size=size) for size in (0.2, 0.1))
        mesh = TriangleMesh.outline(SQUARE, 0.3, joints={"pin": circle}, regions={"pin": finer[::-1]})
        joint = mesh.edges("pin")
        assert joint.length == pytest.approx(0.025 * np.pi)  # no point of the region lies between those of the joint
        assert set(np.bincount(np.concatenate([joint.first, joint.second])).tolist()) == {0, 2}
        assert np.isin(joint.cells, mesh.region("pin")).sum(axis=1).tolist() == len(joint) * [1]

    @pytest.mark.parametrize("more", [{"sizes": {(0.5 + 0.3 * np.cos(0.2), 0.5 + 0.3 * np.sin(0.2)): 0.02}},
                                      {"joints": {"cut": [(0.0, 0.55), (1.0, 0.55)]}}])  # fmt: skip
    def test_what_meets_an_arc_between_its_chords_leaves_it_whole(self, more):
        """Its name, its edges as arcs, and the region inside."""
        circle = Corner.circle((0.5, 0.5), 0.3, size=0.3)
        more = {**more, "joints": {"pin": circle, **more.get("joints", {})}}
        mesh = TriangleMesh.outline(SQUARE, 0.3, regions={"pin": circle}, **more)
        assert mesh.edges("pin").length.sum() == pytest.approx(0.6 * np.pi)
        assert mesh.part(mesh.region("pin")).boundary.length.sum() == pytest.approx(0.6 * np.pi)

    def test_a_line_may_end_on_an_arc(self):
        end = np.sqrt(0.25 - 0.15**2)
        dome = [Corner((0.0, 0.0), "base"), Corner((1.0, 0.0), "dome", (0.5, 0.0))]
        mesh = TriangleMesh.outline(dome, 0.3, joints={"cut": [(0.35, 0.0), (0.35, end)]})
        assert [mesh.edges(name).length.sum() for name in ("dome", "cut")] == pytest.approx([0.5 * np.pi, end])
        segment = TriangleMesh.outline([Corner((1.0, 0.0), "arc", (0.0, 0.0)), (np.cos(0.3), np.sin(0.3))], 1.0)
        assert segment.edges("arc").length.sum() == pytest.approx(0.3)

    @pytest.mark.parametrize(("size", "away"), [(1e-6, 0.0), (1e5, 0.0), (1.0, 1e6), (3.0, 0.0)])
    def test_neither_units_nor_places_matter(self, size, away):
        """The tolerances of gmsh are absolute. Corners are kept to the last digit, straight lines straight."""
        corners = [(size * (x + away), size * (y - away)) for x, y in SQUARE]
        mesh = TriangleMesh.outline(corners, 0.3 * size, joints={"seam": [corners[0], corners[2]]})
        assert len(mesh.edges("seam")) > 2
        assert set(corners) <= set(map(tuple, mesh.vertices.tolist()))
        assert np.count_nonzero(np.abs(mesh.boundary.tangent).max(axis=1) == 1.0) == len(mesh.boundary)

    @pytest.mark.parametrize(
        "inside",
        [{"joints": {"seam": [(0.5, 0.5), (0.5, 1.5)]}}, {"joints": {"seam": [(2.0, 2.0), (3.0, 3.0)]}},
         {"joints": {"seam": [(0.0, 0.0), (0.5, 0.0)]}}, {"regions": {"core": [(2.0, 0.0), (3.0, 0.0), (3.0, 1.0)]}}],
    )  # fmt: skip
    def test_what_is_outside_is_refused(self, inside):
        with pytest.raises(InputError):
            TriangleMesh.outline(SQUARE, 0.5, **inside)

    def test_nothing_is_left_behind(self, capfd):
        handler = signal.getsignal(signal.SIGINT)
        TriangleMesh.outline(SQUARE, 0.5)
        assert not gmsh.isInitialized()
        assert signal.getsignal(signal.SIGINT) is handler
        assert capfd.readouterr() == ("", "")


FILE = (PROBLEMS / "outline.toml").read_text(encoding="utf-8")


class TestFiles:
    """[mesh.outline]."""

    @needs_gmsh
    def test_a_block_with_a_bore_carries_its_load(self, tmp_path):
        (tmp_path / "block.toml").write_text(FILE)
        file = load_problem(tmp_path / "block.toml")
        result = solve(file.problem, **file.solve_options)
        assert result.status == "solved"
        assert result.contacts["base"].normal_force == pytest.approx(4.0, rel=1e-9)
        again = problem_from_toml(problem_to_toml(file.problem)).problem
        assert again.mesh.same_as(file.problem.mesh)
        with refused_at("mesh.outline.regions[1]", "no part"):
            problem_from_toml(FILE.replace("0.1 }]", "0.1 }, { name = 'core', centre = [9, 9], radius = 0.1 }]", 1))

    @pytest.mark.parametrize(
        ("old", "new", "field"),
        [
            ("size = 0.1 }", "size = -0.1 }", "mesh.outline.corners[2].size"),
            ("radius = 0.2", "radius = 2.0", "mesh.outline.holes[0]"),
            ("radius = 0.2", "radius = -2.0", "mesh.outline.holes[0].radius"),
            (", radius = 0.2", "", "mesh.outline.holes[0].radius"),
            ("{ at = [0.0, 0.2] }, ", "", "mesh.outline.joints[0]"),
            ("[2.0, 0.2] }] }", "[2.0, 0.2] }] }, { name = 'seam', corners = [] }", "mesh.outline.joints[1]"),
            ("at = [1.5, 0.5], size", "at = [1.5, 1.5], size", "mesh.outline.sizes"),
            ("[mesh.outline]", '[mesh]\nfile = "a.msh"\n[mesh.outline]', "mesh.outline"),
        ],
    )  # fmt: skip
    def test_what_is_wrong_is_named_by_its_place(self, old, new, field):
        assert old in FILE
        with refused_at(field):
            problem_from_toml(FILE.replace(old, new, 1))
