"""The iterative procedure (4.1)-(4.4) of Więckowski 1992, K factored once.

With λ = m / W as the unknowns, B = [N; T] and C = B K⁻¹ Bᵀ (the compliance seen by the contact points),

    (i)    λ_N = λ_T = 0
    (ii)   for i = 1, 2, …
    (4.1)      K z = f − Nᵀ W λ_N − Tᵀ W λ_T,   that is   (σ_N, σ_T) = σ_bonded − C W λ
    (4.2)      λ_N ← max(λ_N + ω_N σ_N, 0)
    (4.4)      Δ = ω_T (1 − thr(|σ_N|) / |σ_T|)
    (4.3)      λ_T ← 0 where σ_T = 0, elsewhere, with ± = sign σ_T,
               "printed":       ± max(max(± λ_T, 0) + Δ, 0),   and 0 where σ_N ≥ 0
               "accumulating":  λ_T ± Δ where Δ ≥ 0,   sign(λ_T) max(|λ_T| − |Δ|, 0) where Δ < 0

(4.1) has the sign of λ_T corrected, (4.2) the correction that keeps an open gap open; with equality rows
K⁻¹ is that of the constrained system. The solutions of the QVI are fixed points of "accumulating". Those of
"printed" with an open gap are not, nor is it safe where σ_N passes through 0: λ_T is set to 0 there, which
leaves |σ_T| > 0 without pressure. "printed" also forgets λ_T when σ_T changes its sign.
Where a row is bilateral, λ_N = 0.

| stops when                                                     | status before the certificate |
|----------------------------------------------------------------|-------------------------------|
| change of λ ≤ tolerance × |λ| and the certificate passes       | solved                        |
| λ returns to the value of 2 to 8 iterations ago                | cycling                       |
| step ω_T shrunk to round-off, no change any more               | stalled                       |
| λ no longer finite                                             | diverged                      |
| `max_iterations` done, or exactly `iterations`                 | max_iterations                |
| the time is over, see `deadline`                                 | time_limit                    |

At mu = 0, and where the gap is open, Δ = ω_T never shrinks and the iteration ends in a cycle; `step_decay`
shrinks the step.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from solvers.basics.checks import one_of, positive_number, whole_number
from solvers.basics.progress import Progress, deadline, report
from solvers.basics.status import Status
from solvers.basics.types import Vector
from solvers.certificate.certificate import certify
from solvers.inequality.problem import Compliance, FrictionQVI
from solvers.inner.registry import versions
from solvers.solution import Iteration, Outcome

Rule = Literal["printed", "accumulating"]
Decay = Literal["geometric", "harmonic"]

_CYCLE_PERIOD = 8
_CYCLE_EVERY = 64
_RECORD_ALL = 1000


@dataclass(frozen=True)
class UzawaOptions:
    """Options of the Uzawa procedure.

    Attributes
    ----------
    rule : "accumulating" (default) or "printed", see the module
    omega_T : step of λ_T, a displacement (dimensionless)
    omega_N : step of λ_N, displacement per stress; default 1 / the spectral radius of N K⁻¹ Nᵀ W
    step_decay : iterations k0 in which a shrinking step halves; None: it does not shrink
    decay : "geometric", ω_T 2^(−i / k0), or "harmonic", ω_T / (1 + i / k0)
    max_iterations : limit
    iterations : do exactly this many, without any stopping test (the paper's 30)
    callback : called with every recorded `Iteration`

    """

    rule: Rule = "accumulating"
    omega_T: float = 0.01  # noqa: N815
    omega_N: float | None = None  # noqa: N815
    step_decay: float | None = None
    decay: Decay = "geometric"
    max_iterations: int = 100_000
    iterations: int | None = None
    callback: Callable[[Iteration], object] | None = None

    def __post_init__(self) -> None:
        for name, choices in (("rule", get_args(Rule)), ("decay", get_args(Decay))):
            one_of(name, getattr(self, name), choices)
        for name in ("omega_T", "omega_N", "step_decay"):
            if getattr(self, name) is not None:
                positive_number(name, getattr(self, name))
        for name in ("max_iterations", "iterations"):
            if getattr(self, name) is not None:
                whole_number(name, getattr(self, name))


@dataclass(eq=False)
class _State:
    """λ (2m,) that gave σ (2m,), and the bookkeeping of the stopping tests."""

    lam: Vector
    sigma: Vector
    number: int = 0
    change: float = np.inf
    scale: float = 1.0
    snapshot: Vector | None = None
    certify_at: int = 0
    history: list[Iteration] = field(default_factory=list)
    reason: Status | None = None
    message: str = ""


def solve_uzawa(qvi: FrictionQVI, tolerance: float, options: UzawaOptions) -> Outcome:
    """Run the procedure of this module; z belongs to the multipliers it was computed from in (4.1)."""
    began = time.perf_counter()
    compliance = Compliance(qvi)
    omega_N = options.omega_N or _default_step(qvi, compliance)
    state = _State(np.zeros(2 * qvi.m), compliance.bonded)  # (i)
    W2 = np.concatenate([qvi.W, qvi.W])
    set_up = time.perf_counter()
    while state.reason is None:
        state.number += 1
        state.sigma = compliance.bonded - compliance.relief(W2 * state.lam)  # (4.1)
        new = _update(qvi, state, omega_N, _step_length(options, state.number), options.rule)
        _measure(state, new)
        _record(state, qvi, W2, options, began)
        _terminate(qvi, compliance, state, W2, options, tolerance)
        if state.reason is None:
            state.lam = new
    m = W2 * state.lam
    z, nu = compliance.unknowns(m)
    if state.history[-1].number != state.number:
        state.history.append(_iteration(state, qvi, W2, set_up))
    return Outcome(
        state.reason, z, m[: qvi.m], m[qvi.m :], nu, state.history, state.number, state.message, setup=set_up - began,
        versions=versions(("scipy",)),
    )  # fmt: skip


def _default_step(qvi: FrictionQVI, compliance: Compliance) -> float:
    """ω_N = 1 / spectral radius of N K⁻¹ Nᵀ W, by power iteration."""
    v, radius = np.ones(qvi.m), 0.0
    for _ in range(50):
        v = compliance.relief(np.concatenate([qvi.W * v, np.zeros(qvi.m)]))[: qvi.m]
        radius = float(np.abs(v).max(initial=0.0))
        if radius == 0.0:
            return 1.0
        v = v / radius
    return 1.0 / radius


def _step_length(options: UzawaOptions, number: int) -> float:
    if options.step_decay is None:
        return options.omega_T
    age = (number - 1) / options.step_decay
    return options.omega_T * (2.0**-age if options.decay == "geometric" else 1.0 / (1.0 + age))


def _update(qvi: FrictionQVI, state: _State, omega_N: float, omega_T: float, rule: Rule) -> Vector:
    """(4.2)-(4.4)."""
    m = qvi.m
    sigma_N, sigma_T = state.sigma[:m], state.sigma[m:]
    lambda_N = np.where(qvi.bilateral, 0.0, np.maximum(state.lam[:m] + omega_N * sigma_N, 0.0))  # (4.2)
    old = state.lam[m:]
    delta = omega_T * (1.0 - qvi.threshold(qvi.law.pressed(sigma_N)) / np.abs(sigma_T))  # (4.4)
    sign = np.sign(sigma_T)
    if rule == "printed":  # (4.3)
        new = sign * np.maximum(np.maximum(sign * old, 0.0) + delta, 0.0)
    else:
        shrunk = np.sign(old) * np.maximum(np.abs(old) + delta, 0.0)
        new = np.where(delta >= 0, old + sign * delta, shrunk)
    new[(sigma_T == 0) | ((rule == "printed") & (sigma_N >= 0) & ~qvi.bilateral)] = 0.0
    return np.concatenate([lambda_N, new])


def _measure(state: _State, new: Vector) -> None:
    state.scale = float(np.abs(new).max(initial=0.0)) or 1.0
    state.change = float(np.abs(new - state.lam).max(initial=0.0)) / state.scale


def _record(state: _State, qvi: FrictionQVI, W2: Vector, options: UzawaOptions, began: float) -> None:
    """Every iteration up to a thousand, then those with three digits: 1010, 1020, …, 10100, 10200."""
    i = state.number
    if i > _RECORD_ALL and i % 10 ** (len(str(i)) - 3):
        return
    entry = _iteration(state, qvi, W2, began)
    state.history.append(entry)
    report(Progress("uzawa", entry))
    if options.callback is not None:
        options.callback(entry)


def _iteration(state: _State, qvi: FrictionQVI, W2: Vector, began: float) -> Iteration:
    """Record without z: the energy is that of the bonded solution + ½ mᵀ C m."""
    bonded = np.concatenate([qvi.normal(qvi.bonded), qvi.tangential(qvi.bonded)])
    energy = qvi.energy(qvi.bonded) + 0.5 * float((W2 * state.lam) @ (bonded - state.sigma))
    resultant = float(qvi.W @ state.sigma[: qvi.m])
    return Iteration(state.number, state.change, energy, resultant, seconds=time.perf_counter() - began)


def _terminate(
    qvi: FrictionQVI,
    compliance: Compliance,
    state: _State,
    W2: Vector,
    options: UzawaOptions,
    tolerance: float,
) -> None:
    """Apply the table of this module, row by row."""
    i = state.number
    if not np.isfinite(state.change):
        state.reason, state.message = Status.DIVERGED, "the multipliers are no longer finite"
    elif options.iterations is not None:
        state.reason = Status.MAX_ITERATIONS if i >= options.iterations else None
    elif state.change <= tolerance and i >= state.certify_at:
        z, nu = compliance.unknowns(W2 * state.lam)
        m_N, m_T = np.split(W2 * state.lam, 2)
        if certify(qvi, z, m_N, m_T, nu, tolerance).passed:
            state.reason = Status.SOLVED
        elif state.change == 0.0:
            state.reason, state.message = Status.STALLED, "the multipliers no longer change"
        state.certify_at = i + max(10, i // 10)
    elif _cycles(state, tolerance):
        state.reason, state.message = Status.CYCLING, "the multipliers repeat themselves"
    if state.reason is None and i >= options.max_iterations:
        state.reason = Status.MAX_ITERATIONS
    if state.reason is None and deadline.over:
        state.reason = Status.TIME_LIMIT


def _cycles(state: _State, tolerance: float) -> bool:
    """Compare with a snapshot taken every 64 iterations, up to 8 iterations after it."""
    age = state.number % _CYCLE_EVERY
    if age == 0:
        state.snapshot = state.lam
    if state.snapshot is None or not 2 <= age <= _CYCLE_PERIOD or state.change <= tolerance:
        return False
    return bool(np.abs(state.lam - state.snapshot).max(initial=0.0) <= 1e-6 * state.change * state.scale)
