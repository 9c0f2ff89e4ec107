"""The measures of the certificate, one row each: limit, what it means, when to worry.

A measure may be as large as  factor · tolerance^exponent.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from solvers.basics.types import Vector
from solvers.inequality.problem import FrictionQVI
from solvers.inequality.rows import largest


@dataclass(frozen=True)
class Measure:
    """One row of the certificate's table.

    Attributes
    ----------
    name : key in `Certificate.measures`
    meaning : what the number is, in one sentence
    worry : when to worry, and what to do then
    exponent, factor : of the limit factor · tolerance^exponent

    """

    name: str
    meaning: str
    worry: str
    exponent: float = 1.0
    factor: float = 1.0

    def limit(self, tolerance: float) -> float:
        """The value at which it fails."""
        return self.factor * float(tolerance**self.exponent)

    def needed(self, value: float) -> float:
        """The smallest tolerance at which `value` passes."""
        return float((value / self.factor) ** (1.0 / self.exponent))


MEASURES: Final = (
    Measure(
        "equality",
        "Violation of A z = b, such as the force balance of plates driven by force.",
        "Large: forces on a plate are not in equilibrium. Tighten the inner solver's tolerance.",
    ),
    Measure(
        "normal",
        "Largest pull σ_N > 0 at a contact point that can only press, over the largest traction.",
        "Large: the contact pulls on the body somewhere. The state is not admissible.",
    ),
    Measure(
        "friction",
        "Largest |σ_T| above the friction bound of the computed pressure, over the largest traction.",
        "Large: friction carries more than its law allows. The outer iteration may have ended too early.",
    ),
    Measure(
        "stationarity",
        "Error of the stress for the multipliers at hand, in the energy norm and in the contact tractions: "
        "incompatible strains.",
        "Large: the linear system is not solved, or multipliers belong to another state. Equilibrium holds regardless.",
    ),
    Measure(
        "sign",
        "Multipliers of the wrong sign: the obstacle would pull, or friction would push along the slip.",
        "Large: the multipliers of the back end are wrong, whatever status it reports.",
    ),
    Measure(
        "complementarity_normal",
        "Work Σ |m_N σ_N| of pressure on an open gap, over the energy.",
        "Large: points with a gap carry pressure. Tighten the inner tolerance.",
    ),
    Measure(
        "complementarity_tangential",
        "Work Σ | |m_T| bound − m_T σ_T | by which slip falls short of the friction bound, over the energy.",
        "Large: points slip below their bound, or against the traction.",
    ),
    Measure(
        "energy_gap",
        "Primal less dual energy for the bound at hand, over the energy of the body: at least the square of the "
        "relative error for that bound. Negative beyond rounding only if a condition above is violated.",
        "Large: the state is not the minimum of its own friction bound.",
    ),
    Measure(
        "natural_map",
        "Distance of the tractions from their projection on the law after a step along the displacements, with the "
        "bound of the pressure at hand, over the largest traction.",
        "Large with small complementarity: points that touch without pressure (error ~ √tolerance); else wrong states.",
        exponent=0.75,
        factor=10.0,
    ),
    Measure(
        "alart_curnier",
        "The same with the bound of the augmented pressure, as in the augmented Lagrangian of Alart and Curnier, over "
        "1 + μ times the largest traction.",
        "As for the natural map.",
        exponent=0.75,
        factor=10.0,
    ),
    Measure(
        "bipotential",
        "de Saxcé's Σ W (bound |u_T| + σ·u) over the energy, u the displacement relative to the obstacle: ≥ 0 for all "
        "admissible pairs, and 0 for those that obey the law.",
        "Positive: friction's work is not the full bound, or gaps do work. Negative: tractions or signs are not "
        "admissible.",
        factor=2.0,
    ),
)
"""In the order of the table."""


# How far tractions and displacements of a contact are from its law, as numbers.
#
# With λ = m / W, thr(p) = min(cohesion + mu p, cap), the scales S, D, E of `certificate` and k = S / D, at each point
#
#     π_N = min(σ_N + k λ_N, 0), bilateral σ_N + k λ_N                the augmented normal traction
#     natural map      σ_N − π_N   and   σ_T − clip(σ_T + k λ_T, ±thr(|σ_N|))
#     Alart-Curnier    σ_T − clip(σ_T + k λ_T, ±thr(|π_N|)), bilateral |σ_N|
#     bipotential      β = thr(|σ_N|) |λ_T| − σ_T λ_T − σ_N λ_N,  that is thr |u_T − w| + σ_N (u_N − g) + σ_T (u_T − w).
#
# Each is zero exactly where the law holds: the first two are projections on the cone of the present and of the
# augmented pressure, the third is Coulomb's bipotential, which admissible pairs (σ_N ≤ 0, |σ_T| ≤ thr, λ_N ≥ 0) make ≥
# 0. It is summed with its sign; violations of bounds may cancel gaps there, which is why the sums of
# `complementarity_normal` and `complementarity_tangential` take absolute values.
#
# Sources: P. Alart, A. Curnier, Comput. Methods Appl. Mech. Engrg. 92 (1991); G. de Saxcé, Z.-Q. Feng, Math. Comput.
# Modelling 28 (1998).


_NEAR = 10.0  # gaps and slips count up to this many E / (S Σ W)


class LawResiduals(NamedTuple):
    """What is left of the contact law.

    Attributes
    ----------
    measures : name → value ≥ 0, see `certificate`
    work : Σ W β with m_N made admissible: what it adds to the gap between primal and dual energy, signed
    bipotential : Σ W β, signed

    """

    measures: dict[str, float]
    work: float
    bipotential: float


def law_residuals(qvi: FrictionQVI, z: Vector, m_N: Vector, m_T: Vector, scales: dict[str, float]) -> LawResiduals:
    """All measures of the contact law of the QVI at z (n,) with row multipliers m_N, m_T (m,)."""
    S, D, E = scales["stress"], scales["displacement"], scales["energy"]
    sigma_N, sigma_T = qvi.normal(z), qvi.tangential(z)
    bound, one_sided = qvi.threshold(np.abs(sigma_N)), ~qvi.bilateral
    lambda_N, lambda_T = m_N / qvi.W, m_T / qvi.W
    slack_T = np.abs(m_T) * bound - m_T * sigma_T
    far = largest_gap(qvi, scales) * qvi.W
    near_N, near_T = np.minimum(m_N, far), slack_T * far / np.maximum(np.abs(m_T), far)
    bipotential = float(near_T.sum() - near_N @ sigma_N)
    # Projections on the law after a step along the displacements.
    shifted_N, shifted_T = sigma_N + S / D * lambda_N, sigma_T + S / D * lambda_T
    projected = np.where(one_sided, np.minimum(shifted_N, 0.0), shifted_N)
    augmented = qvi.threshold(np.abs(np.where(one_sided, projected, sigma_N)))
    natural, other = (np.abs(sigma_T - np.clip(shifted_T, -limit, limit)) for limit in (bound, augmented))
    normal = np.abs(sigma_N - projected)
    # Multipliers of the wrong sign.
    wrong_N = np.where(one_sided, np.maximum(-lambda_N, 0.0), np.abs(lambda_N))
    wrong_T = np.maximum(-lambda_T * sigma_T, 0.0)
    measures = {
        "normal": largest(np.where(one_sided, np.maximum(sigma_N, 0.0), 0.0)) / S,
        "friction": largest(np.maximum(np.abs(sigma_T) - bound, 0.0)) / S,
        "sign": max(largest(wrong_N) / D, largest(wrong_T) / (S * max(D, largest(lambda_T)))),
        "complementarity_normal": float(np.abs(near_N * sigma_N).sum()) / E,
        "complementarity_tangential": float(np.abs(near_T).sum()) / E,
        "natural_map": max(largest(normal), largest(natural)) / S,
        "alart_curnier": largest(np.maximum(normal, other) / (1.0 + qvi.mu)) / S,
        "bipotential": abs(bipotential) / E,
    }
    return LawResiduals(measures, float(slack_T.sum() - np.maximum(near_N, 0.0) @ sigma_N), bipotential)


def largest_gap(qvi: FrictionQVI, scales: dict[str, float]) -> float:
    """Up to where gaps and slips λ count: 10 E / (S Σ W), at which a wrong stress of ε S weighs 10 ε, however large."""
    length = float(qvi.W.sum())
    return _NEAR * scales["energy"] / (scales["stress"] * length) if length > 0.0 else 0.0
