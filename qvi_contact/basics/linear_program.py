"""Linear programs by HiGHS, accurate, within the time that is left."""

from typing import Any, Final, Literal, TypeAlias

from qvi_contact.basics.checks import FloatArray
from solvers.basics.watch import left

TIME_LIMIT, INFEASIBLE, UNBOUNDED = 1, 2, 3
"""Status numbers of `linprog`; the first is that of a limit of steps too."""

_FAILED: Final = 4
_LONGEST: Final = 300.0  # seconds
_LARGE: Final = 4000  # rows from which on the simplex method is slower, by more and more
_STEPS: Final = 2000  # of the interior point method with what follows it; usual are 11 to 250, and cycling has no end
_OPTIONS: Final = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
_Attempt: TypeAlias = tuple[Literal["highs", "highs-ipm"], bool]
_SIMPLEX: Final[tuple[_Attempt, ...]] = (("highs", True), ("highs", False))  # with presolve, and without
_INTERIOR: Final[_Attempt] = ("highs-ipm", True)


def solved(cost: FloatArray, **program: Any) -> Any:
    """The answer of `linprog`: by the interior point method with a vertex at its end where the program is large.

    By the simplex method where it is not, and where that fails or cycles; without presolve where presolve spoils it.
    """
    from scipy.optimize import linprog  # slow to import, and few problems need it

    large = program["A_ub"].shape[0] > _LARGE
    for method, presolve in (*[_INTERIOR] * large, *_SIMPLEX):
        interior = (method, presolve) == _INTERIOR
        options: Any = {**_OPTIONS, "time_limit": min(_LONGEST, left()), "presolve": presolve}
        if interior:
            options["maxiter"] = _STEPS
        answer = linprog(cost, method=method, options=options, **program)
        if answer.status != _FAILED and not (interior and answer.status == TIME_LIMIT):
            break
    return answer
