"""All degrees of freedom as an affine function of the unknowns, so that prescribed tractions hold.

In `docs/theory.md`: (D2).
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.errors import QVIError

_SAME = 1e-13  # relative difference of two rows that is rounding


class UnbalancedLoadError(QVIError):
    """The prescribed tractions on a closed part of the boundary are not in equilibrium.

    Attributes
    ----------
    imbalance : float
        The largest resultant force or moment that is left, dimensionless.

    """

    def __init__(self, imbalance: float) -> None:
        self.imbalance = imbalance
        super().__init__(f"closed traction boundary out of balance by {imbalance:.3g} (dimensionless)")

    def __reduce__(self) -> tuple[type["UnbalancedLoadError"], tuple[float]]:
        """For pickles, as worker processes send it."""
        return type(self), (self.imbalance,)


@dataclass(frozen=True)
class Elimination:
    """All degrees of freedom u as an affine function of the kept ones z: u = basis z + particular.

    Attributes
    ----------
    kept : (N,) bool array
        Degrees of freedom that are unknowns; z are their values.
    slaves : (m,) int array
        The other degrees of freedom, those outside the body left out.
    slave_basis : (m, n) sparse array
        Their rows of the basis.
    particular : (N,) array
        Zero for kept ones and outside the body.
    conflicts : (c,) int array
        Vertices where the shears prescribed on two edges disagree, and only the edges' resultants are kept.
    source : Elimination, optional
        The one whose basis this one has.

    """

    kept: BoolArray
    slaves: IntArray
    slave_basis: sparse.csr_array
    particular: FloatArray
    conflicts: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    source: "Elimination | None" = None

    def sharing(self, other: "Elimination") -> "Elimination":
        """Itself, with the very basis of another one if they differ in `particular` and `conflicts` only.

        Rows of the basis that differ by rounding are the same.
        """
        mine, its = self.slave_basis, other.slave_basis
        same = (
            np.array_equal(self.kept, other.kept)
            and np.array_equal(self.slaves, other.slaves)
            and mine.shape == its.shape
            and np.array_equal(mine.indptr, its.indptr)
            and np.array_equal(mine.indices, its.indices)
            and np.allclose(mine.data, its.data, rtol=_SAME, atol=0.0)
        )
        if not same:
            return self
        source = other if other.source is None else other.source
        return replace(other, particular=self.particular, conflicts=self.conflicts, source=source)

    @cached_property
    def basis(self) -> sparse.csr_array:
        """The whole basis B, the identity on kept degrees of freedom, shape (N, n)."""
        if self.source is not None:
            return self.source.basis
        free = np.flatnonzero(self.kept)
        count = len(free)
        slaves = self.slave_basis.tocoo()
        rows = np.concatenate([free, self.slaves[slaves.row]])
        columns = np.concatenate([np.arange(count), slaves.col])
        data = np.concatenate([np.ones(count), slaves.data])
        return sparse.csr_array((data, (rows, columns)), shape=(len(self.kept), count))
