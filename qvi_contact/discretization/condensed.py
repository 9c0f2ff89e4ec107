"""Energy of triangles with their interior degrees of freedom condensed, and its root from differences.

On one triangle with the shared degrees of freedom u and the interior ones v

    ½ ∫ c(σ + φI):(σ + φI) = ½ (u, v) K (u, v) + l·(u, v) + e,   v = −K_vv⁻¹ (K_vu u + l_v) at the least

which leaves ½ uᵀSu + s·u + e'. An affine function adds nothing to it: with the differences w of u to the affine
function that has the value and gradient of the first corner,

    Φ_k − Φ₀ − (x_k − x₀)·∇Φ₀,   ∇Φ_k − ∇Φ₀   in the corners k = 1, 2,   and the coefficients on edges,

it is ½ |U w + U⁻ᵀs|² + rest, where UᵀU are the rows and columns of S behind the third. Nothing large cancels in U w,
however small the triangle is and however far away the gauge.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.curved import CurvedTriangles, Rule
from qvi_contact.element.affine import EDGES, AffineTriangles
from qvi_contact.element.hsieh_clough_tocher import HsiehCloughTocher, nearly_incompressible
from qvi_contact.element.triangle import quadrature

_AFFINE: Final = 3  # degrees of freedom of the first corner, which an affine function is made of
_LONG: Final = 10.0  # longest side over height: beyond, energies, unlike stresses, lose too many digits
_BLOCK: Final = 2**24  # entries of element matrices at a time
_EPSILON: Final = float(np.finfo(np.float64).eps) / 2.0


def potential_points(degree: int) -> tuple[FloatArray, FloatArray]:
    """Barycentric points (q, 3) and weights (q,) of sum 1 at which a body potential is taken."""
    return split_points(2 * degree - 4)


def split_points(degree: int) -> tuple[FloatArray, FloatArray]:
    """Such points for functions that are polynomials of a degree on each of the three parts of a triangle."""
    points, weights = quadrature(degree)
    centre = np.full(3, 1.0 / 3.0)
    parts = [points @ np.vstack([np.eye(3)[a], np.eye(3)[b], centre]) for a, b in EDGES]
    return np.concatenate(parts), np.tile(weights / 3.0, 3)


@dataclass(frozen=True, eq=False)
class CondensedTriangles:
    """Triangles of one element, each with its energy in shared degrees of freedom, dimensionless.

    Attributes
    ----------
    roots : (n, k, k) array
        U: upper triangular, times the transformation to the reference triangle; k differences w.
    constants : (n, k) array
        U⁻ᵀ s.
    rests : (n,) array
        The energy that no degree of freedom changes.
    inner : (n, interior, k) array
        −K_vv⁻¹ K_vu, from the degrees of freedom of the reference triangle behind the third; from differences w where
        triangles have arcs.
    shifts : (n, interior) array
        −K_vv⁻¹ l_v.

    """

    roots: FloatArray
    constants: FloatArray
    rests: FloatArray
    inner: FloatArray
    shifts: FloatArray

    @classmethod
    def of(
        cls,
        element: HsiehCloughTocher,
        triangles: AffineTriangles,
        compliances: FloatArray,
        potential: FloatArray | None,
        rule: Rule,
    ) -> "CondensedTriangles":
        """Condense triangles of compliances (n, 3, 3) and potentials (n, q) at the points of the rule, in blocks."""
        step = max(1, _BLOCK // element.dimension**2)
        blocks = [slice(start, start + step) for start in range(0, len(triangles), step)]
        parts = [
            _condensed(
                element,
                triangles.take(block),
                compliances[block],
                None if potential is None else potential[block],
                rule,
            )
            for block in blocks
        ]
        return (
            parts[0]
            if len(parts) == 1
            else cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in cls.__annotations__))
        )

    def with_arcs(
        self, curved: CurvedTriangles, compliances: FloatArray, potential: FloatArray | None, rule: Rule
    ) -> "CondensedTriangles":
        """The same with the triangles that have arcs integrated up to them; compliances (n, 3, 3), potential (n, q)."""
        names = list(type(self).__annotations__)
        found = {name: getattr(self, name).copy() for name in names}
        for block in curved.blocks(len(rule[1])):
            cells = curved.numbers[block]
            given = None if potential is None else potential[cells]
            part = _condensed_to_arcs(curved, block, compliances[cells], given, rule)
            for name in names:
                found[name][cells] = getattr(part, name)
        return CondensedTriangles(**found)

    def interior(self, shared: FloatArray, chosen: IntArray | slice = slice(None)) -> FloatArray:
        """Interior degrees of freedom (n, interior) of all or some triangles from what `inner` takes, (n, k)."""
        return np.asarray((self.inner[chosen] @ shared[:, :, None])[:, :, 0] + self.shifts[chosen])


def _condensed(
    element: HsiehCloughTocher,
    triangles: AffineTriangles,
    compliances: FloatArray,
    potential: FloatArray | None,
    rule: Rule,
) -> CondensedTriangles:
    """`CondensedTriangles.of` for one block.

    With K = RᵀR, interior degrees of freedom first, the energy is ½ |R (v, w) + R⁻ᵀl|² + e − ½ |R⁻ᵀl|².
    The least over v makes the upper part of the first term vanish.
    """
    order = _interior_first(element)
    R = _triangular(element, triangles, compliances, order)
    B = element.transformations(triangles)[:, _AFFINE:, _AFFINE:]
    loads = None if potential is None else _potential_load(element, triangles, compliances, potential, rule)
    found = _without_interior(element, R, order, loads)
    return replace(found, roots=found.roots @ B)


def _condensed_to_arcs(
    curved: CurvedTriangles, block: slice, compliances: FloatArray, potential: FloatArray | None, rule: Rule
) -> CondensedTriangles:
    """`_condensed` for a block of triangles that have arcs, whose functions are those of their degrees of freedom."""
    order = _interior_first(curved.element)
    R = np.asarray(np.linalg.qr(curved.stress_rows(block, compliances, rule)[:, :, order], mode="r"))
    loads = None if potential is None else curved.potential_load(block, compliances, potential, rule)
    return _without_interior(curved.element, R, order, loads)


def _interior_first(element: HsiehCloughTocher) -> IntArray:
    """The functions in the order in which they are condensed, those of the first corner left out."""
    return np.concatenate([np.arange(element.shared, element.dimension), np.arange(_AFFINE, element.shared)])


def _without_interior(
    element: HsiehCloughTocher, R: FloatArray, order: IntArray, loads: tuple[FloatArray, FloatArray] | None
) -> CondensedTriangles:
    """The least over the interior degrees of freedom, from R, and from l (n, dimension) and e (n,) if there are any."""
    v, w = slice(0, element.interior), slice(element.interior, None)
    residual: FloatArray = np.zeros((len(R), len(order)))
    rest: FloatArray = np.zeros(len(R))
    if loads is not None:
        load, rest = loads
        loaded = load.any(axis=1)  # φI does no work in incompressible triangles, whose R is singular
        found = np.linalg.solve(R[loaded].swapaxes(1, 2), load[loaded][:, order, None])
        residual[loaded] = found[:, :, 0]
        rest = np.maximum(rest - np.square(residual).sum(axis=1) / 2.0, 0.0)
    inner = -np.linalg.solve(R[:, v, v], np.concatenate([R[:, v, w], residual[:, v, None]], axis=2))
    return CondensedTriangles(R[:, w, w], residual[:, w], rest, inner[:, :, :-1], inner[:, :, -1])


def _triangular(
    element: HsiehCloughTocher, triangles: AffineTriangles, compliances: FloatArray, order: IntArray
) -> FloatArray:
    """R of the reference functions in that order, upper triangular, shape (n, len(order), len(order)).

    By Cholesky of the energies; by QR of stresses where small energies would be lost: in triangles that are long and
    thin, and in those that hardly resist pressure, or not at all.
    """
    small = (triangles.elongations > _LONG) | nearly_incompressible(compliances)
    R = np.empty((len(triangles), len(order), len(order)))
    energies = element.energies(triangles.take(~small), compliances[~small])[:, order[:, None], order]
    R[~small] = np.linalg.cholesky(energies).swapaxes(1, 2)
    if small.any():
        rows = element.energy_rows(triangles.take(small), compliances[small])
        R[small] = np.linalg.qr(rows[:, :, order], mode="r")
    return R


def _potential_load(
    element: HsiehCloughTocher, triangles: AffineTriangles, compliances: FloatArray, potential: FloatArray, rule: Rule
) -> tuple[FloatArray, FloatArray]:
    """∫ cφI:σ of the reference functions (n, dimension), and ½ ∫ cφI:φI (n,)."""
    points, weights = rule
    area = triangles.areas
    strain = compliances[:, :, 0] + compliances[:, :, 1]
    mapped = (triangles.stress_maps.swapaxes(1, 2) @ strain[:, :, None])[:, :, 0] * area[:, None]
    table = element.reference_functions(points, 2) * weights[:, None, None]
    load = sum(mapped[:, [a]] * (potential @ table[:, a]) for a in range(3))
    return np.asarray(load), (strain[:, 0] + strain[:, 1]) * area * (potential**2 @ weights) / 2.0


@dataclass(frozen=True, eq=False)
class Differences:
    """Degrees of freedom of a body, triangle by triangle as differences w to an affine function.

    Attributes
    ----------
    arms : (n, 2, 2) array
        From the first corner of each triangle to the others.
    dofs : (n, shared) int array
        Degrees of freedom of each triangle.
    units : (n, shared) array
        What one unit of them is: value = unit × degree of freedom.
    size : int
        Degrees of freedom of the body.
    across : (c,) int array
        Triangles whose corners count from several affine functions.
    beyond : (9 c, size) sparse array
        What is added to the values in their corners; see `Frames.beyond`.

    """

    arms: FloatArray
    dofs: IntArray
    units: FloatArray
    size: int
    across: IntArray
    beyond: sparse.csr_array

    def apply(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(Φ, Φ_x, Φ_y) in the first corner (n, 3), and the differences w (n, k), of degrees of freedom (size,).

        Φ counts from where it does at that corner.
        """
        values = self.units * u[self.dofs]
        if len(self.across):
            values[self.across, : 3 * _AFFINE] += (self.beyond @ u).reshape(-1, 3 * _AFFINE)
        affine, w = values[:, :_AFFINE], values[:, _AFFINE:]
        slope = affine[:, 1:]
        for corner in (0, 1):
            rise = (self.arms[:, corner] * slope).sum(axis=1)
            w[:, 3 * corner] = (w[:, 3 * corner] - affine[:, 0]) - rise
            w[:, 3 * corner + 1 : 3 * corner + 3] -= slope
        return affine, w

    def adjoint(self, w: FloatArray) -> FloatArray:
        """The transposed map from w (n, k) to degrees of freedom (size,)."""
        values = self.expanded(w[:, None])[:, 0]
        found = np.bincount(self.dofs.ravel(), (self.units * values).ravel(), self.size)
        if len(self.across):
            found = found + self.beyond.T @ values[self.across, : 3 * _AFFINE].ravel()
        return np.asarray(found, dtype=np.float64)

    def magnitudes(self, sizes: FloatArray) -> FloatArray:
        """`apply` with + for every −: the size (n, k) of the numbers that enter, from sizes (size,)."""
        values = self.units * sizes[self.dofs]
        values[self.across, : 3 * _AFFINE] += (abs(self.beyond) @ sizes).reshape(-1, 3 * _AFFINE)
        w = values[:, _AFFINE:].copy()
        for corner in (0, 1):
            w[:, 3 * corner] += values[:, 0] + (np.abs(self.arms[:, corner]) * values[:, 1:3]).sum(axis=1)
            w[:, 3 * corner + 1 : 3 * corner + 3] += values[:, 1:3]
        return w

    def expanded(self, rows: FloatArray, triangles: IntArray | slice = slice(None)) -> FloatArray:
        """Rows on differences (n, r, k) as rows on the values of these triangles (n, r, shared), units left out."""
        full = np.zeros((*rows.shape[:2], rows.shape[2] + _AFFINE))
        full[:, :, _AFFINE:] = rows
        for corner in (0, 1):
            value, slope = rows[:, :, [3 * corner]], rows[:, :, 3 * corner + 1 : 3 * corner + 3]
            full[:, :, 0] -= value[:, :, 0]
            full[:, :, 1:3] -= self.arms[triangles, None, corner] * value + slope
        return full

    def rows(self, roots: FloatArray) -> FloatArray:
        """R, rows (n, k, shared) on the degrees of freedom of each triangle."""
        return self.expanded(roots) * self.units[:, None, :]

    def spread(self, rows: FloatArray, triangles: IntArray | slice = slice(None)) -> sparse.csr_array:
        """Rows (n, r, shared) on the degrees of freedom of these triangles as rows of the body, (n r, size)."""
        n, r, shared = rows.shape
        columns = np.repeat(self.dofs[triangles], r, axis=0).ravel()
        return sparse.csr_array((rows.ravel(), columns, shared * np.arange(n * r + 1)), shape=(n * r, self.size))

    def rows_beyond(self, roots: FloatArray) -> sparse.csr_array:
        """What R has beside `rows` in the c triangles across parts, shape (c k, size)."""
        corners = self.expanded(roots[self.across], self.across)[:, :, : 3 * _AFFINE]
        c, k, width = corners.shape
        columns = np.repeat(np.arange(c * width).reshape(c, width), k, axis=0).ravel()
        blocks = sparse.csr_array((corners.ravel(), columns, width * np.arange(c * k + 1)), shape=(c * k, c * width))
        return sparse.csr_array(blocks @ self.beyond)


@dataclass(frozen=True, eq=False)
class TriangleRoot:
    """z ↦ r(z) = R z + r₀ with ½|r|² the strain energy: U w + U⁻ᵀs triangle by triangle, then √(2 rest).

    Attributes
    ----------
    condensed : CondensedTriangles
        The triangles.
    differences : Differences
        How their degrees of freedom are taken.
    centres : (n, 2) array
        Where they are, dimensionless.
    basis, particular
        u = basis z + particular.

    """

    condensed: CondensedTriangles
    differences: Differences
    centres: FloatArray
    basis: sparse.csr_array
    particular: FloatArray

    def apply(self, z: FloatArray) -> FloatArray:
        """r(z), shape (n (k + 1),)."""
        w = self.differences.apply(self.basis @ z + self.particular)[1]
        r = (self.condensed.roots @ w[:, :, None])[:, :, 0] + self.condensed.constants
        return np.concatenate([r.ravel(), self._rests])

    def adjoint(self, r: FloatArray) -> FloatArray:
        """Rᵀ r, shape (unknowns,)."""
        count, k = self.condensed.constants.shape
        w = (r[: count * k].reshape(count, 1, k) @ self.condensed.roots)[:, 0]
        return np.asarray(self._transposed @ self.differences.adjoint(w))

    def matrix(self) -> tuple[sparse.csr_array, FloatArray]:
        """(R with RᵀR = K, the centre of each row's triangle); the last n rows, which are zero, left out."""
        differences, k = self.differences, self.condensed.roots.shape[1]
        full = differences.spread(differences.rows(self.condensed.roots))
        if len(differences.across):
            own = (k * differences.across[:, None] + np.arange(k)).ravel()
            place = sparse.csr_array((np.ones(len(own)), (own, np.arange(len(own)))), shape=(full.shape[0], len(own)))
            full = full + place @ differences.rows_beyond(self.condensed.roots)
        return sparse.csr_array(full @ self.basis), np.repeat(self.centres, k, axis=0)

    def rounding(self, z: FloatArray) -> float:
        """Size of the error of R z that rounding of z may cause: ε ‖ |R| |z| ‖, ε = 2⁻⁵³."""
        w = self.differences.magnitudes(self._magnitudes @ np.abs(z))
        return _EPSILON * float(np.linalg.norm(np.abs(self.condensed.roots) @ w[:, :, None]))

    @cached_property
    def _rests(self) -> FloatArray:
        return np.asarray(np.sqrt(2.0 * self.condensed.rests))

    @cached_property
    def _transposed(self) -> sparse.csc_array:
        return self.basis.T

    @cached_property
    def _magnitudes(self) -> sparse.csr_array:
        return abs(self.basis)


def energy_matrix(condensed: CondensedTriangles, differences: Differences) -> sparse.csr_array:
    """K of all degrees of freedom as the sum of the triangles', shape (size, size)."""
    rows, dofs = differences.rows(condensed.roots), differences.dofs.astype(_index_type(differences.size))
    blocks = rows.swapaxes(1, 2) @ rows
    at = (np.repeat(dofs, dofs.shape[1], axis=1).ravel(), np.tile(dofs, dofs.shape[1]).ravel())
    shape = (differences.size, differences.size)
    found = sparse.coo_array((blocks.ravel(), at), shape=shape).tocsr()
    return found + _energy_beyond(rows, condensed, differences) if len(differences.across) else found


def _energy_beyond(rows: FloatArray, condensed: CondensedTriangles, differences: Differences) -> sparse.csr_array:
    """What triangles across parts add: of (R + Q)ᵀ(R + Q), with Q beside their rows R, all but RᵀR."""
    R = differences.spread(rows[differences.across], differences.across)
    Q = differences.rows_beyond(condensed.roots)
    mixed = sparse.csr_array(R.T @ Q)
    return sparse.csr_array(mixed + mixed.T + Q.T @ Q)


def _index_type(size: int) -> type[np.signedinteger[Any]]:
    """The integers that SciPy would choose for so many degrees of freedom: others it copies."""
    return np.int32 if size <= np.iinfo(np.int32).max else np.int64
