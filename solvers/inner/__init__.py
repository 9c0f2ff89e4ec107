"""Back ends for the inner problem: the QVI with the friction bound given."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "linear_program": ("solved", "BackendFailure", "attempt", "within_time"),
        "problem": ("Centre", "InnerSolution", "no_result"),
        "registry": ("make_inner",),
        "socp": ("SOCPSolver",),
    },
)
