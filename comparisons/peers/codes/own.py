"""Our own package: stresses in equilibrium, the inequality solved directly by its default method, and its bounds."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from math import isfinite
from typing import Any, Final

from qvi_contact import TriangleMesh, refine, solve
from qvi_contact.bracket import Bracket
from qvi_contact.bracket import bracket as bracketed
from qvi_contact.gallery import compressed_plate

TOLERANCE: Final = 1e-8
"""That the certificate must confirm."""

COULOMB: Final = "COULOMB"
"""What is bracketed by bounds under Coulomb friction, beside the names of `BracketKind`."""

_plate: Final = cache(compressed_plate)
"""By μ the gallery's plate on its own mesh, whose conditions and material are those of every mesh."""


def plate(
    case: dict[str, Any], degree: int | None = None, bracket: int | None = None, *, adaptive: bool = False
) -> Callable[[], dict[str, Any]]:
    """What solves the plate of a case (see `comparisons.peers.study.plate`), all from the problem on each time.

    As `qvi_contact.solve` does it by default with stresses of this `degree`: P/2, unknowns, iterations, the
    certificate's residual, status. With the degree `bracket` of displacements bounds instead, see `_bounds`. Where the
    mesh is `adaptive`, `qvi_contact.refine` makes it until the bounds of P/2 are as close as the number asks for.
    """
    mesh = TriangleMesh(case["vertices"], case["cells"], case["sides"])
    posed = replace(_plate(case["friction"]), mesh=mesh)
    options: dict[str, Any] = {"degree": degree, "tolerance": TOLERANCE, "threads": 1}

    def solved() -> dict[str, Any]:
        if adaptive:
            target = 10.0 ** -(2.5 + 0.5 * case["number"])
            outcome = refine(posed, None, target, "plate.normal_force", guaranteed=True, **options)
            result, rounds = outcome.result, len(outcome.rounds)
            return {**_ended(result, iterations=rounds), **_bounds(result.bracket, int(result.solution.problem.n))}
        result = solve(posed, **options)
        unknowns = int(result.solution.problem.n)
        force = -result.resultant("plate").y if result.has_state else None
        answer = _ended(result, half_force=force, unknowns=unknowns, iterations=int(result.iterations))
        if bracket is None or not result.has_state:
            return answer
        return {**answer, **_bounds(bracketed(result, degree=bracket, tolerance=TOLERANCE), unknowns)}

    return solved


def _ended(found: Any, **numbers: Any) -> dict[str, Any]:
    """How a solve ended, with these numbers of it, and the certificate's residual."""
    message = "" if found.certificate.passed else found.message
    return {"status": found.status.value, "message": message, **numbers, "residual": float(found.certificate.accuracy)}


def _bounds(found: Bracket, unknowns: int) -> dict[str, Any]:
    """Bounds instead of a force.

    "lower" and "upper" of P/2, None where P has no bounds; "width", half the gap of the energies over their mean, under
    friction that of the bounds of P/2; "strain_error", the bound of the stress's error in the energy norm, relative;
    "guaranteed" for the problem that "kind" names, a `BracketKind` or `COULOMB`; "unknowns" of
    stress and displacement together.
    """
    moved, coulomb = found.companion, found.coulomb
    of: Any = found if coulomb is None or not isfinite(coulomb.error) else coulomb
    force = of.forces.get("plate.normal_force")
    lower, upper = (None, None) if force is None else (float(force.lower), float(force.upper))
    if coulomb is not None and of is coulomb:  # by the share of friction that is used
        width = None if lower is None or upper is None else (upper - lower) / (upper + lower)
        failed, reason, kind = force is None, coulomb.message, COULOMB
    else:  # by the two energies
        width, kind = float(found.gap / abs(found.lower + found.upper)), found.kind.name
        failed, reason = not isfinite(found.gap), " ".join(found.reasons) or found.message
    return {
        "half_force": None, "unknowns": unknowns + (0 if moved is None else int(moved.space.size)), "lower": lower,
        "upper": upper, "width": width, "strain_error": float(of.relative_error), "guaranteed": of.guaranteed,
        "kind": kind, **({"status": "no bounds", "message": reason} if failed else {}),
    }  # fmt: skip
