"""Numbers on edges that depend on the degrees of freedom of the edge alone: those of its two ends and its own."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.constraints import Rows, stacked


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

    def adjoint(self, weights: FloatArray) -> FloatArray:
        """The sum of weights (n, r) times the functionals, a vector over all degrees of freedom (N,)."""
        sums = (weights[:, None, :] @ self.values)[:, 0]
        return np.asarray(np.bincount(self.columns.ravel(), sums.ravel(), self.size), dtype=np.float64)

    def rows(self) -> Rows:
        """The functionals as n r rows, edge by edge."""
        n, r, width = self.values.shape
        return Rows(np.repeat(self.columns, r, axis=0), self.values.reshape(n * r, width))

    def matrix(self) -> sparse.csr_array:
        """The functionals as rows, edge by edge, without zeros; shape (n r, N)."""
        return stacked([self.rows()], self.size)
