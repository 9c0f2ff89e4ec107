"""The measures of the certificate, one row each: limit, what it means, when to worry.

A measure may be as large as  factor · tolerance^exponent.
"""

from dataclasses import dataclass
from typing import Final


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
