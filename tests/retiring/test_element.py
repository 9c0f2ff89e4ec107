"""The element's functions, matrices and traces against polynomials, symbols and quadrature."""

import numpy as np
import pytest
import sympy
from numpy.polynomial import Polynomial

from qvi_contact import Material, RectilinearMesh
from qvi_contact.discretization import BognerFoxSchmit, EdgePoints, energy_matrix
from qvi_contact.element import Grid, gauss_legendre, hermite, scaled_hermite

GRADED = RectilinearMesh([3.0, 3.5, 3.6, 5.0], [-1.0, 0.0, 0.2])
COMPLIANCE = np.array([[1.0, -0.3, 0.1], [-0.3, 1.2, -0.2], [0.1, -0.2, 2.6]])  # every coupling present


def dofs_of(mesh, phi):
    """Scaled nodal values of a SymPy expression in the dimensionless coordinates x, y."""
    x, y = sympy.symbols("x y")
    grid = Grid.of(mesh)
    at = np.meshgrid(grid.x.lines, grid.y.lines)
    parts = [phi, sympy.diff(phi, x), sympy.diff(phi, y), sympy.diff(phi, x, y)]
    values = [np.broadcast_to(sympy.lambdify((x, y), part)(*at), at[0].shape) for part in parts]
    return np.stack(values, axis=-1) * grid.dof_scales


@pytest.mark.parametrize("derivative", range(4))
def test_hermite_functions_reproduce_cubics(derivative):
    t = np.linspace(0.0, 1.0, 7)
    for power in range(4):
        cubic = Polynomial.basis(power)
        ends = np.array([[cubic(end), cubic.deriv()(end)] for end in (0.0, 1.0)])
        expected = cubic.deriv(derivative)(t) if derivative else cubic(t)
        assert np.einsum("tap,ap->t", hermite(t, derivative), ends) == pytest.approx(expected, abs=1e-13)


def test_scaled_hermite_has_the_units_of_its_interval():
    t, h, scale = np.linspace(0, 1, 5), np.array(0.25), np.array([0.1, 0.7])
    ends = np.array([[2.0**3, 3 * 2.0**2 * 0.1], [2.25**3, 3 * 2.25**2 * 0.7]])  # x³ on [2, 2.25]
    for derivative, expected in enumerate([(2 + h * t) ** 3, 3 * (2 + h * t) ** 2, 6 * (2 + h * t)]):
        found = np.einsum("tap,ap->t", scaled_hermite(t, h, scale, derivative), ends)
        assert found == pytest.approx(expected, rel=1e-12)


def test_gauss_points_are_exact_to_degree_seven():
    t, w = gauss_legendre(4)
    assert [w @ t**k for k in range(8)] == pytest.approx([1 / (k + 1) for k in range(8)], rel=1e-14)
    assert abs(w @ t**8 - 1 / 9) > 1e-6


@pytest.mark.parametrize("powers", [(i, j) for i in range(4) for j in range(4)])
def test_energy_of_every_bicubic_monomial(powers):
    x, y = sympy.symbols("x y")
    phi, other = x ** powers[0] * y ** powers[1], (1 + x) ** 3 * (y - sympy.Rational(1, 3)) ** 2
    grid = Grid.of(GRADED)
    matrix = energy_matrix(grid, [(GRADED.active, COMPLIANCE)]).submatrix(np.ones((3, 4, 4), dtype=bool))
    stresses = [sympy.Matrix([sympy.diff(f, y, y), sympy.diff(f, x, x), -sympy.diff(f, x, y)]) for f in (phi, other)]
    density = sympy.expand((stresses[0].T * sympy.Matrix(COMPLIANCE) * stresses[1])[0])
    primitive = sympy.Poly(density, x, y).integrate((x, 1), (y, 1))
    (left, right), (low, high) = ((float(line[0]), float(line[-1])) for line in (grid.x.lines, grid.y.lines))
    exact = primitive(right, high) - primitive(left, high) - primitive(right, low) + primitive(left, low)
    u, v = dofs_of(GRADED, phi).ravel(), dofs_of(GRADED, other).ravel()
    assert u @ (matrix @ v) == pytest.approx(float(exact), rel=1e-11, abs=1e-11)


def test_energy_matrix_is_symmetric_with_the_affine_functions_as_kernel():
    grid = Grid.of(GRADED)
    matrix = energy_matrix(grid, [(GRADED.active, Material(1.0, 0.3).compliance)])
    K = matrix.submatrix(np.ones((3, 4, 4), dtype=bool)).toarray()
    assert np.abs(K - K.T).max() <= 1e-15 * np.abs(K).max()
    eigenvalues = np.linalg.eigvalsh(K)
    assert (np.abs(eigenvalues[:3]) < 1e-12 * eigenvalues[-1]).all()
    assert eigenvalues[3] > 1e-9 * eigenvalues[-1]
    x, y = sympy.symbols("x y")
    assert np.abs(K @ dofs_of(GRADED, 1 + 2 * x - 3 * y).ravel()).max() < 1e-12 * np.abs(K).max()


def test_energy_matrix_of_a_mask_is_the_sum_of_its_cells():
    mesh = RectilinearMesh([0.0, 1.0, 1.5, 2.0], [0.0, 0.3, 1.0, 2.0])
    grid, everything = Grid.of(mesh), np.ones((4, 4, 4), dtype=bool)
    mask = np.array([[1, 1, 0], [0, 1, 1], [0, 1, 0]], dtype=bool)
    total = 0.0
    for cell in np.argwhere(mask):
        single = np.zeros_like(mask)
        single[tuple(cell)] = True
        total = total + energy_matrix(grid, [(single, COMPLIANCE)]).submatrix(everything)
    whole = energy_matrix(grid, [(mask, COMPLIANCE)]).submatrix(everything)
    assert abs(whole - total).max() < 1e-13 * abs(whole).max()


def test_rows_and_submatrix_agree():
    stencil = energy_matrix(Grid.of(GRADED), [(GRADED.active, COMPLIANCE)])
    everything = stencil.submatrix(np.ones((3, 4, 4), dtype=bool))
    kept = np.random.default_rng(1).uniform(size=(3, 4, 4)) < 0.6
    chosen = np.flatnonzero(~kept)
    assert abs(stencil.rows(chosen) - everything[chosen]).max() == 0.0
    assert abs(stencil.submatrix(kept) - everything[kept.ravel()][:, kept.ravel()]).max() == 0.0


def test_traces_are_the_stresses_of_the_airy_function():
    x, y = sympy.symbols("x y")
    phi = x**3 * y**2 - 2 * x**2 * y**3 + x * y
    u = dofs_of(GRADED, phi).ravel()
    points = EdgePoints(BognerFoxSchmit(GRADED), GRADED.boundary, 3)
    at = points.coordinates.T
    xx, yy, xy = (
        np.broadcast_to(sympy.lambdify((x, y), f)(*at), len(at[0]))
        for f in (sympy.diff(phi, y, y), sympy.diff(phi, x, x), -sympy.diff(phi, x, y))
    )
    horizontal, sign = points.tangents[:, 0] == 1.0, points.normals.sum(axis=1)
    tractions = sign * np.where(horizontal, xy, xx), sign * np.where(horizontal, yy, xy)
    weights = np.random.default_rng(0).normal(size=len(sign))
    for direction, values in zip(np.eye(2), tractions, strict=True):
        assert points.traction_load(direction, weights) @ u == pytest.approx(weights @ values, abs=1e-11)
    normal, shear = points.tractions(u)
    assert normal == pytest.approx(np.where(horizontal, yy, xx), abs=1e-11)
    assert shear == pytest.approx(sign * xy, abs=1e-11)
    assert points.weights.sum() == pytest.approx(2 * (2.0 + 1.2) / 2.0)


def test_traces_depend_on_the_nodes_of_their_edge_alone():
    basis, t = BognerFoxSchmit(GRADED), np.array([0.0, 0.3, 0.6, 1.0])
    for rows in (basis.normal_rows, basis.shear_rows):
        coo = rows(GRADED.boundary, t).tocoo()
        edge = coo.row // 4
        node = coo.col // 4
        assert ((node == GRADED.boundary.first[edge]) | (node == GRADED.boundary.second[edge])).all()


def test_cell_points_integrate_over_the_cells():
    basis = BognerFoxSchmit(GRADED)
    points, weights = basis.points(np.arange(6), basis.cell_points), basis.cell_sizes[:, None] * basis.cell_weights
    x, y = points[..., 0], points[..., 1]
    assert (weights * x**3 * y**2).sum() == pytest.approx(1.0 / 4 * 0.6**3 / 3, rel=1e-13)
