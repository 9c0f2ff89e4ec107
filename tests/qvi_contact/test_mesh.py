"""Meshes, their boundary, and what they refuse."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qvi_contact import InputError, RectilinearMesh, graded_lines

L_SHAPE = RectilinearMesh([0, 1, 2, 3], [0, 1, 2], np.array([[1, 1, 1], [1, 0, 0]], dtype=bool))


@given(
    cells=st.integers(1, 40),
    grading=st.floats(0.5, 2.0),
    start=st.floats(-1e3, 1e3),
    length=st.floats(1e-2, 1e3),
)
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
    with pytest.raises(InputError, match=r"nearest one is at 1$"):
        mesh.with_edges("x", "bottom", start=1.1)
    with pytest.raises(InputError, match="exists already"):
        mesh.with_edges("step", "bottom")
    with pytest.raises(InputError, match="no boundary edge"):
        mesh.with_edges("nowhere", "left", start=0.0, stop=1.0, at=1.0)
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
    ],
)
def test_bad_meshes_are_refused(x, y, active, field):
    with pytest.raises(InputError) as caught:
        RectilinearMesh(x, y, active)
    assert caught.value.field == field
    assert "\n" not in str(caught.value)


def test_cells_that_meet_in_a_corner_only_are_refused():
    ring = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 0]], dtype=bool)
    with pytest.raises(InputError, match="meet only in the corner"):
        RectilinearMesh([0, 1, 2, 3], [0, 1, 2, 3], ring)


@pytest.mark.parametrize("cells", [0, -1, 1.5, True, "3"])
def test_bad_cell_counts_are_refused(cells):
    with pytest.raises(InputError, match="cells"):
        graded_lines(0.0, 1.0, cells)
