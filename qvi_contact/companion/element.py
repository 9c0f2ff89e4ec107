"""Tensor-product Bernstein element Q_p for scikit-fem: its degrees of freedom are the Bernstein coefficients.

The trace on a side is the polynomial whose coefficients are the side's degrees of freedom, so that contact conditions
and prescribed data are conditions on single unknowns.

    u(x, y) = Σ c_ij B_i(x) B_j(y) on the unit square, i, j = 0 … p
"""

from functools import lru_cache
from math import comb

import numpy as np
from numpy.typing import NDArray
from skfem import Basis, BilinearForm, MeshQuad  # type: ignore[import-untyped]
from skfem.element import ElementH1  # type: ignore[import-untyped]
from skfem.refdom import RefQuad  # type: ignore[import-untyped]

from qvi_contact.basics.checks import FloatArray, IntArray


class BernsteinQuad(ElementH1):  # type: ignore[misc]  # scikit-fem has no types
    """Q_p on the unit square, with p − 1 unknowns on each side, counted along +x or +y whichever way the side runs.

    Neighbours agree on that order only where all cells have the same vertex order, as those of a grid do.
    """

    refdom = RefQuad
    nodal_dofs = 1

    def __init__(self, degree: int) -> None:
        self.degree = degree
        self.facet_dofs = degree - 1
        self.interior_dofs = (degree - 1) ** 2
        self.maxdeg = 2 * degree
        self.dofnames = (1 + self.facet_dofs + self.interior_dofs) * ["u"]
        table = lattice(degree)
        self._place = np.empty((table.size, 2), dtype=np.int64)
        for (row, column), local in np.ndenumerate(table):
            self._place[local] = column, row
        self.doflocs = self._place / degree

    def lbasis(self, X: FloatArray, i: int) -> tuple[FloatArray, FloatArray]:
        """Value and gradient of shape function i at points X (2, …), as scikit-fem asks for them."""
        column, row = self._place[i]
        (f, df), (g, dg) = _one(self.degree, column, X[0]), _one(self.degree, row, X[1])
        return f * g, np.array([df * g, f * dg])


def _one(degree: int, i: int, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """B_i and its derivative p (B_{i−1} − B_i of degree p − 1) at t."""

    def value(p: int, k: int) -> FloatArray:
        return comb(p, k) * t**k * (1.0 - t) ** (p - k) if 0 <= k <= p else 0.0 * t

    return value(degree, i), degree * (value(degree - 1, i - 1) - value(degree - 1, i))


def lattice(degree: int) -> IntArray:
    """Local number of each coefficient in scikit-fem's order, shape (p + 1, p + 1) as [along y, along x].

    Vertices counterclockwise from the bottom left, then the sides bottom, right, top, left, then the inside.
    """
    p = degree
    number = np.empty((p + 1, p + 1), dtype=np.int64)
    number[0, 0], number[0, p], number[p, p], number[p, 0] = range(4)
    side = np.arange(p - 1)
    number[0, 1:p], number[1:p, p], number[p, 1:p], number[1:p, 0] = (4 + k * (p - 1) + side for k in range(4))
    number[1:p, 1:p] = 4 * p + np.arange((p - 1) ** 2).reshape(p - 1, p - 1)
    return number


@lru_cache(maxsize=8)
def reference_matrices(degree: int) -> NDArray[np.float64]:
    """∫ ∂_a u_i ∂_b u_j over the unit square, shape (2, 2, n, n) as [a, b, i, j], local numbers of `lattice`."""
    corners = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
    cell = Basis(MeshQuad(corners, np.arange(4)[:, None]), BernsteinQuad(degree))
    local = cell.element_dofs[:, 0]
    found = np.empty((2, 2, len(local), len(local)))
    for a in (0, 1):
        for b in (0, 1):
            form = BilinearForm(lambda u, v, _, a=a, b=b: u.grad[b] * v.grad[a])
            found[a, b] = form.assemble(cell).toarray()[np.ix_(local, local)]
    found.setflags(write=False)
    return found
