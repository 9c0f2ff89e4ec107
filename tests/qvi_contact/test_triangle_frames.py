"""Affine functions from which Φ counts on triangles: small cells in places far from each other keep their digits."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import Material, TriangleMesh, exact, solve
from qvi_contact.discretization.basis import SharedCorners
from qvi_contact.discretization.hsieh_clough_tocher import frames
from qvi_contact.discretization.hsieh_clough_tocher.basis import TriangleBasis
from qvi_contact.discretization.hsieh_clough_tocher.space import TriangleSpace
from qvi_contact.gallery import compressed_plate
from solvers import Status

CORNERS = [(0.0, 0.0), (1.0, 1.0)]
SIDES = ("bottom", "right", "top", "left")


def graded(points, depth, cells=(2, 2)):
    return TriangleMesh.rectangle(cells).graded(points, depth)


class TestCentres:
    """Where Φ counts from."""

    @pytest.mark.parametrize("mesh", [graded(CORNERS, 0, (8, 8)), graded([(1.0, 1.0)], 30), graded(CORNERS, 6)])
    def test_one_is_enough(self, mesh):
        found = TriangleSpace(mesh, 3).frames
        assert not found.several
        assert not found.across(mesh.cells).any()

    def test_small_cells_have_one_near(self):
        space = TriangleSpace(graded([*CORNERS, (0.5, 0.5)], 20), 3)
        found = space.frames
        away = np.hypot(*(space.vertices - space.vertices[found.owner]).T)
        assert len(found.centres) == 3
        assert (away <= 501.0 * space.sizes).all()
        assert np.array_equal(found.owner[found.centres], found.centres)
        assert 0 < found.across(space.mesh.cells).sum() < 0.2 * len(space.mesh.cells)


def dofs_of(space, values, slopes):
    """Degrees of freedom of a quadratic Φ, of which Legendre coefficients above the lowest are zero."""
    counting, vertices = space.frames, space.vertices
    absolute = np.column_stack([values(*vertices.T), *slopes(*vertices.T)])
    moved = (counting.affine(np.arange(len(vertices))) @ absolute[counting.owner][:, :, None])[:, :, 0]
    counted = absolute - moved * (counting.several & ~counting.is_centre)[:, None]
    u = np.zeros(space.size)
    u[: counted.size] = counted.ravel()
    return u / space.units


def of_a_quadratic(mesh):
    """A basis, its energy with c = 1, and the degrees of freedom of Φ = 3x² − 4xy + y² + 5 + 7x − 9y."""
    basis = TriangleBasis(mesh, 4)
    energy = basis.energy(np.zeros(len(mesh.cells), dtype=int), np.eye(3)[None], None)
    u = dofs_of(
        basis.space,
        lambda x, y: 3 * x**2 - 4 * x * y + y**2 + 5 + 7 * x - 9 * y,
        lambda x, y: (6 * x - 4 * y + 7, 2 * y - 4 * x - 9),
    )
    return basis, energy, u


def stress_of(basis, energy, u):
    every, middle = np.arange(len(basis.mesh.cells)), np.full((1, 3), 1.0 / 3.0)
    return basis.stress(energy.coefficients(u), every, middle)[:, 0]


def test_a_quadratic_has_its_stress_and_its_energy(monkeypatch):
    """σ_xx = 2, σ_yy = 6, σ_xy = 4 with two centres; with one, small cells far from it have six digits."""
    mesh = graded(CORNERS, 14)
    basis, energy, u = of_a_quadratic(mesh)
    normal, shear = basis.tractions(u, mesh.edges("left"), np.array([0.2, 0.7]))
    assert len(basis.space.frames.centres) == 2
    assert stress_of(basis, energy, u) == pytest.approx(np.tile([2.0, 6.0, 4.0], (len(mesh.cells), 1)), abs=1e-9)
    assert normal == pytest.approx(2.0, abs=1e-9)
    assert np.abs(shear) == pytest.approx(4.0, abs=1e-9)
    assert u @ (energy.matrix @ u) == pytest.approx(4.0 + 36.0 + 16.0, rel=1e-9)
    every, corner = np.arange(len(mesh.cells)), np.eye(3)[1:2]
    x, y = mesh.corners[:, 1].T
    airy = 3 * x**2 - 4 * x * y + y**2 + 5 + 7 * x - 9 * y
    assert basis.airy(energy.coefficients(u), every, corner)[:, 0] == pytest.approx(airy, abs=1e-12)
    monkeypatch.setattr(frames, "_FAR", np.inf)
    assert np.abs(stress_of(*of_a_quadratic(mesh)) - [2.0, 6.0, 4.0]).max() > 1e-8


def test_the_root_of_the_energy_is_one():
    """R, Rᵀ and K as they are applied, as matrices, and on triangles across parts."""
    basis, energy, _ = of_a_quadratic(graded(CORNERS, 12))
    elimination = basis.eliminate([], SharedCorners(np.empty(0, dtype=np.int64)))
    root, B = energy.root(elimination), elimination.basis
    R = root.matrix()[0]
    z, r = np.sin(np.arange(R.shape[1])), np.cos(np.arange(R.shape[0] + len(basis.mesh.cells)))
    Rz = root.apply(z)
    assert Rz[: R.shape[0]] == pytest.approx(R @ z, abs=1e-9 * np.abs(Rz).max())
    assert z @ root.adjoint(r) == pytest.approx(r @ Rz, rel=1e-9)
    assert z @ (B.T @ (energy.matrix @ (B @ z))) == pytest.approx(Rz @ Rz, rel=1e-9)
    assert root.rounding(z) <= 1e-12 * np.linalg.norm(Rz)


@pytest.mark.parametrize("degree", [3, 5])
def test_loads_between_two_small_corners_are_met(degree):
    """Uniform stress, prescribed on all sides but one, in cells of 2^-24."""
    steel = Material(1000.0, 0.3)
    state, names = exact.uniform(steel, 3.0, -7.0, 2.0), dict(zip(SIDES, ("uu", "tt", "tt", "tt"), strict=True))
    result = solve(exact.problem_from_state(state, graded([(0.0, 1.0), (1.0, 1.0)], 24), steel, names), degree=degree)
    assert result.status is Status.SOLVED
    assert result.traction_misfit <= 1e-8
    assert result.stress_rounding <= 1e-8
    middles = result.problem.mesh.corners.mean(axis=1)
    assert result.stress(*middles.T) == pytest.approx(np.tile([3.0, -7.0, 2.0], (len(middles), 1)), abs=1e-6)


@pytest.mark.parametrize(
    ("friction", "place", "force"), [(0.2, (0.5, 1.0), 214.2267041), (1.0, (0.0, 0.0), 214.3637996)]
)
def test_a_contact_with_small_edges_in_two_places(friction, place, force):
    """Edges of 2^-17 at the free corner and elsewhere: the force stays, and the certificate passes."""
    problem = compressed_plate(friction, (2, 2)).triangulated()
    result = solve(replace(problem, mesh=problem.mesh.graded([(1.0, 1.0), place], 16)), degree=3, method="condensed")
    assert result.status is Status.SOLVED
    assert result.stress_rounding <= 1e-9 * result.discretization.scales.stress
    assert result.contacts["plate"].normal_force == pytest.approx(force, rel=1e-9)


def test_a_slip_zone_ends_in_an_edge_of_a_millionth():
    """The transition of the plate, in edges of 2^-17 and of 2^-21: the force does not depend on how small they are."""
    problem = compressed_plate(0.2, (2, 2)).triangulated()
    meshes = [problem.mesh.graded([(1.0, 1.0), (0.749, 1.0)], depth) for depth in (16, 20)]
    results = [solve(replace(problem, mesh=mesh), degree=3, method="condensed") for mesh in meshes]
    assert [result.status for result in results] == [Status.SOLVED] * 2
    forces = [result.contacts["plate"].normal_force for result in results]
    assert forces[0] == pytest.approx(forces[1], rel=2e-11)
