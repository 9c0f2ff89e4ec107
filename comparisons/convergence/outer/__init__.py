"""Convergence of the outer loops on the friction bound, beside the condensed method that needs none."""
