"""The plate with this package: stresses in equilibrium, the inequality solved directly by the condensed method.

Rectangles have the element of Bogner, Fox and Schmit, triangles that of Hsieh, Clough and Tocher of any degree. With a
degree of displacements also the bracket: bounds of the energy, and of P where it has bounds. The package is loaded by
`build`, not before.
"""

from functools import cache
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from qvi_contact import ContactProblem, ContactResult
    from qvi_contact.discretization.families import ElementName

MODULE: Final = "qvi_contact"

TOLERANCE: Final = 1e-8
"""That the certificate must confirm."""


def build(case: dict[str, Any], degree: int | None = None, bracket: int | None = None) -> "EquilibriumPlate":
    """The plate of a case (see `measure.plate`), ready to be solved.

    `degree` is that of the stress function on triangles, `bracket` that of the displacements it is bracketed with.
    """
    return EquilibriumPlate(problem(case), "hct" if case["lines"] is None else "bfs", degree, bracket)


def problem(case: dict[str, Any]) -> "ContactProblem":
    """The gallery's plate on the mesh of a case."""
    from dataclasses import replace

    from qvi_contact import RectilinearMesh, TriangleMesh

    lines = case["lines"]
    mesh = TriangleMesh(case["vertices"], case["cells"], case["sides"]) if lines is None else RectilinearMesh(*lines)
    return replace(_plate(case["friction"]), mesh=mesh)


@cache
def _plate(friction: float) -> "ContactProblem":
    """The gallery's plate on its own mesh, whose conditions and material are those of every mesh."""
    from qvi_contact.gallery import compressed_plate

    return compressed_plate(friction)


class EquilibriumPlate:
    """A problem; `solve` discretises, factorises and certifies each time."""

    def __init__(
        self, posed: "ContactProblem", element: "ElementName", degree: int | None, bracket: int | None
    ) -> None:
        self._problem = posed
        self._element = element
        self._degree = degree
        self._bracket = bracket

    def solve(self) -> dict[str, Any]:
        """As `qvi_contact.solve` does it by default: P/2, unknowns, iterations, the certificate's residual, status."""
        from qvi_contact import solve

        options: dict[str, Any] = {"method": "condensed", "tolerance": TOLERANCE, "threads": 1}
        result = solve(self._problem, element=self._element, degree=self._degree, **options)
        answer: dict[str, Any] = {
            "status": result.status.value,
            "message": "" if result.certificate.passed else result.message,
            "half_force": -result.resultant("plate").y if result.has_state else None,
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
