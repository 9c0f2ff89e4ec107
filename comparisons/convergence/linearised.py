r"""Loops linearised at a solution: how fast they must converge there if open, slipping and sticking points stay so.

With x = √W σ, the compliance of the body seen by the contact Ĉ = √W B K⁻¹ Bᵀ √W, B = [N; T], and at the solution
O the open points (λ_N > 0), S the slipping ones (λ_T ≠ 0) with sign ς = sign σ_T and bound θ = thr(|σ_N|):

**Outer fixed point** s → |σ_N(s)|. A change δs moves the bounds of S by μ δs, and the multipliers of O and S hold the
tractions to it; so on all pressed points

    J = ∓ Ĉ_{N,A} Ĉ_{AA}⁺ [0; ς μ],    A = O ∪ S,    upper sign where σ_N < 0                                   (a)

The plain loop contracts by ρ(J), that damped by θ by ρ((1 − θ) I + θ J).

**Uzawa.** (4.2) is λ_N += ω_N σ_N on O, (4.3) and (4.4) are λ_T += ω_T (σ_T − ς θ)/θ on S, so that

    δλ⁺ = δλ − D G δλ,   D = diag(ω_N, ω_T/θ),   G = [Ĉ_{O,A}; Ĉ_{S,A} + ς μ Ĉ_{N(S),A}]                         (b)

and the eigenvalues e of D G other than zero have to obey |1 − e| < 1. Zero ones change the multipliers of dependent
rows and no traction. Where the bound does not move (μ = 0 with cohesion) and only one of the two kinds is there, it is
ω < 2 / λ_max of the dual operator, Ĉ_OO for ω_N, and

    ω_T < 2 / λ_max(Θ^(−1/2) Ĉ_SS Θ^(−1/2))                                                                    (c)

With all points with friction in place of S the limit is smaller, and holds for any set of points that slips on the way.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Literal

import numpy as np
from scipy.linalg import eigh, eigvals, eigvalsh, pinvh

from qvi_contact.basics.checks import FloatArray, IntArray
from solvers.basics.types import BoolVector, Matrix, Vector
from solvers.inequality.problem import Compliance
from solvers.solution import QVISolution

_NOTHING: Final = 1e-9
"""Eigenvalues below this share of the largest are zero."""


@dataclass(frozen=True, eq=False)
class Linearised:
    """What the loops of this module depend on.

    Attributes
    ----------
    compliance : Ĉ (2m, 2m)
    threshold : θ (m,)
    slipping, open : (m,) bool
    sign : ς (m,)
    moving : (m,), by how much θ moves with the pressure: μ, and 0 where the cap holds
    pressing : (m,), −1 where σ_N < 0, +1 where a bilateral point pulls, 0 elsewhere

    """

    compliance: Matrix
    threshold: Vector
    slipping: BoolVector
    open: BoolVector
    sign: Vector
    moving: Vector
    pressing: Vector

    def outer_contraction(self, damping: float = 1.0) -> float:
        """Spectral radius of the loop s + θ (|σ_N(s)| − s), J (m, m) of (a) in the norm of L²."""
        m, active = len(self.threshold), np.concatenate([self.open, self.slipping])
        bounds = np.concatenate([np.zeros((m, m)), np.diag(self.sign * self.moving)])[active]
        held = pinvh(self.compliance[np.ix_(active, active)], rtol=_NOTHING) @ bounds if active.any() else bounds
        J = self.pressing[:, None] * (self.compliance[:m, active] @ held)
        return _radius(eigvals((1.0 - damping) * np.eye(m) + damping * J))

    def uzawa_contraction(self, omega_T: float, omega_N: float) -> float:
        """Largest |1 − e| of (b); 0 where nothing is open or slips."""
        m, active = len(self.threshold), np.concatenate([self.open, self.slipping])
        if not active.any():
            return 0.0
        S = self.slipping
        if (self.threshold[S] <= 0.0).any():
            return float("inf")
        steps = np.concatenate([np.full(int(self.open.sum()), omega_N), omega_T / self.threshold[S]])
        G = self.compliance[np.ix_(active, active)]
        below = G[int(self.open.sum()) :]
        below -= (self.sign * self.moving * self.pressing)[S, None] * self.compliance[:m][np.ix_(S, active)]
        found = eigvals(steps[:, None] * G)
        return _radius(1.0 - found[np.abs(found) > _NOTHING * np.abs(found).max()])

    def tangential_limit(self, everywhere: bool = False) -> float | None:
        """2 / λ_max of (c) over the slipping points, or over all with friction; None if there are none."""
        chosen = self.threshold > 0.0 if everywhere else self.slipping
        if not chosen.any():
            return None
        return 0.0 if (self.threshold[chosen] <= 0.0).any() else _step_limit(self._scaled(chosen))

    def normal_limit(self, everywhere: bool = False) -> float | None:
        """2 / λ_max(Ĉ_OO), or of all of Ĉ_NN; None if there are no such points."""
        chosen = np.ones_like(self.open) if everywhere else self.open
        m = len(self.threshold)
        return _step_limit(self.compliance[:m, :m][np.ix_(chosen, chosen)]) if chosen.any() else None

    @cached_property
    def limits(self) -> tuple[float | None, float | None]:
        """Limits of ω_T and ω_N over all points."""
        return self.tangential_limit(everywhere=True), self.normal_limit(everywhere=True)

    def condition(self) -> float | None:
        """λ_max / λ_min of Θ^(−1/2) Ĉ_SS Θ^(−1/2), eigenvalues of dependent rows left out; None if nothing slips."""
        if not self.slipping.any() or (self.threshold[self.slipping] <= 0.0).any():
            return None
        values = eigvalsh(self._scaled(self.slipping))
        return float(values[-1] / values[values > _NOTHING * values[-1]][0])

    def _scaled(self, chosen: BoolVector) -> Matrix:
        """Θ^(−1/2) Ĉ_TT Θ^(−1/2) of these points."""
        m, root = len(self.threshold), 1.0 / np.sqrt(self.threshold[chosen])
        return np.asarray(root[:, None] * self.compliance[m:, m:][np.ix_(chosen, chosen)] * root)


def linearised(solution: QVISolution) -> Linearised:
    """Linearise at a solution, best one of an interior point method, whose multipliers decide who slips."""
    qvi, z = solution.problem, solution.z
    stiffness, weights = qvi.contact_stiffness, np.sqrt(np.concatenate([qvi.W, qvi.W]))
    normal, tangential = qvi.normal(z), qvi.tangential(z)
    lambda_N, lambda_T = solution.normal_multiplier / qvi.W, solution.tangential_multiplier / qvi.W
    is_open = (lambda_N * stiffness > -normal) & ~qvi.bilateral
    pressure = np.where(is_open, 0.0, qvi.pressure(z))  # what is left of it there is rounding
    threshold = qvi.threshold(pressure)
    return Linearised(
        weights[:, None] * Compliance(qvi).dense * weights,
        threshold,
        np.abs(lambda_T) * stiffness > threshold - np.abs(tangential),
        is_open,
        np.sign(tangential),
        np.where(qvi.cohesion + qvi.mu * pressure < qvi.cap, qvi.mu, 0.0),
        np.where(normal < 0.0, -1.0, np.where(qvi.bilateral & (normal > 0.0), 1.0, 0.0)),
    )


def _step_limit(matrix: Matrix) -> float:
    return float(2.0 / eigh(matrix, eigvals_only=True)[-1])


def _radius(values: Any) -> float:
    return float(np.abs(values).max(initial=0.0))


Course = Literal["converges", "cycles", "diverges", "wanders", "short"]

LEAST: Final = 4
"""Residuals without which there is no rate."""

LONGEST: Final = 40
"""Residuals that are fitted at most, from the end."""

FLOOR: Final = 1e-12
"""Residuals below this are rounding."""

_SAME: Final = 1e-3  # change of log r that is none


@dataclass(frozen=True)
class Rate:
    """What a sequence of residuals does: its course, and exp(b) with its interval, see `rate_of`."""

    course: Course
    factor: float | None = None
    low: float | None = None
    high: float | None = None
    fitted: int = 0


def rate_of(residuals: Sequence[float], target: float = 0.0) -> Rate:
    """Rate and course of the residuals (k,) ≥ 0 of the iterations of a loop.

    The last residuals above a floor, r_k, are fitted by log r_k = a + b k, b the slope of Theil and Sen (the median
    over all pairs, so that single lucky or spoilt iterations do not count) with its confidence interval of 95 %, as if
    residuals were independent. Then, n the length of the fitted piece in iterations and b₋ ≤ b ≤ b₊ the interval,

        converges    the last residual is at the target, or exp(b₊ n) < 1/2: certainly falling by more than half
        cycles       r_k = r_{k−p} to a thousandth all along, for a period p ≤ 8, p = 1 included
        diverges     exp(b₋ n) > 2, or the last residual is no number
        wanders      none of these
        short        fewer than four residuals

    Where an iteration has no residual (its inner problem failed, say) the loop began anew, and only what follows
    counts. Source: P. K. Sen, J. Amer. Statist. Assoc. 63 (1968).
    """
    values = np.asarray(residuals, dtype=float)
    missing = np.flatnonzero(~np.isfinite(values))
    if len(missing) and missing[-1] == len(values) - 1:
        return Rate("diverges")
    values = values[missing[-1] + 1 :] if len(missing) else values
    above = np.flatnonzero(values > FLOOR)
    # half of them, but all of a few and no more than `LONGEST`
    number = above[-min(max((len(above) + 1) // 2, min(len(above), 2 * LEAST)), LONGEST) :]
    arrived = len(values) > 0 and values[-1] <= max(target, FLOOR)
    if len(number) < LEAST:
        return Rate("converges" if arrived else "short", fitted=len(number))
    logs, length = np.log(values[number]), float(number[-1] - number[0])
    slope, low, high = _slope(logs, number)
    cycles = any(len(logs) >= 2 * p and np.abs(logs[p:] - logs[:-p]).max() <= _SAME for p in range(1, 9))
    half = float(np.log(2.0))
    course: Course = "wanders"
    if arrived or (not cycles and high * length < -half):
        course = "converges"
    elif cycles or low * length > half:
        course = "cycles" if cycles else "diverges"
    return Rate(course, float(np.exp(slope)), float(np.exp(low)), float(np.exp(high)), len(number))


def _slope(y: FloatArray, x: FloatArray | IntArray) -> tuple[float, float, float]:
    """Slope of Theil and Sen, and the ends of its confidence interval."""
    from scipy.stats import theilslopes  # as long to load as all else of a worker

    slope, _, low, high = theilslopes(y, x, 0.95)
    return float(slope), float(low), float(high)


def first_lasting(errors: Sequence[float], numbers: Sequence[int], target: float) -> int | None:
    """The first iteration from which all errors on record are at the target or below.

    None if there is none, or less than a fifth of all iterations are left after it: what comes that late may be a phase
    of a cycle.

    Parameters
    ----------
    errors, numbers : sequences of the same length
        Errors and the numbers of their iterations, in order; gaps between numbers are allowed.
    target : float
        Largest error allowed.

    """
    within = np.asarray(errors) <= target  # nan is not
    outside = np.flatnonzero(~within)
    first = int(outside[-1]) + 1 if len(outside) else 0
    if first >= len(within) or numbers[first] > 0.8 * numbers[-1]:
        return None
    return int(numbers[first])


def growth_order(sizes: Sequence[float], values: Sequence[float]) -> float | None:
    """The p of values ∝ sizes^p by the slope of Theil and Sen in logarithms; None with fewer than three pairs.

    Pairs with what is no number, or not positive, are left out.
    """
    pairs = [(size, value) for size, value in zip(sizes, values, strict=True) if size > 0 and value > 0]
    if len(pairs) < 3:
        return None
    x, y = np.log(np.array(pairs)).T
    return _slope(y, x)[0]
