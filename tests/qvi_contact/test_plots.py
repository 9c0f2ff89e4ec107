"""Pictures of results show the numbers they are made from."""

from dataclasses import replace
from functools import cache

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.quiver import Quiver
from scipy.integrate import trapezoid

from qvi_contact import ContactState, History, InputError, LimitLoad, Region, Tresca, TriangleMesh, solve
from qvi_contact.element import gauss_legendre
from qvi_contact.export import write_collapse_vtu
from qvi_contact.files import load_problem
from qvi_contact.gallery import compressed_plate, exact, half_discs, jointed_slope
from qvi_contact.limit import limit_load_factor
from qvi_contact.plots import (
    Scales,
    Shape,
    beside,
    contact_tractions,
    draw_body,
    draw_contours,
    draw_problem,
    history_figure,
    limit_figure,
    result_figure,
    save_figure,
    value_range,
)
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Symmetry, Traction, stress_along_z
from qvi_contact.solution import ContactLine, principal_stresses, sample_body, stress_component, von_mises
from qvi_contact.units import Units
from solvers import Status
from tests.golden.problems import EXAMPLES
from tests.qvi_contact.builders import polygon

OPEN, STICK, SLIP, _CLOSED = ContactState
LINES = [0.0, 0.5, 2.0], [0.0, 1.0, 1.2, 3.0]
MESH = TriangleMesh.grid(*LINES)
FREE = [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]


def new_axes():
    return Figure().subplots()


@cache
def uniform_result(xx=0.0, yy=0.0, xy=0.0):
    material = Material(1000.0, 0.3)
    sides = {"bottom": "uu", "right": "tt", "top": "tt", "left": "tt"}
    return solve(exact.problem_from_state(exact.uniform(material, xx=xx, yy=yy, xy=xy), MESH, material, sides))


def contact(edges, states, vertical=False, bound=None):
    """A contact of edges [(start, end), …] with given states of the four points of each, made by hand."""
    t, w = gauss_legendre(4)
    along = np.concatenate([a + (b - a) * t for a, b in edges])
    weights = np.concatenate([(b - a) * w for a, b in edges])
    place = (np.full_like(along, 5.0), along) if vertical else (along, np.full_like(along, 5.0))
    pressure = 1.0 + along
    return ContactLine(
        "contact", *place, weights, np.full_like(along, 0.25), 0.25 * pressure if bound is None else bound + 0 * along,
        -pressure, -0.2 * pressure, 0 * along, 0 * along,
        np.concatenate([np.array(s) for s in states]),
        np.array([[(5.0, a), (5.0, b)] if vertical else [(a, 5.0), (b, 5.0)] for a, b in edges]),
        0 * along, np.ones(len(edges)),
    )  # fmt: skip


STATES = ([STICK, STICK, SLIP, SLIP], [SLIP, SLIP, OPEN, OPEN], [OPEN, STICK, OPEN, SLIP])
EDGES = ((1.0, 1.5), (1.5, 3.5), (4.0, 4.4))
"""Edges of unequal length; the last apart from the others."""


@pytest.mark.parametrize("vertical", [False, True])
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
class TestTractions:
    """Tractions along a contact, and its states."""

    @staticmethod
    def draw(order, vertical):
        line = contact([EDGES[i] for i in order], [STATES[i] for i in order], vertical)
        contact_tractions(axes := new_axes(), line, Units("mm", "MPa"))
        return line, axes

    def test_each_point_lies_in_a_range_of_its_state_alone(self, order, vertical):
        line, axes = self.draw(order, vertical)
        drawn = {bars.get_label(): [(bar.get_x(), bar.get_width()) for bar in bars] for bars in axes.containers}
        ranges = {label: np.cumsum(found, axis=1) for label, found in drawn.items()}
        along = line.y if vertical else line.x
        assert set(ranges) == {"open", "stick", "slip"}
        for place, state in zip(along, line.state, strict=True):
            for label, parts in ranges.items():
                inside = ((parts[:, 0] < place) & (place < parts[:, 1])).sum()
                assert inside == (label == ContactState(state).name.lower())
        parts = np.sort(np.concatenate(list(ranges.values())), axis=0)
        borders = np.unique(parts.round(12))
        assert len(parts) == 7
        assert parts[:, 1] - parts[:, 0] == pytest.approx(np.delete(np.diff(borders), 3))  # not between the lines
        assert {1.0, 3.5, 4.0, 4.4} < set(borders.tolist())

    def test_curves_run_through_the_points_and_are_closed_where_the_contact_opens(self, order, vertical):
        line, axes = self.draw(order, vertical)
        pressure, bound, tangential = axes.lines
        along, values = pressure.get_data()
        (gap,) = np.flatnonzero(np.isnan(along))  # the line breaks where the contact does
        ends = [0, gap - 1, gap + 1, -1]
        assert along[ends] == pytest.approx([1.0, 3.5, 4.0, 4.4])
        assert values[ends] == pytest.approx([2.0, 0.0, 0.0, 5.4])
        assert (np.diff(np.delete(along, gap)) >= 0).all()
        for drawn, factor in ((pressure, 1.0), (bound, 0.25), (tangential, 0.2)):
            x, y = (data[drawn.get_markevery()] for data in drawn.get_data())
            assert x == pytest.approx(np.sort(line.y if vertical else line.x))
            assert y == pytest.approx(factor * (1.0 + x))
        assert np.nanmax(values) == pytest.approx(5.4)  # nothing beyond the values at points and ends
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("y [mm]" if vertical else "x [mm]", "traction [MPa]")
        assert axes.get_ylim()[0] == 0.0


def test_a_tied_contact_has_no_bound_to_draw():
    contact_tractions(axes := new_axes(), contact([(0.0, 1.0)], [[STICK] * 4], bound=np.inf))
    assert [drawn.get_label()[:8] for drawn in axes.lines] == ["pressure", "friction"]
    assert np.isfinite(axes.get_ylim()).all()


@cache
def notched(plane="stress"):
    """Graded cells, one of them left out, two materials under a load and a body force."""
    active = np.ones((3, 2), dtype=bool)
    active[2, 1] = False
    mesh = TriangleMesh.grid(*LINES, active)
    conditions = [Displacement("bottom", x=0.0, y=0.0), Traction("top", x=0.0, y=-10.0), *FREE]
    regions = [Region(Material(3000.0, 0.45, plane), y=(0.0, 1.0))]
    material = Material(1000.0, 0.2, plane)
    return solve(ContactProblem(mesh, material, conditions, lambda x, y: 3.0 * y + x, regions))


class TestField:
    """Values in the small triangles of a field."""

    @classmethod
    def inside(cls, result):
        """Stresses, also σ_zz, at some points inside the three parts of a triangle, between which they may jump."""
        samples = sample_body(result, 80)
        points = samples.points
        chosen = np.random.default_rng(5).permutation(len(points))[:400]
        pairs = np.unique(np.column_stack(result.problem.mesh.around(points[chosen])), axis=0)
        point, count = np.unique(pairs[:, 0], return_counts=True)
        chosen = chosen[point[count == 1]]
        _, cell = result.problem.mesh.around(points[chosen])
        flat = np.sort(result.problem.mesh.reference(cell, points[chosen]), axis=1)
        chosen = chosen[flat[:, 1] - flat[:, 0] > 1e-6]
        assert len(chosen) > 50
        return samples.stress[chosen], samples.along_z[chosen], points[chosen]

    def test_every_point_has_the_stress_there(self):
        drawn, _, points = self.inside(notched())
        stress = notched().stress(*points.T)
        assert drawn == pytest.approx(stress, rel=1e-9, abs=1e-8 * np.abs(stress).max())
        xx, yy, xy = stress.T
        assert von_mises(stress) == pytest.approx(np.sqrt(xx**2 + yy**2 - xx * yy + 3 * xy**2))
        for number, name in enumerate(("first", "second")):
            assert (stress_component(stress, name) == principal_stresses(stress)[number]).all()

    def test_triangles_fill_the_body_and_nothing_else(self):
        samples = sample_body(notched(), 80)
        corners = samples.points[samples.triangles]
        areas = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 2.0
        assert areas.min() > 0.0
        assert areas.sum() == pytest.approx(2.0 * 3.0 - 1.5 * 1.8)
        middles = corners.mean(axis=1)
        assert not ((middles[:, 0] > 0.5) & (middles[:, 1] > 1.2)).any()

    def test_plane_strain_counts_the_stress_out_of_the_plane(self):
        """σ_zz = ν (σ_xx + σ_yy) with the ν of each cell's own material; by tensors, and by hand."""
        result = notched("strain")
        drawn, along_z, points = self.inside(result)
        xx, yy, xy = result.stress(*points.T).T
        zz = np.where(points[:, 1] < 1.0, 0.45, 0.2) * (xx + yy)
        tensors = np.zeros((len(xx), 3, 3))
        tensors[:, 0, 0], tensors[:, 1, 1], tensors[:, 2, 2] = xx, yy, zz
        tensors[:, 0, 1] = tensors[:, 1, 0] = xy
        deviator = tensors - np.trace(tensors, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3.0
        assert von_mises(drawn, along_z) == pytest.approx(np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2))), rel=1e-8)
        assert (stress_along_z(notched().problem, np.array([0]), np.ones(1), np.ones(1), np.ones((1, 3))) == 0.0).all()
        assert von_mises(np.array([0.0, -10.0, 0.0]), -3.0) == pytest.approx(10 * np.sqrt(1 - 0.3 + 0.09))

    @pytest.mark.parametrize(
        ("values", "ends"),
        [([0.0, 1.0, 2.0, 3.0], (0.0, 3.0)), ([0.0] * 4, (0.0, 1.0)),
         ([5.0, 5.0, 5.0, 5.0 + 1e-9], (4.75, 5.25)), ([15.0, 15.0 - 1e-9, 15.0 + 1e-9, 15.0], (14.25, 15.75))],
    )  # fmt: skip
    def test_bands_hold_all_values_and_show_no_rounding(self, values, ends):
        points, triangles = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]), np.array([[0, 1, 2], [1, 3, 2]])
        axes = new_axes()
        bands = draw_contours(axes, points, points, triangles, np.array(values), np.zeros(4, dtype=int))
        assert any(len(path) for path in axes.collections[-1].get_paths()) == (np.ptp(values) > 1e-6)
        low, high = bands.levels[[0, -1]]
        assert (low, high) == pytest.approx(ends, rel=0.35)
        assert low <= min(values) <= max(values) <= high


TANGENT, NORMAL = np.array([np.sqrt(0.75), 0.5]), np.array([-0.5, np.sqrt(0.75)])


@cache
def slanted_result(name="plane"):
    """A block of triangles on a plane that rises by 30 degrees, pushed along it."""
    mesh = TriangleMesh.rectangle((2, 2), 2.0, 1.0)
    mesh = TriangleMesh(mesh.vertices @ np.array([TANGENT, NORMAL]), mesh.cells, mesh.edge_sets)
    conditions = [Contact("bottom", friction=0.2, name=name), Traction("left", normal=0.0, tangential=0.0)]
    conditions += [Traction("right", normal=0.0, tangential=0.0), Displacement("top", normal=-0.01, tangential=0.05)]
    return solve(ContactProblem(mesh, Material(1000.0, 0.3), conditions))


@cache
def leaning():
    """Two blocks of width 1 under a load that grows from 0.5 to 1.5 along them: uniform along y, e = 1/12."""
    mesh = TriangleMesh.rectangle((2, 4), 1.0, 2.0).with_joint("bed", lambda _, y: np.isclose(y, 1.0))
    load = Traction("top", x=0.0, y=lambda x, _: -0.5 - x)
    conditions = [*FREE, load, Contact("bed", 0.3), Contact("bottom", 0.3)]
    return solve(ContactProblem(mesh, Material(1000.0, 0.0), conditions))


class TestBody:
    """The deformed body with what its contacts carry."""

    def test_a_uniform_state_moves_linearly(self):
        """ε_xx = (10 + 0.3 · 20)/1000, ε_yy = −(20 + 0.3 · 10)/1000 from the bottom, which is held as it moves."""
        result = uniform_result(xx=10.0, yy=-20.0)
        shape = Shape.of(result)
        edges, t = result.problem.mesh.boundary, np.array([0.0, 0.3, 1.0])
        x, y = result.problem.mesh.points_along(edges, t)
        moved = shape.along(edges, t)
        assert np.ptp(moved - np.stack([0.016 * x, -0.023 * y], axis=-1), axis=(0, 1)) == pytest.approx(0.0, abs=1e-7)

    @pytest.mark.parametrize("law", ["tied", "unilateral"])
    def test_springs_give_way(self, law):
        """Under p = 20 and q = 3 a bed of k_N = 400 and k_T = 100 gives way by 0.05 and 0.03; ε_xx = 0."""
        result = uniform_result(xx=-6.0, yy=-20.0, xy=3.0)
        friction, stiffness = 0.0 if law == "tied" else 0.5, {"normal_stiffness": 400.0, "tangential_stiffness": 100.0}
        bed = Contact("bottom", friction, law=law, **stiffness)
        kept = [each for each in result.problem.conditions if each.edges != "bottom"]
        shape = Shape.of(solve(replace(result.problem, conditions=[*kept, bed])))
        moved = shape.along(result.problem.mesh.edges("bottom"), np.array([0.0, 0.5, 1.0]))
        assert moved == pytest.approx(np.broadcast_to([0.03, -0.05], moved.shape), abs=1e-7)

    def test_pressure_stands_on_the_contact_and_its_area_is_the_normal_force(self):
        result, axes = slanted_result(), new_axes()
        drawn = draw_body(axes, result, units=Units("mm", "MPa"))
        (diagram,) = (patch for patch in axes.patches if isinstance(patch, Polygon))
        x, y = diagram.get_xy().T
        area = abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2.0
        line, length = result.contacts["plane"], result.problem.mesh.length
        largest = (-line.normal_stress).max()
        assert drawn.pressure >= largest  # which may be at an end
        assert area * largest / (0.14 * length) == pytest.approx(line.normal_force, rel=0.05)
        assert (diagram.get_xy() @ NORMAL).max() == pytest.approx(0.0, abs=1e-2)  # below the body, on the plane
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [mm]", "y [mm]")

    def test_results_beside_each_other_have_one_scale(self):
        """The pressure of the second is half as long in the scale of both as in its own; so are displacements."""
        strong, weak = solve(compressed_plate(0.2, (2, 2))), solve(compressed_plate(0.2, (2, 2), displacement=5e-4))
        both, heights, factors, ends = Scales.of([strong, weak]), [], [], []
        for scales in (both, None):
            axes = new_axes()
            factors.append(draw_body(axes, weak, scales=scales).factor)
            (diagram,) = (patch for patch in axes.patches if isinstance(patch, Polygon))
            heights.append(np.ptp(diagram.get_xy()[:, 1]))
            ends.append(axes.collections[0].levels[-1])
        assert heights[1] == pytest.approx(2.0 * heights[0], rel=0.1)
        assert ends[0] == pytest.approx(2.0 * ends[1], rel=0.3)  # bands of colour
        assert factors[1] > factors[0] == draw_body(new_axes(), strong).factor
        assert both.stress is not None
        assert Scales.of([weak]).stress is None  # alone it has bands of its own

    def test_bodies_are_not_drawn_inside_each_other(self):
        """Discs that touch in a point would, exaggerated 5 times as is usual; blocks that slip on each other do not."""
        assert Scales.of([solve(half_discs(1.0, 1, 0))]).factor == 1.0
        assert Scales.of([solve(jointed_slope())]).factor >= 1000.0
        mesh, sides = TriangleMesh.grid([0, 1], [0, 1, 2], joints={"bed": ((0, 1), (1, 1))}), ("left", "right")
        held = [
            Displacement("bottom", 0.0, 0.0),
            Displacement("top", 0.0, -1e-3),
            *(Traction(at, 0, 0) for at in sides),
        ]
        for data, factor in (({"gap": -0.1}, 2.0), ({"gap": 0.05}, 2.0), ({"normal_stiffness": 200.0}, 5.0)):
            bed = Contact("bed", 0.0, **data)  # of the mesh, which shows no gap
            assert Scales.of([solve(ContactProblem(mesh, Material(1e3, 0.3), [bed, *held]))]).factor == factor

    @pytest.mark.parametrize("gap", [0.0, -0.3, 0.3])
    def test_springs_are_zigzag_lines_beside_the_body(self, gap):
        bed = Contact("bottom", 0.0, normal_stiffness=10.0, gap=gap)
        conditions = [bed, Traction("top", x=0.0, y=-1.0), *FREE]
        block = ContactProblem(TriangleMesh.rectangle((2, 2)), Material(1e2, 0.3), conditions)
        for draw, shown in ((draw_body, solve(block)), (draw_problem, block)):
            draw(axes := new_axes(), shown)
            zigzags = [line for line in axes.collections if isinstance(line, LineCollection)]
            paths = [path for line in zigzags for path in line.get_segments() if len(path) == 8]
            assert len(paths) >= 3
            assert np.abs(paths).max() < 1.0
            assert 0.01 < np.ptp(paths, axis=1)[:, 1].max() < 0.3

    def test_the_resultant_is_an_arrow_to_the_centre_of_pressure_with_its_number(self):
        result, axes = slanted_result(), new_axes()
        draw_body(axes, result, units=Units("mm", "MPa"))
        line, force = result.contacts["plane"], result.resultant("bottom")
        (drawn,) = (each for each in axes.collections if isinstance(each, Quiver) and each.width == 0.025)  # the widest
        (tail,), arrow = drawn.get_offsets(), np.array([drawn.U[0], drawn.V[0]])
        push = np.array([force.x, force.y])
        assert arrow / np.hypot(*arrow) == pytest.approx(push / np.hypot(*push), abs=1e-9)
        pressed = line.weights * -line.normal_stress
        centre = pressed @ np.column_stack([line.x, line.y]) / pressed.sum()
        assert (tail + arrow - centre) @ TANGENT == pytest.approx(0.0, abs=0.2)  # which moves with the body
        (text,) = (text.get_text() for text in axes.texts if text.get_text().startswith("plane"))
        assert text.splitlines()[0] == f"plane: {beside([np.hypot(*push)])[0]} N/mm"

    @pytest.mark.parametrize("law", ["unilateral", "bilateral"])
    def test_tension_is_no_pressure_and_rounding_is_nothing(self, law):
        """A block lifted by 1e-3: it leaves the ground, or is pulled by 3 where its sides are held."""
        held = [Displacement("top", x=0.0, y=1e-3), *(Displacement(side, x=0.0) for side in ("left", "right"))]
        held += [Traction(side, y=0.0) for side in ("left", "right")]
        ground = Contact("bottom", 0.0, law=law, gap=0.5 if law == "unilateral" else 0.0)
        result = solve(ContactProblem(TriangleMesh.rectangle((2, 2)), Material(3e3, 0.0), [ground, *held]))
        axes = result_figure(result).axes[0]
        labels = [text.get_text() for text in axes.get_legend().get_texts()][1:]
        assert labels == (["pressure, −3 stress"] if law == "bilateral" else [])
        assert ("N = 0" in said(axes.figure)[1]) == (law == "unilateral")

    @pytest.mark.parametrize(("joint", "sense"), [(False, 1.0), (True, 1.0), (True, -1.0)])
    def test_what_presses_around_a_ring_balances_itself(self, joint, sense):
        """Pressure points outwards all around, also in a turned ring; its resultant is nothing and nowhere else."""
        mesh = polygon(16, 2, 1.0, 4.0).with_joint("middle", lambda x, y: abs(np.hypot(x, y) - 1.98) < 0.05)
        mesh = replace(mesh, vertices=sense * mesh.vertices)
        held = [Displacement("outside", 0.0, 0.0), Contact("middle", 0.3, gap=-1e-3)]
        conditions = [Traction("hole", 0.0, 0.0), *(held if joint else [Contact("outside", 0.3)])]
        steel, axes = Material(1e3, 0.3, expansion=1e-3), new_axes()
        box = draw_body(axes, solve(ContactProblem(mesh, steel, conditions, temperature=lambda x, _: 5.0 + x))).box
        assert np.abs(box).max() < 6.0
        assert not axes.texts
        (diagram,) = (patch.get_xy() for patch in axes.patches if isinstance(patch, Polygon))
        assert np.hypot(*diagram.T).min() > (1.7 if joint else 3.8)

    def test_eccentricity_and_line_of_thrust_of_joints(self):
        draw_body(axes := new_axes(), leaning())
        texts = {text.get_text().split(":")[0]: text.get_text().splitlines()[-1] for text in axes.texts}
        assert texts == dict.fromkeys(("bed", "bottom"), "e = 0.0833 length")
        (thrust,) = (each for each in axes.collections if each.get_label() == "line of thrust")
        ((start, end),) = thrust.get_segments()  # the lower block is pressed from both sides
        assert [start[0], end[0]] == pytest.approx([7 / 12] * 2, abs=0.05)
        assert abs(end[1] - start[1]) == pytest.approx(1.0, rel=0.1)

    @pytest.mark.parametrize(
        ("values", "texts"),
        [([4812.15, -0.00609], "4812 0"), ([10.861, -0.0272], "10.86 −0.03"), ([0.0, 0.0], "0 0"),
         ([98100.2, -3.0], "98100 0"), ([2e6, -1.40546e6], "2·10⁶ −1.405·10⁶")],
    )  # fmt: skip
    def test_noise_beside_a_number_is_zero(self, values, texts):
        assert [text.replace(" ", "") for text in beside(values)] == texts.split()
        assert beside([8.7129e-4], 3) == ["0.000871"]
        assert value_range("gap", np.array([-8.0, 3e-16]), "mm") == "gap\xa0=\xa0−8\xa0…\xa00\xa0mm"


def said(figure):
    """What stands over and under a figure."""
    return [text.get_text().replace("\n", " ") for text in figure.texts]


class TestFigures:
    """Whole figures."""

    def test_title_answer_and_what_the_solver_says(self):
        result = slanted_result()
        figure = result_figure(result, Units("mm", "MPa"), "A block")
        title, answer, foot = said(figure)
        normal, tangential = beside([result.contacts["plane"].normal_force, result.contacts["plane"].tangential_force])
        assert (title, foot) == ("A block", result.message)
        assert answer.startswith(f"plane: N = {normal}, T = {tangential} N/mm, ")
        squeezed = [Contact("left", 0.0), Contact("bottom", 0.5), Contact("top", 0.5, gap=-0.01), FREE[1]]
        twice = solve(ContactProblem(TriangleMesh.rectangle((2, 2)), Material(1e3, 0.3), squeezed))
        top = twice.contacts["top"]
        vars(twice)["contacts"] = {**twice.contacts, "top": replace(top, weights=(1.0 + 1e-12) * top.weights)}
        drawn = result_figure(twice)
        assert said(drawn)[1].startswith("bottom: ")  # rounding does not order them
        assert [axes.get_title("left") for axes in drawn.axes if axes.get_title("left")] == ["bottom", "top"]
        _, tractions = figure.axes
        assert tractions.get_xlabel() == "length along the contact [mm]"
        along, pressure = tractions.lines[0].get_data()
        assert (along[0], along[-1]) == pytest.approx((0.0, 2.0))
        assert trapezoid(pressure, along) == pytest.approx(result.contacts["plane"].normal_force, rel=1e-2)

    def test_an_infeasible_problem_is_drawn_with_the_reason(self):
        result = solve(lifted())
        assert result.status is Status.INFEASIBLE
        figure = result_figure(result)
        _, answer, foot = said(figure)
        assert answer.endswith(f". {result.status.advice}")
        assert f"{foot} {result.status.advice}" == result.solution.message
        (moved,) = [line for line in figure.axes[0].collections if line.get_label() == "mechanism"]
        edges, mesh = result.problem.mesh.boundary, result.problem.mesh
        before = mesh.vertices[np.stack([edges.first, edges.second], axis=1)]
        shift = np.array(moved.get_segments()) - before
        assert np.hypot(*shift.T).max() == pytest.approx(0.08 * mesh.length, rel=0.05)
        assert shift[..., 1].mean() > 0.0

    def test_a_limit_load_is_drawn_with_its_mechanism(self):
        problem = lifted()
        limit = limit_load_factor(problem, ["top"])
        figure = limit_figure(problem, limit, title="title", answer="no load")
        assert said(figure) == ["title", "no load", ""]
        (moved,) = [line for line in figure.axes[0].collections if line.get_label() == "mechanism"]
        assert len(moved.get_segments()) == len(problem.mesh.boundary)
        with pytest.raises(InputError, match="no mechanism"):
            limit_figure(problem, LimitLoad(np.inf, np.inf, None, np.inf, 0.0))
        with pytest.raises(InputError, match="not that of the limit analysis"):
            limit_figure(replace(problem, mesh=TriangleMesh.rectangle((3, 3))), limit)

    def test_a_body_that_yields_is_the_deeper_orange_the_more_it_dissipates(self):
        """Half of it is stronger than the other, which flows alone."""
        mesh = TriangleMesh.rectangle((2, 4)).with_region("strong", lambda _, y: y < 0.5)
        soft, strong = (Material(1e3, 0.3, "strain", Tresca(c)) for c in (1.0, 5.0))
        sides = [Symmetry("bottom"), Symmetry("left"), Traction("top", x=0.0, y=1.0), Traction("right", 0.0, 0.0)]
        problem = ContactProblem(mesh, soft, sides, regions=[Region(strong, name="strong")])
        limit = limit_load_factor(problem, ["top"], degree=3)
        figure = limit_figure(problem, limit)
        filled = [found for found in figure.axes[0].collections if isinstance(found, PolyCollection)]
        (cells,) = (found for found in filled if len(found.get_facecolor()) == mesh.cell_count)
        red, green, blue, depth = cells.get_facecolor().T
        assert ((red > green) & (green > blue)).all()
        with pytest.raises(InputError, match="not that of the limit analysis"):
            write_collapse_vtu("never.vtu", replace(problem, mesh=mesh.refined([0])), limit)
        power = limit.collapse.motion.dissipation  # in triangles of equal size
        least, most = np.argmin(power), np.argmax(power)
        assert depth[least] < 0.1 < 0.5 < depth[most] == depth.max()

    def test_history_of_results(self):
        """Loops of what moves only; forces of every contact step by step."""
        plate = compressed_plate(0.2, (2, 2))
        *others, contact = plate.conditions
        moved = [replace(plate, conditions=[*others, replace(contact, offset=w)]) for w in (0.0, 1e-4)]
        steps = tuple(map(solve, moved))
        figure = history_figure(History(steps, 2), title="Once " + 30 * "again and ")
        figure.draw_without_rendering()
        assert figure._suptitle.get_window_extent().width < figure.bbox.width
        body, loop, forces = figure.axes
        assert body.get_title().startswith("step 2")
        assert loop.get_title() == "plate"
        assert forces.lines[0].get_ydata() == pytest.approx([step.contacts["plate"].normal_force for step in steps])
        assert forces.lines[0].get_xdata().tolist() == [1, 2]
        assert loop.lines[2].get_xydata() == pytest.approx(np.column_stack(History(steps, 2).loop("plate")))
        still = replace(plate, conditions=[*others, replace(contact, offset=1e-18)])  # its loop was rounding
        assert len(history_figure(History((steps[0], solve(still)), 2)).axes) == 2
        with pytest.raises(InputError, match="no contact"):
            history_figure(History((), 2))
        wall = solve(load_problem(EXAMPLES / "dry_stone_wall.toml").problem)
        assert "not shown: forces of head 2, head 3" in history_figure(History((wall,), 1))._suptitle.get_text()
        mesh, top = TriangleMesh.rectangle((2, 2), 2.0, 1.0), Traction("top", x=20.0, y=-100.0)
        block = ContactProblem(mesh, Material(1e3, 0.3), [Contact("bottom", 0.5), top, *FREE])
        figure = history_figure(History((solve(block),), 1))
        figure.draw_without_rendering()
        corners = figure.axes[0].texts[0].get_window_extent().padded(3.0).corners()
        assert all(figure.axes[0].bbox.contains(*corner) for corner in corners)  # nor their background the axis


@pytest.mark.parametrize(("suffix", "start"), [(".svg", b"<?xml"), (".pdf", b"%PDF"), (".PNG", b"\x89PNG")])
def test_pictures_are_files_of_the_kind_their_name_says(tmp_path, suffix, start):
    path, known = tmp_path / f"picture{suffix}", dict(mpl.rcParams)
    contents = []
    for _ in range(2 if suffix == ".svg" else 1):
        figure = Figure(layout="constrained")
        figure.subplots().plot([0.0, 1.0], label="line")
        save_figure(path, figure)
        contents.append(path.read_bytes())
    assert dict(mpl.rcParams) == known
    assert contents[0].startswith(start)
    assert contents[0] == contents[-1]
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def lifted():
    """A block pulled off the ground."""
    mesh = TriangleMesh.rectangle((2, 2))
    conditions = [Contact("bottom", friction=0.3), Traction("top", x=0.0, y=1.0)]
    return ContactProblem(mesh, Material(1000.0, 0.3), [*conditions, *FREE])
