"""Gauss points on edges, and the tractions there as linear functions of the degrees of freedom."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.discretization.basis import Basis
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.mesh.edges import Edges, points_along, vectors_along

_ON_ARCS: Final = 8  # points more for sums of products with frames that turn by 90° at most


@dataclass(frozen=True, eq=False)
class EdgePoints:
    """Gauss points on edges of the boundary or of joints.

    Attributes
    ----------
    basis : Basis
        Mesh and element.
    edges : Edges
        The n edges.
    count : int
        Gauss points an edge, q. Arrays over points have shape (n q,), edge by edge.

    """

    basis: Basis
    edges: Edges
    count: int

    @property
    def reference(self) -> FloatArray:
        """Reference coordinates of the points of each edge, 0 to 1 along the tangent, shape (q,)."""
        return gauss_legendre(self.count)[0]

    @cached_property
    def lengths(self) -> FloatArray:
        """Dimensionless lengths of the edges, shape (n,)."""
        first, second = (self.basis.vertices[ends] for ends in (self.edges.first, self.edges.second))
        return np.asarray(np.hypot(*(second - first).T) * self.edges.stretch)

    @cached_property
    def weights(self) -> FloatArray:
        """Quadrature weights, the edge's length included, shape (n q,)."""
        return np.outer(self.lengths, gauss_legendre(self.count)[1]).ravel()

    @cached_property
    def coordinates(self) -> FloatArray:
        """Dimensionless coordinates, shape (n q, 2)."""
        return points_along(self.basis.vertices, self.edges, self.reference).reshape(-1, 2)

    @property
    def normals(self) -> FloatArray:
        """The edge's normal at each point, shape (n q, 2)."""
        return self.vectors(self.edges.normal, turns=True)

    @property
    def tangents(self) -> FloatArray:
        """The edge's tangent at each point, shape (n q, 2)."""
        return self.vectors(self.edges.tangent, turns=True)

    def for_resultants(self) -> "EdgePoints":
        """More points where edges are arcs, whose normals turn, so that resultants are exact; else the same."""
        return replace(self, count=self.count + _ON_ARCS) if self.edges.curved else self

    def vectors(self, direction: FloatArray, turns: bool) -> FloatArray:
        """Directions (n, 2) of the edges, of arcs if they turn along them, at each point, shape (n q, 2)."""
        return vectors_along(self.edges, direction, self.reference, turns=turns).reshape(-1, 2)

    def load(self, normal: FloatArray, shear: FloatArray) -> FloatArray:
        """Σ normal σ_N + shear σ_T of weights (n q,) each, as a vector over all degrees of freedom (N,)."""
        return self.basis.traction_load(normal, shear, self.edges, self.reference)

    def traction_load(self, direction: FloatArray, weights: FloatArray) -> FloatArray:
        """The same of weights (n q,) of d·σn without φ, for a direction (2,) or one for each point (n q, 2)."""
        normal, shear = ((direction * own).sum(axis=1) for own in (self.normals, self.tangents))
        return self.load(weights * normal, weights * shear)

    def tractions(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """σ_N without φ and σ_T of degrees of freedom u (N,), shape (n q,) each."""
        return self.basis.tractions(u, self.edges, self.reference)
