"""Linear programs by HiGHS, accurate, within the time that is left."""

from typing import Any, Final, Literal, NamedTuple

from qvi_contact.basics.checks import FloatArray
from solvers.basics.foreign import foreign_code
from solvers.basics.watch import left

TIME_LIMIT, INFEASIBLE, UNBOUNDED = 1, 2, 3
"""Status numbers of `linprog`; the first is that of a limit of steps too."""

_SOLVED, _FAILED = 0, 4
_LONGEST: Final = 300.0  # seconds
_LARGE: Final = 4000  # rows from which on the simplex method is slower, by more and more
_STEPS: Final = 2000  # of the interior point method with what follows it; usual are 11 to 250, and cycling has no end


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


def solved(cost: FloatArray, **program: Any) -> Any:
    """The answer of `linprog`: by the interior point method with a vertex at its end where the program is large.

    That is asked for less accuracy where it does not find a vertex otherwise. By the simplex method where the program
    is not large, and where the other fails or cycles; without presolve where presolve spoils it.
    """
    from scipy.optimize import linprog  # slow to import, and few problems need it

    large = program["A_ub"].shape[0] > _LARGE
    for attempt in (*_INTERIOR * large, *_SIMPLEX):
        with foreign_code():
            answer = linprog(cost, method=attempt.method, options=attempt.options, **program)
        if attempt.settles(answer.status):
            break
    return answer
