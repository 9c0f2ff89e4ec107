"""Inner solver ``direct:osqp``: one OSQP solver kept alive, bounds updated, warm-started.

Operator splitting (ADMM) on l ≤ [A; N; T] x ≤ u: the friction bound is an interval, which makes two thirds
of the rows of the other quadratic programs. Polishing can spoil a good dual, so the problem is solved with
and without it and the result with the smaller residual is kept. Cite: B. Stellato et al., OSQP: an operator
splitting solver for quadratic programs, Math. Prog. Comp. 2020.
"""

import math
import time
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix, triu, vstack

from solvers.basics.status import Status
from solvers.basics.types import Module, Vector, load
from solvers.basics.watch import left
from solvers.inequality.problem import FrictionQVI
from solvers.inner.problem import Centre, InnerSolution, inner_residual, no_result
from solvers.inner.qp_backends import OSQP_WORDS

_FLOOR = 1e-11
_MAX_ITERATIONS = 50_000


class DirectOSQP:
    """OSQP on  l ≤ [A; N; T] x ≤ u  with  l = (b, −∞, −thr − t0), u = (b, −n0, thr − t0)."""

    packages: tuple[str, ...] = ("osqp",)

    def __init__(self, qvi: FrictionQVI, tolerance: float, options: Mapping[str, Any] | None = None) -> None:
        osqp = load("osqp")

        self._qvi = qvi
        self._solver = osqp.OSQP()
        self._rows = csc_matrix(vstack([qvi.A, qvi.N, qvi.T]))
        bound = np.ones(qvi.p + 2 * qvi.m)  # of no meaning, as q = 0: every solve sets its own
        self._solver.setup(
            P=csc_matrix(triu(qvi.K)), q=np.zeros(qvi.n), A=self._rows, l=-bound, u=bound,
            verbose=False, polishing=False, polish_refine_iter=10,
            **(_settings(tolerance) if options is None else options),
        )  # fmt: skip

    def solve(self, threshold: Vector, centre: Centre, start: InnerSolution | None) -> InnerSolution:
        """Solve for the bound threshold (m,); warm start from the solver's own multipliers and `start`."""
        began = time.perf_counter()
        with warnings.catch_warnings(record=True):
            warnings.simplefilter("always")
            plain, polished = self._twice(threshold, centre, start, began)
        if polished is None:
            return plain
        return min(plain, polished, key=lambda result: inner_residual(self._qvi, threshold, result))

    def _twice(
        self, threshold: Vector, centre: Centre, start: InnerSolution | None, began: float
    ) -> tuple[InnerSolution, InnerSolution | None]:
        """Without polishing, and polished from there (``None`` if there is nothing to polish)."""
        lower = np.concatenate([centre.b, np.full(self._qvi.m, -np.inf), -threshold - centre.t0])
        upper = np.concatenate([centre.b, -centre.n0, threshold - centre.t0])
        self._solver.update(q=-centre.f, l=lower, u=upper)
        self._limit_time()
        if start is not None and start.finite:
            self._solver.warm_start(x=start.z - centre.z)
        plain = self._read(self._solver.solve(raise_error=False), centre, began)
        if not plain.status.usable or not self._active(plain, centre, lower, upper):
            return plain, None
        self._solver.update_settings(polishing=True)
        self._limit_time()
        try:
            polished = self._read(self._solver.solve(raise_error=False), centre, began)
        finally:
            self._solver.update_settings(polishing=False)
        return plain, polished

    def _limit_time(self) -> None:
        """What is left of the time, if there is a limit."""
        seconds = left()
        if seconds < math.inf:
            self._solver.update_settings(time_limit=min(seconds, self._solver.settings.time_limit))

    def _active(self, plain: InnerSolution, centre: Centre, lower: Vector, upper: Vector) -> bool:
        """Whether polishing has an active row to work with; without one OSQP writes on standard output."""
        values = self._rows @ (plain.z - centre.z)
        y = np.concatenate([plain.nu, plain.m_N, plain.m_T])
        size = float(np.abs(y).max(initial=0.0))
        clear = np.abs(y) > 1e-6 * size
        return bool((clear & ((values - lower < -y) | (upper - values < y))).any()) and size > 0

    def _read(self, answer: Module, centre: Centre, began: float) -> InnerSolution:
        qvi, word = self._qvi, str(answer.info.status)
        status = OSQP_WORDS.get(word, Status.BACKEND_FAILED)
        seconds = time.perf_counter() - began
        if answer.x is None or answer.y is None or not np.isfinite(answer.x).all():
            status = status if not status.usable else Status.BACKEND_FAILED
            return no_result(qvi, status, f"osqp: {word}", seconds)
        nu, m_N, m_T = np.split(np.array(answer.y), [qvi.p, qvi.p + qvi.m])
        return InnerSolution(
            centre.z + np.array(answer.x),
            m_N,
            m_T,
            nu,
            status,
            int(answer.info.iter),
            seconds,
            f"osqp: {word}",
        )


def _settings(tolerance: float) -> dict[str, Any]:
    """OSQP's settings for a tolerance."""
    return {**dict.fromkeys(("eps_abs", "eps_rel"), max(tolerance, _FLOOR)), "max_iter": _MAX_ITERATIONS}
