"""The paper's plate: printed numbers, the computations beside them, and the report."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "reference": ("load",),
        "study": (
            "PICTURES", "TABLES", "back_end_rows", "contact_tractions", "figure_rows", "principal_stresses",
            "run", "step_count", "table_1", "table_rows", "values_of", "verdict", "write",
        ),
    },
)  # fmt: skip
