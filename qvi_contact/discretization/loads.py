"""Points on edges, and prescribed tractions, displacements and body forces there as conditions and load vectors.

All dimensionless.

In `docs/theory.md`: (D1).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, evaluate
from qvi_contact.discretization.scaling import Scales
from qvi_contact.discretization.space import StressSpace
from qvi_contact.discretization.supports import PrescribedTraction
from qvi_contact.element import bernstein, legendre
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.mesh.edges import Edges, points_along, vectors_along
from qvi_contact.problem.conditions import Contact, Displacement, Traction
from qvi_contact.problem.problem import ContactProblem, Prescribed

LOAD_POINTS = 8
"""Gauss points for data given as functions, on edges: exact up to degree 15; for tractions on parts too."""

_ROUNDING = 1e-9  # of the largest value: difference from a polynomial that is none
_ON_ARCS: Final = 8  # points more for sums of products with frames that turn by 90° at most


@dataclass(frozen=True, eq=False)
class EdgePoints:
    """Gauss points on edges of the boundary or of joints.

    Attributes
    ----------
    space : StressSpace
        Mesh and element.
    edges : Edges
        The n edges.
    count : int
        Gauss points an edge, q. Arrays over points have shape (n q,), edge by edge.

    """

    space: StressSpace
    edges: Edges
    count: int

    @property
    def reference(self) -> FloatArray:
        """Reference coordinates of the points of each edge, 0 to 1 along the tangent, shape (q,)."""
        return gauss_legendre(self.count)[0]

    @cached_property
    def lengths(self) -> FloatArray:
        """Dimensionless lengths of the edges, shape (n,)."""
        first, second = (self.space.vertices[ends] for ends in (self.edges.first, self.edges.second))
        return np.asarray(np.hypot(*(second - first).T) * self.edges.stretch)

    @cached_property
    def weights(self) -> FloatArray:
        """Quadrature weights, the edge's length included, shape (n q,)."""
        return np.outer(self.lengths, gauss_legendre(self.count)[1]).ravel()

    @cached_property
    def coordinates(self) -> FloatArray:
        """Dimensionless coordinates, shape (n q, 2)."""
        return points_along(self.space.vertices, self.edges, self.reference).reshape(-1, 2)

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
        return self.space.traction_load(normal, shear, self.edges, self.reference)

    def traction_load(self, direction: FloatArray, weights: FloatArray) -> FloatArray:
        """The same of weights (n q,) of d·σn without φ, for a direction (2,) or one for each point (n q, 2)."""
        normal, shear = ((direction * own).sum(axis=1) for own in (self.normals, self.tangents))
        return self.load(weights * normal, weights * shear)

    def tractions(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """σ_N without φ and σ_T of degrees of freedom u (N,), shape (n q,) each."""
        return self.space.tractions(u, self.edges, self.reference)


def potential_at(problem: ContactProblem, scales: Scales, points: FloatArray) -> FloatArray:
    """Body-force potential φ/S at dimensionless points, shape (..., 2) to (...)."""
    return _potential(problem, scales, *physical(problem, scales, points))


def _potential(problem: ContactProblem, scales: Scales, x: FloatArray, y: FloatArray) -> FloatArray:
    return evaluate("ContactProblem.body_potential", problem.body_potential, x, y) / scales.stress


def has_body_force(problem: ContactProblem) -> bool:
    """Whether there is a potential, be it constant."""
    return callable(problem.body_potential) or problem.body_potential != 0.0


def physical(problem: ContactProblem, scales: Scales, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coordinates x, y [length] of dimensionless points (..., 2)."""
    origin = problem.mesh.origin
    return origin[0] + scales.length * points[..., 0], origin[1] + scales.length * points[..., 1]


def prescribed_tractions(problem: ContactProblem, scales: Scales) -> list[PrescribedTraction]:
    """All prescribed tractions, symmetry lines included, in the order of the problem."""
    return [_traction(problem, scales, given) for given in problem.prescribed(Traction)]


def _traction(problem: ContactProblem, scales: Scales, given: Prescribed) -> PrescribedTraction:
    def value(x: FloatArray, y: FloatArray) -> FloatArray:
        return evaluate(given.name, given.value, x, y) / scales.stress

    def potential(x: FloatArray, y: FloatArray) -> FloatArray:
        return _potential(problem, scales, x, y)

    edges = given.edges
    own = potential if has_body_force(problem) else None
    number = None if own is not None or callable(given.value) else given.value / scales.stress
    return PrescribedTraction(given.name, edges, given.direction, value, own, given.turns, number)


def contact_named(problem: ContactProblem, name: str) -> Contact:
    """The contact of that name."""
    return next(contact for contact in problem.contacts if contact.name == name)


def displacements_at_points(
    problem: ContactProblem, space: StressSpace, scales: Scales
) -> Iterator[tuple[FloatArray, EdgePoints, FloatArray]]:
    """Prescribed displacements but zeros as (directions (m, 2), m Gauss points of edges, values there [length])."""
    for given in problem.prescribed(Displacement):
        if not callable(given.value) and given.value == 0.0:
            continue
        points = EdgePoints(space, given.edges, LOAD_POINTS)
        x, y = physical(problem, scales, points.coordinates)
        yield points.vectors(given.direction, given.turns), points, evaluate(given.name, given.value, x, y)


def displacement_load(problem: ContactProblem, space: StressSpace, scales: Scales) -> FloatArray:
    """∫_{Γ_u} U·τn ds as a vector over all degrees of freedom, the first term on the right of (D1)."""
    load = np.zeros(space.size)
    for direction, points, values in displacements_at_points(problem, space, scales):
        load += points.traction_load(direction, points.weights * values / scales.displacement)
    return load


def cell_potential(problem: ContactProblem, space: StressSpace, scales: Scales) -> FloatArray | None:
    """φ at the quadrature points of the cells (cells, g), dimensionless; None without body force."""
    if not has_body_force(problem):
        return None
    return potential_at(problem, scales, space.points(np.arange(problem.mesh.cell_count), space.cell_points))


def is_polynomial(problem: ContactProblem, edges: Edges, name: str, field: Field, most: int) -> bool:
    """Whether a field is a polynomial of that degree along each edge, as far as many points show."""
    values = evaluate(name, field, *problem.mesh.points_along(edges, bernstein.SAMPLES))
    return spanned(values, legendre.basis(most, bernstein.SAMPLES))


def spanned(values: FloatArray, functions: FloatArray) -> bool:
    """Whether rows of values (n, k) are combinations of the columns of functions (k, c)."""
    basis = np.linalg.qr(functions)[0]
    return bool(np.abs(values - values @ basis @ basis.T).max() <= _ROUNDING * np.abs(values).max())
