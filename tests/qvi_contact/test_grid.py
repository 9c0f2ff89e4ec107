"""Grids of triangles: their lines, diagonals, boundary and names, what they refuse, and those that files refine."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qvi_contact import InputError, TriangleMesh, graded_lines
from qvi_contact.files import problem_from_toml
from tests.cases import refused_at, thinned
from tests.qvi_contact.builders import area

SIDES = ("bottom", "right", "top", "left")
L_CELLS = np.array([[1, 1, 1], [1, 0, 0], [1, 0, 0]], dtype=bool)
T_CELLS = np.array([[0, 1, 0], [0, 1, 0], [1, 1, 1]], dtype=bool)
HOLE_CELLS = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], dtype=bool)


def middles(mesh, name):
    """Midpoints of the edges called so, in ascending order."""
    return sorted(map(tuple, mesh.vertices[mesh.pairs(name)].mean(axis=1).tolist()))


@given(cells=st.integers(1, 40), grading=st.floats(0.5, 2.0), start=st.floats(-1e3, 1e3), length=st.floats(1e-2, 1e3))
def test_graded_lines_form_a_geometric_sequence(cells, grading, start, length):
    lines = graded_lines(start, start + length, cells, grading)
    sizes = np.diff(lines)
    assert (lines[0], lines[-1], len(sizes)) == (start, start + length, cells)
    assert (sizes >= 0).all()
    assert np.abs(sizes[1:] - grading * sizes[:-1]).max(initial=0.0) <= 1e-12 * (abs(start) + length)


@pytest.mark.parametrize(("cells", "grading"), [(1, 2.0), (2, 0.3), (5, 1.0), (8, 0.3)])
def test_lines_graded_towards_both_ends(cells, grading):
    lines = graded_lines(-1.0, 3.0, cells, grading, both_ends=True)
    sizes, middle = np.diff(lines), (cells - 1) // 2
    assert (lines[0], lines[-1], len(sizes)) == (-1.0, 3.0, cells)
    assert sizes == pytest.approx(sizes[::-1], rel=1e-12)
    towards_the_end = sizes[cells - 1 - middle :]
    assert towards_the_end[1:] / towards_the_end[:-1] == pytest.approx(np.full(middle, grading))


def test_a_rectangle_is_the_grid_of_its_lines():
    mesh = TriangleMesh.rectangle((3, 2), 3.0, 1.0, origin=(1.0, -1.0), grading=(0.5, 2.0))
    grid = TriangleMesh.grid(graded_lines(1.0, 4.0, 3, 0.5), graded_lines(-1.0, 0.0, 2, 2.0))
    assert mesh.same_as(grid)
    assert (mesh.cell_count, mesh.edge_names) == (12, SIDES)
    assert area(mesh) == pytest.approx(3.0)


def test_all_edges_that_face_one_way_have_its_name():
    mesh = TriangleMesh.grid([0, 1, 2, 3], [0, 1, 2, 3], L_CELLS)
    assert middles(mesh, "top") == [(0.5, 3.0), (1.5, 1.0), (2.5, 1.0)]
    assert middles(mesh, "right") == [(1.0, 1.5), (1.0, 2.5), (3.0, 0.5)]
    assert sum(len(mesh.edge_set(side)) for side in SIDES) == len(mesh.boundary) == 12
    assert (len(mesh.vertices), area(mesh)) == (12, pytest.approx(5.0))


@given(st.integers(1, 5), st.integers(1, 5), st.randoms(use_true_random=False))
def test_triangles_lie_in_their_cells_and_fill_corners_in_pairs(nx, ny, random):
    """2k and 2k + 1 lie in the cell k of the body; no triangle has two edges on the boundary if its cell has two."""
    active = np.array([[random.random() < 0.85 for _ in range(nx)] for _ in range(ny)])
    x, y = np.arange(nx + 1.0), 2.0 * np.arange(ny + 1.0)
    try:
        mesh = TriangleMesh.grid(x, y, active)
    except InputError:
        return  # not one piece
    row, column = np.nonzero(active)
    centres = mesh.corners.mean(axis=1)
    assert (np.floor(centres[:, 0]) == np.repeat(column, 2)).all()
    assert (np.floor(centres[:, 1] / 2.0) == np.repeat(row, 2)).all()
    pairs = mesh.topology.boundary[mesh.topology.of_cells].sum(axis=1).reshape(-1, 2)
    assert (pairs.max(axis=1)[pairs.sum(axis=1) == 2] == 1).all() or (nx == 1 or ny == 1)


@pytest.mark.parametrize(("cells", "grading"), [((2, 2), 1.0), ((4, 6), (0.5, 0.7)), ((6, 4), 1.0)])
def test_a_symmetric_grid_has_symmetric_triangles(cells, grading):
    def corners(mesh, turned=(1.0, 1.0)):
        found = np.round((mesh.corners - mesh.vertices.mean(axis=0)) * turned, 9) + 0.0
        return {tuple(sorted(map(tuple, each))) for each in found.tolist()}

    halves = zip((1.0, 1.5), cells, np.broadcast_to(grading, 2), strict=True)
    x, y = (graded_lines(-size, size, count, ratio, both_ends=True) for size, count, ratio in halves)
    for place in (0.0, 0.1, -1e3 / 3.0):
        mesh = TriangleMesh.grid(x + place, y - place)
        assert corners(mesh, (-1.0, 1.0)) == corners(mesh) == corners(mesh, (1.0, -1.0))


@pytest.mark.parametrize("cells", [(2, 2), (4, 2), (2, 8)])
def test_halved_cells_lie_inside_triangles(cells):
    coarse, fine = (TriangleMesh.rectangle((k * cells[0], k * cells[1]), 2.0, 3.0) for k in (1, 2))
    _, cell = coarse.around(fine.corners.mean(axis=1))
    assert len(cell) == len(fine.cells)
    for corner in np.moveaxis(fine.corners, 1, 0):
        place = coarse.reference(cell, corner)
        assert min(place.min(), 1.0 - place.sum(axis=1).max()) > -1e-12


def test_parts_are_named_by_segments_functions_and_ranges():
    mesh = TriangleMesh.grid(
        [0, 1, 2, 3],
        [0, 1, 2, 3],
        edges={"foot": ((1, 0), (3, 0)), "lid": lambda x, y: (y == 3.0) & (x < 2.0)},
        joints={"seam": ((0, 1), (2, 1)), "crack": lambda x, _: x == 2.0},
        regions={"core": ((1, 2), (1, 2)), "low": (None, (0, 1))},
    )
    assert (mesh.edge_names, mesh.joint_names) == ((*SIDES, "foot", "lid"), ("seam", "crack"))
    assert middles(mesh, "foot") == [(1.5, 0.0), (2.5, 0.0)]
    assert middles(mesh, "lid") == [(0.5, 3.0), (1.5, 3.0)]
    assert middles(mesh, "seam") == [(0.5, 1.0), (1.5, 1.0)]
    assert middles(mesh, "crack") == [(2.0, 0.5), (2.0, 1.5), (2.0, 2.5)]
    assert (mesh.region("core").tolist(), mesh.region("low").tolist()) == ([8, 9], [0, 1, 2, 3, 4, 5])


@pytest.mark.parametrize(
    ("parts", "word"),
    [({"edges": {"foot": ((0, 0), (1.2, 0))}}, r"nearest one is \(1, 0\)"),
     ({"edges": {"foot": ((0, 1), (2, 1))}}, "no edge of the boundary"),
     ({"joints": {"seam": ((0, 0), (2, 0))}}, "no edge inside the body"),
     ({"joints": {"seam": lambda x, _: x > 5.0}}, "no interior edge"),
     ({"edges": {"top": ((0, 0), (1, 0))}}, "exists already"), ({"edges": {"": ((0, 0), (1, 0))}}, "non-empty"),
     ({"edges": {"foot": "bottom"}}, "pair of points"), ({"edges": [((0, 0), (1, 0))]}, "mapping"),
     ({"regions": {"core": ((5, 6), None)}}, "no triangle"),
     *(({"regions": {"core": ranges}}, "cuts the triangle")
       for ranges in (((0.3, 2), None), ((0, 0.3), None), ((0, 1.5), (0, 1)), ((0.9, 2), (1, 2)))),
     ({"regions": {"core": ((1, 0), None)}}, "smaller end"), ({"regions": {"core": 3}}, "pair of ranges")],
)  # fmt: skip
def test_parts_that_fit_no_line_are_refused(parts, word):
    with pytest.raises(InputError, match=word):
        TriangleMesh.grid([0, 1, 2], [0, 1, 2], **parts)


@pytest.mark.parametrize(
    ("x", "y", "active", "field"),
    [([0, 1, 1], [0, 1], None, "x"), ([0, 2, 1], [0, 1], None, "x"), ([0, 1], [0], None, "y"),
     ([0, np.nan], [0, 1], None, "x"), ([0, 1], ["a", "b"], None, "y"), ([0, 1], [0, 1e308], None, "y"),
     ([1e6, 1e6 + 1e-8, 2e6], [0, 1], None, "x"),
     ([0, 1, 2], [0, 1], np.ones((2, 1), dtype=bool), "active"), ([0, 1, 2], [0, 1], np.ones((1, 2)), "active"),
     ([0, 1, 2], [0, 1], [[True], [True, False]], "active"),
     ([0, 1, 2], [0, 1], np.zeros((1, 2), dtype=bool), "active"),
     ([0, 1, 2, 3], [0, 1], np.array([[1, 0, 1]], dtype=bool), "TriangleMesh"),
     ([0, 1, 2], [0, 1, 2], np.array([[1, 0], [0, 1]], dtype=bool), "TriangleMesh"),
     ([0, 1, 2, 3], [0, 1, 2, 3], np.array([[1, 1, 1], [1, 0, 1], [1, 1, 0]], dtype=bool), "TriangleMesh")],
)  # fmt: skip
def test_what_is_no_grid_is_refused(x, y, active, field):
    with refused_at(field):
        TriangleMesh.grid(x, y, active)


@pytest.mark.parametrize("factor", [1.0, 1e-3, 1e6])
def test_long_cells_are_cut_along_their_length(factor):
    strip = TriangleMesh.rectangle((1, 1), 1000.0 * factor, factor)
    assert strip.cell_count == 4
    layer = TriangleMesh.grid(
        factor * np.linspace(0.0, 1.0, 5),
        factor * np.array([0.0, 0.5, 0.5002, 1.0]),
        joints={"seam": ((0.0, 0.5 * factor), (factor, 0.5 * factor))},
    )
    assert layer.cell_count == 2 * 3 * 12
    assert len(layer.joint_set("seam")) == 12
    column = TriangleMesh.grid([0.0, factor], [0.0, 501.0 * factor, 1000.0 * factor])
    assert len(column.edge_set("left")) == 3
    for mesh in (strip, layer, column):
        sides = np.linalg.norm(mesh.corners - np.roll(mesh.corners, 1, axis=1), axis=2)
        assert (sides[:, :, None] / sides[:, None]).max() < 501.0


def test_cells_long_both_ways_are_refused_with_the_remedy():
    with pytest.raises(InputError, match="give at most 500") as caught:
        TriangleMesh.rectangle((20, 20), grading=0.3)
    assert caught.value.value > 500.0


BODIES = {
    "rectangle": ([0.0, 1.0, 3.0], [0.0, 1.0], None),
    "L": ([0.0, 1.0, 2.0, 3.0], [0.0, 0.7, 2.0, 3.0], L_CELLS),
    "T": ([0.0, 1.0, 2.0, 3.0], [-1.0, 0.0, 1.0, 2.0], T_CELLS),
    "hole": ([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 2.0, 3.0], HOLE_CELLS),
}
OPTIONS = {
    "uniform": {"largest": 0.3},
    "graded": {"largest": 0.5, "smallest": 0.02},
    "towards": {"largest": 0.5, "smallest": 0.05, "ratio": 0.8, "towards": ["bottom"]},
    "steep": {"largest": 1.0, "smallest": 1e-4, "ratio": 0.3, "towards": ["bottom", "top"]},
    "coarse": {"largest": 100.0},
}


def refined(body, options):
    """The mesh of a problem file with [mesh.refine]."""
    x, y, active = BODIES[body]
    cut = [] if active is None else np.argwhere(~active).tolist()
    remove = ", ".join(f"{{ x = [{x[i]}, {x[i + 1]}], y = [{y[j]}, {y[j + 1]}] }}" for j, i in cut)
    told = "\n".join(f"{key} = {value}" for key, value in options.items()).replace("'", '"')
    free = "".join(f'[[tractions]]\nedges = "{side}"\nx = 0.0\ny = 0.0\n' for side in SIDES)
    text = f"version = 1\n[mesh]\nx = {x}\ny = {y}\nremove = [{remove}]\n[mesh.refine]\n{told}\n"
    return problem_from_toml(f"{text}[material]\nyoung = 1.0\npoisson = 0.3\n{free}").problem.mesh


def critical(body, towards):
    """Coordinates of re-entrant corners and of the ends of sides, found once more cell by cell."""
    x, y, active = BODIES[body]
    mesh = TriangleMesh.grid(x, y, active)
    padded = np.pad(np.ones((len(y) - 1, len(x) - 1), dtype=bool) if active is None else active, 1)
    nodes = product(range(len(x)), range(len(y)))
    found = [(x[i], y[j]) for i, j in nodes if padded[j : j + 2, i : i + 2].sum() == 3]
    for name in towards:
        ends = mesh.pairs(name).ravel().tolist()
        found += [tuple(mesh.vertices[end].tolist()) for end in ends if ends.count(end) == 1]
    return [np.unique([place[axis] for place in found]) for axis in (0, 1)]


@pytest.mark.parametrize(("body", "sizes"), thinned(product(BODIES, OPTIONS), 6))
def test_files_refine_grids_by_the_formula(body, sizes):
    """Old lines stay; a cell is at most as large as the formula says at its larger end, and not needlessly small."""
    options = OPTIONS[sizes]
    fine, (x, y, active) = refined(body, options), BODIES[body]
    coarse = TriangleMesh.grid(x, y, active)
    assert area(fine) == pytest.approx(area(coarse))
    for side in SIDES:
        lengths = [mesh.edges(side).length for mesh in (coarse, fine)]
        assert lengths[0].sum() == pytest.approx(lengths[1].sum())
    smallest, ratio = options.get("smallest", options["largest"]), options.get("ratio", 0.5)
    for axis, corners in enumerate(critical(body, options.get("towards", ()))):
        old, new = np.array((x, y)[axis]), np.unique(fine.vertices[:, axis])
        assert set(old) <= set(new)
        inside = new[:-1, None] + np.diff(new)[:, None] * np.linspace(0.0, 1.0, 21)
        distance = np.abs(inside[..., None] - corners).min(axis=-1, initial=np.inf)
        most = np.minimum(options["largest"], smallest + (1.0 / ratio - 1.0) * distance).max(axis=1)
        least = np.minimum(options["largest"], smallest + np.log(1.0 / ratio) * distance).min(axis=1)
        intervals = np.diff(old)[np.searchsorted(old, new[:-1], "right") - 1]
        cells = np.diff(new)
        assert (cells <= most * (1.0 + 5e-3)).all()
        if sizes != "steep":  # whose long cells are cut
            assert (cells >= 0.49 * np.minimum(least, intervals)).all()  # intervals are rounded up to whole cells


@pytest.mark.parametrize(
    ("options", "word"),
    [({"largest": 0.0}, "largest"),
     ({"largest": 0.1, "smallest": 0.2}, "at most largest"), ({"largest": 0.1, "smallest": -1.0}, "smallest"),
     ({"largest": 0.1, "smallest": 1e-12}, "of the body"), ({"largest": 0.1, "ratio": 1.0}, "ratio"),
     ({"largest": 0.1, "towards": ["nowhere"]}, "nowhere"), ({"largest": 1e-9}, "largest"),
         ({"largest": 1e-310}, "largest"), ({"largest": 0.1, "smallest": 1e-310}, "of the body")],
)  # fmt: skip
def test_sizes_that_cannot_be_are_refused(options, word):
    with pytest.raises(InputError, match=word):
        refined("L", options)
