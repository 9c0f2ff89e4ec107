"""Pictures show the numbers they are made from."""

import sys

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from qvi_contact import ContactState, InputError, Material, RectilinearMesh, exact, principal_stresses, solve
from qvi_contact.contact import ContactLine
from qvi_contact.gallery import compressed_plate
from qvi_contact.hermite import gauss_legendre
from qvi_contact.plots import contact_tractions, principal_stress_map, require_matplotlib

OPEN, STICK, SLIP = ContactState
MESH = RectilinearMesh([0.0, 0.5, 2.0], [0.0, 1.0, 1.2, 3.0])


def uniform_result(**stress):
    material = Material(1000.0, 0.3)
    sides = {"bottom": "uu", "right": "tt", "top": "tt", "left": "tt"}
    return solve(exact.problem_from_state(exact.uniform(material, **stress), MESH, material, sides))


def crosses(result, largest=None):
    """Returned maximum; segments (n, 2, 2) of compression and tension, told apart by line style alone; the axes."""
    axes = Figure().subplots()
    maximum = principal_stress_map(axes, result, largest)
    drawn = {"solid": [np.zeros((0, 2, 2))], "broken": [np.zeros((0, 2, 2))]}
    for collection in axes.collections:
        assert isinstance(collection, LineCollection)
        segments = [s for s in collection.get_segments() if len(s) == 2]  # outlines of cells have five points
        ((_, dashes),) = collection.get_linestyle()
        if segments:
            drawn["solid" if dashes is None else "broken"].append(np.array(segments))
    return maximum, np.concatenate(drawn["solid"]), np.concatenate(drawn["broken"]), axes


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

    def test_tension_has_round_ends_compression_has_none(self):
        _, _, tension, axes = crosses(uniform_result(xx=10.0, yy=-20.0))
        marked = np.concatenate([np.column_stack(line.get_data()) for line in axes.lines if len(line.get_xdata())])
        assert all(line.get_marker() == "o" for line in axes.lines)
        assert np.sort(marked, axis=0) == pytest.approx(np.sort(tension.reshape(-1, 2), axis=0), abs=1e-12)

    def test_maximum_of_a_state_that_varies(self):
        result = solve(compressed_plate(0.2, (3, 3)))
        maximum, compression, tension, axes = crosses(result)
        values = np.stack(principal_stresses(result.gauss_stress()[2])[:2])
        assert maximum == np.abs(values).max()
        assert maximum == -values.min()  # not the algebraically largest
        assert len(compression) + len(tension) == (np.abs(values) > 1e-3 * maximum).sum()
        assert axes.get_aspect() == 1.0
        assert axes.get_xlim()[0] < 0.0 < 1.0 < axes.get_xlim()[1]


def contact(edges, states, vertical=False):
    """A contact of edges [(start, end), …] with given states of the four points of each, made by hand."""
    t, w = gauss_legendre(4)
    along = np.concatenate([a + (b - a) * t for a, b in edges])
    weights = np.concatenate([(b - a) * w for a, b in edges])
    place = (np.full_like(along, 5.0), along) if vertical else (along, np.full_like(along, 5.0))
    pressure = 1.0 + along
    return ContactLine(
        "contact", *place, weights, np.full_like(along, 0.25), -pressure, -0.2 * pressure, 0 * along, 0 * along,
        np.concatenate([np.array(s) for s in states]),
    )  # fmt: skip


STATES = ([STICK, STICK, SLIP, SLIP], [SLIP, SLIP, OPEN, OPEN], [OPEN, STICK, OPEN, SLIP])
EDGES = ((1.0, 1.5), (1.5, 3.5), (4.0, 4.4))
"""Edges of unequal length; the last apart from the others."""


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
            for label, parts in ranges.items():
                inside = ((parts[:, 0] < place) & (place < parts[:, 1])).sum()
                assert inside == (label == ContactState(state).name.lower())

    def test_the_ranges_fill_the_edges(self, order, vertical):
        _, axes = self.draw(order, vertical)
        parts = np.sort(np.concatenate(list(shaded(axes)[0].values())), axis=0)
        assert len(parts) == 12
        for start, end in EDGES:
            own = parts[(parts[:, 0] > start - 1e-9) & (parts[:, 1] < end + 1e-9)]
            assert own.ravel()[[0, -1]] == pytest.approx([start, end], abs=1e-12)
            assert own[1:, 0] == pytest.approx(own[:-1, 1], abs=1e-12)

    def test_states_look_different_without_colour(self, order, vertical):
        _, axes = self.draw(order, vertical)
        looks = shaded(axes)[1]
        assert len(set(looks.values())) == 3

    def test_curves(self, order, vertical):
        _, axes = self.draw(order, vertical)
        pressure, bound, tangential = axes.lines
        along, values = pressure.get_data()
        assert (np.diff(along) > 0).all()
        assert values == pytest.approx(1.0 + along)
        assert bound.get_ydata() == pytest.approx(0.25 * values)
        assert tangential.get_ydata() == pytest.approx(0.2 * values)
        assert len({(line.get_linestyle(), line.get_marker()) for line in axes.lines}) == 3
        assert axes.get_xlabel() == ("y [length]" if vertical else "x [length]")
        assert axes.get_ylabel() == "traction [MPa]"
        assert axes.get_ylim()[0] == 0.0


def test_without_matplotlib_the_command_to_type_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(InputError, match=r"pip install 'qvi-contact\[plot\]'"):
        require_matplotlib()
