"""Convergence of the outer loops on the friction bound, beside the condensed method that needs none."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "report": ("on_meshes", "runs_of", "solution_found", "tables_of", "values_of"),
        "study": ("LOOPS", "run", "study_of"),
    },
)
