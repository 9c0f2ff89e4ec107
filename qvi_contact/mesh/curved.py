"""Triangles with sides that are curved: where their points are.

Seen from the barycentre c, the third of the triangle at side s reaches up to the arc γ instead of the chord:

    x = c + r (γ(τ) − c),   0 ≤ r ≤ 1,   0 ≤ τ ≤ 1

in the place of c + r (a + τ (b − a) − c). The other thirds, and sides that are straight, stay what they are.
Polynomials are those of the straight triangle, continued. So every point has two triples of coordinates: *reference*
coordinates t, those of the straight triangle's point with the same r and τ, and the *barycentric* coordinates λ of x,
of which one is negative beyond the chord.
"""

from typing import Final

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.mesh.arcs import angles, arc_offsets, cross, stretches, turned
from qvi_contact.mesh.topology import OPPOSITE

_STEPS: Final = 8  # of Newton's method for τ; it doubles the digits each time


def barycentric_of(corners: FloatArray, bends: FloatArray, t: FloatArray) -> FloatArray:
    """Barycentric coordinates λ (n, q, 3) of reference points.

    Parameters
    ----------
    corners : (n, 3, 2) array
        Corners of the triangles.
    bends : (n, 3, k) array
        How their sides bend from the corner of lower number to that of higher one, see `mesh.arcs`.
    t : (q, 3) or (n, q, 3) array
        Reference coordinates.

    """
    t = np.broadcast_to(t, (len(corners), *np.shape(t)[-2:]))
    found, part = np.array(t), np.argmin(t, axis=-1)
    for s, (a, b) in enumerate(OPPOSITE):
        cell, point = np.nonzero((part == s) & bends[:, [s]].any(axis=2))
        at = t[cell, point]
        r = 1.0 - 3.0 * at[:, s]
        tau = _tau(at, s, r)
        chord = corners[cell, b] - corners[cell, a]
        bulge = arc_offsets(chord, bends[cell, s], tau[:, None])[:, 0] - tau[:, None] * chord
        found[cell, point] += _slopes(corners[cell], r[:, None] * bulge)
    return found


def reference_of(corners: FloatArray, bends: FloatArray, barycentric: FloatArray) -> FloatArray:
    """Reference coordinates (n, 3) of points with barycentric coordinates λ (n, 3) in triangles (n, …), one in each."""
    found, part = np.array(barycentric), np.argmin(barycentric, axis=-1)
    for s, (a, b) in enumerate(OPPOSITE):
        cell = np.flatnonzero((part == s) & bends[:, s].any(axis=1))
        own, bend, centre = corners[cell], bends[cell, s], corners[cell].mean(axis=1)
        at = barycentric[cell]
        away = np.einsum("nk,nkx->nx", at - 1.0 / 3.0, own)
        outer = at[:, a] + at[:, b] - 2.0 * at[:, s]  # r on the straight triangle
        tau = np.clip(_tau(at, s, outer), 0.0, 1.0)
        for _ in range(_STEPS):
            place, slope = _arc(own[:, a], own[:, b], bend, tau)
            across, rate = cross(place - centre, away), cross(slope, away)
            tau = np.clip(tau - np.where(rate != 0.0, across / np.where(rate != 0.0, rate, 1.0), 0.0), -0.5, 1.5)
        arm = _arc(own[:, a], own[:, b], bend, tau)[0] - centre
        r = (arm * away).sum(axis=1) / np.square(arm).sum(axis=1)
        found[cell, s] = (1.0 - r) / 3.0
        found[cell, a] = r * (1.0 - tau) + (1.0 - r) / 3.0
        found[cell, b] = r * tau + (1.0 - r) / 3.0
    return found


def area_factors(corners: FloatArray, bends: FloatArray, t: FloatArray) -> FloatArray:
    """How many times as large areas are as on the straight triangles, at reference points t; shape (n, q)."""
    t = np.broadcast_to(t, (len(corners), *np.shape(t)[-2:]))
    found, part, centres = np.ones(t.shape[:2]), np.argmin(t, axis=-1), corners.mean(axis=1)
    for s, (a, b) in enumerate(OPPOSITE):
        cell, point = np.nonzero((part == s) & bends[:, [s]].any(axis=2))
        at = t[cell, point]
        tau = _tau(at, s, 1.0 - 3.0 * at[:, s])
        first, second = corners[cell, a], corners[cell, b]
        place, slope = _arc(first, second, bends[cell, s], tau)
        straight = cross(first - centres[cell], second - first)
        found[cell, point] = cross(place - centres[cell], slope) / straight
    return found


def arc_points(s: int, t: FloatArray) -> FloatArray:
    """Reference coordinates (q, 3) of the points t (q,) along side s, from its corner of lower number."""
    found = np.zeros((len(t), 3))
    found[:, OPPOSITE[s][0]], found[:, OPPOSITE[s][1]] = 1.0 - t, t
    return found


def _tau(t: FloatArray, s: int, r: FloatArray) -> FloatArray:
    """The τ of points t (n, 3) of the straight triangle in the third at side s, from their r; any at the barycentre."""
    along = t[:, OPPOSITE[s][1]] - t[:, s]
    return np.where(r > 0.0, along / np.where(r > 0.0, r, 1.0), 0.5)


def _arc(first: FloatArray, second: FloatArray, bend: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (n, 2) at t (n,) on arcs, and their derivatives by t."""
    chord = second - first
    slope = turned(chord * stretches(bend)[:, None], angles(bend, t[:, None])[:, 0])
    return first + arc_offsets(chord, bend, t[:, None])[:, 0], slope


def _slopes(corners: FloatArray, vectors: FloatArray) -> FloatArray:
    """Changes of barycentric coordinates (n, 3) along vectors (n, 2)."""
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = cross(u, v)
    second, third = cross(vectors, v) / area, cross(u, vectors) / area
    return np.column_stack([-second - third, second, third])
