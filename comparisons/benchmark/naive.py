"""The loop one would write first in cvxpy: a quadratic program in all unknowns for each pressure, until it stays.

    s = 0;  repeat  z = argmin ½ zᵀKz − fᵀz  with  N z + n0 ≤ 0, |T z + t0| ≤ thr(s);  s ← max(−(N z + n0), 0)

without centring, acceleration or elimination. The certificate is that of every other method.
"""

from typing import Any, Final

import numpy as np

from qvi_contact import Discretization
from solvers import FrictionQVI, certify
from solvers.basics.types import Vector, load

_ITERATIONS: Final = 100
_INNER: Final = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), 1e-12)  # as of the package's own loops


def cvxpy_loop(discretization: Discretization, tolerance: float) -> dict[str, Any]:
    """Solve with Clarabel and report as `task.loop` does; for problems without plates driven by force."""
    qvi, scales = discretization.qvi, discretization.scales
    z, m_N, m_T, iterations = _iterated(qvi, tolerance)
    certificate = certify(qvi, z, m_N, m_T, np.zeros(qvi.p), tolerance)
    return {
        "status": "solved" if certificate.passed else "inaccurate",
        "message": certificate.summary(),
        "unknowns": qvi.n,
        "contact_points": qvi.m,
        "iterations": iterations,
        "accuracy": certificate.accuracy,
        "half_force": -scales.stress * scales.length * qvi.resultant(z),
    }


def _iterated(qvi: FrictionQVI, tolerance: float) -> tuple[Vector, Vector, Vector, int]:
    """(z, m_N, m_T) when the pressure has changed by less than the tolerance, and the number of programs."""
    cp = load("cvxpy")
    x, bound = cp.Variable(qvi.n), cp.Parameter(qvi.m, nonneg=True)
    normal, shear = qvi.N @ x + qvi.n0, qvi.T @ x + qvi.t0
    laws = [normal <= 0, shear <= bound, -shear <= bound]
    problem = cp.Problem(cp.Minimize(0.5 * cp.quad_form(x, cp.psd_wrap(qvi.K)) - qvi.f @ x), laws)
    pressure, number, change = np.zeros(qvi.m), 0, np.inf
    while change > tolerance and number < _ITERATIONS:
        bound.value = qvi.threshold(pressure)
        problem.solve(solver="CLARABEL", **_INNER)
        before, pressure, number = pressure, qvi.pressure(x.value), number + 1
        change = float(np.linalg.norm(pressure - before) / np.linalg.norm(pressure))
    m_N, above, below = (np.asarray(law.dual_value) for law in laws)
    return np.asarray(x.value), m_N, above - below, number
