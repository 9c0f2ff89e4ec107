"""The project's exceptions; names of version 0.1 that were retired, each with its replacement.

All exceptions derive from `QVIError` of the package `solvers`. This module is the first to import that package, so it
also explains the error if a file of the user is called `solvers`.
"""

import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

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
    "RETIRED", "InputError", "QVIError", "SolveError", "SolverUnavailableError", "UnknownNameError", "place_of",
    "refuse_arguments", "refuse_retired",
]  # fmt: skip

RETIRED: Final = {
    "RectilinearMesh": "was retired in version 0.2: give its lines and cells to TriangleMesh.grid, or take "
    "TriangleMesh.rectangle",
    "triangulated": "was retired in version 0.2: grids have triangles from the start, so leave the call out",
    "on_lines": "was retired in version 0.2: give other lines to TriangleMesh.grid, or take refine",
    "refined": "was retired in version 0.2: take refine(problem, target=…), or refined and graded of the mesh",
    "element": "was retired in version 0.2: there is one element, on triangles, into which grids are cut; leave it out",
    "contact_rows": "was renamed in version 0.2: give law_on='edges' for 'bernstein', 'points' for 'gauss'",
    "refined_where_apart": "was retired in version 0.2: call refine(problem, quantity='energy'), or bisect what holds "
    "most of result.bracket.cell_gaps by the mesh's own refined",
    "exact": "was retired in version 0.2: its states are in qvi_contact.gallery",
    "stream_sweep": "was retired in version 0.2: call solve_sweep(problem, parameter, values, of, store=FILE)",
}
"""Retired names of classes, methods, arguments and options, and the remedy for each."""


def place_of(point: Iterable[float]) -> str:
    """The text of a point (x, y) in messages, with nine digits."""
    x, y = map(float, point)
    return f"({x:.9g}, {y:.9g})"


def refuse_retired(name: str) -> None:
    """`InputError` with the remedy if this name was retired."""
    if name in RETIRED:
        raise InputError("name", name, RETIRED[name])


def refuse_arguments(given: Mapping[str, Any], known: Sequence[str]) -> None:
    """`InputError` with the remedy for an argument that was retired or is not known."""
    for name, value in given.items():
        remedy = nearest_first(name, known, f"the options here are {', '.join(known)}")
        raise InputError(name, value, RETIRED.get(name, remedy))
