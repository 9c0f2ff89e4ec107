"""Inner solver ``qp:<name>``: any back end of `qpsolvers`, the problem rebuilt for every bound.

Solves (`InnerProblem`) min ½xᵀPx + qᵀx, G x ≤ h, A x = b. The words "found" and "is_optimal" of `qpsolvers`
are not used: the former means different things for different back ends, the latter accepts multipliers of the
wrong sign. Cite: S. Caron et al., qpsolvers: Quadratic Programming Solvers in Python.
"""

import time
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix

from solvers.basics.status import Status
from solvers.basics.types import Vector, load
from solvers.inequality.problem import FrictionQVI
from solvers.inner.guard import within_time
from solvers.inner.problem import Centre, InnerProblem, InnerSolution, no_result
from solvers.inner.qp_backends import BACKENDS, QPBackend


class QPSolver:
    """One `qpsolvers` back end for one QVI."""

    def __init__(self, qvi: FrictionQVI, name: str, tolerance: float, options: Mapping[str, Any] | None = None) -> None:
        self.name = name
        self.backend = BACKENDS.get(name, QPBackend(name))
        self.packages: tuple[str, ...] = ("qpsolvers", self.backend.package or self.backend.module)
        self._inner = InnerProblem(qvi)
        self._settings = self.backend.settings(tolerance) if options is None else dict(options)
        matrices = (self._inner.P, self._inner.G, qvi.A)  # for qpsolvers sparse means csc_matrix, no sparse array
        self._matrices = [matrix.toarray() if self.backend.dense else csc_matrix(matrix) for matrix in matrices]

    def solve(self, threshold: Vector, centre: Centre, start: InnerSolution | None) -> InnerSolution:
        """Solve for the bound threshold (m,); warnings end in the message."""
        began = time.perf_counter()
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            answer = self._call(threshold, centre, start)
        seconds = time.perf_counter() - began
        word = self.backend.word(answer)
        status = self.backend.words.get(word, Status.BACKEND_FAILED)
        message = "; ".join([f"{self.name}: {word}", *(str(w.message) for w in caught)])
        return self._translate(answer, centre, status, message, seconds)

    def _call(self, threshold: Vector, centre: Centre, start: InnerSolution | None) -> Any:
        qpsolvers = load("qpsolvers")

        P, G, A = self._matrices
        equalities = (A, centre.b) if self._inner.qvi.p else (None, None)
        problem = qpsolvers.Problem(P, -centre.f, G, centre.h(threshold), *equalities)
        initial = start.z - centre.z if self.backend.warm and start is not None and start.finite else None
        settings = within_time(self._settings, self.backend.limit)
        return qpsolvers.solve_problem(problem, self.name, initvals=initial, **settings)

    def _translate(self, answer: Any, centre: Centre, status: Status, message: str, seconds: float) -> InnerSolution:
        """Read z and multipliers; where one is missing everything is."""
        qvi = self._inner.qvi
        if any(_size(part) != size for part, size in ((answer.x, qvi.n), (answer.z, 3 * qvi.m))):
            status = status if not status.usable else Status.BACKEND_FAILED
            return no_result(qvi, status, message, seconds)
        m_N, m_T = self._inner.multipliers(np.array(answer.z, dtype=np.float64))
        nu = np.array(answer.y, dtype=np.float64) if qvi.p else np.zeros(0)
        z = centre.z + np.array(answer.x, dtype=np.float64)
        return InnerSolution(z, m_N, m_T, nu, status, self.backend.iterations(answer), seconds, message)


def _size(array: Any) -> int:
    return 0 if array is None else int(np.size(array))
