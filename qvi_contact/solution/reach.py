"""Obstacles out of reach: solve as if they stood nearer, and again where they are if the body gets there.

See `Scales.reach`. An obstacle that was moved closer has been reached where a pressure on it is more than the
certificate would take for none. Multipliers tell less: where rows depend on each other single ones may be zero.
"""

from typing import Any

from qvi_contact.discretization.contact_rows import joined
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.solution.result import ContactResult
from solvers import QVISolution, solve_qvi


def solve_within_reach(discretization: Discretization, settings: dict[str, Any]) -> ContactResult:
    """Solve a discretisation; `settings` are those of `solve_qvi`."""
    result = ContactResult(discretization, solve_qvi(discretization.qvi, **settings))
    if not _reached(discretization, result.solution):
        return result
    everywhere = discretization.everywhere()
    return ContactResult(everywhere, solve_qvi(everywhere.qvi, **settings))


def _reached(discretization: Discretization, solution: QVISolution) -> bool:
    """Whether the body presses on an obstacle that stands farther away than it was taken to be."""
    moved = joined([rows.beyond for rows in discretization.contacts if rows.law != "tied"]) > 0.0
    certificate = solution.certificate
    if not moved.any() or not certificate.scales:  # nothing was measured, as there is no state
        return False
    pressure = -solution.problem.normal(solution.z)[moved]
    return bool(pressure.max() > certificate.tolerance * certificate.scales["stress"])
