"""Pictures of results show the numbers they are made from."""

from dataclasses import replace
from functools import cache
from itertools import combinations

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection, TriMesh
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from scipy.integrate import trapezoid

from qvi_contact import (
    Contact,
    ContactProblem,
    ContactState,
    Displacement,
    History,
    InputError,
    LimitLoad,
    Material,
    Region,
    Traction,
    TriangleMesh,
    exact,
    limit_load_factor,
    principal_stresses,
    solve,
)
from qvi_contact.element import gauss_legendre
from qvi_contact.gallery import compressed_plate
from qvi_contact.plots import (
    bracket_figure,
    contact_tractions,
    deformed_contact,
    deformed_figure,
    friction_used,
    history_figure,
    limit_figure,
    moved_outlines,
    principal_stress_map,
    problem_figure,
    result_figure,
    save_figure,
    stress_field,
)
from qvi_contact.solution import ContactLine, cell_factors, sample_body, von_mises
from qvi_contact.units import Units
from solvers import Status

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


def crosses(result, largest=None):
    """Returned maximum; segments (n, 2, 2) of compression and tension, told apart by line style alone; the axes."""
    axes = new_axes()
    maximum = principal_stress_map(axes, result, largest)
    drawn = {"solid": [np.zeros((0, 2, 2))], "broken": [np.zeros((0, 2, 2))]}
    for collection in axes.collections:
        if isinstance(collection, LineCollection):
            segments = [s for s in collection.get_segments() if len(s) == 2]  # outlines of cells have more points
            ((_, dashes),) = collection.get_linestyle()
            if segments:
                drawn["solid" if dashes is None else "broken"].append(np.array(segments))
    return maximum, np.concatenate(drawn["solid"]), np.concatenate(drawn["broken"]), axes


def lengths(segments):
    return np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)


def spacings(result, segments):
    """√(A/n) of the cell of area A that holds each cross, with n points: neighbours just meet."""
    mesh = result.problem.mesh
    a, b, c = mesh.corners[mesh.locate(segments.mean(axis=1))].swapaxes(0, 1)
    areas = np.abs(np.linalg.det(np.stack([b - a, c - a], axis=1))) / 2.0
    return np.sqrt(areas / result.gauss_stress()[0].shape[1])


class TestCrosses:
    """Principal stress maps of uniform states."""

    @pytest.mark.parametrize("largest", [None, 80.0])
    def test_one_tension_and_one_compression_at_each_gauss_point(self, largest):
        """As long as the stress is large, by itself or on a common scale."""
        result = uniform_result(xx=10.0, yy=-20.0)
        maximum, compression, tension, _ = crosses(result, largest)
        points = np.column_stack([v.ravel() for v in result.gauss_stress()[:2]])
        assert maximum == pytest.approx(20.0, rel=1e-9)  # what is there, not the scale
        for segments, stress, axis in ((compression, 20.0, 0), (tension, 10.0, 1)):
            assert segments.mean(axis=1) == pytest.approx(points, abs=1e-12)
            full = stress / (largest or 20.0)
            assert lengths(segments) == pytest.approx(full * spacings(result, segments), rel=1e-6)
            assert np.ptp(segments[:, :, axis], axis=1) == pytest.approx(0.0, abs=1e-6)  # σ_xx pulls along x

    @pytest.mark.parametrize("stress", [(3.0, -7.0, 2.0), (0.0, 0.0, 5.0), (0.0, 0.0, -5.0)])
    def test_segments_lie_along_eigenvectors_of_the_stress(self, stress):
        maximum, compression, tension, _ = crosses(uniform_result(*stress))
        xx, yy, xy = stress
        tensor = np.array([[xx, xy], [xy, yy]])
        low, high = np.linalg.eigvalsh(tensor)
        assert maximum == pytest.approx(max(-low, high), rel=1e-9)
        for segments, value in ((tension, high), (compression, low)):
            d = (segments[:, 1] - segments[:, 0]) / lengths(segments)[:, None]
            assert d @ tensor == pytest.approx(value * d, abs=1e-6)

    def test_tension_has_round_ends_that_shrink_with_the_cells_and_next_to_nothing_is_not_drawn(self):
        result = uniform_result(xx=10.0, yy=-20.0)
        _, _, tension, axes = crosses(result)
        dotted = [found for found in axes.collections if isinstance(found, EllipseCollection)]
        (dots,) = (found for found in dotted if len(found.get_offsets()))
        places, ends = np.asarray(dots.get_offsets()), tension.reshape(-1, 2)
        assert places[np.lexsort(places.T)] == pytest.approx(ends[np.lexsort(ends.T)], abs=1e-12)
        assert np.asarray(dots.get_widths()) == pytest.approx(0.1 * np.repeat(spacings(result, tension), 2))
        pressed = uniform_result(yy=-20.0)
        assert [len(drawn) for drawn in crosses(pressed)[1:3]] == [pressed.gauss_stress()[0].size, 0]
        principal_stress_map(axes, pressed, largest=80.0, units=Units("mm", "MPa"), legend=True)
        assert "80 MPa" in axes.get_legend().get_title().get_text()
        assert axes.get_xlabel() == "x [mm]"

    def test_maximum_of_a_state_that_varies(self):
        result = solve(compressed_plate(0.2, (3, 3)))
        maximum, compression, tension, axes = crosses(result)
        values = np.stack(principal_stresses(result.gauss_stress()[2])[:2])
        assert maximum == np.abs(values).max() == -values.min()  # not the algebraically largest
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
        axes = new_axes()
        contact_tractions(axes, line, Units("mm", "MPa"))
        return line, axes

    def test_each_point_lies_in_a_range_of_its_state_alone(self, order, vertical):
        """But for a single point between others, which is marked and makes no band."""
        line, axes = self.draw(order, vertical)
        ranges, looks = shaded(axes)
        along = line.y if vertical else line.x
        assert set(ranges) == {"open", "stick", "slip"}
        assert len(set(looks.values())) == 3  # without colour
        for place, state in zip(along, line.state, strict=True):
            for label, parts in ranges.items():
                inside = ((parts[:, 0] < place) & (place < parts[:, 1])).sum()
                assert inside == (label == ("open" if place == SINGLE else ContactState(state).name.lower()))
        (marked,) = (drawn for drawn in axes.lines if drawn.get_label().startswith("single"))
        assert marked.get_label() == "single point: stick"
        assert marked.get_xydata() == pytest.approx(np.array([[SINGLE, 0.2 * (1.0 + SINGLE)]]))
        parts = np.sort(np.concatenate(list(ranges.values())), axis=0)
        borders = np.unique(parts.round(12))
        assert len(parts) == 5
        assert parts[:, 1] - parts[:, 0] == pytest.approx(np.diff(borders)[[0, 1, 2, 4, 5]])  # not between the lines
        assert {1.0, 3.5, 4.0, 4.4} < set(borders.tolist())

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
        assert axes.get_xlabel() == ("y [mm]" if vertical else "x [mm]")
        assert axes.get_ylabel() == "traction [MPa]"
        assert axes.get_ylim()[0] == 0.0


class TestOtherContacts:
    """Bounds that are not Coulomb's, lines above each other."""

    EDGES, STATES = ((0.0, 1.0),), ([STICK] * 4,)

    def test_other_laws_are_not_labelled_as_coulomb(self):
        for bound, label in ((0.5, "friction bound"), (None, "bound $\\mu|\\sigma_N|$")):
            axes = new_axes()
            contact_tractions(axes, contact(self.EDGES, self.STATES, bound=bound))
            assert axes.lines[1].get_label() == label

    def test_a_tied_contact_has_no_bound_to_draw(self):
        line = contact(self.EDGES, self.STATES, bound=np.inf)
        axes = new_axes()
        contact_tractions(axes, line)
        assert np.isnan(axes.lines[1].get_ydata()).all()
        assert np.isfinite(axes.get_ylim()).all()
        friction_used(new_axes(), line)


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


class Seen(Axes):
    """Axes that remember the triangles that are drawn."""

    def tripcolor(self, shape, *values, **look):
        self.shape = shape
        return super().tripcolor(shape, *values, **look)


class TestField:
    """Values in the small triangles of a field."""

    @staticmethod
    def values(result, component, **options):
        """Values (n,) at points (n, 2) of the field, the triangles and the field."""
        axes = Figure().add_subplot(axes_class=Seen)
        field = stress_field(axes, result, component, **options)
        points = np.column_stack([axes.shape.x, axes.shape.y])
        return np.ma.getdata(field.get_array()), points, axes.shape.triangles, field

    @classmethod
    def inside(cls, result, component):
        """The same at some points inside the three parts of a triangle, between which stresses may jump."""
        drawn, points, *_ = cls.values(result, component)
        chosen = np.random.default_rng(5).permutation(len(points))[:400]
        pairs = np.unique(np.column_stack(result.problem.mesh.around(points[chosen])), axis=0)
        point, count = np.unique(pairs[:, 0], return_counts=True)
        chosen = chosen[point[count == 1]]
        _, cell = result.problem.mesh.around(points[chosen])
        flat = np.sort(result.problem.mesh.reference(cell, points[chosen]), axis=1)
        chosen = chosen[flat[:, 1] - flat[:, 0] > 1e-6]
        assert len(chosen) > 50
        return drawn[chosen], points[chosen]

    @pytest.mark.parametrize("component", ["xx", "yy", "xy", "first", "second", "von_mises"])
    def test_every_point_has_the_stress_there(self, component):
        result = notched()
        drawn, points = self.inside(result, component)
        stress = result.stress(*points.T)
        xx, yy, xy = stress.T
        first, second, _ = principal_stresses(stress)
        mises = np.sqrt(xx**2 + yy**2 - xx * yy + 3 * xy**2)
        wanted = {"xx": xx, "yy": yy, "xy": xy, "first": first, "second": second, "von_mises": mises}[component]
        assert drawn == pytest.approx(wanted, rel=1e-9, abs=1e-8 * np.abs(stress).max())

    def test_triangles_fill_the_body_and_nothing_else(self):
        _, points, triangles, _ = self.values(notched(), "yy")
        corners = points[triangles]
        areas = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 2.0
        assert areas.min() > 0.0
        assert areas.sum() == pytest.approx(2.0 * 3.0 - 1.5 * 1.8)
        middles = corners.mean(axis=1)
        assert not ((middles[:, 0] > 0.5) & (middles[:, 1] > 1.2)).any()

    def test_jumps_between_cells_are_kept(self):
        """On both sides of the line x = 0.5, across which σ_yy jumps and σ_xx does not."""
        result = notched()
        samples = sample_body(result, 40)
        on_line = np.flatnonzero(np.isclose(samples.points[:, 0], 0.5) & (np.abs(samples.points[:, 1] - 0.8) < 0.15))
        left = result.problem.mesh.corners[samples.cells[on_line]].mean(axis=1)[:, 0] < 0.5
        heights = samples.points[on_line, 1]
        beside = [result.stress(np.full_like(heights, 0.5 + side), heights) for side in (-1e-7, 1e-7)]
        assert {True, False} == set(left.tolist())
        assert samples.stress[on_line] == pytest.approx(np.where(left[:, None], *beside), abs=1e-4)
        assert np.abs(beside[1] - beside[0]).max(axis=0)[1] > 1e-2
        assert beside[1][:, [0, 2]] == pytest.approx(beside[0][:, [0, 2]], abs=1e-4)

    def test_plane_strain_counts_the_stress_out_of_the_plane(self):
        """σ_zz = ν (σ_xx + σ_yy) with the ν of each cell's own material; by tensors, and by hand."""
        result = notched("strain")
        drawn, points = self.inside(result, "von_mises")
        xx, yy, xy = result.stress(*points.T).T
        zz = np.where(points[:, 1] < 1.0, 0.45, 0.2) * (xx + yy)
        tensors = np.zeros((len(xx), 3, 3))
        tensors[:, 0, 0], tensors[:, 1, 1], tensors[:, 2, 2] = xx, yy, zz
        tensors[:, 0, 1] = tensors[:, 1, 0] = xy
        deviator = tensors - np.trace(tensors, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3.0
        assert drawn == pytest.approx(np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2))), rel=1e-8)
        assert sorted(set(cell_factors(result.problem))) == pytest.approx([0.2, 0.45])
        assert set(cell_factors(notched().problem)) == {0.0}
        assert von_mises(np.array([0.0, -10.0, 0.0]), 0.3) == pytest.approx(10 * np.sqrt(1 - 0.3 + 0.09))

    def test_colours_of_both_signs_are_centred_on_zero_and_rounding_is_not_shown(self):
        drawn, _, _, field = self.values(notched(), "xx")
        assert field.get_cmap().name == "PuOr_r"
        assert field.get_clim() == pytest.approx((-np.abs(drawn).max(), np.abs(drawn).max()))
        assert self.values(notched(), "xx", limits=(-1.0, 3.0))[-1].get_clim() == (-1.0, 3.0)
        field = self.values(uniform_result(xx=10.0), "xx")[-1]
        assert field.get_cmap().name == "cividis"  # one sign only
        low, high = field.get_clim()
        assert low < 9.7 < 10.3 < high
        with pytest.raises(InputError, match="xx, yy, xy, von_mises"):
            stress_field(new_axes(), notched(), "zz")


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

    def test_slanted_edges_move_along_their_own_directions(self):
        """A block pressed flat by a plate: all of the contact stays on the plane, and slips down it."""
        result = slanted_result()
        axes = new_axes()
        deformed_contact(axes, result, factor=20.0)
        line = result.contacts["plane"]
        marked = np.concatenate([drawn.get_xydata() for drawn in axes.lines if drawn.get_marker() in "s^o"])
        assert marked @ NORMAL == pytest.approx(0.0, abs=1e-9)
        slip = marked @ TANGENT - np.sort(np.column_stack([line.x, line.y]) @ TANGENT)
        order = np.argsort(np.column_stack([line.x, line.y]) @ TANGENT)
        assert slip == pytest.approx(20.0 * line.slip[order], abs=1e-9)
        assert line.slip.max() > 1e-4

    def test_a_plate_pushes_its_contact_down_and_the_factor_is_stated(self):
        axes = new_axes()
        factor = deformed_contact(axes, solve(compressed_plate(0.2, (4, 4), displacement=1e-3)))
        assert factor == 50.0  # 8 % of the length at most, in round numbers
        marked = np.concatenate([line.get_ydata() for line in axes.lines if line.get_marker() not in ("None", None)])
        assert marked == pytest.approx(1.0 - 50.0 * 1e-3, abs=1e-9)
        assert axes.get_legend().get_title().get_text() == "displacements × 50"
        lowered = [Displacement("top", x=0.0, y=-1e-3), *FREE, Contact("bottom", 0.3, gap=2e-3)]
        apart = solve(ContactProblem(TriangleMesh.rectangle((1, 1)), Material(1.0, 0.3), lowered))
        assert deformed_contact(new_axes(), apart) == 50.0  # an obstacle farther away does not make it smaller
        with pytest.raises(InputError, match="plate"):
            deformed_contact(axes, solve(compressed_plate(0.2, (1, 1))), "table")

    def test_a_joint_that_opens_has_two_faces_apart(self):
        """The upper block is lifted and moved to the right: half of that is drawn on either side."""
        mesh = TriangleMesh.rectangle((2, 2), 1.0, 2.0).with_joint("bed", lambda _, y: np.isclose(y, 1.0))
        conditions = [Displacement("bottom", x=0.0, y=0.0), Displacement("top", x=0.2, y=0.5)]
        conditions += [*FREE, Contact("bed", friction=0.3)]
        result = solve(ContactProblem(mesh, Material(1000.0, 0.3), conditions))
        axes = new_axes()
        deformed_contact(axes, result, factor=1.0)
        lower, upper = (line for line in axes.lines if line.get_marker() == "o" and len(line.get_xdata()))
        x = np.sort(result.contacts["bed"].x)
        assert lower.get_xydata() == pytest.approx(np.column_stack([x - 0.1, np.full_like(x, 0.75)]), abs=1e-6)
        assert upper.get_xydata() == pytest.approx(np.column_stack([x + 0.1, np.full_like(x, 1.25)]), abs=1e-6)


class TestBounds:
    """Pictures of a bracket and its displacements."""

    @pytest.fixture
    def bracket(self):
        return slanted_result().bracket

    def test_the_gap_of_each_cell_is_drawn(self, bracket):
        (drawn,) = (c for c in bracket_figure(bracket).axes[0].collections if isinstance(c, PolyCollection))
        corners = bracket.result.problem.mesh.corners
        density = 2.0 * bracket.cell_gaps / np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
        assert np.asarray(drawn.get_array()) == pytest.approx(np.maximum(density, 1e-6 * density.max()))
        for path, wanted in zip(drawn.get_paths(), corners, strict=True):
            assert path.vertices[:3] == pytest.approx(wanted)

    def test_the_deformed_body_is_drawn(self, bracket):
        axes = deformed_figure(bracket.companion, scale=3.0).axes[0]
        (field,) = (c for c in axes.collections if isinstance(c, TriMesh))
        vertices = bracket.result.problem.mesh.vertices
        moved = vertices + 3.0 * bracket.companion.displacement(*vertices.T)
        drawn = np.concatenate([path.vertices[:3] for path in field.get_paths()])
        for place in moved:
            assert np.hypot(*(drawn - place).T).min() < 1e-9
        assert drawn.min(axis=0) == pytest.approx(moved.min(axis=0), abs=0.02)


NOTHING = ({}, [])


def heading(figure):
    """The title over a figure or its upper part, if there is one."""
    return next((text for part in (figure, *figure.subfigs) for text in part.texts), None)


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

    def test_overview(self):
        result = slanted_result()
        figure = result_figure(result, Units("mm", "MPa"))
        assert self.misplaced(figure) == NOTHING
        assert heading(figure).get_text() == result.message
        (tractions,) = (axes for axes in figure.axes if axes.get_title().startswith("plane: N"))
        assert tractions.get_xlabel() == "length along the contact [mm]"
        along, pressure = tractions.lines[0].get_data()
        assert (along[0], along[-1]) == pytest.approx((0.0, 2.0))
        force = trapezoid(pressure, along)
        assert force == pytest.approx(result.contacts["plane"].normal_force, rel=1e-3)

    def test_of_many_contacts_four_are_shown_and_the_rest_named(self):
        mesh = TriangleMesh.rectangle((6, 1), 3.0, 1.0)
        for k in range(6):
            mesh = mesh.with_edges(f"foot {k}", lambda x, y, k=k: (y == 0.0) & (x > 0.5 * k) & (x < 0.5 * (k + 1)))
        conditions = [Displacement("top", x=0.0, y=-1e-3), *FREE, *(Contact(f"foot {k}", 0.3) for k in range(6))]
        figure = result_figure(solve(ContactProblem(mesh, Material(1e4, 0.3), conditions)))
        assert self.misplaced(figure) == NOTHING
        assert heading(figure).get_text().replace("\n", " ").endswith("Without a panel of tractions: foot 4, foot 5.")
        assert sum(axes.get_title().startswith("foot") for axes in figure.axes) == 4

    def test_under_loads_alone_there_are_forces_over_the_time_and_no_loop(self):
        step, times = solve(compressed_plate(0.2, (2, 2))), [0.5, 1.0, 0.25]
        history = History((step,) * 3, 3)
        (forces,) = history_figure(history, times=times).axes
        curves = {line.get_label(): line for line in forces.lines}
        assert curves["N"].get_xdata().tolist() == times
        assert curves["T"].get_ydata() == pytest.approx([step.contacts["plate"].tangential_force] * 3)
        assert forces.get_xlabel() == "t"
        with pytest.raises(InputError, match="times"):
            history_figure(history, times=[0.0, 1.0])

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
        problem = lifted()
        limit = limit_load_factor(problem, ["top"])
        figure = limit_figure(problem, limit, title="title")
        (moved,) = [line for line in figure.axes[0].collections if line.get_label() == "mechanism"]
        assert np.array(moved.get_segments()) == pytest.approx(moved_outlines(problem.mesh, limit.mechanism))
        assert heading(figure).get_text().startswith("title. ")
        with pytest.raises(InputError, match="no mechanism"):
            limit_figure(problem, LimitLoad(np.inf, np.inf, None, np.inf, 0.0))

    def test_history_of_results(self):
        """Loops of what moves only; forces of every contact step by step."""
        plate = compressed_plate(0.2, (2, 2))
        *others, contact = plate.conditions
        moved = [replace(plate, conditions=[*others, replace(contact, offset=w)]) for w in (0.0, 1e-4)]
        steps = tuple(map(solve, moved))
        figure = history_figure(History(steps, 2))
        assert self.misplaced(figure) == NOTHING
        loop, forces = figure.axes
        assert loop.get_title() == "plate"
        assert forces.lines[0].get_ydata() == pytest.approx([step.contacts["plate"].normal_force for step in steps])
        assert forces.lines[0].get_xdata().tolist() == [1, 2]


@pytest.mark.parametrize(("suffix", "start"), [(".svg", b"<?xml"), (".pdf", b"%PDF"), (".PNG", b"\x89PNG")])
def test_pictures_are_files_of_the_kind_their_name_says(tmp_path, suffix, start):
    path, known = tmp_path / f"picture{suffix}", dict(mpl.rcParams)
    contents = []
    for _ in range(2 if suffix == ".svg" else 1):
        figure = problem_figure(compressed_plate(0.2, (1, 1)))
        layout = figure.get_layout_engine(), figure.canvas, figure.dpi
        save_figure(path, figure)
        contents.append(path.read_bytes())
        assert (figure.get_layout_engine(), figure.canvas, figure.dpi) == layout  # it can be changed, and saved again
    assert dict(mpl.rcParams) == known
    assert contents[0].startswith(start)
    assert contents[0] == contents[-1]
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_other_kinds_of_pictures_are_refused_with_the_choices(tmp_path):
    with pytest.raises(InputError, match=r"\.png, \.svg, \.pdf"):
        save_figure(tmp_path / "picture.jpeg", Figure())
    assert not list(tmp_path.iterdir())


def lifted():
    """A block pulled off the ground."""
    mesh = TriangleMesh.rectangle((2, 2))
    conditions = [Contact("bottom", friction=0.3), Traction("top", x=0.0, y=1.0)]
    return ContactProblem(mesh, Material(1000.0, 0.3), [*conditions, *FREE])
