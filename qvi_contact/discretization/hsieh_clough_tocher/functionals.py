"""Numbers on edges that depend on the degrees of freedom of the edge alone: those of its two ends and its own."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class EdgeFunctionals:
    """The same r linear functionals on each of n edges.

    Attributes
    ----------
    columns : (n, l) int array
        Degrees of freedom of each edge: (Φ, Φ_x, Φ_y) at its first end, at its second, and its own.
    values : (n, r, l) array
        The functionals.
    size : int
        Degrees of freedom N of the body.

    """

    columns: IntArray
    values: FloatArray
    size: int

    def mapped(self, map_: FloatArray) -> "EdgeFunctionals":
        """Others, a map (q, r) of these on every edge or (n, q, r) on each."""
        return EdgeFunctionals(self.columns, np.asarray(map_ @ self.values), self.size)

    def apply(self, u: FloatArray) -> FloatArray:
        """Their values (n, r) of degrees of freedom u (N,)."""
        return np.asarray((self.values @ u[self.columns][:, :, None])[:, :, 0])

    def matrix(self) -> sparse.csr_array:
        """The functionals as rows, edge by edge, without zeros; shape (n r, N)."""
        n, r, width = self.values.shape
        flat = self.values.reshape(n * r, width)
        kept = flat != 0.0
        columns = np.repeat(self.columns, r, axis=0)[kept]
        pointers = np.concatenate([[0], np.cumsum(kept.sum(axis=1))])
        return sparse.csr_array((flat[kept], columns, pointers), shape=(n * r, self.size))
