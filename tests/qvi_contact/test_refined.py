"""Refined grids: what they keep, and that sizes obey the formula."""

from itertools import pairwise

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    InputError,
    Material,
    RectilinearMesh,
    Symmetry,
    Traction,
    graded_lines,
    solve,
)
from solvers import Status

L = np.array([[1, 1, 1], [1, 0, 0], [1, 0, 0]], dtype=bool)
T = np.array([[0, 1, 0], [0, 1, 0], [1, 1, 1]], dtype=bool)
HOLE = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], dtype=bool)
BODIES = {
    "rectangle": RectilinearMesh([0.0, 1.0, 3.0], [0.0, 1.0]),
    "L": RectilinearMesh([0.0, 1.0, 2.0, 3.0], [0.0, 0.7, 2.0, 3.0], L).with_edges("step", "top", at=0.7),
    "T": RectilinearMesh([0.0, 1.0, 2.0, 3.0], [-1.0, 0.0, 1.0, 2.0], T),
    "hole": RectilinearMesh([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 2.0, 3.0], HOLE).with_edges("roof", "top", at=3.0),
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


@pytest.mark.parametrize("mesh", BODIES.values(), ids=BODIES)
@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
class TestRefined:
    """Whatever the body and the sizes."""

    def test_keeps_lines_mask_and_edge_sets(self, mesh, options):
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

    def test_sizes_obey_the_formula(self, mesh, options):
        """Every cell is at most as large as the formula says at its larger end, and not needlessly small."""
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

    def test_uniform_without_grading(self, mesh, options):
        if "smallest" in options:
            pytest.skip("graded")
        fine = mesh.refined(**options)
        for old, new in ((mesh.x, fine.x), (mesh.y, fine.y)):
            for start, stop in pairwise(old):
                cells = np.diff(new[(new >= start) & (new <= stop)])
                assert cells == pytest.approx((stop - start) / np.ceil((stop - start) / options["largest"] - 1e-3))


@pytest.mark.parametrize("mesh", [BODIES["T"], BODIES["hole"]])
@pytest.mark.parametrize("ratio", [0.3, 0.5, 0.9])
def test_symmetric_bodies_get_symmetric_lines(mesh, ratio):
    lines = mesh.refined(0.4, ("bottom",), 0.01, ratio).x
    assert lines == pytest.approx(3.0 - lines[::-1], abs=1e-5)


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


def test_refined_problem_comes_closer_to_the_fine_one():
    """An L pressed on rough ground: energy of refined grids falls towards that of a uniform fine one."""
    body = BODIES["L"]

    def strain(mesh):
        free = [Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0), Traction("step", 0.0, 0.0)]
        mesh = mesh.with_edges("roof", "top", at=3.0)
        conditions = [Contact("bottom", 0.3), *free, Contact("roof", 0.0, gap=-1e-3)]
        result = solve(ContactProblem(mesh, Material(1000.0, 0.3), conditions))
        assert result.status is Status.SOLVED
        return result.energies.complementary

    fine, graded, coarse = (strain(body.refined(*sizes)) for sizes in ((0.2,), (0.5, ("bottom",), 0.05), (0.5,)))
    assert abs(graded - fine) < 0.5 * abs(coarse - fine)


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


@pytest.mark.parametrize("cells", [1, 2, 5, 8])
@pytest.mark.parametrize("grading", [0.3, 1.0, 2.0])
def test_lines_graded_towards_both_ends(cells, grading):
    lines = graded_lines(-1.0, 3.0, cells, grading, both_ends=True)
    sizes = np.diff(lines)
    assert (lines[0], lines[-1], len(sizes)) == (-1.0, 3.0, cells)
    assert sizes == pytest.approx(sizes[::-1], rel=1e-12)
    middle = (cells - 1) // 2
    towards_the_end = sizes[cells - 1 - middle :]
    assert towards_the_end[1:] / towards_the_end[:-1] == pytest.approx(np.full(middle, grading))


def test_lines_graded_towards_one_end():
    sizes = np.diff(graded_lines(0.0, 1.0, 6, 0.5))
    assert sizes[1:] / sizes[:-1] == pytest.approx(np.full(5, 0.5))


def test_symmetric_grading_keeps_symmetric_solutions():
    lines = graded_lines(-1.0, 1.0, 6, 0.6, both_ends=True)
    conditions = [
        Symmetry("bottom"),
        Traction("left", 0.0, 0.0),
        Traction("right", 0.0, 0.0),
        Contact("top", 0.3, gap=-1e-3, name="plate"),
    ]
    mesh = RectilinearMesh(lines, [0.0, 0.5, 1.0])
    problem = ContactProblem(mesh, Material(1000.0, 0.3), conditions)
    line = solve(problem, tolerance=1e-9, element="bfs").contacts["plate"]  # triangles are not symmetric
    assert line.normal_stress == pytest.approx(line.normal_stress[::-1], abs=1e-7)
    assert line.tangential_stress == pytest.approx(-line.tangential_stress[::-1], abs=1e-7)
