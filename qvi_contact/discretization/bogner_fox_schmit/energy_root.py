"""The energy as a square of stresses: K = RᵀR without cancellation.

An assembled K is wrong by its own rounding: entries of size h⁻² (in scaled degrees of freedom) cancel to stresses of
size one, which costs a direct solve four digits at every tenfold refinement. Stresses computed from differences of
nodal values lose nothing, so a residual computed through them tells how good a solution really is, and one or two
steps of defect correction repair it.

Along one direction a cubic p on an interval of length h has end values v₀, v₁ and, as they are stored, end slopes
g₀ = s₀ p′, g₁ = s₁ p′. With f = h/s its four parts are

    E = (v₀ + v₁)/2,   D = v₁ − v₀,   S = f₁ g₁ − f₀ g₀,   M = (f₀ g₀ − D) + (f₁ g₁ − D)

and in the polynomials P₀, …, P₃ of Legendre, orthonormal on [0, 1], with t = (x − x₀)/h

    p      = (E − S/12) P₀ + (D/2 − M/20)/√3 P₁ + S/(12√5) P₂ + M/(20√7) P₃
    h  p′  = D P₀ + S/(2√3) P₁ + M/(2√5) P₂
    h² p″  = S P₀ + √3 M P₁

Derivatives contain no E, second derivatives neither E nor D, so nothing large cancels once D, S and M are taken of
stored numbers. In a cell, σ_xx takes the parts along y first, σ_yy those along x: then what is left to be combined
across is as small as the stress itself.

In `docs/theory.md`: (D8).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final, TypeAlias

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray
from qvi_contact.element import legendre
from qvi_contact.element.bogner_fox_schmit import GAUSS_COUNT, STRESS_DERIVATIVES, Grid
from qvi_contact.element.compliance import compliance_roots
from qvi_contact.element.hermite import gauss_legendre

_BLOCK: Final = 8192  # cells at a time: their numbers stay in the cache
_EPSILON: Final = float(np.finfo(np.float64).eps) / 2.0

#: (v₀, f₀ g₀, v₁, f₁ g₁) to (E, D, S, M)
_PARTS: Final = np.array([[0.5, 0, 0.5, 0], [-1, 0, 1, 0], [0, -1, 0, 1], [2, 1, -2, 1]])
_NORMS: Final = np.sqrt(np.array([[1.0], [3], [5], [7]]))
#: (E, D, S, M) to the coefficients in P₀, …, P₃ of p, h p′ and h² p″
_VALUE: Final = np.array([[1, 0, -1 / 12, 0], [0, 1 / 2, 0, -1 / 20], [0, 0, 1 / 12, 0], [0, 0, 0, 1 / 20]]) / _NORMS
_FIRST: Final = np.array([[0, 1, 0, 0], [0, 0, 1 / 2, 0], [0, 0, 0, 1 / 2], [0, 0, 0, 0]]) / _NORMS
_SECOND: Final = np.array([[0, 0, 1, 0], [0, 0, 0, np.sqrt(3.0)], [0, 0, 0, 0], [0, 0, 0, 0]])
#: Normal stress: p across, for S and M along, (2, 4, 4); shear: factors of D, S, M along y and x, (3, 3, 1, 1)
_NORMAL: Final = np.stack([_VALUE, np.sqrt(3.0) * _VALUE])
_SHEAR: Final = np.multiply.outer(_FIRST.diagonal(1), _FIRST.diagonal(1))[..., None, None]
#: Products 4 a + b of part a along y and part b along x that carry stress: all but E E, E D and D E
_MODES: Final = np.array([4 * a + b for a in range(4) for b in range(4) if a + b > 1])
_COEFFICIENTS: Final = 41

_Parts: TypeAlias = Callable[[FloatArray, FloatArray, FloatArray], None]


def _differences(values: FloatArray, factors: FloatArray, parts: FloatArray) -> None:
    """(E,) D, S, M along the last axis, of values (2, ..., n + 1) and factors (2, n) into parts (4 or 3, ..., n)."""
    low, high = values[0][..., :-1], values[0][..., 1:]
    first, second = values[1][..., :-1] * factors[0], values[1][..., 1:] * factors[1]
    *mean, rise, bend, wave = parts
    for part in mean:
        np.add(low, high, out=part)
        part *= 0.5
    np.subtract(high, low, out=rise)
    np.subtract(second, first, out=bend)
    first -= rise
    second -= rise
    np.add(first, second, out=wave)


def _sums(values: FloatArray, factors: FloatArray, parts: FloatArray) -> None:
    """`_differences` with + for every −: the size of the numbers that enter."""
    low, high = values[0][..., :-1], values[0][..., 1:]
    *mean, rise, bend, wave = parts
    np.add(low, high, out=rise)
    np.add(values[1][..., :-1] * factors[0], values[1][..., 1:] * factors[1], out=bend)
    np.add(bend, 2.0 * rise, out=wave)
    for part in mean:
        np.multiply(rise, 0.5, out=part)


def _add_transposed(parts: FloatArray, factors: FloatArray, values: FloatArray) -> None:
    """Add the transpose of `_differences` of parts (4 or 3, ..., n) to values (2, ..., n + 1)."""
    *mean, rise, bend, wave = parts
    step = rise - 2.0 * wave
    values[0][..., :-1] -= step
    values[0][..., 1:] += step
    for part in mean:
        half = 0.5 * part
        values[0][..., :-1] += half
        values[0][..., 1:] += half
    values[1][..., :-1] += (wave - bend) * factors[0]
    values[1][..., 1:] += (wave + bend) * factors[1]


def _turned(array: FloatArray) -> FloatArray:
    """The first two axes swapped, and the last two: from parts or kinds along y to those along x, or back."""
    return array.swapaxes(0, 1).swapaxes(-1, -2)


@dataclass(frozen=True, eq=False)
class StressRoot:
    """z ↦ r(z) = R z + r₀, the stresses of all cells weighted so that ½|r|² is the strain energy.

    With U the upper Cholesky factor of a cell's compliance, c = UᵀU, r holds the coefficients of √(h_x h_y) U σ in
    products P_j(y) P_i(x) of orthonormal polynomials of Legendre: for cubic σ those of σ itself, for body forces φ
    those that 4×4 Gauss points give. They are 4×4 each of the first two components and 3×3 of the last, which is
    σ_xy alone; `_COEFFICIENTS` in all. Cells that are no part of the body have zeros. Blocks of rows of cells follow
    one another, each an array (coefficients, rows, nx).

    Attributes
    ----------
    grid : Grid
        Dimensionless grid.
    active : (ny, nx) bool array
        Cells of the body.
    compliances : (cells, 3, 3) array
        Dimensionless compliance of the active cells.
    basis, particular
        u = basis z + particular, see `Elimination`.
    potential : (cells, points) array
        Dimensionless body-force potential φ at the Gauss points of the active cells.

    """

    grid: Grid
    active: BoolArray
    compliances: FloatArray
    basis: sparse.csr_array
    particular: FloatArray
    potential: FloatArray

    def apply(self, z: FloatArray) -> FloatArray:
        """r(z), shape (`_COEFFICIENTS` · all cells,)."""
        r = self._weighted(self.basis @ z + self.particular)
        if self._constant is not None:
            for rows, (first, second, _) in self._blocks(r):
                first += self._constant[0][:, :, rows]
                second += self._constant[1][:, :, rows]
        return r

    def adjoint(self, r: FloatArray) -> FloatArray:
        """Rᵀ r, shape (n,)."""
        ny, nx = self.active.shape
        planes = np.zeros((2, 2, ny + 1, nx + 1))
        for rows, block in self._blocks(r):
            self._add_block(rows, block, planes[:, :, rows.start : rows.stop + 1])
        return np.asarray(self._transposed @ planes.transpose(2, 3, 0, 1).ravel())

    def rounding(self, z: FloatArray) -> float:
        """Size of the error of R z that rounding of z may cause: ε ‖ |R| |z| ‖, ε = 2⁻⁵³.

        R stands for its factors here: magnitudes are added wherever `apply` adds or subtracts.
        """
        sizes = abs(self.basis) @ np.abs(z)
        return _EPSILON * float(np.linalg.norm(self._weighted(sizes, magnitudes=True)))

    def matrix(self) -> tuple[sparse.csr_array, FloatArray]:
        """R with RᵀR = K as a matrix, in thirteen orthonormal stress modes a cell, and its rows' places.

        The stresses of a cell are linear, σ = C m, in thirteen products m of parts along x and y, which hold no
        cancellation. With C = Q L, L upper triangular, the rows are L m: |L m| = |C m|. Entries of R are rounded, so
        that R z is off by ε |R| |z|; `apply` is more accurate.

        Returns
        -------
        R : (13 cells, n) sparse array
            In the unknowns z; active cells only.
        places : (13 cells, 2) array
            Column and row of each row's cell.

        """
        row, column = np.nonzero(self.active)
        shapes = np.stack([np.kron(_SECOND, _VALUE), np.kron(_VALUE, _SECOND), np.kron(_FIRST, _FIRST)])[:, :, _MODES]
        weighted = np.einsum("klc,lgm->ckgm", self._weights[..., row, column], shapes)
        upper = np.linalg.qr(weighted.reshape(len(row), -1, len(_MODES)), mode="r")
        parts = np.kron(_PARTS, _PARTS)[_MODES].reshape(-1, 2, 2, 2, 2)  # (mode, b, r, a, p)
        entries = (upper @ parts.transpose(0, 1, 3, 2, 4).reshape(-1, 16)) * self._slope_factors()[:, None, :]
        columns = np.repeat(self.grid.cell_dofs(column, row), len(_MODES), axis=0)
        shape = (len(columns), len(self.particular))
        full = sparse.csr_array((entries.ravel(), columns.ravel(), 16 * np.arange(len(columns) + 1)), shape=shape)
        places = np.repeat(np.column_stack([column, row]), len(_MODES), axis=0).astype(float)
        return sparse.csr_array(full @ self.basis), places

    @cached_property
    def _factors(self) -> tuple[FloatArray, FloatArray]:
        """Ratios f = h/s at the two ends of each interval along x and along y, shapes (2, nx) and (2, ny)."""
        x, y = (np.ascontiguousarray((line.sizes[:, None] / line.end_scales).T) for line in (self.grid.x, self.grid.y))
        return x, y

    def _slope_factors(self) -> FloatArray:
        """Factors that turn stored values into (Φ, h_x Φ_x, h_y Φ_y, h_x h_y Φ_xy) of active cells, (cells, 16)."""
        row, column = np.nonzero(self.active)
        in_x, in_y = (np.stack([np.ones_like(f), f], axis=-1) for f in self._factors)
        return np.asarray(np.einsum("acp,bcr->cbarp", in_x[:, column], in_y[:, row])).reshape(-1, 16)

    def _cell_roots(self) -> tuple[FloatArray, FloatArray]:
        """√(h_x h_y) U, shape (3, 3, ny, nx), zero outside the body; ±1/(h_x^i h_y^j) of each component (3, ny, nx)."""
        h_x, h_y = self.grid.x.sizes, self.grid.y.sizes[:, None]
        roots = np.zeros((3, 3, *self.active.shape))
        roots[:, :, self.active] = np.moveaxis(compliance_roots(self.compliances), 0, -1).swapaxes(0, 1)
        roots *= np.sqrt(h_x * h_y)
        return roots, np.stack([sign / (h_x**i * h_y**j) for i, j, sign in STRESS_DERIVATIVES])

    @cached_property
    def _weights(self) -> FloatArray:
        """Factors of derivatives with respect to (t_x, t_y) in each component of √(h_x h_y) U σ, (3, 3, ny, nx)."""
        roots, derivatives = self._cell_roots()
        return np.asarray(roots * derivatives)

    @cached_property
    def _coupled(self) -> bool:
        """Whether the compliance of any cell couples shear with normal stress."""
        return bool(self._weights[:2, 2].any())

    @cached_property
    def _constant(self) -> FloatArray | None:
        """What φ adds to the first two components of r, shape (2, 4, 4, ny, nx); None without body forces."""
        if not self.potential.any():
            return None
        t, w = gauss_legendre(GAUSS_COUNT)
        degrees = np.arange(GAUSS_COUNT)
        orthonormal = legendre.basis(GAUSS_COUNT - 1, t) * np.sqrt(2 * degrees + 1)
        transform = (orthonormal * w[:, None]).T
        coefficients = np.zeros((GAUSS_COUNT, GAUSS_COUNT, *self.active.shape))
        at_points = self.potential.reshape(-1, GAUSS_COUNT, GAUSS_COUNT)
        coefficients[:, :, self.active] = np.moveaxis(transform @ at_points @ transform.T, 0, -1)
        roots, _ = self._cell_roots()
        return np.stack([(roots[0, 0] + roots[0, 1]) * coefficients, roots[1, 1] * coefficients])

    @cached_property
    def _transposed(self) -> sparse.csc_array:
        return self.basis.T

    def _blocks(self, r: FloatArray) -> Iterator[tuple[slice, tuple[FloatArray, FloatArray, FloatArray]]]:
        """Rows of cells and the part of r that belongs to them: three components (4, 4 | 4, 4 | 3, 3, rows, nx)."""
        ny, nx = self.active.shape
        step = max(1, _BLOCK // nx)
        for start in range(0, ny, step):
            stop = min(start + step, ny)
            block = r[_COEFFICIENTS * nx * start : _COEFFICIENTS * nx * stop].reshape(-1, stop - start, nx)
            first, second = block[:32].reshape(2, 4, 4, -1, nx)
            yield slice(start, stop), (first, second, block[32:].reshape(3, 3, -1, nx))

    def _weighted(self, u: FloatArray, *, magnitudes: bool = False) -> FloatArray:
        """R without the basis applied to u, shape (`_COEFFICIENTS` · all cells,); all signs taken as + if asked."""
        ny, nx = self.active.shape
        planes = np.ascontiguousarray(u.reshape(ny + 1, nx + 1, 2, 2).transpose(2, 3, 0, 1))
        r = np.empty(_COEFFICIENTS * ny * nx)
        for rows, (first, second, third) in self._blocks(r):
            nodes, weights = planes[:, :, rows.start : rows.stop + 1], self._weights[:, :, rows]
            if magnitudes:
                xx, yy, xy = self._derivatives(rows, nodes, _sums, np.abs(_NORMAL))
                weights = np.abs(weights)
            else:
                xx, yy, xy = self._derivatives(rows, nodes, _differences, _NORMAL)
            first[2:], second[:, 2:] = 0.0, 0.0
            np.multiply(weights[0, 0], xx, out=first[:2])
            first[:, :2] += weights[0, 1] * yy
            np.multiply(weights[1, 1], yy, out=second[:, :2])
            np.multiply(weights[2, 2], xy, out=third)
            if self._coupled:
                first[:3, :3] += weights[0, 2] * xy
                second[:3, :3] += weights[1, 2] * xy
        return r

    def _derivatives(
        self, rows: slice, nodes: FloatArray, parts: _Parts, normal: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coefficients of Φ_yy, Φ_xx, Φ_xy with respect to (t_x, t_y) in rows of cells.

        Parameters
        ----------
        rows : slice
            The rows of cells.
        nodes : (2, 2, rows + 1, nx + 1) array
            Stored values by kind along y and along x.
        parts : function
            `_differences` or `_sums`.
        normal : (2, 4, 4) array
            From the parts of Φ across, for S and M along, to coefficients.

        Returns
        -------
        Arrays (2, 4 | 4, 2 | 3, 3, rows, nx): coefficients of P_j(y) P_i(x).

        """
        in_x, in_y = self._factors[0], self._factors[1][:, rows]
        count, nx = nodes.shape[2] - 1, nodes.shape[3] - 1
        along_y, both = np.empty((3, 2, count, nx + 1)), np.empty((3, 4, count, nx))  # D, S, M along y; both: and x
        parts(nodes.swapaxes(-1, -2), in_y, along_y.swapaxes(-1, -2))
        parts(along_y.swapaxes(0, 1), in_x, both.swapaxes(0, 1))
        along_x, turned = np.empty((3, 2, count + 1, nx)), np.empty((2, 4, count, nx))  # S, M along x, all along y
        parts(nodes.swapaxes(0, 1), in_x, along_x)
        parts(_turned(along_x[1:]), in_y, _turned(turned))
        xx = (normal @ both[1:].reshape(2, 4, -1)).reshape(turned.shape)
        yy = (normal @ turned.reshape(2, 4, -1)).reshape(turned.shape)
        return xx, yy.swapaxes(0, 1), both[:, 1:] * _SHEAR

    def _add_block(self, rows: slice, block: tuple[FloatArray, FloatArray, FloatArray], nodes: FloatArray) -> None:
        """Add the transpose of `_weighted` in rows of cells to nodes, see `_derivatives`."""
        first, second, third = block
        weights, in_x, in_y = self._weights[:, :, rows], self._factors[0], self._factors[1][:, rows]
        count, nx = nodes.shape[2] - 1, nodes.shape[3] - 1
        back = _NORMAL.swapaxes(1, 2)
        xx = (weights[0, 0] * first[:2]).reshape(2, 4, -1)
        yy = (weights[0, 1] * first[:, :2] + weights[1, 1] * second[:, :2]).swapaxes(0, 1).reshape(2, 4, -1)
        xy = weights[2, 2] * third
        if self._coupled:
            xy += weights[0, 2] * first[:3, :3] + weights[1, 2] * second[:3, :3]
        both = np.zeros((3, 4, count, nx))
        both[1:] = (back @ xx).reshape(2, 4, count, nx)
        both[:, 1:] += xy * _SHEAR
        along_y = np.zeros((3, 2, count, nx + 1))
        _add_transposed(both.swapaxes(0, 1), in_x, along_y.swapaxes(0, 1))
        _add_transposed(along_y.swapaxes(-1, -2), in_y, nodes.swapaxes(-1, -2))
        turned, along_x = (back @ yy).reshape(2, 4, count, nx), np.zeros((3, 2, count + 1, nx))
        _add_transposed(_turned(turned), in_y, _turned(along_x[1:]))
        _add_transposed(along_x, in_x, nodes.swapaxes(0, 1))
