"""How stresses behave where a contact ends in a corner of the body: exponents of Williams' expansion.

In a wedge 0 ≤ θ ≤ π/2 whose face θ = π/2 is free, Φ = r^(λ+1) F(θ) with

    F = a cos(λ+1)θ + b sin(λ+1)θ + c cos(λ−1)θ + d sin(λ−1)θ

gives σ_θθ = λ(λ+1) r^(λ−1) F, σ_rθ = −λ r^(λ−1) F′, and with κ = (3 − ν)/(1 + ν) in plane stress and 3 − 4ν
in plane strain

    2G u_r = r^λ (−(λ+1) F + (κ+1)(c cos(λ−1)θ + d sin(λ−1)θ)),
    2G u_θ = r^λ (−F′ + (κ+1)(c sin(λ−1)θ − d cos(λ−1)θ)).

On the face θ = 0 a flat rigid body either holds the wedge (u_r = u_θ = 0) or lets it slip towards the corner, u_θ = 0
and σ_rθ = μ σ_θθ. λ is the smallest exponent in (½, 1] for which a, b, c, d are not all zero; stresses behave like
r^(λ−1). Source: M. L. Williams, J. Appl. Mech. 19 (1952); J. R. Barber, Elasticity, chapter 11, for the displacements.
"""

import numpy as np
from scipy.optimize import brentq

from qvi_contact.basics.checks import FloatArray

_SAMPLES = 400


def exponent(poisson: float, friction: float | None = None, plane: str = "stress") -> float:
    """λ for a coefficient of friction μ ≥ 0, or where the wedge is held (None)."""
    kappa = (3.0 - poisson) / (1.0 + poisson) if plane == "stress" else 3.0 - 4.0 * poisson
    if friction == 0.0:
        return 1.0  # uniform pressure

    def determinant(power: float) -> float:
        return float(np.linalg.det(_conditions(power, kappa, friction)))

    samples = np.linspace(0.5, 1.0 - 1e-6, _SAMPLES)
    values = [determinant(power) for power in samples]
    changes = (k for k in range(_SAMPLES - 1) if values[k] * values[k + 1] <= 0.0)
    first = next(changes, None)
    if first is None:
        return 1.0  # no singularity: uniform stress
    return float(brentq(determinant, samples[first], samples[first + 1], xtol=1e-13))


def _conditions(power: float, kappa: float, friction: float | None) -> FloatArray:
    """Rows of the conditions on both faces, columns a, b, c, d."""
    value, slope = _shape(power, 0.0)
    far, far_slope = _shape(power, np.pi / 2.0)
    across = -slope - (kappa + 1.0) * np.array([0.0, 0.0, 0.0, 1.0])  # u_θ
    if friction is None:
        along = -(power + 1.0) * value + (kappa + 1.0) * np.array([0.0, 0.0, 1.0, 0.0])  # u_r
    else:
        along = -slope - friction * (power + 1.0) * value
    return np.stack([across, along, far, far_slope])


def _shape(power: float, angle: float) -> tuple[FloatArray, FloatArray]:
    """F and F′ at an angle, by a, b, c, d."""
    outer, inner = power + 1.0, power - 1.0
    value = [np.cos(outer * angle), np.sin(outer * angle), np.cos(inner * angle), np.sin(inner * angle)]
    slope = [-outer * value[1], outer * value[0], -inner * value[3], inner * value[2]]
    return np.array(value), np.array(slope)
