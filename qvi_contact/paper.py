"""The plate between two rough rigid plates of Więckowski (1992), section 5, as the algebraic problem (D2).

For your own bodies take `qvi_contact.solve`: its triangles are far more accurate with as many unknowns.

The quarter [0, a] × [0, h] has symmetry on x = 0 and y = 0, a free side x = a, and contact on y = h with a rigid plate
that is moved down by U. An Airy function of Bogner-Fox-Schmit elements has, without volume forces, the stresses (3.1)

    σ_xx = Φ_yy,    σ_yy = Φ_xx,    σ_xy = −Φ_xy.

The paper imposes the tractions on Γ_σ by Lagrange multipliers; here degrees of freedom are eliminated instead. On the
free side Φ is affine. An affine function has no stress, (3.2), so Φ is set to zero there. Zero shear stress on the two
symmetry lines makes Φ_y and Φ_x constant there:

    x = a:  Φ = Φ_x = 0          y = 0:  Φ_y = 0          x = 0:  Φ_x = P/2, one unknown.

Therefore the shear stress is zero in the corner between the contact and the free side.

The element is that of Bogner, Fox and Schmit, (3.7): cubic in x times cubic in y, with a continuous gradient. An Airy
function of these elements on a grid is Φ(x, y) = Σ u_JI H_J(y) H_I(x), a product of cubic splines: H_I with I = 2i is
one at the line x_i, with I = 2i + 1 it has a slope there, and both are zero on all other lines. So a derivative of Φ at
points of a grid is a Kronecker product of two matrices of one variable, applied to u.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.polynomial import polynomial
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, check_field, finite_number, positive_number
from qvi_contact.element.edge import bernstein_from_values, gauss_legendre, largest_quadratic, lobatto_points
from qvi_contact.errors import InputError
from qvi_contact.mesh.grid import rectangle_lines
from qvi_contact.problem.material import Material, Plane
from qvi_contact.solution.stress import principal_stresses
from solvers import FrictionQVI, TractionFactor

__all__ = ["QuarterPlate", "plate"]

_COMPONENTS = ((0, 2, 1.0), (2, 0, 1.0), (1, 1, -1.0))
"""σ_xx, σ_yy, σ_xy as derivatives of Φ: order in x, order in y, factor."""

GAUSS_POINTS, GAUSS_WEIGHTS = gauss_legendre(4)
"""Four Gauss points on [0, 1]: exact for the energy; the paper imposes the friction law at these points of an edge."""

# coefficients of powers of t (rows) for: value at 0, slope at 0, value at 1, slope at 1 (columns)
_HERMITE: Final = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [-3.0, -2.0, 3.0, -1.0], [2.0, 1.0, -2.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Spline:
    """Cubic Hermite functions of one coordinate on grid lines.

    The degrees of freedom are Φ and s Φ' at every line, where s is the geometric mean of the sizes of the two cells at
    the line. So all have the same unit, and the matrices of fine grids keep their digits.
    """

    lines: FloatArray
    """Coordinates, increasing, dimensionless, shape (n + 1,)."""

    @cached_property
    def sizes(self) -> FloatArray:
        """Lengths h of the cells, shape (n,)."""
        return np.diff(self.lines)

    def points(self, t: FloatArray) -> FloatArray:
        """Coordinates of the points t (q,) in [0, 1] of every cell, shape (n, q)."""
        return np.asarray(self.lines[:-1, None] + self.sizes[:, None] * t)

    def matrix(self, t: FloatArray, derivative: int) -> sparse.csr_array:
        """Derivatives of order 0 to 2 at the points t (q,) of every cell, from the degrees of freedom.

        Shape (n q, 2(n + 1)), cell by cell.
        """
        n, q = len(self.sizes), len(t)
        shapes = polynomial.polyval(t, polynomial.polyder(_HERMITE, derivative), tensor=True).T  # (q, 4)
        h, padded = self.sizes, np.pad(self.sizes, 1, mode="edge")
        s = np.sqrt(padded[:-1] * padded[1:])
        units = np.stack([np.ones(n), h / s[:-1], np.ones(n), h / s[1:]], axis=1) / h[:, None] ** derivative
        rows = shapes[None] * units[:, None]  # (n, q, 4)
        columns = np.broadcast_to(2 * np.arange(n)[:, None, None] + np.arange(4), rows.shape)
        starts = 4 * np.arange(n * q + 1)
        return sparse.csr_array((rows.ravel(), columns.ravel(), starts), shape=(n * q, 2 * (n + 1)))


def plate(
    friction: float,
    cells: tuple[int, int] = (2, 2),
    width: float = 1.0,
    height: float = 1.0,
    grading: float = 1.0,
    young: float = 2.09e5,
    poisson: float = 0.3,
    plane: Plane = "stress",
    displacement: float = 1e-3,
) -> QuarterPlate:
    """The quarter plate on a grid; the defaults are the paper's data, in MPa and a length of 1.

    The parameters are those of `qvi_contact.gallery.compressed_plate`, the same plate on triangles, but the friction is
    a number, cells are elements, and plane strain with ν = 0.5 is an `InputError`. The paper calls U the relative
    translation of the two plates, but its forces belong to the U of the quarter: P/2 = E U at μ = 0.
    """
    mu, U = finite_number("friction", friction), positive_number("displacement", displacement)
    check_field("friction", mu, minimum=0.0)
    material = Material(young, poisson, plane)
    if material.incompressible:
        raise InputError("poisson", poisson, "give less than 0.5 in plane strain")
    x, y = rectangle_lines(cells, width, height, (0.0, 0.0), grading)
    return QuarterPlate(x, y, material, mu, U)


@dataclass(frozen=True, eq=False)
class QuarterPlate:
    """The plate on grid lines, its algebraic problem, and forces and stresses from a solution z (n,) of the problem.

    Lengths are divided by L = max(a, h), stresses by S = U / (c11 L), displacements by U. If z is NaN, as without a
    solution, forces and stresses are NaN.
    """

    x: FloatArray
    y: FloatArray
    """Grid lines [length], from 0 to a and to h, shape (nx + 1,) and (ny + 1,)."""
    material: Material
    """Material with E, ν and the plane state."""
    friction: float
    """Coefficient of friction μ."""
    displacement: float
    """Displacement U of the plate [length]."""

    @property
    def length_unit(self) -> float:
        """Unit of length L [length]."""
        return float(max(self.x[-1], self.y[-1]))

    @property
    def stress_unit(self) -> float:
        """Unit of stress S = U / (c11 L) [stress]."""
        return self.displacement / (float(self.material.compliance[0, 0]) * self.length_unit)

    @cached_property
    def qvi(self) -> FrictionQVI:
        """The problem (D2) of (3.5) and (3.6), dimensionless.

        K is the energy ∫ cσ : τ, the rows of N and T are σ_N = σ_yy and σ_T = σ_xy at four Gauss points of every edge,
        W their weights, and the load is the obstacle u_N ≤ −U: f = −U ∫ τ_N ds, in units of U.
        """
        sizes = self._splines[0].sizes
        weights, edges = np.outer(sizes, GAUSS_WEIGHTS).ravel(), sparse.eye_array(len(sizes))
        points = lobatto_points(1), lobatto_points(2)  # of an edge: σ_N is linear, σ_T quadratic
        nodal = sparse.vstack([self._contact(t, component) for component, t in enumerate(points, start=1)])
        maps = [np.vander(GAUSS_POINTS, len(t)) @ np.linalg.inv(np.vander(t)) for t in points]
        traces = TractionFactor(sparse.csc_array(nodal), sparse.block_diag([sparse.kron(edges, each) for each in maps]))
        normal, shear = (sparse.csc_array(self._contact(GAUSS_POINTS, component)) for component in (1, 2))
        load, zero = -(normal.T @ weights), 0.0 * weights
        x_weights, y_weights = (np.outer(each.sizes, GAUSS_WEIGHTS).ravel() for each in self._splines)
        compliance = self.material.compliance / self.material.compliance[0, 0]
        stress, at = sparse.vstack(self._stress_rows()), sparse.diags_array(np.kron(y_weights, x_weights))
        K = sparse.csc_array(stress.T @ sparse.kron(compliance, at) @ stress)
        return FrictionQVI.from_arrays(
            K=K, f=load, N=normal, n0=zero, T=shear, t0=zero, mu=np.full(len(weights), self.friction), W=weights,
            traces=traces,
        )  # fmt: skip

    def force(self, z: FloatArray) -> float:
        """P/2 = −∫ σ_N ds over the contact [stress × length]; Table 1 prints it."""
        unit = self.stress_unit * self.length_unit
        return -unit * float(self.qvi.W @ self.qvi.normal(z))

    def tractions(self, z: FloatArray, t: FloatArray = GAUSS_POINTS) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Arrays x, σ_N, σ_T at the points t (q,) in [0, 1] of every edge of the contact, shape (nx, q) each.

        They are in units of the data. On an edge σ_N is linear, and σ_T, which acts on the body along +x, quadratic.
        """
        x = self._splines[0].points(t) * self.length_unit
        normal, shear = ((self._contact(t, component) @ z).reshape(x.shape) for component in (1, 2))
        return x, self.stress_unit * normal, self.stress_unit * shear

    def excess_between_points(self, z: FloatArray) -> float:
        """The largest |σ_T| + μσ_N on the whole contact [stress], at least 0.

        The friction law (1.6) holds only at four points of every edge. The quadratic ±σ_T + μσ_N of an edge has its
        maximum at an end, or where its slope is zero.
        """
        _, normal, shear = self.tractions(z, lobatto_points(2))
        sides = (sign * shear + self.friction * normal for sign in (1.0, -1.0))
        largest = (largest_quadratic(values @ bernstein_from_values(2).T) for values in sides)
        return max(0.0, *(float(values.max()) for values in largest))

    def stress(self, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Arrays x, y, σ at the 4 × 4 Gauss points of each element, shapes (m,), (m,), (m, 3) with xx, yy, xy.

        Lengths and stresses are in the units of the data; x runs first in the order of the m = 16 nx ny points.
        """
        x, y = np.meshgrid(*(spline.points(GAUSS_POINTS).ravel() for spline in self._splines))
        sigma = np.stack([rows @ z for rows in self._stress_rows()], axis=1)
        return x.ravel() * self.length_unit, y.ravel() * self.length_unit, sigma * self.stress_unit

    def principal_stress(self, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Principal stresses σ₁ ≥ σ₂ and the angle [rad] of σ₁ from the x-axis at the points of `stress`, (m,) each.

        Figures 2-5 show them and print the largest |σ₁|, |σ₂|.
        """
        return principal_stresses(self.stress(z)[2])

    @cached_property
    def _splines(self) -> tuple[Spline, Spline]:
        """The splines along x and along y."""
        return Spline(self.x / self.length_unit), Spline(self.y / self.length_unit)

    @cached_property
    def _basis(self) -> sparse.csr_array:
        """Matrix B with u = B z: all degrees of freedom u_JI, I = 2i + p of x running first, from the free ones z."""
        rows, columns = 2 * len(self.y), 2 * len(self.x)
        free = np.ones((rows, columns), dtype=bool)
        free[:, -2:] = False  # x = a: Φ = Φ_x = 0 and so Φ_y = Φ_xy = 0
        free[1, :] = False  # y = 0: Φ_y = Φ_xy = 0
        free[:, 1] = False  # x = 0: Φ_xy = 0, and Φ_x is one number
        free_dofs = np.flatnonzero(free)
        on_axis = np.ravel_multi_index((np.arange(0, rows, 2), np.ones(len(self.y), dtype=int)), free.shape)
        column = np.concatenate([np.arange(len(free_dofs)), np.full(len(on_axis), len(free_dofs))])
        positions = (np.concatenate([free_dofs, on_axis]), column)
        return sparse.csr_array((np.ones(len(column)), positions), shape=(free.size, len(free_dofs) + 1))

    def _stress_rows(self) -> list[sparse.csr_array]:
        """Matrices (m, n) from z to σ_xx, σ_yy, σ_xy at all Gauss points, dimensionless."""
        (along_x, along_y), all_rows = self._splines, []
        for in_x, in_y, factor in _COMPONENTS:
            rows = sparse.kron(along_y.matrix(GAUSS_POINTS, in_y), along_x.matrix(GAUSS_POINTS, in_x))
            all_rows.append(sparse.csr_array(factor * rows) @ self._basis)
        return all_rows

    def _contact(self, t: FloatArray, component: int) -> sparse.csr_array:
        """Matrix (nx q, n) from z to a stress on y = h at the points t (q,) of every edge, dimensionless."""
        in_x, in_y, factor = _COMPONENTS[component]
        along_x, along_y = self._splines
        top = along_y.matrix(np.ones(1), in_y)[[-1]]
        return sparse.csr_array(factor * sparse.kron(top, along_x.matrix(t, in_x)) @ self._basis)
