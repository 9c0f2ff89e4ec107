"""Curved edges by their chords and their bends: the angle θ from the chord to the tangent, counterclockwise.

Along shares t of the length θ is a polynomial, θ(t) = Σ c_k P_k(2t − 1) with Legendre's P_k. With the chord as unit of
length, and along the x-axis,

    x(t) = ℓ ∫₀ᵗ (cos θ, sin θ) dt,   ℓ ∫₀¹ cos θ dt = 1,   ∫₀¹ sin θ dt = 0

and ℓ is the length. On a straight edge c = 0; of an arc of a circle that turns by α it is c₁ = α/2 alone.
"""

from functools import cache
from typing import Final

import numpy as np
from numpy.polynomial.legendre import leggauss, legval, legvander

from qvi_contact.basics.checks import FloatArray

_MORE: Final = 6  # Gauss points beside the coefficients: digits of ∫ cos θ where θ changes by 90°


def angles(bend: FloatArray, t: FloatArray) -> FloatArray:
    """θ of edges with bends (n, k) at shares t, (q,) or (n, q), of their lengths; shape (n, q)."""
    return polynomials(bend, 2.0 * np.broadcast_to(t, (len(bend), np.shape(t)[-1])) - 1.0)


def stretches(bend: FloatArray) -> FloatArray:
    """Lengths ℓ of edges with bends (n, k) over those of their chords; 1 of straight ones."""
    x, _ = _from_first(bend, np.ones((len(bend), 1)))
    return np.asarray(1.0 / x[:, 0])


def arc_offsets(chords: FloatArray, bend: FloatArray, t: FloatArray) -> FloatArray:
    """From the first ends of edges to their points, shape (n, q, 2).

    Parameters
    ----------
    chords : (n, 2) array
        From the first ends to the second ones.
    bend : (n, k) array
        Their bends c.
    t : (q,) or (n, q) array
        Shares of their lengths.

    """
    count = len(chords)
    shares = np.concatenate([np.broadcast_to(t, (count, np.shape(t)[-1])), np.ones((count, 1))], axis=1)
    along, across = _from_first(bend, shares)
    across_chords = np.column_stack([-chords[:, 1], chords[:, 0]])
    found = along[:, :-1, None] * chords[:, None] + across[:, :-1, None] * across_chords[:, None]
    return np.asarray(found / along[:, -1:, None])  # at the end of an edge its chord over its length


def levelled(bend: FloatArray) -> FloatArray:
    """The bends of the same curves, turned so that ∫ sin θ = 0: θ counts from the chord."""
    x, y = _from_first(bend, np.ones((len(bend), 1)))
    found = bend.copy()
    found[:, 0] -= np.arctan2(y, x)[:, 0]
    return found


def reversed_bends(bend: FloatArray) -> FloatArray:
    """The bends of the same edges taken from their second ends to the first ones."""
    return np.asarray(bend * (-1.0) ** np.arange(bend.shape[1]))


def halves(bend: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The bends of both halves of edges, (n, k) each."""
    t, _ = gauss(bend.shape[1])
    first, second = (levelled(coefficients(angles(bend, at))) for at in (t / 2.0, (1.0 + t) / 2.0))
    return first, second


@cache
def gauss(count: int) -> tuple[FloatArray, FloatArray]:
    """Points and weights (count,) of Gauss on 0 to 1."""
    nodes, weights = leggauss(count)
    return (1.0 + nodes) / 2.0, weights / 2.0


def coefficients(values: FloatArray) -> FloatArray:
    """Coefficients of Legendre (..., q) of polynomials from their values (..., q) at as many points of Gauss."""
    count = values.shape[-1]
    t, weights = gauss(count)
    project = (2.0 * np.arange(count) + 1.0) * legvander(2.0 * t - 1.0, count - 1) * weights[:, None]
    return np.asarray(values @ project)


def polynomials(terms: FloatArray, x: FloatArray) -> FloatArray:
    """Polynomials by coefficients of Legendre (n, k) at x (n, q), −1 to 1."""
    return np.asarray(legval(x, terms.T[:, :, None], tensor=False))


def turned(vectors: FloatArray, angle: FloatArray) -> FloatArray:
    """Vectors (..., 2) turned counterclockwise by angles (...) [rad]."""
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)


def cross(u: FloatArray, v: FloatArray) -> FloatArray:
    """u_x v_y − u_y v_x of vectors (..., 2)."""
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def _from_first(bend: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """∫₀ᵗ cos θ and ∫₀ᵗ sin θ at t (n, q), (n, q) each; t and 0 of straight edges, to the last digit."""
    along, across = np.array(t), np.zeros(t.shape)
    bent = np.flatnonzero(bend.any(axis=1))
    if not len(bent):
        return along, across
    nodes, weights = gauss(bend.shape[1] + _MORE)
    at = t[bent]
    between = at[:, :, None] * nodes
    angle = angles(bend[bent], between.reshape(len(bent), at.shape[1] * len(nodes))).reshape(between.shape)
    along[bent] = at * (np.cos(angle) @ weights)
    across[bent] = at * (np.sin(angle) @ weights)
    return along, across
