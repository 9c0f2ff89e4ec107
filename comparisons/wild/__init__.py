"""Contact problems as wild as users may make them, what becomes of each, and whether what is called solved is true."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "bodies": ("Dice",),
        "enumeration": ("EXISTS", "NONE", "enumerated"),
        "generator": ("FAMILIES", "wild_problem"),
        "judge": ("wrong",),
        "report": ("ORDER", "counts_of", "problems_of", "values_of"),
        "study": ("ACCEPTED", "FOREIGN", "INFEASIBLE", "OPEN", "REFUSED", "SOLVED", "declared", "solve_case"),
    },
)
