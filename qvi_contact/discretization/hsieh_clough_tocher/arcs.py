"""Tractions along arcs: what the degrees of freedom of a curved edge mean.

On an arc from a to b, of length ℓ and with a tangent τ that turns, the traction is that of ∇Φ along it,

    d∇Φ/ds = Φ_ττ τ + Φ_τμ μ,   σ_N = Φ_ττ,   σ_T = −(n·μ) Φ_τμ,   μ = (−τ_y, τ_x)

and N_k, Q_k are coefficients of Legendre of Φ_ττ and Φ_τμ over the arc's length, as on straight edges: a constant
pressure has one coefficient. N_0, Q_0 and N_1 follow from the corners, so that the polynomials of all coefficients have
the resultant force and moment that ∇Φ and Φ have there,

    ℓ ∫ (N τ + Q μ) dt = ∇Φ_b − ∇Φ_a,   ℓ ∫ (N τ + Q μ)·(x_m − x) dt = Φ_b − Φ_a − (b − a)·(∇Φ_a + ∇Φ_b)/2

with the middle x_m of the chord. The other coefficients are those of Φ itself.
"""

from typing import Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.element import legendre
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.mesh.arcs import angles, arc_offsets, stretches, turned

_MORE: Final = 8  # Gauss points beside the degree and the coefficients of bends


def resultant_shapes(bend: FloatArray, t: FloatArray) -> FloatArray:
    """What Φ_ττ and Φ_τμ at t contribute to the force, along chord and its normal, and to the moment.

    Parameters
    ----------
    bend : (n, k) array
        How the arcs bend, see `mesh.arcs`.
    t : (n, q) array
        Shares of their lengths.

    Returns
    -------
    (n, q, 3, 2) array
        Integrands, of chords of length 1.

    """
    unit = np.tile([1.0, 0.0], (len(bend), 1))
    angle = angles(bend, t)
    tangent = turned(np.broadcast_to([1.0, 0.0], (*t.shape, 2)), angle)
    normal = turned(np.broadcast_to([0.0, 1.0], (*t.shape, 2)), angle)
    arm = np.array([0.5, 0.0]) - arc_offsets(unit, bend, t)
    frame = np.stack([tangent, normal], axis=-1)  # (n, q, component, of Φ_ττ or Φ_τμ)
    moment = (arm[..., None] * frame).sum(axis=2, keepdims=True)
    return np.asarray(stretches(bend)[:, None, None, None] * np.concatenate([frame, moment], axis=2))


def from_corners(bend: FloatArray, degree: int) -> FloatArray:
    """All coefficients of Legendre (N_0 … N_d, Q_0 … Q_d) of arcs on chords of length 1.

    Parameters
    ----------
    bend : (n, k) array
        How the arcs bend, see `mesh.arcs`.
    degree : int
        d.

    Returns
    -------
    (n, 2d + 2, 2d + 2) array
        From the force along the chord and its normal, the moment, N_2 … N_d, Q_1 … Q_d.

    """
    t, w = gauss_legendre(degree + _MORE + bend.shape[1])
    values = legendre.basis(degree, t) * w[:, None]
    shapes = resultant_shapes(bend, np.tile(t, (len(bend), 1)))
    sums = np.einsum("nqrf,qk->nrfk", shapes, values).reshape(len(bend), 3, -1)
    solved, given = _solved(degree), _given(degree)
    found = np.zeros((len(bend), 2 * degree + 2, 2 * degree + 2))
    right = np.concatenate([np.tile(np.eye(3), (len(bend), 1, 1)), -sums[:, :, given]], axis=2)
    found[:, solved] = np.linalg.solve(sums[:, :, solved], right)
    found[:, given, 3 + np.arange(len(given))] = 1.0
    return found


def _solved(degree: int) -> IntArray:
    """Where N_0, N_1 and Q_0 stand among all coefficients."""
    return np.array([0, 1, degree + 1])


def _given(degree: int) -> IntArray:
    """Where the others do."""
    return np.setdiff1d(np.arange(2 * degree + 2), _solved(degree))
