"""The plate with this package's displacement model: elements Q_p, condensed to the contact forces.

The package is loaded by `build`, not before.
"""

from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from qvi_contact import ContactProblem

MODULE: Final = "qvi_contact"

TOLERANCE: Final = 1e-8
"""That the certificate of the contact forces must confirm."""


def build(case: dict[str, Any], degree: int = 2) -> "CompanionPlate":
    """The plate of a case (see `measure.plate`), ready to be solved."""
    from comparisons.peers.codes.equilibrium import problem

    return CompanionPlate(problem(case), degree)


class CompanionPlate:
    """A problem; `solve` assembles and factorises each time."""

    def __init__(self, problem: "ContactProblem", degree: int) -> None:
        self._problem = problem
        self._degree = degree

    def solve(self) -> dict[str, Any]:
        """As `solve_companion` does it by default: P/2, unknowns, iterations, the certificate's residual, status."""
        from qvi_contact.companion import solve_companion

        found = solve_companion(self._problem, degree=self._degree, tolerance=TOLERANCE)
        held = sum(self._degree * (len(lines) - 1) + 1 for lines in (self._problem.grid.x, self._problem.grid.y))
        return {
            "status": found.status.value,
            "message": "" if found.certificate.passed else found.message,
            "half_force": float(found.contacts["plate"].normal_force) if found.has_state else None,
            "unknowns": int(found.space.size) - held,  # of the two lines of symmetry
            "iterations": 0 if found.solution is None else int(found.solution.iterations),
            "residual": float(found.certificate.accuracy),
        }
