r"""The certificate: how well a state meets every condition of (D2), computed on the original data alone.

With σ_N = N z + n0, σ_T = T z + t0, λ = m / W, the stiffness k of the contact (`FrictionQVI.contact_stiffness`), the
strain energy E_b = ½|r(z)|² (without a root ½ zᵀKz) and the scales

    S   stress:        max |σ_N|, |σ_T|
    D   displacement:  S / k
    E   energy:        min(S D Σ W, E_b), which is E_b where the stress peaks in few small cells

the measures are

    equality                    max over rows of (|A z − b| − ε |A| max |z|)⁺ / B,  ε = 1e-15,
                                B_i = b_i' + 1e-3 |a_i| max b'/|a|,  b' = |b| + 1e-4 |A||z|,  |a|² = Σ a_j² / K_jj
    normal                      max (σ_N)⁺ / S, unilateral points
    friction                    max (|σ_T| − thr)⁺ / S,  thr = min(cohesion + mu |σ_N|, cap)
    stationarity                max of |ρ| / √(2 E_b) and |N K⁻¹ρ|, |T K⁻¹ρ| / S,  ρ = K z − f + Nᵀm_N + Tᵀm_T + Aᵀν,
                                with the part Aᵀδν of ρ outside A z = 0: the less of |δν| B / E over rows of A and
                                |Aᵀδν|·|z| / E, and √(Σ r_i² / K_ii) / √(2 E_b) of r = Aᵀδν and of
                                r = ρ − K e − Aᵀδν,  with e the computed K⁻¹ρ
    sign                        max of (−λ_N)⁺ / D, bilateral |λ_N| / D, and (−λ_T σ_T)⁺ / (S max(D, |λ|))
    complementarity_normal      Σ |m_N σ_N| / E, open gaps λ_N counted up to 10 E / (S Σ W)
    complementarity_tangential  Σ | |m_T| thr − m_T σ_T | / E, slips |λ_T| counted up to 10 E / (S Σ W)
    energy_gap                  |primal − dual energy| / E_b for the bound s = |σ_N|
    natural_map                 max of |σ_N − min(σ_N + k λ_N, 0)| / S, bilateral k |λ_N| / S,  and
                                       |σ_T − clip(σ_T + k λ_T, −thr, thr)| / S

`law_residuals` has the formulas of the contact law, `MEASURES` the meaning of each measure and when to worry.

**Scales.** All scales are computed from the state itself, so that a large load or gap elsewhere does not hide an error
in the contact. If max |σ_N|, |σ_T| is below 1e-7 of √(E_b k / Σ W), a mean stress in the body, the contact counts as
unloaded and S is that stress. If the body is unloaded too, S is the stress of the bonded state, without inequalities.
It is 1, the unit of the dimensionless problem, if the bonded stress is larger than 1, or is rounding: √(2 E) of the
bonded state below 1e-12 √(Σ f_i² / K_ii). Such loads f are cancelled by the equations A z = b: gaps that move a plate
without deforming the body.

**Far gaps and long slips.** An obstacle farther from the body than 10 E / (S Σ W), at most 10 D, has the same effect as
one at that distance, so the gap counts up to that limit. Else rounding of σ_N, times a large gap, would count as an
error. Slips count up to the same limit: an error ε S of σ_T then weighs at most 10 ε.

**Rounding.** On strongly graded meshes the rounding of z itself, ε|R||z| in stresses, may exceed the tolerance. If |ρ|
is above 1e-9 √(2 E_b), this rounding is subtracted from |ρ|, up to 1e-6 √(2 E_b), and reported as the scale "rounding"
in units of √(2 E_b). The energy is then accurate to its square; single stresses in the smallest cells are not.

**Signs and dual energy.** σ_N > 0 is tension, m_N = W λ_N ≥ 0 an open gap, m_T has the sign of σ_T where the point
slips. The dual energy is taken at max(m_N, 0):
primal − dual = Σ (thr |m_T| − m_T σ_T − m_N σ_N) + ½ |ρ|² with |ρ|² = ρᵀK⁻¹ρ, which bounds ½ |z − z*|² in the norm of
K. K⁻¹ acts on the null space of A and uses the factorisation of the solver; r, a product with K itself, shows whether
that is a factorisation of this K. K⁻¹ρ is the error of z for the given multipliers, and |ρ| its energy norm. K z − f is
`FrictionQVI.gradient`, which includes the rounding inside K if the problem has an `EnergyRoot`.

**Limits.** At a point that touches without pressure, a product σ_N λ_N of size ε allows |σ_N| and λ_N of size √ε each.
The natural map measures their minimum, so its limit is looser: 10 tolerance^(3/4). All other limits are the tolerance.
Except for unloaded states all measures are invariant to the units of stress, displacement and length, and to a change
of the unknowns from z to c z.

In `docs/theory.md`: (D10).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from math import copysign, isfinite, sqrt
from operator import itemgetter
from types import MappingProxyType
from typing import Final

import numpy as np

from solvers.basics.checks import fraction, real_array
from solvers.basics.types import Vector
from solvers.errors import InputError
from solvers.inequality.problem import FrictionQVI
from solvers.inequality.rows import largest, most

# The measures: meaning, when to worry, and the limit  factor · tolerance^exponent.


@dataclass(frozen=True)
class Measure:
    """One row of the certificate's table."""

    name: str
    """Key in `Certificate.measures`."""
    meaning: str
    """Definition of the number, in one sentence."""
    worry: str
    """When to worry, and what to do then."""
    exponent: float = 1.0
    factor: float = 1.0
    """Exponent and factor of the limit factor · tolerance^exponent."""

    def limit(self, tolerance: float) -> float:
        """The largest value that passes."""
        return self.factor * float(tolerance**self.exponent)

    def needed(self, value: float) -> float:
        """The smallest tolerance at which `value` passes."""
        try:
            return float((value / self.factor) ** (1.0 / self.exponent))
        except OverflowError:
            return np.inf


MEASURES: Final = (
    Measure(
        "equality",
        "Violation of A z = b, such as the force balance of plates driven by force.",
        "Large: forces on a plate are not in equilibrium. Tighten the inner solver's tolerance.",
    ),
    Measure(
        "normal",
        "Largest tension σ_N > 0 at a contact point that can only press, over the largest traction.",
        "Large: the contact pulls on the body somewhere. The state is not admissible.",
    ),
    Measure(
        "friction",
        "Largest |σ_T| above the friction bound of the computed pressure, over the largest traction.",
        "Large: friction carries more than its law allows. The outer iteration may have ended too early.",
    ),
    Measure(
        "stationarity",
        "Error of the stress for the computed multipliers, in the energy norm and in the contact tractions: "
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
        "Primal less dual energy for the computed friction bound, over the energy of the body: at least the square of "
        "the relative error for that bound. Negative beyond rounding only if a condition above is violated.",
        "Large: the state does not minimise the energy for its own friction bound.",
    ),
    Measure(
        "natural_map",
        "Distance of the tractions from their projection on the law after a step along the displacements, with the "
        "friction bound of the computed pressure, over the largest traction.",
        "Large with small complementarity: points that touch without pressure (error ~ √tolerance); else wrong states.",
        exponent=0.75,
        factor=10.0,
    ),
)
"""All measures, in the order of the table."""


# The contact law holds if and only if the natural map is zero. Two other residuals of the law are bounded by these
# measures, and not computed: that of Alart and Curnier, with the friction bound of the augmented pressure, is at most
# 1 + mu times the natural map; de Saxcé's bipotential is at most the sum of both complementarities.
#
# Sources: P. Alart, A. Curnier, Comput. Methods Appl. Mech. Engrg. 92 (1991); G. de Saxcé, Z.-Q. Feng, Math. Comput.
# Modelling 28 (1998).

_LARGEST_GAP = 10.0  # gaps and slips count up to this multiple of E / (S Σ W)


def law_residuals(
    qvi: FrictionQVI, tractions: Vector, m_N: Vector, m_T: Vector, scales: dict[str, float]
) -> tuple[dict[str, float], float]:
    """All measures of the contact law of the QVI at tractions (2m,) with row multipliers m_N, m_T (m,).

    The second value is Σ (thr |m_T| − m_T σ_T − max(m_N, 0) σ_N), gaps counted up to their limit, a part of the primal
    less dual energy.
    """
    S, D, E = scales["stress"], scales["displacement"], scales["energy"]
    sigma_N, sigma_T = tractions[: qvi.m], tractions[qvi.m :]
    law, W, is_unilateral = qvi.law, qvi.W, ~qvi.bilateral
    bound, size_T = law.threshold(np.abs(sigma_N)), np.abs(m_T)
    # Works of gaps and slips, both counted up to the limit.
    work_T = size_T * bound - m_T * sigma_T
    limit = _LARGEST_GAP * E / (S * qvi.contact.length) * W
    limited_N, limited_work_T = np.minimum(m_N, limit), work_T * limit / np.maximum(size_T, limit)
    # Projections on the law after a step along the displacements.
    lambda_N, lambda_T = m_N / W, m_T / W
    shifted_N, shifted_T = sigma_N + S / D * lambda_N, sigma_T + S / D * lambda_T
    projected_N = np.where(is_unilateral, np.minimum(shifted_N, 0.0), shifted_N)
    natural_T = sigma_T - np.minimum(np.maximum(shifted_T, -bound), bound)
    natural_N = np.abs(sigma_N - projected_N)
    wrong_N = np.where(is_unilateral, -lambda_N, np.abs(lambda_N))  # multipliers of the wrong sign
    measures = {
        "normal": most(sigma_N[is_unilateral]) / S,
        "friction": most(np.abs(sigma_T) - bound) / S,
        "sign": max(most(wrong_N) / D, most(-lambda_T * sigma_T) / (S * max(D, largest(lambda_T)))),
        "complementarity_normal": float(np.abs(limited_N * sigma_N).sum()) / E,
        "complementarity_tangential": float(np.abs(limited_work_T).sum()) / E,
        "natural_map": max(most(natural_N), largest(natural_T)) / S,
    }
    return measures, float(work_T.sum() - np.maximum(limited_N, 0.0) @ sigma_N)


# The certificate.


# Scale of a row of A z = b: |b|, plus this share of |A||z|, plus this share of the largest, for rows of one length.
_TERMS_SHARE, _LARGEST_ROW_SHARE = 1e-4, 1e-3
_UNKNOWN_ROUNDING = 1e-15  # ε: error of the unknowns, over the largest one, that a row of A z = b may show
_ROUNDING_FREE = 1e-9  # relative error |ρ| / √(2 E_b) above which the rounding of z is subtracted
_ROUNDING_LIMIT = 1e-6  # the most of it that is subtracted
_UNLOADED_CONTACT = 1e-7  # traction, over the stress in the body, below which the contact is unloaded
_UNLOADED_BODY = 1e-6  # stress, over the unit or the bonded one, below which the whole body is unloaded
_CANCELLED_LOADS = 1e-12  # energy norm of the bonded state, over that of the loads, below which it is rounding

EXPONENTS: Mapping[str, float] = MappingProxyType({measure.name: measure.exponent for measure in MEASURES})
"""Measure → exponent e of its limit, a multiple of tolerance**e."""


@dataclass(frozen=True)
class CertificateRow:
    """A row of the certificate's table: a measure, its value, with a sign if it has one, and its limit."""

    measure: Measure
    value: float
    limit: float

    @property
    def passed(self) -> bool:
        """Whether the value is within the limit."""
        return bool(abs(self.value) <= self.limit)


@dataclass(frozen=True)
class Certificate:
    """Measured violations of every condition of (D2), relative to the scales of this module."""

    measures: Mapping[str, float]
    """Name → value, ≥ 0; ``inf`` if it could not be computed, so that the certificate then fails."""
    tolerance: float
    """The tolerance asked for."""
    scales: Mapping[str, float] = field(default_factory=dict)
    """Dimensionless "stress", "displacement", "energy" and "body_energy", and "rounding" if that was subtracted."""
    signed: Mapping[str, float] = field(default_factory=dict)
    """Name → value with its sign, for "energy_gap"."""

    @property
    def limits(self) -> Mapping[str, float]:
        """Measure → its largest value that passes, see `Measure`."""
        return _limits(self.tolerance)

    @cached_property
    def passed(self) -> bool:
        """Whether every measure is within its limit."""
        return all(self.measures[name] <= limit for name, limit in self.limits.items())

    @property
    def accuracy(self) -> float:
        """The smallest tolerance at which the certificate would pass."""
        return self._worst[0]

    @property
    def worst(self) -> str:
        """Name of the measure that determines `accuracy`."""
        return self._worst[1]

    @cached_property
    def _worst(self) -> tuple[float, str]:
        values = self.measures  # a certificate read from a file may lack some
        return max(((each.needed(values.get(each.name, np.inf)), each.name) for each in MEASURES), key=itemgetter(0))

    def rows(self) -> tuple[CertificateRow, ...]:
        """The rows of the table."""
        values = {**self.measures, **self.signed}
        return tuple(CertificateRow(each, values[each.name], self.limits[each.name]) for each in MEASURES)

    def explain(self) -> str:
        """The table as text, two significant digits; all numbers are relative, see the scales of this module."""
        width = max(map(len, EXPONENTS))
        lines = [f"{'measure':<{width}}  {'value':>8}  {'limit':>8}"]
        for row in self.rows():
            numbers = f"{row.measure.name:<{width}}  {row.value:>8.1e}  {row.limit:>8.1e}"
            lines.append(numbers + ("" if row.passed else "  FAILED"))
            lines += [f"    {row.measure.meaning}", f"    {row.measure.worry}"]
        return "\n".join(lines)

    def summary(self) -> str:
        """One line: passed or failed, the accuracy, and the measure that limits it."""
        verdict = "passed" if self.passed else "failed"
        return (
            f"certificate {verdict} at {self.tolerance:.0e}: accuracy {self.accuracy:.1e}, "
            f"limited by {self.worst} = {self.measures[self.worst]:.1e}"
        )


@lru_cache(maxsize=1)
def _limits(tolerance: float) -> Mapping[str, float]:
    return MappingProxyType({measure.name: measure.limit(tolerance) for measure in MEASURES})


def certify(
    qvi: FrictionQVI,
    z: Vector | None,
    normal_multiplier: Vector | None,
    tangential_multiplier: Vector | None,
    equality_multiplier: Vector | None = None,
    tolerance: float = 1e-8,
) -> Certificate:
    """Measure how well (z, m_N, m_T, ν) solves the QVI.

    Parameters
    ----------
    qvi : FrictionQVI
        The original data.
    z : (n,)
        Unknowns.
    normal_multiplier, tangential_multiplier : (m,)
        Row multipliers m = W λ with the signs of `FrictionQVI`.
    equality_multiplier : (p,)
        ν, needed if there are equalities.
    tolerance : float
        Relative, in (0, 1).

    A missing or non-finite argument gives infinite measures; a wrong shape raises `InputError`.

    """
    fraction("tolerance", tolerance)
    if equality_multiplier is None and qvi.p == 0:
        equality_multiplier = np.zeros(0)
    arguments = {
        "z": (z, qvi.n),
        "normal_multiplier": (normal_multiplier, qvi.m),
        "tangential_multiplier": (tangential_multiplier, qvi.m),
        "equality_multiplier": (equality_multiplier, qvi.p),
    }
    vectors = {name: real_array(name, value) for name, (value, _) in arguments.items() if value is not None}
    for name, vector in vectors.items():
        if vector.shape != (arguments[name][1],):
            raise InputError(name, f"shape {vector.shape}", f"give shape ({arguments[name][1]},)")
    if len(vectors) < len(arguments) or not np.isfinite(np.concatenate([*vectors.values()])).all():
        return Certificate(dict.fromkeys(EXPONENTS, np.inf), tolerance)
    with np.errstate(over="ignore", invalid="ignore"):
        measures, scales, gap = _measure(qvi, *vectors.values())
    finite = {name: value if isfinite(value) else np.inf for name, value in measures.items()}
    return Certificate(finite, tolerance, scales, {"energy_gap": gap} if isfinite(gap) else {})


def _measure(
    qvi: FrictionQVI, z: Vector, m_N: Vector, m_T: Vector, nu: Vector
) -> tuple[dict[str, float], dict[str, float], float]:
    """Measures, scales, and the energy gap with its sign; the module's docstring has the formulas."""
    (body, gradient), tractions = qvi.state(z), qvi.tractions(z)
    scales = scales_of(qvi, tractions, body)
    S, E_b = scales["stress"], scales["body_energy"]
    K, B, A = qvi.stiffness.K, qvi.contact.rows, qvi.contact.A
    residual = gradient + B.T @ np.concatenate([m_N, m_T]) + A.T @ nu
    error, delta_nu = qvi.linear_system.solve(residual)  # K⁻¹ρ and δν
    square, body_norm = float(residual @ error), sqrt(2.0 * E_b)
    conjugate = A.T @ delta_nu
    equality = work_nu = 0.0  # rows of A z = b over their scales B, and the work of δν
    if qvi.p:
        sizes = np.abs(qvi.b) + _TERMS_SHARE * (abs(A) @ np.abs(z))
        lengths = np.sqrt((A * A) @ (1.0 / qvi.stiffness.positive_diagonal))
        sizes += _LARGEST_ROW_SHARE * lengths * (sizes[lengths > 0.0] / lengths[lengths > 0.0]).max(initial=0.0)
        rounding = _UNKNOWN_ROUNDING * (abs(A) @ np.full(qvi.n, largest(z)))
        violation = np.maximum(np.abs(A @ z - qvi.b) - rounding, 0.0)
        equality = largest(violation / np.where(sizes > 0.0, sizes, 1.0))
        # rows that nearly repeat each other have large δν that cancel in Aᵀδν
        work_nu = min(largest(delta_nu * sizes), float(np.abs(conjugate) @ np.abs(z))) / scales["energy"]
    # The error of z for its multipliers: in the energy norm, and in the contact tractions.
    energy = sqrt(abs(square)) / body_norm
    if qvi.root is not None and energy > _ROUNDING_FREE:
        scales["rounding"] = min(qvi.root.rounding(z) / body_norm, _ROUNDING_LIMIT)
        energy = max(energy - scales["rounding"], 0.0)
    error_tractions = B @ error
    # The residual of the linear solve, and what it leaves to the equations; this norm is below the energy norm times
    # √(entries of a row).
    rest = max(_diagonal_norm(qvi, residual - K @ error - conjugate), _diagonal_norm(qvi, conjugate)) / body_norm
    # |ρ|² for max(m_N, 0) in place of m_N: the residual changes by Nᵀ(max(m_N, 0) − m_N).
    change = np.maximum(m_N, 0.0) - m_N
    if change.any():
        relief = qvi.linear_system.relief(qvi.contact.N)(change)
        square += 2.0 * float(change @ error_tractions[: qvi.m]) + float(change @ relief)
    law_measures, work = law_residuals(qvi, tractions, m_N, m_T, scales)
    gap = work + 0.5 * abs(square)
    measures = {
        "equality": equality,
        "stationarity": max(energy, largest(error_tractions) / S, work_nu, rest),
        "energy_gap": (abs(work) + 0.5 * abs(square)) / E_b,
        **law_measures,
    }
    return measures, scales, copysign(measures["energy_gap"], gap)


def body_scales(qvi: FrictionQVI, body: float) -> tuple[float, float, float]:
    """Energy and stress of a body with the strain energy `body`, and the traction up to which a contact is unloaded."""
    length, stiffness = qvi.contact.length, qvi.contact_stiffness or 1.0
    reference = length / stiffness  # energy of unit stress
    least = _UNLOADED_CONTACT
    if body <= _UNLOADED_BODY**2 * reference:  # unloaded, unless the bonded state is as small
        bonded = qvi.bonded_state.strain_energy
        # only equations can cancel loads: those on a plate that is free to move
        loads = _diagonal_norm(qvi, qvi.f) if qvi.p else 0.0
        if 2.0 * bonded > (_CANCELLED_LOADS * loads) ** 2:
            reference = min(reference, bonded)
        if body <= _UNLOADED_BODY**2 * reference:
            body, least = reference, _UNLOADED_BODY
    stress = sqrt(body * stiffness / length)
    return body, stress, least * stress


def scales_at(qvi: FrictionQVI, z: Vector) -> dict[str, float]:
    """The scales "stress", "displacement", "energy" of the contact and "body_energy" of the state z (n,)."""
    return scales_of(qvi, qvi.tractions(z), qvi.state(z)[0])


def scales_of(qvi: FrictionQVI, tractions: Vector, body: float) -> dict[str, float]:
    """`scales_at` for a state with these tractions (2m,) and the strain energy `body`."""
    body, body_stress, least = body_scales(qvi, body)
    stress = largest(tractions)
    stress = (body_stress if stress <= least else stress) or 1.0
    displacement = stress / (qvi.contact_stiffness or 1.0)
    body = body if body > 0.0 else 1.0
    energy = min(stress * displacement * qvi.contact.length, body)
    return {"stress": stress, "displacement": displacement, "energy": energy, "body_energy": body}


def _diagonal_norm(qvi: FrictionQVI, residual: Vector) -> float:
    """√(Σ r_i² / K_ii) of a residual or load (n,)."""
    return sqrt(residual @ (residual / qvi.stiffness.positive_diagonal))
