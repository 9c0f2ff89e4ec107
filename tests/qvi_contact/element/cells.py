"""A triangle and its element as the test of elements wants them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sympy
from numpy.polynomial.polynomial import polyval2d

from qvi_contact.element import legendre
from qvi_contact.element.affine import EDGES, AffineTriangles
from qvi_contact.element.hsieh_clough_tocher import hsieh_clough_tocher

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
    """One triangle of a degree: what `Cell` of the test of elements asks for."""

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
