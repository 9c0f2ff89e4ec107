"""Experiments on contact problems and their solvers: ``python -m comparisons --help``."""

from solvers.basics.front import front

__getattr__ = front(__name__, {"settled": ("LIMITS", "SETTLED", "UNCERTAINTY")})
