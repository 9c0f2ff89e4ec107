"""Quadratics that are nonnegative on [0, 1], by Bernstein coefficients b (..., 3), and the dual cone.

    C = { b : b₀, b₂ ≥ 0,  b₁ ≥ −√(b₀b₂) }              nonnegative quadratics
    D = { q : q₀, q₁, q₂ ≥ 0,  q₁² ≤ 4 q₀q₂ }            functionals q·b that are ≥ 0 on C

C: with b₁ = −√(b₀b₂) the quadratic is the square (√b₀ (1 − t) − √b₂ t)², and a larger b₁ adds a multiple of 2t(1 − t).
D is the cone of the point evaluations ((1 − t)², 2t(1 − t), t²), for which q₁² = 4 q₀q₂, and of what lies between them.
Source: Karlin, Studden, Tchebycheff Systems, ch. II (Markov-Lukács); here for degree 2.

In `docs/theory.md`: (D16), (D17).
"""

import numpy as np

from solvers.basics.types import BoolVector, Matrix, Vector
from solvers.inequality.edges import quadratic_basis


def is_nonnegative(b: Matrix, slack: float = 0.0) -> BoolVector:
    """Whether b (e, 3) is ≥ −slack on the whole of [0, 1]."""
    return np.asarray(smallest(b) >= -slack)


def smallest(b: Matrix) -> Vector:
    """Minimum on [0, 1] of each quadratic b (e, 3)."""
    return -largest(-np.asarray(b))


def largest(b: Matrix) -> Vector:
    """Maximum on [0, 1] of each quadratic b (e, 3): at an end, or inside where it is concave."""
    b = np.asarray(b, dtype=np.float64)
    curvature = 2.0 * b[:, 1] - b[:, 0] - b[:, 2]  # > 0: concave
    inside = (b[:, 1] > b[:, 0]) & (b[:, 1] > b[:, 2])
    t = np.divide(b[:, 1] - b[:, 0], curvature, out=np.zeros(len(b)), where=inside)
    return np.asarray(np.maximum(b[:, [0, 2]].max(axis=1), (quadratic_basis(t) * b).sum(axis=1)))


def product(u: Matrix, v: Matrix) -> Matrix:
    """Bernstein coefficients (e, 3) of the product of two affine functions of end values u, v (e, 2)."""
    cross = 0.5 * (u[:, 0] * v[:, 1] + u[:, 1] * v[:, 0])
    return np.column_stack([u[:, 0] * v[:, 0], cross, u[:, 1] * v[:, 1]])


def raised(v: Matrix) -> Matrix:
    """Bernstein coefficients (e, 3) of affine functions of end values v (e, 2)."""
    return np.column_stack([v[:, 0], v.mean(axis=1), v[:, 1]])


def affine_below(b: Matrix) -> Matrix:
    """End values (e, 2) of affine functions ≥ 0 below quadratics b (e, 3) that are ≥ 0.

    The chord, lowered where the quadratic sags below it; its minimum as a constant where that would be negative.
    """
    sag = np.maximum(0.25 * (b[:, 0] + b[:, 2]) - 0.5 * b[:, 1], 0.0)  # at t = 1/2, the largest
    chord = b[:, [0, 2]] - sag[:, None]
    lowest = np.maximum(smallest(b), 0.0)
    usable = np.asarray((chord >= 0.0).all(axis=1))
    return np.where(usable[:, None], chord, lowest[:, None])


def in_dual(q: Matrix, slack: float = 0.0) -> BoolVector:
    """Whether q (e, 3) is in D, up to `slack` in each of its conditions."""
    sides = np.sqrt(np.maximum(q[:, 0], 0.0) * np.maximum(q[:, 2], 0.0))
    return np.asarray((q.min(axis=1) >= -slack) & (q[:, 1] <= 2.0 * sides + slack))
