"""The plate with this package: stresses in equilibrium, the inequality solved directly by the condensed method.

Rectangles have the element of Bogner, Fox and Schmit, triangles that of Hsieh, Clough and Tocher of any degree. With a
degree of displacements also the bracket: bounds of the energy, and of P where it has bounds, on triangles under slip
too. The package is loaded by `build`, not before.
"""

from functools import cache
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from qvi_contact import ContactProblem
    from qvi_contact.bracket import Bracket
    from qvi_contact.bracket.slip import SlipBounds
    from qvi_contact.discretization.families import ElementName

MODULE: Final = "qvi_contact"

TOLERANCE: Final = 1e-8
"""That the certificate must confirm."""

ONE_SENSE: Final = "ONE_SENSE"
"""What is bracketed by bounds under Coulomb slip, beside the names of `BracketKind`."""


def build(
    case: dict[str, Any], degree: int | None = None, bracket: int | None = None, *, adaptive: bool = False
) -> "EquilibriumPlate | AdaptivePlate":
    """The plate of a case (see `measure.plate`), ready to be solved.

    `degree` is that of the stress function on triangles, `bracket` that of the displacements it is bracketed with;
    `adaptive` plates are refined from the mesh of the case on.
    """
    posed = problem(case)
    if adaptive:
        return AdaptivePlate(posed, degree, 10.0 ** -(2.5 + 0.5 * case["number"]))
    return EquilibriumPlate(posed, "hct" if case["lines"] is None else "bfs", degree, bracket)


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
        from qvi_contact.bracket import bracket

        found = bracket(result, degree=self._bracket, tolerance=TOLERANCE)
        return {**answer, **_bounds(found, answer["unknowns"])}


class AdaptivePlate:
    """A problem whose mesh is bisected until the bounds of P/2 are within a target; each `solve` begins anew."""

    def __init__(self, posed: "ContactProblem", degree: int | None, target: float) -> None:
        self._problem = posed
        self._degree = degree
        self._target = target

    def solve(self) -> dict[str, Any]:
        """As `qvi_contact.refine` does it with a guarantee: the bounds on the last mesh, after all rounds."""
        from qvi_contact import refine

        options: dict[str, Any] = {"element": "hct", "degree": self._degree, "tolerance": TOLERANCE, "threads": 1}
        quantity = "plate.normal_force"
        outcome = refine(self._problem, None, self._target, quantity, guaranteed=True, **options)
        result = outcome.result
        return {
            "status": result.status.value,
            "message": "" if result.certificate.passed else result.message,
            "iterations": len(outcome.rounds),
            "residual": float(result.certificate.accuracy),
            **_bounds(result.bracket, int(result.solution.problem.n)),
        }


def _bounds(found: "Bracket", unknowns: int) -> dict[str, Any]:
    """Bounds instead of a force.

    "lower" and "upper" of P/2, None where P has no bounds; "width", half the gap of the energies over their mean, under
    slip that of the bounds of P/2; "strain_error", the bound of the stress's error in the energy norm, relative;
    "guaranteed", and "kind": the name of the `BracketKind`, which problem is bracketed, or `ONE_SENSE`; "unknowns" of
    stress and displacement together.
    """
    from math import isfinite

    moved, slip = found.companion, found.slip
    slips = slip is not None and isfinite(slip.error) and not found.guaranteed
    return {
        "half_force": None,
        "unknowns": unknowns + (0 if moved is None else int(moved.space.size)),
        **(_by_slip(slip) if slips and slip is not None else _by_energies(found)),
    }


def _by_slip(slip: "SlipBounds") -> dict[str, Any]:
    """What the bounds under slip in one sense say."""
    force = slip.forces.get("plate.normal_force")
    lower, upper = (None, None) if force is None else (float(force.lower), float(force.upper))
    failure = {} if force is not None else {"status": "no bounds", "message": slip.message}
    return {
        "lower": lower,
        "upper": upper,
        "width": None if lower is None or upper is None else (upper - lower) / (upper + lower),
        "strain_error": float(slip.relative_error),
        "guaranteed": slip.guaranteed,
        "kind": ONE_SENSE,
        **failure,
    }


def _by_energies(found: "Bracket") -> dict[str, Any]:
    """What the two energies say."""
    from math import isfinite

    force = found.forces.get("plate.normal_force")
    reasons = " ".join(found.reasons) or found.message
    failure = {} if isfinite(found.gap) else {"status": "no bounds", "message": reasons}
    return {
        "lower": None if force is None else float(force.lower),
        "upper": None if force is None else float(force.upper),
        "width": float(found.gap / abs(found.lower + found.upper)),
        "strain_error": float(found.relative_error),
        "guaranteed": found.guaranteed,
        "kind": found.kind.name,
        **failure,
    }
