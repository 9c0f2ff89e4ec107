"""Linear programs by HiGHS, accurate, within the time that is left."""

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
"""Status numbers of `linprog`; the first is that of a limit of steps too."""

_SOLVED, _FAILED = 0, 4
_NOTHING: Vector = np.zeros(0)
_LONGEST: Final = 300.0  # seconds
_LARGE: Final = 4000  # rows from which on the simplex method is slower, by more and more
_STEPS: Final = 2000  # of the interior point method with what follows it; usual are 11 to 250, and cycling has no end


class Answer(NamedTuple):
    """What `linprog` answered, in the form that it promises; without a solution vectors are empty."""

    status: int  # 0 if solved, else `TIME_LIMIT`, `INFEASIBLE`, `UNBOUNDED`, or 4: nothing is known
    message: str
    x: Vector = _NOTHING  # (n,), finite
    inequalities: Vector = _NOTHING  # (rows,) derivatives of the least cost by b_ub, ≤ 0
    equations: Vector = _NOTHING  # and by b_eq

    @property
    def solved(self) -> bool:
        """Whether there is a solution."""
        return self.status == _SOLVED


_INTERIOR: Final = (("highs-ipm", True, 1e-10), ("highs-ipm", True, 1e-7))
_SIMPLEX: Final = (("highs", True, 1e-10), ("highs", False, 1e-10))
"""Method, presolve, and tolerance of rows and of reduced costs."""


def solved(cost: Vector, *, bounds: Sequence[tuple[float | None, float | None]], **program: Any) -> Answer:
    """The answer of `linprog`, with bounds of every unknown.

    By the interior point method with a vertex at its end where the program is large; that is asked for less accuracy
    where it does not find a vertex otherwise. By the simplex method where the program is not large, and where the other
    fails or cycles; without presolve where presolve spoils it. Where a small program fails so the interior point method
    follows. One that raises, or answers in another form, has failed.
    """
    large = program["A_ub"].shape[0] > _LARGE
    towards = [end[int(c < 0.0)] for c, end in zip(cost.tolist(), bounds, strict=True) if c]
    least = all(end is not None and math.isfinite(end) for end in towards)  # bounds alone are a limit
    answer = Answer(_FAILED, "")
    for method, presolve, tolerance in (*_INTERIOR * large, *_SIMPLEX, *_INTERIOR * (not large)):
        options: dict[str, Any] = {"presolve": presolve, "time_limit": min(_LONGEST, deadline.left)}
        options |= dict.fromkeys(("primal_feasibility_tolerance", "dual_feasibility_tolerance"), tolerance)
        options |= {} if method == "highs" else {"maxiter": _STEPS}
        answer = _answer(cost, {**program, "bounds": bounds, "method": method, "options": options})
        if answer.solved:
            break  # rows and bound of a coarser one are checked by those who asked
        failed = answer.status == _FAILED or (least and answer.status == UNBOUNDED)
        final = not failed and (method == "highs" or answer.status != TIME_LIMIT)
        if final and tolerance == _INTERIOR[0][2]:
            break
    return answer


def _answer(cost: Vector, program: dict[str, Any]) -> Answer:
    """What `linprog` answers, checked."""
    from scipy.optimize import linprog  # slow to import, and few problems need it

    def ask() -> Answer:
        found = linprog(cost, **program)
        status, message = int(found.status), str(getattr(found, "message", ""))
        if status != _SOLVED:
            return Answer(status, message)
        rows = (program["A_ub"].shape[0], program["A_eq"].shape[0] if "A_eq" in program else 0)
        parts = (
            real_vector("x", found.x, len(cost)),
            real_vector("ineqlin.marginals", found.ineqlin.marginals, rows[0]),
            real_vector("eqlin.marginals", found.eqlin.marginals, rows[1]) if rows[1] else _NOTHING,
        )
        if not all(np.isfinite(part).all() for part in parts):
            return Answer(_FAILED, "the solution is not finite")
        return Answer(status, message, *parts)

    answer = attempt("linprog", ask)
    return Answer(_FAILED, answer) if isinstance(answer, BackendFailure) else answer


# Calls of back ends, which may fail in ways of their own.


_Answer = TypeVar("_Answer")

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
        if isinstance(error, TimeoutError) or not (isinstance(error, Exception) or type(error).__name__ == _PANIC):
            raise
        return BackendFailure(one_line(f"{name}: {type(error).__name__}: {error}"))


def real_vector(name: str, value: object, size: int) -> Vector:
    """What a back end has returned as `name`, where it is (size,) real numbers, finite or not; else `TypeError`."""
    array = np.asarray(value)
    if array.shape != (size,) or array.dtype.kind != "f":
        raise TypeError(f"{name} is {array.dtype}{list(array.shape)}, not {size} real numbers")
    return array


def within_time(settings: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Settings of a back end with its limit of time, called `name` if there is one, no longer than what is left."""
    seconds = deadline.left
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
        with warnings.catch_warnings():
            warnings.simplefilter("error", ComplexWarning)  # imaginary parts are not dropped
            answer = attempt(self._name, lambda: self._checked(self._solver.solve(threshold, centre, start)))
        if isinstance(answer, BackendFailure):
            return no_result(self._qvi, Status.BACKEND_FAILED, str(answer))
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
            return no_result(self._qvi, Status.BACKEND_FAILED, message)
        return replace(answer, message=message)
