"""Cells of the displacement model with sides that are arcs: a smooth map from the straight triangle.

With the barycentric coordinates λ of the reference triangle, corners X and the arc γ of a side from corner a to b,

    x(λ) = Σ λ_i X_i + Σ_sides λ_a λ_b q(λ_b − λ_a),   τ (1 − τ) q(2τ − 1) = γ(τ) − (1 − τ) X_a − τ X_b

which is γ on the side, the straight line on the others, and smooth, so that displacements that are polynomials of λ are
of full order. Neighbours agree on every side. q is a polynomial that differs from its definition by rounding.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.polynomial.legendre import legder, leggauss, legvander

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.companion.triangle import barycentric
from qvi_contact.mesh.arcs import arc_offsets
from qvi_contact.mesh.topology import OPPOSITE
from qvi_contact.mesh.triangles import TriangleMesh

_TERMS: Final = 12  # of q beside the coefficients of bends: its digits on an arc that turns by 90°
_STEPS: Final = 8  # of Newton's method for the inverse of the map; each doubles the digits
_SLOPES: Final = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])  # of λ = (1 − t₁ − t₂, t₁, t₂)


@dataclass(frozen=True, eq=False)
class CurvedCells:
    """What arcs add to the triangles of a mesh that have some; dimensionless.

    Attributes
    ----------
    numbers : (c,) int array
        The cells.
    corners : (c, 3, 2) array
        Their corners.
    bends : (c, 3, k) array
        How their sides bend, see `TriangleMesh.sides`.

    """

    numbers: IntArray
    corners: FloatArray
    bends: FloatArray

    @classmethod
    def of(cls, mesh: TriangleMesh, length: float) -> "CurvedCells":
        """Those of a mesh, whose lengths are divided by `length`."""
        bends = mesh.sides
        numbers = np.flatnonzero(bends.any(axis=(1, 2)))
        corners = (mesh.vertices[mesh.cells[numbers]] - mesh.origin) / length
        return cls(numbers, corners, bends[numbers])

    def __len__(self) -> int:
        return len(self.numbers)

    def among(self, cells: IntArray | slice, count: int) -> tuple[IntArray, IntArray]:
        """Places in `cells`, of so many cells, that have arcs, and which of these they are."""
        chosen = np.arange(count)[cells]
        place = np.full(count, -1)
        place[self.numbers] = np.arange(len(self))
        at = np.flatnonzero(place[chosen] >= 0)
        return at, place[chosen][at]

    @cached_property
    def _bulges(self) -> FloatArray:
        """Coefficients of Legendre of q of all sides, (3, c, terms, 2)."""
        terms = _TERMS + self.bends.shape[2]
        nodes, weights = leggauss(terms)
        t = (1.0 + nodes) / 2.0
        project = (np.arange(terms) + 0.5)[:, None] * (legvander(nodes, terms - 1) * weights[:, None]).T
        found = np.zeros((3, len(self), terms, 2))
        for s, (a, b) in enumerate(OPPOSITE):
            chord = self.corners[:, b] - self.corners[:, a]
            bulge = arc_offsets(chord, self.bends[:, s], t) - t[:, None] * chord[:, None]
            found[s] = project @ (bulge / (t * (1.0 - t))[:, None])
        return found

    def points(self, which: IntArray, t: FloatArray) -> FloatArray:
        """Points (k, q, 2) at reference points t, (q, 2) or (k, q, 2), of some of the cells (k,)."""
        barycentric = _barycentric(t, len(which))
        found = barycentric @ self.corners[which]
        for s, (a, b) in enumerate(OPPOSITE):
            bent = self._bent(which, s)
            first, second = barycentric[bent, :, a], barycentric[bent, :, b]
            found[bent] += (first * second)[..., None] * _sum(self._bulges[s, which[bent]], second - first)
        return np.asarray(found)

    def jacobians(self, which: IntArray, t: FloatArray) -> FloatArray:
        """∂x_b/∂t_a as [cell, point, b, a], shape (k, q, 2, 2)."""
        barycentric = _barycentric(t, len(which))
        found = np.broadcast_to(
            (self.corners[which].swapaxes(1, 2) @ _SLOPES)[:, None], (*barycentric.shape[:2], 2, 2)
        ).copy()
        for s, (a, b) in enumerate(OPPOSITE):
            bent = self._bent(which, s)
            first, second = barycentric[bent, :, a], barycentric[bent, :, b]
            q = self._bulges[s, which[bent]]
            product = first[..., None] * _SLOPES[b] + second[..., None] * _SLOPES[a]
            slope = (first * second)[..., None] * _sum(legder(q, axis=1), second - first)
            found[bent] += _sum(q, second - first)[..., None] * product[..., None, :]
            found[bent] += slope[..., None] * (_SLOPES[b] - _SLOPES[a])
        return np.asarray(found)

    def _bent(self, which: IntArray, side: int) -> IntArray:
        """Places in `which` of the cells whose side of this number is an arc: mostly one of three is."""
        return np.flatnonzero(self.bends[which, side].any(axis=1))

    def own(self, mesh: TriangleMesh, which: IntArray, t: FloatArray) -> FloatArray:
        """Reference points t (k, q, 2) of this map from those (k, q, 2) of the mesh."""
        placed = mesh.placed(self.numbers[which], _barycentric(t, len(which)))
        return self.reference(which, placed @ self.corners[which])

    def reference(self, which: IntArray, points: FloatArray) -> FloatArray:
        """Reference points t (k, q, 2) of points (k, q, 2) in some of the cells (k,)."""
        corners = self.corners[which]
        straight = np.linalg.inv(corners.swapaxes(1, 2) @ _SLOPES)
        t = (points - corners[:, :1]) @ straight.swapaxes(1, 2)
        for _ in range(_STEPS):
            miss = points - self.points(which, t)
            t = t + np.linalg.solve(self.jacobians(which, t), miss[..., None])[..., 0]
        return np.asarray(t)


def _barycentric(t: FloatArray, count: int) -> FloatArray:
    return barycentric(np.broadcast_to(t, (count, *np.shape(t)[-2:])))


def _sum(coefficients: FloatArray, at: FloatArray) -> FloatArray:
    """Σ c_k P_k of coefficients (n, terms, 2) at places (n, q), shape (n, q, 2)."""
    return np.asarray(legvander(at, coefficients.shape[1] - 1) @ coefficients)
