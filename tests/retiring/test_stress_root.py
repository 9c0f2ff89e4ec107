"""Stresses as a square root of the energy: against exact arithmetic, against K, and as a matrix."""

from fractions import Fraction

import numpy as np
import pytest
from scipy import sparse

from qvi_contact import discretize
from qvi_contact.discretization import StressRoot
from qvi_contact.element import Grid, Line
from qvi_contact.gallery import compressed_plate
from qvi_contact.mesh import graded_lines
from solvers.factorisation import factorise_root
from tests.steps import steps

ANISOTROPIC = np.array([[2.0, -0.5, 0.3], [-0.5, 1.0, -0.2], [0.3, -0.2, 3.0]])
L_SHAPE = np.array([[1, 1, 1, 1], [1, 1, 0, 0], [1, 1, 0, 0]], dtype=bool)


def free_root(x, y, active=None, compliance=ANISOTROPIC, seed=None):
    """The root of a mesh without conditions: z are all stored values."""
    active = np.ones((len(y) - 1, len(x) - 1), dtype=bool) if active is None else active
    cells, total = int(active.sum()), 4 * len(x) * len(y)
    potential = np.zeros((cells, 16)) if seed is None else np.random.default_rng(seed).normal(size=(cells, 16))
    compliances = np.broadcast_to(compliance, (cells, 3, 3))
    grid = Grid(Line(np.array(x)), Line(np.array(y)))
    return StressRoot(grid, active, compliances, sparse.eye_array(total, format="csr"), np.zeros(total), potential)


def stored(root, *derivatives):
    """Stored values of a Φ given by functions Φ, Φ_x, Φ_y, Φ_xy."""
    x, y = np.meshgrid(root.grid.x.lines, root.grid.y.lines)
    values = np.stack([np.broadcast_to(function(x, y), x.shape) for function in derivatives], axis=-1)
    return (values * root.grid.dof_scales).ravel()


def wave(root):
    """Stored values of sin(2x + y) + 3."""
    return stored(
        root,
        lambda x, y: np.sin(2 * x + y) + 3.0,
        lambda x, y: 2.0 * np.cos(2 * x + y),
        lambda x, y: np.cos(2 * x + y),
        lambda x, y: -2.0 * np.sin(2 * x + y),
    )


def exact_stress(root, z):
    """√(h_x h_y) σ of each cell in P_j(y) P_i(x), by rational arithmetic; shape (3, 4, 4, ny, nx)."""
    fractions = np.frompyfunc(Fraction, 1, 1)
    ny, nx = root.active.shape
    row, column = np.divmod(np.arange(ny * nx), nx)
    dofs = root.grid.cell_dofs(column, row)
    values = fractions(z)[dofs].reshape(-1, 2, 2, 2, 2).transpose(0, 1, 3, 2, 4).reshape(-1, 4, 4)
    h_x, h_y = fractions(root.grid.x.sizes)[column], fractions(root.grid.y.sizes)[row]
    factors = []
    for h, ends in ((h_x, root.grid.x.end_scales[column]), (h_y, root.grid.y.end_scales[row])):
        slopes = h[:, None] / fractions(ends)
        factors.append(np.stack([0 * slopes + 1, slopes], axis=-1).reshape(-1, 4))
    monomials = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [-3, -2, 3, -1], [2, 1, -2, 1]], dtype=object)  # of t⁰, …, t³
    values = monomials @ (values * factors[1][:, :, None] * factors[0][:, None, :]) @ monomials.T
    derivative = np.diag([1, 2, 3], 1).astype(object)
    moments = np.array([[Fraction(1, i + k + 1) for i in range(4)] for k in range(4)])
    legendre = np.array([[1, 0, 0, 0], [-1, 2, 0, 0], [1, -6, 6, 0], [-1, 12, -30, 20]], dtype=object) @ moments
    powers = [legendre, legendre @ derivative, legendre @ derivative @ derivative]
    shape = (-1, 1, 1)
    parts = [
        powers[2] @ values @ powers[0].T / (h_y**2).reshape(shape),
        powers[0] @ values @ powers[2].T / (h_x**2).reshape(shape),
        -(powers[1] @ values @ powers[1].T) / (h_x * h_y).reshape(shape),
    ]
    norms = np.sqrt(2.0 * np.arange(4) + 1.0)
    coefficients = np.moveaxis(np.stack(parts).astype(float), 1, -1).reshape(3, 4, 4, ny, nx)
    area = root.grid.x.sizes * root.grid.y.sizes[:, None]
    return coefficients * np.multiply.outer(norms, norms)[..., None, None] * np.sqrt(area)


def error(root, z, compliance):
    """|r(z) − exact r(z)|, and |r(z)|, on a mesh of one block."""
    exact = np.einsum("kl,l...->k...", np.linalg.cholesky(compliance).T, exact_stress(root, z))
    expected = np.concatenate([exact[:2].ravel(), exact[2, :3, :3].ravel()])
    return np.linalg.norm(root.apply(z) - expected), np.linalg.norm(expected)


MESHES = {
    "uniform": (np.linspace(0, 1, 13), np.linspace(0, 1, 13), 2e-15),
    "flat cells": (np.linspace(0, 1, 5), np.linspace(0, 0.01, 9), 1e-13),
    "graded": (graded_lines(0.0, 1.0, 14, 0.6), graded_lines(0.0, 1.0, 14, 0.6), 1e-14),
    "very graded": (graded_lines(0.0, 1.0, 24, 0.55), graded_lines(0.0, 1.0, 8, 0.55), 1e-12),
}


@pytest.mark.parametrize(("x", "y", "allowed"), MESHES.values(), ids=MESHES)
def test_stresses_agree_with_exact_arithmetic(x, y, allowed):
    root = free_root(x, y)
    z = wave(root)
    absolute, size = error(root, z, ANISOTROPIC)
    assert absolute < allowed * size
    assert absolute < root.rounding(z)


def test_rounding_bounds_what_rounding_of_the_values_does():
    """On the graded mesh stored values carry more error than their evaluation, and the bound is not far above it."""
    root = free_root(*MESHES["graded"][:2])
    z = wave(root)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=z.size)
    moved = np.linalg.norm(root.apply(z * (1.0 + 2.0**-53 * signs)) - root.apply(z))
    assert moved > 1e3 * error(root, z, ANISOTROPIC)[0]
    assert moved < root.rounding(z) < 20.0 * moved
    assert root.rounding(3.0 * z) == pytest.approx(3.0 * root.rounding(z))


def test_constants_and_affine_functions_have_no_stress_at_all():
    """On lines at multiples of 1/8 all differences are exact, whatever is added to Φ."""
    lines = np.arange(9) / 8.0
    root = free_root(lines, lines)
    affine = stored(root, lambda x, y: 2.0**30 + 3 * x - 5 * y, lambda *_: 3.0, lambda *_: -5.0, lambda *_: 0.0)
    assert not root.apply(affine).any()
    square = stored(root, lambda x, y: x**2 + x * y, lambda x, y: 2 * x + y, lambda x, _: x, lambda *_: 1.0)
    assert np.array_equal(root.apply(square + affine), root.apply(square))


def test_affine_functions_on_a_graded_mesh():
    """Their stress is rounding of differences, h |∇Φ|, not of values: nothing grows with a constant."""
    x, y, _ = MESHES["graded"]
    root = free_root(x, y, compliance=np.eye(3))
    for constant in (0.0, 1e6):
        z = stored(root, lambda *_, c=constant: c, lambda *_: 0.0, lambda *_: 0.0, lambda *_: 0.0)
        assert not root.apply(z).any()
    z = stored(root, lambda x, _: x, lambda *_: 1.0, lambda *_: 0.0, lambda *_: 0.0)
    spread = np.spacing(1.0) * np.abs(1.0 / np.diff(x)).max()
    assert np.linalg.norm(root.apply(z)) < spread


@pytest.mark.parametrize("active", [None, L_SHAPE], ids=["rectangle", "L"])
def test_energy_is_the_square_with_body_forces_of_any_shape(active):
    """|r|² against quadrature of σ c σ with φ that is no polynomial; cells outside the body count for nothing."""
    root = free_root(np.array([0.0, 0.1, 0.5, 0.6, 1.0]), np.array([0.0, 0.3, 0.4, 1.0]), active, seed=3)
    random = np.random.default_rng(4)
    z = random.normal(size=root.particular.shape)
    row, column = np.nonzero(root.active)
    t, w = np.polynomial.legendre.leggauss(4)
    t, w = (t + 1.0) / 2.0, w / 2.0
    tx, ty = np.tile(t, 4), np.repeat(t, 4)
    rows = root.grid.stress_rows(column[:, None], row[:, None], tx, ty)
    stress = np.einsum("cgkd,cd->cgk", rows, z[root.grid.cell_dofs(column, row)])
    stress[..., :2] += root.potential[..., None]
    area = root.grid.x.sizes[column] * root.grid.y.sizes[row]
    energy = np.einsum("c,g,cgk,kl,cgl->", area, np.outer(w, w).ravel(), stress, ANISOTROPIC, stress)
    r = root.apply(z)
    assert r @ r == pytest.approx(energy, rel=1e-12)
    other = random.normal(size=r.shape)
    linear = r - root.apply(np.zeros_like(z))
    assert linear @ other == pytest.approx(z @ root.adjoint(other), abs=1e-12 * np.linalg.norm(linear) * len(r))


def test_blocks_of_rows_make_no_difference(monkeypatch):
    root = free_root(np.linspace(0, 1, 5), graded_lines(0.0, 1.0, 7, 0.9), seed=1)
    z = wave(root)
    whole, gradient = root.apply(z).reshape(41, 7, 4), root.adjoint(root.apply(z))
    monkeypatch.setattr("qvi_contact.discretization.bogner_fox_schmit.energy_root._BLOCK", 8)
    parts = root.apply(z)
    blocks = [part.reshape(41, -1, 4) for part in np.split(parts, 41 * 4 * np.array([2, 4, 6]))]
    assert np.array_equal(np.concatenate(blocks, axis=1), whole)
    assert root.adjoint(parts) == pytest.approx(gradient, abs=1e-14 * np.abs(gradient).max())


def test_factorised_root_has_the_schur_complement_of_k():
    qvi = discretize(compressed_plate(0.2, (8, 6), grading=0.9)).qvi
    R, places = qvi.root.matrix()
    contact = np.flatnonzero(np.asarray(abs(qvi.N).sum(axis=0) + abs(qvi.T).sum(axis=0)).ravel())
    factor = factorise_root(R, contact, places)
    K = qvi.K.toarray()
    inside = np.setdiff1d(np.arange(qvi.n), contact)
    across = np.linalg.solve(K[np.ix_(inside, inside)], K[np.ix_(inside, contact)])
    schur = K[np.ix_(contact, contact)] - K[np.ix_(contact, inside)] @ across
    assert factor.schur == pytest.approx(schur, abs=1e-10 * np.abs(schur).max())


def test_a_gradient_has_no_loop_over_cells():
    """16 384 of them take less than a fiftieth of a second."""

    def gradient(cells):
        root = free_root(np.linspace(0, 1, cells + 1), np.linspace(0, 1, cells + 1))
        z = wave(root)
        return steps(lambda: root.adjoint(root.apply(z)))

    assert gradient(128) < 2 * gradient(8)
