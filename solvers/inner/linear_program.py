"""Linear programs by HiGHS, and calls of back ends whose failures become results."""

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np
from numpy.exceptions import ComplexWarning

from solvers.basics.foreign import foreign_code
from solvers.basics.progress import deadline
from solvers.basics.status import Status
from solvers.basics.types import Vector
from solvers.errors import one_line
from solvers.inequality.problem import FrictionQVI
from solvers.inner.problem import Centre, InnerSolution, InnerSolver, no_result

TIME_LIMIT, INFEASIBLE, UNBOUNDED = 1, 2, 3
"""Status numbers of `linprog`."""

_SOLVED, _FAILED = 0, 4
_NOTHING: Vector = np.zeros(0)
_LONGEST: Final = 300.0  # seconds of all attempts together
_LARGEST_SIMPLEX: Final = 4000  # rows up to which the simplex method is faster
_MOST_STEPS: Final = 2000  # of the interior point method with crossover; 11 to 250 are usual, cycling has no end
_MOST_PIVOTS: Final = 10  # steps of the simplex method, over rows and unknowns; up to 3 are usual


class Answer(NamedTuple):
    """A checked answer of `linprog`; without a solution its vectors are empty."""

    status: int  # 0 if solved, else `TIME_LIMIT`, `INFEASIBLE`, `UNBOUNDED`, or 4, failed
    message: str
    x: Vector = _NOTHING  # (n,), finite
    inequalities: Vector = _NOTHING  # (rows,) derivatives of the optimal cost by b_ub, ≤ 0
    equations: Vector = _NOTHING  # (rows,) derivatives of the optimal cost by b_eq

    @property
    def solved(self) -> bool:
        """Whether the program is solved."""
        return self.status == _SOLVED


_INTERIOR: Final = (("highs-ipm", True, 1e-10), ("highs-ipm", True, 1e-7))
_SIMPLEX: Final = (("highs", True, 1e-10), ("highs", False, 1e-10))
"""Attempts: method, presolve, tolerance of rows and reduced costs."""


def solved(cost: Vector, *, bounds: Sequence[tuple[float | None, float | None]], **program: Any) -> Answer:
    """The first usable answer of `linprog` for the minimum of cost · x, with bounds of every unknown.

    A large program is solved by the interior point method with crossover, at a lower accuracy if that finds no vertex;
    if it fails or cycles, by the simplex method. A small program is solved by the simplex method, without presolve if
    that fails or cycles, then by the interior point method. An attempt that raises, or whose answer has a wrong form,
    has failed.
    """
    rows = program["A_ub"].shape[0]
    most_pivots, is_large = _MOST_PIVOTS * (rows + len(cost)), rows > _LARGEST_SIMPLEX
    cost_bounds = [end[int(c < 0.0)] for c, end in zip(cost.tolist(), bounds, strict=True) if c]
    is_bounded = all(end is not None and math.isfinite(end) for end in cost_bounds)  # the cost, by the bounds alone
    answer = Answer(_FAILED, "")
    with deadline(_LONGEST):
        for method, presolve, tolerance in (*_INTERIOR * is_large, *_SIMPLEX, *_INTERIOR * (not is_large)):
            options: dict[str, Any] = {"presolve": presolve, "time_limit": deadline.left}
            options |= dict.fromkeys(("primal_feasibility_tolerance", "dual_feasibility_tolerance"), tolerance)
            options["maxiter"] = most_pivots if method == "highs" else _MOST_STEPS
            answer = _checked_answer(cost, {**program, "bounds": bounds, "method": method, "options": options})
            failed = answer.status == _FAILED or (is_bounded and answer.status == UNBOUNDED)
            is_final = deadline.over or not (failed or answer.status == TIME_LIMIT)
            if answer.solved or (is_final and tolerance == _INTERIOR[0][2]):
                break  # callers check a solution of lower accuracy
        if answer.status == TIME_LIMIT and not deadline.over:  # HiGHS has one number for limits of time and of steps
            return Answer(_FAILED, "all attempts reached their limits of steps")
    return answer


def _checked_answer(cost: Vector, program: dict[str, Any]) -> Answer:
    """The answer of one call of `linprog`, with its form checked."""
    from scipy.optimize import linprog  # slow to import, and few problems need it

    def call() -> Answer:
        result = linprog(cost, **program)
        status, message = int(result.status), str(getattr(result, "message", ""))
        if status != _SOLVED:
            return Answer(status, message)
        rows = (program["A_ub"].shape[0], program["A_eq"].shape[0] if "A_eq" in program else 0)
        parts = (
            real_vector("x", result.x, len(cost)),
            real_vector("ineqlin.marginals", result.ineqlin.marginals, rows[0]),
            real_vector("eqlin.marginals", result.eqlin.marginals, rows[1]) if rows[1] else _NOTHING,
        )
        if not all(np.isfinite(part).all() for part in parts):
            return Answer(_FAILED, "the solution is not finite")
        return Answer(status, message, *parts)

    answer = attempt("linprog", call)
    return Answer(_FAILED, answer) if isinstance(answer, BackendFailure) else answer


# Calls of back ends.

_Answer = TypeVar("_Answer")

_PANIC: Final = "PanicException"  # Rust's, which is not derived from Exception


class BackendFailure(str):
    """A sentence that says how a back end failed."""


def attempt(name: str, call: Callable[[], _Answer]) -> _Answer | BackendFailure:
    """The result of the call, or its failure; its output does not reach standard output.

    Panics of compiled back ends are failures. Interrupts, cancellations and time-outs are meant for the caller and are
    raised again.
    """
    try:
        with foreign_code():
            return call()
    except BaseException as error:
        if isinstance(error, TimeoutError) or not (isinstance(error, Exception) or type(error).__name__ == _PANIC):
            raise
        return BackendFailure(one_line(f"{name}: {type(error).__name__}: {error}"))


def real_vector(name: str, value: object, size: int) -> Vector:
    """The array `name` of a back end, if it has (size,) real numbers, finite or not; else `TypeError`."""
    array = np.asarray(value)
    if array.shape != (size,) or array.dtype.kind != "f":
        raise TypeError(f"{name} is {array.dtype}{list(array.shape)}, not {size} real numbers")
    return array


def within_time(settings: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Settings of a back end with its time limit `name` reduced to `deadline.left`; unchanged if it has none."""
    seconds = deadline.left
    if not name or seconds == math.inf:
        return dict(settings)
    return {**settings, name: min(seconds, settings.get(name, math.inf))}


# Inner solvers with checked answers.


class Guarded:
    """An inner solver whose exceptions and malformed answers become results with the status backend_failed."""

    def __init__(self, name: str, qvi: FrictionQVI, solver: InnerSolver) -> None:
        self.packages = solver.packages
        self._name, self._qvi, self._solver = name, qvi, solver

    def solve(self, threshold: Vector, centre: Centre, start: InnerSolution | None) -> InnerSolution:
        """As `InnerSolver.solve`."""
        with warnings.catch_warnings():
            warnings.simplefilter("error", ComplexWarning)  # complex answers are failures
            answer = attempt(self._name, lambda: self._checked(self._solver.solve(threshold, centre, start)))
        if isinstance(answer, BackendFailure):
            return no_result(self._qvi, Status.BACKEND_FAILED, str(answer))
        return answer

    def _checked(self, answer: object) -> InnerSolution:
        """The answer, if its arrays have the right sizes and a usable one is finite; its accuracy is not checked."""
        if not isinstance(answer, InnerSolution):
            raise TypeError(f"the answer is {type(answer).__name__}, not an InnerSolution")
        sizes = {"z": self._qvi.n, "m_N": self._qvi.m, "m_T": self._qvi.m, "nu": self._qvi.p}
        for part, size in sizes.items():
            real_vector(part, getattr(answer, part), size)
        message = one_line(answer.message)
        if answer.status.usable and not answer.finite:
            message = f"{message}; result is not finite"
            return no_result(self._qvi, Status.BACKEND_FAILED, message)
        return replace(answer, message=message)
