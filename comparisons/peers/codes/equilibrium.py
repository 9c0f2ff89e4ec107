"""The plate with this package: stresses in equilibrium, the inequality solved directly by the condensed method.

With a degree of displacements also the bracket: bounds of the energy, and of P where it has bounds. The package is
loaded by `build`, not before.
"""

from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from qvi_contact import ContactResult, Discretization

MODULE: Final = "qvi_contact"

TOLERANCE: Final = 1e-8
"""That the certificate must confirm."""


def build(case: dict[str, Any], bracket: int | None = None) -> "EquilibriumPlate":
    """The plate of a case (see `cases`), ready to be solved, and to be bracketed with displacements of that degree."""
    from qvi_contact import discretize
    from qvi_contact.gallery import compressed_plate

    cells = (case["cells"], case["cells"])
    problem = compressed_plate(case["friction"], cells, grading=case["grading"])
    return EquilibriumPlate(discretize(problem), bracket)


class EquilibriumPlate:
    """A discretisation that is solved once; another solve would find what the first has factorised."""

    def __init__(self, discretization: "Discretization", bracket: int | None) -> None:
        self._discretization = discretization
        self._bracket = bracket

    def solve(self) -> dict[str, Any]:
        """As `qvi_contact.solve` does it by default: P/2, unknowns, iterations, the certificate's residual, status."""
        from qvi_contact import solve

        with self._discretization.qvi.operator.using("auto", 1):
            fitted = self._discretization.fitted()
        result = solve(fitted, method="condensed", tolerance=TOLERANCE, threads=1)
        answer: dict[str, Any] = {
            "status": result.status.value,
            "message": "" if result.certificate.passed else result.message,
            "half_force": float(result.contacts["plate"].normal_force) if result.has_state else None,
            "unknowns": int(result.solution.problem.n),
            "iterations": int(result.iterations),
            "residual": float(result.certificate.accuracy),
        }
        if self._bracket is None or not result.has_state:
            return answer
        return {**answer, **_bounds(result, self._bracket, answer["unknowns"])}


def _bounds(result: "ContactResult", degree: int, unknowns: int) -> dict[str, Any]:
    """Bounds instead of a force.

    "lower" and "upper" of P/2, None where P has no bounds; "width", half the gap of the energies over their mean;
    "strain_error", the bound of the stress's error in the energy norm, relative; "guaranteed", and "kind", the name of
    the `BracketKind`, which problem is bracketed; "unknowns" of stress and displacement together.
    """
    from math import isfinite

    from qvi_contact.bracket import bracket

    found = bracket(result, degree=degree, tolerance=TOLERANCE)
    force = found.forces.get("plate.normal_force")
    moved = found.companion
    reasons = " ".join(found.reasons) or found.message
    failure = {} if isfinite(found.gap) else {"status": "no bounds", "message": reasons}
    return {
        "half_force": None,
        "unknowns": unknowns + (0 if moved is None else int(moved.space.size)),
        "lower": None if force is None else float(force.lower),
        "upper": None if force is None else float(force.upper),
        "width": float(found.gap / abs(found.lower + found.upper)),
        "strain_error": float(found.relative_error),
        "guaranteed": found.guaranteed,
        "kind": found.kind.name,
        **failure,
    }
