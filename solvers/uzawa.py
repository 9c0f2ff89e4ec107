"""The iterative procedure (4.1)-(4.4) of Więckowski 1992, K factored once.

With the unknowns λ = m / W, B = [N; T] and the compliance C = B K⁻¹ Bᵀ of the contact,

    (i)    λ_N = λ_T = 0
    (ii)   for i = 1, 2, …
    (4.1)      K z = f − Nᵀ W λ_N − Tᵀ W λ_T,   that is   (σ_N, σ_T) = σ_bonded − C W λ
    (4.2)      λ_N ← max(λ_N + ω_N σ_N, 0)
    (4.4)      Δ = ω_T (1 − thr(|σ_N|) / |σ_T|)
    (4.3)      λ_T ← 0 where σ_T = 0, elsewhere, with ± = sign σ_T,
               "printed":       ± max(max(± λ_T, 0) + Δ, 0),   and 0 where σ_N ≥ 0
               "accumulating":  λ_T ± Δ where Δ ≥ 0,   sign(λ_T) max(|λ_T| − |Δ|, 0) where Δ < 0

In (4.1) the sign of λ_T is corrected; (4.2) is corrected so that an open gap stays open. With equations K⁻¹ is the
inverse on the null space of A. At bilateral points λ_N = 0. The solutions of the QVI are fixed points of
"accumulating". They are not fixed points of "printed" if a gap is open. "printed" also fails where σ_N passes through
0: it sets λ_T to 0, which leaves |σ_T| > 0 without pressure. It drops λ_T when σ_T changes its sign.

| stops when                                                     | status before the certificate |
|----------------------------------------------------------------|-------------------------------|
| change of λ ≤ tolerance × |λ| and the certificate passes       | solved                        |
| λ returns to the value of 2 to 8 iterations ago                | cycling                       |
| step ω_T shrunk to round-off, no change any more               | stalled                       |
| λ no longer finite                                             | diverged                      |
| `max_iterations` done, or exactly `iterations`                 | max_iterations                |
| the time is over, see `deadline`                               | time_limit                    |

At mu = 0, and where the gap is open, Δ = ω_T is constant and the iteration ends in a cycle, unless `step_decay` reduces
the step.
"""

import time

import numpy as np
from scipy.linalg import eigvalsh

from solvers.basics.progress import Progress, deadline, report
from solvers.basics.status import Status
from solvers.basics.types import Vector
from solvers.certificate.certificate import certify
from solvers.inequality.problem import Compliance, FrictionQVI
from solvers.inequality.rows import largest
from solvers.inner.registry import versions
from solvers.settings import UzawaOptions
from solvers.solution import Iteration, Outcome

_CYCLE_PERIOD = 8
_CYCLE_EVERY = 64
_RECORD_ALL = 1000


def solve_uzawa(qvi: FrictionQVI, tolerance: float, options: UzawaOptions) -> Outcome:
    """Solve the QVI by the iteration of this module; z is that of (4.1) for the returned multipliers."""
    began = time.perf_counter()
    compliance, m, W2, printed = Compliance(qvi), qvi.m, np.concatenate([qvi.W, qvi.W]), options.rule == "printed"
    root = np.sqrt(qvi.W)
    radius = 0.0 if options.omega_N else eigvalsh(root[:, None] * compliance.dense[:m, :m] * root)[-1]  # of N K⁻¹ Nᵀ W
    omega_N = options.omega_N or (1.0 / radius if radius > 0.0 else 1.0)
    energy_bonded = qvi.energy(qvi.bonded)
    is_tested = options.iterations is None  # else the number of iterations is given
    limit = min(options.iterations or options.max_iterations, options.max_iterations)
    setup = time.perf_counter() - began
    lam: Vector = np.zeros(2 * m)  # (i)
    history, number, certify_at, snapshot = list[Iteration](), 0, 0, lam
    reason: Status | None = None
    message = ""
    while reason is None:
        number += 1
        sigma = compliance.bonded - compliance.dense @ (W2 * lam)  # (4.1)
        age = 0.0 if options.step_decay is None else (number - 1) / options.step_decay
        omega_T = options.omega_T * 2.0**-age
        sigma_N, sigma_T, old, sign = sigma[:m], sigma[m:], lam[m:], np.sign(sigma[m:])
        lambda_N = np.where(qvi.bilateral, 0.0, np.maximum(lam[:m] + omega_N * sigma_N, 0.0))  # (4.2)
        delta = omega_T * (1.0 - qvi.threshold(qvi.law.pressed(sigma_N)) / np.abs(sigma_T))  # (4.4)
        if printed:  # (4.3)
            lambda_T = sign * np.maximum(np.maximum(sign * old, 0.0) + delta, 0.0)
        else:
            shrunk = np.sign(old) * np.maximum(np.abs(old) + delta, 0.0)
            lambda_T = np.where(delta >= 0, old + sign * delta, shrunk)
        lambda_T[(sigma_T == 0) | (printed & (sigma_N >= 0) & ~qvi.bilateral)] = 0.0
        new = np.concatenate([lambda_N, lambda_T])
        scale = largest(new) or 1.0
        change = largest(new - lam) / scale
        # The energy is that of the bonded solution + ½ mᵀ C m, so that z is not needed.
        energy = energy_bonded + 0.5 * float((W2 * lam) @ (compliance.bonded - sigma))
        seconds = time.perf_counter() - began
        entry = Iteration(number, change, energy, float(qvi.W @ sigma_N), seconds=seconds)
        # All iterations up to 1000 are recorded, then those with three digits: 1010, 1020, …, 10100, 10200.
        if number <= _RECORD_ALL or not number % 10 ** (len(str(number)) - 3):
            history.append(entry)
            report(Progress("uzawa", entry))
        # The rows of the table above; λ of every 64th iteration, `snapshot`, is compared with the next 8.
        since = number % _CYCLE_EVERY
        snapshot = snapshot if since else lam
        if not np.isfinite(change):
            reason, message = Status.DIVERGED, "the multipliers are no longer finite"
        elif is_tested and change <= tolerance and number >= certify_at:
            passed = certify(qvi, *compliance.state(W2 * lam), tolerance).passed
            reason = Status.SOLVED if passed else Status.STALLED if change == 0.0 else None
            message = "the multipliers no longer change" if reason is Status.STALLED else ""
            certify_at = number + max(10, number // 10)
        elif is_tested and change > tolerance and number >= _CYCLE_EVERY and 2 <= since <= _CYCLE_PERIOD:
            is_cycle = largest(lam - snapshot) <= 1e-6 * change * scale
            reason, message = (Status.CYCLING, "the multipliers repeat themselves") if is_cycle else (None, "")
        if reason is None and (number >= limit or deadline.over):
            reason = Status.MAX_ITERATIONS if number >= limit else Status.TIME_LIMIT
        lam = new if reason is None else lam
    if history[-1].number != number:
        history.append(entry)
    state, package_versions = compliance.state(W2 * lam), versions(("scipy",))
    return Outcome(reason, *state, history, number, message, setup=setup, versions=package_versions)
