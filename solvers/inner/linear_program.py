"""Linear programs by HiGHS, accurate, within the time that is left."""

from dataclasses import dataclass, field
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from solvers.basics.progress import left
from solvers.basics.types import Vector
from solvers.inner.guard import BackendFailure, attempt, real_vector

TIME_LIMIT, INFEASIBLE, UNBOUNDED = 1, 2, 3
"""Status numbers of `linprog`; the first is that of a limit of steps too."""

_SOLVED, _FAILED = 0, 4
_LONGEST: Final = 300.0  # seconds
_LARGE: Final = 4000  # rows from which on the simplex method is slower, by more and more
_STEPS: Final = 2000  # of the interior point method with what follows it; usual are 11 to 250, and cycling has no end


def _none() -> Vector:
    return np.zeros(0)


@dataclass(frozen=True, eq=False)
class Answer:
    """What `linprog` answered, in the form that it promises.

    Attributes
    ----------
    status : int
        0 if solved, else `TIME_LIMIT`, `INFEASIBLE`, `UNBOUNDED`, or 4: nothing is known.
    message : str
        What is said about it.
    x : (n,) array
        The solution, finite; empty without one.
    inequalities, equations : (rows,) array
        Derivatives of the least cost by b_ub, ≤ 0, and by b_eq; empty without a solution.

    """

    status: int
    message: str
    x: Vector = field(default_factory=_none)
    inequalities: Vector = field(default_factory=_none)
    equations: Vector = field(default_factory=_none)

    @property
    def solved(self) -> bool:
        """Whether there is a solution."""
        return self.status == _SOLVED


class _Attempt(NamedTuple):
    method: Literal["highs", "highs-ipm"]
    presolve: bool = True
    tolerance: float = 1e-10  # of rows, and of reduced costs

    @property
    def is_simplex(self) -> bool:
        """Whether it is the simplex method, whose limits are final."""
        return self.method == "highs"

    @property
    def options(self) -> dict[str, Any]:
        """For `linprog`, now."""
        feasibility = dict.fromkeys(("primal_feasibility_tolerance", "dual_feasibility_tolerance"), self.tolerance)
        steps = {} if self.is_simplex else {"maxiter": _STEPS}
        return {**feasibility, **steps, "time_limit": min(_LONGEST, left()), "presolve": self.presolve}

    def settles(self, status: int) -> bool:
        """Whether an answer with this status is the last word.

        One of a coarser tolerance is only if it is a solution, whose rows and bound callers check.
        """
        if self.tolerance > _FINE.tolerance:
            return status == _SOLVED
        return status != _FAILED and (self.is_simplex or status != TIME_LIMIT)


_FINE: Final = _Attempt("highs-ipm")
_INTERIOR: Final = (_FINE, _Attempt("highs-ipm", tolerance=1e-7))
_SIMPLEX: Final = (_Attempt("highs"), _Attempt("highs", presolve=False))


def solved(cost: Vector, **program: Any) -> Answer:
    """The answer of `linprog`: by the interior point method with a vertex at its end where the program is large.

    That is asked for less accuracy where it does not find a vertex otherwise. By the simplex method where the program
    is not large, and where the other fails or cycles; without presolve where presolve spoils it. One that raises, or
    answers in another form, has failed.
    """
    large = program["A_ub"].shape[0] > _LARGE
    answer = Answer(_FAILED, "")
    for way in (*_INTERIOR * large, *_SIMPLEX):
        answer = _answer(way, cost, program)
        if way.settles(answer.status):
            break
    return answer


def _answer(way: _Attempt, cost: Vector, program: dict[str, Any]) -> Answer:
    """What `linprog` answers, checked."""
    from scipy.optimize import linprog  # slow to import, and few problems need it

    arguments: dict[str, Any] = {**program, "method": way.method, "options": way.options}

    def ask() -> Answer:
        found = linprog(cost, **arguments)
        status, message = int(found.status), str(getattr(found, "message", ""))
        if status != _SOLVED:
            return Answer(status, message)
        rows = (program["A_ub"].shape[0], program["A_eq"].shape[0] if "A_eq" in program else 0)
        answer = Answer(
            status,
            message,
            real_vector("x", found.x, len(cost)),
            real_vector("ineqlin.marginals", found.ineqlin.marginals, rows[0]),
            real_vector("eqlin.marginals", found.eqlin.marginals, rows[1]) if rows[1] else _none(),
        )
        if not all(np.isfinite(part).all() for part in (answer.x, answer.inequalities, answer.equations)):
            return Answer(_FAILED, "the solution is not finite")
        return answer

    answer = attempt("linprog", ask)
    return Answer(_FAILED, answer) if isinstance(answer, BackendFailure) else answer
