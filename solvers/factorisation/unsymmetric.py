"""H = L U of unsymmetric matrices that share one symmetric pattern, as Newton's method meets them.

PARDISO orders and analyses once. Where MKL is not installed SuperLU does all of it every time, but for an order that is
given.
"""

from typing import Literal, Protocol, TypeAlias

import numpy as np
import scipy
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu

from solvers.basics.types import IntVector, Module, Vector, load
from solvers.factorisation.base import FactorisationError

_Ordering: TypeAlias = Literal["MMD_AT_PLUS_A", "NATURAL"]

_THRESHOLD = 1e-3  # a pivot on the diagonal may be so much smaller than the largest of its column


class Refactorisation(Protocol):
    """One matrix after the other.

    Attributes
    ----------
    backend, version : name in `BACKENDS`, and the library with its version

    """

    backend: str
    version: str

    def factorise(self, values: Vector) -> None:
        """Factorise H, its entries row by row; solves are by this matrix from now on.

        Raises `FactorisationError` where H is singular.
        """
        ...

    def solve(self, right: Vector) -> Vector:
        """H⁻¹ right (n,)."""
        ...

    def release(self) -> None:
        """Free the memory; may be called again."""
        ...


def refactorisation(
    starts: IntVector,
    columns: IntVector,
    backend: str = "superlu",
    threads: int | None = None,
    order: IntVector | None = None,
) -> Refactorisation:
    """For matrices of a symmetric pattern in compressed rows with sorted columns; "pardiso" or "superlu".

    `order` is a permutation of the unknowns, in which they are eliminated; by default the library looks for one.
    """
    if backend == "pardiso":
        module: Module = load("solvers.factorisation.pardiso")
        return module.Refactorised(starts, columns, threads, order)  # type: ignore[no-any-return]
    return _BySuperLU(starts, columns) if order is None else _Reordered(starts, columns, order)


class _BySuperLU:
    """Pivots on the diagonal as long as they are large enough; one thread."""

    backend = "superlu"

    def __init__(self, starts: IntVector, columns: IntVector, ordering: _Ordering = "MMD_AT_PLUS_A") -> None:
        self.version = f"scipy {scipy.__version__}"
        self._starts, self._columns, self._ordering = starts, columns, ordering
        self._factor: Module = None

    def factorise(self, values: Vector) -> None:
        """See `Refactorisation`; rows of H are columns of its transpose."""
        size = len(self._starts) - 1
        transposed = csc_array((values, self._columns, self._starts), (size, size))
        try:
            self._factor = splu(transposed, self._ordering, _THRESHOLD, options={"SymmetricMode": True})
        except RuntimeError as error:
            raise FactorisationError("singular", self.backend, str(error)) from error

    def solve(self, right: Vector) -> Vector:
        """See `Refactorisation`."""
        if self._factor is None:
            raise FactorisationError("backend", self.backend, "there are no factors, or they have been released")
        return np.asarray(self._factor.solve(right, "T"))

    def release(self) -> None:
        """See `Refactorisation`."""
        self._factor = None


class _Reordered(_BySuperLU):
    """The same with unknowns in an order that is given, in which SuperLU leaves them."""

    def __init__(self, starts: IntVector, columns: IntVector, order: IntVector) -> None:
        numbers = np.arange(len(columns))
        moved = csr_array((numbers, columns, starts), (len(order), len(order)))[order][:, order]
        moved.sort_indices()
        super().__init__(moved.indptr.astype(np.int64), moved.indices.astype(np.int64), "NATURAL")
        self._order, self._entries = order, moved.data

    def factorise(self, values: Vector) -> None:
        """See `Refactorisation`."""
        super().factorise(values[self._entries])

    def solve(self, right: Vector) -> Vector:
        """See `Refactorisation`."""
        found = np.empty_like(right)
        found[self._order] = super().solve(right[self._order])
        return found
