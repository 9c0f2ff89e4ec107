"""The plate by this package: stresses in equilibrium, the default method of `solve`, and bounds of the force."""

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
"""Tolerance of the certificate."""

COULOMB: Final = "COULOMB"
"""Kind of bounds under Coulomb friction, beside the names of `BracketKind`."""

_plate: Final = cache(compressed_plate)
"""μ → the gallery's plate, whose conditions and material are taken for every mesh."""


def plate(
    case: dict[str, Any], degree: int | None = None, bracket: int | None = None, *, adaptive: bool = False
) -> Callable[[], dict[str, Any]]:
    """A function that solves the plate of a case (see `comparisons.peers.study.plate`), anew at each call.

    It calls `qvi_contact.solve` with this `degree`, and returns P/2, unknowns, iterations, the certificate's residual
    and the status. If `bracket` is given, the degree of the displacements, it returns bounds, see `_bounds`. If
    `adaptive`, `qvi_contact.refine` makes the mesh, until the bounds of P/2 are as close as the mesh number requires.
    """
    mesh = TriangleMesh(case["vertices"], case["cells"], case["sides"])
    problem = replace(_plate(case["friction"]), mesh=mesh)
    options: dict[str, Any] = {"degree": degree, "tolerance": TOLERANCE, "threads": 1}

    def solved() -> dict[str, Any]:
        if adaptive:
            target = 10.0 ** -(2.5 + 0.5 * case["number"])
            outcome = refine(problem, None, target, "plate.normal_force", guaranteed=True, **options)
            result, rounds = outcome.result, len(outcome.rounds)
            return {**_ended(result, iterations=rounds), **_bounds(result.bracket, int(result.solution.problem.n))}
        result = solve(problem, **options)
        unknowns = int(result.solution.problem.n)
        force = -result.resultant("plate").y if result.has_state else None
        answer = _ended(result, half_force=force, unknowns=unknowns, iterations=int(result.iterations))
        if bracket is None or not result.has_state:
            return answer
        return {**answer, **_bounds(bracketed(result, degree=bracket, tolerance=TOLERANCE), unknowns)}

    return solved


def _ended(found: Any, **numbers: Any) -> dict[str, Any]:
    """Status and message of a solve, these numbers, and the certificate's residual."""
    message = "" if found.certificate.passed else found.message
    return {"status": found.status.value, "message": message, **numbers, "residual": float(found.certificate.accuracy)}


def _bounds(found: Bracket, unknowns: int) -> dict[str, Any]:
    """Bounds of P/2 and of the stress.

    "lower" and "upper" of P/2, None if P has no bounds; "width", half the difference over the mean of the bounds of P/2
    under friction, of the two energies otherwise; "strain_error", the relative bound of the stress's error in the
    energy norm; "guaranteed" for the problem that "kind" names, a `BracketKind` or `COULOMB`; "unknowns" of stress and
    displacement together.
    """
    moved, coulomb = found.companion, found.coulomb
    of: Any = found if coulomb is None or not isfinite(coulomb.error) else coulomb
    force = of.forces.get("plate.normal_force")
    lower, upper = (None, None) if force is None else (float(force.lower), float(force.upper))
    if coulomb is not None and of is coulomb:  # bounds under Coulomb friction
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
