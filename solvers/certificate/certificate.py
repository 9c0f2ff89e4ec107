r"""Is this a solution? Computed on the original data, whatever the back end said.

With σ_N = N z + n0, σ_T = T z + t0, λ = m / W, the stiffness k of the contact (`FrictionQVI.contact_stiffness`), the
strain energy E_b = ½|r(z)|² (without a root ½ zᵀKz) and the scales

    S   stress:        max |σ_N|, |σ_T|
    D   displacement:  S / k
    E   energy:        min(S D Σ W, E_b), the smaller one where the stress peaks in few small cells

the measures are

    equality                    max over rows of (|A z − b| − ε |A| max |z|)⁺ / B,  ε = 1e-15,
                                B_i = b_i' + 1e-3 max b',  b' = |b| + 1e-4 |A||z|
    normal                      max (σ_N)⁺ / S, unilateral points
    friction                    max (|σ_T| − thr)⁺ / S,  thr = min(cohesion + mu |σ_N|, cap)
    stationarity                max of |ρ| / √(2 E_b) and |N K⁻¹ρ|, |T K⁻¹ρ| / S,  ρ = K z − f + Nᵀm_N + Tᵀm_T + Aᵀν,
                                over rows of A of |δν| B / E, Aᵀδν the part of ρ outside A z = 0, and of
                                √(Σ r_i² / K_ii) / √(2 E_b),  r = ρ − K e − Aᵀδν  with e the K⁻¹ρ that was found
    sign                        max of (−λ_N)⁺ / D, bilateral |λ_N| / D, and (−λ_T σ_T)⁺ / (S max(D, |λ|))
    complementarity_normal      Σ |m_N σ_N| / E, open gaps λ_N counted up to 10 E / (S Σ W)
    complementarity_tangential  Σ | |m_T| thr − m_T σ_T | / E, slips |λ_T| counted up to 10 E / (S Σ W)
    energy_gap                  |primal − dual energy| / E_b for the bound s = |σ_N|
    natural_map                 max of |σ_N − min(σ_N + k λ_N, 0)| / S, bilateral k |λ_N| / S,  and
                                       |σ_T − clip(σ_T + k λ_T, −thr, thr)| / S
    alart_curnier               the same over 1 + mu, with thr = thr(|min(σ_N + k λ_N, 0)|)
    bipotential                 |Σ (thr |m_T| − m_T σ_T − m_N σ_N)| / E, gaps and slips counted so

`law_residuals` has the formulas of the contact law, `MEASURES` what each number means and when to worry.

All scales are those of the state itself: a load or a gap elsewhere, however large, does not hide an error in the
contact. Where the contact carries nothing, max |σ_N|, |σ_T| below 1e-7 of √(E_b k / Σ W), which stands for the stress
in the body, that is S; where the body carries nothing either, it is the stress without the inequalities (`bonded`),
and 1, the unit of the dimensionless problem, if that is larger, or zero but for rounding: √(2 E) of the bonded state
below 1e-12 √(Σ f_i² / K_ii), where the equations A z = b cancel f: gaps that move a plate and do not deform the body.

An obstacle farther away than 10 E / (S Σ W), which is 10 D or less, from the body may as well stand there: the solution
is the same, and round-off in σ_N times a gap of any size is no error. Likewise a point that slides farther than that
slides: an error ε S of σ_T weighs 10 ε, however far.

Where cells are strongly graded the rounding of z itself, ε|R||z| in stresses, may exceed the tolerance. Where |ρ| is
above 1e-9 √(2 E_b) it is subtracted from |ρ|, up to 1e-6 √(2 E_b), and reported as the scale "rounding" in units of
√(2 E_b): the energy is then accurate to its square, and single stresses in the smallest cells are not.

Signs: positive normal traction pulls, m_N pushes (≥ 0), m_T has the sign of σ_T where it slips. The dual
energy is that of max(m_N, 0): primal − dual = Σ (thr |m_T| − m_T σ_T − m_N σ_N) + ½ |ρ|² with
|ρ|² = ρᵀK⁻¹ρ (K⁻¹ on the null space of A, by the factorisation that has served the solver: r, a product with K
itself, shows whether it is one of K), which bounds ½ |z − z*|² in the norm of K. |ρ| is, in that norm,
the error of z for the given multipliers, and K⁻¹ρ that error itself; K z − f is `FrictionQVI.gradient`, so that
rounding inside K counts where the problem has a root to measure it.

At a point that touches without load σ_N λ_N of size ε allows |σ_N| and λ_N of size √ε each; natural map and
Alart-Curnier's are their minimum. Their limit is therefore looser, 10 tolerance^(3/4); that of the bipotential, which
adds both complementarities, is 2 tolerance, that of the others the tolerance itself. Except for
states that carry nothing, all measures are invariant to the units of stress, displacement and length, and to exchanging
the unknowns z for c z.

In `docs/theory.md`: (D10).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np

from solvers.basics.checks import fraction, real_array
from solvers.basics.types import Vector
from solvers.errors import InputError
from solvers.inequality.problem import FrictionQVI
from solvers.inequality.rows import largest

# The measures, one row each: limit, what it means, when to worry. A measure may be as large as  factor ·
# tolerance^exponent.


@dataclass(frozen=True)
class Measure:
    """One row of the certificate's table."""

    name: str
    """Key in `Certificate.measures`."""
    meaning: str
    """What the number is, in one sentence."""
    worry: str
    """When to worry, and what to do then."""
    exponent: float = 1.0
    factor: float = 1.0
    """Of the limit factor · tolerance^exponent."""

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


# The contact law: each of the last three measures is zero exactly where it holds. Natural map and Alart-Curnier's are
# projections on the cone of the present and of the augmented pressure; the bipotential is ≥ 0 for admissible pairs
# (σ_N ≤ 0, |σ_T| ≤ thr, λ_N ≥ 0). It is summed with its sign; violations of bounds may cancel gaps there, which is why
# the sums of `complementarity_normal` and `complementarity_tangential` take absolute values.
#
# Sources: P. Alart, A. Curnier, Comput. Methods Appl. Mech. Engrg. 92 (1991); G. de Saxcé, Z.-Q. Feng, Math. Comput.
# Modelling 28 (1998).


_NEAR = 10.0  # gaps and slips count up to this many E / (S Σ W)


class LawResiduals(NamedTuple):
    """Measures of the law, each ≥ 0; what it adds to the gap between primal and dual energy; the bipotential, signed.

    The second is the third with m_N made admissible.
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
    far = _NEAR * E / (S * (float(qvi.W.sum()) or 1.0)) * qvi.W
    near_N, near_T = np.minimum(m_N, far), slack_T * far / np.maximum(np.abs(m_T), far)
    bipotential = float(near_T.sum() - near_N @ sigma_N)
    # Projections on the law after a step along the displacements.
    shifted_N, shifted_T = sigma_N + S / D * lambda_N, sigma_T + S / D * lambda_T
    projected = np.where(one_sided, np.minimum(shifted_N, 0.0), shifted_N)
    augmented = qvi.threshold(np.abs(np.where(one_sided, projected, sigma_N)))
    natural, other = (sigma_T - np.minimum(np.maximum(shifted_T, -limit), limit) for limit in (bound, augmented))
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
        "alart_curnier": largest(np.maximum(normal, np.abs(other)) / (1.0 + qvi.mu)) / S,
        "bipotential": abs(bipotential) / E,
    }
    return LawResiduals(measures, float(slack_T.sum() - np.maximum(near_N, 0.0) @ sigma_N), bipotential)


# The certificate.


_CANCELS = 1e-4  # share of the terms of A z that an error is measured by where b is small
_ROUNDED = 1e-15  # share of the largest z in the unknowns of a row that is no error
_BESIDE = 1e-3  # the same, of the largest other row
_ROUNDING_FREE = 1e-9  # error of z above which one asks whether it is rounding
_ROUNDING_LIMIT = 1e-6  # error of z that rounding may explain
_LITTLE = 1e-7  # share of the stress in the body below which a contact carries nothing
_NOTHING = 1e-6  # share of unit stress, or of the bonded state's, below which the whole body carries nothing
_CANCELLED = 1e-12  # share of the loads' own energy norm below which that of the bonded state is rounding

EXPONENTS: Mapping[str, float] = MappingProxyType({measure.name: measure.exponent for measure in MEASURES})
"""Measure → exponent e of its limit, a multiple of tolerance**e."""


@dataclass(frozen=True)
class CertificateRow:
    """One line of the certificate's table: a measure, its value, signed where that means something, and its limit."""

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
    """Name → value, ≥ 0; ``inf`` where it could not be computed, so that nothing missing passes."""
    tolerance: float
    """The tolerance asked for."""
    scales: Mapping[str, float] = field(default_factory=dict)
    """Dimensionless "stress", "displacement", "energy" and "body_energy", and "rounding" where that counted."""
    signed: Mapping[str, float] = field(default_factory=dict)
    """Name → the same value with its sign, where that means something: "energy_gap" and "bipotential"."""

    @cached_property
    def limits(self) -> dict[str, float]:
        """Measure → the value at which it fails, see `Measure`."""
        return {measure.name: measure.limit(self.tolerance) for measure in MEASURES}

    @cached_property
    def passed(self) -> bool:
        """Whether every measure is within its limit."""
        return all(self.measures[name] <= limit for name, limit in self.limits.items())

    @cached_property
    def accuracy(self) -> float:
        """The smallest tolerance at which it would pass."""
        return max(self._needed.values())

    @property
    def worst(self) -> str:
        """Name of the measure that decides `accuracy`."""
        needed = self._needed
        return max(needed, key=needed.__getitem__)

    @cached_property
    def _needed(self) -> dict[str, float]:
        found = self.measures  # a claimed certificate may lack some
        return {measure.name: measure.needed(found.get(measure.name, np.inf)) for measure in MEASURES}

    def rows(self) -> tuple[CertificateRow, ...]:
        """The table: each measure, its limit, what it means and when to worry."""
        values = {**self.measures, **self.signed}
        return tuple(CertificateRow(each, values[each.name], self.limits[each.name]) for each in MEASURES)

    def explain(self) -> str:
        """The table as text, two significant digits; all numbers are relative, see the scales in `certificate`."""
        width = max(map(len, EXPONENTS))
        lines = [f"{'measure':<{width}}  {'value':>8}  {'limit':>8}"]
        for row in self.rows():
            numbers = f"{row.measure.name:<{width}}  {row.value:>8.1e}  {row.limit:>8.1e}"
            lines.append(numbers + ("" if row.passed else "  FAILED"))
            lines += [f"    {row.measure.meaning}", f"    {row.measure.worry}"]
        return "\n".join(lines)

    def summary(self) -> str:
        """One line: passed or failed, at which accuracy, and what limits it."""
        verdict = "passed" if self.passed else "failed"
        return (
            f"certificate {verdict} at {self.tolerance:.0e}: accuracy {self.accuracy:.1e}, "
            f"limited by {self.worst} = {self.measures[self.worst]:.1e}"
        )


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
    given = {
        "z": (z, qvi.n),
        "normal_multiplier": (normal_multiplier, qvi.m),
        "tangential_multiplier": (tangential_multiplier, qvi.m),
        "equality_multiplier": (equality_multiplier, qvi.p),
    }
    vectors = {name: real_array(name, value) for name, (value, _) in given.items() if value is not None}
    for name, vector in vectors.items():
        if vector.shape != (given[name][1],):
            raise InputError(name, f"shape {vector.shape}", f"give shape ({given[name][1]},)")
    if len(vectors) < len(given) or not all(np.isfinite(vector).all() for vector in vectors.values()):
        return Certificate(dict.fromkeys(EXPONENTS, np.inf), tolerance)
    with np.errstate(over="ignore", invalid="ignore"):
        measures, scales, signed = _measure(qvi, *vectors.values())
    finite = {name: float(value) if np.isfinite(value) else np.inf for name, value in measures.items()}
    return Certificate(finite, tolerance, scales, {name: float(v) for name, v in signed.items() if np.isfinite(v)})


def _measure(qvi: FrictionQVI, z: Vector, m_N: Vector, m_T: Vector, nu: Vector) -> tuple[dict[str, float], ...]:
    """All measures, scales, and measures with their signs; the formulas stand in the module's docstring."""
    body, gradient = qvi.state(z)
    scales = scales_at(qvi, z, body)
    S, E, E_b = scales["stress"], scales["energy"], scales["body_energy"]
    K, N, T, A = qvi.stiffness.K, qvi.contact.N, qvi.contact.T, qvi.contact.A
    residual = gradient + N.T @ m_N + T.T @ m_T + A.T @ nu
    error, outside = qvi.linear_system.solve(residual)
    square, size = float(residual @ error), float(np.sqrt(2.0 * E_b))
    # A z = b: a row is large by b, by a share of what cancels in A z, and by the largest row.
    equality = conjugate = 0.0
    if qvi.p:
        sizes = np.abs(qvi.b) + _CANCELS * (abs(A) @ np.abs(z))
        sizes += _BESIDE * sizes.max(initial=0.0)
        rounding = _ROUNDED * (abs(A) @ np.full(qvi.n, largest(z)))
        missed = np.maximum(np.abs(A @ z - qvi.b) - rounding, 0.0)
        equality = largest(missed / np.where(sizes > 0.0, sizes, 1.0))
        conjugate = largest(outside * sizes) / E
    # The error of z for its multipliers: in the energy norm, and in the contact tractions.
    energy = float(np.sqrt(abs(square))) / size
    if qvi.root is not None and energy > _ROUNDING_FREE:
        scales["rounding"] = min(qvi.root.rounding(z) / size, _ROUNDING_LIMIT)
        energy = max(energy - scales["rounding"], 0.0)
    tractions = max(largest(N @ error), largest(T @ error)) / S
    # What the linear solve has left, in a lower bound of its energy norm up to √(entries of a row).
    unsolved = _diagonal_norm(qvi, residual - K @ error - A.T @ outside) / size
    # |ρ|² once m_N is made admissible: the residual changes by Nᵀ(max(m_N, 0) − m_N).
    change = np.maximum(m_N, 0.0) - m_N
    if change.any():
        square += 2.0 * float(change @ (N @ error)) + float(change @ qvi.linear_system.relief(N)(change))
    law = law_residuals(qvi, z, m_N, m_T, scales)
    gap = law.work + 0.5 * abs(square)
    measures = {
        "equality": equality,
        "stationarity": max(energy, tractions, conjugate, unsolved),
        "energy_gap": (abs(law.work) + 0.5 * abs(square)) / E_b,
        **law.measures,
    }
    signed = {"energy_gap": float(np.copysign(measures["energy_gap"], gap)), "bipotential": law.bipotential / E}
    return measures, scales, signed


def _contact_scales(qvi: FrictionQVI) -> tuple[float, float]:
    """Length and stiffness of the contact; without one, or with tractions that nothing can change, any does."""
    return float(qvi.W.sum()) or 1.0, qvi.contact_stiffness or 1.0


def body_scales(qvi: FrictionQVI, body: float) -> tuple[float, float, float]:
    """Energy and stress of the body, and the traction up to which a contact carries nothing; `body` is its energy."""
    length, stiffness = _contact_scales(qvi)
    reference = length / stiffness  # energy of unit stress
    least = _LITTLE
    if body <= _NOTHING**2 * reference:  # next to nothing, unless the bonded state has no more
        bonded = qvi.bonded_state.strain_energy
        # only equations can cancel loads: those on a plate that is free to move
        loads = _diagonal_norm(qvi, qvi.f) if qvi.p else 0.0
        if 2.0 * bonded > (_CANCELLED * loads) ** 2:
            reference = min(reference, bonded)
        if body <= _NOTHING**2 * reference:
            body, least = reference, _NOTHING
    stress = float(np.sqrt(body * stiffness / length))
    return body, stress, least * stress


def scales_at(qvi: FrictionQVI, z: Vector, body: float | None = None) -> dict[str, float]:
    """Scales "stress", "displacement", "energy" of the contact and "body_energy" of the whole state z.

    `body` is the strain energy at z, if it is known already.
    """
    length, stiffness = _contact_scales(qvi)
    body, in_body, least = body_scales(qvi, qvi.state(z)[0] if body is None else body)
    stress = largest(qvi.tractions(z))
    stress = (in_body if stress <= least else stress) or 1.0
    displacement = stress / stiffness
    body = body if body > 0.0 else 1.0
    energy = min(stress * displacement * length, body)
    return {"stress": stress, "displacement": displacement, "energy": energy, "body_energy": body}


def _diagonal_norm(qvi: FrictionQVI, residual: Vector) -> float:
    """√(Σ r_i² / K_ii) of a residual or load (n,)."""
    diagonal = qvi.stiffness.diagonal
    return float(np.sqrt(np.sum(residual**2 / np.where(diagonal > 0.0, diagonal, 1.0))))
