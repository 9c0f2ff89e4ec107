"""What the elements must be: unisolvent, C1, complete to their degree, energy and derivatives right."""

from dataclasses import dataclass
from functools import cache, cached_property
from math import factorial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qvi_contact.element import (
    EDGES,
    AffineTriangles,
    absolute_integrals,
    hsieh_clough_tocher,
    legendre_from_values,
    product_integrals,
)
from tests.qvi_contact.builders import bernstein


@dataclass(frozen=True)
class Triangle:
    """One triangle with the Hsieh-Clough-Tocher element of a degree; points in barycentric coordinates (n, 3).

    The first `shared` of the element's `dimension` functions belong to degrees of freedom that it shares with others.
    """

    degree: int
    corners: np.ndarray

    @cached_property
    def element(self):
        return hsieh_clough_tocher(self.degree)

    @cached_property
    def maps(self):
        return AffineTriangles(self.corners[None])

    def points(self, local):
        return local @ self.maps.corners[0]

    def functions(self, local, order):
        """Derivatives of all functions, shape (n, components, dimension)."""
        reference = self.element.reference_functions(local, order)
        if order:
            reference = (np.linalg.inv(self.maps.jacobians).swapaxes(1, 2) if order == 1 else self.maps.hessian_maps)[
                0
            ] @ reference
        own = reference[..., : self.element.shared] @ self.element.transformations(self.maps)[0]
        return np.concatenate([own, reference[..., self.element.shared :]], axis=-1)

    def quadrature(self):
        """Points (g, 3) and weights (g,) in the plane, exact for the energy."""
        t, w = np.polynomial.legendre.leggauss(self.degree + 1)
        u, v = (part.ravel() for part in np.meshgrid((t + 1.0) / 2.0, (t + 1.0) / 2.0))
        points, weights = np.column_stack([u, (1.0 - u) * v, (1.0 - u) * (1.0 - v)]), np.outer(w, w).ravel() / 2.0
        weights = weights * (1.0 - u)  # the square collapsed to a triangle
        parts = [points @ np.array([np.eye(3)[a], np.eye(3)[b], np.full(3, 1.0 / 3.0)]) for a, b in EDGES]
        area = abs(np.linalg.det(self.corners[1:] - self.corners[0])) / 2.0
        return np.concatenate(parts), np.tile(weights, 3) * area / 3.0

    def energy(self, compliance):
        """∫ cσ:τ of the functions `interior_first`, as the element gives it."""
        B, order = np.eye(self.element.dimension), self.element.interior_first
        B[: self.element.shared, : self.element.shared] = self.element.transformations(self.maps)[0]
        R = self.element.roots(self.maps, compliance[None])[0] @ B[np.ix_(order, order)]
        return R.T @ R

    def neighbours(self, t):
        """A cell beyond each edge: points at t, that cell, functions that both have; numbers are those of both."""
        for s, ((a, b), local) in enumerate(self.on_edges(t)):
            corners = self.corners.copy()
            corners[s] = self.corners[[a, b]].sum(axis=0) - self.corners[s] + 0.1
            own = 9 + s * self.element.on_edge
            common = np.r_[3 * a : 3 * a + 3, 3 * b : 3 * b + 3, own : own + self.element.on_edge]
            yield local, Triangle(self.degree, corners), common

    def on_edges(self, t):
        """Barycentric coordinates (n, 3) at t (n,) along each edge, with the numbers of its corners."""
        for s, (a, b) in enumerate(EDGES):
            local = np.zeros((len(t), 3))
            local[:, a], local[:, b], local[:, s] = 1.0 - t, t, -1e-30  # in the part at this edge, in corners too
            yield (a, b), local

    def degrees_of_freedom(self, values):
        """The shared degrees of freedom of a function given by values(local, order) -> (n, components, …)."""
        found = []
        for corner in np.eye(3):
            found += [values(corner[None], 0)[0], values(corner[None], 1)[0]]
        count = self.degree + 6
        t, w = np.polynomial.legendre.leggauss(count)
        coefficients = (np.polynomial.legendre.legvander(t, self.degree - 2) * (np.arange(self.degree - 1) + 0.5)).T * w
        for (a, b), local in self.on_edges((t + 1.0) / 2.0):
            along = self.corners[b] - self.corners[a]
            (tx, ty) = along / np.hypot(*along)
            xx, yy, xy = np.moveaxis(values(local, 2), 1, 0)
            normal = tx * tx * xx + ty * ty * yy + 2.0 * tx * ty * xy
            twist = tx * ty * (yy - xx) + (tx * tx - ty * ty) * xy
            found += [np.tensordot(coefficients[2:], normal, 1), np.tensordot(coefficients[1:], twist, 1)]
        return np.concatenate(found)


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


every_degree = pytest.mark.parametrize("cell", [triangle(degree) for degree in DEGREES], ids=DEGREES)


@every_degree
def test_degrees_of_freedom_are_dual_to_the_functions(cell):
    found = cell.degrees_of_freedom(cell.functions)
    scale = np.abs(found).max()
    assert np.abs(found - np.eye(cell.element.shared, cell.element.dimension)).max() < 1e-10 * scale
    points = np.random.default_rng(1).dirichlet(np.ones(3), cell.element.dimension + 30)
    assert np.linalg.matrix_rank(cell.functions(points, 0)[:, 0]) == cell.element.dimension


@every_degree
def test_polynomials_of_the_degree_are_reproduced_with_all_derivatives(cell):
    degree, rng = cell.degree, np.random.default_rng(cell.degree)
    points, (a, b, c) = rng.dirichlet(np.ones(3), 2 * cell.element.dimension), rng.normal(size=(3, degree + 1))

    def powers(local, order):
        """Σ (a x + b y + c)^p, its gradient or its Hessian."""
        linear = np.multiply.outer((local @ cell.corners), np.ones(degree + 1)).swapaxes(0, 1)
        linear = a * linear[0] + b * linear[1] + c
        factors = [np.ones_like(a)[None], np.stack([a, b]), np.stack([a * a, b * b, a * b])][order]
        return factorial(degree) / factorial(degree - order) * linear ** (degree - order) @ factors.T

    shared = cell.degrees_of_freedom(powers)
    exact = [powers(points, order) for order in range(3)]
    tables = [cell.functions(points, order) for order in range(3)]
    rest = exact[0] - tables[0][..., : cell.element.shared] @ shared
    inner = np.linalg.lstsq(tables[0][:, 0, cell.element.shared :], rest[:, 0], rcond=None)[0]
    dofs = np.concatenate([shared, inner])
    for order in range(3):
        assert tables[order] @ dofs == pytest.approx(exact[order], abs=1e-9 * np.abs(exact[2]).max())


@every_degree
def test_functions_are_c1_across_edges_whatever_lies_beyond(cell):
    t, rng = np.linspace(0.0, 1.0, 7), np.random.default_rng(0)
    for at, other, common in cell.neighbours(t):
        u, v = rng.normal(size=(2, cell.element.dimension))
        v[common] = u[common]
        for order in (0, 1):
            values = cell.functions(at, order) @ u
            assert other.functions(at, order) @ v == pytest.approx(values, abs=1e-11 * np.abs(values).max())
        v[common[0]] += 1.0
        assert np.abs(cell.functions(at, 0) @ u - other.functions(at, 0) @ v).max() > 0.1


@every_degree
def test_energy_is_that_of_quadrature(cell):
    points, weights = cell.quadrature()
    stresses = cell.functions(points, 2)[:, [1, 0, 2]] * np.array([1.0, 1.0, -1.0])[:, None]
    stresses = stresses[:, :, cell.element.interior_first]
    by_points = np.einsum("g,gad,ab,gbe->de", weights, stresses, COMPLIANCE, stresses, optimize=True)
    found = cell.energy(COMPLIANCE)
    size = np.sqrt(np.outer(np.diag(found), np.diag(found)))
    assert (np.abs(found - by_points) < 1e-8 * size).all()


def test_interior_functions_are_the_same_on_every_processor():
    assert np.abs(hsieh_clough_tocher(6).coefficients[:, :, -18:]).sum() == pytest.approx(11.075891449302, rel=1e-11)


@every_degree
def test_functions_are_c1_inside_a_triangle(cell):
    rng = np.random.default_rng(cell.degree)
    dofs, step = rng.normal(size=cell.element.dimension), 1e-10
    for corner in np.eye(3):  # the line from a corner to the barycentre, a hair to its left and right
        t = rng.random(4)[:, None]
        across = step * (np.roll(corner, 1) - np.roll(corner, 2))
        sides = [t * corner + (1.0 - t) / 3.0 + shift for shift in (across, -across)]
        bend = np.abs(cell.functions(sides[0], 2) @ dofs).max()
        for order in (0, 1):
            left, right = (cell.functions(side, order) @ dofs for side in sides)
            assert left == pytest.approx(right, abs=1e-9 * bend)
        assert np.abs(np.diff([cell.functions(side, 2) @ dofs for side in sides], axis=0)).max() > 1e-6 * bend


coefficient = st.floats(-3.0, 3.0).map(lambda value: round(value, 3))


@cache
def at_midpoints(degree):
    return bernstein(degree, (np.arange(5000) + 0.5) / 5000)


@pytest.mark.parametrize("count", [3, 21])
def test_interpolation_from_gauss_points(count):
    """Polynomials of degree count − 1 are met, the next Legendre polynomial is taken for zero."""
    t = np.linspace(0.0, 1.0, 31)
    points = (1 + np.polynomial.legendre.leggauss(count)[0]) / 2
    matrix = (np.polynomial.legendre.legvander(2.0 * t - 1.0, count - 1) @ legendre_from_values(count - 1, count)).T
    assert points ** (count - 1) @ matrix == pytest.approx(t ** (count - 1), abs=1e-13)
    assert np.polynomial.Legendre.basis(count, [0, 1])(points) @ matrix == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("first", [2, 3])
@pytest.mark.parametrize("second", [2, 3, 4])
def test_products(first, second):
    t, w = np.polynomial.legendre.leggauss(8)
    t, w = (1 + t) / 2, w / 2
    found = product_integrals(first, second)
    assert found == pytest.approx(np.einsum("g,gi,gj->ij", w, bernstein(first, t), bernstein(second, t)), abs=1e-14)
    with pytest.raises(ValueError, match="read-only"):  # all share it
        found[0, 0] = 1.0


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(0.0, 2.0), min_size=3, max_size=3), st.lists(coefficient, min_size=3, max_size=5))
def test_integral_of_the_absolute_value(weight, coefficients):
    """Never above Σ |c_i| ∫ s B_i, never below |∫ s v|."""
    s, c = np.array([weight]), np.array([coefficients])
    degree = len(coefficients) - 1
    values = (at_midpoints(2) @ s[0]) * np.abs(at_midpoints(degree) @ c[0])
    found = float(absolute_integrals(s, c)[0])
    assert found == pytest.approx(values.mean(), abs=1e-6)
    moments = s @ product_integrals(2, degree)
    assert abs(float(moments[0] @ c[0])) - 1e-13 <= found <= float(moments[0] @ np.abs(c[0])) + 1e-13
