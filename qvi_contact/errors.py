"""The project's exceptions.

All exceptions derive from `QVIError` of the package `solvers`. This module is the first to import that package, so it
also explains the error if a file of the user is called `solvers`.
"""

import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

try:
    from solvers.errors import InputError, QVIError, SolveError, SolverUnavailableError, UnknownNameError, nearest_first
except ImportError as error:
    _taken = getattr(sys.modules.get("solvers"), "__file__", None)
    if _taken is None:
        raise
    _remedy = "Rename that file or folder, or start Python elsewhere or with -P; docs/installation.md says more."
    _message = f"'solvers' is {_taken}, not the package that comes with qvi_contact. {_remedy}"
    raise ImportError(_message, name="solvers", path=_taken) from error

__all__ = [
    "InputError", "QVIError", "SolveError", "SolverUnavailableError", "UnknownNameError", "place_of",
    "refuse_arguments",
]  # fmt: skip


def place_of(point: Iterable[float]) -> str:
    """The text of a point (x, y) in messages, with nine digits."""
    x, y = map(float, point)
    return f"({x:.9g}, {y:.9g})"


def refuse_arguments(given: Mapping[str, Any], known: Sequence[str]) -> None:
    """`InputError` with the remedy for an argument that is not known."""
    for name, value in given.items():
        raise InputError(name, value, nearest_first(name, known, f"the options here are {', '.join(known)}"))
