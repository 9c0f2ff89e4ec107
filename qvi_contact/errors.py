"""The project's exceptions, as users of the mechanics package import them.

The tree has one root, `QVIError`, which lives in the lowest package so that every layer can raise from it. This is also
the first module that needs the package `solvers`, a name that a file of the user's may have taken.
"""

import sys

try:
    from solvers.errors import InputError, QVIError, SolveError, SolverUnavailableError, UnknownNameError
except ImportError as error:
    _taken = getattr(sys.modules.get("solvers"), "__file__", None)
    if _taken is None:
        raise
    _remedy = "Rename that file or folder, or start Python elsewhere or with -P; docs/installation.md says more."
    _message = f"'solvers' is {_taken}, not the package that comes with qvi_contact. {_remedy}"
    raise ImportError(_message, name="solvers", path=_taken) from error

__all__ = ["InputError", "QVIError", "SolveError", "SolverUnavailableError", "UnknownNameError"]
