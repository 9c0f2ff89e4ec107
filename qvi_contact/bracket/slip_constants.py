"""How an error grows under Coulomb slip in one sense: constants of the norm s of the friction operator.

Friction turns normal tractions into tangential ones. S is an operator on displacements with (Sv)_N = ±μ v_T and
(Sv)_T = 0 on contacts, SS = 0, s no less than its norm in the energy norm. For s < 2, with

    α = 1 − s/2,   f = (4 + s²)/(4 − s²),

the residual ρ and the contact defect δ bound errors by F(ρ, δ) and what contacts miss by Σ ≤ ρ²/(4α) + δ.

In `docs/theory.md`: (D28).
"""

from typing import Final

import numpy as np

LARGEST: Final = 2.0
"""The norm s from which on nothing is bounded."""


def coercivity(s: float) -> float:
    """α = min a(e, e − Se)/|e|² = 1 − s/2, which is also min a(e, q)/|q|² for q = e − Se."""
    return 1.0 - s / 2.0


def amplification(s: float) -> float:
    """The factor f = max |e − Se| |e|/a(e, e − Se) = (4 + s²)/(4 − s²) of ρ, for 0 ≤ s < 2."""
    return (4.0 + s**2) / (4.0 - s**2)


def error_bound(residual: float, defect: float, s: float) -> float:
    """F = ½ [fρ + √(f²ρ² + 4δ/α)], the larger root of x² = fρx + δ/α; infinite from s = 2 on."""
    if not s < LARGEST:
        return float("inf")
    grown = amplification(s) * residual
    return float(0.5 * (grown + np.hypot(grown, 2.0 * np.sqrt(defect / coercivity(s)))))


def defect_bound(residual: float, defect: float, s: float) -> float:
    """Σ ≤ ρ²/(4α) + δ; infinite from s = 2 on."""
    return residual**2 / (4.0 * coercivity(s)) + defect if s < LARGEST else float("inf")
