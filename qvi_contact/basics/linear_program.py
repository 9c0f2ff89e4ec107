"""Linear programs by HiGHS, accurate, within the time that is left."""

from typing import Any, Final

from scipy.optimize import linprog

from qvi_contact.basics.checks import FloatArray
from solvers.basics.watch import left

TIME_LIMIT, INFEASIBLE, UNBOUNDED = 1, 2, 3
"""Status numbers of `linprog`."""

_FAILED: Final = 4
_LONGEST: Final = 300.0  # seconds
_OPTIONS: Final = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


def solved(cost: FloatArray, **program: Any) -> Any:
    """The answer of `linprog` to a program; without presolve where that spoils it."""
    for presolve in (True, False):
        options: Any = {**_OPTIONS, "time_limit": min(_LONGEST, left()), "presolve": presolve}
        answer = linprog(cost, method="highs", options=options, **program)
        if answer.status != _FAILED:
            break
    return answer
