"""K = RᵀR eliminated without forming K, where K has lost to rounding what R still holds.

The augmented system [−1 R; Rᵀ 0] of the rows r = R x and the unknowns x has the condition of R, the square root of
that of K = RᵀR. Its stable elimination is the orthogonal one: multifrontal QR by nested dissection with dense fronts.
Rows are split by a binary tree of places. At each node the factors of its two halves are stacked, and

    Q [rows] = [U₁₁ U₁₂]    with the unknowns whose rows all lie below the node first.
               [ 0  U₂₂]

U₁₁ and U₁₂ stay, U₂₂ goes up. What arrives at the top is the triangular factor U of the Schur complement S = UᵀU on
the interface. The relative error of S is of order ε cond(R), with the columns of R scaled to length one; that of a
factorised K is ε cond(R)².

Sources: J. Liu, On general row merging schemes for sparse Givens transformations, SIAM J. Sci. Stat. Comput. 7 (1986);
Å. Björck, Numerical Methods for Least Squares Problems (1996), sections 2.5 and 6.6.

In `docs/theory.md`: (D9).
"""

from functools import cached_property
from time import perf_counter
from typing import Final

import numpy as np
from scipy import __version__ as scipy_version
from scipy.linalg import lapack
from scipy.sparse import csr_array, diags_array

from solvers.basics.types import BoolVector, IntVector, Matrix, SparseRows, Vector
from solvers.errors import InputError
from solvers.factorisation.base import FactorisationError, Front, Fronts, limited_blas

ORTHOGONAL: Final = "qr"
"""Name of this back end."""

LEAF_ROWS: Final = 256
"""Rows that are no longer split."""

_EPSILON: Final = float(np.finfo(np.float64).eps) / 2.0
_BLOCK: Final = 32  # of LAPACK's QR
_POWER_STEPS: Final = 4
_DEPENDENT: Final = 0.1  # `rounding` above which columns count as dependent: a copied column has 1 to 10


class OrthogonalFactor(Fronts):
    """RᵀR with its interior eliminated by QR of R.

    Attributes
    ----------
    schur_root : Matrix (k, k)
        U, upper triangular, with S = UᵀU; more accurate than S where S is badly scaled.
    rounding : float
        4 ε / σ_min(R), columns of R scaled to length one: how wrong a solution may be, relative, in the energy norm
        |R x|, and the factor that a defect correction shrinks the error by. S is usually far more accurate. Above 0.1
        the columns of R are dependent as far as double precision can tell, which is refused.

    """

    backend = ORTHOGONAL

    def __init__(self, R: SparseRows, interface: IntVector, places: Matrix) -> None:
        """Use `factorise_root`, which checks its arguments."""
        start = perf_counter()
        self.version = f"scipy {scipy_version}"
        self.interface, self.size = interface, int(R.shape[1])
        self._scale = np.sqrt(np.asarray(R.multiply(R).sum(axis=0)).ravel())
        if not np.all(self._scale > 0.0):
            raise FactorisationError("singular", self.backend, f"column {int(np.argmin(self._scale))} of R is zero")
        tree = _Tree(csr_array(R @ diags_array(1.0 / self._scale)), interface, places)
        analysed = perf_counter()
        with limited_blas(1):
            fronts, columns, top = tree.eliminated()
            root = _triangle(top[:, np.argsort(columns)])
        _check(root, self.backend)
        self._fronts = [
            Front(
                own, others, np.asfortranarray(head * self._scale[own]), np.asfortranarray(tail * self._scale[others])
            )
            for own, others, head, tail in fronts
        ]
        self.schur_root = np.asarray(root * self._scale[interface])
        self.schur = np.asarray(self.schur_root.T @ self.schur_root)
        if not self.rounding <= _DEPENDENT:
            wrong = "columns of R are dependent up to rounding: a solution would be wrong by"
            raise FactorisationError("singular", self.backend, f"{wrong} {self.rounding:.0e} of its size")
        self.seconds = {"analysis": analysed - start, "numeric": perf_counter() - analysed}

    @cached_property
    def rounding(self) -> float:
        """4 ε / σ_min(R), by inverse power iteration."""
        x: Vector = np.random.default_rng(0).normal(size=self.size)
        growth = 1.0
        for _ in range(_POWER_STEPS if self.size else 0):
            x = np.asarray(self.solve(x * self._scale)) * self._scale
            growth = float(np.linalg.norm(x))
            x = x / growth
        return 4.0 * _EPSILON * float(np.sqrt(growth))

    @cached_property
    def _schur_factor(self) -> tuple[Matrix, bool]:
        return self.schur_root, False


def factorise_root(R: SparseRows, interface: IntVector, places: Matrix) -> OrthogonalFactor:
    """Eliminate the interior of K = RᵀR by QR of R.

    This takes about five times as long as PARDISO's Cholesky factorisation of K. The fronts are small:
    several threads of BLAS make it slower, by orders of magnitude on a busy machine, so that it takes one where the
    package threadpoolctl is installed.

    Parameters
    ----------
    R : SparseRows (m, n)
        Full column rank.
    interface : IntVector (k,)
        Γ: indices of unknowns in increasing order, none twice.
    places : (m, d) array
        Where each row lies: rows with equal places are kept together, and only those with places side by side should
        share unknowns, a few unknowns excepted. For cells of a grid: their column and row.

    Raises
    ------
    InputError
        If shapes disagree or numbers are not finite.
    FactorisationError
        If R has linearly dependent columns, up to rounding.

    """
    if len(R.shape) != 2:
        raise InputError("R", R.shape, "give a matrix")
    R = csr_array(R).astype(np.float64, copy=False)
    if not np.isfinite(R.data).all():
        raise InputError("R", "not finite", "give finite entries")
    indices = np.asarray(interface, dtype=np.int64).reshape(-1)
    if indices.size and (np.any(np.diff(indices) <= 0) or indices[0] < 0 or indices[-1] >= R.shape[1]):
        raise InputError("interface", indices, f"give indices from 0 to {R.shape[1] - 1} in increasing order")
    points: Matrix = np.asarray(places, dtype=np.float64)
    if points.ndim != 2 or points.shape[0] != R.shape[0]:
        raise InputError("places", points.shape, f"give an array ({R.shape[0]}, d)")
    return OrthogonalFactor(R, indices, points)


class _Tree:
    """Rows split by place, and the unknowns eliminated where the last of their rows comes in."""

    def __init__(self, R: SparseRows, interface: IntVector, places: Matrix) -> None:
        self._R = R
        self._places = places
        self._entries = np.bincount(R.indices, minlength=R.shape[1])
        self._stays: BoolVector = np.zeros(R.shape[1], dtype=np.bool_)
        self._stays[interface] = True
        self._fronts: list[Front] = []

    def eliminated(self) -> tuple[list[Front], IntVector, Matrix]:
        """Fronts, parts before wholes; the interface in the order of the columns of the factor left for it."""
        columns, _, factor = self._subtree(np.arange(self._R.shape[0]))
        return self._fronts, columns, factor

    def _subtree(self, rows: IntVector) -> tuple[IntVector, IntVector, Matrix]:
        """Eliminate all that lies within the rows: columns that stay, their entries so far, and U₂₂."""
        halves = self._halves(rows) if rows.size > LEAF_ROWS else None
        if halves is None:
            columns, found, stacked = self._leaf(rows)
        else:
            first, second = (self._subtree(half) for half in halves)
            columns = np.union1d(first[0], second[0])
            found = np.zeros(columns.size, dtype=np.int64)
            stacked = np.zeros((len(first[2]) + len(second[2]), columns.size), order="F")
            start = 0
            for part, count, factor in (first, second):
                local = np.searchsorted(columns, part)
                found[local] += count
                stacked[start : start + len(factor), local] = factor
                start += len(factor)
        return self._eliminate(columns, found, stacked)

    def _leaf(self, rows: IntVector) -> tuple[IntVector, IntVector, Matrix]:
        """Columns of the rows, entries in each, and the rows as a dense matrix."""
        part = self._R[rows]
        columns, local, found = np.unique(part.indices, return_inverse=True, return_counts=True)
        dense = np.zeros((rows.size, columns.size), order="F")
        dense[np.repeat(np.arange(rows.size), np.diff(part.indptr)), local] = part.data
        return columns.astype(np.int64), found, dense

    def _eliminate(self, columns: IntVector, found: IntVector, stacked: Matrix) -> tuple[IntVector, IntVector, Matrix]:
        done = (found == self._entries[columns]) & ~self._stays[columns]
        order = np.concatenate([np.flatnonzero(done), np.flatnonzero(~done)])
        columns, found, count = columns[order], found[order], int(done.sum())
        upper = _triangle(stacked[:, order])
        head = np.asfortranarray(upper[:count, :count])
        _check(head, OrthogonalFactor.backend)
        if count:
            tail = np.asfortranarray(upper[:count, count:])
            self._fronts.append(Front(columns[:count], columns[count:], head, tail))
        return columns[count:], found[count:], upper[count:, count:]

    def _halves(self, rows: IntVector) -> tuple[IntVector, IntVector] | None:
        """The rows cut near the middle, across the direction with the most different places; None if all are alike."""
        if not self._places.shape[1]:
            return None
        steps = [np.unique(self._places[rows, d], return_counts=True) for d in range(self._places.shape[1])]
        direction = int(np.argmax([values.size for values, _ in steps]))
        values, counts = steps[direction]
        if values.size < 2:
            return None
        before = np.cumsum(counts)[:-1]
        last = values[int(np.argmin(np.abs(before - rows.size / 2.0)))]
        low = self._places[rows, direction] <= last
        return rows[low], rows[~low]


def _triangle(matrix: Matrix) -> Matrix:
    """The factor U (min(m, n), n) of matrix = Q U."""
    m, n = matrix.shape
    if not (m and n):
        return np.zeros((0, n))
    packed = lapack.dgeqrf(np.asfortranarray(matrix), lwork=_BLOCK * n, overwrite_a=1)[0]
    return np.triu(packed[: min(m, n)])


def _check(upper: Matrix, backend: str) -> None:
    """`FactorisationError` if there are fewer rows than columns or a pivot is rounding; columns had length one.

    Only what would divide by nothing is caught here: whether columns are dependent, no single pivot tells.
    """
    if not upper.shape[1]:
        return
    least = float(np.abs(upper.diagonal()).min()) if upper.shape[0] == upper.shape[1] else 0.0
    if not least > _EPSILON:
        raise FactorisationError("singular", backend, f"pivot {least:.1e} of its column of R")
