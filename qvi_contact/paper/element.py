"""The element of Bogner, Fox and Schmit, (3.7): cubic in x times cubic in y, with a continuous gradient.

An Airy function of these elements on a grid is Φ(x, y) = Σ u_JI H_J(y) H_I(x), a product of cubic splines: H_I with
I = 2i is one at the line x_i, with I = 2i + 1 it has a slope there, and both are zero on all other lines. So what is
computed of Φ anywhere is a Kronecker product of two matrices of one variable, and only those are needed here.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.polynomial import polynomial
from scipy import sparse

from qvi_contact.basics.checks import FloatArray

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(4)
GAUSS_POINTS: Final[FloatArray] = (_POINTS + 1.0) / 2.0
"""Four on [0, 1]: exact for the energy, and where the paper checks the friction law on the side of an element."""
GAUSS_WEIGHTS: Final[FloatArray] = _WEIGHTS / 2.0

# in powers of t, columns: value at 0, slope at 0, value at 1, slope at 1
_HERMITE: Final = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [-3.0, -2.0, 3.0, -1.0], [2.0, 1.0, -2.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Spline:
    """Cubic Hermite functions of one coordinate on grid lines.

    The degrees of freedom are Φ and s Φ' at every line, where s is the geometric mean of the two cells beside it, so
    that all have one unit and matrices of fine grids keep their digits.

    Attributes
    ----------
    lines : (n + 1,) array
        Coordinates, increasing, dimensionless.

    """

    lines: FloatArray

    @cached_property
    def sizes(self) -> FloatArray:
        """Lengths h of the cells, shape (n,)."""
        return np.diff(self.lines)

    @cached_property
    def scales(self) -> FloatArray:
        """The length s of every line, shape (n + 1,)."""
        padded = np.concatenate([self.sizes[:1], self.sizes, self.sizes[-1:]])
        return np.asarray(np.sqrt(padded[:-1] * padded[1:]))

    def points(self, t: FloatArray) -> FloatArray:
        """Coordinates of the points t (q,) in [0, 1] of every cell, shape (n, q)."""
        return np.asarray(self.lines[:-1, None] + self.sizes[:, None] * t)

    def matrix(self, t: FloatArray, derivative: int) -> sparse.csr_array:
        """Derivatives of order 0 to 2 at the points t (q,) of every cell, from the degrees of freedom.

        Shape (n q, 2(n + 1)), cell by cell.
        """
        n, q = len(self.sizes), len(t)
        shapes = polynomial.polyval(t, polynomial.polyder(_HERMITE, derivative), tensor=True).T  # (q, 4)
        h, s = self.sizes, self.scales
        units = np.stack([np.ones(n), h / s[:-1], np.ones(n), h / s[1:]], axis=1) / h[:, None] ** derivative
        rows = shapes[None] * units[:, None]  # (n, q, 4)
        columns = np.broadcast_to(2 * np.arange(n)[:, None, None] + np.arange(4), rows.shape)
        starts = 4 * np.arange(n * q + 1)
        return sparse.csr_array((rows.ravel(), columns.ravel(), starts), shape=(n * q, 2 * (n + 1)))
