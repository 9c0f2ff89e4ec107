"""Calls of back ends, which may fail in ways of their own."""

import math
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final, TypeVar

import numpy as np
from numpy.exceptions import ComplexWarning

from solvers.basics.foreign import foreign_code
from solvers.basics.progress import left
from solvers.basics.status import Status
from solvers.basics.types import Module, Vector
from solvers.inequality.problem import FrictionQVI
from solvers.inner.problem import Centre, InnerSolution, InnerSolver, no_result

_Answer = TypeVar("_Answer")

_LONGEST: Final = 500  # characters of what a back end says
_PANIC: Final = "PanicException"  # of Rust, which is no Exception


class BackendFailure(str):
    """What went wrong inside a back end, in a sentence."""


def attempt(name: str, call: Callable[[], _Answer]) -> _Answer | BackendFailure:
    """What the call returns, or how it failed; what it prints does not reach standard output.

    Panics of compiled back ends are failures. Interrupts, cancellations and time-outs are not: they are meant for those
    who called, and go on.
    """
    try:
        with foreign_code():
            return call()
    except BaseException as error:
        if not is_failure(error):
            raise
        return BackendFailure(one_line(f"{name}: {type(error).__name__}: {error}"))


def is_failure(error: BaseException) -> bool:
    """Whether an exception is a failure of what was called, rather than a sign that it is to end."""
    if isinstance(error, Exception):
        return not isinstance(error, TimeoutError)
    return type(error).__name__ == _PANIC


def real_vector(name: str, value: object, size: int) -> Vector:
    """What a back end has returned as `name`, where it is (size,) real numbers, finite or not; else `TypeError`."""
    array = np.asarray(value)
    if array.shape != (size,) or array.dtype.kind != "f":
        raise TypeError(f"{name} is {array.dtype}{list(array.shape)}, not {size} real numbers")
    return array


def one_line(text: str) -> str:
    """The text without line breaks, cut where it is long."""
    joined = " ".join(text.split())
    return joined if len(joined) <= _LONGEST else f"{joined[: _LONGEST - 1]}…"


def solve_cvxpy(problem: Module, name: str, settings: Mapping[str, Any]) -> tuple[str, str]:
    """Solve a cvxpy problem by the back end `name`: its status word, and that word with the warnings it came with."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        problem.solve(solver=name.upper(), **settings)
    word = str(problem.status)
    return word, "; ".join([f"{name}: {word}", *(str(warning.message) for warning in caught)])


def updated_solve(solver: Module, q: Vector, b: Vector) -> Module:
    """Solve with a Clarabel solver that is kept, for new vectors q and b, in the time that is left."""
    settings, seconds = solver.get_settings(), left()
    if seconds < settings.time_limit:
        settings.time_limit = seconds
        solver.update(settings=settings)
    solver.update(q=q, b=b)
    return solver.solve()


def within_time(settings: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Settings of a back end with its limit of time, called `name` if there is one, no longer than what is left."""
    seconds = left()
    if not name or seconds == math.inf:
        return dict(settings)
    return {**settings, name: min(seconds, settings.get(name, math.inf))}


# An inner solver whose answers are looked at before anybody works with them.


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
