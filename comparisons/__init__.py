"""Experiments on contact problems and their solvers: ``python -m comparisons --help``."""
