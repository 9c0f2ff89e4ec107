"""What every element must be: unisolvent, C1, complete to its degree, its energy and derivatives right."""

import numpy as np
import pytest
import sympy

from qvi_contact import InputError
from qvi_contact.element.affine import EDGES, AffineTriangles
from qvi_contact.element.hsieh_clough_tocher import hsieh_clough_tocher
from qvi_contact.element.triangle import bernstein, exponents, quadrature
from tests.qvi_contact.element.cells import Triangle, X, Y, rectangle, tabulated

COMPLIANCE = np.array([[1.0, -0.3, 0.1], [-0.3, 1.2, -0.2], [0.1, -0.2, 2.6]])  # every coupling present
DEGREES = (3, 4, 5, 6, 8, 12)


def triangle(degree, seed=0):
    """A triangle of no special shape."""
    rng = np.random.default_rng([degree, seed])
    while True:
        corners = rng.normal(size=(3, 2))
        area = abs(np.linalg.det(corners[1:] - corners[0])) / 2.0
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).max()
        if area > 0.2 * longest**2:
            return Triangle(degree, corners / longest)


CELLS = {"Bogner-Fox-Schmit": rectangle(), **{f"Hsieh-Clough-Tocher {degree}": triangle(degree) for degree in DEGREES}}
every_element = pytest.mark.parametrize("cell", CELLS.values(), ids=CELLS)


@every_element
def test_degrees_of_freedom_are_dual_to_the_functions(cell):
    found = cell.degrees_of_freedom(cell.functions)
    scale = np.abs(found).max()
    assert np.abs(found - np.eye(cell.shared, cell.dimension)).max() < 1e-10 * scale
    points = cell.random_points(np.random.default_rng(1), cell.dimension + 30)
    assert np.linalg.matrix_rank(cell.functions(points, 0)[:, 0]) == cell.dimension


@every_element
def test_polynomials_of_the_degree_are_reproduced_with_all_derivatives(cell):
    degree, rng = cell.degree, np.random.default_rng(cell.degree)
    points, (a, b, c) = cell.random_points(rng, 2 * cell.dimension), rng.normal(size=(3, degree + 1)).tolist()
    phi = sum((a[i] * X + b[i] * Y + c[i]) ** degree for i in range(degree + 1))
    shared = cell.degrees_of_freedom(lambda local, order: tabulated(phi, cell.points(local), order))
    exact = [tabulated(phi, cell.points(points), order) for order in range(3)]
    tables = [cell.functions(points, order) for order in range(3)]
    rest = exact[0] - tables[0][..., : cell.shared] @ shared
    inner = np.linalg.lstsq(tables[0][:, 0, cell.shared :], rest[:, 0], rcond=None)[0]
    dofs = np.concatenate([shared, inner])
    for order in range(3):
        assert tables[order] @ dofs == pytest.approx(exact[order], abs=1e-9 * np.abs(exact[2]).max())


@every_element
def test_functions_are_c1_across_edges_whatever_lies_beyond(cell):
    t, rng = np.linspace(0.0, 1.0, 7), np.random.default_rng(0)
    for here, other, there, own, its in cell.neighbours(t):
        u, v = rng.normal(size=(2, cell.dimension))
        v[its] = u[own]
        for order in (0, 1):
            values = cell.functions(here, order) @ u
            assert other.functions(there, order) @ v == pytest.approx(values, abs=1e-11 * np.abs(values).max())
        v[its[0]] += 1.0
        assert np.abs(cell.functions(here, 0) @ u - other.functions(there, 0) @ v).max() > 0.1


@every_element
def test_energy_is_that_of_quadrature(cell):
    points, weights = cell.quadrature()
    stresses = cell.functions(points, 2)[:, [1, 0, 2]] * np.array([1.0, 1.0, -1.0])[:, None]
    by_points = np.einsum("g,gad,ab,gbe->de", weights, stresses, COMPLIANCE, stresses, optimize=True)
    found = cell.energy(COMPLIANCE)
    size = np.sqrt(np.outer(np.diag(found), np.diag(found)))
    assert (np.abs(found - by_points) < 1e-8 * size).all()


@pytest.mark.parametrize("degree", [3, 6])
def test_derivatives_of_every_function_beside_sympy(degree):
    cell = triangle(degree)
    element, rng = cell.element, np.random.default_rng(degree)
    dofs = rng.normal(size=cell.dimension)
    reference = dofs.copy()
    reference[: cell.shared] = element.transformations(AffineTriangles(cell.corners[None]))[0] @ dofs[: cell.shared]
    for s, edge in enumerate(EDGES):  # on each part of the split a polynomial in x and y, by its Bernstein coefficients
        part = np.vstack([np.eye(3)[list(edge)], np.full(3, 1.0 / 3.0)])
        linear = np.linalg.inv(np.column_stack([part @ cell.corners, np.ones(3)])).T
        barycentric = [sympy.Poly(a * X + b * Y + c, X, Y) for a, b, c in linear.tolist()]
        phi = sympy.Poly(0, X, Y)
        for coefficient, alpha in zip(element.coefficients[s] @ reference, exponents(degree).tolist(), strict=True):
            divisor = sympy.prod(sympy.factorial(k) for k in alpha)
            power = sympy.prod(b**k for b, k in zip(barycentric, alpha, strict=True))
            phi += float(coefficient * sympy.factorial(degree) / divisor) * power
        local = rng.dirichlet(np.ones(3), 5) @ part
        for order in range(3):
            found, exact = cell.functions(local, order) @ dofs, tabulated(phi, cell.points(local), order)
            assert found == pytest.approx(exact, abs=1e-9 * np.abs(exact).max())


@pytest.mark.parametrize("degree", DEGREES)
def test_functions_are_c1_inside_a_triangle(degree):
    cell, rng = triangle(degree), np.random.default_rng(degree)
    dofs, step = rng.normal(size=cell.dimension), 1e-13
    for corner in np.eye(3):  # the line from a corner to the barycentre, a hair to its left and right
        t = rng.random(4)[:, None]
        across = step * (np.roll(corner, 1) - np.roll(corner, 2))
        sides = [t * corner + (1.0 - t) / 3.0 + shift for shift in (across, -across)]
        bend = np.abs(cell.functions(sides[0], 2) @ dofs).max()
        for order in (0, 1):
            left, right = (cell.functions(side, order) @ dofs for side in sides)
            assert left == pytest.approx(right, abs=1e-9 * bend)
        assert np.abs(np.diff([cell.functions(side, 2) @ dofs for side in sides], axis=0)).max() > 1e-6 * bend


@pytest.mark.parametrize("degree", [0, 3, 8])
def test_quadrature_is_exact_to_its_degree(degree):
    points, weights = quadrature(degree)
    for i in range(degree + 1):
        for j in range(degree + 1 - i):
            exact = 2.0 * sympy.factorial(i) * sympy.factorial(j) / sympy.factorial(i + j + 2)
            assert weights @ (points[:, 0] ** i * points[:, 1] ** j) == pytest.approx(float(exact), rel=1e-13)


def test_bernstein_polynomials_sum_to_one():
    points = np.random.default_rng(0).dirichlet(np.ones(3), 20)
    assert bernstein(12, points).sum(axis=1) == pytest.approx(np.ones(20), rel=1e-13)


@pytest.mark.parametrize("degree", [2, 13, 4.0, True, "4"])
def test_degrees_that_are_not_offered_are_refused(degree):
    with pytest.raises(InputError, match="from 3 to 12"):
        hsieh_clough_tocher(degree)
