"""Pictures show the numbers they are made from."""

import sys
from dataclasses import replace
from functools import cache
from itertools import combinations

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver
from scipy.integrate import trapezoid

from qvi_contact import (
    Contact,
    ContactProblem,
    ContactState,
    Displacement,
    InputError,
    LimitLoad,
    Material,
    RectilinearMesh,
    Region,
    RigidPlate,
    Symmetry,
    Traction,
    TriangleMesh,
    exact,
    limit_load_factor,
    principal_stresses,
    solve,
)
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.gallery import compressed_plate, sliding_block
from qvi_contact.plots import (
    contact_tractions,
    deformed_contact,
    draw_problem,
    friction_used,
    history_figure,
    hysteresis_loop,
    limit_figure,
    principal_stress_map,
    problem_figure,
    require_matplotlib,
    result_figure,
    save_figure,
    stress_field,
)
from qvi_contact.plots.mechanism import moved_outlines
from qvi_contact.solution.contact_line import ContactLine
from qvi_contact.solution.sampling import cell_factors, sample_body, von_mises
from qvi_contact.units import Units
from solvers import Status
from tests.effort import thinned

OPEN, STICK, SLIP = ContactState
MESH = RectilinearMesh([0.0, 0.5, 2.0], [0.0, 1.0, 1.2, 3.0])


def uniform_result(**stress):
    material = Material(1000.0, 0.3)
    sides = {"bottom": "uu", "right": "tt", "top": "tt", "left": "tt"}
    return solve(exact.problem_from_state(exact.uniform(material, **stress), MESH, material, sides), element="bfs")


def crosses(result, largest=None):
    """Returned maximum; segments (n, 2, 2) of compression and tension, told apart by line style alone; the axes."""
    axes = Figure().subplots()
    maximum = principal_stress_map(axes, result, largest)
    drawn = {"solid": [np.zeros((0, 2, 2))], "broken": [np.zeros((0, 2, 2))]}
    for collection in axes.collections:
        if isinstance(collection, EllipseCollection):
            continue
        assert isinstance(collection, LineCollection)
        segments = [s for s in collection.get_segments() if len(s) == 2]  # outlines of cells have five points
        ((_, dashes),) = collection.get_linestyle()
        if segments:
            drawn["solid" if dashes is None else "broken"].append(np.array(segments))
    return maximum, np.concatenate(drawn["solid"]), np.concatenate(drawn["broken"]), axes


def is_crosses(collection):
    return isinstance(collection, LineCollection) and any(len(s) == 2 for s in collection.get_segments())


def lengths(segments):
    return np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)


def directions(segments):
    """Angles from the x-axis in [−0.1, π − 0.1), round-off of a horizontal line included."""
    d = segments[:, 1] - segments[:, 0]
    return (np.arctan2(d[:, 1], d[:, 0]) + 0.1) % np.pi - 0.1


def cell_sizes(segments):
    """√(h_x h_y) of the cell that holds each cross."""
    middle = segments.mean(axis=1)
    column = np.searchsorted(MESH.x, middle[:, 0]) - 1
    row = np.searchsorted(MESH.y, middle[:, 1]) - 1
    return np.sqrt(np.diff(MESH.x)[column] * np.diff(MESH.y)[row])


class TestCrosses:
    """Principal stress maps of uniform states."""

    def test_one_tension_and_one_compression_at_each_gauss_point(self):
        result = uniform_result(xx=10.0, yy=-20.0)
        maximum, compression, tension, _ = crosses(result)
        points = np.column_stack([v.ravel() for v in result.gauss_stress()[:2]])
        assert maximum == pytest.approx(20.0, rel=1e-9)
        assert compression.shape == tension.shape == (6 * 16, 2, 2)
        for segments in (compression, tension):
            assert segments.mean(axis=1) == pytest.approx(points, abs=1e-12)
        assert directions(tension) == pytest.approx(0.0, abs=1e-6)  # σ_xx pulls along x
        assert directions(compression) == pytest.approx(np.pi / 2, abs=1e-6)

    def test_lengths_are_proportional_to_the_stress(self):
        _, compression, tension, _ = crosses(uniform_result(xx=10.0, yy=-20.0))
        assert lengths(compression) == pytest.approx(cell_sizes(compression) / 4, rel=1e-8)  # neighbours just meet
        assert lengths(tension) == pytest.approx(cell_sizes(tension) / 8, rel=1e-8)

    def test_a_common_scale(self):
        maximum, compression, tension, _ = crosses(uniform_result(xx=10.0, yy=-20.0), largest=80.0)
        assert maximum == pytest.approx(20.0, rel=1e-9)  # what is there, not the scale
        assert lengths(compression) == pytest.approx(cell_sizes(compression) / 16, rel=1e-8)
        assert lengths(tension) == pytest.approx(cell_sizes(tension) / 32, rel=1e-8)

    @pytest.mark.parametrize(("xy", "pulled"), [(5.0, np.pi / 4), (-5.0, 3 * np.pi / 4)])
    def test_shear_pulls_along_one_diagonal(self, xy, pulled):
        maximum, compression, tension, _ = crosses(uniform_result(xy=xy))
        assert maximum == pytest.approx(5.0, rel=1e-9)
        assert directions(tension) == pytest.approx(pulled, abs=1e-8)
        assert directions(compression) == pytest.approx(np.pi - pulled, abs=1e-8)

    def test_an_oblique_state(self):
        """Segments lie along eigenvectors of the stress tensor."""
        _, compression, tension, _ = crosses(uniform_result(xx=3.0, yy=-7.0, xy=2.0))
        tensor = np.array([[3.0, 2.0], [2.0, -7.0]])
        for segments, value in ((tension, -2 + np.sqrt(29)), (compression, -2 - np.sqrt(29))):
            d = (segments[:, 1] - segments[:, 0]) / lengths(segments)[:, None]
            assert d @ tensor == pytest.approx(value * d, abs=1e-7)

    def test_a_stress_of_nearly_nothing_is_not_drawn(self):
        _, compression, tension, _ = crosses(uniform_result(yy=-20.0))
        assert len(compression) == 96
        assert len(tension) == 0

    def test_tension_has_round_ends_that_shrink_with_the_cells(self):
        _, _, tension, axes = crosses(uniform_result(xx=10.0, yy=-20.0))
        (dots,) = (
            found for found in axes.collections if isinstance(found, EllipseCollection) and len(found.get_offsets())
        )
        places, sizes = np.asarray(dots.get_offsets()), np.asarray(dots.get_widths())
        ends = tension.reshape(-1, 2)
        assert places[np.lexsort(places.T)] == pytest.approx(ends[np.lexsort(ends.T)], abs=1e-12)
        assert dots._units == "xy"  # in units of length
        assert sizes / np.repeat(cell_sizes(tension), 2) == pytest.approx(sizes[0] / cell_sizes(tension)[0])

    def test_few_crosses_on_a_fine_mesh(self):
        result = solve(compressed_plate(0.2, (12, 6), width=2.0))
        axes = Figure().subplots()
        maximum = principal_stress_map(axes, result, crosses=6)
        middles = np.concatenate([np.array(c.get_segments()) for c in axes.collections if is_crosses(c)]).mean(axis=1)
        assert len(np.unique(middles.round(9), axis=0)) == 6 * 3
        assert np.unique(middles[:, 0].round(9)) == pytest.approx(np.arange(0.25, 6) / 3, abs=0.1)
        assert maximum == np.abs(np.stack(principal_stresses(result.gauss_stress()[2])[:2])).max()

    def test_the_legend_states_the_stress_of_a_full_line(self):
        axes = Figure().subplots()
        principal_stress_map(axes, uniform_result(yy=-20.0), largest=80.0, units=Units("mm", "MPa"), legend=True)
        assert "80 MPa" in axes.get_legend().get_title().get_text()
        assert axes.get_xlabel() == "x [mm]"

    def test_maximum_of_a_state_that_varies(self):
        result = solve(compressed_plate(0.2, (3, 3)))
        maximum, compression, tension, axes = crosses(result)
        values = np.stack(principal_stresses(result.gauss_stress()[2])[:2])
        assert maximum == np.abs(values).max()
        assert maximum == -values.min()  # not the algebraically largest
        assert len(compression) + len(tension) == (np.abs(values) > 1e-3 * maximum).sum()
        assert axes.get_aspect() == 1.0
        assert axes.get_xlim()[0] < 0.0 < 1.0 < axes.get_xlim()[1]


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
        0 * along,
    )  # fmt: skip


STATES = ([STICK, STICK, SLIP, SLIP], [SLIP, SLIP, OPEN, OPEN], [OPEN, STICK, OPEN, SLIP])
EDGES = ((1.0, 1.5), (1.5, 3.5), (4.0, 4.4))
"""Edges of unequal length; the last apart from the others."""

SINGLE = 4.0 + 0.4 * float(gauss_legendre(4)[0][1])
"""The point that sticks between two that are open."""


def shaded(axes):
    """Label to (n, 2) ranges, and to the look without colour."""
    ranges, looks = {}, {}
    for bars in axes.containers:
        label = bars.get_label()
        ranges[label] = np.array([(bar.get_x(), bar.get_x() + bar.get_width()) for bar in bars])
        (looks[label],) = {(bar.get_hatch(), to_rgba(bar.get_facecolor())[3] > 0) for bar in bars}
    return ranges, looks


@pytest.mark.parametrize("vertical", [False, True])
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
class TestTractions:
    """Tractions along a contact, and its states."""

    @staticmethod
    def draw(order, vertical):
        line = contact([EDGES[i] for i in order], [STATES[i] for i in order], vertical)
        axes = Figure().subplots()
        contact_tractions(axes, line, "MPa")
        return line, axes

    def test_each_point_lies_in_a_range_of_its_state_alone(self, order, vertical):
        line, axes = self.draw(order, vertical)
        ranges, _ = shaded(axes)
        along = line.y if vertical else line.x
        assert set(ranges) == {"open", "stick", "slip"}
        for place, state in zip(along, line.state, strict=True):
            if place != SINGLE:
                for label, parts in ranges.items():
                    inside = ((parts[:, 0] < place) & (place < parts[:, 1])).sum()
                    assert inside == (label == ContactState(state).name.lower())

    def test_a_single_point_is_marked_and_makes_no_band(self, order, vertical):
        _, axes = self.draw(order, vertical)
        (marked,) = (drawn for drawn in axes.lines if drawn.get_label().startswith("single"))
        assert marked.get_label() == "single point: stick"
        assert marked.get_xydata() == pytest.approx(np.array([[SINGLE, 0.2 * (1.0 + SINGLE)]]))
        ranges, _ = shaded(axes)
        assert ((ranges["open"][:, 0] < SINGLE) & (ranges["open"][:, 1] > SINGLE)).sum() == 1

    def test_the_ranges_fill_the_edges(self, order, vertical):
        _, axes = self.draw(order, vertical)
        parts = np.sort(np.concatenate(list(shaded(axes)[0].values())), axis=0)
        borders = np.unique(parts.round(12))
        assert len(parts) == 5
        assert parts[:, 1] - parts[:, 0] == pytest.approx(np.diff(borders)[[0, 1, 2, 4, 5]])  # not between the lines
        assert {1.0, 3.5, 4.0, 4.4} < set(borders.tolist())

    def test_states_look_different_without_colour(self, order, vertical):
        _, axes = self.draw(order, vertical)
        looks = shaded(axes)[1]
        assert len(set(looks.values())) == 3

    def test_curves(self, order, vertical):
        line, axes = self.draw(order, vertical)
        pressure, bound, tangential = axes.lines[1:]
        along, values = pressure.get_data()
        (gap,) = np.flatnonzero(np.isnan(along))  # the line breaks where the contact does
        assert along[[0, gap - 1, gap + 1, -1]] == pytest.approx([1.0, 3.5, 4.0, 4.4])
        assert (np.diff(np.delete(along, gap)) >= 0).all()
        assert along[pressure.get_markevery()] == pytest.approx(np.sort(line.y if vertical else line.x))
        assert values == pytest.approx(1.0 + along, nan_ok=True)
        assert bound.get_ydata() == pytest.approx(0.25 * values, nan_ok=True)
        assert tangential.get_ydata() == pytest.approx(0.2 * values, nan_ok=True)
        assert len({(drawn.get_linestyle(), drawn.get_marker()) for drawn in axes.lines[1:]}) == 3
        assert axes.get_xlabel() == ("y [length]" if vertical else "x [length]")
        assert axes.get_ylabel() == "traction [MPa]"
        assert axes.get_ylim()[0] == 0.0


class TestOtherContacts:
    """Bounds that are not Coulomb's, signs, lines above each other."""

    EDGES, STATES = ((0.0, 1.0),), ([STICK] * 4,)

    def test_other_laws_are_not_labelled_as_coulomb(self):
        for bound, label in ((0.5, "friction bound"), (None, "bound $\\mu|\\sigma_N|$")):
            axes = Figure().subplots()
            contact_tractions(axes, contact(self.EDGES, self.STATES, bound=bound))
            assert axes.lines[1].get_label() == label

    def test_a_tied_contact_has_no_bound_to_draw(self):
        line = contact(self.EDGES, self.STATES, bound=np.inf)
        axes = Figure().subplots()
        contact_tractions(axes, line)
        assert np.isnan(axes.lines[1].get_ydata()).all()
        assert np.isfinite(axes.get_ylim()).all()
        friction_used(Figure().subplots(), line)

    def test_signed(self):
        axes = Figure().subplots()
        contact_tractions(axes, contact(self.EDGES, self.STATES), Units("mm", "MPa"), signed=True)
        pressure, upper, lower, tangential = (line.get_ydata() for line in axes.lines)
        assert tangential == pytest.approx(-0.2 * pressure)
        assert lower == pytest.approx(-upper)
        assert axes.get_ylim()[0] < lower.min()
        assert axes.get_xlabel() == "x [mm]"

    def test_lines_above_each_other_are_drawn_behind_each_other(self):
        axes = Figure().subplots()
        contact_tractions(axes, contact(((0.0, 1.0), (1.0, 2.0), (0.5, 1.5)), [[STICK] * 4] * 3))
        along = axes.lines[0].get_xdata()
        assert (np.nanmin(along), np.nanmax(along)) == pytest.approx((0.0, 3.0))
        assert (np.diff(along[np.isfinite(along)]) >= 0).all()
        assert "length along the contact" in axes.get_xlabel()


def notched(plane="stress"):
    """Graded cells, one of them left out, two materials; without load."""
    active = np.ones((3, 2), dtype=bool)
    active[2, 1] = False
    mesh = RectilinearMesh(MESH.x, MESH.y, active)
    conditions = [Displacement("bottom", x=0.0, y=0.0), Traction("top", x=0.0, y=-10.0)]
    conditions += [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
    regions = [Region(Material(3000.0, 0.45, plane), y=(0.0, 1.0))]
    return ContactProblem(mesh, Material(1000.0, 0.2, plane), conditions, lambda x, y: 3.0 * y + x, regions)


@cache
def notched_result(kind):
    problem = notched()
    return solve(problem if kind == "grid" else problem.triangulated())


class TestField:
    """Values in the small triangles of a field, on grids and on triangles."""

    @staticmethod
    def values(result, component, **options):
        """Values (n,) at points (n, 2) of the field, and the field."""
        field = stress_field(Figure().subplots(), result, component, **options)
        shape = field._triangulation
        return np.ma.getdata(field.get_array()), np.column_stack([shape.x, shape.y]), field

    @classmethod
    def inside(cls, result, component):
        """The same at some points inside cells."""
        drawn, points, _ = cls.values(result, component)
        chosen = np.random.default_rng(5).permutation(len(points))[:400]
        pairs = np.unique(np.column_stack(result.problem.mesh.around(points[chosen])), axis=0)
        point, count = np.unique(pairs[:, 0], return_counts=True)
        chosen = chosen[point[count == 1]]
        if isinstance(result.problem.mesh, TriangleMesh):  # stresses may jump between the three parts of a triangle
            _, cell = result.problem.mesh.around(points[chosen])
            flat = np.sort(result.problem.mesh.reference(cell, points[chosen]), axis=1)
            chosen = chosen[flat[:, 1] - flat[:, 0] > 1e-6]
        assert len(chosen) > 50
        return drawn[chosen], points[chosen]

    @pytest.mark.parametrize("component", ["xx", "yy", "xy", "first", "second", "von_mises"])
    @pytest.mark.parametrize("kind", ["grid", "triangles"])
    def test_every_point_has_the_stress_there(self, kind, component):
        result = notched_result(kind)
        drawn, points = self.inside(result, component)
        stress = result.stress(*points.T)
        xx, yy, xy = stress.T
        first, second, _ = principal_stresses(stress)
        mises = np.sqrt(xx**2 + yy**2 - xx * yy + 3 * xy**2)
        wanted = {"xx": xx, "yy": yy, "xy": xy, "first": first, "second": second, "von_mises": mises}[component]
        assert drawn == pytest.approx(wanted, rel=1e-9, abs=1e-8 * np.abs(stress).max())

    @pytest.mark.parametrize("kind", ["grid", "triangles"])
    def test_triangles_fill_the_body_and_nothing_else(self, kind):
        _, points, field = self.values(notched_result(kind), "yy")
        corners = points[field._triangulation.triangles]
        (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
        areas = np.abs(ax * by - ay * bx)
        assert areas.min() > 0.0
        assert areas.sum() / 2.0 == pytest.approx(2.0 * 3.0 - 1.5 * 1.8)
        middles = corners.mean(axis=1)
        assert not ((middles[:, 0] > 0.5) & (middles[:, 1] > 1.2)).any()

    @pytest.mark.parametrize("kind", ["grid", "triangles"])
    def test_jumps_between_cells_are_kept(self, kind):
        """On both sides of the line x = 0.5, across which σ_yy jumps and σ_xx does not."""
        result = notched_result(kind)
        samples = sample_body(result, 40)
        on_line = np.flatnonzero(np.isclose(samples.points[:, 0], 0.5) & (np.abs(samples.points[:, 1] - 0.8) < 0.15))
        left = result.problem.mesh.vertices[result.problem.mesh.cells[samples.cells[on_line]]].mean(axis=1)[:, 0] < 0.5
        heights = samples.points[on_line, 1]
        beside = [result.stress(np.full_like(heights, 0.5 + side), heights) for side in (-1e-7, 1e-7)]
        wanted = np.where(left[:, None], *beside)
        assert left.any()
        assert not left.all()
        assert samples.stress[on_line] == pytest.approx(wanted, abs=1e-4)
        assert np.abs(beside[1] - beside[0]).max(axis=0)[1] > 1e-2
        assert beside[1][:, [0, 2]] == pytest.approx(beside[0][:, [0, 2]], abs=1e-4)

    def test_small_cells_are_not_divided(self):
        mesh = TriangleMesh.rectangle((1, 1)).graded([(0.0, 0.0)], 6)
        problem = replace(notched(), mesh=mesh, regions=())
        samples = sample_body(solve(problem), 20)
        sizes = np.ptp(mesh.corners, axis=1).max(axis=1)
        assert np.bincount(samples.cells)[sizes < 0.05].tolist() == [9] * int((sizes < 0.05).sum())
        assert np.bincount(samples.cells)[np.argmax(sizes)] >= 9 * 11

    def test_bending_is_linear(self):
        state = exact.pure_bending(Material(1000.0, 0.3), 4.0)
        sides = dict.fromkeys(("bottom", "right", "top", "left"), "tt") | {"left": "uu"}
        drawn, points, quads = self.values(
            solve(exact.problem_from_state(state, MESH, Material(1000.0, 0.3), sides)), "xx"
        )
        np.testing.assert_allclose(drawn, 4.0 * points[:, 1], rtol=0.0, atol=1e-7)
        assert quads.get_cmap().name == "cividis"  # one sign only

    def test_plane_strain_counts_the_stress_out_of_the_plane(self):
        """σ_zz = ν (σ_xx + σ_yy) with the ν of each cell's own material."""
        result = solve(notched("strain"))
        drawn, points = self.inside(result, "von_mises")
        xx, yy, xy = result.stress(*points.T).T
        zz = np.where(points[:, 1] < 1.0, 0.45, 0.2) * (xx + yy)
        tensors = np.zeros((len(xx), 3, 3))
        tensors[:, 0, 0], tensors[:, 1, 1], tensors[:, 2, 2] = xx, yy, zz
        tensors[:, 0, 1] = tensors[:, 1, 0] = xy
        deviator = tensors - np.trace(tensors, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3.0
        assert drawn == pytest.approx(np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2))), rel=1e-8)

    def test_uniaxial_plane_strain_by_hand(self):
        assert cell_factors(notched("strain")) == pytest.approx([0.45, 0.45, 0.2, 0.2, 0.2])
        assert cell_factors(notched())[0] == 0.0
        assert von_mises(np.array([0.0, -10.0, 0.0]), 0.3) == pytest.approx(10 * np.sqrt(1 - 0.3 + 0.09))

    def test_colours_of_both_signs_are_centred_on_zero(self):
        result = solve(notched())
        drawn, _, quads = self.values(result, "xx")
        assert quads.get_cmap().name == "PuOr_r"
        assert quads.get_clim() == pytest.approx((-np.abs(drawn).max(), np.abs(drawn).max()))
        assert self.values(result, "xx", limits=(-1.0, 3.0))[2].get_clim() == (-1.0, 3.0)

    def test_rounding_of_a_uniform_state_is_not_shown(self):
        low, high = self.values(uniform_result(yy=-20.0), "yy")[2].get_clim()
        assert low < -20.5 < -19.5 < high

    def test_an_unknown_component_is_refused_with_the_choices(self):
        with pytest.raises(InputError, match="xx, yy, xy, von_mises"):
            stress_field(Figure().subplots(), uniform_result(yy=-20.0), "zz")


TANGENT, NORMAL = np.array([np.sqrt(0.75), 0.5]), np.array([-0.5, np.sqrt(0.75)])


@cache
def slanted_result():
    """A block of triangles on a plane that rises by 30 degrees, pushed along it."""
    mesh = TriangleMesh.rectangle((2, 2), 2.0, 1.0)
    mesh = TriangleMesh(mesh.vertices @ np.array([TANGENT, NORMAL]), mesh.cells, mesh.edge_sets)
    conditions = [Contact("bottom", friction=0.2, name="plane"), Traction("left", normal=0.0, tangential=0.0)]
    conditions += [Traction("right", normal=0.0, tangential=0.0), Displacement("top", normal=-0.01, tangential=0.05)]
    return solve(ContactProblem(mesh, Material(1000.0, 0.3), conditions))


class TestMotion:
    """Deformed contact lines."""

    def test_a_block_that_slips_is_where_the_exact_answer_says(self):
        problem, state = sliding_block()
        result = solve(problem)
        axes = Figure().subplots()
        factor = deformed_contact(axes, result, "base", factor=0.5)
        assert factor == 0.5
        line = result.contacts["base"]
        (marked,) = (drawn for drawn in axes.lines if drawn.get_marker() == "^")
        moved = state.displacement(line.x, line.y)
        assert marked.get_xdata() == pytest.approx(line.x + 0.5 * moved[0], rel=1e-6)
        assert marked.get_ydata() == pytest.approx(0.0, abs=1e-6)

    def test_slanted_edges_move_along_their_own_directions(self):
        """A block pressed flat by a plate: all of the contact stays on the plane, and slips down it."""
        result = slanted_result()
        axes = Figure().subplots()
        deformed_contact(axes, result, factor=20.0)
        line = result.contacts["plane"]
        marked = np.concatenate([drawn.get_xydata() for drawn in axes.lines if drawn.get_marker() in "s^o"])
        assert marked @ NORMAL == pytest.approx(0.0, abs=1e-9)
        slip = marked @ TANGENT - np.sort(np.column_stack([line.x, line.y]) @ TANGENT)
        order = np.argsort(np.column_stack([line.x, line.y]) @ TANGENT)
        assert slip == pytest.approx(20.0 * line.slip[order], abs=1e-9)
        assert line.slip.max() > 1e-4

    def test_a_plate_pushes_its_contact_down_and_the_factor_is_stated(self):
        axes = Figure().subplots()
        factor = deformed_contact(axes, solve(compressed_plate(0.2, (4, 4), displacement=1e-3)))
        assert factor == 50.0  # 8 % of the length at most, in round numbers
        marked = np.concatenate([line.get_ydata() for line in axes.lines if line.get_marker() not in ("None", None)])
        assert marked == pytest.approx(1.0 - 50.0 * 1e-3, abs=1e-9)
        assert axes.get_legend().get_title().get_text() == "displacements × 50"

    def test_a_plate_driven_by_force_moves_with_the_body(self):
        """Uniform compression by a force: the obstacle is where the surface is, at the plate's motion."""
        mesh = RectilinearMesh.rectangle((2, 2))
        contact = Contact("top", friction=0.0, plate=RigidPlate(force_y=-10.0))
        conditions = [Symmetry("left"), Symmetry("bottom"), Traction("right", x=0.0, y=0.0), contact]
        result = solve(ContactProblem(mesh, Material(1000.0, 0.3), conditions))
        axes = Figure().subplots()
        deformed_contact(axes, result, factor=1.0)
        obstacle = next(line for line in axes.lines if line.get_color() == "black")
        marked = np.concatenate([line.get_ydata() for line in axes.lines if line.get_marker() in ("s", "^", "o")])
        assert obstacle.get_ydata() == pytest.approx(1.0 - 0.01, rel=1e-7)
        assert marked == pytest.approx(1.0 - 0.01, rel=1e-7)

    def test_a_body_above_its_obstacle(self):
        conditions = [Displacement("top", x=0.0, y=-0.1), Contact("bottom", friction=0.3, gap=0.3)]
        conditions += [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
        result = solve(ContactProblem(RectilinearMesh.rectangle((2, 2)), Material(1000.0, 0.3), conditions))
        axes = Figure().subplots()
        deformed_contact(axes, result, factor=1.0)
        obstacle = next(line for line in axes.lines if line.get_color() == "black")
        (surface,) = (line for line in axes.lines if line.get_marker() == "o" and len(line.get_xdata()))
        assert obstacle.get_ydata() == pytest.approx(-0.3)
        assert surface.get_ydata() == pytest.approx(-0.1, abs=1e-6)

    def test_a_joint_that_opens_has_two_faces_apart(self):
        """The upper block is lifted and moved to the right: half of that is drawn on either side."""
        mesh = RectilinearMesh.rectangle((2, 2), 1.0, 2.0).with_joint("bed", "horizontal", 1.0)
        conditions = [Displacement("bottom", x=0.0, y=0.0), Displacement("top", x=0.2, y=0.5)]
        conditions += [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
        result = solve(ContactProblem(mesh, Material(1000.0, 0.3), [*conditions, Contact("bed", friction=0.3)]))
        axes = Figure().subplots()
        deformed_contact(axes, result, factor=1.0)
        lower, upper = (line for line in axes.lines if line.get_marker() == "o" and len(line.get_xdata()))
        x = np.sort(result.contacts["bed"].x)
        assert lower.get_xydata() == pytest.approx(np.column_stack([x - 0.1, np.full_like(x, 0.75)]), abs=1e-6)
        assert upper.get_xydata() == pytest.approx(np.column_stack([x + 0.1, np.full_like(x, 1.25)]), abs=1e-6)

    def test_an_unknown_contact_is_refused_with_the_known_ones(self):
        with pytest.raises(InputError, match="plate"):
            deformed_contact(Figure().subplots(), solve(compressed_plate(0.2)), "table")


def _bowl(x, y):
    return 0.01 * x**2 + 0 * y


def loaded():
    """A block with everything a problem may have."""
    mesh = RectilinearMesh.rectangle((4, 4), 2.0, 2.0).with_joint("bed", "horizontal", 1.0)
    mesh = mesh.with_edges("press", "top", stop=1.0).with_edges("lid", "top", start=1.0)
    conditions = [
        Traction("left", x=lambda x, y: 5.0 * y + 0 * x, y=0.0),
        Traction("right", x=2.0),
        Displacement("right", y=0.0),
        Traction("lid", x=0.0, y=0.0),
        Contact("bottom", friction=lambda x, y: 0.2 + 0.1 * x + 0 * y, gap=_bowl, name="ground"),
        Contact("press", friction=0.1, plate=RigidPlate(force_y=-3.0, moment=0.5)),
        Contact("bed", friction=0.4, cohesion=1.5),
    ]
    regions = [Region(Material(500.0, 0.2), y=(1.0, 2.0))]
    return ContactProblem(mesh, Material(1000.0, 0.3), conditions, regions=regions)


class TestProblem:
    """The sketch of a problem."""

    @staticmethod
    def arrows(axes, colour):
        """Tails and vectors of the arrows of a colour."""
        found = [
            q
            for q in axes.collections
            if isinstance(q, Quiver) and q.get_facecolor()[0] == pytest.approx(to_rgba(colour))
        ]
        tails = np.concatenate([np.asarray(q.XY) for q in found])
        return tails, np.concatenate([np.column_stack([q.U, q.V]) for q in found])

    def test_tractions_point_the_way_they_act(self):
        axes = Figure().subplots()
        draw_problem(axes, loaded())
        tails, vectors = self.arrows(axes, "#D55E00")
        assert vectors[:, 1] == pytest.approx(0.0)
        assert (vectors[:, 0] > 0).all()
        left = tails[:, 0] < 1.0
        assert (tails + vectors)[left, 0] == pytest.approx(0.0)  # pressed: they end at the side
        assert tails[~left, 0] == pytest.approx(2.0)  # pulled: they begin there
        share = vectors[left, 0] / tails[left, 1]
        assert share == pytest.approx(share[0])  # 5 y
        assert vectors[~left, 0] == pytest.approx(2.0 / 5.0 * share[0])  # one scale for all

    def test_a_plates_force_points_at_it(self):
        axes = Figure().subplots()
        draw_problem(axes, loaded())
        tails, vectors = self.arrows(axes, "black")
        assert tails[0, 0] == pytest.approx(0.5)
        assert vectors[0, 0] == 0.0
        assert vectors[0, 1] < 0.0
        assert 2.0 < (tails + vectors)[0, 1] < 2.2

    def test_components_given_apart_make_one_arrow(self):
        problem, _ = sliding_block()
        axes = Figure().subplots()
        draw_problem(axes, problem)
        tails, vectors = self.arrows(axes, "#D55E00")
        top = tails[:, 1] > 1.0
        assert vectors[top, 0] / vectors[top, 1] == pytest.approx(30.0 / -100.0)

    def test_the_legend_names_everything(self):
        axes = Figure().subplots()
        draw_problem(axes, loaded(), Units("mm", "MPa"))
        legend = " ".join(" ".join(text.get_text() for text in axes.get_legend().get_texts()).split())
        for words in (
            "1: E = 1000 MPa", "2: E = 500 MPa", "t_x = 0 … 10 MPa", "u_y = 0 mm", "free: lid",
            "contact ground: μ = 0.2 … 0.4, gap = 0 … 0.04 mm", "F_y = −3 N/mm", "M = 0.5 N mm/mm",
            "joint bed: μ = 0.4, c = 1.5 MPa",
        ):  # fmt: skip
            assert words in legend
        assert {"ground", "press", "bed"} <= {text.get_text() for text in axes.texts}

    def test_the_obstacle_follows_the_gap(self):
        axes = Figure().subplots()
        draw_problem(axes, loaded())
        curves = [np.column_stack(line.get_data()) for line in axes.lines if line.get_color() == "black"]
        (curve,) = (c for c in curves if len(c) > 3 and c[:, 1].max() < 0.0)
        depth = curve[0, 1] - curve[:, 1]
        assert depth / depth[-1] == pytest.approx((curve[:, 0] / 2.0) ** 2, abs=1e-9)

    def test_holes_and_every_kind_of_support(self):
        """Nothing breaks, and the words stay inside the picture."""
        active = np.ones((3, 3), dtype=bool)
        active[1, 1] = False
        mesh = RectilinearMesh([0, 1, 2, 3], [0, 1, 2, 3], active)
        for name, side, at in (
            ("low", "bottom", 0.0),
            ("high", "top", 3.0),
            ("west", "left", 0.0),
            ("east", "right", 3.0),
        ):
            mesh = mesh.with_edges(name, side, at=at)
        mesh = mesh.with_edges("roof", "bottom", at=2.0).with_edges("floor", "top", at=1.0)
        mesh = mesh.with_edges("wall", "left", at=2.0).with_edges("pane", "right", at=1.0)
        conditions = [Traction(name, x=0.0, y=0.0) for name in ("roof", "floor", "wall", "pane", "high")]
        conditions += [Displacement("low", x=0.0), Traction("low", y=1.0), Symmetry("west")]
        conditions += [Displacement("east", x=lambda x, y: 1e-3 * y + 0 * x, y=-2e-3)]
        figure = problem_figure(ContactProblem(mesh, Material(1.0, 0.3), conditions))
        figure.draw_without_rendering()
        box = figure.axes[0].get_legend().get_window_extent()
        assert 0 <= box.x0 < box.x1 <= figure.bbox.width
        assert 0 <= box.y0 < box.y1 <= figure.bbox.height


NOTHING = ({}, [])


def heading(figure):
    """The title over a figure or its upper part, if there is one."""
    return next((part._suptitle for part in (figure, *figure.subfigs) if part._suptitle is not None), None)


class TestFigures:
    """Whole figures."""

    @staticmethod
    def misplaced(figure):
        """Titles, labels and legends beyond the page, and pairs of them that overlap."""
        figure.draw_without_rendering()
        page = figure.bbox
        boxes = {"heading": heading(figure).get_window_extent()} if heading(figure) else {}
        for axes in figure.findobj(Axes):
            for artist in (axes.title, axes.xaxis.label, axes.yaxis.label, axes.get_legend()):
                if artist is not None and artist.get_window_extent().width > 1.0:
                    boxes[str(artist), str(axes)] = artist.get_window_extent()
        off = {name: box for name, box in boxes.items() if not page.padded(1.0).contains(*box.min)}
        off |= {name: box for name, box in boxes.items() if not page.padded(1.0).contains(*box.max)}
        overlapping = [(a, b) for a, b in combinations(boxes, 2) if boxes[a].overlaps(boxes[b])]
        return off, overlapping

    @pytest.mark.parametrize(("width", "height"), thinned([(1.0, 1.0), (4.0, 1.0), (1.0, 4.0)], 2))
    def test_overview(self, width, height):
        result = solve(compressed_plate(0.2, (4, 4), width, height))
        figure = result_figure(result, Units("mm", "MPa"))
        assert self.misplaced(figure) == NOTHING
        assert heading(figure).get_text() == result.message
        titles = [axes.get_title() for axes in figure.axes]
        force = result.contacts["plate"].normal_force
        assert any(f"plate: N = {force:.4g}, T = −" in title and title.endswith("N/mm") for title in titles)

    def test_overview_on_triangles(self):
        result = slanted_result()
        figure = result_figure(result, Units("mm", "MPa"))
        assert self.misplaced(figure) == NOTHING
        (tractions,) = (axes for axes in figure.axes if axes.get_title().startswith("plane: N"))
        assert tractions.get_xlabel() == "length along the contact [mm]"
        along, pressure = tractions.lines[0].get_data()
        assert (along[0], along[-1]) == pytest.approx((0.0, 2.0))
        force = trapezoid(pressure, along)
        assert force == pytest.approx(result.contacts["plane"].normal_force, rel=1e-3)

    def test_of_many_contacts_four_are_shown_and_the_rest_named(self):
        mesh = RectilinearMesh.rectangle((6, 2), 3.0, 1.0)
        for k in range(6):
            mesh = mesh.with_edges(f"foot {k}", "bottom", 0.5 * k, 0.5 * (k + 1))
        conditions = [
            Displacement("top", x=0.0, y=-1e-3),
            *(Traction(side, x=0.0, y=0.0) for side in ("left", "right")),
        ]
        conditions += [Contact(f"foot {k}", friction=0.3) for k in range(6)]
        figure = result_figure(solve(ContactProblem(mesh, Material(1e4, 0.3), conditions)))
        assert self.misplaced(figure) == NOTHING
        assert heading(figure).get_text().replace("\n", " ").endswith("Without a panel of tractions: foot 4, foot 5.")
        assert sum(axes.get_title().startswith("foot") for axes in figure.axes) == 4

    def test_without_contact(self):
        figure = result_figure(uniform_result(xx=3.0))
        assert self.misplaced(figure) == NOTHING
        assert not any("deformed" in axes.get_title() for axes in figure.axes)

    def test_an_infeasible_problem_is_drawn_with_the_reason(self):
        result = solve(lifted())
        assert result.status is Status.INFEASIBLE
        figure = result_figure(result)
        title = heading(figure).get_text().replace("\n", " ")
        assert title.count("infeasible") == 1
        assert title.count(result.status.advice) == 1
        (moved,) = [line for line in figure.axes[0].collections if line.get_label() == "mechanism"]
        ends = np.array(moved.get_segments())
        mesh = result.problem.mesh
        before = mesh.vertices[np.column_stack([mesh.boundary.first, mesh.boundary.second])]
        assert np.hypot(*(ends - before).T).max() == pytest.approx(0.08 * mesh.length, rel=0.05)

    def test_a_limit_load_is_drawn_with_its_mechanism(self):
        problem = lifted().triangulated()
        limit = limit_load_factor(problem, ["top"])
        figure = limit_figure(problem, limit, title="title")
        (moved,) = [line for line in figure.axes[0].collections if line.get_label() == "mechanism"]
        assert np.array(moved.get_segments()) == pytest.approx(moved_outlines(problem.mesh, limit.mechanism))
        assert heading(figure).get_text().startswith("title. ")
        with pytest.raises(InputError, match="no mechanism"):
            limit_figure(problem, LimitLoad(np.inf, np.inf, None, np.inf, 0.0))

    def test_history_of_loops_alone(self):
        w, force = [0.0, 1.0, -1.0, 1.0], [0.0, 2.0, -2.0, 2.0]
        figure = history_figure({"ground": (w, force)}, Units("mm", "MPa"))
        (axes,) = figure.axes
        assert axes.lines[2].get_xydata() == pytest.approx(np.column_stack([w, force]))
        assert axes.get_xlabel() == "displacement [mm]"
        assert axes.get_ylabel() == "force [N/mm]"

    def test_history_of_results(self):
        """Loops of what moves only; forces of every contact step by step."""
        steps = [solve(compressed_plate(0.2, displacement=u)) for u in (1e-3, 2e-3)]

        class Steps:
            def __init__(self):
                self.steps = steps

            def loop(self, name):
                return np.array([0.0, 1.0]), np.array([step.contacts[name].tangential_force for step in steps])

        figure = history_figure(Steps())
        assert self.misplaced(figure) == NOTHING
        loop, forces = figure.axes
        assert loop.get_title() == "plate"
        assert forces.lines[0].get_ydata() == pytest.approx([step.contacts["plate"].normal_force for step in steps])
        assert forces.lines[0].get_xdata().tolist() == [1, 2]

    def test_nothing_to_draw_is_said(self):
        with pytest.raises(InputError, match="no contact"):
            history_figure({})
        with pytest.raises(InputError, match="one length"):
            hysteresis_loop(Figure().subplots(), [0.0, 1.0], [0.0])


@pytest.mark.parametrize(
    ("suffix", "start"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF"), (".PNG", b"\x89PNG")]
)
def test_pictures_are_files_of_the_kind_their_name_says(tmp_path, suffix, start):
    path, known = tmp_path / f"picture{suffix}", dict(mpl.rcParams)
    contents = []
    for _ in range(2):
        figure = problem_figure(compressed_plate(0.2))
        layout = figure.get_layout_engine(), figure.canvas, figure.dpi
        save_figure(path, figure)
        contents.append(path.read_bytes())
        assert (figure.get_layout_engine(), figure.canvas, figure.dpi) == layout  # it can be changed, and saved again
    assert dict(mpl.rcParams) == known
    assert contents[0].startswith(start)
    assert contents[0] == contents[1]
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_other_kinds_of_pictures_are_refused_with_the_choices(tmp_path):
    with pytest.raises(InputError, match=r"\.png, \.svg, \.pdf"):
        save_figure(tmp_path / "picture.jpeg", Figure())
    assert not list(tmp_path.iterdir())


def lifted():
    """A block pulled off the ground."""
    mesh = RectilinearMesh.rectangle((2, 2))
    conditions = [Contact("bottom", friction=0.3), Traction("top", x=0.0, y=1.0)]
    conditions += [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
    return ContactProblem(mesh, Material(1000.0, 0.3), conditions)


def test_without_matplotlib_the_command_to_type_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(InputError, match=r"pip install 'qvi-contact\[plot\]'"):
        require_matplotlib()
