"""Affine maps from one equilateral reference triangle to triangles of any shape."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray

CORNERS: Final[FloatArray] = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
"""Corners of the reference triangle: equilateral, so that no corner and no direction is preferred."""
CORNERS.flags.writeable = False

EDGES: Final = ((1, 2), (0, 2), (0, 1))
"""Corners of the three edges, edge s opposite to corner s, the lower corner first."""


@dataclass(frozen=True, eq=False)
class AffineTriangles:
    """Triangles as images x = X₀ + J (ξ − Ξ₀) of the reference triangle with corners Ξ.

    Attributes
    ----------
    corners : (n, 3, 2) array
        Corners X of the triangles, in any sense of rotation.

    """

    corners: FloatArray

    def __len__(self) -> int:
        return len(self.corners)

    def take(self, chosen: BoolArray | slice) -> "AffineTriangles":
        """Some of them; with all of them, what is known of these."""
        corners = self.corners[chosen]
        return self if len(corners) == len(self) else AffineTriangles(corners)

    @cached_property
    def jacobians(self) -> FloatArray:
        """J = ∂x/∂ξ, shape (n, 2, 2)."""
        reference = np.linalg.inv(CORNERS[1:] - CORNERS[0])
        return np.asarray((reference @ (self.corners[:, 1:] - self.corners[:, :1])).swapaxes(1, 2))

    @cached_property
    def scales(self) -> FloatArray:
        """|det J|: area over that of the reference triangle, shape (n,)."""
        J = self.jacobians
        return np.abs(J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] * J[:, 1, 0])

    @property
    def areas(self) -> FloatArray:
        """Areas, shape (n,)."""
        return np.asarray(self.scales * np.sqrt(0.75) / 2.0)

    @cached_property
    def elongations(self) -> FloatArray:
        """Longest side over the height on it, shape (n,)."""
        sides = self.corners - np.roll(self.corners, 1, axis=1)
        return np.asarray(np.square(sides).sum(axis=2).max(axis=1) / (self.scales * np.sqrt(0.75)))

    @cached_property
    def inverses(self) -> FloatArray:
        """J⁻¹ = ∂ξ/∂x, shape (n, 2, 2)."""
        return np.asarray(np.linalg.inv(self.jacobians))

    @cached_property
    def hessian_maps(self) -> FloatArray:
        """From (Φ_ξξ, Φ_ηη, Φ_ξη) to (Φ_xx, Φ_yy, Φ_xy), shape (n, 3, 3)."""
        (a, b), (c, d) = self.inverses.transpose(1, 2, 0)
        rows = [[a * a, c * c, 2.0 * a * c], [b * b, d * d, 2.0 * b * d], [a * b, c * d, a * d + b * c]]
        return np.moveaxis(np.array(rows), 2, 0)

    @cached_property
    def stress_maps(self) -> FloatArray:
        """From (Φ_ξξ, Φ_ηη, Φ_ξη) to (σ_xx, σ_yy, σ_xy) = (Φ_yy, Φ_xx, −Φ_xy), shape (n, 3, 3)."""
        return np.asarray(self.hessian_maps[:, [1, 0, 2]] * np.array([1.0, 1.0, -1.0])[:, None])

    def points(self, barycentric: FloatArray) -> FloatArray:
        """Points at barycentric coordinates (p, 3) of every triangle or (n, p, 3) of each; shape (n, p, 2)."""
        return np.asarray(barycentric @ self.corners)
