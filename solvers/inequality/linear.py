"""The equality-constrained linear system of (D2), its interior eliminated once by a sparse factorisation."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import eigh
from scipy.linalg.lapack import dpotrf, dpotrs
from scipy.sparse import csc_array, csr_array

from solvers.basics.types import IntVector, Matrix, Sparse, Vector
from solvers.factorisation import Factorisation, FactorisationError
from solvers.inequality.rows import Rows, are_few, dense, stored, transposed

_REFINEMENTS = 2  # of the dense system, where there are equality rows
_DEPENDENT = 1e-12  # directions in which equality rows are weaker than this repeat each other


class EqualitySystem:
    """Solves  [K Aᵀ; A 0] (x, ν) = (r, c).

    Unknowns Γ, those that equality rows A touch and in most cases those of contact rows B too, are kept, the others
    eliminated by the factorisation; what is left is dense:

        [S A_Γᵀ; A_Γ 0] (x_Γ, ν) = (r_Γ − K_ΓI K_II⁻¹ r_I, c),    S = K_ΓΓ − K_ΓI K_II⁻¹ K_IΓ.

    K is (n, n), positive definite on the null space of A; A is (p, n), p = 0 allowed. Linearly dependent but
    consistent rows of A are accepted; ν is then the one of least norm.

    Parameters
    ----------
    A : as in `FrictionQVI`
    factor : a factorisation of K whose interface Γ holds all unknowns that equality rows touch. What is done with
        contact rows on Γ alone needs theirs too

    """

    def __init__(self, A: Sparse, factor: Factorisation) -> None:
        self.A = A
        self.factor = factor
        self.interface: IntVector = self.factor.interface
        self.A_interface: Matrix = np.asarray(dense(self.near(A))) if A.shape[0] else np.zeros((0, len(self.interface)))

    def near(self, rows: Sparse | Matrix) -> Rows:
        """Columns Γ (j, k) of rows (j, n), the same arrays where there are no entries in others, as in contact rows."""
        if isinstance(rows, np.ndarray) or are_few(*rows.shape):
            return (rows if isinstance(rows, np.ndarray) else rows.toarray())[:, self.interface]
        if self._goes_beyond(rows):
            return stored(rows[:, self.interface])
        starts = np.append(rows.indptr[self.interface], rows.indptr[-1])
        return stored(csc_array((rows.data, rows.indices, starts), (rows.shape[0], len(self.interface))))

    @property
    def schur(self) -> Matrix:
        """S (k, k)."""
        return self.factor.schur

    def solve(self, r: Vector | Matrix, c: Vector | Matrix | None = None) -> tuple[Vector, Vector]:
        """(x, ν) for right-hand sides r (n,) or (n, j) and c (p,) or (p, j), zero if not given."""
        reduced, state = self.factor.reduce(r)
        values, nu = self.solve_interface(reduced, c)
        return self.factor.expand(state, values), nu

    def square(self, r: Vector, c: Vector) -> float:
        """xᵀK x of the solution for r (n,) and c (p,), at half the cost of the solution itself."""
        reduced, state = self.factor.reduce(r)
        values, nu = self.solve_interface(reduced, c)
        return abs(self.factor.square(r, state) + float(values @ reduced - nu @ c))

    def solve_interface(self, g: Vector | Matrix, c: Vector | Matrix | None = None) -> tuple[Vector, Vector]:
        """(x_Γ, ν) of the dense system for g (k,) or (k, j), the right-hand side where it vanishes elsewhere."""
        if c is None:
            c = np.zeros((self.A.shape[0], *g.shape[1:]))
        return self._dense.solve(np.asarray(g), np.asarray(c))

    def relief(self, rows: Sparse | Matrix, *, often: bool = False) -> Callable[[Vector], Vector]:
        """The map m → R x of the solution for r = Rᵀm and c = 0, for rows R (j, n): what forces m relieve in R x.

        By the dense system alone where Γ holds all unknowns that the rows touch; for a few dense rows, if it is asked
        for often, by the matrix of the map.
        """
        if self._goes_beyond(rows):
            across = csr_array(rows)
            return lambda m: np.asarray(across @ self.solve(across.T @ m)[0])
        near = self.near(rows)
        columns = transposed(near)
        if often and isinstance(near, np.ndarray):
            matrix = np.asarray(near @ self.solve_interface(near.T)[0])
            return lambda m: np.asarray(matrix @ m)
        return lambda m: np.asarray(near @ self.solve_interface(columns @ m)[0])

    def _goes_beyond(self, rows: Sparse | Matrix) -> bool:
        """Whether rows (j, n) have entries off Γ."""
        if isinstance(rows, np.ndarray):
            return bool(np.count_nonzero(rows[:, self.interface]) < np.count_nonzero(rows))
        return int(np.diff(rows.indptr)[self.interface].sum()) < rows.nnz

    @cached_property
    def _dense(self) -> "_DenseSystem":
        return _DenseSystem.of(self.schur, self.A_interface)


@dataclass(frozen=True, eq=False)
class _DenseSystem:
    """[S Aᵀ; A 0] by Cholesky of S + ρ AᵀA, which changes neither x nor ν if ρ Aᵀc is added to the right-hand side."""

    S: Matrix
    A: Matrix
    rho: float
    cholesky: Matrix
    relief: Matrix  # (S + ρ AᵀA)⁻¹ Aᵀ
    values: Vector
    vectors: Matrix  # eigenvectors of A relief that are not null

    @classmethod
    def of(cls, S: Matrix, A: Matrix) -> "_DenseSystem":
        rho, stiffened = 0.0, S
        if len(A):
            square = A.T @ A
            rho = float(np.trace(S) / max(np.trace(square), np.finfo(float).tiny)) if len(S) else 0.0
            stiffened = S + rho * square
        cholesky = stiffened
        if len(S):
            cholesky, info = dpotrf(stiffened, lower=1, clean=0)
            if info:
                raise FactorisationError("singular", "lapack", "the Schur complement is not positive definite")
        relief = A.T
        values, vectors = np.zeros(0), np.zeros((0, 0))
        if len(A):
            relief = dpotrs(cholesky, A.T, lower=1)[0] if len(S) else A.T
            values, vectors = eigh(A @ relief)
        kept = values > _DEPENDENT * values.max(initial=0.0)
        return cls(S, A, rho, cholesky, relief, values[kept], vectors[:, kept])

    def solve(self, g: Vector | Matrix, c: Vector | Matrix) -> tuple[Vector, Vector]:
        if not len(self.A):
            return self._inverse(g), c
        x, nu = self._solve(g, c)
        for _ in range(_REFINEMENTS):
            dx, dnu = self._solve(g - self.S @ x - self.A.T @ nu, c - self.A @ x)
            x, nu = x + dx, nu + dnu
        return x, nu

    def _solve(self, g: Vector | Matrix, c: Vector | Matrix) -> tuple[Vector, Vector]:
        x = self._inverse(g + self.rho * self.A.T @ c)
        weights = self.vectors.T @ (self.A @ x - c)
        nu = self.vectors @ (weights / (self.values if g.ndim == 1 else self.values[:, None]))
        return x - self.relief @ nu, nu

    def _inverse(self, g: Vector | Matrix) -> Vector | Matrix:
        """(S + ρ AᵀA)⁻¹ g; SciPy's `cho_solve` would take longer for its arguments than for small systems."""
        return np.asarray(dpotrs(self.cholesky, g, lower=1)[0]) if g.size else g


def interface_of(contact_rows: Sparse, A: Sparse) -> IntVector:
    """Γ: the columns in which contact or equality rows have an entry, sorted."""
    return np.union1d(columns_of(contact_rows), columns_of(A))


def columns_of(matrix: Sparse) -> IntVector:
    """The columns in which a matrix has an entry, sorted."""
    columns = matrix if matrix.format == "csc" else csc_array(matrix)
    return np.flatnonzero(np.diff(columns.indptr)).astype(np.int64)
