"""Dense Cholesky of level sets around the interface: for matrices so small that an ordering costs more than it saves.

Unknowns are sorted by their distance from the interface Γ in the graph of K: level 0 is Γ, level j + 1 what level j
reaches in one step. K is then block tridiagonal, and eliminating the farthest level first,

    D_j = L_j L_jᵀ,   E_j = L_j⁻¹ K_j,j−1,   D_j−1 ← D_j−1 − E_jᵀ E_j,

leaves the Schur complement S = D_0. There is no ordering to be found and no symbolic factorisation, which is most of
what a sparse back end does for a few hundred unknowns; each level is three calls of LAPACK and BLAS.
"""

from itertools import pairwise
from time import perf_counter
from typing import Final

import numpy as np
from scipy import __version__ as scipy_version
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf

from solvers.basics.types import IntVector, Matrix, Sparse, Vector
from solvers.factorisation.base import Factorisation, State, check_pivots
from solvers.factorisation.errors import FactorisationError

LEVELS: Final = "levels"
"""Name of this back end."""

_FEW: Final = 2000  # unknowns from which on levels are not even looked for
_CHEAP: Final = 1.5e7  # multiplications up to which no sparse back end is faster, its ordering included


def version() -> str:
    """Library and version."""
    return f"scipy {scipy_version}"


def factorise(K: Sparse, interface: IntVector, threads: int | None) -> "LevelFactor":  # noqa: ARG001  # see `registry`
    """Factorise K (n, n), n > k, in compressed columns without duplicates."""
    return LevelFactor(K, Levels(K, interface))


def cheap_levels(K: Sparse, interface: IntVector) -> "Levels | None":
    """The levels of such a K where dense algebra on them is faster than any sparse back end, else None."""
    if K.shape[0] > _FEW:
        return None
    levels = Levels(K, interface)
    return levels if levels.multiplications <= _CHEAP else None


class Levels:
    """Unknowns of K (n, n) by their distance from the interface, in the graph of K.

    Attributes
    ----------
    members : list of IntVector
        Unknowns of each level, sorted; the first is the interface, perhaps empty. Parts of K that no entry links to it
        come behind, as further levels.

    """

    def __init__(self, K: Sparse, interface: IntVector) -> None:
        n = K.shape[0]
        self._number = np.full(n, -1)
        self._number[interface] = 0
        self.members = [interface]
        found, front = interface.size, interface
        starts = K.indptr.astype(np.int64)
        while found < n:
            near = K.indices[_ranges(starts[front], starts[front + 1])]
            near = near[self._number[near] < 0]
            self._number[near if near.size else int(np.argmin(self._number))] = len(self.members)
            front = np.flatnonzero(self._number == len(self.members))
            self.members.append(front)
            found += front.size

    @property
    def multiplications(self) -> float:
        """Those of the factorisation, about."""
        sizes = np.array([level.size for level in self.members], dtype=np.float64)
        own, before = sizes[1:], sizes[:-1]
        return float((own**3 / 6.0 + own**2 * before / 2.0 + own * before**2 / 2.0).sum())

    def blocks(self, K: Sparse) -> tuple[list[Matrix], list[Matrix]]:
        """Dense lower triangles of D_j, and K_j,j−1; of level 0, which has none before it, K_j,j−1 has no columns."""
        sizes = np.array([level.size for level in self.members])
        before = np.concatenate([[0], sizes[:-1]])
        starts = np.concatenate([[0], np.cumsum(sizes * (sizes + before))])
        place = np.empty(K.shape[0], dtype=np.int64)
        place[np.concatenate(self.members)] = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        column = np.repeat(np.arange(K.shape[0]), np.diff(K.indptr))
        level, left = self._number[K.indices], self._number[column]
        kept = level >= left  # what is above D_j is the transposed of K_j+1,j
        row, column, level, left = K.indices[kept], column[kept], level[kept], left[kept]
        at = starts[level] + place[row] + sizes[level] * (place[column] + np.where(level > left, sizes[level], 0))
        memory = np.zeros(starts[-1])
        memory[at] = K.data[kept]
        widths = np.stack([sizes, before], axis=1)
        pieces = [
            memory[start:stop].reshape((size, size + width), order="F")
            for (start, stop), (size, width) in zip(pairwise(starts), widths, strict=True)
        ]
        own = [piece[:, : len(piece)] for piece in pieces]
        return own, [piece[:, len(piece) :] for piece in pieces]


class LevelFactor(Factorisation):
    """L_j and E_j of each level."""

    backend = LEVELS

    def __init__(self, K: Sparse, levels: Levels) -> None:
        start = perf_counter()
        self.version = version()
        self.interface = levels.members[0]
        self._members = levels.members
        diagonal = K.diagonal()
        self._scale: Vector = diagonal[self.interface]
        own, couplings = levels.blocks(K)
        analysed = perf_counter()
        self._released = False
        for j in range(len(own) - 1, 0, -1):
            own[j], info = dpotrf(own[j], lower=1, clean=0, overwrite_a=1)
            if info > 0:
                raise FactorisationError("singular", self.backend, f"pivot {info} of level {j} is not positive")
            if not couplings[j].size:  # an interface without unknowns
                continue
            couplings[j] = dtrsm(1.0, own[j], couplings[j], lower=1, overwrite_b=1)
            own[j - 1] = dsyrk(-1.0, couplings[j], 1.0, own[j - 1], trans=1, lower=1, overwrite_c=1)
        self._own, self._couplings = own, couplings
        self._check_interior(diagonal)
        lower = np.tril(own[0])
        self.schur = lower + np.tril(lower, -1).T
        self.seconds = {"analysis": analysed - start, "numeric": perf_counter() - analysed}

    @property
    def size(self) -> int:
        """Number of unknowns n."""
        return sum(level.size for level in self._members)

    def release(self) -> None:
        """Drop the factors; may be called again."""
        self._own, self._couplings, self._released = [], [], True

    def _schur_scale(self) -> Vector:
        return self._scale

    def _check_interior(self, diagonal: Vector) -> None:
        pivots = np.concatenate([np.zeros(0), *(np.diagonal(L) for L in self._own[1:])])
        interior = np.concatenate([np.zeros(0, dtype=np.int64), *self._members[1:]])
        check_pivots(pivots**2, diagonal[interior], self.backend, self.size)

    def _forward(self, right: Matrix) -> State:
        self._need_factors()
        state = np.array(right, order="F")
        for j in range(len(self._members) - 1 if state.size else 0, 0, -1):
            y = dtrsm(1.0, self._own[j], state[self._members[j]], lower=1)
            state[self._members[j]] = y
            state[self._members[j - 1]] -= self._couplings[j].T @ y
        return state

    def _backward(self, state: State, values: Matrix) -> Matrix:
        self._need_factors()
        state = self._with_values(state, values)
        for j in range(1, len(self._members) if state.size else 0):
            y = state[self._members[j]] - self._couplings[j] @ state[self._members[j - 1]]
            state[self._members[j]] = dtrsm(1.0, self._own[j], y, lower=1, trans_a=1)
        return state

    def _need_factors(self) -> None:
        if self._released:
            raise FactorisationError("backend", self.backend, "the factors have been released")


def _ranges(starts: IntVector, stops: IntVector) -> IntVector:
    """All whole numbers from each start up to its stop."""
    counts = stops - starts
    return np.asarray(np.arange(counts.sum()) + np.repeat(starts - (np.cumsum(counts) - counts), counts))
