"""Cells with their elements as the test of elements wants them.

A cell has `dimension` functions, the first `shared` of which belong to degrees of freedom that it shares with others.
Points are given in its own coordinates.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sympy
from numpy.polynomial.polynomial import polyval2d

from qvi_contact import RectilinearMesh
from qvi_contact.discretization.bogner_fox_schmit.stencil import energy_matrix
from qvi_contact.element import legendre
from qvi_contact.element.affine import EDGES, AffineTriangles
from qvi_contact.element.bogner_fox_schmit import Grid
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.element.hsieh_clough_tocher import hsieh_clough_tocher
from qvi_contact.element.triangle import quadrature

X, Y = sympy.symbols("x y")
DERIVATIVES = ([()], [(X,), (Y,)], [(X, X), (Y, Y), (X, Y)])
"""Values, gradient and Hessian as an element tabulates them, by order."""


def tabulated(phi, points, order):
    """Derivatives of a polynomial in SymPy at points (n, 2), shape (n, components)."""
    columns = []
    for variables in DERIVATIVES[order]:
        derivative = sympy.Poly(phi, X, Y)
        for variable in variables:
            derivative = derivative.diff(variable)
        table = np.zeros((derivative.total_degree() + 1,) * 2 if derivative else (1, 1))
        for powers, coefficient in derivative.terms():
            table[powers] = coefficient
        columns.append(polyval2d(*points.T, table))
    return np.column_stack(columns)


@dataclass(frozen=True)
class Triangle:
    """One triangle with the Hsieh-Clough-Tocher element of a degree; points in barycentric coordinates."""

    degree: int
    corners: np.ndarray

    @cached_property
    def element(self):
        return hsieh_clough_tocher(self.degree)

    @cached_property
    def _maps(self):
        return AffineTriangles(self.corners[None])

    @property
    def shared(self):
        return self.element.shared

    @property
    def dimension(self):
        return self.element.dimension

    def points(self, local):
        """Points in the plane at barycentric coordinates (n, 3)."""
        return self._maps.points(local)[0]

    def functions(self, local, order):
        """Derivatives of all functions at barycentric coordinates (n, 3), shape (n, components, dimension)."""
        return self.element.functions(self._maps, local, order)[0]

    def quadrature(self):
        """Points (g, 3) and weights (g,) in the plane, exact for the energy."""
        points, weights = quadrature(2 * self.degree)
        parts = [points @ np.array([np.eye(3)[a], np.eye(3)[b], np.full(3, 1.0 / 3.0)]) for a, b in EDGES]
        area = abs(np.linalg.det(self.corners[1:] - self.corners[0])) / 2.0
        return np.concatenate(parts), np.tile(weights, 3) * area / 3.0

    def energy(self, compliance):
        """∫ cσ:τ of all functions (dimension, dimension), as the element gives it."""
        B = np.eye(self.dimension)
        B[: self.shared, : self.shared] = self.element.transformations(self._maps)[0]
        return B.T @ self.element.energies(self._maps, compliance)[0] @ B

    def neighbours(self, t):
        """A cell beyond each edge: (points at t here, that cell, points there, common functions here, and there)."""
        for s, ((a, b), local) in enumerate(self.on_edges(t)):
            corners = self.corners.copy()
            corners[s] = self.corners[[a, b]].sum(axis=0) - self.corners[s] + 0.1
            own = 9 + s * self.element.on_edge
            common = np.r_[3 * a : 3 * a + 3, 3 * b : 3 * b + 3, own : own + self.element.on_edge]
            yield local, Triangle(self.degree, corners), local, common, common

    def random_points(self, rng, count):
        """Barycentric coordinates (n, 3)."""
        return rng.dirichlet(np.ones(3), count)

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
        t, _ = np.polynomial.legendre.leggauss(count)
        coefficients = legendre.from_values(self.degree - 2, count)
        for (a, b), local in self.on_edges((t + 1.0) / 2.0):
            along = self.corners[b] - self.corners[a]
            (tx, ty) = along / np.hypot(*along)
            xx, yy, xy = np.moveaxis(values(local, 2), 1, 0)
            normal = tx * tx * xx + ty * ty * yy + 2.0 * tx * ty * xy
            twist = tx * ty * (yy - xx) + (tx * tx - ty * ty) * xy
            found += [np.tensordot(coefficients[2:], normal, 1), np.tensordot(coefficients[1:], twist, 1)]
        return np.concatenate(found)


@dataclass(frozen=True)
class Rectangle:
    """One cell of a grid with the Bogner-Fox-Schmit element; points (t_x, t_y) from 0 to 1."""

    grid: Grid
    column: int = 0
    row: int = 0

    degree, shared, dimension = 3, 16, 16

    def points(self, local):
        """Points in the plane at (t_x, t_y), shape (n, 2)."""
        lines = ((self.grid.x, self.column), (self.grid.y, self.row))
        return np.column_stack([line.lines[i] + line.sizes[i] * t for (line, i), t in zip(lines, local.T, strict=True)])

    def functions(self, local, order):
        """Derivatives of all functions, shape (n, components, 16)."""
        orders = ([(0, 0)], [(1, 0), (0, 1)], [(2, 0), (0, 2), (1, 1)])[order]
        column, row = (np.full(len(local), number) for number in (self.column, self.row))
        return np.stack([self.grid.derivative_rows(column, row, *local.T, which) for which in orders], axis=1)

    def random_points(self, rng, count):
        """(t_x, t_y), shape (n, 2)."""
        return rng.random((count, 2))

    def quadrature(self):
        """Points (g, 2) and weights (g,) in the plane, exact for the energy."""
        t, w = gauss_legendre(5)
        area = self.grid.x.sizes[self.column] * self.grid.y.sizes[self.row]
        return np.column_stack([np.tile(t, 5), np.repeat(t, 5)]), area * np.outer(w, w).ravel()

    def energy(self, compliance):
        """∫ cσ:τ of all functions (16, 16), as assembled on a grid of which only this cell is filled."""
        body = np.zeros((len(self.grid.y.sizes), len(self.grid.x.sizes)), dtype=bool)
        body[self.row, self.column] = True
        everything = np.ones((len(self.grid.y.lines), len(self.grid.x.lines), 4), dtype=bool)
        K = energy_matrix(self.grid, [(body, compliance)]).submatrix(everything).toarray()
        dofs = self.grid.cell_dofs(np.array(self.column), np.array(self.row))
        return K[np.ix_(dofs, dofs)]

    def neighbours(self, t):
        """The cells to the right and above."""
        ends, ones = np.zeros_like(t), np.ones_like(t)
        beside, above = Rectangle(self.grid, self.column + 1, self.row), Rectangle(self.grid, self.column, self.row + 1)
        low, high = np.arange(4), 4 + np.arange(4)
        yield np.column_stack([ones, t]), beside, np.column_stack([ends, t]), np.r_[high, 8 + high], np.r_[low, 8 + low]
        yield np.column_stack([t, ones]), above, np.column_stack([t, ends]), np.r_[8 + low, 8 + high], np.r_[low, high]

    def degrees_of_freedom(self, values):
        """(Φ, s_x Φ_x, s_y Φ_y, s_x s_y Φ_xy) at the four nodes, of values(local, order) -> (n, components, …)."""
        found = []
        for b, a in np.ndindex(2, 2):
            corner = np.array([[float(a), float(b)]])
            first, second = values(corner, 1)[0], values(corner, 2)[0]
            parts = np.stack([values(corner, 0)[0, 0], first[0], first[1], second[2]])
            scales = self.grid.dof_scales[self.row + b, self.column + a]
            found.append(parts * scales.reshape(-1, *[1] * (parts.ndim - 1)))
        return np.concatenate(found)


def rectangle():
    """The lower left cell of four of different sizes."""
    return Rectangle(Grid.of(RectilinearMesh([3.0, 3.5, 4.1], [-1.0, 0.0, 0.2])))
