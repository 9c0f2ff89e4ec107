"""The plate with this package: stresses in equilibrium, the inequality solved directly by the condensed method.

With a degree of displacements also the bracket: bounds of the energy, and of P where it has bounds, with friction
too. The package is loaded by `build`, not before.
"""

from collections.abc import Callable
from functools import cache, partial
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from qvi_contact import ContactProblem
    from qvi_contact.bracket import Bracket
    from qvi_contact.bracket.coulomb import CoulombBounds

TOLERANCE: Final = 1e-8
"""That the certificate must confirm."""

COULOMB: Final = "COULOMB"
"""What is bracketed by bounds under Coulomb friction, beside the names of `BracketKind`."""


def build(
    case: dict[str, Any], degree: int | None = None, bracket: int | None = None, *, adaptive: bool = False
) -> Callable[[], dict[str, Any]]:
    """What solves the plate of a case (see `study.plate`): it discretises, factorises and certifies each time.

    `degree` is that of the stress function on triangles, `bracket` that of the displacements it is bracketed with;
    `adaptive` plates are refined from the mesh of the case on.
    """
    posed = problem(case)
    if adaptive:
        return partial(_refined, posed, degree, 10.0 ** -(2.5 + 0.5 * case["number"]))
    return partial(_solved, posed, degree, bracket)


def problem(case: dict[str, Any]) -> "ContactProblem":
    """The gallery's plate on the mesh of a case."""
    from dataclasses import replace

    from qvi_contact import TriangleMesh

    mesh = TriangleMesh(case["vertices"], case["cells"], case["sides"])
    return replace(_plate(case["friction"]), mesh=mesh)


@cache
def _plate(friction: float) -> "ContactProblem":
    """The gallery's plate on its own mesh, whose conditions and material are those of every mesh."""
    from qvi_contact.gallery import compressed_plate

    return compressed_plate(friction)


def _solved(posed: "ContactProblem", degree: int | None, displacements: int | None) -> dict[str, Any]:
    """As `qvi_contact.solve` does it by default: P/2, unknowns, iterations, the certificate's residual, status."""
    from qvi_contact import solve

    options: dict[str, Any] = {"method": "condensed", "tolerance": TOLERANCE, "threads": 1}
    result = solve(posed, degree=degree, **options)
    answer = ended(
        result, half_force=-result.resultant("plate").y if result.has_state else None,
        unknowns=int(result.solution.problem.n), iterations=int(result.iterations),
    )  # fmt: skip
    if displacements is None or not result.has_state:
        return answer
    from qvi_contact.bracket import bracket

    found = bracket(result, degree=displacements, tolerance=TOLERANCE)
    return {**answer, **_bounds(found, answer["unknowns"])}


def _refined(posed: "ContactProblem", degree: int | None, target: float) -> dict[str, Any]:
    """As `qvi_contact.refine` does it with a guarantee: the bounds of P/2 on the first mesh that has them so close."""
    from qvi_contact import refine

    options: dict[str, Any] = {"degree": degree, "tolerance": TOLERANCE, "threads": 1}
    outcome = refine(posed, None, target, "plate.normal_force", guaranteed=True, **options)
    result = outcome.result
    bounds = _bounds(result.bracket, int(result.solution.problem.n))
    return {**ended(result, iterations=len(outcome.rounds)), **bounds}


def ended(found: Any, **numbers: Any) -> dict[str, Any]:
    """How a solve of this package ended, with these numbers of it, and the certificate's residual."""
    message = "" if found.certificate.passed else found.message
    return {"status": found.status.value, "message": message, **numbers, "residual": float(found.certificate.accuracy)}


def _bounds(found: "Bracket", unknowns: int) -> dict[str, Any]:
    """Bounds instead of a force.

    "lower" and "upper" of P/2, None where P has no bounds; "width", half the gap of the energies over their mean, under
    friction that of the bounds of P/2; "strain_error", the bound of the stress's error in the energy norm, relative;
    "guaranteed" for the problem that "kind" names, a `BracketKind` or `COULOMB`; "unknowns" of
    stress and displacement together.
    """
    from math import isfinite

    moved, coulomb = found.companion, found.coulomb
    bounded = coulomb is not None and isfinite(coulomb.error)
    return {
        "half_force": None,
        "unknowns": unknowns + (0 if moved is None else int(moved.space.size)),
        **(_by_shares(coulomb) if bounded and coulomb is not None else _by_energies(found)),
    }


def _by_shares(coulomb: "CoulombBounds") -> dict[str, Any]:
    """What the bounds under Coulomb friction say."""
    force = coulomb.forces.get("plate.normal_force")
    lower, upper = (None, None) if force is None else (float(force.lower), float(force.upper))
    failure = {} if force is not None else {"status": "no bounds", "message": coulomb.message}
    return {
        "lower": lower,
        "upper": upper,
        "width": None if lower is None or upper is None else (upper - lower) / (upper + lower),
        "strain_error": float(coulomb.relative_error),
        "guaranteed": coulomb.guaranteed,
        "kind": COULOMB,
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
