"""The plate with this package's displacement model: elements Q_p, condensed to the contact forces.

The package is loaded by `build`, not before.
"""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from qvi_contact import ContactProblem


def build(case: dict[str, Any], degree: int = 2) -> Callable[[], dict[str, Any]]:
    """What solves the plate of a case (see `study.plate`): it assembles and factorises each time."""
    from comparisons.peers.codes.equilibrium import problem

    return partial(_solved, problem(case), degree)


def _solved(problem: "ContactProblem", degree: int) -> dict[str, Any]:
    """As `solve_companion` does it by default: P/2, unknowns, iterations, the certificate's residual, status."""
    from comparisons.peers.codes.equilibrium import TOLERANCE, ended
    from qvi_contact.companion import solve_companion

    found = solve_companion(problem, degree=degree, tolerance=TOLERANCE)
    held = sum(degree * (len(lines) - 1) + 1 for lines in (problem.grid.x, problem.grid.y))  # of the lines of symmetry
    return ended(
        found, half_force=float(found.contacts["plate"].normal_force) if found.has_state else None,
        unknowns=int(found.space.size) - held,
        iterations=0 if found.solution is None else int(found.solution.iterations),
    )  # fmt: skip
