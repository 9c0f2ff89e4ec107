"""The data of the inequality (D2), its linear algebra, and the residuals of its laws."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "contact": ("ContactMatrices", "interface_of"),
        "problem": ("FrictionQVI", "Law", "Compliance"),
        "rows": ("dense", "echelon", "independent_rows"),
        "body": ("EnergyRoot", "Loads", "Stiffness"),
        "traces": ("TractionFactor", "trace_coordinates"),
    },
)
