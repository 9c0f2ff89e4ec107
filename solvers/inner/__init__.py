"""Back ends for the inner problem: the QVI with the friction bound given."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "direct_clarabel": ("DirectClarabel",),
        "guard": ("BackendFailure", "attempt", "within_time"),
        "linear_program": ("solved",),
        "problem": ("Centre", "InnerProblem", "InnerSolution", "no_result"),
        "qp": ("QPSolver",),
        "registry": ("make_inner",),
        "socp": ("SOCPSolver", "square_root"),
    },
)
