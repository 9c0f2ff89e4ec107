"""Pictures of problems: runs of edges, arrows and symbols that turn with the body, texts that cover none."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver

from qvi_contact import Polynomial, TriangleMesh, load_problem, solve
from qvi_contact.gallery import sliding_block
from qvi_contact.plots import draw_problem, draw_symbols, problem_figure, result_figure, runs
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Region, RigidPlate, Symmetry, Traction
from qvi_contact.units import Units
from tests.golden.problems import EXAMPLES
from tests.qvi_contact.builders import polygon
from tests.qvi_contact.test_triangles import oblique


class TestRuns:
    """Edges one behind the other."""

    @pytest.mark.parametrize("angle", [0.4, 2.0, 3.5])
    def test_a_side_is_one_run_whatever_way_it_faces(self, angle):
        mesh = oblique(TriangleMesh.rectangle((5, 3), 2.0, 1.0), np.degrees(angle))
        (run,) = runs(mesh, mesh.edges("bottom"))
        assert run.length == pytest.approx(2.0)
        assert run.at(0.5).normals[0] == pytest.approx([np.sin(angle), -np.cos(angle)])
        places = run.ends_and_points(10.0)
        assert len(places.points) == 2  # nothing but its ends
        assert places.tangents[0] == pytest.approx((places.points[1] - places.points[0]) / 2.0)

    def test_a_circle_is_cut_where_the_tangent_changes_its_sense_only(self):
        mesh = polygon(24, 2)
        for name, radius in (("hole", 1.0), ("outside", 2.0)):
            found = runs(mesh, mesh.edges(name))
            assert len(found) == 2
            for run in found:
                places = run.ends_and_points(0.01)
                assert np.hypot(*places.points.T).max() == pytest.approx(radius)
                outward = (places.points * places.normals).sum(axis=1) * (1.0 if radius == 2.0 else -1.0)
                assert outward.min() > 0.98 * radius
                steps = np.diff(places.points, axis=0)
                assert (steps[:, 0] >= -1e-12).all()  # along the tangents
                for vertex in run.line:
                    assert np.hypot(*(places.points - vertex).T).min() < 1e-12  # no corner is cut off

    def test_places_on_an_arc_lie_on_the_circle(self):
        """Between the chords that are drawn too: a gap of a rounded pin is that of the arc."""
        mesh = polygon(24, 2).with_arc("hole", (0.0, 0.0), 1.0)
        for run in runs(mesh, mesh.edges("hole")):
            assert np.hypot(*run.ends_and_points(0.01).points.T) == pytest.approx(1.0, abs=1e-13)


def loaded(angle):
    """A block under every kind of condition, given by normal and tangential components, and turned."""
    mesh = TriangleMesh.rectangle((4, 4), 2.0, 2.0)
    mesh = mesh.with_joint("bed", lambda x, y: np.abs(y - 1.0) + 0 * x < 1e-9).with_region(
        "lower", lambda x, y: y + 0 * x < 1.0
    )
    conditions = [
        Traction("left", normal=-4.0, tangential=0.0),
        Displacement("right", normal=0.0),
        Traction("right", tangential=2.0),
        Contact("bottom", friction=0.3),
        Contact("top", friction=0.1, plate=RigidPlate(force_x=3.0 * np.sin(angle), force_y=-3.0 * np.cos(angle))),
        Contact("bed", friction=0.4),
    ]
    regions = [Region(Material(500.0, 0.2), name="lower")]
    return ContactProblem(oblique(mesh, np.degrees(angle)), Material(1000.0, 0.3), conditions, regions=regions)


def drawn(problem):
    """Axes, tails and vectors (n, 4) of the arrows by colour, and places of symbols."""
    axes = Figure().subplots()
    draw_problem(axes, problem)
    arrows = [q for q in axes.collections if isinstance(q, Quiver)]
    found = {
        colour: np.concatenate(
            [np.column_stack([q.XY, q.U, q.V]) for q in arrows if tuple(q.get_facecolor()[0]) == to_rgba(colour)]
            or [np.empty((0, 4))]
        )
        for colour in ("#D55E00", "black")
    }
    symbols = [line.get_xydata() for line in axes.lines if line.get_marker() not in ("None", None, "")]
    return axes, found, np.concatenate([np.empty((0, 2)), *symbols])


class TestTriangles:
    """The sketch of a problem on triangles."""

    @pytest.mark.parametrize("angle", [0.0, 1.0, -0.7])
    def test_a_turned_body_has_the_turned_picture(self, angle):
        _, found, supports = drawn(loaded(angle))
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        loads, plate = (np.hstack([found[c][:, :2] @ turn, found[c][:, 2:] @ turn]) for c in ("#D55E00", "black"))
        left = loads[:, 0] < 1.0
        assert (loads[left, 0] + loads[left, 2]) == pytest.approx(0.0, abs=1e-12)  # pressed: they end at the side
        assert loads[left, 3] == pytest.approx(0.0, abs=1e-12)
        assert np.abs(loads[~left, 3]) == pytest.approx(loads[left, 2][0] / 2.0)  # one scale for all
        assert loads[~left, 2] == pytest.approx(0.0, abs=1e-12)
        assert plate[0, :1] == pytest.approx(1.0)
        assert plate[0, 2] == pytest.approx(0.0, abs=1e-12)
        assert plate[0, 3] < 0.0
        assert 2.0 < plate[0, 1] + plate[0, 3] < 2.2  # at the plate
        beside = supports @ turn
        assert ((beside[:, 0] > 2.0) & (beside[:, 0] < 2.2)).all()

    def test_symmetry_and_supports_stand_beside_slanted_sides(self):
        mesh = oblique(TriangleMesh.rectangle((2, 2)), 35.0)
        conditions = [Symmetry("bottom"), Displacement("left", x=0.0, y=0.0), Traction("top", x=0.0, y=0.0)]
        conditions += [Displacement("right", tangential=0.0), Traction("right", normal=0.0)]
        axes, _, symbols = drawn(ContactProblem(mesh, Material(1.0, 0.3), conditions))
        assert (mesh.locate(symbols) < 0).all()
        assert (np.hypot(*(symbols - mesh.vertices.mean(axis=0)).T) < mesh.length).all()
        markers = {str(line.get_marker()) for line in axes.lines if line.get_marker() not in ("None", None, "")}
        assert {"o", "d"} <= markers


def laden():
    """A block with everything a problem may have."""
    mesh = TriangleMesh.rectangle((4, 4), 2.0, 2.0).with_joint("bed", lambda _, y: np.isclose(y, 1.0))
    mesh = mesh.with_edges("press", lambda x, y: (x < 1.0) & (y == 2.0))
    mesh = mesh.with_edges("lid", lambda x, y: (x > 1.0) & (y == 2.0))
    conditions = [
        Traction("left", x=lambda x, y: 5.0 * y + 0 * x, y=0.0),
        Traction("right", x=2.0),
        Displacement("right", y=0.0),
        Traction("lid", x=0.0, y=0.0),
        Contact("bottom", friction=lambda x, y: 0.2 + 0.1 * x + 0 * y, gap=lambda x, _: 0.01 * x**2, name="ground"),
        Contact("press", friction=0.1, plate=RigidPlate(force_y=-3.0, moment=0.5)),
        Contact("bed", friction=0.4, cohesion=1.5, normal_stiffness=3e6),
    ]
    regions = [Region(Material(500.0, 0.2), y=(1.0, 2.0))]
    return ContactProblem(mesh, Material(1000.0, 0.3), conditions, regions=regions)


def test_components_given_apart_make_one_arrow():
    _, arrows, _ = drawn(sliding_block()[0])
    top = arrows["#D55E00"][arrows["#D55E00"][:, 1] > 1.0]
    assert top[:, 2] / top[:, 3] == pytest.approx(30.0 / -100.0)


def test_the_legend_names_everything():
    axes = Figure().subplots()
    draw_problem(axes, laden(), Units("mm", "MPa"))
    legend = " ".join(" ".join(text.get_text() for text in axes.get_legend().get_texts()).split())
    for words in (
        "1: E = 1000 MPa", "2: E = 500 MPa", "t_x = 0 … 10 MPa", "u_y = 0 mm", "free: lid",
        "contact ground: μ = 0.2 … 0.4, gap = 0 … 0.04 mm", "F_y = −3 N/mm", "M = 0.5 N mm/mm",
        "joint bed: μ = 0.4, c = 1.5 MPa, k_N = 3 · 10⁶ MPa/mm",
    ):  # fmt: skip
        assert words in legend
    assert legend.count("about (0, 0)") == 1  # a moment has a pivot, a force has none
    assert "mm/mm about (0, 0)" in legend
    places = {text.get_text(): text.xy for text in axes.texts}
    assert {"ground", "press", "bed"} <= places.keys()
    assert places["1"][1] < 1.0 < places["2"][1]  # numbers of materials stand in them


def test_the_obstacle_follows_the_gap():
    axes = Figure().subplots()
    draw_problem(axes, laden())
    curves = [np.column_stack(line.get_data()) for line in axes.lines if line.get_color() == "black"]
    (curve,) = (c for c in curves if len(c) > 3 and c[:, 1].max() < 0.0)
    lines = (line for each in axes.collections if hasattr(each, "get_segments") for line in each.get_segments())
    feet, tips = np.array([line for line in lines if len(line) == 2 and line[:, 1].max() < 0.0]).swapaxes(0, 1)
    assert (tips - feet < 0.0).all()  # strokes on the side away from the body
    depth = curve[0, 1] - curve[:, 1]
    assert np.concatenate(draw_symbols(axes, laden(), obstacles=True))[:, 1].max() > 2.2  # the force on the plate
    assert depth / depth[-1] == pytest.approx((curve[:, 0] / 2.0) ** 2, abs=1e-9)


def covered(axes):
    """Pairs of texts that overlap."""
    return [(a, b) for a, b in combinations((text.get_window_extent() for text in axes.texts), 2) if a.overlaps(b)]


def test_texts_cover_neither_each_other_nor_pressures():
    """Numbers of thin layers in one line, and of piers, where an arrow's tail stands in the pressure of another joint.

    Names of the sides of a thin wedge, with a tip too narrow for two names; numbers of materials.
    """
    heights, load = {"low": 3.0, "high": 6.0}, Polynomial([[-5.0], [0.08]])
    joints = {name: ((0.0, y), (60.0, y)) for name, y in heights.items()}
    mesh = TriangleMesh.grid(np.linspace(0.0, 60.0, 9), [0.0, *heights.values(), 9.0], joints=joints)
    sides = [Traction(side, 0.0, value) for side, value in (("left", 0.0), ("right", 0.0), ("top", load))]
    layers = ContactProblem(mesh, Material(1e4, 0.3), [*sides, *(Contact(name, 0.5) for name in ("bottom", *heights))])
    edges = {f"{side} side": [(k, (k + 1) % 4)] for k, side in enumerate(("lower", "right", "upper", "left"))}
    mesh = TriangleMesh([(0.0, 0.0), (10.0, 0.0), (10.0, 0.6), (0.0, 0.3)], [[0, 1, 2], [0, 2, 3]], edges)
    wedge = ContactProblem(mesh, Material(1e4, 0.3), [Displacement(name, 0.0, 0.0) for name in edges])
    wall, cylinder = (load_problem(EXAMPLES / f"{n}.toml").problem for n in ("dry_stone_wall", "cylinder_on_block"))
    figures = [(problem_figure(wedge), 4), (problem_figure(cylinder), 9)]
    figures += [(result_figure(solve(each), panels=()), count) for each, count in ((layers, 3), (wall, 4))]
    for figure, count in figures:
        figure.draw_without_rendering()
        axes = figure.axes[0]
        assert (len(axes.texts), covered(axes)) == (count, [])
    paths = [patch.get_path().transformed(patch.get_transform()) for patch in axes.patches]
    assert not any(path.intersects_bbox(text.get_window_extent()) for path in paths for text in axes.texts)


def test_names_beside_a_thin_body_stand_on_their_own_side():
    mesh = TriangleMesh.rectangle((2, 40), 0.2, 20.0)
    held = [Displacement(side, x=0.0, y=0.0) for side in mesh.edge_names]
    axes = problem_figure(ContactProblem(mesh, Material(1e3, 0.3), held)).axes[0]
    boxes = {text.get_text(): axes.transData.inverted().transform(text.get_window_extent()) for text in axes.texts}
    assert boxes["left"][1, 0] < 0.0 < 0.2 < boxes["right"][0, 0]
