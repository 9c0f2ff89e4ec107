"""Outer iteration on the friction bound, each step a convex program."""

from solvers.basics.front import front
from solvers.fixed_point.method import FixedPointOptions, solve_fixed_point

__all__ = ["FixedPointOptions", "solve_fixed_point"]

__getattr__ = front(
    __name__,
    {
        "forms": ("CondensedForm", "Simplified"),
    },
)
