"""Outer iteration on the friction bound, each step a convex program."""

from solvers.fixed_point.method import FixedPointOptions, solve_fixed_point

__all__ = ["FixedPointOptions", "solve_fixed_point"]
