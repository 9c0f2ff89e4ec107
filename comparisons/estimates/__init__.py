"""How often the error that `refine` estimates is the error of its answer, over generated problems on triangles."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "measures": ("runs_of", "values_of"),
        "problems": ("stated",),
        "study": ("EACH", "declared", "solve_case"),
    },
)
