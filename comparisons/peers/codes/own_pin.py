"""The loaded pin with this package, on the same triangles: stresses of degree p − 2.

The package is loaded by `build`, not before.
"""

from typing import Any, Final

MODULE: Final = "qvi_contact"

TOLERANCE: Final = 1e-8
"""That the certificate must confirm."""


def build(case: dict[str, Any], degree: int = 4) -> "EquilibriumPin":
    """The pin of a case (see `comparisons.peers.pin.study.plain_pin`), ready to be solved."""
    return EquilibriumPin(case, degree)


class EquilibriumPin:
    """A problem; `solve` assembles and factorises each time."""

    def __init__(self, case: dict[str, Any], degree: int) -> None:
        from qvi_contact.gallery import loaded_pin

        self._problem, self._degree = loaded_pin(case["sectors"], case["friction"]), degree
        self._radius, self._traction = case["radius"], case["traction"]

    def solve(self) -> dict[str, Any]:
        """What `comparisons.peers.pin.study.MEASURED` names, unknowns, the certificate's residual, status."""
        from qvi_contact import solve

        found = solve(self._problem, degree=self._degree, tolerance=TOLERANCE)
        answer: dict[str, Any] = {
            "status": found.status.value,
            "message": "" if found.certificate.passed else found.message,
            "unknowns": int(found.solution.problem.n) if found.solution is not None else None,
            "iterations": int(found.solution.iterations) if found.solution is not None else 0,
            "residual": float(found.certificate.accuracy),
        }
        return answer | self._measured(found) if found.has_state else answer

    def _measured(self, found: Any) -> dict[str, float]:
        hole = found.contacts["pin"]
        return {
            "moved": float(found.displacement(self._radius, 0.0)[0]),
            "normal": -float(hole.weights @ hole.normal_stress),
            "shear": -float(hole.weights @ hole.tangential_stress),
            "carried": -float(found.resultant("wall").x),
        }
