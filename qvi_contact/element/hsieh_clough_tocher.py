"""The Hsieh-Clough-Tocher family of degree p ≥ 3: C1 and piecewise polynomial on triangles split at their barycentre.

Douglas, Dupont, Percell and Scott (1979). A triangle holds 3 (p² − p + 2) / 2 functions. What it shares with others are

    at each corner    Φ, Φ_x, Φ_y
    on each edge      N_k, k = 2 … p − 2, and Q_k, k = 1 … p − 2

the coefficients of Legendre, Σ c_k P_k(2s/h − 1), of Φ_tt = σ_N and of Φ_tn along the edge of length h, run through
from its corner of lower number to that of higher one with tangent t and normal n = (−t_y, t_x). They are the tractions
themselves, and each degree adds to those of the degree below. The coefficients left out follow from the corners a and b
of the edge:

    h N₀ = t·(∇Φ_b − ∇Φ_a),   h Q₀ = n·(∇Φ_b − ∇Φ_a),   h² N₁ = 3 h t·(∇Φ_a + ∇Φ_b) − 6 (Φ_b − Φ_a)

Since the split is affine invariant, the space is built once, on an equilateral triangle, as the null space of the jumps
between its three parts. Functions of corners and edges have the least ∫|∇∇Φ|² there, the interior ones are
orthonormal in it.
"""

from functools import cache, cached_property
from typing import Final

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.element.edge import gauss_legendre, legendre_from_values
from qvi_contact.element.triangle import CORNERS, EDGES, AffineTriangles, bernstein, exponents, gradient, quadrature
from qvi_contact.errors import InputError

LOWEST, HIGHEST = 3, 12
"""Degrees that are offered; at the highest rounding leaves twelve digits."""

_FIRST, _SECOND = np.transpose(EDGES)  # corners at the ends of each edge
_FROBENIUS: Final = np.array([1.0, 1.0, 2.0])  # |∇∇Φ|² = Φ_xx² + Φ_yy² + 2 Φ_xy²
_NEARLY: Final = 1e-4  # of c_11: a resistance to pressure below which Cholesky's root of an energy loses digits
_LONG: Final = 10.0  # longest side over height: beyond, energies, unlike stresses, lose too many digits
_TOGETHER: Final = 1e-10  # difference of barycentric coordinates that is rounding: parts meet there
_AREA: Final = np.sqrt(0.75) / 2.0  # of the reference triangle


@cache
def hsieh_clough_tocher(degree: int) -> "HsiehCloughTocher":
    """The element of a degree, made once; `InputError` for a degree that is not offered."""
    if isinstance(degree, bool) or not isinstance(degree, (int, np.integer)) or not LOWEST <= degree <= HIGHEST:
        raise InputError("degree", degree, f"give a whole number from {LOWEST} to {HIGHEST}")
    return HsiehCloughTocher(int(degree))


class HsiehCloughTocher:
    """The element of one degree; `hsieh_clough_tocher` makes it once.

    Local functions are those of corner 0, 1, 2 (three each), of edge 0, 1, 2 (see `EDGES`; N_2 … N_(p−2), then
    Q_1 … Q_(p−2)), then the interior ones. On a triangle the first `shared` belong to the degrees of freedom of the
    triangle itself, the interior ones are images of those on the reference triangle.
    """

    def __init__(self, degree: int) -> None:
        self.degree, self.traction_degree = degree, degree - 2  # of Φ: p; of σ_N and σ_T on an edge
        self.dimension = 3 * (degree**2 - degree + 2) // 2  # number of functions
        self.on_edge = 2 * degree - 5  # of those of one edge, of all edges and corners, and of interior ones
        self.shared = 9 + 3 * self.on_edge
        self.interior = self.dimension - self.shared
        # the order in which functions are condensed, those of the first corner, an affine function, left out
        self.interior_first = np.concatenate([np.arange(self.shared, self.dimension), np.arange(3, self.shared)])
        # from coefficients of each part to those of the gradient (3, 2, …, count) and Hessian (3, 3, …, count)
        gradients, hessians, centre = [], [], CORNERS.mean(axis=0)
        for edge in EDGES:
            slopes = np.linalg.inv(np.column_stack([np.vstack([CORNERS[list(edge)], centre]), np.ones(3)]))[:2].T
            x, y = gradient(degree, slopes), gradient(degree - 1, slopes)  # slopes of the barycentric coordinates
            gradients.append(x)
            hessians.append([y[0] @ x[0], y[1] @ x[1], y[0] @ x[1]])
        self._gradients, self._hessians = np.array(gradients), np.array(hessians)
        # Bernstein coefficients on the reference triangle (3, count, dimension), part by part: part s holds edge s and
        # has the corners of `EDGES[s]` and the barycentre
        self.coefficients = self._dual_basis(self._smooth_functions())
        self._weighted_hessians = self._weighted(self.coefficients)

    def _smooth_functions(self) -> FloatArray:
        """An orthonormal basis of the C1 functions among the piecewise polynomials, shape (3, count, dimension)."""
        p = self.degree
        count = len(exponents(p))
        rows = []
        for v in range(3):  # on the line to the barycentre Φ and its gradient have the same coefficients in both parts
            first, second = (s for s in range(3) if s != v)
            jumps = np.zeros((3 * p + 1, 3, count))
            for s, sign in ((first, 1.0), (second, -1.0)):
                along, lower = (exponents(d)[:, 1 - EDGES[s].index(v)] == 0 for d in (p, p - 1))
                jumps[: p + 1, s] = sign * np.eye(count)[along]
                jumps[p + 1 :, s] = sign * self._gradients[s][:, lower].reshape(-1, count)
            rows.append(jumps.reshape(len(jumps), -1))
        _, _, right = np.linalg.svd(np.vstack(rows))
        return np.asarray(right[3 * count - self.dimension :].T.reshape(3, count, self.dimension))

    def _functionals(self) -> FloatArray:
        """Degrees of freedom as rows on coefficients (shared, 3, count); edges e with medians m have Φ_ee and Φ_em."""
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
            stretched = e[0] ** 2 * xx + e[1] ** 2 * yy + 2.0 * e[0] * e[1] * xy
            mixed = e[0] * m[0] * xx + e[1] * m[1] * yy + (e[0] * m[1] + e[1] * m[0]) * xy
            start = 9 + s * self.on_edge
            rows[start : start + self.on_edge, s] = np.vstack([stretched[2:], mixed[1:]])
        return rows

    def _dual_basis(self, smooth: FloatArray) -> FloatArray:
        """The functions: dual to the functionals with least energy, then energy-orthonormal ones without any."""
        flat = smooth.reshape(-1, self.dimension)
        functionals = self._functionals().reshape(self.shared, -1) @ flat
        stresses = (np.sqrt(_FROBENIUS)[:, None, None] * self._weighted(smooth)).reshape(-1, self.dimension)
        dual, null = np.linalg.pinv(functionals), np.linalg.svd(functionals)[2][self.shared :].T
        orthogonal, triangular = np.linalg.qr(stresses @ null)
        dual = dual - null @ np.linalg.solve(triangular, orthogonal.T @ (stresses @ dual))
        inner = np.linalg.solve(triangular.T, null.T).T
        functions = np.hstack([dual, inner])
        for _ in range(2):  # what rounding left of the functionals, 1e-13, is taken off
            functions = functions - dual @ (functionals @ functions - np.eye(self.shared, self.dimension))
        return np.asarray(flat @ functions).reshape(smooth.shape)

    @cached_property
    def derivatives(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Bernstein coefficients of values, gradients and Hessians, (part, component, count, dimension) each."""
        functions = self.coefficients[:, None]
        return functions, self._gradients @ functions, self._hessians @ functions

    def _weighted(self, functions: FloatArray) -> FloatArray:
        """(xx, yy, xy) of functions at quadrature points of the reference triangle times √weight, (3, q, dimension)."""
        points, weights = quadrature(2 * self.degree - 4)
        values = bernstein(self.degree - 2, points) * np.sqrt(_AREA / 3.0 * weights)[:, None]
        found = np.moveaxis(values @ (self._hessians @ functions[:, None]), 1, 0)
        return np.asarray(found).reshape(3, -1, self.dimension)

    @cached_property
    def _energies(self) -> FloatArray:
        """∫ H_a ⊗ H_b of `interior_first` on the reference triangle for all pairs of components, (9, …)."""
        hessians = self._weighted_hessians[:, :, self.interior_first]
        return np.asarray(hessians[:, None].swapaxes(2, 3) @ hessians).reshape(9, -1)

    def roots(self, triangles: AffineTriangles, compliances: FloatArray) -> FloatArray:
        """R (n, …) upper triangular, RᵀR = ∫ c σ:τ of the reference functions `interior_first`, with c (n, 3, 3).

        By Cholesky; by QR of stresses where small energies would be lost: in triangles that are long and thin, and in
        those that hardly resist pressure, or not at all.
        """
        in_plane = compliances[:, :2, :2].sum(axis=(1, 2))  # what pressure does, beside what shear does
        soft = in_plane < _NEARLY * (compliances[:, 0, 0] + compliances[:, 1, 1])
        small, maps, order = (triangles.elongations > _LONG) | soft, triangles.stress_maps, self.interior_first
        if not small.any():
            weights = triangles.scales[:, None, None] * (maps.swapaxes(1, 2) @ compliances @ maps)
            energies = weights.reshape(-1, 9) @ self._energies
            return np.asarray(np.linalg.cholesky(energies.reshape(-1, len(order), len(order))).swapaxes(1, 2))
        R = np.empty((len(triangles), len(order), len(order)))
        R[~small] = self.roots(triangles.take(~small), compliances[~small])
        upper = compliance_roots(compliances).swapaxes(1, 2) * np.sqrt(triangles.scales)[:, None, None]
        rows = np.einsum("nab,bqd->naqd", (upper @ maps)[small], self._weighted_hessians[:, :, order])
        R[small] = np.linalg.qr(rows.reshape(len(rows), -1, len(order)), mode="r")
        return R

    def transformations(self, triangles: AffineTriangles) -> FloatArray:
        """From degrees of freedom of triangles to those of the reference triangle, shape (n, shared, shared).

        Φ_ξ = Jᵀ ∇Φ in corners. On an edge Φ_ee = h² Φ_tt and Φ_em = h (α Φ_tn + β Φ_tt) with the median's vector
        m = α n + β t, where the coefficient N₁ of Φ_tt follows from the corners.
        """
        a, b = triangles.corners.take(_FIRST, axis=1), triangles.corners.take(_SECOND, axis=1)
        h = np.sqrt(np.square(b - a).sum(axis=2, keepdims=True))
        t, median = (b - a) / h, triangles.corners - (a + b) / 2.0
        alpha = t[..., :1] * median[..., 1:] - t[..., 1:] * median[..., :1]
        beta = (median * t).sum(axis=2, keepdims=True)
        B = np.zeros((len(triangles), self.shared, self.shared))
        corner = 3 * np.arange(3)[:, None]
        slopes, ends = corner + np.array([1, 2]), 3 * np.array(EDGES)
        N = 9 + self.on_edge * np.arange(3)[:, None] + np.arange(self.degree - 3)  # edges have the numbers of corners
        Q = 6 + self.degree + self.on_edge * np.arange(3)[:, None] + np.arange(self.degree - 2)
        B[:, corner, corner], B[:, slopes[:, :, None], slopes[:, None]] = (
            1.0,
            triangles.jacobians.swapaxes(1, 2)[:, None],
        )
        B[:, N, N], B[:, Q, Q], B[:, Q[:, 1:], N] = np.square(h), alpha * h, beta * h
        B[:, Q[:, :1], ends] = 6.0 * beta / h * [1.0, -1.0]
        B[:, Q[:, :1, None], ends[..., None] + np.array([1, 2])] = (3.0 * beta * t)[:, :, None]
        return B

    def reference_functions(self, barycentric: FloatArray, order: int) -> FloatArray:
        """Values (1), gradients (2) or Hessians (3 components xx, yy, xy) on the reference triangle, by order 0, 1, 2.

        At points (..., 3), shape (..., components, dimension). Where parts meet, as at the corners, it is the mean of
        theirs: the Hessian jumps there.
        """
        at = np.asarray(barycentric, dtype=float)
        flat = at.reshape(-1, 3)
        meeting = flat <= flat.min(axis=1, keepdims=True) + _TOGETHER
        share = meeting / meeting.sum(axis=1, keepdims=True)
        found = np.zeros((len(flat), (1, 2, 3)[order], self.dimension))
        for s, (a, b) in enumerate(EDGES):
            inside = np.flatnonzero(meeting[:, s])
            low = flat[inside, s]
            local = np.column_stack([flat[inside, a] - low, flat[inside, b] - low, 3.0 * low])
            tables = bernstein(self.degree - order, local) @ self.derivatives[order][s]
            found[inside] += share[inside, s, None, None] * np.moveaxis(tables, 0, 1)
        return found.reshape(*at.shape[:-1], *found.shape[1:])


def compliance_roots(compliances: FloatArray) -> FloatArray:
    """L lower triangular with L Lᵀ = c (n, 3, 3), positive semi-definite: where a pivot is zero so is its column."""
    roots = np.zeros_like(compliances)
    for j in range(3):
        left = compliances[:, j:, j] - (roots[:, j:, :j] @ roots[:, j, :j, None])[..., 0]
        pivot = np.sqrt(np.maximum(left[:, :1], 0.0))
        roots[:, j:, j] = np.divide(left, pivot, out=np.zeros_like(left), where=pivot > 0.0)
    return roots
