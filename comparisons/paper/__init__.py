"""The paper's plate: printed numbers, the computations beside them, and the report."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "figures": ("contact_tractions", "convergence", "principal_stresses", "table_1"),
        "reference": ("load",),
        "report": (
            "PICTURES", "TABLES", "as_document", "back_end_rows", "figure_rows", "table_rows", "values_of", "verdict",
            "write",
        ),
        "study": ("run", "step_count"),
    },
)  # fmt: skip
