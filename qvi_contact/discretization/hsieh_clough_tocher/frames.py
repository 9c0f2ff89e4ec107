"""Affine functions from which degrees of freedom at vertices count, so that small cells lose no digits.

Stresses are second differences of Φ. Where Φ counts from an affine function that vanishes with its slopes at a distance
r, a cell of size h takes them from numbers that are (r/h)² times as large, and rounding takes as many digits. So every
vertex v belongs to a *centre* c(v), a vertex, and its degrees of freedom are values and slopes of

    Φ − a_c,     a_c(x) = Φ(x_c) + (x − x_c)·∇Φ(x_c),

those of the centre are Φ(x_c) and ∇Φ(x_c) themselves. Where all vertices have one centre, the gauge makes these zero,
and nothing changes. Where there are several, nothing changes inside the part of each, since stresses do not feel a_c.
Only edges and triangles *across* parts see the centres: at a vertex v of theirs

    Φ(x_v) = its own degree of freedom + a_c(x_v).

Centres are chosen one after the other, each where r/h is largest, until it is small everywhere.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray

_FAR: Final = 500.5  # distance to the centre over size of cells that is allowed: its square times ε is lost
_ALIKE: Final = 1.47  # ratio that counts as none when a centre is chosen
_NEARER: Final = 1.0 - 1e-9  # share of a distance that is less
# None is a ratio of lengths in regular meshes: rounding must not choose centres, by which stored results are read.


@dataclass(frozen=True, eq=False)
class Frames:
    """From which vertex each vertex of a mesh counts.

    Attributes
    ----------
    vertices : (v, 2) array
        Dimensionless coordinates.
    centres : (c,) int array
        Vertices that are centres, the one with the smallest cells first.
    owner : (v,) int array
        The centre of each vertex.

    """

    vertices: FloatArray
    centres: IntArray
    owner: IntArray

    @classmethod
    def of(cls, vertices: FloatArray, sizes: FloatArray, preferred: BoolArray) -> "Frames":
        """Centres of vertices with cells of these sizes (v,); of several that are alike a preferred one (v,)."""
        ratio, centres = np.asarray(1.0 / sizes), list[int]()
        owner, distance = np.zeros(len(vertices), dtype=np.int64), np.full(len(vertices), np.inf)
        while not centres or ratio.max() > _FAR:
            alike = ratio * _ALIKE >= ratio.max()
            centre = int(np.argmax(alike & preferred if (alike & preferred).any() else alike))
            away = np.hypot(*(vertices - vertices[centre]).T)
            nearer = away < _NEARER * distance
            owner[nearer], distance[nearer] = centre, away[nearer]
            centres.append(centre)
            ratio = distance / sizes
        return cls(vertices, np.array(centres), owner)

    @property
    def several(self) -> bool:
        """Whether there is more than one centre, so that degrees of freedom are not those of Φ."""
        return len(self.centres) > 1

    @cached_property
    def is_centre(self) -> BoolArray:
        """Whether vertices are centres (v,)."""
        found = np.zeros(len(self.vertices), dtype=bool)
        found[self.centres] = True
        return found

    def across(self, groups: IntArray) -> BoolArray:
        """Which edges (n, 2) or triangles (n, 3) have vertices of several centres, shape (n,)."""
        owners = self.owner[groups]
        return np.asarray((owners != owners[:, :1]).any(axis=1))

    def affine(self, at: IntArray) -> FloatArray:
        """(a_c, its slopes) at vertices (n,) of (Φ, Φ_x, Φ_y) at their centres, shape (n, 3, 3)."""
        return shifts(self.vertices[at] - self.vertices[self.owner[at]])

    def columns(self, at: IntArray) -> IntArray:
        """The degrees of freedom of the centres of vertices (n,), shape (n, 3)."""
        return 3 * self.owner[at][:, None] + np.arange(3)

    def beyond(self, cells: IntArray, size: int) -> sparse.csr_array:
        """What triangles (n, 3) across parts have at their corners beside their own degrees of freedom.

        That is a_c of each corner less a_c of the first, as rows (Φ, Φ_x, Φ_y) of the three corners, shape
        (9 n, size). Degrees of freedom of centres count in their own units.
        """
        first = np.repeat(cells[:, 0], 3)
        corner = cells.ravel()
        apart = np.flatnonzero(self.owner[corner] != self.owner[first])
        at, origin = corner[apart], first[apart]
        away = shifts(self.vertices[at] - self.vertices[self.owner[origin]])
        rows = np.repeat(3 * apart[:, None] + np.arange(3), 6, axis=1)
        columns = np.repeat(np.hstack([self.columns(at), self.columns(origin)])[:, None], 3, axis=1)
        values = np.concatenate([self.affine(at), -away], axis=2)
        shape = (3 * len(corner), size)
        return sparse.coo_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape).tocsr()


def shifts(arms: FloatArray) -> FloatArray:
    """Maps of value and slopes of affine functions from one point to another, arms (n, 2) away: shape (n, 3, 3)."""
    found = np.tile(np.eye(3), (len(arms), 1, 1))
    found[:, 0, 1:] = arms
    return found
