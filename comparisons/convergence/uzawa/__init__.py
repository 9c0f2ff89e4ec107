"""The iteration of Uzawa of Więckowski (1992): how large its steps may be, and how many it takes."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "report": ("growth", "paper_runs", "runs_of", "tables_of", "values_of"),
        "study": ("Extent", "NEAR", "SEARCHED", "STILL", "run", "study_of"),
    },
)
