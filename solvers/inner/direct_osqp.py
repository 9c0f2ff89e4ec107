"""Inner solver ``direct:osqp``: one OSQP solver kept alive, bounds updated, warm-started.

Operator splitting (ADMM) on l ≤ [A; N; T] z ≤ u: the friction bound is an interval, which makes two thirds
of the rows of the other quadratic programs. Polishing can spoil a good dual, so the problem is solved with
and without it and the result with the smaller residual is kept. Cite: B. Stellato et al., OSQP: an operator
splitting solver for quadratic programs, Math. Prog. Comp. 2020.
"""

import time
import warnings

import numpy as np
from scipy.sparse import csc_matrix, triu, vstack

from solvers.inner.problem import InnerSolution, inner_residual, no_result
from solvers.inner.qp_backends import OSQP_WORDS
from solvers.problem import FrictionQVI
from solvers.status import Status
from solvers.types import Module, Vector, load

_FLOOR = 1e-11
_MAX_ITERATIONS = 50_000


class DirectOSQP:
    """OSQP on  l ≤ [A; N; T] z ≤ u  with  l = (b, −∞, −thr − t0), u = (b, −n0, thr − t0)."""

    packages: tuple[str, ...] = ("osqp",)

    def __init__(self, qvi: FrictionQVI, tolerance: float) -> None:
        osqp = load("osqp")

        self._qvi = qvi
        self._solver = osqp.OSQP()
        self._rows = csc_matrix(vstack([qvi.A, qvi.N, qvi.T]))
        lower, upper = self._bounds(np.ones(qvi.m))
        self._solver.setup(
            P=csc_matrix(triu(qvi.K)), q=-qvi.f, A=self._rows, l=lower, u=upper,
            verbose=False, eps_abs=max(tolerance, _FLOOR), eps_rel=max(tolerance, _FLOOR),
            max_iter=_MAX_ITERATIONS, polishing=False, polish_refine_iter=10,
        )  # fmt: skip

    def _bounds(self, threshold: Vector) -> tuple[Vector, Vector]:
        qvi = self._qvi
        lower = np.concatenate([qvi.b, np.full(qvi.m, -np.inf), -threshold - qvi.t0])
        return lower, np.concatenate([qvi.b, -qvi.n0, threshold - qvi.t0])

    def solve(self, threshold: Vector, start: InnerSolution | None) -> InnerSolution:  # noqa: ARG002
        """Solve for the bound threshold (m,); the solver's own last state is the start."""
        began = time.perf_counter()
        with warnings.catch_warnings(record=True):
            warnings.simplefilter("always")
            try:
                plain, polished = self._twice(threshold, began)
            except Exception as error:
                text = f"osqp: {type(error).__name__}: {error}"
                return no_result(self._qvi, Status.BACKEND_FAILED, text, time.perf_counter() - began)
        if polished is None:
            return plain
        return min(plain, polished, key=lambda result: inner_residual(self._qvi, threshold, result))

    def _twice(self, threshold: Vector, began: float) -> tuple[InnerSolution, InnerSolution | None]:
        """Without polishing, and polished from there (``None`` if there is nothing to polish)."""
        lower, upper = self._bounds(threshold)
        self._solver.update(l=lower, u=upper)
        plain = self._read(self._solver.solve(raise_error=False), threshold, began)
        if not plain.status.usable or not self._active(plain, lower, upper):
            return plain, None
        self._solver.update_settings(polishing=True)
        try:
            polished = self._read(self._solver.solve(raise_error=False), threshold, began)
        finally:
            self._solver.update_settings(polishing=False)
        return plain, polished

    def _active(self, plain: InnerSolution, lower: Vector, upper: Vector) -> bool:
        """Whether polishing has an active row to work with; without one OSQP writes on standard output."""
        values = self._rows @ plain.z
        y = np.concatenate([plain.nu, plain.m_N, plain.m_T])
        size = float(np.abs(y).max(initial=0.0))
        clear = np.abs(y) > 1e-6 * size
        return bool((clear & ((values - lower < -y) | (upper - values < y))).any()) and size > 0

    def _read(self, answer: Module, threshold: Vector, began: float) -> InnerSolution:  # noqa: ARG002
        qvi, word = self._qvi, str(answer.info.status)
        status = OSQP_WORDS.get(word, Status.BACKEND_FAILED)
        seconds = time.perf_counter() - began
        if answer.x is None or answer.y is None or not np.isfinite(answer.x).all():
            status = status if not status.usable else Status.BACKEND_FAILED
            return no_result(qvi, status, f"osqp: {word}", seconds)
        nu, m_N, m_T = np.split(np.array(answer.y), [qvi.p, qvi.p + qvi.m])
        return InnerSolution(
            np.array(answer.x), m_N, m_T, nu, status, int(answer.info.iter), seconds, f"osqp: {word}"
        )
