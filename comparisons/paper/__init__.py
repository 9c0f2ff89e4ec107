"""The paper's plate: printed numbers, the computations beside them, and the report."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "reference": ("load",),
        "report": (
            "PICTURES", "TABLES", "back_end_rows", "contact_tractions", "convergence", "figure_rows",
            "principal_stresses", "table_1", "table_rows", "values_of", "verdict", "write",
        ),
        "study": ("run", "step_count"),
    },
)  # fmt: skip
