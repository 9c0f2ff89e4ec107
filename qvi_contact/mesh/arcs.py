"""Arcs of circles by their chords and the angles θ by which they turn, counterclockwise; straight where θ = 0."""

import numpy as np

from qvi_contact.basics.checks import FloatArray


def stretches(turn: FloatArray) -> FloatArray:
    """Lengths of arcs over those of their chords, (θ/2) / sin(θ/2), from the angles θ they turn by; 1 for none."""
    half = np.where(turn == 0.0, 1.0, turn / 2.0)
    return np.where(turn == 0.0, 1.0, half / np.sin(half))


def arc_offsets(chords: FloatArray, turn: FloatArray, t: FloatArray) -> FloatArray:
    """From the first ends of arcs to their points, shape (n, q, 2).

    The chord to the point at t is sin(θt/2) / sin(θ/2) times as long as the whole, and turned by −θ(1 − t)/2.

    Parameters
    ----------
    chords : (n, 2) array
        From the first ends to the second ones.
    turn : (n,) array
        The angles θ by which the arcs turn, 0 where they are straight.
    t : (q,) or (n, q) array
        Shares of their lengths.

    """
    t = np.broadcast_to(t, (len(chords), np.shape(t)[-1]))
    half = np.where(turn == 0.0, 1.0, turn / 2.0)[:, None]
    share = np.where(turn[:, None] == 0.0, t, np.sin(half * t) / np.sin(half))
    return turned(share[..., None] * chords[:, None], (t - 1.0) * turn[:, None] / 2.0)


def turned(vectors: FloatArray, angle: FloatArray) -> FloatArray:
    """Vectors (..., 2) turned counterclockwise by angles (...) [rad]."""
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)


def cross(u: FloatArray, v: FloatArray) -> FloatArray:
    """u_x v_y − u_y v_x of vectors (..., 2)."""
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])
