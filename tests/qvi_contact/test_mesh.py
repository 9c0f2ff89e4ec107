"""Grids: their lines, boundary and names, what they refuse, and that refined ones obey the formula of sizes."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qvi_contact import InputError, RectilinearMesh, graded_lines
from tests.effort import thinned

L_SHAPE = RectilinearMesh([0, 1, 2, 3], [0, 1, 2], np.array([[1, 1, 1], [1, 0, 0]], dtype=bool))


@given(cells=st.integers(1, 40), grading=st.floats(0.5, 2.0), start=st.floats(-1e3, 1e3), length=st.floats(1e-2, 1e3))
def test_graded_lines_form_a_geometric_sequence(cells, grading, start, length):
    lines = graded_lines(start, start + length, cells, grading)
    sizes = np.diff(lines)
    assert lines[0] == start
    assert lines[-1] == start + length
    assert len(sizes) == cells
    assert (sizes >= 0).all()
    resolution = 1e-13 * (abs(start) + length)
    assert np.abs(sizes[1:] - grading * sizes[:-1]).max(initial=0.0) <= 10 * resolution


def test_boundary_of_a_rectangle():
    mesh = RectilinearMesh.rectangle((3, 2))
    assert len(mesh.boundary) == 10
    assert [len(mesh.edge_set(side)) for side in ("bottom", "right", "top", "left")] == [3, 2, 3, 2]
    ends = mesh.coordinates[mesh.boundary.second] - mesh.coordinates[mesh.boundary.first]
    assert (ends.sum(axis=1) > 0).all()
    assert (mesh.boundary_midpoints[mesh.edge_set("top"), 1] == 1.0).all()
    assert (mesh.boundary_midpoints[mesh.edge_set("left"), 0] == 0.0).all()


def test_boundary_of_an_l_shape():
    assert len(L_SHAPE.boundary) == 10
    top = L_SHAPE.boundary_midpoints[L_SHAPE.edge_set("top")]
    assert sorted(map(tuple, top)) == [(0.5, 2.0), (1.5, 1.0), (2.5, 1.0)]
    assert L_SHAPE.active_nodes.sum() == 10
    outward = np.where(L_SHAPE.boundary.axis == 0, 0, L_SHAPE.boundary.sign)
    assert outward.sum() == 0


def test_named_edge_sets():
    mesh = L_SHAPE.with_edges("step", "top", at=1.0).with_edges("far", "bottom", start=1.0, stop=3.0)
    assert len(mesh.edge_set("step")) == 2
    assert len(mesh.edge_set("far")) == 2
    for word, arguments in {
        "nearest one is at 1$": ("x", "bottom", 1.1),
        "exists already": ("step", "bottom"),
        "no boundary edge": ("nowhere", "left", 0.0, 1.0, 1.0),
    }.items():
        with pytest.raises(InputError, match=word):
            mesh.with_edges(*arguments)
    with pytest.raises(InputError, match=r"bottom, right, top, left, step, far"):
        mesh.edge_set("plate")


@pytest.mark.parametrize(
    ("x", "y", "active", "field"),
    [
        ([0, 1, 1], [0, 1], None, "RectilinearMesh.x"),
        ([0, 2, 1], [0, 1], None, "RectilinearMesh.x"),
        ([0, 1], [0], None, "RectilinearMesh.y"),
        ([0, np.nan], [0, 1], None, "RectilinearMesh.x"),
        ([0, 1], ["a", "b"], None, "RectilinearMesh.y"),
        ([1e6, 1e6 + 1e-8, 2e6], [0, 1], None, "RectilinearMesh.x"),
        ([0, 1, 2], [0, 1], np.ones((2, 1), dtype=bool), "RectilinearMesh.active"),
        ([0, 1, 2], [0, 1], np.ones((1, 2)), "RectilinearMesh.active"),
        ([0, 1, 2], [0, 1], np.zeros((1, 2), dtype=bool), "RectilinearMesh.active"),
        ([0, 1, 2, 3], [0, 1], np.array([[1, 0, 1]], dtype=bool), "RectilinearMesh.active"),
        ([0, 1, 2], [0, 1, 2], np.array([[1, 0], [0, 1]], dtype=bool), "RectilinearMesh.active"),
        ([0, 1, 2, 3], [0, 1, 2, 3], np.array([[1, 1, 1], [1, 0, 1], [1, 1, 0]], dtype=bool), "RectilinearMesh.active"),
    ],
)
def test_bad_meshes_are_refused(x, y, active, field):
    with pytest.raises(InputError) as caught:
        RectilinearMesh(x, y, active)
    assert caught.value.field == field
    assert "\n" not in str(caught.value)


L_CELLS = np.array([[1, 1, 1], [1, 0, 0], [1, 0, 0]], dtype=bool)


T_CELLS = np.array([[0, 1, 0], [0, 1, 0], [1, 1, 1]], dtype=bool)


HOLE_CELLS = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], dtype=bool)


BODIES = {
    "rectangle": RectilinearMesh([0.0, 1.0, 3.0], [0.0, 1.0]),
    "L": RectilinearMesh([0.0, 1.0, 2.0, 3.0], [0.0, 0.7, 2.0, 3.0], L_CELLS).with_edges("step", "top", at=0.7),
    "T": RectilinearMesh([0.0, 1.0, 2.0, 3.0], [-1.0, 0.0, 1.0, 2.0], T_CELLS),
    "hole": RectilinearMesh([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 2.0, 3.0], HOLE_CELLS).with_edges("roof", "top", at=3.0),
    "joints": RectilinearMesh([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 2.0]).with_joint("joint", "horizontal", 1.0, 1.0, 2.0),
}


OPTIONS = {
    "uniform": {"largest": 0.3},
    "graded": {"largest": 0.5, "smallest": 0.02},
    "towards": {"largest": 0.5, "smallest": 0.05, "ratio": 0.8, "towards": ("bottom",)},
    "steep": {"largest": 1.0, "smallest": 1e-4, "ratio": 0.3, "towards": ("bottom", "top")},
    "coarse": {"largest": 100.0},
}


def critical(mesh, towards):
    """Coordinates of re-entrant corners and of the ends of edge sets, found once more cell by cell."""
    nodes = {(i, j) for j in range(len(mesh.y)) for i in range(len(mesh.x))}
    padded = np.pad(mesh.active, 1)
    found = {(i, j) for i, j in nodes if padded[j : j + 2, i : i + 2].sum() == 3}
    stride = len(mesh.x)
    for name in towards:
        edges = mesh.edges(name)
        ends = edges.first.tolist() + edges.second.tolist()
        found |= {(node % stride, node // stride) for node in ends if ends.count(node) == 1}
    return np.unique([mesh.x[i] for i, _ in found]), np.unique([mesh.y[j] for _, j in found])


@pytest.mark.parametrize(("body", "sizes"), thinned(product(BODIES, OPTIONS), 12))
class TestRefined:
    """Whatever the body and the sizes."""

    def test_keeps_lines_mask_and_edge_sets(self, body, sizes):
        mesh, options = BODIES[body], OPTIONS[sizes]
        fine = mesh.refined(**options)
        assert set(mesh.x) <= set(fine.x)
        assert set(mesh.y) <= set(fine.y)
        assert fine.named == mesh.named
        centre_x, centre_y = (fine.x[1:] + fine.x[:-1]) / 2.0, (fine.y[1:] + fine.y[:-1]) / 2.0
        columns, rows = np.searchsorted(mesh.x, centre_x) - 1, np.searchsorted(mesh.y, centre_y) - 1
        assert (fine.active == mesh.active[np.ix_(rows, columns)]).all()
        for name in (*mesh.edge_names, *mesh.joint_names):
            coarse, refined = mesh.edges(name), fine.edges(name)
            assert self.lengths(mesh, coarse) == pytest.approx(self.lengths(fine, refined))

    @staticmethod
    def lengths(mesh, edges):
        """Total length, and first moments, of a set of edges."""
        first, second = mesh.coordinates[edges.first], mesh.coordinates[edges.second]
        length = np.linalg.norm(second - first, axis=1)
        return np.array([length.sum(), *(length @ (first + second) / 2.0)])

    def test_sizes_obey_the_formula(self, body, sizes):
        """Every cell is at most as large as the formula says at its larger end, and not needlessly small."""
        mesh, options = BODIES[body], OPTIONS[sizes]
        fine = mesh.refined(**options)
        smallest, ratio = options.get("smallest", options["largest"]), options.get("ratio", 0.5)
        for old, new, corners in zip(
            (mesh.x, mesh.y), (fine.x, fine.y), critical(mesh, options.get("towards", ())), strict=True
        ):
            inside = new[:-1, None] + np.diff(new)[:, None] * np.linspace(0.0, 1.0, 21)
            distance = np.abs(inside[..., None] - corners).min(axis=-1, initial=np.inf)
            most = np.minimum(options["largest"], smallest + (1.0 / ratio - 1.0) * distance).max(axis=1)
            least = np.minimum(options["largest"], smallest + np.log(1.0 / ratio) * distance).min(axis=1)
            intervals = np.diff(old)[np.searchsorted(old, new[:-1], "right") - 1]
            cells = np.diff(new)
            assert (cells <= most * (1.0 + 5e-3)).all()
            assert (cells >= 0.49 * np.minimum(least, intervals)).all()  # intervals are rounded up to whole cells


@pytest.mark.parametrize("ratio", [0.3, 0.5, 0.8])
def test_neighbours_differ_by_the_ratio(ratio):
    lines = RectilinearMesh([0.0, 1.0], [0.0, 1.0]).refined(1.0, ("bottom",), 1e-4, ratio).x
    left = np.diff(lines[lines < 0.45])
    assert 0.5e-4 < left[0] < 2e-4
    assert left[:-1] / left[1:] == pytest.approx(ratio, abs=0.08)


def test_ends_of_joints_attract():
    fine = BODIES["joints"].refined(0.5, ("joint",), 0.01)
    at = np.searchsorted(fine.x, [1.0, 2.0])
    assert np.diff(fine.x)[[*at, *(at - 1)]].max() < 0.025
    assert np.diff(fine.x).max() > 0.2


def test_refining_twice_keeps_what_is_fine_enough():
    once = BODIES["L"].refined(0.3)
    assert once.refined(0.3).x == pytest.approx(once.x)
    assert once.refined(1.0).x == pytest.approx(once.x)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"largest": 0.0}, "largest"),
        ({"largest": 0.1, "smallest": 0.2}, "at most largest"),
        ({"largest": 0.1, "smallest": -1.0}, "smallest"),
        ({"largest": 0.1, "ratio": 1.0}, "between 0.01 and 0.99"),
        ({"largest": 0.1, "ratio": 0.0}, "ratio"),
        ({"largest": 0.1, "towards": ("nowhere",)}, "nowhere"),
        ({"largest": float("nan")}, "largest"),
    ],
)
def test_bad_sizes_are_refused(options, word):
    with pytest.raises(InputError, match=word):
        BODIES["L"].refined(**options)


@pytest.mark.parametrize(("cells", "grading"), [(1, 2.0), (2, 0.3), (5, 1.0), (8, 0.3)])
def test_lines_graded_towards_both_ends(cells, grading):
    lines = graded_lines(-1.0, 3.0, cells, grading, both_ends=True)
    sizes = np.diff(lines)
    assert (lines[0], lines[-1], len(sizes)) == (-1.0, 3.0, cells)
    assert sizes == pytest.approx(sizes[::-1], rel=1e-12)
    middle = (cells - 1) // 2
    towards_the_end = sizes[cells - 1 - middle :]
    assert towards_the_end[1:] / towards_the_end[:-1] == pytest.approx(np.full(middle, grading))
