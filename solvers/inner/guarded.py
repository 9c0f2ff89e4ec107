"""An inner solver whose answers are looked at before anybody works with them."""

import time
import warnings
from dataclasses import replace

from numpy.exceptions import ComplexWarning

from solvers.basics.status import Status
from solvers.basics.types import Vector
from solvers.inequality.problem import FrictionQVI
from solvers.inner.guard import BackendFailure, attempt, one_line, real_vector
from solvers.inner.problem import Centre, InnerSolution, InnerSolver, no_result


class Guarded:
    """Another inner solver; what it raises, and an answer that is none, is a result with the status backend_failed."""

    def __init__(self, name: str, qvi: FrictionQVI, solver: InnerSolver) -> None:
        self.packages = solver.packages
        self._name, self._qvi, self._solver = name, qvi, solver

    def solve(self, threshold: Vector, centre: Centre, start: InnerSolution | None) -> InnerSolution:
        """As `InnerSolver.solve`."""
        began = time.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("error", ComplexWarning)  # imaginary parts are not dropped
            answer = attempt(self._name, lambda: self._checked(self._solver.solve(threshold, centre, start)))
        if isinstance(answer, BackendFailure):
            return no_result(self._qvi, Status.BACKEND_FAILED, str(answer), time.perf_counter() - began)
        return answer

    def _checked(self, answer: object) -> InnerSolution:
        """An answer of the promised form, and finite where it claims to be one; how good it is others judge."""
        if not isinstance(answer, InnerSolution):
            raise TypeError(f"the answer is {type(answer).__name__}, not an InnerSolution")
        sizes = {"z": self._qvi.n, "m_N": self._qvi.m, "m_T": self._qvi.m, "nu": self._qvi.p}
        for part, size in sizes.items():
            real_vector(part, getattr(answer, part), size)
        message = one_line(answer.message)
        if answer.status.usable and not answer.finite:
            message = f"{message}; result is not finite"
            return no_result(self._qvi, Status.BACKEND_FAILED, message, answer.seconds)
        return replace(answer, message=message)
