"""An inner solver whose answers are looked at before anybody works with them."""

import time
import warnings
from dataclasses import replace

import numpy as np
from numpy.exceptions import ComplexWarning

from solvers.basics.status import Status
from solvers.basics.types import Vector
from solvers.inequality.problem import FrictionQVI
from solvers.inner.guard import BackendFailure, attempt, one_line
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
            answer = attempt(self._name, lambda: self._solver.solve(threshold, centre, start))
        failure = answer if isinstance(answer, BackendFailure) else self._wrong(answer)
        if isinstance(answer, BackendFailure) or failure:
            return no_result(self._qvi, Status.BACKEND_FAILED, str(failure), time.perf_counter() - began)
        return replace(answer, message=one_line(answer.message))

    def _wrong(self, answer: object) -> str:
        """What is wrong with the form of an answer; its numbers are judged by others."""
        if not isinstance(answer, InnerSolution):
            return f"{self._name}: the answer is {type(answer).__name__}, not an InnerSolution"
        sizes = {"z": self._qvi.n, "m_N": self._qvi.m, "m_T": self._qvi.m, "nu": self._qvi.p}
        for part, size in sizes.items():
            array = np.asarray(getattr(answer, part))
            if array.shape != (size,) or array.dtype.kind != "f":
                return f"{self._name}: {part} is {array.dtype}{list(array.shape)}, not {size} real numbers"
        return ""
