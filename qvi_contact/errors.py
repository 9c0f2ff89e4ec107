"""The project's exceptions, as users of the mechanics package import them.

The tree has one root, `QVIError`, which lives in the lowest package so that every layer can raise from it.
"""

from solvers.errors import InputError, QVIError, SolveError, SolverUnavailableError

__all__ = ["InputError", "QVIError", "SolveError", "SolverUnavailableError"]
