"""The Hsieh-Clough-Tocher family of degree p ≥ 3: C1 and piecewise polynomial on triangles split at their barycentre.

Source: Douglas, Dupont, Percell and Scott (1979). A triangle has 3 (p² − p + 2) / 2 functions. The degrees of freedom
that it shares with its neighbours are

    at each corner    Φ, Φ_x, Φ_y
    on each edge      N_k, k = 2 … p − 2, and Q_k, k = 1 … p − 2

N_k and Q_k are the Legendre coefficients, Σ c_k P_k(2s/h − 1), of the tractions Φ_tt = σ_N and of Φ_tn on the edge. The
edge has length h and runs from its corner a of lower number to b, with tangent t and normal n = (−t_y, t_x). The family
is hierarchical: degree p + 1 adds coefficients to those of degree p. The lowest coefficients follow from the corners:

    h N₀ = t·(∇Φ_b − ∇Φ_a),   h Q₀ = n·(∇Φ_b − ∇Φ_a),   h² N₁ = 3 h t·(∇Φ_a + ∇Φ_b) − 6 (Φ_b − Φ_a)

The C1 space is affine invariant, so it is built once, on an equilateral triangle, as the null space of the jumps
between the three parts. On that triangle the functions of corners and edges have the least ∫|∇∇Φ|², and the interior
functions are orthonormal in this energy.
"""

from functools import cache, cached_property
from typing import Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, whole_number
from qvi_contact.element.edge import gauss_legendre, legendre_from_values
from qvi_contact.element.triangle import CORNERS, EDGES, AffineTriangles, bernstein, exponents, gradient, quadrature

LOWEST, HIGHEST = 3, 12
"""Lowest and highest degree; at degree 12 rounding leaves twelve digits."""

_FIRST, _SECOND = np.transpose(EDGES)  # corners at the ends of each edge
_FROBENIUS: Final = np.array([1.0, 1.0, 2.0])  # |∇∇Φ|² = Φ_xx² + Φ_yy² + 2 Φ_xy²
_SOFT: Final = 1e-4  # compliance to a pressure, relative to c_11 + c_22, below which Cholesky's root loses digits
_MAX_ELONGATION: Final = 10.0  # longest side over height: above it the energy matrix loses too many digits
_ON_BORDER: Final = 1e-10  # difference of barycentric coordinates that is rounding: the point is on a border of parts
_AREA: Final = np.sqrt(0.75) / 2.0  # of the reference triangle


@cache
def hsieh_clough_tocher(degree: int) -> "HsiehCloughTocher":
    """The element of a degree, cached; `InputError` for a degree out of range."""
    return HsiehCloughTocher(whole_number("degree", degree, HIGHEST, LOWEST))


class HsiehCloughTocher:
    """The element of one degree; `hsieh_clough_tocher` makes and caches it.

    The local functions are those of the corners 0, 1, 2 (three each), of the edges 0, 1, 2 (see `EDGES`; N_2 … N_(p−2),
    then Q_1 … Q_(p−2)), and the interior functions. The first `shared` functions are dual to the degrees of
    freedom of each triangle; the interior functions are images of those of the reference triangle.
    """

    def __init__(self, degree: int) -> None:
        self.degree, self.traction_degree = degree, degree - 2  # p of Φ; p − 2 of σ_N and σ_T on an edge
        self.dimension = 3 * (degree**2 - degree + 2) // 2  # number of functions
        self.on_edge = 2 * degree - 5  # those of one edge
        self.shared = 9 + 3 * self.on_edge  # those of all corners and edges
        self.interior = self.dimension - self.shared
        # order for condensation; without corner 0, whose values become zero by adding an affine Φ, which has no stress
        self.interior_first = np.concatenate([np.arange(self.shared, self.dimension), np.arange(3, self.shared)])
        # matrices from coefficients of a part to those of its gradient (3, 2, …, count) and Hessian (3, 3, …, count)
        gradients, hessians, centre = [], [], CORNERS.mean(axis=0)
        for edge in EDGES:
            slopes = np.linalg.inv(np.column_stack([np.vstack([CORNERS[list(edge)], centre]), np.ones(3)]))[:2].T
            x, y = gradient(degree, slopes), gradient(degree - 1, slopes)  # slopes of the barycentric coordinates
            gradients.append(x)
            hessians.append([y[0] @ x[0], y[1] @ x[1], y[0] @ x[1]])
        self._gradients, self._hessians = np.array(gradients), np.array(hessians)
        # Bernstein coefficients of the functions on the three parts (3, count, dimension) of the reference triangle;
        # part s has edge s, with the corners `EDGES[s]`, and the barycentre as third corner
        self.coefficients = self._dual_basis(self._smooth_functions())
        self._weighted_hessians = self._weighted(self.coefficients)

    def _smooth_functions(self) -> FloatArray:
        """An orthonormal basis of the C1 functions among the piecewise polynomials, shape (3, count, dimension)."""
        p = self.degree
        count = len(exponents(p))
        jump_rows = []
        for v in range(3):  # on the line from corner v to the barycentre Φ and ∇Φ have equal coefficients in both parts
            part_1, part_2 = (s for s in range(3) if s != v)
            jumps = np.zeros((3 * p + 1, 3, count))
            for s, sign in ((part_1, 1.0), (part_2, -1.0)):
                on_line, lower = (exponents(d)[:, 1 - EDGES[s].index(v)] == 0 for d in (p, p - 1))
                jumps[: p + 1, s] = sign * np.eye(count)[on_line]
                jumps[p + 1 :, s] = sign * self._gradients[s][:, lower].reshape(-1, count)
            jump_rows.append(jumps.reshape(len(jumps), -1))
        _, _, right_singular = np.linalg.svd(np.vstack(jump_rows))
        return np.asarray(right_singular[3 * count - self.dimension :].T.reshape(3, count, self.dimension))

    def _functionals(self) -> FloatArray:
        """Degrees of freedom as rows on coefficients (shared, 3, count); on edges e with medians m of Φ_ee and Φ_em."""
        count = len(exponents(self.degree))
        rows = np.zeros((self.shared, 3, count))
        for v in range(3):
            s = (v + 1) % 3
            value, slopes = (exponents(d)[:, EDGES[s].index(v)].argmax() for d in (self.degree, self.degree - 1))
            rows[3 * v, s, value] = 1.0
            rows[3 * v + 1 : 3 * v + 3, s] = self._gradients[s][:, slopes]
        t, _ = gauss_legendre(self.degree)
        coefficients = legendre_from_values(self.traction_degree, self.degree)
        values = bernstein(self.degree - 2, np.column_stack([1.0 - t, t, np.zeros_like(t)]))
        for s, (a, b) in enumerate(EDGES):
            e, m = CORNERS[b] - CORNERS[a], CORNERS[s] - (CORNERS[a] + CORNERS[b]) / 2.0
            xx, yy, xy = coefficients @ values @ self._hessians[s]
            phi_ee = e[0] ** 2 * xx + e[1] ** 2 * yy + 2.0 * e[0] * e[1] * xy
            phi_em = e[0] * m[0] * xx + e[1] * m[1] * yy + (e[0] * m[1] + e[1] * m[0]) * xy
            start = 9 + s * self.on_edge
            rows[start : start + self.on_edge, s] = np.vstack([phi_ee[2:], phi_em[1:]])
        return rows

    def _dual_basis(self, smooth: FloatArray) -> FloatArray:
        """Functions dual to the functionals, of least energy; then the interior ones, energy-orthonormal."""
        basis = smooth.reshape(-1, self.dimension)
        functionals = self._functionals().reshape(self.shared, -1) @ basis
        stresses = (np.sqrt(_FROBENIUS)[:, None, None] * self._weighted(smooth)).reshape(-1, self.dimension)
        # null: the functions on which all functionals are zero; subtract from `dual` its energy projection on them
        dual, null = np.linalg.pinv(functionals), np.linalg.svd(functionals)[2][self.shared :].T
        orthogonal, triangular = np.linalg.qr(stresses @ null)
        dual = dual - null @ np.linalg.solve(triangular, orthogonal.T @ (stresses @ dual))
        inner = np.linalg.solve(triangular.T, null.T).T
        if self.interior:  # unique up to a rotation, which rounding would choose: fixed sums become lower triangular
            sums = np.cos(np.outer(np.arange(self.interior) + 1.0, np.arange(len(basis)) + 1.0)) @ basis @ inner
            rotation, upper = np.linalg.qr(sums.T)
            inner = inner @ (rotation * np.sign(np.diag(upper)))
        functions = np.hstack([dual, inner])
        for _ in range(2):  # remove the rounding error, 1e-13, of the duality
            functions = functions - dual @ (functionals @ functions - np.eye(self.shared, self.dimension))
        return np.asarray(basis @ functions).reshape(smooth.shape)

    @cached_property
    def derivatives(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Bernstein coefficients of values, gradients and Hessians, shapes (part, component, count, dimension)."""
        functions = self.coefficients[:, None]
        return functions, self._gradients @ functions, self._hessians @ functions

    def _weighted(self, functions: FloatArray) -> FloatArray:
        """Second derivatives (xx, yy, xy) × √weight at points of the reference triangle, (3, q, dimension)."""
        points, weights = quadrature(2 * self.degree - 4)
        values = bernstein(self.degree - 2, points) * np.sqrt(_AREA / 3.0 * weights)[:, None]
        derivatives = np.moveaxis(values @ (self._hessians @ functions[:, None]), 1, 0)
        return np.asarray(derivatives).reshape(3, -1, self.dimension)

    @cached_property
    def _energies(self) -> FloatArray:
        """∫ H_a ⊗ H_b over the reference triangle, H_a component a of the Hessians of `interior_first`; (9, …)."""
        hessians = self._weighted_hessians[:, :, self.interior_first]
        return np.asarray(hessians[:, None].swapaxes(2, 3) @ hessians).reshape(9, -1)

    def roots(self, triangles: AffineTriangles, compliances: FloatArray) -> FloatArray:
        """R (n, …) upper triangular with RᵀR = ∫ c σ:τ for the functions `interior_first` and compliances c (n, 3, 3).

        R comes from Cholesky's factorisation of the energy. Small energies would be lost in long and thin triangles,
        and where the compliance to a pressure is zero or close to it; there R comes from QR of the weighted stresses.
        """
        pressure_compliance = compliances[:, :2, :2].sum(axis=(1, 2))  # cσ:σ of σ_xx = σ_yy = 1
        is_soft = pressure_compliance < _SOFT * (compliances[:, 0, 0] + compliances[:, 1, 1])
        by_qr = (triangles.elongations > _MAX_ELONGATION) | is_soft
        maps, order = triangles.stress_maps, self.interior_first
        if not by_qr.any():
            weights = triangles.scales[:, None, None] * (maps.swapaxes(1, 2) @ compliances @ maps)
            energies = weights.reshape(-1, 9) @ self._energies
            return np.asarray(np.linalg.cholesky(energies.reshape(-1, len(order), len(order))).swapaxes(1, 2))
        R = np.empty((len(triangles), len(order), len(order)))
        R[~by_qr] = self.roots(triangles.take(~by_qr), compliances[~by_qr])
        root = compliance_roots(compliances).swapaxes(1, 2) * np.sqrt(triangles.scales)[:, None, None]
        rows = np.einsum("nab,bqd->naqd", (root @ maps)[by_qr], self._weighted_hessians[:, :, order])
        R[by_qr] = np.linalg.qr(rows.reshape(len(rows), -1, len(order)), mode="r")
        return R

    def transformations(self, triangles: AffineTriangles) -> FloatArray:
        """Matrices from the degrees of freedom of triangles to those of the reference triangle, (n, shared, shared).

        At corners ∇_ξ Φ = Jᵀ ∇Φ. On an edge Φ_ee = h² Φ_tt and Φ_em = h (α Φ_tn + β Φ_tt), with the median
        m = α n + β t. The coefficient N₁ of Φ_tt follows from the corners.
        """
        a, b = triangles.corners.take(_FIRST, axis=1), triangles.corners.take(_SECOND, axis=1)
        h = np.sqrt(np.square(b - a).sum(axis=2, keepdims=True))
        t, median = (b - a) / h, triangles.corners - (a + b) / 2.0
        alpha = t[..., :1] * median[..., 1:] - t[..., 1:] * median[..., :1]
        beta = (median * t).sum(axis=2, keepdims=True)
        B = np.zeros((len(triangles), self.shared, self.shared))
        # positions of Φ and ∇Φ at the corners and at both ends of edges, and of N_2 … and Q_1 … of edges, by edge
        corner = 3 * np.arange(3)[:, None]
        slopes, ends = corner + np.array([1, 2]), 3 * np.array(EDGES)
        N = 9 + self.on_edge * np.arange(3)[:, None] + np.arange(self.degree - 3)
        Q = 6 + self.degree + self.on_edge * np.arange(3)[:, None] + np.arange(self.degree - 2)
        B[:, corner, corner] = 1.0
        B[:, slopes[:, :, None], slopes[:, None]] = triangles.jacobians.swapaxes(1, 2)[:, None]
        B[:, N, N], B[:, Q, Q], B[:, Q[:, 1:], N] = np.square(h), alpha * h, beta * h
        # h β N₁ in the first coefficient of Φ_em
        B[:, Q[:, :1], ends] = 6.0 * beta / h * [1.0, -1.0]
        B[:, Q[:, :1, None], ends[..., None] + np.array([1, 2])] = (3.0 * beta * t)[:, :, None]
        return B

    def reference_functions(self, barycentric: FloatArray, order: int) -> FloatArray:
        """Values, gradients or Hessians (xx, yy, xy) of the functions at points (..., 3) of the reference triangle.

        The order of differentiation is 0, 1 or 2, the shape (..., 1, 2 or 3, dimension). On lines between parts, where
        the Hessian jumps, it is the mean over the parts that meet.
        """
        points = np.asarray(barycentric, dtype=float)
        flat = points.reshape(-1, 3)
        is_in_part = flat <= flat.min(axis=1, keepdims=True) + _ON_BORDER
        weight = is_in_part / is_in_part.sum(axis=1, keepdims=True)
        functions = np.zeros((len(flat), (1, 2, 3)[order], self.dimension))
        for s, (a, b) in enumerate(EDGES):
            inside = np.flatnonzero(is_in_part[:, s])
            smallest = flat[inside, s]
            in_part = np.column_stack([flat[inside, a] - smallest, flat[inside, b] - smallest, 3.0 * smallest])
            values = bernstein(self.degree - order, in_part) @ self.derivatives[order][s]
            functions[inside] += weight[inside, s, None, None] * np.moveaxis(values, 0, 1)
        return functions.reshape(*points.shape[:-1], *functions.shape[1:])


def compliance_roots(compliances: FloatArray) -> FloatArray:
    """L lower triangular with L Lᵀ = c (n, 3, 3) positive semi-definite; a zero pivot gives a zero column."""
    roots = np.zeros_like(compliances)
    for j in range(3):
        column = compliances[:, j:, j] - (roots[:, j:, :j] @ roots[:, j, :j, None])[..., 0]
        pivot = np.sqrt(np.maximum(column[:, :1], 0.0))
        roots[:, j:, j] = np.divide(column, pivot, out=np.zeros_like(column), where=pivot > 0.0)
    return roots
